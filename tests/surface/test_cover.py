"""Sides of surfaces: the orientation double cover on what can be oriented, what is not, and what cannot be."""

import numpy as np
import pytest

from dsfab.core.errors import SurfaceError
from dsfab.surface import Surface, read_surface
from dsfab.surface.loads.load_case import Pressure, Snow, Wind
from dsfab.surface.loads.pickers import Boundary, Box, Facing
from dsfab.surface.orientation import corner_sides, flips_along_tree, one_sided_pieces
from dsfab.surface.topology import boundary_loops, euler_characteristic, misoriented_edges, pieces
from tests.shapes import ZOO, moebius, projective_plane, sphere, with_mixed_sides, zoo


@zoo
def test_sides_do_not_depend_on_how_the_faces_are_turned(name):
    surface = ZOO[name]()
    mixed, flips = with_mixed_sides(surface)
    before, after = (corner_sides(s.F, s.edges) for s in (surface, mixed))
    after = np.where(flips[:, None], -after[:, ::-1], after)  # in the corners, and on the side, of the face as it was
    for vertex in range(surface.n):
        here = vertex == surface.F
        assert len(np.unique(before[here] * after[here])) == 1  # the same, up to which side a vertex calls its first


def test_every_side_of_an_oriented_surface_is_the_first():
    ball = sphere(2)
    assert (corner_sides(ball.F, ball.edges) == 1).all()


def test_neighbours_around_a_vertex_lie_on_the_side_that_the_sides_say():
    """Normals of neighbours nearly agree on a fine strip, once each is turned to the first face's side."""
    strip, _ = with_mixed_sides(moebius(120, 6, 0.4))
    sides = corner_sides(strip.F, strip.edges)
    N = strip.normals[:, None] * sides[:, :, None]
    total = np.stack([np.bincount(strip.F.ravel(), N[..., i].ravel()) for i in range(3)], axis=1)
    assert (np.einsum("mvi,mi->mv", total[strip.F], strip.normals) * sides > 0).all()


def test_one_sided_pieces_are_detected_beside_two_sided_ones():
    strip, ball = moebius(), with_mixed_sides(sphere(1))[0]
    both = Surface(np.concatenate([strip.V, ball.V + [5, 0, 0]]), np.concatenate([strip.F, ball.F + strip.n]))
    assert np.array_equal(one_sided_pieces(both.F, both.edges), np.arange(both.m) < strip.m)
    boy = projective_plane()
    assert one_sided_pieces(boy.F, boy.edges).all()
    assert (euler_characteristic(boy.F, boy.edges), boy.is_closed) == (1, True)


def test_along_a_tree_only_a_short_seam_disagrees():
    strip, _ = with_mixed_sides(moebius(60, 4))
    flips = flips_along_tree(strip.F, strip.edges)
    F = np.where(flips[:, None], strip.F[:, ::-1], strip.F)
    assert len(misoriented_edges(strip.F, strip.edges)) > 100
    assert 4 <= len(misoriented_edges(F, Surface(strip.V, F).edges)) <= 12


@pytest.mark.parametrize("seed", range(3))
def test_the_one_boundary_of_a_strip_is_one_loop(seed):
    strip, _ = with_mixed_sides(moebius(), seed)
    (loop,) = boundary_loops(strip.F, strip.edges)
    ends = strip.edges.ends[strip.edges.boundary]
    assert len(loop) == len(ends) == 80
    steps = np.sort(np.stack([loop, np.roll(loop, -1)], axis=1), axis=1)
    assert {tuple(s) for s in steps.tolist()} == {tuple(e) for e in ends.tolist()}
    assert Boundary(0).vertices(strip).sum() == 80


def test_a_one_sided_strip_is_read_from_a_file_unchanged(tmp_path):
    strip, _ = with_mixed_sides(moebius())
    path = tmp_path / "strip.obj"
    path.write_text(
        "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in strip.V.tolist())
        + "".join(f"f {a} {b} {c}\n" for a, b, c in (strip.F + 1).tolist())
    )
    read = read_surface(path)
    assert np.array_equal(np.sort(read.F, axis=1), np.sort(strip.F, axis=1))
    assert len(misoriented_edges(read.F, read.edges)) <= 12
    assert pieces(read.F, read.edges)[0] == 1


@pytest.mark.parametrize("load", [Pressure(1.0), Wind(1.0, (1, 0, 0))], ids=["pressure", "wind"])
def test_loads_that_need_an_outside_refuse_a_one_sided_surface(load):
    with pytest.raises(
        SurfaceError,
        match=r"needs faces with an outside, but 320 of these faces .* on a one-sided "
        r"surface",
    ):
        load.forces(moebius(), 1.0)


def test_faces_with_two_sides_beside_a_strip_take_pressure():
    strip, ball = moebius(), sphere(1)
    both = Surface(np.concatenate([strip.V, ball.V + [5, 0, 0]]), np.concatenate([strip.F, ball.F + strip.n]))
    beside = Box((3, -2, -2), (8, 2, 2))
    assert np.abs(Pressure(1.0, beside).forces(both, 1.0)).sum() > 0


def test_nothing_of_a_strip_faces_anywhere():
    with pytest.raises(SurfaceError, match="needs faces with an outside"):
        Facing((0, 0, 1)).vertices(moebius())


def test_snow_lies_on_both_sides_of_a_closed_surface_with_one_side():
    boy = projective_plane()
    plan = 0.5 * np.abs(np.cross(*np.moveaxis(boy.V[boy.F[:, 1:]] - boy.V[boy.F[:, :1]], 1, 0))[:, 2]).sum()
    assert Snow(2.0).forces(boy, 1.0)[:, 2].sum() == pytest.approx(-2.0 * plan)
