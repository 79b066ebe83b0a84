"""Lines that the sides of cells lie on: the rim, levels of fields, fillets and the outlines of other passes."""

import numpy as np
import pytest

import dsfab
from dsfab.preset.file import with_overrides
from dsfab.slicing import Sheet, cut, improve_cells, resolve_pinches
from dsfab.slicing.cutting.sheet import LineKind
from dsfab.slicing.finishing.fairing import faired_walls
from dsfab.slicing.finishing.fillets import rounded_corners
from dsfab.slicing.finishing.least_widths import bridged_necks
from dsfab.slicing.finishing.opening_corners import CHORD
from dsfab.slicing.measures.lines import edge_lines, outline_corners
from dsfab.surface import Surface
from tests.presets import BARREL_VAULT_MODES, DOME_MODES
from tests.shapes import ZOO, grid, zoo
from tests.slicing.striped_balls import openings, striped_ball
from tests.slicing.stripes import LEVELS, dumbbell, plain, regauged, ripples, striped, widths


def fillets(sheet: Sheet) -> np.ndarray:
    """(f, 7) centre, unit axis and radius of each fillet, metres."""
    return sheet.lines.circle[sheet.lines.kind == LineKind.FILLET]


def outline(sheet: Sheet) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lines (k,), and first and last vertices (k,), of the outline of a material sheet, after a check of its labels.

    Every half-edge of the outline has a line, and no other half-edge has one.
    """
    edges, sides_on = sheet.surface.edges, sheet.sides_on.ravel()
    half_edge = edges.order[edges.start[:-1][edges.boundary]]
    assert np.array_equal(np.flatnonzero(sides_on), np.sort(half_edge))
    start, end = sheet.surface.F.ravel(), np.roll(sheet.surface.F, -1, axis=1).ravel()
    return sides_on[half_edge], start[half_edge], end[half_edge]


def check_rim(surface: Surface, sheet: Sheet) -> None:
    """The rim is the uncut boundary between the material, and nothing else."""
    line, start, end = outline(sheet.subset())
    X, material = sheet.subset().surface.V, sheet.material
    rim = sheet.lines.kind[line] == LineKind.RIM
    edges = sheet.surface.edges
    half_edge = edges.order[edges.start[:-1][edges.boundary]]
    half_edge = half_edge[material[half_edge // 3]]
    a, b = (ends.ravel()[half_edge] for ends in (sheet.surface.F, np.roll(sheet.surface.F, -1, axis=1)))
    expected = {tuple(x) for x in np.hstack([sheet.surface.V[a], sheet.surface.V[b]]).tolist()}
    assert {tuple(x) for x in np.hstack([X[start[rim]], X[end[rim]]]).tolist()} == expected
    assert surface.is_closed == (not expected) or not material.all()


@zoo
@pytest.mark.parametrize("snap", [0.0, 0.1])
def test_edges_of_stripes_lie_on_their_levels(name, snap):
    """The outline of a cut is its levels, within the snap, and the rim."""
    surface = ZOO[name]()
    V = surface.V / surface.size
    fields = [V @ [1.0, 0.2, 0.3], V @ [-0.2, 0.9, 0.5]]
    levels = [np.linspace(x.min(), x.max(), 10)[1:-1] for x in fields]
    sheet = cut(surface, fields, levels, snap)
    check_rim(surface, sheet)
    material = sheet.subset()
    line, start, end = outline(material)
    assert set(material.lines.kind[line]) <= {LineKind.LEVEL, LineKind.RIM}
    for k, (x, steps) in enumerate(zip(fields, levels, strict=True)):
        on_level = material.lines.field[line] == k
        value = steps[material.lines.number[line[on_level]]]
        off = snap * np.abs(np.diff(x[surface.edges.ends], axis=1)).max()
        for vertex in (start, end):
            assert material.carry(x)[vertex[on_level]] == pytest.approx(value, abs=off + 1e-9)


@zoo
@pytest.mark.parametrize("kind", ["even", "tips"])
def test_both_edges_of_a_stripe_of_varying_width_are_known(name, kind):
    surface = ZOO[name]()
    x = plain(ripples(surface, 1), widths(surface, kind, 1))
    sheet = cut(surface, [x], [LEVELS], snap=0.0)
    material = sheet.subset()
    line, start, end = outline(material)
    level = material.lines.kind[line] == LineKind.LEVEL
    stripe, side = np.divmod(material.lines.number[line[level]], 2)
    for vertex in (start[level], end[level]):
        assert material.carry(x)[vertex, side] == pytest.approx(LEVELS[stripe], abs=1e-6)
    check_rim(surface, sheet)


@zoo
def test_stripes_of_a_corner_field_have_the_same_edges_as_plain_ones(name):
    surface = ZOO[name]()
    z, d = ripples(surface, 2), widths(surface, "even", 2)
    sheets = [cut(surface, [field], [LEVELS], snap=0.0) for field in (plain(z, d), regauged(surface, z, d, 5))]
    kinds = [np.bincount(sheet.lines.kind[outline(sheet.subset())[0]], minlength=8) for sheet in sheets]
    assert kinds[0].tolist() == kinds[1].tolist()


@zoo
@pytest.mark.parametrize(("seed", "snap"), [(0, 0.0), (7, 0.1), (10, 0.1)])
def test_improved_cells_and_pieces_of_a_sheet_keep_their_lines(name, seed, snap):
    surface = ZOO[name]()
    sheet = improve_cells(faired_walls(striped(surface, seed, snap)), surface, 0.1 * surface.mean_edge).sheet
    check_rim(surface, sheet)
    material = sheet.subset()
    first = material.subset(np.arange(material.surface.m) < material.surface.m // 2)
    line = outline(first)[0]
    before = {(*x, *y): k for k, x, y in zip(*_places(material), strict=True)}
    after = {(*x, *y): k for k, x, y in zip(*_places(first), strict=True)}
    assert len(after) == len(line)
    assert all(before.get(place, LineKind.END) == k for place, k in after.items())


def _places(sheet: Sheet) -> tuple[list, list, list]:
    line, start, end = outline(sheet)
    return line.tolist(), sheet.surface.V[start].tolist(), sheet.surface.V[end].tolist()


@pytest.mark.parametrize("radius", [0.01, 0.04])
def test_fillets_of_a_plate_are_known_with_their_circles(radius):
    sheet, found = rounded_corners(openings(grid(17, 17, 1.0, 1.0)), radius)
    check_fillets(sheet, found, len(found))


def test_fillets_of_a_ball_are_known_with_their_circles():
    _, sheet = striped_ball(4.0, 0.3, 1)
    sheet, found = rounded_corners(sheet, 0.05)
    check_fillets(sheet, found, len(found))


def check_fillets(sheet: Sheet, radii: np.ndarray, count: int) -> None:
    """Chords of the arcs end at their circle, and stray from it by the height of the arc at most."""
    material = sheet.subset()
    line, start, end = outline(material)
    kind, circle = material.lines.kind[line], material.lines.circle[line]
    fillet = kind == LineKind.FILLET
    assert len(fillets(material)) == count == len(np.unique(line[fillet]))
    assert sorted(fillets(material)[:, 6]) == pytest.approx(sorted(radii))
    middle, axis, radius = circle[fillet, :3], circle[fillet, 3:6], circle[fillet, 6]
    for vertex in (start[fillet], end[fillet]):
        away = material.surface.V[vertex] - middle
        away -= np.einsum("ki,ki->k", away, axis)[:, None] * axis
        share = np.linalg.norm(away, axis=1) / radius
        assert share.min() >= np.cos(CHORD / 2) - 5e-3
        assert share.max() <= 1 + 5e-3


@pytest.mark.parametrize("preset", [DOME_MODES, BARREL_VAULT_MODES])
def test_a_design_notes_as_many_fillets_as_its_sheet_knows(preset):
    edits = {"pattern.fillet": 0.05}
    design = dsfab.run(with_overrides(dsfab.load_preset(preset), edits))
    outline(design.sheet)
    note = next(text for _, text in design.notes if "corners of openings were rounded" in text)
    assert int(note.split()[0].replace(",", "")) == len(fillets(design.sheet))


def test_bridges_and_discs_are_known():
    done, count = bridged_necks(dumbbell(grid(40, 40, 1.0, 1.0), 0.004), 0.05)
    assert count
    assert LineKind.STRIP in done.lines.kind[outline(done.subset())[0]]
    plate = grid(16, 16, 1.0, 1.0)
    checks = cut(plate, [plate.V[:, 0], plate.V[:, 1]], [[0.5], [0.5]], snap=0.0)
    family = np.where((plate.V[plate.F].mean(axis=1)[checks.parent, :2] > 0.5).sum(axis=1) == 1, 0, -1)
    joined = resolve_pinches(Sheet(checks.surface, checks.parent, family, checks.weights), 0.05).sheet
    line = outline(joined.subset())[0]
    assert LineKind.DISC in joined.lines.kind[line]
    assert LineKind.END in joined.lines.kind[line]  # a sheet from arrays knows no lines


def test_both_ends_of_a_fillet_are_corners_of_the_outline():
    """Nine square openings with four fillets each: 72 ends of fillets, and no corner inside a fillet or a wall."""
    plate = grid(17, 17, 1.0, 1.0)
    sheet, radii = rounded_corners(openings(plate), 0.04)
    corners = outline_corners(sheet.subset())
    inside = corners[(np.abs(corners[:, :2] - 0.5) < 0.5).all(axis=1)]
    assert len(inside) == 2 * len(radii) == 72
    lines = [line for line in edge_lines(sheet.subset(), plate, ["a", "b"], [None, None]) if not line.is_closed]
    lengths = np.array([line.length for line in lines])
    fillet = lengths < np.pi / 2 * 0.04
    assert fillet.sum() == 36
    assert lengths[fillet] == pytest.approx(3 * 2 * 0.04 * np.sin(np.pi / 12), rel=1e-6)  # three chords of 30 degrees
    assert lengths[~fillet] == pytest.approx(0.2 - 2 * 0.04, rel=1e-6)
