"""Flat parts of strips: closed forms of developments, and parts of DXF files bent back onto their members in space."""

from functools import cache
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

from dsfab.members import Member, MemberAxis, MemberGraph
from dsfab.workshop import Layering, is_strip
from dsfab.workshop.development import Development, member_course
from dsfab.workshop.planks import PlankStock, plank_plan
from dsfab.workshop.strips import calm_stations, strip_parts
from tests.analytic import SURFACES, WIDTH
from tests.shapes import grid
from tests.workshop.unrolled_strips import Bent, ReadPart, graph_of

LAYERING = Layering(thickness=0.018, count=2, bolt=0.012)
STOCK = [(2.484, 1.234)]
ASIDE = 0.3
"""Metres from the ends of an axis, where a spline knows less."""


@cache
def parts_of(name, edge, layering=LAYERING):
    return strip_parts(graph_of(name, edge)[1], layering, STOCK, splice="cover")


# --- ends that curl up


def hook(curl: float, at: float = 5.0) -> Member:
    """6 m in a plane, .2 m wide: straight to a place, then around `curl` of a circle of .08 m, then straight on."""
    s = np.linspace(0, 6, 601)
    kg = np.where((s > at) & (s < at + curl * 0.16 * np.pi), 1 / 0.08, 0.0)
    turn = np.concatenate([[0], np.cumsum((kg[1:] + kg[:-1]) / 2 * np.diff(s))])
    T = np.column_stack([np.cos(turn), np.sin(turn), 0 * s])
    P = np.vstack([np.zeros(3), np.cumsum((T[1:] + T[:-1]) / 2 * np.diff(s)[:, None], axis=0)])
    axis = MemberAxis(s, P, T, np.tile([0.0, 0.0, 1.0], (len(s), 1)), kg, 0 * s, 0 * s, False, s, 0.0)
    return Member("A1", "strip", "major", 0, 1, np.arange(1), 1.2, axis, np.full((len(s), 2), 0.1), ("free", "free"))


def test_a_strip_that_curls_at_its_end_is_built_up_to_the_curl():
    """Half of a hairpin's turn is left at the ends of both its members. In the middle of one it makes a plate of it."""
    member = hook(0.2, 5.85)
    graph = MemberGraph(SimpleNamespace(surface=grid(1, 1, 1.0, 1.0)), np.zeros(2, int), (member,), ())
    assert is_strip(member)
    found = strip_parts(graph, LAYERING, STOCK, splice="cover")
    course = member_course(graph, member, 0.1, 0.1)
    assert (course.begin, course.end) == pytest.approx((0, 5.85), abs=0.02)
    assert found.shortened == ["A1"]
    assert len(found.pieces) == 3
    assert sum(float(np.ptp(piece.axis[:, 0])) for piece in found.pieces) == pytest.approx(5.85, abs=0.02)
    assert not is_strip(hook(0.2, 3.0))
    straight = hook(0.0)
    assert is_strip(straight)
    assert member_course(graph, straight, 0.1, 0.1).end == 6


