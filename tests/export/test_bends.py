"""STEP by members: regions that bend too much for one surface are divided by seams."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array

from dsfab.core.errors import ExportError
from dsfab.export.cad.step.by_members import draft
from dsfab.export.cad.step.by_members.borders import crossing_chains, without_crossings
from dsfab.export.cad.step.by_members.curves import ChainCurve
from dsfab.export.cad.step.by_members.draft import member_draft
from dsfab.export.cad.step.by_members.region_division import LEAST_COSINE, level
from dsfab.export.cad.step.by_members.regions import VOID, Chain, ChainNet, net_of
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.cad.step.shared.plan import SolidPlan
from dsfab.surface import Surface
from tests.export.member_networks import T, draft_of, striped


def cap(angle: float, sectors: int, cells: int = 16):
    """A square piece of a sphere of 2 m, so many radians from its middle to its edges, and its sheet: one region in the
    middle, and sectors around it."""
    u, v = np.meshgrid(*[np.linspace(-1, 1, cells + 1)] * 2, indexing="ij")
    around, down = np.arctan2(v, u), angle * np.hypot(u, v)
    V = 2 * np.stack([np.sin(down) * np.cos(around), np.sin(down) * np.sin(around), np.cos(down)], axis=2)
    i = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    a, b, c, d = (x.ravel() for x in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    surface = Surface(V.reshape(-1, 3), np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))
    x, y = (w.ravel()[surface.F].mean(axis=1) for w in (u, v))
    ring = np.hypot(x, y) > 0.8
    sector = np.floor((np.arctan2(y, x) / (2 * np.pi) + 0.5) * sectors)
    return surface, striped(surface, label=(ring * (1 + sector)).astype(np.int64))


def levelled(angle: float, sectors: int):
    """The net of a cap before and after, and the normals of its cells."""
    surface, sheet = cap(angle, sectors)
    part, _, _ = draft_of(surface, sheet)
    plan = SolidPlan(part)
    lifting = Lifting.from_sheet(plan.surface, plan.curved)
    net = net_of(sheet, surface.V, lifting.skins.normals, T)
    normals = surface.normals
    return net, level(net, sheet, lifting, plan.limits), normals


@pytest.mark.parametrize("sectors", [8, 2])
def test_a_region_that_bends_is_divided_until_one_plane_sees_each_part(sectors):
    """With two sectors its outline has two chains: these get nodes in their middles."""
    net, done, N = levelled(1.6, sectors)
    middle = int(net.cell[N[:, 2].argmax()])
    new = set(done.loops) - set(net.loops)
    assert len(new) >= 2
    np.testing.assert_array_equal(
        np.flatnonzero(net.cell == middle), np.flatnonzero(np.isin(done.cell, [middle, *new]))
    )
    for region in {middle, *new}:
        mine = N[done.cell == region]
        mean = mine.sum(axis=0)
        assert (mine @ mean).min() > LEAST_COSINE * np.linalg.norm(mean)
    steps = [step for loops in done.loops.values() for loop in loops for step in loop]
    assert len(steps) == len(set(steps))
    for k, chain in done.chains.items():
        assert (k, True) in steps
        assert ((k, False) in steps) == (chain.right != VOID)
    for region, loops in done.loops.items():
        for loop in loops:
            for step, after in pairwise([*loop, loop[0]]):
                assert done.ends(step)[1] == done.ends(after)[0]
                assert (done.chains[step[0]].left if step[1] else done.chains[step[0]].right) == region


def test_a_region_with_little_bend_stays_undivided():
    net, done, _ = levelled(0.3, 8)
    assert done is net


@pytest.mark.slow
def test_a_region_with_a_large_bend_is_written_after_division(monkeypatch):
    """Parts whose surface is off their edges stay as they are here: to divide these takes most of the time."""
    monkeypatch.setattr(draft, "divided_faces", lambda model, faces, *_: list(faces.values()))
    part, _, _ = draft_of(*cap(1.6, 8))
    assert member_draft(part, SolidPlan(part)).faces > 2 * 9 + 8
    monkeypatch.setattr(draft, "level", lambda net, *_: net)
    with pytest.raises(ExportError, match="bends too much"):
        member_draft(part, SolidPlan(part))


@pytest.mark.parametrize("way", [1, -1])
def test_a_region_that_is_inside_out_joins_its_neighbour(way):
    """A square beside another one, and its mirror image."""
    P = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1.0]])
    ends = [(0, 1, VOID), (1, 2, 1), (2, 3, VOID), (3, 0, VOID)]
    chains = {k: Chain(np.array([a, b]), 0, beyond) for k, (a, b, beyond) in enumerate(ends)}
    chains |= {4 + k: Chain(np.array(two), 1, VOID) for k, two in enumerate([(1, 4), (4, 5), (5, 2)])}
    loops = {0: [[(k, True) for k in range(4)]], 1: [[*((k, True) for k in (4, 5, 6)), (1, False)]]}
    net = ChainNet(csr_array(eye_array(len(P))), chains, loops, frozenset(), np.array([0, 1]))
    curves = dict[int, ChainCurve]()
    for k, chain in chains.items():
        line = np.linspace(*P[chain.points], 4) * [way, 1]
        curves[k] = ChainCurve(np.array([0.0, 1]), np.column_stack([line, np.ones(4), line, np.zeros(4)])[None])
    assert crossing_chains(net, curves, 0) == (set() if way == 1 else {0, 1, 2, 3})
    assert sorted(without_crossings(net, curves, [0]).loops) == ([0, 1] if way == 1 else [0])
