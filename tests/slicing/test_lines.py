"""Edges and middles of members: straight on a plate, circles on a cylinder, the co-area formula elsewhere."""

from collections import Counter

import numpy as np
import pytest

from dsfab.pattern import Stripes
from dsfab.slicing import cut
from dsfab.slicing.measures.lines import centre_lines, edge_lines
from dsfab.surface import Surface
from dsfab.surface.fields import chains, hat_gradients, level_lines, polyline_length, simplified_line
from tests.shapes import ZOO, grid, jittered, sphere, zoo
from tests.slicing.staggered_tubes import staggered_tube


def striped(surface: Surface, x: np.ndarray, stripes: Stripes):
    """The sheet of one family of stripes, all its edges and its centre lines."""
    sheet = cut(surface, [x], [stripes.levels(x)], snap=0.0).subset()
    z = stripes.phases(x)
    edges = edge_lines(sheet, surface, ["major"], [z])
    return sheet, edges, centre_lines(sheet, "major", z, np.full(surface.n, stripes.half_width))


def test_stripes_on_a_plate_are_straight_and_span_its_width():
    """x = position along 2 m, two stripes per metre at half a period: members 0.25 m wide, middles every 0.5 m."""
    plate = jittered(grid(16, 9, 2.0, 1.0))
    _, edges, centre = striped(plate, plate.V[:, 0].copy(), Stripes(2.0, phase=0.5))
    assert [line.id for line in centre] == [f"centre-major-{k}.1" for k in (1, 2, 3, 4)]
    for line in centre:
        assert line.length == pytest.approx(1.0, rel=1e-12)
        assert line.points[:, 0] == pytest.approx((line.number - 0.5) / 2)
        assert len(simplified_line(line.points, 1e-9)) == 2
    inner = [line for line in edges if line.family == "major"]
    assert sorted({round(x, 9) for line in inner for x in line.points[:, 0]}) == [
        *(0.125, 0.375, 0.625, 0.875, 1.125, 1.375, 1.625, 1.875)
    ]
    assert [line.length for line in inner] == pytest.approx([1.0] * 8)
    assert Counter(line.number for line in inner) == dict.fromkeys((1, 2, 3, 4), 2)
    boundary = [line for line in edges if line.family == "boundary"]
    assert [line.length for line in boundary] == pytest.approx([0.25] * 8)
    assert {line.layer for line in edges} == {"edges-major", "boundary"}


def test_rings_on_a_cylinder_are_circles():
    """Each ring is closed, and a polygon of 2 n chords in a regular n-gon's sides: 2 pi r to second order."""
    error = []
    for n in (24, 48, 96):
        _, edges, centre = striped(staggered_tube(n, 11), staggered_tube(n, 11).V[:, 2].copy(), Stripes(2.0, phase=0.3))
        assert {line.is_closed for line in [*edges, *centre]} == {True}
        assert len(centre) == 4
        error.append(max(abs(line.length / (2 * np.pi) - 1) for line in centre))
    assert np.log2(error[0] / error[1]) == pytest.approx(2, abs=0.1)
    assert error[2] < np.pi**2 / (6 * 96**2) * 1.05


@zoo
def test_middles_are_as_long_as_the_gradient_says(name):
    """Co-area: over all phases the lines z = k have the mean length of the integral of |grad z| [Federer 1959]."""
    surface = ZOO[name]()
    x = surface.V @ [1.0, 0.7, 0.4] / surface.size
    z = 5 * x
    gradient = np.einsum("mcx,mc->mx", hat_gradients(surface), z[surface.F])
    integral = surface.areas @ np.linalg.norm(gradient, axis=1)
    phases = (np.arange(100) + 0.5) / 100
    lengths = [
        sum(polyline_length(track.points) for track in level_lines(surface, z + phase, np.arange(-9.0, 10.0)))
        for phase in phases
    ]
    assert np.mean(lengths) == pytest.approx(integral, rel=2e-3)


@zoo
def test_edges_are_the_boundary_of_the_sheet_once_and_on_their_levels(name):
    surface = ZOO[name]()
    V = surface.V / surface.size
    x, y = V @ [1.0, 0.2, 0.3], V @ [-0.2, 0.9, 0.5]
    one, two = Stripes(6.0), Stripes(5.0, 0.25, 0.3)
    sheet = cut(surface, [x, y], [one.levels(x), two.levels(y)], snap=0.0).subset()
    lines = edge_lines(sheet, surface, ["major", "minor"], [one.phases(x), two.phases(y)])
    ends = sheet.surface.V[sheet.surface.edges.ends[sheet.surface.edges.boundary]]
    outline = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()
    assert sum(line.length for line in lines) == pytest.approx(outline, rel=1e-9)
    assert len({line.id for line in lines}) == len(lines)
    for line in lines:
        if line.family != "boundary":
            stripes, axis = (one, [1.0, 0.2, 0.3]) if line.family == "major" else (two, [-0.2, 0.9, 0.5])
            off = np.abs(stripes.phases(line.points / surface.size @ axis) - line.number)
            assert off == pytest.approx(stripes.half_width, abs=1e-6)
    assert any(line.family == "boundary" for line in lines) == (not surface.is_closed)


