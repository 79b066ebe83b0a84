"""Whether a cut structure carries: closed forms of strips and columns, spans from supports, and reactions."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.design import Design, sheet_loads
from dsfab.preset.file import load_preset, with_overrides
from dsfab.preset.model import Preset
from dsfab.results import SlicingResult
from dsfab.study.carrying import carrying, cut_carrying, cut_statics, judged_span, use_and_movement
from dsfab.study.hold_down import hold_down_remarks
from dsfab.study.verdict import whole_sheet
from dsfab.surface import (
    All,
    Cladding,
    DesignFactors,
    Force,
    LiftingRule,
    LoadCase,
    Pressure,
    SelfWeight,
    Side,
    Snow,
    Support,
    Vertices,
    Wind,
    shapes,
)
from tests.benchmarks.solid_verdicts import solid_verdict
from tests.calculix import needs_ccx
from tests.shapes import annulus, grid

LENGTH, WIDTH, THICKNESS, YOUNG = 2.0, 0.2, 0.02, 210e9
BUILT_IN = {"bending": "midedge"}  # elements whose edges can be built in
INERTIA = WIDTH * THICKNESS**3 / 12


def strip(per_metre, strength=235e6, edge=0.05):
    """A strip without openings, built in at x = 0, under a line load (N/m) at its other end."""
    side = {"pick": "side", "axis": "x"}
    preset = Preset.model_validate(
        {
            "name": "strip",
            "surface": {
                "shape": "plate",
                "length": LENGTH,
                "width": WIDTH,
                "edge": edge,
                "support": [{"name": "wall", "at": {**side, "end": "min"}, "hold": "xyz", "clamp": True}],
                "load": [{"kind": "line", "at": {**side, "end": "max"}, "per_metre": per_metre}],
            },
            "statics": {
                "bending": "midedge",
                "thickness": THICKNESS,
                "young": YOUNG,
                "poisson": 0.0,
                "strength": strength,
            },
        }
    )
    return whole(Design.from_preset(preset))


def whole(design):
    sheet = whole_sheet(design.surface)
    cut = SlicingResult(sheet, sheet, (), 0)
    stages = {"surface": design.surface, "statics": design.statics, "slicing": cut, "sheet": sheet}
    return Design.from_results(design.preset, **stages)


def test_a_cantilever_has_the_movement_stress_and_reaction_of_a_beam():
    judged = carrying(strip((0, 0, -1e3), edge=0.04))
    load = 1e3 * WIDTH
    assert judged.movement.value == pytest.approx(load * LENGTH**3 / (3 * YOUNG * INERTIA), rel=0.01)
    assert judged.movement.span == pytest.approx(2 * LENGTH)
    (reaction,) = judged.reactions
    assert (reaction.support, reaction.vertical) == ("wall", pytest.approx(load))
    assert reaction.horizontal < 1e-6 * load
    # stress falls in proportion to the distance from the free end: 99 % of the area is below 99 % of the largest
    bending = load * LENGTH / (WIDTH * THICKNESS**2 / 6)
    assert judged.use.value == pytest.approx(0.99 * bending / 235e6, rel=0.02)
    assert judged.use.place[0] < 0.1 * LENGTH
    assert judged.buckling is None
    assert judged.outcome == "carries"


def test_a_strip_in_torsion_turns_as_a_bar():
    """An even torque t turns the end of a strip twice as wide as thick by t L^2 / (2 G J), J = .2287 w h^3
    [Timoshenko and Goodier 1970, table 10]. A thin sheet would turn by .69 of that."""
    design, per_metre, thickness = strip((0, 0, -1.0)), 500.0, WIDTH / 2
    lines = [
        {"kind": "line", "at": {"pick": "side", "axis": "y", "end": end}, "per_metre": (0, 0, sign * per_metre)}
        for end, sign in (("min", -1), ("max", 1))
    ]
    preset = with_overrides(design.preset, {"surface.load": lines, "statics.thickness": thickness})
    judged = carrying(whole(Design.from_preset(preset)))
    turned = per_metre * WIDTH * LENGTH**2 / (2 * YOUNG / 2 * 0.2287 * WIDTH * thickness**3)
    assert judged.movement.value == pytest.approx(turned * WIDTH / 2, rel=0.05)  # the wall hinders the warping


@pytest.mark.parametrize(("share", "outcome"), [(0.5, "carries"), (1.1, "does not carry")])
def test_a_column_carries_up_to_the_load_of_euler(share, outcome):
    critical = np.pi**2 * YOUNG * INERTIA / (4 * LENGTH**2)
    judged = carrying(strip((-share * critical / WIDTH, 0, 0)))
    assert judged.buckling == pytest.approx(1 / share, rel=0.01)
    assert judged.outcome == outcome
    assert bool(judged.faults) == (share > 1)
    assert judged.movement.span == pytest.approx(LENGTH, rel=0.01)


def test_a_sheet_over_its_strength_does_not_carry_and_names_what_fails():
    judged = carrying(strip((0, 0, -1e4)))
    assert judged.outcome == "does not carry"
    assert "of its resistance" in judged.faults[0]
    assert judged.facts()["outcome"] == "does not carry"


def test_without_a_strength_nothing_is_judged():
    judged = carrying(strip((0, 0, -1e3), strength=0.0))
    assert judged.outcome == "not judged"
    assert "statics.material" in judged.remarks[0]


def test_a_sheet_that_would_need_too_much_memory_is_not_judged(monkeypatch):
    monkeypatch.setattr("dsfab.study.carrying.BUDGET", 1e4)
    judged = carrying(strip((0, 0, -1e4)))
    assert judged.outcome == "not judged"
    assert "make the mesh coarser" in judged.remarks[0]


def test_another_thickness_needs_no_new_design():
    design = strip((0, 0, -1e3))
    thick = use_and_movement(cut_statics(design, 2 * THICKNESS))
    assert thick.movement.value == pytest.approx(carrying(design).movement.value / 8, rel=1e-6)
    assert thick.mass == pytest.approx(2 * carrying(design).mass)


def test_a_sheet_without_enough_supports_is_told_as_one_that_does_not_stand():
    design = strip((0, 0, -1e3))
    case = design.statics.cases["load"]
    corner = LoadCase.build(design.surface, [Support(Vertices((0,)), "xyz")], [Force(Side("x", "max"), (0, 0, -1.0))])
    loose = {"load": replace(case, load=corner)}
    stages = {"surface": design.surface, "slicing": design.slicing, "sheet": design.sheet}
    lost = Design.from_results(design.preset, statics=replace(design.statics, cases=loose), **stages)
    judged = carrying(lost)
    assert judged.outcome == "does not carry"
    assert "does not stand" in judged.faults[0]


def held(surface, mask, force=(0, 0, -1.0)):
    every = np.flatnonzero(mask)
    return LoadCase.build(surface, [Support(Vertices(tuple(every.tolist())), "xyz")], [Force(All(), force)])


def test_the_span_follows_from_the_supports():
    plate = grid(8, 4, 8.0, 4.0)
    x, y = plate.V[:, 0], plate.V[:, 1]
    ends = held(plate, (x == 0) | (x == 8))
    words = "twice the distance of 4 m from the supports to the farthest place"
    assert judged_span(plate, ends) == (pytest.approx(8.0), words)
    corners = held(plate, ((x == 0) | (x == 8)) & ((y == 0) | (y == 4)))
    assert judged_span(plate, corners)[0] == pytest.approx(np.hypot(8, 4))
    assert judged_span(plate, held(plate, x == 0))[0] == pytest.approx(16.0)
    wall = judged_span(plate, held(plate, x == 0, (0, 1.0, 0)))  # the load lies in the plate: its height counts double
    assert wall[0] == pytest.approx(16.0)
    for weight in (0.01, 100.0):  # a thick wall is heavier than its wind; its span stays twice its height
        base = [Support(Vertices(tuple(np.flatnonzero(x == 0).tolist())), "xyz")]
        heavy = LoadCase.build(plate, base, [SelfWeight((-1.0, 0, 0)), Pressure(1.0)], weight)
        assert judged_span(plate, heavy)[0] == pytest.approx(16.0)
    ring = annulus(24, 4, 1.0, 3.0)
    r = np.linalg.norm(ring.V, axis=1)
    assert judged_span(ring, held(ring, (r < 1.01) | (r > 2.99)))[0] == pytest.approx(2.0, rel=0.02)


def test_members_of_a_graded_material_have_the_utilisation_of_the_members_report():
    """Combinations are sums of the forces of their cases, so all cases need one factorisation."""
    coarse = {"surface.combinations": "EN 1990 6.10", "surface.edge": 0.4, "pattern.width.member": 0.3}
    coarse |= {"surface.load.0.case": "dead", "surface.load.1.case": "snow"}
    coarse |= {"pattern.major.spacing": 2.0, "pattern.minor.spacing": 2.0}
    design = Design.from_preset(load_preset("gridshell", coarse)).until("slicing")
    judged = cut_carrying(cut_statics(design, design.preset.statics.thickness))
    use = design.member_utilisation
    assert judged.use.value == pytest.approx(use.largest.max(), rel=1e-6)
    assert judged.use.member == use.bays.member[int(use.order[0])]
    assert judged.use.case in design.preset.judged_in("ULS", design.statics.cases)
    for name, case in design.statics.cases.items():
        load = sheet_loads(design.surface, design.slicing.cells.subset(), design.sheet, {name: case.load})[name]
        rows = [row.vertical for row in judged.reactions if row.case == name]
        assert sum(rows) == pytest.approx(-load.force[:, 2].sum(), rel=1e-6)


def lifting_remark(loads, vertical, actions=None, combinations=()):
    """The remark on a support named post, with the words of the forces (N) in it."""
    rule = LiftingRule.for_loads(loads, actions or {}, DesignFactors())
    arrays = {case: np.array([force]) for case, force in vertical.items()}
    return "; ".join(hold_down_remarks(rule, combinations, ["post"], arrays))


def test_a_load_of_unknown_kind_may_lift_and_combinations_of_the_preset_count_too():
    """A suction of 800 N lifts a support under 490 N of weight: 1.5 x 800 - 0.9 x 490, whatever the preset combines."""
    vertical = {"dead": 490.0, "suction": -800.0}
    loads = [SelfWeight(case="dead"), Pressure(-800.0, case="suction")]
    assert "post 759 N (0.9 dead + 1.5 suction)" in lifting_remark(loads, vertical)
    for factor, words in ((1.0, "post 759 N (0.9 dead + 1.5 suction)"), (2.0, "post 1.11 kN (both)")):
        vertical["both"] = 490.0 - factor * 800.0
        assert words in lifting_remark(loads, vertical, combinations=["both"])


def test_only_variable_loads_that_lift_act_and_the_leading_load_is_the_worst():
    """Snow of 100 N holds a post down, wind lifts it by 300 N, and imposed loads by 200 N with psi_0 = 0.7."""
    vertical = {"dead": 400.0, "snow": 100.0, "wind": -300.0, "back": -250.0, "people": -200.0}
    actions = {"dead": "permanent", "snow": "snow", "wind": "wind", "back": "wind", "people": "imposed C"}
    loads = [Pressure(1.0, case=case) for case in vertical]
    pull = 1.5 * 300 + 1.5 * 0.7 * 200 - 0.9 * 400
    assert f"post {pull:.0f} N (0.9 dead + 1.5 wind + 1.05 people)" in lifting_remark(loads, vertical, actions)


def test_a_weight_that_cases_repeat_counts_once_also_beside_a_case_of_wind_alone():
    """Weight of 400 N in two cases with variable loads: 1.5 x 300 - 0.9 x 400 for a third case of wind only."""
    loads = [SelfWeight(), Snow(1.0), SelfWeight(case="gust"), Wind(1.0, (1, 0, 0), case="gust")]
    loads += [Wind(2.0, (1, 0, 0), case="alone")]
    vertical = {"load": 500.0, "gust": 200.0, "alone": -300.0, "(permanent loads)": 400.0, "load: snow": 100.0}
    vertical |= {"gust: wind": -200.0}
    assert "post 90 N (0.9 (permanent loads) + 1.5 alone)" in lifting_remark(loads, vertical)
    assert not lifting_remark(loads, vertical | {"alone": -230.0})


def test_permanent_loads_that_a_case_lacks_never_hold_down():
    """Cladding of 300 N is not there yet in the wind of the erection: 1.5 x 400 - 0.9 x 400. It lifts if it can."""
    wind = Wind(1.0, (1, 0, 0), case="erection")
    loads = [SelfWeight(), Cladding(1.0), Snow(1.0), SelfWeight(case="erection"), wind]
    vertical = {"load": 0.0, "erection": 0.0, "(permanent loads)": 400.0, "load: snow": 100.0, "erection: wind": -400.0}
    assert "post 240 N (0.9 (permanent loads) + 1.5 erection: wind)" in lifting_remark(
        loads, vertical | {"load: permanent": 300.0}
    )
    assert "post 570 N (0.9 (permanent loads) + 1.1 load: permanent + 1.5 erection: wind)" in lifting_remark(
        loads, vertical | {"load: permanent": -300.0}
    )


def test_a_weight_that_is_labelled_as_wind_stays_permanent():
    loads = [SelfWeight(case="up"), Pressure(-9.0, case="up")]
    vertical = {"up": 0.0, "(permanent loads)": 400.0, "up: wind": -400.0}
    assert "post 240 N (0.9 (permanent loads) + 1.5 up: wind)" in lifting_remark(loads, vertical, {"up": "wind"})


def test_the_names_and_the_order_of_cases_do_not_matter():
    """Weight in a case of its own, and with cladding and wind in another; a third case repeats the weight."""
    cases = {"a": [SelfWeight(case="a")], "c": [SelfWeight(case="c")]}
    cases["b"] = [SelfWeight(case="b"), Cladding(1.0, case="b"), Wind(1.0, (1, 0, 0), case="b")]
    vertical = {"a": 400.0, "c": 400.0, "b": 0.0, "(permanent loads)": 400.0, "b: permanent": 50.0, "b: wind": -450.0}
    for order in ("abc", "bac", "cba"):
        loads = [load for name in order for load in cases[name]]
        assert "post 315 N (0.9 (permanent loads) + 1.5 b: wind)" in lifting_remark(loads, vertical)


def test_loads_of_unknown_kind_in_one_case_are_checked_one_by_one():
    """A suction of 400 N and people of 300 N in the case of the weight: 1.5 x 400 - 0.9 x 400."""
    loads = [SelfWeight(), Pressure(-9.0), Snow(9.0, kind="imposed")]
    vertical = {"load": 300.0, "(permanent loads)": 400.0, "load: pressure 1": -400.0, "load: imposed 2": 300.0}
    assert "post 240 N (0.9 (permanent loads) + 1.5 load: pressure 1)" in lifting_remark(loads, vertical)


def test_cases_named_like_parts_of_cases_are_told_apart():
    """`loads_by_action` gives parts names that no preset can have."""
    loads = [SelfWeight(), Wind(1.0, (1, 0, 0)), SelfWeight(case="load wind"), Wind(2.0, (1, 0, 0), case="load wind")]
    rule = LiftingRule.for_loads(loads, {}, DesignFactors())
    names = [action.case for group in rule.groups for action in group]
    assert sorted(names) == ["load wind: wind", "load: wind"]


LIFTED = {"kind": "wind", "direction": [1, 0, 0], "shape": "canopy up", "case": "lift"}


def plate_preset(length, supports, loads):
    plate = {"shape": "plate", "length": length, "width": 2.0, "edge": 0.4, "support": supports}
    statics = {"thickness": 0.1, "material": "S235", "density": 500.0}  # without members: a remark says so
    return Preset.model_validate({"name": "canopy", "surface": plate | {"load": loads}, "statics": statics})


def remarks_on_lifting(preset):
    judged = carrying(whole(Design.from_preset(preset)))
    remarks = [text for text in judged.remarks if text.startswith("supports must hold the structure down")]
    assert list(judged.remarks[: len(remarks)]) == remarks  # they come first
    return remarks


@pytest.mark.parametrize("cases", [("dead", "lift"), ("lift", "lift")])
@pytest.mark.parametrize("pressure", [200.0, 2000.0])
def test_supports_hold_a_light_roof_down_by_the_rule_of_static_equilibrium(cases, pressure):
    """Each of two ends takes half of 0.9 G - 1.5 Q [EN 1990, table A1.2(A)], also if a case has weight and wind. A flat
    canopy is lifted by 0.55 of the velocity pressure."""
    side = {"pick": "side", "axis": "x"}
    ends = [{"name": end, "at": {**side, "end": end}, "hold": "xyz"} for end in ("min", "max")]
    loads = [{"kind": "self_weight", "case": cases[0]}, LIFTED | {"pressure": pressure}]
    remarks = remarks_on_lifting(plate_preset(4.0, ends, loads))
    weight, wind = 500 * 9.81 * 0.1 * 4.0, 0.55 * pressure * 4.0  # newtons on half of the plate
    pull = 1.5 * wind - 0.9 * weight
    words = "0.9 dead + 1.5 lift" if cases[0] == "dead" else "0.9 (permanent loads) + 1.5 lift: wind"
    assert len(remarks) == (pull > 0)
    for text in remarks:
        assert text.count(f"{pull / 1e3:.3g} kN ({words})") == 2
        assert "EN 1990, table A1.2(A)" in text


@pytest.mark.parametrize("together", [False, True])
def test_a_support_behind_an_overhang_pulls_under_snow(together):
    """A plate of 10 m stands on two points of its end, and on two points 4 m from it. The end pulls by
    w L (L / 8 m - 1) [statics of a beam], with 1.1 of the weight and 1.5 of the snow. Its pull is told, also if one
    support has all points, so that its sum pushes."""
    x = shapes.plate(10.0, 2.0, 0.4).V[:, 0]
    end, inside = (np.flatnonzero(np.abs(x - at) < 0.01)[[0, -1]] for at in (-5.0, -1.0))
    groups = {"points": [*end, *inside]} if together else {"end": end, "inside": inside}
    supports = [
        {"name": name, "at": {"pick": "vertices", "indices": [int(k) for k in group]}, "hold": "xyz"}
        for name, group in groups.items()
    ]
    loads = [{"kind": "self_weight"}, {"kind": "snow", "pressure": 800.0}]
    (text,) = remarks_on_lifting(plate_preset(10.0, supports, loads))
    pull = 2.0 * 10.0 * (10.0 / 8.0 - 1) * (1.1 * 500 * 9.81 * 0.1 + 1.5 * 800)
    name, count = ("points", 4) if together else ("end", 2)
    places = f"at 2 of {count} places, at most {pull / 2e3:.3g} kN"
    assert f"A1.2(A): {name} {pull / 1e3:.3g} kN {places} (1.1 (permanent loads) + 1.5 load: snow)" in text


@pytest.mark.slow
@needs_ccx
def test_a_slab_of_narrow_ribs_moves_as_its_solid():
    """Ribs are .1 m wide and .3 m high: as a thin sheet the slab would move by .7 of its solid."""
    preset = load_preset("slab", {"surface.edge": 0.3, "pattern.fillet": 0.0})
    assert solid_verdict(Design.from_preset(preset), buckling=False).ratios[0] == pytest.approx(1.0, abs=0.1)
