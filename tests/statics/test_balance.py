"""Reactions per support and sums of forces and moments: levers and cantilevers by hand, and what `build` writes."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from dsfab import load_preset, run
from dsfab.report.design.facts import design_facts
from dsfab.statics import Elements, Material, SheetModel, resultant, solve_statics, spread_load, support_reactions
from dsfab.surface import Box, Line, LoadCase, Side, Snow, Support, Vertices
from tests.presets import BARREL_VAULT_MODES
from tests.shapes import ZOO, grid, zoo

STEEL = Material(210e9, 0.3, 7850.0)
PAIRS = [Elements("constant", "hinge"), Elements("constant", "midedge"), Elements("quadratic", "hhj")]
pairs = pytest.mark.parametrize("elements", PAIRS, ids=str)


def solved(surface, supports, loads, elements):
    load = LoadCase.build(surface, supports, loads)
    spread = spread_load(surface, loads)
    return load, solve_statics(SheetModel(surface, STEEL, 0.01), load, elements, spread)


@pairs
def test_two_supports_share_a_load_as_a_lever_does(elements):
    """A line load of 30 N at a quarter of the span: three quarters go to the near end; moments are about the origin."""
    s = grid(8, 2, 2.0, 0.5)
    supports = [Support(Side("x", "min"), "xyz"), Support(Side("x", "max"), "z")]
    load, answer = solved(s, supports, [Line(Box((0.5, 0, 0), (0.5, 0.5, 0)), (0, 0, -60.0), "all")], elements)
    near, far = support_reactions(s, supports, answer)
    assert_allclose(near.force, [0, 0, 22.5], atol=1e-6)
    assert_allclose(far.force, [0, 0, 7.5], atol=1e-6)
    assert_allclose(near.moment, [22.5 * 0.25, 0, 0], atol=1e-6)
    assert_allclose(far.moment, [7.5 * 0.25, -7.5 * 2, 0], atol=1e-6)
    loads = resultant(s, load.force)
    assert_allclose(loads.force, [0, 0, -30], atol=1e-12)
    assert_allclose(loads.moment, [-30 * 0.25, 30 * 0.5, 0], atol=1e-12)


@pairs
def test_a_built_in_end_answers_with_its_moment_too(elements):
    """Faces that are held wholly do not turn: with rotations on edges a part of the moment is there."""
    s = grid(8, 2, 2.0, 0.5)
    supports = [Support(Side("x", "min", depth=0.25))]
    _, answer = solved(s, supports, [Line(Side("x", "max"), (0, 0, -60.0))], elements)
    (end,) = support_reactions(s, supports, answer)
    assert_allclose(end.force, [0, 0, 30], atol=1e-6)
    assert_allclose(end.moment, [30 * 0.25, -30 * 2, 0], atol=1e-5)
    assert (len(answer.torque) == 0) == (elements.bending == "hinge")
    if len(answer.torque):
        without = resultant(s, answer.reaction)
        assert np.abs(without.moment - end.moment).max() > 1
        free = s.V[s.edges.ends][:, :, 0].max(axis=1) > 0.25 + 1e-9
        assert not answer.torque[free].any()


def test_supports_on_the_same_vertices_share_equally():
    s = grid(8, 2, 2.0, 0.5)
    supports = [Support(Side("x", "min")), Support(Side("x", "min"), "z"), Support(Side("x", "max"), "z")]
    _, answer = solved(s, supports, [Snow(100.0)], PAIRS[1])
    both, again, other = support_reactions(s, supports, answer)
    assert both.force[2] == pytest.approx(25, rel=1e-6)
    assert again.force[2] == pytest.approx(25, rel=1e-6)
    assert other.force[2] == pytest.approx(50, rel=1e-6)


@zoo
@pairs
def test_the_supports_together_balance_the_loads(name, elements):
    s = ZOO[name]()
    k = s.n // 2 if name == "two pieces" else s.n
    lows = [np.arange(s.n) < k, np.arange(s.n) >= k]
    supports = [
        Support(Vertices(tuple(s.F[part[s.F].all(axis=1)][:3].ravel().tolist()))) for part in lows if part.any()
    ]
    load, answer = solved(s, supports, [Snow(1000.0, (0.3, 0.2, -1.0))], elements)
    loads, parts = resultant(s, load.force), support_reactions(s, supports, answer)
    assert len(parts) == len(supports)
    size = np.abs(load.force).sum()
    assert_allclose(sum(part.force for part in parts), -loads.force, atol=1e-6 * size)
    reach = np.abs(s.V).max()
    assert_allclose(sum(part.moment for part in parts), -loads.moment, atol=1e-5 * size * reach)


def test_a_design_tells_its_balance():
    """A vault on its two springing lines, under snow and wind: the lee side carries another share."""
    lines = [{"at": {"pick": "side", "axis": "y", "end": end}, "hold": "xyz"} for end in ("min", "max")]
    loads = [{"kind": "snow", "pressure": 900.0}, {"kind": "wind", "pressure": 600.0, "direction": [0, 1, 0]}]
    changes = {"surface.edge": 0.5, "surface.support": lines, "surface.load": loads, "statics.bending": "midedge"}
    design = run(load_preset(BARREL_VAULT_MODES, changes))
    told = design_facts(design, dict(design.seconds), [], [])["statics"]
    supports = design.preset.surface.support
    assert [part["hold"] for part in told["supports"]] == [support.hold for support in supports]
    assert_allclose(np.sum([part["reaction_N"] for part in told["supports"]], axis=0), told["reaction_N"], atol=1e-6)
    size = np.abs(design.load.force).sum()
    assert_allclose(told["reaction_N"], -np.array(told["load_N"]), atol=1e-6 * size)
    assert_allclose(
        told["reaction_moment_Nm"], -np.array(told["load_moment_Nm"]), atol=1e-6 * size * design.surface.size
    )
    assert told["load_N"][2] == pytest.approx(-900 * 80, rel=0.3)
    assert told["load_N"][1] > 0
    assert told["supports"][0]["reaction_N"] != pytest.approx(told["supports"][1]["reaction_N"], rel=0.01)
    assert json.dumps(told)
