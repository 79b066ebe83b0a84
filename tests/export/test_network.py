"""STEP by members: curves, patches, lifting and nets by closed forms; the solids by OCCT (slow)."""

import json
import re
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array, eye_array

from dsfab.core.errors import ExportError
from dsfab.core.limits import DEFLECTION
from dsfab.export import StepOptions, write
from dsfab.export.cad.step import soundness
from dsfab.export.cad.step.by_members import borders, draft, patch_sides
from dsfab.export.cad.step.by_members.borders import straight_net, without_crossings
from dsfab.export.cad.step.by_members.build import RoughError, TriangleReport, require_solid
from dsfab.export.cad.step.by_members.curves import ChainCurve, SampledChain, curves_through, on_skins, parts_of
from dsfab.export.cad.step.by_members.draft import ManyFacesError, NetWriter, member_draft
from dsfab.export.cad.step.by_members.fillets import without_fillets
from dsfab.export.cad.step.by_members.lines import ChainLine, NetLines, with_ends_on_lines
from dsfab.export.cad.step.by_members.model import NetEdge, NetModel, NetPatch
from dsfab.export.cad.step.by_members.patch_sides import SideStations, paired_shares, quad_of
from dsfab.export.cad.step.by_members.patches import coons, height_rows, least_jacobian, patch_excess, patches_on_skins
from dsfab.export.cad.step.by_members.region_division import is_narrow_end, with_cut_ends
from dsfab.export.cad.step.by_members.regions import VOID, Chain, ChainNet, joined_outlines, net_of, without_lenses
from dsfab.export.cad.step.by_members.trimmed import SPLIT, height_surface, trimmed_face
from dsfab.export.cad.step.entities import StepEntities
from dsfab.export.cad.step.shared.plan import SolidPlan
from dsfab.export.cad.step.worker import program, reports
from dsfab.export.part import StripedSheet
from dsfab.export.splines import Spline, bernstein
from dsfab.export.subprocesses import run_program
from dsfab.study.file_check import read_shipped
from dsfab.surface import SHAPES, Surface, nearest_places
from dsfab.surface.topology import on_boundary
from tests.export.member_networks import (
    RADIUS,
    T,
    asked,
    cylinder_grid,
    cylinder_strip,
    draft_of,
    flat_model,
    flat_strip,
    lifting_of,
    striped,
)


def bent_strip() -> Surface:
    """A coarse cylinder that turns by 15 degrees at every second vertex, as where diagonals were cut."""
    given = cylinder_strip(columns=12)
    V = given.V.reshape(13, 13, 3).copy()
    V[1::2] = (V[:-1:2] + V[2::2]) / 2
    return Surface(V.reshape(-1, 3), given.F)


def two_chains_of_a_line(x: float, seed: int) -> tuple[NetLines, ChainCurve]:
    """A line of two cubics, of chain 0 up to x, and of chain 1 backwards beyond."""
    spans = np.random.default_rng(seed).normal(size=(2, 4, 6))
    spans[1, 0] = spans[0, 3]
    curve = ChainCurve(np.array([0.0, 0.4, 1.0]), spans)
    net = ChainNet(csr_array((0, 0)), {}, {}, frozenset(), np.zeros(0, dtype=np.int64))
    return NetLines(net, [ChainLine([(0, True), (1, False)], curve, np.array([0.0, x, 1.0]))]), curve


@settings(max_examples=30, deadline=None)
@given(st.floats(0.05, 0.95), st.integers(0, 10**6))
def test_curves_of_chains_are_parts_of_one_line_and_follow_its_moved_ends(x, seed):
    lines, whole = two_chains_of_a_line(x, seed)
    at = np.linspace(0, 1, 21)
    np.testing.assert_allclose(lines.curve(0)(at), whole(x * at), atol=1e-12)
    np.testing.assert_allclose(lines.curve(1)(at), whole(1 + (x - 1) * at), atol=1e-12)
    curve = ChainCurve(np.array([0.0, 1.0]), whole.spans[:1])
    ends = np.arange(6.0), -np.arange(6.0)
    moved = curve.with_ends(*ends)
    np.testing.assert_array_equal(moved.spans[0, [0, -1]], ends)
    ways = [end - pole for end, pole in zip(ends, curve.spans[0, [0, -1]], strict=True)]
    np.testing.assert_allclose(moved(at) - curve(at), np.outer(1 - at, ways[0]) + np.outer(at, ways[1]), atol=1e-12)


def test_curves_of_all_chains_are_cut_out_of_lines_at_once(monkeypatch):
    lines, _ = two_chains_of_a_line(0.7, 0)
    asked, parts = [], NetLines.parts
    monkeypatch.setattr(NetLines, "parts", lambda self, some: asked.append(len(some)) or parts(self, some))
    assert [len(lines.curve(k).spans) for k in (0, 1)] == [2, 1]
    assert asked == [3]


@settings(max_examples=30, deadline=None)
@given(st.floats(0.01, 0.99), st.integers(2, 9), st.integers(0, 10**6))
def test_a_chain_goes_from_its_end_to_the_point_within_reach(x, count, seed):
    chain = SampledChain(np.random.default_rng(seed).normal(size=(count, 6)), True)
    there = [np.interp(x * chain.lengths[-1], chain.lengths, column) for column in chain.Q.T]
    np.testing.assert_allclose(chain.point(x), there, atol=1e-12)
    reach = min(x, 0.5) * chain.lengths[-1]
    for first, share in ((True, min(x, 0.5)), (False, 1 - min(x, 0.5))):
        way, across = chain.direction(first, float(reach))
        there, end = chain.point(share), chain.Q[0 if first else -1]
        np.testing.assert_allclose(way, (there - end).reshape(2, 3).mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(across * np.linalg.norm(end[:3] - end[3:]), end[:3] - end[3:], atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 4), st.integers(1, 3), st.integers(0, 10**6))
def test_coons_patches_end_in_the_curves_and_meet_each_other(ku, kv, seed):
    rng = np.random.default_rng(seed)
    corner = {(u, v): np.array([u, v, 0.0]) for u in (0, 1) for v in (0, 1)}
    bottom, top = (_side(rng, corner[0, v], corner[1, v], ku) for v in (0, 1))
    left, right = (_side(rng, corner[u, 0], corner[u, 1], kv) for u in (0, 1))
    P = coons(bottom, right, top, left)
    assert P.shape == (ku, kv, 4, 4, 3)
    np.testing.assert_array_equal(P[:, 0, :, 0], bottom)
    np.testing.assert_array_equal(P[:, -1, :, -1], top)
    np.testing.assert_array_equal(P[0, :, 0], left)
    np.testing.assert_array_equal(P[-1, :, -1], right)
    np.testing.assert_allclose(P[1:, :, 0], P[:-1, :, -1], atol=1e-12)
    np.testing.assert_allclose(P[:, 1:, :, 0], P[:, :-1, :, -1], atol=1e-12)


