"""Flips and collapses: what they must not change, over a zoo and at random, and that they make cells better."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array

import dsfab
from dsfab.core.errors import PatternError
from dsfab.preset.file import with_overrides
from dsfab.slicing import Sheet, cut, resolve_pinches
from dsfab.slicing.finishing.mesh_quality import (
    CellMesh,
    ImprovedSheet,
    collapse_edges,
    flip_edges,
    improve_cells,
    quality,
)
from dsfab.slicing.measures.lines import outline_labels
from dsfab.surface import Surface
from dsfab.surface.topology import euler_characteristic, manifold_faults, pieces
from tests.presets import DOME_MODES
from tests.shapes import ZOO, grid, jittered, sphere
from tests.slicing.laws import cases, check_laws
from tests.slicing.stripes import striped

SHARES = [0.0, 0.02, 0.1]


def outline(sheet: Sheet) -> dict[int, np.ndarray]:
    """Segments (k, 2, 3) of the outline of the material, by family."""
    kept = sheet.subset()
    found = outline_labels(kept)
    return {
        int(family): kept.surface.V[np.stack([found.start, found.end], axis=1)[found.family == family]]
        for family in np.unique(found.family)
    }


def far(points: np.ndarray, segments: np.ndarray) -> float:
    """The largest distance of points (k, 3) from a set of segments (s, 2, 3)."""
    A, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    t = np.einsum("ksi,si->ks", points[:, None] - A, along) / np.einsum("si,si->s", along, along)
    spots = A + np.clip(t, 0, 1)[..., None] * along
    return float(np.linalg.norm(points[:, None] - spots, axis=2).min(axis=1).max())


def check_improved(surface: Surface, sheet: Sheet, tolerance: float) -> ImprovedSheet:
    done = improve_cells(sheet, surface, tolerance)
    check_laws(surface, done.sheet)
    old, new = sheet.subset().surface, done.sheet.subset().surface
    assert len(manifold_faults(new.F, new.edges, new.n)) == len(manifold_faults(old.F, old.edges, old.n))
    assert euler_characteristic(new.F, new.edges) == euler_characteristic(old.F, old.edges)
    assert pieces(new.F, new.edges)[0] == pieces(old.F, old.edges)[0]
    assert len(new.loops) == len(old.loops)
    before, after = outline(sheet), outline(done.sheet)
    length = sum(np.linalg.norm(s[:, 1] - s[:, 0], axis=1).sum() for s in before.values())
    assert abs(new.area - old.area) <= tolerance * length + 1e-10 * surface.area
    assert done.strayed <= tolerance
    if tolerance:  # two joints that meet take the edge between them, and its family there, away
        before, after = ({0: np.concatenate(list(lines.values()))} for lines in (before, after))
    assert set(before) == set(after)
    for family, here in before.items():
        for a, b in ((here, after[family]), (after[family], here)):
            assert far(a.reshape(-1, 3)[:400], b) <= done.strayed + 1e-9 * surface.size
    assert quality(new).worst_angle >= (1 - 1e-9) * quality(old).worst_angle
    assert (done.before, done.after)[1].median == quality(new).median
    return done


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("name", ZOO)
def test_the_surface_and_the_outline_are_kept(name, share):
    surface = ZOO[name]()
    check_improved(surface, striped(surface), share * surface.mean_edge)


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("name", ZOO)
def test_a_round_misses_no_place_outside_of_its_zone(name, share):
    """A round looks near the changes of the round before; looking everywhere gives the same triangles."""
    surface = jittered(ZOO[name]())
    mesh = CellMesh.from_sheet(striped(surface, snap=0.05), surface)
    zone = everywhere = np.ones(len(mesh.surface.V), dtype=bool)
    for _ in range(20):
        rounds = [collapse_edges(mesh, share * surface.mean_edge, where) for where in (zone, everywhere)]
        assert np.array_equal(*(done.mesh.surface.F for done in rounds))
        mesh, fewer, collapse_zone = rounds[0]
        rounds = [flip_edges(mesh, where) for where in (zone | collapse_zone, everywhere)]
        assert np.array_equal(*(done.mesh.surface.F for done in rounds))
        mesh, turned, flip_zone = rounds[0]
        zone = collapse_zone | flip_zone
        if not fewer and not turned:
            return
    pytest.fail("the rounds do not end")


@settings(max_examples=40, deadline=None, derandomize=True)
@given(cases(), st.sampled_from(SHARES), st.integers(0, 1))
def test_laws_hold_on_random_meshes(case, share, rule):
    surface, fields, levels, snap = case
    try:
        sheet = resolve_pinches(cut(surface, fields, levels, snap), 0.2 * surface.mean_edge, ("join", "split")[rule])
        sheet = sheet.sheet
    except PatternError:
        return
    check_improved(surface, sheet, share * surface.mean_edge)


def test_needles_become_fewer():
    surface = jittered(grid(20, 20, 1.0, 1.0))
    sheet = striped(surface, snap=0.05)
    exact, near = (improve_cells(sheet, surface, share * surface.mean_edge) for share in (0.0, 0.1))
    assert exact.flips > 10
    assert near.collapses > 50
    assert near.after.needles < 0.7 * near.before.needles
    assert near.after.median > exact.after.median > exact.before.median


def test_a_sheet_that_cannot_be_better_comes_back_itself():
    surface = sphere(2)
    sheet = cut(surface, [surface.V[:, 2]], [[-2.0]])
    done = improve_cells(sheet, surface, 0.1)
    assert done.sheet is sheet
    assert (done.flips, done.collapses, done.strayed) == (0, 0, 0.0)


def test_the_key_improve_improves_the_cut_mesh():
    plain = dsfab.load_preset(DOME_MODES, {"surface.edge": 0.8})
    one = dsfab.run(plain)
    two = dsfab.revise(one, with_overrides(plain, {"slicing.improve": True, "slicing.tolerance": 0.04}))
    assert two.sheet.surface.m < one.sheet.surface.m
    assert two.sheet.surface.area == pytest.approx(one.sheet.surface.area, rel=5e-3)
    assert two.solid.volume == pytest.approx(one.solid.volume, rel=5e-3)
    assert two.solid.repairs.pairs == 0
    assert quality(two.sheet.surface).median > quality(one.sheet.surface).median
    (told,) = [note.text for note in two.notes if "collapsed" in note.text]
    assert f"-> {quality(two.sheet.surface).median:.2f}" in told


@pytest.mark.parametrize(("scale", "turns"), [(1e-3, 1), (5e-10, 0)])
def test_no_cell_is_made_that_no_surface_takes(scale, turns):
    """A needle does not become two of next to no area in a sheet of a metre: the coarse sphere was refused for them."""
    kite = scale * np.array([[0.0, 0, 0], [4, 0, 0], [2, 1.5, 0], [2, -1.5, 0]])
    V = np.concatenate([kite, [[1.0, 0, 0], [0, 1, 0]]])
    F = np.array([[0, 1, 2], [1, 0, 3]])
    uncut, of = Surface(V, [[0, 4, 5]]), np.zeros(2, dtype=int)
    sheet = Sheet(Surface(V, F), of, of, csr_array(np.eye(len(V))))
    everywhere = np.ones(len(V), dtype=bool)
    assert flip_edges(CellMesh.from_sheet(sheet, uncut), everywhere).number == turns
