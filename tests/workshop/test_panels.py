"""Panels of models: closed forms of lengths and areas between members that go through, and what is refused."""

from functools import cache

import numpy as np
import pytest
from shapely import Polygon

from dsfab.core.errors import PatternError
from dsfab.design import Design
from dsfab.members import member_graph
from dsfab.preset.file import load_preset, with_overrides
from dsfab.report.assembly import assembly_page, assembly_pdf
from dsfab.workshop import workshop_plan
from dsfab.workshop.card_models import ROOT_SHARE, TAB_GAP_SHARE, TIP_SHARE, panel_parts, scaled_graph
from tests.analytic import SURFACES, WIDTH
from tests.designs import sliced

A3 = [(0.41, 0.287)]


@cache
def graph_of(name):
    given = SURFACES[name](0.4)
    return scaled_graph(member_graph(given.surface, given.sheet(), given.pattern), 50)


@cache
def panels_of(name):
    return panel_parts(graph_of(name), 0.001, 0.003, A3)


@pytest.mark.parametrize(("name", "bay"), [("cylinder", 0.8), ("sphere", 0.65)])
def test_panels_end_at_through_members_and_tabs_before_their_middle(name, bay):
    """Between two stripes of .12 m a panel is bay - .12 long, and its tabs come to .15 of .06 from both middles."""
    tab = (1 - TAB_GAP_SHARE) * WIDTH / 2 * (ROOT_SHARE + TIP_SHARE) / 2 * WIDTH
    long, area = bay - TAB_GAP_SHARE * WIDTH, (bay - WIDTH) * WIDTH + 2 * tab
    inner = [part for part in panels_of(name).parts if part.member[0] == "B" and is_inner(part)]
    assert len(inner) > 40
    sizes, areas = 50 * np.array([part.size[0] for part in inner]), 2500 * np.array([part.area for part in inner])
    assert np.median(np.abs(sizes - long)) < 3e-3
    assert np.abs(sizes - long).max() < 0.03
    assert np.median(areas) == pytest.approx(area, rel=0.01)
    assert np.abs(areas / area - 1).max() < 0.06


def is_inner(part):
    """With a tab at both ends: eight corners more than a strip."""
    ends = len(part.outline) - 2 * len(part.axis)
    return ends == 8


@pytest.mark.parametrize("name", SURFACES)
def test_panels_are_simple_polygons_and_through_panels_are_whole(name):
    found = panels_of(name)
    assert not found.sharp
    assert all(Polygon(part.outline).is_valid and part.area > 0 for part in found.parts)
    assert found.tabs > len(found.parts)
    graph = graph_of(name)
    for member in graph.members:
        mine = [part for part in found.parts if part.member == member.id]
        cuts = sum(
            graph.by_id[other].family == "major" for node in graph.nodes_along[member.id] for other in node.members
        )
        if member.family == "major":
            assert sum(part.span[1] - part.span[0] for part in mine) == pytest.approx(member.length)
        else:
            assert len(mine) >= cuts - 1


def test_a_vault_of_panels_has_its_pages_and_panels_are_for_models():
    vault = sliced(load_preset("barrel_vault", {"surface.edge": 0.5}))
    with pytest.raises(PatternError, match="panels with tabs are only for models in card: give --model 1:50"):
        workshop_plan(
            Design.from_preset(with_overrides(vault.preset, {"workshop.route": "panels"}), vault).until("slicing")
        )
    card = {"stock": [0.42, 0.297], "thickness": 0.001, "bolt": 0.0006, "gap": 0.001, "model": 50, "route": "panels"}
    asked = with_overrides(vault.preset, {f"workshop.{key}": value for key, value in card.items()})
    design = Design.from_preset(asked, vault).until("slicing")
    plan = workshop_plan(design)
    assert any("panels in one skin" in note for note in plan.notes)
    assert not any(part.holes for part in plan.parts)
    assert not any("HOLES" in note for note in plan.notes)
    assert_on_its_base(plan)
    assert max(max(part.size) for part in plan.parts) < 0.42
    tabs = sum(part.area for part in plan.parts if part.member) * 2500 / design.sheet.surface.area
    assert 1 < tabs < 1.06
    assert assembly_pdf(plan, design).startswith(b"%PDF")
    assert '"built":[]' in assembly_page(plan, design)


def assert_on_its_base(plan):
    """Both ends of all twelve arches and of both edges have a foot in a slot that is as long as a tab is wide."""
    (base,) = (part for part in plan.parts if part.id == "base")
    assert any("28 feet of 28 parts stand in slots of the base plate" in note for note in plan.notes)
    assert len(base.slots) == 28
    sides = [sorted(np.linalg.norm(np.diff(slot, axis=0), axis=1)) for slot in base.slots]
    wide = 0.6 * 0.2 / 50 + 2e-4  # of a tab, and air at both sides
    assert [long for *_, long in sides] == pytest.approx([wide] * 28, rel=0.08)  # drawn on a coarse mesh
    inside = Polygon(base.outline)
    assert all(inside.contains(Polygon(slot)) for slot in base.slots)
    arch = [part for part in plan.parts if part.member == "B06"]
    assert len(arch) == 5  # a foot, three panels between both purlins and the springing lines, and a foot
    assert all(Polygon(part.outline).is_valid and part.area > 0 for part in plan.parts)