def _side(rng, a, b, count):
    """Wavy spans from a to b, one beginning where the other ends."""
    joints = a + np.linspace(0, 1, count + 1)[:, None] * (b - a)
    joints[1:-1] += rng.normal(size=(count - 1, 3)) / 20
    P = joints[:-1, None] + np.arange(4)[:, None] / 3 * np.diff(joints, axis=0)[:, None]
    P[:, 1:3] += rng.normal(size=(count, 2, 3)) / 20
    P[1:, 0], P[:, 3] = joints[1:-1], joints[1:]
    P[0, 0] = a
    return P


def on_sphere(angles):
    """(k, 6) points of two spheres with radii of 1010 and 990 over longitudes and latitudes (k, 2)."""
    a, b = angles.T
    n = np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], axis=1)
    return np.concatenate([1010 * n, 990 * n], axis=1)


def to_sphere(Q):
    """(k, 6) from points to these spheres."""
    n = Q[:, :3] / np.linalg.norm(Q[:, :3], axis=1)[:, None]
    return np.concatenate([1010 * n, 990 * n], axis=1) - Q


def test_chains_lie_on_the_skins_where_a_line_is_near_enough():
    """80 mm of a parallel of a sphere of 1 m: a line below by .8 mm is within 2 mm, and becomes a cubic on it."""
    chain = on_sphere(np.stack([np.linspace(0, 0.08, 50), np.full(50, 0.1)], axis=1))
    x = np.linspace(0, 1, 41)
    below, on = (on_skins(curves_through([chain], [2.0]), away)[0](x) for away in (np.zeros_like, to_sphere))
    assert np.abs(to_sphere(below)).max() > 0.7
    assert np.abs(to_sphere(on)).max() < 0.01
    np.testing.assert_allclose(on[[0, -1]], chain[[0, -1]], atol=1e-9)


def test_patches_lie_on_the_skins_between_their_borders():
    """A region of 900 x 400 mm on a sphere of 1 m, two spans by one: its Coons patches stray by 1.7 mm."""
    x = np.linspace(0, 1, 200)
    ends = [((0, 0), (0.9, 0)), ((0.9, 0), (0.9, 0.4)), ((0, 0.4), (0.9, 0.4)), ((0, 0), (0, 0.4))]
    lines = [on_sphere(a + x[:, None] * np.subtract(b, a)) for a, b in ends]
    curves = on_skins(curves_through(lines, [0.1] * len(lines)), to_sphere)
    coarse = coons(*(curve.spans for curve in curves))
    (fine,) = patches_on_skins([coarse], to_sphere)
    B = bernstein(x[::20])
    off = [np.abs(to_sphere(np.einsum("xa,yb,klabi->klxyi", B, B, P).reshape(-1, 6))).max() for P in (coarse, fine)]
    assert off[0] > 1.5
    assert off[1] < 0.1
    for border in (np.s_[:, 0, :, 0], np.s_[:, -1, :, -1], np.s_[0, :, 0], np.s_[-1, :, -1]):
        np.testing.assert_array_equal(fine[border], coarse[border])
    np.testing.assert_allclose(fine[1, 0, 0], fine[0, 0, -1], atol=1e-9)


def test_the_least_jacobian_detects_folded_patches():
    x = np.linspace(0, 1, 4)
    square = np.stack(np.broadcast_arrays(x[:, None], x[None], 0.0), axis=2)
    assert least_jacobian(square) == pytest.approx(1)
    folded = square.copy()
    folded[-1, -1] = [-0.5, -0.5, 0]
    assert least_jacobian(folded) < 0
    assert bernstein(np.array([0.3])).sum() == pytest.approx(1)


def test_lifted_points_lie_on_cylinder_and_sphere():
    """Off by the fourth order of the edges; the middles of the triangles themselves by the second."""
    for surface, centre in (
        (cylinder_strip(), np.array([0.0, 1, 1])),
        (SHAPES["sphere"](radius=RADIUS, edge=0.2), np.ones(3)),
    ):
        lifting = lifting_of(surface)
        rows = np.repeat(np.arange(surface.m), 3)
        inner = ~on_boundary(surface.edges, surface.n)[surface.F].any(axis=1)  # normals there are one-sided
        W = csr_array((np.full(3 * surface.m, 1 / 3), (rows, surface.F.ravel())), shape=(surface.m, surface.n))[inner]
        Q = lifting.points(W) / 1000
        chord = np.abs(np.linalg.norm(W @ surface.V * centre, axis=1) - RADIUS).max()
        for some, r in ((Q[:, :3], RADIUS + T / 2), (Q[:, 3:], RADIUS - T / 2)):
            assert np.abs(np.linalg.norm(some * centre, axis=1) - r).max() < min(0.12 * chord, 2e-4)


def test_a_crease_is_lifted_by_a_fifth_of_the_thickness_at_most():
    """Two sides of a roof, 1 m wide: the quadratic between their normals would leave them by 125 mm."""
    V = np.array([[-1, 0, 0], [-1, 1, 0], [0, 0, 1], [0, 1, 1], [1, 0, 0], [1, 1.0, 0]])
    roof = Surface(V, np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]]))
    W = csr_array(np.array([[0.5, 0, 0.5, 0, 0, 0], [0, 0, 0.25, 0.25, 0.25, 0.25]]))
    Q = lifting_of(roof).points(W)
    away = np.linalg.norm((Q[:, :3] + Q[:, 3:]) / 2 - 1000 * (W @ V), axis=1)
    assert away == pytest.approx([0.2 * 1000 * T] * 2, rel=0.01)


def test_a_part_of_a_region_does_not_bend_where_the_rest_does():
    """A triangle, points in and beside it, and one beyond where the sheet has turned by 90 degrees."""
    model, loop = flat_model(np.array([[0, 0], [300, 0], [0, 300.0]]))
    points = np.array([[50.0, 50, 20, 50, 50, -20], [900, 0, 50, 900, 0, 10], [900, 0, -400, 860, 0, -400]])
    face = trimmed_face(model, [loop], points, asked(0.01, 1.0), part=True)
    assert face.gap < 1e-6
    np.testing.assert_allclose(face.outer[..., 2], 20, atol=1e-6)
    with pytest.raises(ExportError, match="bends too much"):
        trimmed_face(model, [loop], points, asked(0.01, 1.0))


