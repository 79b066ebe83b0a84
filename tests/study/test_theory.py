"""What the theory of thin sheets leaves out: ribs that twist as bars, shear, the term that is told, and its table."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dsfab
from dsfab.slicing.cutting.sheet import SmoothSurface, meshes
from dsfab.statics import (
    Material,
    SheetMaterial,
    SpreadLoad,
    equilibria,
    rib_shape,
    sheet_stiffness,
    sheet_stress,
    torsion_share,
    with_barlike_ribs,
)
from dsfab.study.verdict import LoadedSurface, check, whole_sheet
from dsfab.study.verdict.calibration import TABLE
from dsfab.study.verdict.levels import MAIN_ELEMENTS, level, rib_softening, shares
from dsfab.study.verdict.verdict import attached_material
from dsfab.surface import LoadCase, Surface
from tests.benchmarks.solid_designs import LATER, NAMED, drawn_design, segment
from tests.benchmarks.solid_truth import limit, read
from tests.benchmarks.solid_wedges import solid_compliance
from tests.calculix import needs_ccx
from tests.shapes import glued, grid, jittered, sphere, windows

SOFT = Material(1e9, 0.25, 1.0)
STRIP = {"length": 4.0, "width": 0.4}


def softened(surface, fixed, force, thickness, material=SOFT, clamped=()):
    """Torsion and shear of a sheet under forces (n, 3) on its vertices, and how stiff the thin sheet is."""
    made = SheetMaterial(material, thickness).model_for(surface)
    load = LoadCase(fixed, force, np.abs(force).any(axis=1), clamped=np.array(clamped, dtype=bool))
    spread = SpreadLoad.broadcast(surface, (0.0, 0.0, 0.0), 0.0)
    (answer,) = equilibria(surface, sheet_stiffness(made, MAIN_ELEMENTS), [load], MAIN_ELEMENTS, [spread])
    stress = {"load": sheet_stress(made, MAIN_ELEMENTS, answer)}
    (found,) = rib_softening(made, MAIN_ELEMENTS, {"load": load}, {"load": spread}, {"load": answer}, stress).values()
    return found, answer.compliance


def loaded_strip(force, thickness, cells=(40, 4), material=SOFT):
    """A strip that is built in at x = 0, with forces (k, 3) on the vertices of its tip, from one side to the other."""
    surface = grid(*cells, *STRIP.values())
    x, y = surface.V[:, 0], surface.V[:, 1]
    tip = np.flatnonzero(x > STRIP["length"] - 1e-9)
    forces = np.zeros((surface.n, 3))
    forces[tip[np.argsort(y[tip])]] = force
    clamped = (x[surface.edges.ends] < 1e-9).all(axis=1)
    return softened(surface, np.repeat((x < 1e-9)[:, None], 3, axis=1), forces, thickness, material, clamped)


@pytest.mark.parametrize(
    ("ratio", "k"), [(1, 0.1406), (1.5, 0.1958), (2, 0.2287), (3, 0.2633), (5, 0.2913), (10, 0.3123)]
)
def test_bars_have_saint_venants_torsion(ratio, k):
    """J = k w h^3 for w over h [Timoshenko and Goodier 1970, table 10], and the same for a bar on its narrow side."""
    assert torsion_share(np.array(ratio)) == pytest.approx(3 * k, rel=0.005)
    assert torsion_share(np.array(1 / ratio)) == pytest.approx(3 * k / ratio**2, rel=0.005)


@pytest.mark.parametrize("thickness", [0.05, 0.2, 0.8])
def test_a_strip_that_is_twisted_is_a_bar(thickness):
    """Twisted by a pair of forces at its tip, far longer than wide: 1 / share as soft; thin, and thicker than wide. At
    its ends it is built in, and pressed by forces on points."""
    pair = np.zeros((5, 3))
    pair[[0, 4], 2] = 1.0, -1.0
    found, _ = loaded_strip(pair, thickness)
    exact = 1 / torsion_share(np.array(STRIP["width"] / thickness)) - 1
    assert found.torsion == pytest.approx(exact, rel=0.08)


def test_a_strip_that_is_bent_is_no_softer_but_for_shear():
    """F^2 L 6 / (5 G w h) of shear over F^2 L^3 / (3 E I) [Timoshenko 1921]."""
    thickness, material = 0.4, replace(SOFT, poisson=0.0)
    found, compliance = loaded_strip(
        np.array([[0, 0, 1.0]] * 5) * [[0.5], [1], [1], [1], [0.5]], thickness, material=material
    )
    length, width = STRIP.values()
    assert compliance == pytest.approx(16 * length**3 / (3 * 1e9 * width * thickness**3 / 12), rel=1e-3)
    assert found.shear == pytest.approx(1.2 * 3 * thickness**2 / 12 * 2 / length**2, rel=0.01)
    assert found.torsion < 1e-3


def test_a_sheet_that_is_pulled_has_neither():
    found, _ = loaded_strip(np.array([[1.0, 0, 0]] * 5), 0.2)
    assert found == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("width", [1, 2, 3])
def test_measured_rib_widths_equal_the_width_between_windows(width):
    surface = windows(width)
    shape = rib_shape(surface)
    place = (surface.centroids[:, :2] * 24) % 6
    inner = (surface.centroids[:, :2].max(axis=1) < 17 / 24) & (surface.centroids[:, :2].min(axis=1) > width / 24)
    bars = ((place < width).sum(axis=1) == 1) & inner
    middle = np.abs(place - (width + 6) / 2).min(axis=1) < (6 - width) / 4  # between the nodes
    assert shape.widths[bars & middle] == pytest.approx(width / 24, rel=0.03)
    for axis in (0, 1):
        some = bars & middle & (place[:, 1 - axis] < width)
        assert np.abs(shape.along[some]) == pytest.approx(np.array([np.eye(3)[axis]] * some.sum()), abs=1e-9)
    assert (shape.widths[inner] > 0.99 * width / 24).all()


def test_widths_turn_with_the_sheet_and_a_closed_one_has_none():
    surface = jittered(windows())
    c, s = np.cos(0.7), np.sin(0.7)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    known, other = rib_shape(surface), rib_shape(Surface(3 * surface.V @ R.T + 5.0, surface.F))
    assert np.median(np.abs(other.widths / (3 * known.widths) - 1)) < 1e-6
    assert np.abs(np.einsum("mx,mx->m", other.along, known.along @ R.T)) == pytest.approx(1.0, abs=1e-6)
    assert np.isinf(rib_shape(sphere(1)).widths).all()


def ring_around_polygon(width, sides):
    """A ring of 96 steps around an opening of 2 m that has so many sides."""
    around = grid(96, 6, 2 * np.pi, width)
    turn, half = around.V[:, 0], np.pi / sides
    side = np.cos(half) / np.cos(turn % (2 * half) - half) * (1 + around.V[:, 1])
    V = np.stack([side * np.cos(turn), side * np.sin(turn), 0 * turn], axis=1)
    return glued(Surface(V, around.F))


def test_rough_outlines_do_not_make_ribs_narrow():
    """A ring of twelve sides: the kinks of its outer border are not two sides of a rib."""
    found = rib_shape(ring_around_polygon(0.3, 12)).widths
    assert found.min() > 0.99 * 0.3 * np.cos(np.pi / 12)
    assert found.max() < 0.3


@pytest.mark.parametrize("width", [0.02, 0.05])
def test_a_slender_ring_is_no_disc(width):
    """Of discs that began as large as the ring the next touching points were neighbours: half of it was 2 m wide."""
    assert rib_shape(ring_around_polygon(width, 96)).widths == pytest.approx(width, rel=0.02)


def test_a_plate_whose_border_lies_on_another_plate_is_no_rib():
    """A wall on the middle of a floor's side: borders beside the wall run at right angles to some faces of the wall."""
    floor, wall = grid(10, 10, 1.0, 1.0), grid(4, 4, 0.4, 0.4)
    upright = np.stack([wall.V[:, 0] + 0.3, 0 * wall.V[:, 0], wall.V[:, 1]], axis=1)
    surface = glued(Surface(np.concatenate([floor.V, upright]), np.concatenate([floor.F, wall.F + floor.n])))
    shape = rib_shape(surface)
    assert np.linalg.norm(shape.along, axis=1) == pytest.approx(1.0)
    assert np.einsum("mx,mx->m", shape.along, surface.normals) == pytest.approx(0.0, abs=1e-9)
    assert np.isinf(shape.widths).any()
    assert np.isfinite(with_barlike_ribs(SheetMaterial(SOFT, 0.05).model_for(surface)).bending).all()