def test_the_material_lies_left_of_every_edge():
    plate = grid(12, 12, 1.0, 1.0)
    sheet, edges, _ = striped(plate, np.hypot(*plate.V[:, :2].T), Stripes(4.0))
    signed = sum(np.cross(line.points[:-1], line.points[1:])[:, 2].sum() / 2 for line in edges)
    assert signed == pytest.approx(sheet.surface.area)


def test_middles_end_where_a_member_tapers_out_or_is_not_kept():
    """d = 0 for x < 1: no member there, whatever else is material."""
    plate = grid(20, 10, 2.0, 1.0)
    x, y = plate.V[:, 0], plate.V[:, 1]
    sheet = cut(plate, [-np.ones(plate.n)], [[-2.0]]).subset()  # all of it
    d = np.where(x > 1, 0.25, 0.0)
    centre = centre_lines(sheet, "minor", 2 * y, d)
    assert [line.number for line in centre] == [1, 2]
    inside = centre[0]
    assert inside.length == pytest.approx(0.9)  # from x = 1.1, where all corners of a face have d > 0
    split = sheet.subset(np.abs(sheet.surface.centroids[:, 0] - 1.4) > 0.1)
    first, second = centre_lines(split, "minor", 2 * y, d)[:2]
    assert (first.id, second.id) == ("centre-minor-1.1", "centre-minor-1.2")
    assert (first.length, second.length) == pytest.approx((0.5, 0.2))
    half = sheet.subset(x[sheet.surface.F].min(axis=1) > 1.5)
    assert centre_lines(half, "minor", 2 * y, d)[0].length == pytest.approx(0.4)


def test_a_level_through_vertices_and_along_edges_is_drawn_once():
    plate = grid(4, 4, 1.0, 1.0)
    (along,) = level_lines(plate, plate.V[:, 0].copy(), np.array([0.5]))
    assert polyline_length(along.points) == pytest.approx(1.0)
    diagonal = level_lines(plate, plate.V[:, 0] + plate.V[:, 1], np.array([1.0]))
    assert sum(polyline_length(track.points) for track in diagonal) == pytest.approx(np.sqrt(2))
    assert level_lines(plate, np.ones(plate.n), np.array([1.0])) == []
    peak = np.zeros(plate.n)
    peak[12] = 1.0
    assert level_lines(plate, peak, np.array([1.0])) == []  # a level that only touches a vertex has no length
    (around,) = level_lines(plate, peak, np.array([1.0 - 1e-12]))
    assert (around.points[0] == around.points[-1]).all()


def test_each_chord_lies_in_its_face():
    surface = sphere(2)
    for track in level_lines(surface, surface.V @ [0.3, 0.5, 0.8], np.linspace(-0.9, 0.9, 7)):
        corners = surface.V[surface.F[track.faces]]
        height = np.einsum("kx,kx->k", surface.normals[track.faces], corners[:, 0])
        for ends in (track.points[:-1], track.points[1:]):
            assert np.einsum("kx,kx->k", surface.normals[track.faces], ends) == pytest.approx(height)
            assert (np.linalg.norm(ends - corners.mean(axis=1), axis=1) < 0.5).all()


def test_chains_follow_open_and_closed_links():
    found = chains(np.array([1, 0, 5, 3, 4]), np.array([2, 1, 3, 4, 5]), 7)
    assert [nodes.tolist() for nodes, _ in found] == [[0, 1, 2], [3, 4, 5, 3]]
    assert [links.tolist() for _, links in found] == [[1, 0], [3, 4, 2]]


def test_a_simplified_circle_stays_within_the_tolerance_and_closed():
    angle = np.linspace(0, 2 * np.pi, 401)
    circle = np.c_[np.cos(angle), np.sin(angle), 0 * angle]
    circle[-1] = circle[0]
    for tolerance in (1e-2, 1e-3):
        few = simplified_line(circle, tolerance)
        assert (few[0] == few[-1]).all()
        middle = np.linalg.norm((few[1:] + few[:-1]) / 2, axis=1)
        assert 1 - middle.min() <= tolerance
        assert len(few) < 2.1 * np.pi / np.arccos(1 - tolerance)