def test_a_trimmed_face_does_not_wave_to_meet_edges_that_no_surface_meets():
    """Half a flat ring whose edges jump by .4 mm: what is nearest to them was 13 mm off between them."""
    turn, r = np.linspace(0, np.pi, 73), np.linspace(600, 1200, 9)
    edges = np.concatenate([ring_points(turn, 600), ring_points(turn, 1200), ring_points(0, r), ring_points(np.pi, r)])
    edges[:, 2] = 0.2 * np.sign(np.sin(9 * np.arctan2(edges[:, 1], edges[:, 0])))
    inside = ring_points(np.linspace(0, np.pi, 7)[1:-1], np.array([[800.0], [1000]]))
    poles, _, gap, _ = height_surface(inside, edges, np.zeros((0, 3)), np.eye(3), asked(1e-3, 1.0))
    uv = ((ring_points(np.linspace(0, np.pi, 61), r[:, None]) - poles[0, 0]) / (poles[-1, -1] - poles[0, 0]))[:, :2]
    assert np.abs(height_rows(uv, len(poles) - 1) @ poles[..., 2].ravel()).max() < 0.5
    assert gap < 0.4


def test_the_gap_of_a_trimmed_face_is_found_along_a_long_edge():
    """A long curved edge and four short ones of a region on a ball of 4 m; eight steps of each saw half of the gap."""
    corners = np.array([[0, 0], [2400, 0], [2400, 300], [2200, 500], [200, 500], [0, 300.0]])
    model, loop = flat_model(corners)
    for i, edge in enumerate(model.edges):
        P = edge.poles.copy()
        if i == 0:
            P[1:3, [1, 4]] -= 700
        x = np.linalg.norm(P[:, :2] - [1200, 200], axis=1)
        P[:, 2], P[:, 5] = (np.sqrt(4000**2 - x**2) + z for z in (20, -20))
        model.edges[i] = replace(edge, poles=P)
    inside = np.array([[x, y, 0, x, y, 0] for x in np.linspace(300, 2100, 9) for y in (0, 150, 300.0)])
    height = np.sqrt(4000**2 - ((inside[:, :2] - [1200, 200]) ** 2).sum(axis=1))
    inside[:, 2], inside[:, 5] = height + 20, height - 20
    face = trimmed_face(model, [loop], inside, asked(0.01, 5.0))
    lines = np.concatenate([bernstein(np.linspace(0, 1, 400)) @ edge.poles for edge in model.edges])
    assert face.gap == pytest.approx(float(heights_off(face.outer, lines[:, :3]).max()), rel=0.1)


