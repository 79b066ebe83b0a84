"""STEP by members at round corners: arcs that go on as walls do, and borders that end on them steeply."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from dsfab.export.cad.step.by_members import patch_sides
from dsfab.export.cad.step.by_members.borders import with_steep_ends
from dsfab.export.cad.step.by_members.curves import SampledChain, curves_through
from dsfab.export.cad.step.by_members.fillets import without_short_walls
from dsfab.export.cad.step.by_members.lines import ArcsOnSkins, ChainLine, NetLines, round_chains, with_arcs
from dsfab.export.cad.step.by_members.patch_sides import Quad
from dsfab.export.cad.step.by_members.regions import VOID, Chain, ChainNet
from tests.export.member_networks import flat_strip, lifting_of

R = 30.0
MIDDLE = np.array([R, -R])
ROUND = MIDDLE + R * np.array([[np.cos(a), np.sin(a)] for a in np.deg2rad([180, 150, 120, 90])])
CORNER = np.array([[0, -200], *ROUND, [200, 0]])
"""A wall upwards, a quarter of a circle as three chords, and a wall to the right; material is on the left of them."""


UP = np.array([0.0, 0, 1, 0, 0, 1])


def corner_net(far):
    """Two regions that share a border from the third point of the round corner to a far point; points (k, 2)."""
    points = np.array([*CORNER, far, [200, 400], [-200, 400]])
    runs = [([0, 1], 0, VOID), ([1, 2, 3], 0, VOID), ([3, 4], 1, VOID), ([4, 5], 1, VOID)]
    runs += [([3, 6], 0, 1), ([6, 0], 0, VOID), ([5, 7, 8, 6], 1, VOID)]
    chains = {k: Chain(np.array(run), left, right) for k, (run, left, right) in enumerate(runs)}
    loops = {0: [[(0, True), (1, True), (4, True), (5, True)]], 1: [[(2, True), (3, True), (6, True), (4, False)]]}
    weights = csr_array(eye_array(len(points), format="csr"))
    return ChainNet(weights, chains, loops, frozenset(), np.zeros(0, dtype=np.int64)), points


def sampled(line):
    """A polyline (k, 2) with the middles of its chords, on skins of 20 mm."""
    P = np.insert(line[1:], np.arange(len(line) - 1), (line[1:] + line[:-1]) / 2, axis=0)
    P = np.concatenate([line[:1], P])
    both = [np.column_stack([P, np.full(len(P), z)]) for z in (20.0, 0.0)]
    return SampledChain(np.hstack(both), True)


def arcs_of(far, within):
    """The curves of the chains of a corner, once round ones are arcs."""
    net, points = corner_net(far)
    chains = {k: sampled(points[chain.points]) for k, chain in net.chains.items()}
    curves = curves_through([chain.Q for chain in chains.values()], [0.01] * len(chains))
    lines = NetLines(net, [ChainLine([(k, True)], curve, np.array([0.0, 1])) for k, curve in enumerate(curves)])
    limits = dict.fromkeys(chains, within)
    done = with_arcs(lines, chains, limits, round_chains(net, chains, limits), ArcsOnSkins(np.zeros_like))
    return [done.curve(k) for k in net.chains], curves


def test_arcs_are_brought_onto_the_skins_once():
    """Two chains, one of which is another one then, and an arc with other poles."""
    asked_at = list[int]()

    def away(Q: np.ndarray) -> np.ndarray:
        asked_at.append(len(Q))
        return np.zeros_like(Q)

    x = np.linspace(0, 30, 7)
    chains = {k: sampled(np.column_stack([x, 0.1 * k * x])) for k in (1, 2)}
    arcs = {k: curves_through([chain.Q], [0.01])[0] for k, chain in chains.items()}
    on = ArcsOnSkins(away)
    first, count = on(arcs, chains), len(asked_at)
    assert {k: curve.off for k, curve in first.items()} == pytest.approx({1: 0, 2: 0}, abs=0.3)
    assert on(arcs, chains)[2] is first[2]
    assert len(asked_at) == count
    high = arcs[1].with_ends(arcs[1].spans[0, 0] + 3, arcs[1].spans[-1, -1])
    second = on({1: high, 2: arcs[2]}, chains)
    assert second[1].off > 1
    assert second[2] is first[2]
    other = on(arcs, chains | {2: replace(chains[2])})
    assert other[2] is not first[2]


def directions(curve):
    """(2, 2) at both ends."""
    P = curve.spans[:, :, :2]
    ways = np.array([P[0, 1] - P[0, 0], P[-1, 3] - P[-1, 2]])
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


def test_chords_of_a_round_corner_become_the_circle_and_go_on_as_walls_do():
    done, before = arcs_of((-200, 200), within=2.0)
    for k in (1, 2):
        away = np.linalg.norm(done[k](np.linspace(0, 1, 33))[:, :2] - MIDDLE, axis=1) - R
        assert np.abs(away).max() < 0.01
        assert len(done[k].spans) == 1
    np.testing.assert_allclose(directions(done[1])[0], [0, 1], atol=1e-12)
    np.testing.assert_allclose(directions(done[2])[1], [1, 0], atol=1e-12)
    np.testing.assert_allclose(directions(done[1])[1], directions(done[2])[0], atol=1e-12)
    for k in (0, 3, 4, 5, 6):
        np.testing.assert_allclose(done[k].spans, before[k].spans, atol=1e-9)


def test_chords_that_an_arc_is_too_far_off_from_stay():
    done, before = arcs_of((-200, 200), within=0.2)
    for one, other in zip(done, before, strict=True):
        np.testing.assert_allclose(one.spans, other.spans, atol=1e-9)


def test_an_outline_keeps_its_angle_at_a_border_that_continues_it():
    done, _ = arcs_of((-200, -128), within=2.0)
    assert np.degrees(np.arccos(directions(done[1])[1] @ directions(done[2])[0])) > 10
    np.testing.assert_allclose(directions(done[1])[0], [0, 1], atol=1e-12)


def test_chords_are_round_but_not_walls_over_a_bent_mesh():
    net, points = corner_net((-200, 200))
    chains = {k: sampled(points[chain.points]) for k, chain in net.chains.items()}
    assert round_chains(net, chains, dict.fromkeys(chains, 2.0)) == {1, 2, 6}
    assert round_chains(net, chains, dict.fromkeys(chains, 0.1)) == {1, 6}
    ridge = sampled(np.array([[200.0, 0], [0, 0], [-200, 0]])).Q + np.array([0, 30, 60, 30, 0])[:, None] * UP
    assert round_chains(net, {**chains, 6: SampledChain(ridge, True)}, dict.fromkeys(chains, 2.0)) == {1, 2}


def test_an_arc_is_no_line_with_a_border_between_members():
    net, points = corner_net((-215, -37))  # straight on from the arc's last chord
    chains = {k: sampled(points[chain.points]) for k, chain in net.chains.items()}
    turn = partial(patch_sides.chain_turn, chains, 5.0)
    side = [Quad(1, ([(4, False), (2, True)], [(3, True)], [(6, True)], []))]
    assert patch_sides.line_links(net, side, turn, {1, 2}).keys().isdisjoint({(2, 0), (4, 0)})
    assert patch_sides.line_links(net, side, turn, set())[2, 0] == (4, 0)


@pytest.mark.parametrize(("far", "moves"), [((-200, -20), True), ((-200, 34), False)])
def test_a_border_along_a_round_corner_ends_where_the_wall_does(far, moves):
    flat, points = corner_net(far)
    lifting = lifting_of(flat_strip())
    at = np.column_stack([points + [500, 1000], np.zeros(len(points))])
    net = ChainNet(lifting.weights_at(at), flat.chains, flat.loops, flat.loose, flat.cell)
    done = with_steep_ends(net, lifting, 40.0)
    if not moves:
        assert done is net
        return
    assert done.chains[4].points[[0, -1]].tolist() == [1, 6]
    assert done.loops[0] == [[(0, True), (4, True), (5, True)]]
    assert done.loops[1] == [[(2, True), (3, True), (6, True), (4, False), (7, True)]]
    assert (done.chains[7].points.tolist(), done.chains[7].left) == ([1, 2, 3], 1)
    assert with_steep_ends(done, lifting, 40.0) is done


@pytest.mark.parametrize("bend", [0, 1])
def test_borders_that_end_a_millimetre_apart_end_in_one_place(bend):
    """Where the wall turns more: the other end gives way, and the wall between them is a part of its neighbour."""
    tilt = np.array([[0.0, 0], [0, 0], [0, 0], [0, 30]]) if bend else np.array([[0.0, 30], [0, 0], [0, 0], [0, 0]])
    points = np.array([*np.array([[-200, 0], [0, 0], [1.5, 0], [200, 0]]) + tilt, [-40, 200], [60, 200]])
    runs = [([0, 1], 0, VOID), ([1, 2], 1, VOID), ([2, 3], 2, VOID), ([1, 4], 0, 1), ([2, 5], 1, 2)]
    runs += [([4, 0], 0, VOID), ([5, 4], 1, VOID), ([3, 5], 2, VOID)]
    chains = {k: Chain(np.array(run), left, right) for k, (run, left, right) in enumerate(runs)}
    loops = {
        0: [[(0, True), (3, True), (5, True)]],
        1: [[(1, True), (4, True), (6, True), (3, False)]],
        2: [[(2, True), (7, True), (4, False)]],
    }
    lifting = lifting_of(flat_strip())
    at = np.column_stack([points + [500, 1000], np.zeros(len(points))])
    net = ChainNet(lifting.weights_at(at), chains, loops, frozenset(), np.zeros(0, dtype=np.int64))
    assert without_short_walls(net, lifting, 1.0).loops == loops
    done = without_short_walls(net, lifting, 2.0)
    assert sorted(done.chains) == [0, 2, 3, 4, 5, 6, 7]
    assert done.loops == loops | {1: [[(4, True), (6, True), (3, False)]]}
    assert [done.chains[k].points[0] for k in (3, 4)] == [1 + bend] * 2
    walls = [[0, 1, 2], [2, 3]] if bend else [[0, 1], [1, 2, 3]]
    assert [done.chains[k].points.tolist() for k in (0, 2)] == walls
    assert without_short_walls(done, lifting, 2.0).loops == done.loops
