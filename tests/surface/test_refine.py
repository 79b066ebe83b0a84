"""Refining: no edge longer than asked, the same flat facets, no T-junction, sound angles; and Loop's smooth kind."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

import dsfab
from dsfab.core.errors import SurfaceError
from dsfab.surface import SHAPES, Surface, refined_surface
from dsfab.surface.orientation import one_sided_pieces
from dsfab.surface.topology import euler_characteristic, manifold_faults, pieces
from tests.presets import DOME_MODES
from tests.shapes import ZOO, grid, jittered, smallest_angle, sphere, zoo


def lengths(surface: Surface) -> np.ndarray:
    return np.linalg.norm(np.diff(surface.V[surface.edges.ends], axis=1)[:, 0], axis=1)


def check_same_surface(old: Surface, new: Surface) -> None:
    """The new faces fill the old ones, face the same way, and are connected as they were."""
    assert np.array_equal(new.V[: old.n], old.V)
    assert new.area == pytest.approx(old.area, rel=1e-12)
    faults = [manifold_faults(s.F, s.edges, s.n) for s in (old, new)]
    assert (
        len(faults[0]) == len(faults[1]) == one_sided_pieces(old.F, old.edges).any()
    )  # a Moebius strip has one: its seam
    assert euler_characteristic(new.F, new.edges) == euler_characteristic(old.F, old.edges)
    assert pieces(new.F, new.edges)[0] == pieces(old.F, old.edges)[0]
    assert len(new.loops) == len(old.loops)
    border = [lengths(s)[s.edges.boundary].sum() for s in (old, new)]
    assert border[0] == pytest.approx(border[1], rel=1e-12)
    assert np.isin(new.F.ravel(), np.arange(new.n)).all()
    assert len(np.unique(new.F)) == new.n
    vectors = [(s.areas[:, None] * s.normals).sum(axis=0) for s in (old, new)]
    assert vectors[0] == pytest.approx(vectors[1], abs=1e-12 * old.area)
    if not old.is_closed:
        return
    assert new.volume == pytest.approx(old.volume, rel=1e-12)


@zoo
@pytest.mark.parametrize("share", [0.9, 0.5, 0.21])
def test_refined_edges_keep_the_limit_and_facets_stay_flat(name, share):
    surface = ZOO[name]()
    target = share * lengths(surface).max()
    finer = refined_surface(surface, target)
    assert lengths(finer).max() <= target
    assert finer.m > surface.m
    check_same_surface(surface, finer)
    assert smallest_angle(finer) >= smallest_angle(surface) / 2 - 1e-9


def test_nothing_happens_to_a_surface_that_is_fine_enough():
    surface = sphere(2)
    assert refined_surface(surface, 10.0) is surface
    assert refined_surface(surface, 10.0, smooth=True) is surface


def test_only_long_edges_and_their_neighbours_are_divided():
    """One long strip in a fine plate: faces far from it stay as they were."""
    plate = grid(16, 4, 4.0, 1.0)
    V = plate.V.copy()
    V[V[:, 0] > 3.5, 0] += 2
    finer = refined_surface(Surface(V, plate.F), 0.5)
    assert lengths(finer).max() <= 0.5
    left = finer.V[:, 0] <= 2.0
    assert left.sum() == (V[:, 0] <= 2.0).sum()
    check_same_surface(Surface(V, plate.F), finer)


@pytest.mark.parametrize(
    ("points", "faces"),
    [
        ([[0, 0], [1, 0], [0.5, 0.9]], 4),  # all three edges
        ([[0, 0], [1, 0], [0.5, 0.2]], 2),  # the longest
        ([[0, 0], [1, 0], [0.8, 0.3]], 3),  # the longest and one other, on either side
        ([[0, 0], [1, 0], [0.2, 0.3]], 3),
    ],
)
def test_one_triangle_is_divided_by_the_drawing(points, faces):
    triangle = Surface(np.c_[points, np.zeros(3)], [[0, 1, 2]])
    for turn in range(3):
        turned = Surface(triangle.V, np.roll(triangle.F, turn, axis=1))
        finer = refined_surface(turned, 0.6)
        assert finer.m == faces
        check_same_surface(turned, finer)


def test_angles_stop_getting_smaller():
    """Rounds on a bad triangle and on random ones: no less than half the smallest angle, however fine."""
    triangle = Surface([[0, 0, 0], [1, 0, 0], [0.03, 0.11, 0]], [[0, 1, 2]])
    angles = [smallest_angle(refined_surface(triangle, target)) for target in (0.5, 0.1, 0.02)]
    assert min(angles) >= smallest_angle(triangle) / 2
    assert angles[2] == pytest.approx(angles[1], rel=1e-6)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), count=st.integers(4, 30), share=st.floats(0.05, 1.0), rounded=st.booleans())
def test_random_meshes_keep_their_shape(seed, count, share, rounded):
    rng = np.random.default_rng(seed)
    xy = rng.uniform(size=(count, 2))
    if rounded:  # equal lengths, among which an order must be kept
        xy = np.unique(np.round(4 * xy) / 4, axis=0)
        xy = np.concatenate([xy, [[-1, -1], [2, -1], [0, 2]]])
    surface = Surface(np.c_[xy, rng.normal(size=len(xy))], Delaunay(xy).simplices)
    target = share * lengths(surface).max()
    finer = refined_surface(surface, target)
    assert lengths(finer).max() <= target
    check_same_surface(surface, finer)


# --- smooth


def test_smooth_refining_rounds_the_facets_of_a_sphere():
    """Loop's limit of a coarse sphere is round to a few per cent: dihedral angles shrink with the edges."""
    coarse = sphere(2)
    smooth, flat = (refined_surface(coarse, 0.08, smooth=s) for s in (True, False))
    radii = np.linalg.norm(smooth.V, axis=1)
    assert lengths(smooth).max() <= 0.08
    assert np.ptp(radii) < 0.05 < 1 - radii.min() < 0.1
    assert euler_characteristic(smooth.F, smooth.edges) == 2
    assert manifold_faults(smooth.F, smooth.edges, smooth.n) == ()

    def bend(s):
        one, two = (s.normals[s.edges.pairs[:, i] // 3] for i in (0, 1))
        return np.einsum("ij,ij->i", one, two).min()

    assert bend(smooth) > 0.99 > bend(flat)


def test_smooth_refining_keeps_planes_boundaries_and_orientation():
    plate = jittered(grid(8, 8, 1.0, 1.0))
    finer = refined_surface(plate, 0.06, smooth=True)
    assert np.abs(finer.V[:, 2]).max() == 0
    assert (finer.normals[:, 2] > 0).all()
    assert len(finer.loops) == 1
    assert finer.area == pytest.approx(1, rel=0.01)  # corners are rounded
    straight = finer.V[finer.loops[0]]
    assert (np.abs(straight[:, :2] - 0.5).max(axis=1) > 0.45).all()
    two = refined_surface(ZOO["two pieces"](), 0.2, smooth=True)
    assert pieces(two.F, two.edges)[0] == 2


def test_smooth_refining_needs_a_manifold_and_flat_refining_does_not():
    fan = Surface([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    finer = refined_surface(fan, 0.4)
    assert lengths(finer).max() <= 0.4
    assert (finer.edges.count == 3).sum() == 4  # the common edge in four parts
    assert finer.area == pytest.approx(fan.area)
    with pytest.raises(SurfaceError, match=r"1 edge has more than two faces .*; set smooth to false"):
        refined_surface(fan, 0.4, smooth=True)


# --- refusals, and presets


@pytest.mark.parametrize("target", [0.0, -1.0, np.nan, np.inf])
def test_impossible_lengths_are_refused(target):
    with pytest.raises(SurfaceError, match="must be a positive length"):
        refined_surface(sphere(1), target)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_length_that_takes_too_many_triangles_is_refused_in_time(smooth, monkeypatch):
    monkeypatch.setattr("dsfab.surface.edge_changes.MOST_TRIANGLES", 2000)
    with pytest.raises(SurfaceError, match=r"edges of 1e-06 m needs more than 2,000 triangles"):
        refined_surface(sphere(2), 1e-6, smooth=smooth)
    assert refined_surface(sphere(2), 0.35, smooth=smooth).m <= 2000


def test_a_preset_refines_its_shape():
    preset = dsfab.load_preset(DOME_MODES, {"surface.edge": 2.0, "surface.refine": 0.5})
    coarse = SHAPES["dome"](span=12.0, rise=4.0, oculus=0.0, edge=2.0)
    surface = preset.surface.build()
    assert lengths(surface).max() <= 0.5 < lengths(coarse).max()
    assert surface.area == pytest.approx(coarse.area, rel=1e-12)
    assert dsfab.load_preset(DOME_MODES, {"surface.edge": 2.0}).surface.build().m == coarse.m
    round_ = dsfab.load_preset(DOME_MODES, {"surface.edge": 2.0, "surface.refine": 0.5, "surface.smooth": True})
    assert round_.surface.build().area != pytest.approx(coarse.area, rel=1e-6)