def heights_off(poles: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(k,) how far points (k, 3) are above or below a surface over a rectangle of the plan."""
    ways = (poles[[-1, 0], [0, -1]] - poles[0, 0])[:, :2]
    uv = (points - poles[0, 0])[:, :2] @ (ways / (ways**2).sum(axis=1)[:, None]).T
    return np.abs(height_rows(uv, len(poles) - 1) @ poles[..., 2].ravel() - points[:, 2])


def test_edges_that_waves_keep_from_a_surface_are_near_enough_to_be_split():
    """Waves of 1.5 mm along a strip of 3 m: no surface of the usual degrees is within .045 mm of its edges."""
    x = np.linspace(-1500, 1500, 241)
    edges = np.concatenate([np.stack(np.broadcast_arrays(x, y, 1.5 * np.sin(x / 160)), axis=1) for y in (-150, 150.0)])
    inside = np.stack(np.broadcast_arrays(x[::8], 0.0, 1.5 * np.sin(x[::8] / 160)), axis=1)
    _, _, gap, off = height_surface(inside, edges, np.zeros((0, 3)), np.eye(3), asked(1e-3, 1.0))
    assert gap <= SPLIT
    assert off <= 1.0


def test_a_parabola_is_itself_however_little_of_its_square_is_a_region():
    """Poles that no point holds are those of the parabola, which second differences alone would flatten."""
    x, y = np.meshgrid(np.linspace(0, 1000, 41), (0.0, 1.0), indexing="ij")
    edges, inside = (
        np.stack([a, 40 * b + 0.2 * a, a**2 / 2000 + a * b], axis=2).reshape(-1, 3) for a, b in ((x, y), (x, y / 2))
    )
    edges[:, 2], inside[:, 2] = ((P[:, 0] ** 2 + P[:, 1] ** 2) / 4000 for P in (edges, inside))
    poles, _, gap, off = height_surface(inside, edges, np.zeros((0, 3)), np.eye(3), asked(1e-3, 1.0))
    assert max(gap, off) < 1e-3
    corners = poles[[0, 0, -1, -1], [0, -1, 0, -1]]
    np.testing.assert_allclose(corners[:, 2], (corners[:, :2] ** 2).sum(axis=1) / 4000, atol=1)


def test_the_rectangle_of_a_strip_follows_its_direction():
    """At 30 degrees to both axes; a rectangle along them has six times the strip's area."""
    strip = np.array([[x, y, 0.0] for x in np.linspace(0, 900, 46) for y in (-30, 30)])
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    edges = strip @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    poles, *_ = height_surface(edges[:2], edges, np.zeros((0, 3)), np.eye(3), asked(1e-3, 1.0))
    long, wide = np.linalg.norm(poles[[-1, 0], [0, -1]] - poles[0, 0], axis=1)
    assert sorted([long, wide]) == pytest.approx([62, 902], abs=1e-6)


def ring_points(turn, r) -> np.ndarray:
    """(k, 3) points around the origin."""
    return np.stack(np.broadcast_arrays(r * np.cos(turn), r * np.sin(turn), 0.0), axis=-1).reshape(-1, 3)


def test_a_plain_sheet_is_one_patch_and_a_grid_has_every_side_twice():
    for plain in (flat_strip(), bent_strip()):
        net = net_of(striped(plain), plain.V, lifting_of(plain).skins.normals, T)
        assert [len(loops) for loops in net.loops.values()] == [1]
        assert len(net.chains) == 4
    given = cylinder_strip()
    lifting = lifting_of(given)
    net = without_fillets(net_of(cylinder_grid(given), given.V, lifting.skins.normals, T), lifting)
    assert len(net.loops) == 8  # four crossings, four stretches between them
    steps = [step for loops in net.loops.values() for loop in loops for step in loop]
    for k, chain in net.chains.items():
        assert (k, True) in steps
        assert ((k, False) in steps) == (chain.right != VOID)
    assert len(steps) == len(set(steps))


def test_faces_by_members_count_as_curved_in_dsfab_check(tmp_path):
    """Or no chord error of the mesh would be allowed there: a ring whose file was within a build's limits failed."""
    surface = cylinder_strip()
    part, _, _ = draft_of(surface, striped(surface))
    path = tmp_path / "strip.step"
    path.write_text(member_draft(part, SolidPlan(part)).text, encoding="ascii")
    assert read_shipped(path, deflection=1e-3).deflection > 0


def test_some_cubics_of_a_line_are_halved_and_nothing_moves():
    lines, curve = two_chains_of_a_line(0.4, 3)
    line = replace(lines.lines[0], curve=curve)
    halved, x = line.with_halved_spans(np.array([False, True])).curve, np.linspace(0, 1, 23)
    np.testing.assert_allclose(halved.breaks, [0, 0.4, 0.7, 1])
    np.testing.assert_allclose(halved(x), curve(x), atol=1e-12)
    np.testing.assert_array_equal(halved.spans[0], curve.spans[0])


@pytest.mark.parametrize(("wave", "long", "spans"), [(3.0, 400.0, 2), (0.2, 400.0, 1), (3.0, 30.0, 1)])
def test_cubics_that_leave_the_skins_between_their_places_are_halved(wave, long, spans):
    """Over skins that wave by 3 mm; not what waves by less than is allowed, or is shorter than the sheet is thick."""

    def away(Q: np.ndarray) -> np.ndarray:
        way = np.zeros_like(Q)
        z = wave * np.sin(4 * np.pi * Q[:, 0] / long)
        way[:, 2], way[:, 5] = z + 20 - Q[:, 2], z - 20 - Q[:, 5]
        return way

    box, share = np.array([[-np.inf] * 3, [np.inf] * 3]), np.linspace(0, long, 4)
    poles = np.stack([share, 0 * share, 0 * share + 20, share, 0 * share, 0 * share - 20], axis=1)
    line = ChainLine([(0, True)], ChainCurve(np.array([0.0, 1]), poles[None]), np.array([0.0, 1]))
    assert len(patch_sides.LineFits(1.0, box, box, away, True).halved_strays([line])[0].curve.spans) == spans


@pytest.mark.parametrize("near", [True, False])
def test_the_distance_of_patches_from_the_mesh_is_measured_at_corners_too(near):
    """Though it is on the skins in its middle: at a corner it is 1 mm farther than it may be, or nearer."""
    patch = np.zeros((1, 1, 4, 4, 6))
    x = np.linspace(0, 30, 4)
    patch[0, 0, ..., [0, 3]], patch[0, 0, ..., [1, 4]] = np.broadcast_to(x[:, None], (4, 4)), np.broadcast_to(x, (4, 4))
    asked_at = list[int]()

    def beyond(points: np.ndarray) -> np.ndarray:
        asked_at.append(len(points))
        return np.where(points[:, :2].sum(axis=1) < 1, -1.0 if near else 1.0, -1.0)

    limits = replace(asked(0.01, 1.0), beyond_mesh=beyond)
    assert patch_excess([patch, patch], limits).tolist() == [-1.0 if near else 1.0] * 2
    assert patch_excess([patch], asked(0.01, 1.0)).tolist() == [-np.inf]
    assert patch_excess([], limits).shape == (0,)
    assert asked_at == [2 * 98]


def test_the_gate_gives_the_excess_distance_of_points_from_the_mesh():
    """What is near is nearer than it may be by less than it seems: its chord error is not asked for."""
    surface = cylinder_strip(columns=8)
    part, _, _ = draft_of(surface, striped(surface))
    plan, up = SolidPlan(part), 1000 * surface.V[surface.F[:5]].mean(axis=1)
    points = np.concatenate([up + [0, 0, 100.0], part.V[:5]])
    away = nearest_places(points, part.V, part.F).distance
    np.testing.assert_allclose(
        plan.gate.excess_distances(points)[:5], (away - plan.limits.allowed_distances(points))[:5]
    )
    np.testing.assert_allclose(plan.gate.excess_distances(points)[5:], -plan.limits.distance)
    assert plan.limits.allowed_distances(points).min() > 1.5 * plan.limits.distance


def test_a_strip_is_untrimmed_and_uses_each_edge_twice():
    surface = cylinder_strip()
    part, _, _ = draft_of(surface, striped(surface))
    draft = member_draft(part, SolidPlan(part))
    assert (draft.solids, draft.trimmed) == (1, 0)
    assert draft.text.count("=B_SPLINE_SURFACE_WITH_KNOTS(") == draft.faces == draft.text.count("=ADVANCED_FACE(")
    edges, used = draft.text.count("=EDGE_CURVE("), draft.text.count("=ORIENTED_EDGE(")
    assert used == 2 * edges


def rectangle_net(arc: bool, folded: bool = False) -> tuple[ChainNet, np.ndarray, np.ndarray]:
    """A region of 2 x 1, its bottom in three chains, one of its sides shared with another region; the middle chain of
    the bottom ends where an arc does, if asked, or at folds of 20 degrees. With its points and the normals there."""
    P = np.array([[0, 0], [0.5, 0], [1, 0], [1.5, 0], [2, 0], [2, 1], [0, 1], [0.25, 0], [1.25, 0.0], [1.75, 0]])
    if arc:
        P[[2, 8], 1] = 0.3, 0.15
    steep = 0.36 * folded  # tan 20 degrees
    x = P[:, 0]
    N = np.stack(
        [
            -np.interp(x, [0.49, 0.5, 0.51, 1.49, 1.5, 1.51], steep * np.array([-1, -0.5, 0, 0, 0.5, 1])),
            0 * x,
            1 + 0 * x,
        ],
        axis=1,
    )
    z = steep * np.maximum(np.abs(x - 1) - 0.5, 0)
    ways = [[0, 7, 1], [1, 2, 8, 3], [3, 9, 4], [4, 5], [5, 6], [6, 0]]
    chains = {k: Chain(np.array(way), 0, 1 if k == 5 else VOID) for k, way in enumerate(ways)}
    loops = {0: [[(k, True) for k in chains]], 1: [[(5, False)]]}
    net = ChainNet(csr_array(eye_array(len(P))), chains, loops, frozenset(), np.zeros(0, dtype=np.int64))
    return net, np.column_stack([P, z]), N


@pytest.mark.parametrize("width", [0.2, 0.6])
def test_a_narrow_lens_joins_the_region_on_its_left(width):
    """Two squares of 1 with a lens between them that is .3 wide in its middle, .15 in the mean."""
    P = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1], [1.3, 0.5]])
    P = np.concatenate([P, np.zeros((7, 1))], axis=1)
    ways = {0: ([2, 3, 0, 1], 0, VOID), 1: ([1, 2], 0, 2), 2: ([1, 6, 2], 2, 1), 3: ([1, 4, 5, 2], 1, VOID)}
    chains = {k: Chain(np.array(points), left, right) for k, (points, left, right) in ways.items()}
    loops = {0: [[(0, True), (1, True)]], 1: [[(3, True), (2, False)]], 2: [[(2, True), (1, False)]]}
    net = ChainNet(csr_array(eye_array(7)), chains, loops, frozenset({2}), np.zeros(0, dtype=np.int64))
    done = without_lenses(net, P, width / 2)
    if width == 0.2:
        assert done.loops == loops
        return
    assert len(done.loops) == 2
    assert not done.loose
    assert len({k for loops in done.loops.values() for k, _ in loops[0]}) == 3
    for region, (loop,) in done.loops.items():
        for k, ahead in loop:
            assert region == (done.chains[k].left if ahead else done.chains[k].right)