def test_chords_of_an_outline_are_at_most_three_hundredths_of_a_millimetre_off_its_arcs():
    """A strip .2 m wide along a circle of 1 m, whose stations are 50 mm apart."""
    s = np.linspace(0, 3, 61)
    P, T = np.stack([np.sin(s), 1 - np.cos(s), 0 * s], axis=1), np.stack([np.cos(s), np.sin(s), 0 * s], axis=1)
    axis = MemberAxis(s, P, T, np.tile([0.0, 0.0, 1.0], (61, 1)), 1 + 0 * s, 0 * s, 0 * s, False, s, 0.0)
    member = Member("A1", "strip", "major", 0, 1, np.arange(1), 0.6, axis, np.full((61, 2), 0.1), ("free", "free"))
    graph = MemberGraph(SimpleNamespace(surface=grid(1, 1, 1.0, 1.0)), np.zeros(2, int), (member,), ())
    outline = Development(member_course(graph, member, 0.1, 0.1), 0.0).outline(0.5, 2.5)
    edge = outline[: len(outline) // 2]
    middle, radius = fitted_circle(edge)
    assert radius == pytest.approx(1.1, abs=0.01)
    off = radius - np.linalg.norm((edge[1:] + edge[:-1]) / 2 - middle, axis=1)
    assert 1e-5 < np.median(off) < 3e-5


def test_the_curvature_of_a_strip_is_read_one_and_a_half_widths_from_its_ends():
    member = hook(0.0)
    s = member.curve.s[calm_stations(member)]
    assert (s[0], s[-1]) == pytest.approx((0.3, 5.7), abs=0.05)


@pytest.mark.parametrize(("member", "stopped"), [(hook(0.2, 5.85), ["A1"]), (hook(0.0), [])])
def test_a_plank_that_curls_at_its_end_stops_there_with_a_note(member, stopped):
    graph = MemberGraph(SimpleNamespace(surface=grid(1, 1, 1.0, 1.0)), np.zeros(2, int), (member,), ())
    stock = PlankStock(0.018, 0.12, 0.012, "cover", (0.02, 0.008))
    plan = plank_plan(graph, np.tile([0.0, 0.0, 1.0], (graph.sheet.surface.n, 1)), stock, STOCK, 0.0)
    assert plan.planks.shortened == stopped
    assert max(part.span[1] for part in plan.parts) == pytest.approx(5.85 if stopped else 6, abs=0.02)
    assert any("A1 stops before its ends" in line and "curl up" in line for line in plan.lines) == bool(stopped)


def straight(name: str, begin: tuple[float, float], long: float) -> Member:
    """In a plane, along x, .2 m wide."""
    s = np.linspace(0, long, 60)
    P = np.column_stack([begin[0] + s, begin[1] + 0 * s, 0 * s])
    axis = MemberAxis(s, P, *(np.tile(way, (60, 1)) for way in np.eye(3)[[0, 2]]), *(0 * s,) * 3, False, s, 0.0)
    return Member(name, "strip", "major", 0, 1, np.arange(1), 1.2, axis, np.full((60, 2), 0.1), ("free", "free"))


@pytest.mark.parametrize(("long", "built"), [(0.3, False), (2.0, True)])
def test_a_strip_of_which_no_length_is_left_is_omitted_with_a_note(long, built):
    """It stops .17 m from both ends, where it would touch them. What was left once was longer than nothing by less than
    nothing, and no stock was large enough for it."""
    members = (straight("A1", (0, 0), 6), straight("A2", (6 + long, 0), 6), straight("A3", (6, 0.1), long))
    graph = MemberGraph(SimpleNamespace(surface=grid(1, 1, 1.0, 1.0)), np.zeros(2, int), members, ())
    found = strip_parts(graph, LAYERING, STOCK, splice="cover")
    assert (found.shortened, found.vanished) == ((["A3"], []) if built else ([], ["A3"]))
    assert {part.member for part in found.pieces} == {"A1", "A2"} | ({"A3"} if built else set())
    stock = PlankStock(0.195, 0.2, 0.012, "cover", (0.02, 0.008))
    plan = plank_plan(graph, np.tile([0.0, 0.0, 1.0], (graph.sheet.surface.n, 1)), stock, STOCK, 0.0)
    assert {part.member for part in plan.parts} == {"A1", "A2"} | ({"A3"} if built else set())
    assert any("NOT BUILT" in line and "A3" in line for line in plan.lines) != built


# --- parts as files, bent back


def bent(part, graph, folder):
    """A part read from its file and what it becomes in space, with its course."""
    read = ReadPart(part, folder)
    course = member_course(graph, graph.by_id[part.member], 3 * LAYERING.bolt, 2 * LAYERING.half_cover_length)
    curve = Bent(course, part.layer, part.span)
    drawn = np.linalg.norm(np.diff(read.axis, axis=0), axis=1).sum()
    assert drawn == pytest.approx(curve.long[-1], abs=3e-4)  # a chord is shorter than its arc
    return read, course, curve


def assert_folds_back(part, graph, folder):
    read, course, curve = bent(part, graph, folder)
    nodes = {node.id: node for node in graph.nodes_along[part.member]}
    along, left = read.beside_axis(read.holes)
    placed, _ = curve.points(along, left)
    for hole, point in zip(part.holes, placed, strict=True):
        if hole.bolt in nodes:  # the bolt's line, through both layers
            node = nodes[hole.bolt]
            off = point - node.point
            assert np.linalg.norm(off - (off @ node.normal) * node.normal) < 1e-4
    along, left = read.beside_axis(read.outline)
    _, s = curve.points(along, left)
    edges = np.where(left > 0, np.interp(s, course.s, course.left), -np.interp(s, course.s, course.right))
    assert np.abs(left - edges).max() < 5e-4
    return read, curve


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
def test_parts_of_files_bend_back_with_their_holes_at_nodes_and_their_outlines_at_edges(name, tmp_path):
    """Of both layers: all that the bolt of a node goes through lies on its line."""
    _, graph = graph_of(name, 0.2)
    found, holed = parts_of(name, 0.2), set()
    for part in (*found.pieces, *found.covers):
        read, curve = assert_folds_back(part, graph, tmp_path)
        assert read.diameters <= {12.0}
        assert read.engraved >= len(part.id)
        # both edges keep their lengths too: the strip is bent in its plane as much as the surface asks
        for side in (1, -1):
            along, left = read.beside_axis(read.outline)
            edge = read.outline[side * left > 0]
            flat = np.linalg.norm(np.diff(edge, axis=0), axis=1).sum()
            order = np.argsort(along)[side * left[np.argsort(along)] > 0]
            dense = np.linspace(along[order[0]], along[order[-1]], 2000)
            space, _ = curve.points(dense, np.interp(dense, along[order], left[order]))
            assert np.linalg.norm(np.diff(space, axis=0), axis=1).sum() == pytest.approx(flat, abs=5e-4)
    for part in found.pieces:
        holed |= {(hole.bolt, part.member) for hole in part.holes}
    wanted = {(node.id, name) for node in graph.nodes if node.kind == "crossing" for name in node.members}
    assert holed >= wanted  # a hole in both layers of every node


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
def test_outlines_are_at_the_edges_that_were_drawn(name, tmp_path):
    """Within half a millimetre of the half-width that the stripes were given, by a finer mesh; the hypar's differs."""
    graph = graph_of(name, 0.1)[1]
    for part in parts_of(name, 0.1).pieces:
        read, _, _ = bent(part, graph, tmp_path)
        _, left = read.beside_axis(read.outline)
        if name != "hypar" and graph.by_id[part.member].length > 3:
            assert np.abs(np.abs(left) - WIDTH / 2).max() < 5e-4


# --- closed forms


def bays_of(name, edge, layering=LAYERING):
    """(family, number, numbers of crossing members, metres along a layer) from hole to hole of one piece."""
    _, graph = graph_of(name, edge)
    nodes = {node.id: node for node in graph.nodes}
    layers = {}  # of which pieces are parts
    for part in parts_of(name, edge, layering).pieces:
        member = graph.by_id[part.member]
        if (part.member, part.layer) not in layers:
            course = member_course(graph, member, 3 * layering.bolt, 2 * layering.half_cover_length)
            layers[part.member, part.layer] = Development(course, part.layer)
        layer, known = layers[part.member, part.layer], []
        for hole in part.holes:
            if hole.bolt in nodes and nodes[hole.bolt].kind == "crossing":
                node = nodes[hole.bolt]
                s, _ = layer.piercing_point(node.point, node.normal, node.at[node.members.index(member.id)])
                other = graph.by_id[next(one for one in node.members if one != member.id)]
                if ASIDE < s < member.length - ASIDE:
                    known.append((s, other.stripe, hole))
        for (s, i, one), (z, j, two) in pairwise(known):
            along = float(np.diff(np.interp([s, z], layer.course.s, layer.length))[0])
            yield member, i, j, along, float(np.linalg.norm(two.at - one.at)), part.layer


def layer_bay_errors(name, edge):
    given, _ = graph_of(name, edge)
    found = []
    for member, i, j, along, straight, h in bays_of(name, edge):
        truth = given.truth(member.family, member.stripe)
        bay = truth["bay"](min(i, j)) if callable(truth["bay"]) else truth["bay"]
        if name == "sphere":
            wanted = abs(j - i) * bay * (6.5 + h) / 6.5
        elif name == "cylinder":
            wanted = abs(j - i) * bay * np.hypot((4.45 + h) / 4.45, 1) / np.sqrt(2)
        elif name == "hypar":  # a straight line that the surface twists about: tg = c / (c^2 + x^2)
            c, x = 6.0, 0.6 * (member.stripe - 0.25)
            ends = np.array([0.6 * (k - 0.25) for k in (i, j)])
            y = np.linspace(ends.min(), ends.max(), 2001)
            tg = c / np.hypot(c, x) / (c**2 + x**2 + y**2) * np.hypot(c, x)
            wanted = np.trapezoid(np.hypot(1, h * tg), y) * np.hypot(1, x / c)
        else:
            wanted = _catenoid_bay(member, i, j, h)
        found.append(along - wanted)
        assert straight == pytest.approx(along, abs=4e-3)  # bent in the plane, beside the middle line
    return np.abs(found)


def _catenoid_bay(member, i, j, h, c=3.0):
    """A parallel of r = c cosh(v / c) grows by h / cosh with its normal; a meridian bends by 1 / (c cosh^2)."""
    if member.family == "major":
        v = 0.5 * member.stripe + 0.2
        return abs(j - i) * 0.2 * (c * np.cosh(v / c) + _outward(member) * h / np.cosh(v / c))
    v = np.linspace(0.5 * min(i, j) + 0.2, 0.5 * max(i, j) + 0.2, 2001)
    return np.trapezoid(np.cosh(v / c) * (1 - _outward(member) * h / (c * np.cosh(v / c) ** 2)), v)


def _outward(member):
    """1 where the normals of a surface of revolution about z point away from the axis, else -1."""
    axis = member.axis
    return np.sign(np.einsum("ki,ki->k", axis.N[:, :2], axis.P[:, :2]).mean())


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["sphere", "catenoid", *(pytest.param(name, marks=pytest.mark.slow) for name in ("cylinder", "hypar"))]
)
def test_bays_of_both_layers_converge_to_the_offset_surface(name):
    coarse, fine = (layer_bay_errors(name, edge) for edge in (0.4, 0.2))
    assert len(fine) > 60
    assert fine.max() < 2.5e-3
    assert np.median(fine) < 0.6 * np.median(coarse)