def test_ribs_soften_a_verdict_in_bending_only():
    surface = windows()
    x = surface.V[:, 0]
    fixed = np.repeat((x < 1e-9)[:, None], 3, axis=1)
    for force, some in (((0.0, 0.0, -1.0), True), ((0.0, -1.0, 0.0), False)):
        tip, held = x > 1 - 1e-9, (x[surface.edges.ends] < 1e-9).all(axis=1)
        load = {"load": LoadCase(fixed, np.outer(tip, force), tip, clamped=held & some)}
        spread = {"load": SpreadLoad.broadcast(surface, (0.0, 0.0, 0.0), 0.0)}
        made = SheetMaterial(SOFT, 0.05)
        assert bool(level(surface, made, load, spread, (MAIN_ELEMENTS,), ribs=True).softer) is some
        assert not level(surface, made, load, spread, (MAIN_ELEMENTS,)).softer


SOLIDS = read(Path(str(TABLE)).parent / "solids.csv")


def test_the_verdict_intervals_contain_the_solids_of_the_table():
    assert len(SOLIDS) >= 60
    assert len({row.kind for row in SOLIDS}) >= 20
    assert min(row.share for row in SOLIDS) < 0.3
    assert min(row.ratio for row in SOLIDS) < 2 < 12 < max(row.ratio for row in SOLIDS)
    assert np.mean([row.inside() for row in SOLIDS]) >= 0.98
    assert np.mean([row.inside(theory=False) for row in SOLIDS]) < 0.2  # the bound is about thin sheets
    flat = [row for row in SOLIDS if row.kind == "cantilever"]
    assert flat
    assert all(row.theory == 0 and row.inside() for row in flat)