@pytest.mark.parametrize("inner_first", [True, False])
def test_a_lens_between_an_outline_and_a_member_joins_the_member(inner_first):
    """A square of 1 whose right side is straight, and beyond it a lens of .15 in the mean, with void behind."""
    P = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1.3, 0.5, 0]])
    chains = {
        0: Chain(np.array([2, 3, 0, 1]), 0, VOID),
        1: Chain(np.array([1, 2]), 0, 2),
        2: Chain(np.array([1, 4, 2]), 2, VOID),
    }
    lens = [(1, False), (2, True)]
    loops = {0: [[(0, True), (1, True)]], 2: [lens if inner_first else lens[::-1]]}
    net = ChainNet(csr_array(eye_array(5)), chains, loops, frozenset(), np.array([0, 2]))
    assert without_lenses(net, P, 0.1).loops == loops
    done = without_lenses(net, P, 0.3)
    assert done.loops == {0: [[(0, True), (2, True)]]}
    assert sorted(done.chains) == [0, 2]
    assert (done.chains[2].left, done.chains[2].right, done.cell.tolist()) == (0, VOID, [0, 0])


@pytest.mark.parametrize("folded", [False, True])
def test_outlines_are_joined_except_at_the_begin_of_an_arc(folded):
    """What bends with the sheet is straight to those who walk on it."""
    net, P, N = rectangle_net(arc=False, folded=folded)
    done = joined_outlines(net, P, N)
    assert done.loops == {0: [[(0, True), (3, True), (4, True), (5, True)]], 1: [[(5, False)]]}
    assert done.chains[0].points.tolist() == [0, 7, 1, 2, 8, 3, 9, 4]
    net, P, N = rectangle_net(arc=True, folded=folded)
    assert joined_outlines(net, P, N).loops == net.loops


def test_sides_of_regions_are_looked_for_again_only_where_a_chain_is_another(monkeypatch):
    net, P, _ = rectangle_net(arc=False)
    chains = {k: SampledChain(np.hstack([P[chain.points], P[chain.points]]), True) for k, chain in net.chains.items()}
    for chain in chains.values():
        chain.Q[:, 5] -= 0.1
    cache, asked = draft.RegionQuads(0.01), list[int]()
    monkeypatch.setattr(draft, "quad_of", lambda region, *some: asked.append(region) or quad_of(region, *some))
    (first,), others = cache.quads(net, chains)
    quad = quad_of(0, net.loops[0], chains, 0.01)
    assert (first.region, first.sides, others) == (0, quad.sides, [1])
    assert cache.quads(net, chains)[0][0] is first
    assert asked == [0, 1]
    cache.quads(net, chains | {1: replace(chains[1])})
    assert asked == [0, 1, 0]
    cache.quads(replace(net, loops=net.loops | {1: [[(4, False)]]}), chains)
    assert asked == [0, 1, 0, 0, 1], "chain 1 is the old one again, and the other region has another outline"


def test_opposite_sides_are_divided_at_the_same_shares():
    """Arcs of .1 at both ends of a bottom of length 1, and a top of one span: parts of three lines, or of one."""
    ends = {0: ([0, 0], [0.1, 0]), 1: ([0.1, 0], [0.9, 0]), 2: ([0.9, 0], [1, 0]), 4: ([1, 1], [0, 1])}
    ends |= {3: ([1, 0], [1, 1]), 5: ([0, 1], [0, 0])}
    chains = {
        k: SampledChain(np.array([[*a, 1, *a, 0], [*b, 1, *b, 0]], dtype=float), True) for k, (a, b) in ends.items()
    }
    net, _, _ = rectangle_net(arc=False)
    quad = quad_of(0, net.loops[0], chains, 0.01)
    assert quad_of(1, net.loops[1], chains, 0.01) is None
    curves = {k: curves_through([chain.Q], [0.1])[0] for k, chain in chains.items()}
    apart = NetLines(net, [ChainLine([(k, True)], curve, np.array([0.0, 1])) for k, curve in curves.items()])
    stations = SideStations(apart, chains)
    assert stations.cells(quad) == 3
    bottom, right, top, left = stations.grid(quad)
    assert bottom == [(0, 0, 1), (1, 0, 1), (2, 0, 1)]
    assert len(right) == len(left) == 1
    np.testing.assert_allclose([(a, b) for _, a, b in top], [(1, 0.9), (0.9, 0.1), (0.1, 0)])
    np.testing.assert_allclose(sorted(stations.stops[apart.place[4][0]]), [0, 0.1, 0.9, 1])
    bow = curves_through([np.concatenate([chains[0].Q, chains[2].Q])], [0.1])[0]
    long = ChainLine([(k, True) for k in range(3)], bow, np.array([0, 0.1, 0.9, 1]))
    one = NetLines(net, [long, *apart.lines[3:]])
    assert SideStations(one, chains).cells(quad) == 1
    assert one.line_part((1, False)) == (0, 0.9, 0.1)


@pytest.mark.parametrize(("near", "trimmed"), [(True, 2), (False, 0)])
def test_a_crossing_that_one_surface_does_not_fit_is_written_as_patches(monkeypatch, near, trimmed):
    """The half of a strip is taken for a crossing, for which one face on each skin is enough."""
    given = cylinder_strip()
    angle, x = np.arctan2(*given.centroids.T[[2, 1]]) / (np.pi / 2), given.centroids[:, 0]
    part, _, _ = draft_of(given, striped(given, label=((angle > 0.5) * (1 + (x > 0.5))).astype(np.int64)))
    monkeypatch.setattr("dsfab.export.cad.step.by_members.model.MOST_CELLS", 0)
    for name in ("SPLIT", "OUTLINE_SHARE"):
        monkeypatch.setattr(draft, name, np.inf if near else -np.inf)
    made = member_draft(part, SolidPlan(part))
    assert (made.trimmed, made.faces) == (trimmed, 2 * 3 + 6)


