"""Buckling and frequency with a bound: the interval holds the closed form, in the plane too, and all pages show it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csc_array
from scipy.sparse.linalg import eigsh

import dsfab
from dsfab.core.messages import value_with_bound
from dsfab.preset.file import with_overrides
from dsfab.report.design.facts import mode_facts, mode_lines
from dsfab.slicing import cut
from dsfab.statics import (
    Material,
    ResultRequest,
    SheetMaterial,
    SheetModel,
    SpreadLoad,
    buckling,
    mode_supports,
    needle_message,
    solve_for,
)
from dsfab.statics.modes import HELD_ACROSS, UPRIGHT
from dsfab.study.alternatives import Competitor
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.calculix import lowest_buckling, solid_model
from dsfab.study.check_model import uncut_model
from dsfab.study.judges import full, quick
from dsfab.study.verdict import LoadedSurface, mode_intervals, whole_sheet
from dsfab.study.verdict.estimates import LEAST_BOUND, mode_estimate
from dsfab.study.verdict.modes import MODE_ELEMENTS, mode_level
from dsfab.surface import LoadCase, Surface
from dsfab.verification import TESTS
from tests.calculix import needs_ccx
from tests.shapes import grid, lifted
from tests.statics.supports import hold

BOTH = ResultRequest(frequencies=1, buckling=1)


def holds(found, exact: float) -> bool:
    """Whether the interval contains the exact value."""
    return abs(found.value - exact) <= found.bound * found.value


@pytest.mark.parametrize(
    ("name", "cells", "exact"),
    [
        ("plate_buckling", (4, 8), 4 * np.pi**2),
        ("plate_buckling", (4, 8, 16), 4 * np.pi**2),
        ("plate_frequency", (4, 8), 2 * np.pi**2),
        ("axial_cylinder", (16, 32), 0.60523),
        ("axial_cylinder", (16, 32, 64), 0.60523),
        ("cantilevered_plate_1", (4, 8), 3.4710 / 3.494 * 0.4207),
        ("tapered_membrane_1", (4, 8), 44.623),
    ],
)
def test_the_interval_of_two_meshes_or_three_holds_the_closed_form(name, cells, exact):
    found = mode_estimate([TESTS[name].problem(count, "union_jack").solve(MODE_ELEMENTS) for count in cells])
    assert holds(found, exact), (found, exact)
    assert found.bound < (0.2 if name == "axial_cylinder" else 0.02)


BEAM, THICK, TALL, WIDE = Material(210e9, 0.0, 7850.0), 0.01, 2.0, 0.1
RIGID = BEAM.young * THICK**3 / 12
WEIGHT = BEAM.density * THICK * 9.81
BASE, TOP = dsfab.Support(dsfab.Side("z", "min"), hold="xz"), dsfab.Support(dsfab.Side("z", "max"), hold="x")


def wall(across: int, along: int) -> Surface:
    """A strip that stands upright in the plane y = 0."""
    flat = grid(across, along, WIDE, TALL)
    return Surface(flat.V[:, [0, 2, 1]], flat.F)


def standing(surface: Surface, *supports: dsfab.Support) -> LoadedSurface:
    """Under its own weight, with supports that hold it in its plane alone."""
    load = LoadCase.build(surface, list(supports), [dsfab.SelfWeight()], WEIGHT)
    return LoadedSurface(surface, SheetMaterial(BEAM, THICK), {"dead": load})


def pinned_column(width, stiff, samples: int = 100) -> float:
    """The factor at which a column on hinges, of stiffness E h^3 / 12 stiff(z), buckles under its own weight, that of a
    sheet of width(z): cubic beam elements along a line [Przemieniecki 1968], each of one width."""
    at = np.linspace(0, TALL, samples + 1)
    size, middle = TALL / samples, (at[1:] + at[:-1]) / 2
    wide = width(middle)
    press = WEIGHT * (np.cumsum(wide[::-1])[::-1] - wide / 2) * size
    bend = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], dtype=float)
    lean = np.array([[36, 3, -36, 3], [3, 4, -3, -1], [-36, -3, 36, -3], [3, -1, -3, 4]], dtype=float) / 30
    turn = np.array([1, size, 1, size])
    K, G = np.zeros((2, 2 * samples + 2, 2 * samples + 2))
    for k in range(samples):
        four = slice(2 * k, 2 * k + 4)
        K[four, four] += RIGID * stiff(middle)[k] / size**3 * bend * np.outer(turn, turn)
        G[four, four] += press[k] / size * lean * np.outer(turn, turn)
    free = np.delete(np.arange(2 * samples + 2), [0, 2 * samples])
    inner = np.ix_(free, free)
    return float(1 / eigsh(csc_array(G[inner]), 1, M=csc_array(K[inner]), which="LA", return_eigenvectors=False)[0])


def test_a_wall_on_its_base_buckles_and_sways_as_a_column_that_is_built_in():
    """q L^3 = 7.8373 E I [Greenhill 1881]; omega = 1.8751^2 sqrt(E I / (m L^4)). Its base holds it upright: told."""
    found = mode_intervals(standing(wall(2, 24), BASE), whole_sheet(wall(2, 24)), BOTH, 4e9)
    assert holds(found.buckling["dead"], 7.8373 * RIGID / (WEIGHT * TALL**3))
    exact = 1.875104**2 * np.sqrt(RIGID / (BEAM.density * THICK * TALL**4)) / (2 * np.pi)
    assert holds(found.hertz, exact)
    assert found.buckling["dead"].bound == found.hertz.bound == LEAST_BOUND
    assert found.assumed == UPRIGHT
    assert found.refusals == ()
    assert [level.triangles for level in found.levels] == [96, 384]


def test_a_wall_between_two_supports_is_a_column_on_hinges_and_needs_no_edge_held():
    surface = wall(2, 24)
    found = mode_intervals(standing(surface, BASE, TOP), whole_sheet(surface), BOTH, 4e9)
    even = pinned_column(np.ones_like, np.ones_like)
    assert holds(found.buckling["dead"], even)
    assert even * WEIGHT * TALL**3 / RIGID == pytest.approx(18.5687, rel=1e-4)
    assert holds(found.hertz, np.pi / 2 * np.sqrt(RIGID / (BEAM.density * THICK * TALL**4)))
    assert found.assumed == HELD_ACROSS


def test_a_strut_that_is_pressed_at_its_end_has_eulers_load():
    """Loads on the very edge, which no mesh spreads: pi^2 E I / L^2."""
    values = []
    for cells in (12, 24):
        surface = wall(cells // 12, cells)
        load = standing(surface, BASE, TOP).loads["dead"]
        top = surface.edges.boundary & (surface.V[surface.edges.ends, 2] > TALL - 1e-9).all(axis=1)
        spread = SpreadLoad.broadcast(surface, edge=top[:, None] * np.array([0.0, 0.0, -1.0]))
        pressed = LoadCase(load.fixed, spread.vertex_forces(surface), load.loaded)
        level = mode_level(
            surface, SheetMaterial(BEAM, THICK), {"a": pressed}, {"a": spread}, mode_supports(surface, pressed), BOTH
        )
        values.append(level.buckling["a"])
    assert holds(mode_estimate(values), np.pi**2 * RIGID / TALL**2)


def test_a_ladder_that_is_cut_out_of_a_wall_is_a_column_of_its_chords():
    """Two chords of three eighths of the width, and thin rungs; cut by stripes along both. What the rungs add to the
    stiffness lies between nothing and the whole width there, which makes 1 %."""
    surface = wall(8, 40)
    x, z = surface.V[:, 0] / WIDE, surface.V[:, 2] / TALL
    rungs = np.sort(np.concatenate([np.arange(6) / 5 - 0.004, np.arange(6) / 5 + 0.004]))
    sheet = cut(surface, [x, z], [[-1.0, 0.375, 0.625, 2.0], rungs], snap=0.0).subset()

    def width(along):
        rung = np.abs(along / TALL - np.round(5 * along / TALL) / 5) < 0.004
        return np.where(rung, WIDE, 0.75 * WIDE)

    assert sheet.surface.area == pytest.approx(width((np.arange(4000) + 0.5) * TALL / 4000).mean() * TALL, rel=1e-3)
    found = mode_intervals(standing(surface, BASE, TOP), sheet, ResultRequest(buckling=1), 4e9)
    factor, chords = found.buckling["dead"], pinned_column(width, lambda along: 0.75 * WIDE + 0 * along, 250)
    whole = pinned_column(width, width, 250)
    assert 1.001 < whole / chords < 1.02
    assert factor.value * (1 + factor.bound) > chords
    assert factor.value * (1 - factor.bound) < whole
    assert factor.bound < 0.05
    assert found.hertz is None
    assert found.assumed == HELD_ACROSS


@pytest.mark.slow
@needs_ccx
def test_a_cut_shell_with_needles_buckles_where_a_solid_does():
    """A shallow shell of ribs 70 mm wide; the solid has quadratic wedges. A needle alone buckled at a factor of 0.5."""
    whole = lifted(lambda x, y: 1.6 * x * (1 - x) * y * (1 - y), cells=9)
    x, y = whole.V[:, 0], whole.V[:, 1]
    ribs = np.sort(np.concatenate([np.arange(-1, 2.01, 0.25) - 0.05, np.arange(-1, 2.01, 0.25) + 0.05]))
    s = cut(whole, [x + y, x - y], [ribs, ribs], snap=0.0).subset().surface
    assert needle_message(s)
    x, y = s.V[:, 0], s.V[:, 1]
    rim = np.isclose(x * (1 - x) * y * (1 - y), 0)
    weight = s.vertex_areas[:, None] * np.array([0.0, 0.0, -1e3])
    load = LoadCase(hold(s, (rim, "xyz")), weight, np.zeros(s.n, dtype=bool))
    timber, thickness = Material(11e9, 0.3), 0.02
    sheet = SheetModel(s, timber, thickness)
    answer = solve_for(sheet, {"snow": load}, "displacement")["snow"]
    normal = np.stack([-1.6 * (1 - 2 * x) * y * (1 - y), -1.6 * x * (1 - x) * (1 - 2 * y), np.ones(s.n)], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    solid, _ = lowest_buckling(solid_model(s, normal, thickness, timber, load), 60.0)
    assert buckling(sheet, load, answer, 1).factor[0] == pytest.approx(solid, rel=0.1)


def test_sheets_that_are_held_out_of_plane_keep_their_supports():
    surface = wall(2, 6)
    load = standing(surface, BASE).loads["dead"]
    across = mode_supports(surface, load)
    assert across.load.fixed[load.supported].all(axis=1).sum() == 3
    assert across.load.clamped.sum() == 2  # the two edges of the base
    assert mode_supports(surface, load, plane=False).load is load
    pushed = replace(load, force=load.force + (0.0, 1.0, 0.0))
    assert mode_supports(surface, pushed).load is pushed
    spring = replace(load, fixed=np.zeros_like(load.fixed), spring=np.where(load.fixed, 1e9, 0.0))
    assert mode_supports(surface, spring).load.fixed.sum() == 3


@pytest.mark.parametrize(
    ("values", "value", "bound"),
    [
        ([2.0], 2.0, np.inf),
        ([1.0, 1.2], 1.3, 0.2 / 1.3),
        ([1.2, 1.0], 0.9, 0.2 / 0.9),
        ([1.0, 1.4, 1.6], 1.8, 0.2 / 1.8),  # a ratio of 2
        ([1.0, 1.8, 2.0], 2.0 + 0.2 / 3, 0.2 / 3 / (2.0 + 0.2 / 3)),  # of 4
        ([1.0, 2.6, 2.7], 2.7 + 0.1 / 3, 0.1 / 3 / (2.7 + 0.1 / 3)),  # of 16: not believed
        ([1.0, 1.2, 1.4], 1.4, 0.4 / 1.4),  # steps that do not shrink
        ([1.0, 1.5, 1.4], 1.4, 0.2 / 1.4),  # that turn back
        ([1.0, 1.1, 0.8], 0.8, 0.6 / 0.8),  # and grow
        ([1.0, 1.0, 1.0], 1.0, LEAST_BOUND),
    ],
)
def test_the_rule_goes_on_at_the_ratio_of_the_steps(values, value, bound):
    found = mode_estimate(values)
    assert found.value == pytest.approx(value)
    assert found.bound == pytest.approx(bound)
    assert (found.finite_bound is None) == (len(values) == 1)


ASKED = {"surface.edge": 0.15, "statics.density": 1000.0, "statics.buckling": 1, "statics.frequencies": 1}


@pytest.fixture(scope="module")
def cantilever() -> dsfab.Design:
    return dsfab.run(dsfab.load_preset("cantilever", ASKED))


@pytest.mark.slow
def test_a_full_comparison_gives_bounds_and_a_quick_comparison_does_not(cantilever):
    task = ComparisonTask.from_design(cantilever, cantilever.sheet.surface.area)
    structure = Structure(
        cantilever.slicing.cells,
        cantilever.pattern.names,
        cantilever.slicing.sheet,
        1,
        cantilever.preset.statics.thickness,
    )
    (one,) = quick(task, structure, BOTH).cases.values()
    deep = full(task, structure, BOTH)
    (more,) = deep.cases.values()
    assert one.buckling_bound is None
    assert one.frequency_bound is None
    assert one.assumed == more.assumed == UPRIGHT
    assert 0 < more.buckling_bound < 0.1
    assert LEAST_BOUND <= more.frequency_bound < 0.05
    assert one.buckling == pytest.approx(more.buckling, rel=0.15)
    assert one.frequency == pytest.approx(more.frequency, rel=0.05)
    row = Competitor("design", judgement=deep).row(1.0, 1.0)
    assert (row["buckling_factor"], row["buckling_bound"]) == (more.buckling, more.buckling_bound)
    assert (row["frequency_hz"], row["frequency_bound"]) == (more.frequency, more.frequency_bound)
    assert row["assumed"] == UPRIGHT


FLOOR = """
[surface]
shape = "plate"
length = 8.0
width = 6.0
edge = 0.75
support = [{ at = { pick = "boundary" }, hold = "xyz" }]
load = [
    { kind = "self_weight" },
    { kind = "cladding", pressure = 400.0, case = "dead" },
    { kind = "cladding", pressure = 400.0, case = "snow" },
    { kind = "snow", pressure = 800.0, case = "snow" },
    { kind = "snow", pressure = 100.0, case = "drift" },
    { kind = "pressure", pressure = -300.0, case = "inflated" },
    { kind = "imposed", pressure = 2e3, case = "people" },
]
actions = { inflated = "permanent", people = "imposed C" }
[statics]
thickness = 0.16
material = "GL24h"
membrane = "hybrid"
bending = "hhj"
frequencies = 1
[pattern]
method = "stripes"
width = { solid_fraction = 0.5 }
major = { spacing = 1.5 }
minor = { spacing = 1.5 }
"""
NAVIER = np.pi / 2 * (1 / 64 + 1 / 36)


@pytest.mark.slow
@pytest.mark.parametrize(("snow_mass", "carried"), [(0.0, 400.0), (0.5, 800.0)])
def test_cladding_and_a_share_of_the_snow_vibrate_with_a_floor(tmp_path, snow_mass, carried):
    """Navier: 13.6 Hz with glass, 17.3 Hz without. On the cut sheet the loads of openings have mass, too. Cladding that
    two cases repeat counts once, the lighter case of snow does not count, and a pressure upwards has no mass."""
    (tmp_path / "floor.toml").write_text(FLOOR)
    preset = dsfab.load_preset(tmp_path / "floor.toml", {"statics.snow_mass": snow_mass})
    design, statics = dsfab.run(preset), preset.statics
    mass = statics.density * statics.thickness + carried / 9.80665
    whole = NAVIER * np.sqrt(statics.elastic.bending_stiffness(statics.thickness) / mass)
    assert design.statics.cases["dead"].answers.vibration.hertz[0] == pytest.approx(whole, rel=2e-3)
    assert mode_facts(design)["mode_intervals"]["frequency"]["hertz"] == pytest.approx(whole, rel=3e-3)
    task, sheet = ComparisonTask.from_design(design, design.sheet.surface.area), design.sheet
    structure = Structure(design.slicing.cells, design.pattern.names, sheet, 1, statics.thickness)
    heavier = replace(task, preset=with_overrides(preset, {"statics.density": 20.0}))
    for judge in (quick, full):
        hertz = next(iter(judge(task, structure, BOTH).cases.values())).frequency
        light = next(iter(judge(heavier, structure, BOTH).cases.values())).frequency
        share = sheet.surface.area / design.surface.area
        total = [share * density * statics.thickness + carried / 9.80665 for density in (statics.density, 20.0)]
        assert light / hertz == pytest.approx(np.sqrt(total[0] / total[1]), rel=0.02)


def test_a_build_and_a_calculix_file_tell_the_interval_of_the_uncut_sheet(cantilever):
    (facts,) = mode_facts(cantilever).values()
    (line,) = mode_lines(cantilever)
    known = facts["buckling"]["load"]
    assert facts["triangles"] == [cantilever.surface.m, 4 * cantilever.surface.m]
    assert known["factor"] == pytest.approx(cantilever.statics.answers.buckling.factor[0], rel=0.1)
    assert facts["frequency"]["hertz"] == pytest.approx(cantilever.statics.answers.vibration.hertz[0], rel=0.01)
    assert f"lowest factor of buckling {value_with_bound(known['factor'], known['bound'])}" in line
    assert line.endswith(UPRIGHT)
    notes = uncut_model(cantilever.preset).model.notes
    assert (
        f"Lowest factor of linear buckling, load: {value_with_bound(known['factor'], known['bound'])}".replace(
            "±", "+-"
        )
        in notes
    )
    silent = dsfab.load_preset("cantilever", {"surface.edge": 0.1})
    assert not any("Lowest" in note for note in uncut_model(silent).model.notes)
    assert mode_facts(dsfab.run(silent)) == {}


def test_numbers_are_written_with_the_digits_of_their_bound():
    assert value_with_bound(2.34567, 0.018) == "2.35 ± 1.8 %"
    assert value_with_bound(2.34567, 0.003, "Hz") == "2.346 Hz ± 0.3 %"
    assert value_with_bound(2.34567, 0.16) == "2.35 ± 16 %"
    assert value_with_bound(2.34567, None, "Hz") == "2.35 Hz (one mesh, bound unknown)"