def test_the_verdict_intervals_hold_for_unseen_designs_and_are_narrow():
    """Those of seed 3 were drawn when the form stood; the others were seen while it was chosen."""
    assert sum(row.kind in LATER and row.seed == 3 for row in SOLIDS) == 8
    later = [row for row in SOLIDS if row.kind in LATER]
    assert len(later) >= 30
    assert all(row.inside() for row in later)
    bent = [row for row in SOLIDS if row.theory > 0]
    assert np.median([row.theory for row in bent]) < 1.5 * np.median([row.gap for row in bent])
    assert max(row.gap for row in bent) > 1  # ribs thinner than wide that are twisted: four times as soft


def test_the_verdict_intervals_contain_the_named_designs():
    named = {row.kind: row for row in SOLIDS if row.kind in NAMED}
    assert set(NAMED) - set(named) == {"tower, thin"}  # told to be unknown: its equations are not solved well enough
    assert all(row.inside() for row in named.values())


def test_the_segment_of_a_torus_is_half_of_its_tube(tmp_path):
    segment(tmp_path / "segment.obj")
    read_back = dsfab.read_surface(tmp_path / "segment.obj")
    assert read_back.area == pytest.approx(np.radians(150) * np.pi * 6 * 2.5, rel=0.01)


def test_solids_are_carried_on_at_their_own_rate():
    for rate in (2.0, 3.5):
        assert limit([1 - 0.1 / rate**k for k in range(3)]) == pytest.approx(1)
    assert limit([0.7, 0.9]) == pytest.approx(1.0)


@pytest.mark.slow
@needs_ccx
def test_wedges_of_a_whole_plate_agree_with_the_thin_plate():
    """A plate of 516 triangles, 200 thicknesses long, on hinges: the solid is softer by .1 % and what meshes leave."""
    design, _ = drawn_design("plate", 0)
    setting = LoadedSurface.from_design(design)
    sheet, _, loads = attached_material(setting, whole_sheet(design.surface))
    forces, chain = shares(sheet, loads), meshes(sheet, SmoothSurface.from_surface(design.surface))
    first, second, third = (next(chain) for _ in range(3))
    solid = [solid_compliance(setting, a, b, forces, 1) for a, b in ((first, second), (second, third))]
    assert limit(solid) == pytest.approx(check(setting, sheet).value, rel=0.01)
    assert solid_compliance(setting, first, second, forces, 2) / solid[0] == pytest.approx(1.0, abs=1e-3)