def test_an_outline_is_looked_at_again_where_a_line_has_moved():
    """Its chains are those that it had, and another line of the net was fitted anew."""
    net, P, _ = rectangle_net(arc=False)
    ends = {k: np.tile(P[chain.points[[0, -1]]], 2) for k, chain in net.chains.items()}
    curves = {k: ChainCurve(np.array([0.0, 1]), np.linspace(*both, 4)[None]) for k, both in ends.items()}
    lines = [ChainLine([(k, True)], curve, np.array([0.0, 1])) for k, curve in curves.items()]
    model = NetModel(trimmed=dict(net.loops))
    known = draft.outline_poles(net, NetLines(net, lines), model)
    assert draft.changed_regions({}, known) == [0, 1]
    for k, seen in ((0, [0]), (5, [0, 1])):
        bent = replace(lines[k], curve=ChainCurve(np.array([0.0, 1]), lines[k].curve.spans + 0.1))
        moved = NetLines(net, [*lines[:k], bent, *lines[k + 1 :]])
        assert draft.changed_regions(known, draft.outline_poles(net, moved, model)) == seen
    assert draft.changed_regions(known, known) == []


@pytest.mark.parametrize(
    ("one", "two", "pairs"),
    [
        ([0.5], [0.55], [(0.5, 0.55)]),
        ([0.25, 0.5], [0.5], [(0.25, 0.25), (0.5, 0.5)]),
        ([0.4], [0.7], [(0.4, 0.4), (0.7, 0.7)]),
        ([0.5, 0.75], [0.52], [(0.5, 0.52), (0.75, 0.76)]),
    ],
)
def test_near_stations_pair_up_and_single_stations_get_a_partner(one, two, pairs):
    np.testing.assert_allclose(np.stack(paired_shares(np.array(one), np.array(two)), axis=1), pairs)


def test_lines_may_end_on_lines_that_end_on_lines():
    """The second line begins beside the first at .4 of it, the third beside the second at .5 of that."""
    places = {0: (0, 0), 1: (1, 0), 2: (0.4, 0.03), 3: (0.4, 1), 4: (0.43, 0.5), 5: (1, 0.5)}
    ways, rows = [(0, 2), (2, 1), (2, 4), (4, 3), (4, 5)], ((0, 1), (2, 3), (4,))
    chains = {k: Chain(np.array(ends), 0, 1) for k, ends in enumerate(ways)}
    net = ChainNet(csr_array(eye_array(6)), chains, {}, frozenset(), np.zeros(0, dtype=np.int64))
    lines = list[ChainLine]()
    for row, at in zip(rows, ([0, 0.4, 1], [0, 0.5, 1], [0, 1]), strict=True):
        first, last = (
            np.array([*places[ways[k][i]], 1, *places[ways[k][i]], 0]) for k, i in ((row[0], 0), (row[-1], 1))
        )
        curve = ChainCurve(np.array([0.0, 1]), (first + np.arange(4)[:, None] / 3 * (last - first))[None])
        lines.append(ChainLine([(k, True) for k in row], curve, np.array(at, dtype=float)))
    one, two, three = (line.curve for line in with_ends_on_lines(NetLines(net, lines)).lines)
    np.testing.assert_allclose(two.spans[0, 0], one(np.array([0.4]))[0], atol=1e-12)
    np.testing.assert_allclose(three.spans[0, 0], two(np.array([0.5]))[0], atol=1e-12)
    np.testing.assert_allclose(three.spans[0, 0, :2], [0.4, 0.5], atol=1e-12)
    np.testing.assert_array_equal(three.spans[0, -1], lines[2].curve.spans[0, -1])


def test_chains_on_a_side_of_a_region_are_one_line_on_which_a_third_ends():
    """Half of a strip, and beside it both quarters: three patches and six walls, each edge used twice."""
    given = cylinder_strip()
    angle, x = np.arctan2(*given.centroids.T[[2, 1]]) / (np.pi / 2), given.centroids[:, 0]
    part, _, _ = draft_of(given, striped(given, label=((angle > 0.5) * (1 + (x > 0.5))).astype(np.int64)))
    made = member_draft(part, SolidPlan(part))
    edges, used = made.text.count("=EDGE_CURVE("), made.text.count("=ORIENTED_EDGE(")
    assert (made.trimmed, used) == (0, 2 * edges)
    assert made.faces == 2 * 3 + 6


@pytest.mark.parametrize(("middle", "stays"), [(-0.5, False), (-0.001, True), (0.5, True)])
def test_an_end_that_turns_back_or_has_no_width_stays_with_its_member(middle, stays):
    """Of a region of 4 x 1 that runs anticlockwise its left end, by way of one point."""
    P = np.array([[0, 1.0, 0], [middle, 0.5, 0], [0, 0, 0]])
    chains = {k: Chain(np.array([k, k + 1]), 0, VOID) for k in range(2)}
    net = ChainNet(csr_array(eye_array(3)), chains, {}, frozenset(), np.zeros(0, dtype=np.int64))
    assert is_narrow_end(net, [(0, True), (1, True)], P, 0.05, np.array([0, 0, 4.0])) is stays


def rounded_grid(surface: Surface) -> StripedSheet:
    """The grid whose opening has a loose square of one cell in every corner."""
    angle, x = np.arctan2(*surface.centroids.T[[2, 1]]) / (np.pi / 2), surface.centroids[:, 0]
    along, across = (x < 0.25) | (x > 0.75), (angle < 0.2) | (angle > 0.8)
    near = (np.minimum(x, 1 - x) < 0.25 + 1 / 12) & (np.minimum(angle, 1 - angle) < 0.2 + 1 / 40)
    loose = near & ~along & ~across
    sheet = striped(surface, along | across | loose, (along + 2 * across).astype(np.int64))
    return sheet._replace(loose=loose[along | across | loose])


def test_crossings_get_whole_round_corners_and_members_keep_four_sides():
    """Each crossing has two sides of the sheet's outline, two borders, and the arc between these."""
    given = cylinder_strip()
    sheet = rounded_grid(given)
    assert sheet.loose.sum() == 8
    lifting = lifting_of(given)
    net = without_fillets(net_of(sheet, given.V, lifting.skins.normals, T), lifting)
    assert sorted(len(loop) for loops in net.loops.values() for loop in loops) == [4] * 4 + [5] * 4
    assert not net.loose
    P = net.weights @ lifting.skins.points
    for loops in net.loops.values():
        for before, after in zip([loops[0][-1], *loops[0]], loops[0], strict=False):
            assert net.ends(before)[1] == net.ends(after)[0]
    for chain in net.chains.values():
        if chain.right != VOID:  # across a member, from one end of an arc to the outline
            assert np.linalg.norm(P[chain.points[0]] - P[chain.points[-1]]) > 200