@pytest.mark.slow
@pytest.mark.parametrize("name", SURFACES)
def test_bays_of_both_layers_are_right_to_three_quarters_of_a_millimetre(name):
    """The axes on these meshes have bays that are right to seven tenths."""
    found = layer_bay_errors(name, 0.1)
    assert found.max() < 0.75e-3
    assert found.max() < 0.6 * layer_bay_errors(name, 0.2).max()


def test_bays_of_a_layer_over_a_sphere_grow_with_its_radius():
    """bay (R + h) / R, half a millimetre at most apart, for four layers of 20 mm."""
    layering = Layering(0.02, 4, 0.012)
    graph, heights = graph_of("sphere", 0.2)[1], set()
    for member, _, _, along, _, h in bays_of("sphere", 0.2, layering):
        heights.add(round(h, 3))
        on_axis = graph.bays(member.id)
        assert np.abs(on_axis * (6.5 + h) / 6.5 - along).min() < 5e-4
    assert heights == {0.03, 0.01, -0.01, -0.03}


def test_strips_over_a_sphere_are_rings_of_a_plane():
    """A parallel of an offset sphere develops to an arc of radius (R + h) tan t; holes lie on it, edges beside it."""
    graph = graph_of("sphere", 0.2)[1]
    for part in parts_of("sphere", 0.2).pieces:
        member = graph.by_id[part.member]
        if member.family == "major" and len(part.holes) > 4:
            middle, radius = fitted_circle(np.array([hole.at for hole in part.holes]))
            wanted = (6.5 + part.layer) * np.tan(0.33 + 0.1 * member.stripe)
            assert radius == pytest.approx(wanted, rel=0.04)
            away = np.abs(np.linalg.norm(part.outline - middle, axis=1) - radius)
            assert away == pytest.approx(np.full(len(away), member.mean_width / 2), abs=4e-3)


def fitted_circle(P):
    """Middle and radius of the circle nearest to points (k, 2) [Kasa 1976]."""
    A = np.c_[2 * P, np.ones(len(P))]
    x, y, c = np.linalg.lstsq(A, (P**2).sum(axis=1), rcond=None)[0]
    return np.array([x, y]), np.sqrt(c + x**2 + y**2)