@pytest.mark.parametrize("far", [36, 8])
def test_a_long_member_is_cut_off_from_a_pointed_end(far):
    """Two walls along the strip, a straight end and one of two chains; walls that are shorter than apart stay."""
    flat = flat_strip()
    places = [(4, 4), (4, far), (6, far + 2), (8, far), (8, 4)]  # across and along the strip
    rows = [13 * along + across for across, along in places]
    weights = csr_array(eye_array(flat.n, format="csr")[rows])
    chains = {k: Chain(np.array([k, (k + 1) % 5]), 0, VOID if k in (0, 3) else 7) for k in range(5)}
    loops = {0: [[(k, True) for k in chains]], 7: [[(k, False) for k in (4, 2, 1)]]}
    net = ChainNet(weights, chains, loops, frozenset(), np.zeros(0, dtype=np.int64))
    done = with_cut_ends(net, [0], lifting_of(flat), 10.0)
    if far == 8:
        assert done is net
        return
    assert with_cut_ends(net, [0], lifting_of(flat), 500.0) is net  # what would be cut off is about 50 mm wide
    assert done.loops == {
        0: [[(0, True), (5, True), (3, True), (4, True)]],
        7: net.loops[7],
        8: [[(1, True), (2, True), (5, False)]],
    }
    assert (done.chains[5].left, done.chains[5].right, done.parent) == (0, 8, {8: 0})
    assert [done.chains[k].left for k in range(5)] == [0, 8, 8, 0, 0]
    line = done.weights[done.chains[5].points] @ flat.V
    np.testing.assert_allclose(line, np.linspace(flat.V[rows[1]], flat.V[rows[3]], len(line)), atol=1e-9)


@pytest.mark.parametrize(("deep", "regions"), [(20, 1), (1, 2)])
def test_the_inside_of_a_hairpin_joins_the_region_beside_it(deep, regions):
    """A stripe of a third of the strip's width below another, 20 of 40 columns long, or 1."""
    flat = flat_strip()
    x, y = flat.centroids[:, 0], flat.centroids[:, 1] / flat.V[:, 1].max()
    label = ((np.abs(x - 0.5) < 1 / 6) & (y < deep / 40)).astype(np.int64)
    lifting = lifting_of(flat)
    net = straight_net(net_of(striped(flat, label=label), flat.V, lifting.skins.normals, T), lifting, 1e3 * T)
    assert len(net.loops) == regions
    assert sum(chain.right != VOID for chain in net.chains.values()) == regions - 1


@pytest.mark.parametrize("sag", [1.0, 0.1])
def test_chords_of_a_straightened_chain_are_near_it(sag):
    """A quarter of a circle of 1 m."""
    h = 4 / 3 * np.tan(np.pi / 8)
    arc = Spline(np.repeat([0.0, 1], 4), 1e3 * np.array([[1, 0, 0], [1, h, 0], [h, 1, 0], [0, 1, 0]]), 3)
    P = arc(np.linspace(0, 1, borders.point_count(arc, sag)))
    off = 1e3 - np.linalg.norm((P[1:] + P[:-1]) / 2, axis=1).min()
    assert sag / 4 < off < 1.1 * sag


@pytest.mark.parametrize(("width", "within"), [(4, 0.03 * 8000 / 2008), (400, 0.55 * 2 + 0.3 / 8)])
def test_lines_are_as_far_off_as_the_mesh_allows_but_not_so_far_that_a_slit_closes(width, within):
    """Around an opening 1 m long; what is allowed is 2 mm, and the mesh's chord error .3 mm."""
    P = np.array([[0, 0], [0, width], [1000, width], [1000, 0]])
    net_chains = {k: Chain(np.array([k, (k + 1) % 4]), 0, VOID) for k in range(4)}
    net = ChainNet(csr_array(eye_array(4)), net_chains, {}, frozenset(), np.zeros(0, dtype=np.int64))
    ends = {k: P[chain.points] for k, chain in net_chains.items()}
    chains = {k: SampledChain(np.array([[*a, 1, *a, -1], [*b, 1, *b, -1]]), True, 0.3) for k, (a, b) in ends.items()}
    assert patch_sides.chain_tolerances(net, chains, 2.0) == pytest.approx(dict.fromkeys(range(4), within))


def two_squares(bulge: float, corner: bool = False) -> tuple[ChainNet, dict[int, ChainCurve]]:
    """Side by side; what is between them is of two chains, of which the first bulges so far into the left one, whose
    left wall has a corner beside that if asked."""
    P = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [0, 1], [1, 0.5], [0, 0.25]])
    left = {0: (0, 1, VOID), 1: (1, 6, 1), 2: (6, 4, 1), 3: (4, 5, VOID), 4: (5, 7 if corner else 0, VOID)}
    if corner:
        left[8] = (7, 0, VOID)
    right = {5: (1, 2, VOID), 6: (2, 3, VOID), 7: (3, 4, VOID)}
    ends = {**{k: (*one, 0) for k, one in left.items()}, **{k: (*one, 1) for k, one in right.items()}}
    chains = {k: Chain(np.array([a, b]), mine, beyond) for k, (a, b, beyond, mine) in ends.items()}
    loops = {0: [[(k, True) for k in left]], 1: [[*((k, True) for k in right), (2, False), (1, False)]]}
    curves = {}
    for k, (a, b, *_) in ends.items():
        line = P[a] + np.arange(4)[:, None] / 3 * (P[b] - P[a])
        line[1:3, 0] -= bulge * (k == 1)
        skins = np.concatenate([line, np.ones((4, 1)), line, np.zeros((4, 1))], axis=1)
        curves[k] = ChainCurve(np.array([0.0, 1]), skins[None])
    return ChainNet(csr_array(eye_array(len(P))), chains, loops, frozenset({1}), np.array([0, 1])), curves


@pytest.mark.parametrize("bulge", [1.3, 1.4])
def test_regions_merge_if_their_common_chain_crosses_an_outline(bulge):
    """A cubic whose inner poles are 1.3 aside is .98 aside in its middle, at 1.4 it is 1.05: beyond the left wall."""
    net, curves = two_squares(bulge)
    done = without_crossings(net, curves, [0, 1])
    if bulge < 4 / 3:
        assert done is net
        return
    assert sorted(done.loops) == [0]
    loop = done.loops[0][0]
    assert loop[loop.index((0, True)) :] + loop[: loop.index((0, True))] == [(k, True) for k in (0, 5, 6, 7, 3, 4)]
    assert sorted(done.chains) == [0, 3, 4, 5, 6, 7]
    assert {chain.left for chain in done.chains.values()} == {0}
    assert (done.cell.tolist(), done.loose) == ([0, 0], frozenset())


@pytest.mark.parametrize(("near", "corner", "one"), [(0.05, True, True), (0.01, True, False), (0.05, False, False)])
def test_regions_merge_if_their_common_chain_comes_near_an_outline_corner(near, corner, one):
    """The cubic that is .98 aside: .02 from the left wall, and from a corner of it if there is one."""
    net, curves = two_squares(1.3, corner)
    done = without_crossings(net, curves, [0, 1], near)
    assert (done is net) == (not one)
    assert sorted(done.loops) == ([0] if one else [0, 1])
    assert (1 in done.chains) == (not one)


def test_edges_that_are_parts_of_a_side_of_a_patch_lie_exactly_on_it():
    """A side that is two edges: OCCT takes as exact what is off by less than 1e-7 mm."""
    P = np.random.default_rng(1).uniform(-1e3, 1e3, (4, 4, 6))
    sides = [P[:, 0], P[3], P[::-1, 3], P[0, ::-1]]
    ends = np.array([0.0, 0.37, 1.0])
    parts = [*parts_of(np.array([P[:, 0]] * 2), ends[:-1], ends[1:]), *sides[1:]]
    model = NetModel(vertices=[part[0] for part in parts])
    model.edges += [NetEdge(i, (i + 1) % 5, part) for i, part in enumerate(parts)]
    model.patches.append(NetPatch([(i, True) for i in range(5)], P))
    NetWriter(new := StepEntities(), model, 40.0).faces([], {})
    points = {
        int(n): np.array(x.split(","), float)
        for n, x in re.findall(r"#(\d+)=CARTESIAN_POINT\('',\((.*?)\)\)", "".join(new.text))
    }
    curves, surfaces = (
        [
            np.array([points[int(n)] for n in re.findall(r"#(\d+)", line.split("=", 1)[1])])
            for line in new.text
            if kind in line
        ]
        for kind in ("B_SPLINE_CURVE_WITH_KNOTS", "B_SPLINE_SURFACE_WITH_KNOTS")
    )
    x = bernstein(np.linspace(0, 1, 23))
    for s in (0, 1):
        for i, (a, b) in enumerate(pairwise(ends)):
            side = bernstein(np.linspace(a, b, 23)) @ surfaces[s].reshape(4, 4, 3)[:, 0]
            np.testing.assert_allclose(x @ curves[2 * i + s], side, atol=1e-7, rtol=0)


def test_many_faces_are_written_only_on_request(monkeypatch):
    monkeypatch.setattr(draft, "UNASKED", 10)
    part, _, _ = draft_of(surface := cylinder_strip(), cylinder_grid(surface))
    assert member_draft(part, SolidPlan(part)).faces > 10
    with pytest.raises(ManyFacesError, match=r"dsfab writes more than 10 faces only on request$"):
        member_draft(replace(part, hurry=1), SolidPlan(part))


@pytest.mark.slow
def test_a_grid_is_cut_measured_and_written_by_members(tmp_path):
    surface = cylinder_strip()
    part, solid, curved = draft_of(surface, cylinder_grid(surface))
    said, path = list[str](), tmp_path / "grid.step"
    write(solid, path, step=StepOptions("members", curved=partial(lambda: curved)), note=said.append)
    assert said[0].startswith("STEP is by members")
    assert "8 of 8" in said[0]
    assert "8 of 8 fillets" in said[0]
    found = json.loads(run_program(program.__file__, "use", str(path), "2", seconds=300))
    assert (found["solids"], found["valid"], found["sound"], found["closed"]) == (1, True, 2, True)
    assert (found["boxed"], found["again"]) == (True, True)
    assert found["volume"] == pytest.approx(part.volume, rel=2e-3)
    assert found["plain"] == pytest.approx(found["volume"], rel=1e-6)


@pytest.mark.slow
def test_a_grid_is_written_by_members_and_its_trial_cut_is_valid(tmp_path, monkeypatch):
    """The same grid: one cut of it is tried, and none where it has more faces than are cut unasked."""
    surface = cylinder_strip()
    _, solid, curved = draft_of(surface, cylinder_grid(surface))
    ask, said = StepOptions(curved=partial(lambda: curved)), list[str]()
    write(solid, tmp_path / "grid.step", step=ask, note=said.append)
    assert said[0].startswith("STEP is by members")
    assert said[0].endswith("; a half-space cut valid")
    monkeypatch.setattr(soundness, "MOST_FACES", 10)
    write(solid, tmp_path / "grid.step", step=ask, note=said.append)
    assert said[1].startswith("STEP is by members")
    assert "; dsfab made no trial cut, because the solid has over" in said[1]


def test_members_of_which_occt_draws_no_solid_are_refused(inspected_pieces):
    """A triangle is turned over: `dsfab check` would fail the file."""
    part, _, _ = draft_of(surface := cylinder_strip(), cylinder_grid(surface))
    made, off = member_draft(part, made_of := SolidPlan(part)), DEFLECTION * made_of.limits.distance
    seen = []
    found = reports.findings(None, made.text, off, 60, seen.append)
    assert [one["valid"] for one in inspected_pieces] == [True]
    (mesh,) = seen
    assert mesh.solids == 1
    *away, shape = require_solid(part, made_of, made, found, [TriangleReport.from_mesh(mesh, made_of.gate)])
    assert max(away) < made_of.limits.distance
    assert shape == mesh.shape
    turned = replace(mesh, F=np.concatenate([mesh.F[:1, ::-1], mesh.F[1:]]))
    with pytest.raises(
        RoughError, match="3 edges have two triangles that face opposite sides when OCCT divides the solid"
    ):
        require_solid(part, made_of, made, found, [TriangleReport.from_mesh(turned, made_of.gate)])
    with pytest.raises(RoughError, match="OCCT cannot divide a face"):
        require_solid(part, made_of, made, found, [])
    with pytest.raises(RoughError, match="OCCT finds the curved solid along members invalid"):  # one more is made, then
        require_solid(
            part, made_of, made, [replace(found[0], valid=False)], [TriangleReport.from_mesh(mesh, made_of.gate)]
        )


@pytest.mark.slow
def test_without_stripes_the_file_is_smooth_and_says_why(tmp_path):
    surface = cylinder_strip()
    _, solid, curved = draft_of(surface, cylinder_grid(surface))
    said = list[str]()
    ask = StepOptions("members", curved=lambda: replace(curved, striped=None))
    write(solid, tmp_path / "a.step", step=ask, note=said.append)
    assert said[0].startswith("STEP is smooth")
    assert "needs the stripes" in said[0]


def test_crossings_of_outlines_are_removed_in_three_attempts(monkeypatch):
    """Here each attempt returns another net, as if it made outlines cross elsewhere."""
    surface, attempts = cylinder_strip(8, 4), list[int]()
    part, _, _ = draft_of(surface, striped(surface))

    def without(net, curves, regions, apart):
        attempts.append(len(regions))
        return replace(net)

    monkeypatch.setattr(draft, "without_crossings", without)
    assert member_draft(part, SolidPlan(part)).solids == 1
    assert len(attempts) == 3
