"""Springs and clamped edges as supports: bars and plates by hand, reactions, and what a cut sheet keeps of them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import TypeAdapter, ValidationError

from dsfab import load_preset, run
from dsfab.core.errors import PresetError, StaticsError, SurfaceError
from dsfab.design import draft
from dsfab.design.regions_and_loads import sheet_load
from dsfab.report.design.facts import design_facts
from dsfab.slicing import cut
from dsfab.statics import (
    Elements,
    Material,
    SheetModel,
    buckling,
    frequencies,
    resultant,
    solve_statics,
    spread_load,
    support_reactions,
)
from dsfab.surface import All, Boundary, Box, Force, Line, LoadCase, Nearest, Side, Snow, Support, Surface, Vertices
from tests.presets import DOME_MODES
from tests.shapes import ZOO, grid, zoo

E, H = 10e9, 0.02
WOOD = Material(E, 0.0)
PAIRS = [Elements("constant", "hinge"), Elements("constant", "midedge"), Elements("quadratic", "hhj")]
pairs = pytest.mark.parametrize("elements", PAIRS, ids=str)


def solved(surface, supports, loads, elements, thickness=H):
    case = LoadCase.build(surface, supports, loads)
    return case, solve_statics(SheetModel(surface, WOOD, thickness), case, elements, spread_load(surface, loads))


@pairs
def test_a_bar_on_a_spring_moves_as_two_springs_in_series_do(elements):
    """F / k + F l / (E A), without Poisson's effect; solved in its plane, where springs across it mean nothing."""
    s, k, force = grid(8, 2, 2.0, 0.5), 3e6, 5e3
    ends = Side("x", "min"), Side("x", "max")
    supports = [Support(ends[0], hold="y", spring=(k, 0.0, 7.0))]
    case, answer = solved(s, supports, [Line(ends[1], (force / 0.5, 0, 0))], elements)
    stretch = force * 2.0 / (E * 0.5 * H)
    assert_allclose(answer.u[s.V[:, 0] < 1e-9, 0].mean(), force / k, rtol=1e-9)
    assert_allclose(case.force[:, 0] @ answer.u[:, 0] / force, force / k + stretch, rtol=1e-2)
    assert_allclose(answer.compliance, force * (force / k + stretch), rtol=1e-2)
    assert_allclose(answer.reaction.sum(axis=0), [-force, 0, 0], atol=1e-6 * force)
    assert not answer.u[:, 2].any()


@pairs
def test_a_plate_on_a_spring_at_its_corner_twists_less(elements):
    """Held at three corners and loaded at the fourth a square plate twists: w = P a^2 / (2 D (1 - nu)) [Timoshenko
    1959, section 11]; a spring there is beside it, w = P / (k + 2 D (1 - nu) / a^2)."""
    s, force, a = grid(6, 6, 1.5, 1.5), 40.0, 1.5
    held = [Support(Nearest((at,)), hold) for at, hold in (((0, 0, 0), "xyz"), ((a, 0, 0), "yz"), ((0, a, 0), "z"))]
    far = Nearest(((a, a, 0.0),))
    corner = far.vertices(s).argmax()

    def sag(*springs):
        _, answer = solved(s, [*held, *springs], [Force(far, (0, 0, -force))], elements)
        assert answer.imbalance < 1e-9
        return -answer.u[corner, 2], support_reactions(s, [*held, *springs], answer)

    plate = force / sag()[0]
    if elements.bending != "hinge":  # hinges do not converge to the plate
        assert plate == pytest.approx(2 * WOOD.bending_stiffness(H) / a**2, rel=1e-6)
    for k in (0.5 * plate, 20 * plate):
        w, (*_, spring) = sag(Support(far, spring=(0.0, 0.0, k)))
        assert w == pytest.approx(force / (k + plate), rel=1e-9)
        assert_allclose(spring.force, [0, 0, k * w], rtol=1e-9, atol=1e-9)
        assert_allclose(spring.moment, [a * k * w, -a * k * w, 0], rtol=1e-9, atol=1e-9)


@zoo
@pairs
def test_springs_share_by_area_and_balance_the_loads(name, elements):
    s = ZOO[name]()
    stiffness = 1e6 * s.size
    supports = [Support(All(), spring=(stiffness, 2 * stiffness, 3 * stiffness)), Support(Vertices((0,)), "x")]
    case, answer = solved(s, supports, [Snow(1000.0, (0.3, 0.2, -1.0))], elements, H * s.size)
    assert_allclose(case.spring.sum(axis=0), [stiffness, 2 * stiffness, 3 * stiffness], rtol=1e-12)
    assert_allclose(case.spring[:, 2] * s.area, 3 * stiffness * s.vertex_areas, rtol=1e-9)
    assert case.supported.all()
    free = ~case.fixed
    assert_allclose(answer.reaction[free], -(case.spring * answer.u)[free], rtol=1e-12)
    loads, (bed, pin) = resultant(s, case.force), support_reactions(s, supports, answer)
    size = np.abs(case.force).sum()
    assert_allclose(bed.force + pin.force, -loads.force, atol=1e-6 * size)
    assert_allclose(bed.moment + pin.moment, -loads.moment, atol=1e-6 * size * np.abs(s.V).max())
    assert pin.force[1:].tolist() == [0.0, 0.0]
    assert answer.imbalance < 1e-9


def test_springs_on_the_same_vertices_share_by_stiffness_and_stand_still_where_held():
    s = grid(4, 2, 2.0, 0.5)
    ends = Side("x", "min"), Side("x", "max")
    supports = [Support(ends[0]), Support(ends[0], spring=(0, 0, 1e9))]
    supports += [Support(ends[1], spring=(0, 0, k)) for k in (1e4, 3e4)]
    _, answer = solved(s, supports, [Snow(100.0)], PAIRS[1])
    parts = support_reactions(s, supports, answer)
    assert parts[1].force.tolist() == [0, 0, 0]
    assert parts[3].force[2] == pytest.approx(3 * parts[2].force[2], rel=1e-12)
    assert parts[0].force[2] + 4 * parts[2].force[2] == pytest.approx(100, rel=1e-6)


def test_a_stiff_spring_is_a_support():
    s = ZOO["dome"]()
    rim = Boundary()
    held, spring = (
        solved(s, [support], [Snow(1000.0)], PAIRS[0])[1]
        for support in (Support(rim), Support(rim, spring=(1e16, 1e16, 1e16)))
    )
    assert_allclose(spring.u, held.u, atol=1e-4 * np.abs(held.u).max())
    assert spring.compliance == pytest.approx(held.compliance, rel=1e-4)


def test_springs_stop_motions_and_free_motions_are_named():
    s = ZOO["saddle"]()
    feet = [Support(Side("x", "min"), spring=(0.0, 5e4, 5e4))]
    with pytest.raises(StaticsError, match=r"the surface can move along x and turn about y and turn about z: the sup"):
        solved(s, feet, [Snow(10.0)], PAIRS[0])
    solved(s, [*feet, Support(Side("x", "max"), spring=(1e3, 0.0, 1e3))], [Snow(10.0)], PAIRS[0])


# clamped edges


@pytest.mark.parametrize("bending", ["midedge", "hhj"])
def test_a_clamped_end_makes_a_cantilever_and_answers_with_its_moment(bending):
    """Tip sag P l^3 / (3 E I): the support holds a single line of vertices."""
    s = grid(16, 4, 1.0, 0.1)
    supports, elements = [Support(Side("x", "min"), clamp=True)], Elements("quadratic", bending)
    _, answer = solved(s, supports, [Line(Side("x", "max"), (0, 0, -100.0))], elements)
    sag = 10.0 / (3 * E * 0.1 * H**3 / 12)
    assert -answer.u[s.V[:, 0] > 1 - 1e-9, 2].mean() == pytest.approx(sag, rel=5e-3)
    (end,) = support_reactions(s, supports, answer)
    assert_allclose(end.force, [0, 0, 10], atol=1e-6)
    assert_allclose(end.moment, [0.5, -10, 0], atol=1e-5)


def test_a_clamp_without_hold_gives_its_moment_to_itself_alone():
    s = grid(16, 4, 1.0, 0.1)
    root, elements = Side("x", "min"), Elements("quadratic", "hhj")
    supports = [Support(root), Support(root, hold="", clamp=True)]
    _, answer = solved(s, supports, [Line(Side("x", "max"), (0, 0, -100.0))], elements)
    pin, clamp = support_reactions(s, supports, answer)
    assert_allclose(clamp.force, 0, atol=1e-9)
    assert_allclose(clamp.moment, [0, -10, 0], atol=1e-5)
    assert_allclose(pin.moment, [0.5, 0, 0], atol=1e-5)


def test_hinges_cannot_be_clamped():
    s = grid(8, 2, 1.0, 0.1)
    with pytest.raises(StaticsError, match=r'2 edges are clamped, but `hinge`.*bending = "midedge" or "hhj"'):
        solved(s, [Support(Side("x", "min"), clamp=True)], [Snow(10.0)], PAIRS[0])
    with pytest.raises(StaticsError, match="hinge"):
        run(load_preset(DOME_MODES, {"surface.edge": 1.0, "surface.support.0.clamp": True}))


def test_clamped_edges_have_both_ends_picked_and_do_not_cross_ears():
    s = grid(5, 4, 5.0, 4.0)
    ends, boundary = s.edges.ends, s.edges.boundary
    assert np.array_equal(Support(Boundary(), clamp=True).clamped_edges(s), boundary)
    rows = Support(Box((2, 0, 0), (2, 4, 0)), clamp=True).clamped_edges(s)
    assert rows.sum() == 4
    assert np.all(s.V[ends[rows]][:, :, 0] == 2)
    region = Support(Box((0, 0, 0), (2, 2, 0)), clamp=True).clamped_edges(s)
    assert (region & ~boundary).sum() > 4
    assert not Support(Boundary()).clamped_edges(s).any()
    with pytest.raises(SurfaceError, match="clamp = true finds no edge"):
        Support(Vertices((0,)), clamp=True).clamped_edges(s)


# handed over to a cut sheet


def test_a_cut_sheet_keeps_the_springs_and_clamps_that_are_left():
    s = grid(10, 10, 1.0, 1.0)
    y = s.V[:, 1]
    supports = [Support(Side("x", "min"), spring=(1e5, 1e5, 1e5), clamp=True)]
    case = LoadCase.build(s, supports, [Force(Box((1, 0.5, 0), (1, 1, 0)), (0, 0, -10.0))])
    half = cut(s, [y], [[0.47]]).subset()
    load = sheet_load(s, half, case)
    left = case.spring[(y > 0.47) & (s.V[:, 0] < 1e-9)].sum(axis=0)
    assert_allclose(load.spring.sum(axis=0), left, rtol=1e-12)
    assert_allclose(left, 1e5 * (0.5 + 0.05) / 1.0, rtol=0.1)
    mid = half.surface.V[half.surface.edges.ends[load.clamped]]
    assert_allclose(mid[:, :, 0], 0, atol=1e-12)
    assert np.ptp(mid[:, :, 1], axis=1).sum() == pytest.approx(0.53, rel=1e-9)
    bare = cut(s, [s.V[:, 0]], [[0.35]]).subset()
    with pytest.raises(StaticsError, match="the cut removed all supported vertices"):
        sheet_load(s, bare, case)


def test_a_clamped_sheet_cut_but_kept_whole_is_as_stiff():
    s = grid(12, 4, 1.0, 0.25)
    case = LoadCase.build(s, [Support(Side("x", "min"), clamp=True)], [Line(Side("x", "max"), (0, 0, -10.0))])
    cells = cut(s, [s.V[:, 1] - 0.3 * s.V[:, 0]], [[0.03, 0.11]])
    whole = cells.subset(np.ones(cells.surface.m, dtype=bool))
    stiff = [
        solve_statics(SheetModel(t, WOOD, H), load, Elements("quadratic", "hhj")).compliance
        for t, load in ((s, case), (whole.surface, sheet_load(s, whole, case)))
    ]
    assert whole.surface.m > s.m
    assert stiff[1] == pytest.approx(stiff[0], rel=5e-3)


# from a preset


def test_a_dome_on_springs_is_built_and_tells_their_reactions():
    base = {"at": {"pick": "boundary"}, "spring": [4e7, 4e7, 9e7], "clamp": True}
    changes = {"surface.edge": 0.9, "surface.support": [base], "statics.bending": "midedge", "pattern.keep": 0.0}
    design = run(load_preset(DOME_MODES, changes))
    (told,) = design_facts(design, {}, [], [])["statics"]["supports"]
    assert (told["hold"], told["spring_N_per_m"], told["clamp"]) == ("", [4e7, 4e7, 9e7], True)
    assert told["reaction_N"] == pytest.approx((-design.load.force.sum(axis=0)).tolist(), abs=1.0)
    sunk = design.statics.equilibrium.u[design.load.supported, 2] @ design.surface.vertex_areas[design.load.supported]
    area = design.surface.vertex_areas[design.load.supported].sum()
    assert sunk / area == pytest.approx(design.load.force[:, 2].sum() / 9e7, rel=1e-9)
    assert any("of the stiffness of spring supports is on removed material" in note.text for note in design.notes)


def test_supports_are_read_with_defaults():
    read = TypeAdapter(Support).validate_python
    at = {"pick": "all"}
    assert read({"at": at}) == Support(All(), "xyz")
    assert read({"at": at, "spring": [0, 0, 5]}) == Support(All(), "", (0.0, 0.0, 5.0))
    assert read({"at": at, "hold": "xy", "spring": [0, 0, 5]}).hold == "xy"
    assert read({"at": at, "hold": "", "clamp": True}).clamp
    for support in (Support(All()), Support(All(), "xy", (0, 0, 5.0)), Support(All(), spring=(1.0, 0, 0), clamp=True)):
        assert read(TypeAdapter(Support).dump_python(support)) == support


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"hold": ""}, "the support holds nothing; give hold"),
        ({"hold": "", "spring": [0, 0, 0]}, "the support holds nothing"),
        ({"spring": [0, 0, -5]}, r"spring = \[0\.0, 0\.0, -5\.0\] must be newtons per metre"),
        ({"hold": "xz", "spring": [4, 4, 5]}, r"hold = 'xz' and spring = \[4.* both act along x, z; use only"),
        ({"spring": [1, 2]}, "spring"),
    ],
)
def test_impossible_supports_are_refused(table, says):
    with pytest.raises(ValidationError, match=says):
        TypeAdapter(Support).validate_python({"at": {"pick": "all"}, **table})
    with pytest.raises(PresetError, match=r"surface\.support\.0.*" + says):
        load_preset(DOME_MODES, {"surface.support.0": {"at": {"pick": "all"}, **table}})


def test_springs_on_vertices_without_faces_are_refused():
    s = Surface([[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], [[0, 1, 2]])
    with pytest.raises(SurfaceError, match="a spring is on vertices without faces"):
        Support(Vertices((3,)), spring=(1.0, 1.0, 1.0)).springs(s)


def test_a_stiff_plate_on_springs_everywhere_swings_as_a_mass_on_a_spring():
    """All three rigid motions across it have omega^2 = k / m: springs and mass are spread alike."""
    s, k = grid(6, 6, 1.0, 1.0), 5e4
    springs = Support(All(), hold="xy", spring=(0.0, 0.0, k))
    made = frequencies(
        SheetModel(s, Material(210e12, 0.3, 8000.0), 0.1),
        springs.fixed_directions(s),
        elements=PAIRS[1],
        spring=springs.springs(s),
    )
    assert_allclose(made.hertz, np.sqrt(k / 800.0) / (2 * np.pi), rtol=0.03)
    with pytest.raises(StaticsError, match="can move along z"):
        frequencies(SheetModel(s, Material(210e12, 0.3, 8000.0), 0.1), springs.fixed_directions(s), elements=PAIRS[1])


def test_a_strip_that_its_support_clamps_buckles_as_eulers_flagpole():
    """pi^2 E I / (4 l^2) [Euler 1744], without Poisson's effect; the same strip on springs alone is a mechanism."""
    s, b = grid(16, 2, 2.0, 0.25), 0.25
    supports = [Support(Side("x", "min"), clamp=True), Support(All(), hold="y")]
    case = LoadCase.build(s, supports, [Line(Side("x", "max"), (-1.0 / b, 0, 0))])
    answer = solve_statics(SheetModel(s, WOOD, H), case, Elements("quadratic", "hhj"))
    (factor,) = buckling(SheetModel(s, WOOD, H), case, answer, 1).factor
    assert_allclose(factor, np.pi**2 * E * b * H**3 / 12 / (4 * 2.0**2), rtol=0.01)


def test_modes_of_a_preset_know_its_springs_and_clamped_edges():
    changes = {"surface.edge": 1.2, "statics.bending": "midedge", "statics.frequencies": 1, "statics.buckling": 1}
    stiff = draft(load_preset(DOME_MODES, {**changes, "surface.support.0.clamp": True})).statics.answers
    hinged = draft(load_preset(DOME_MODES, changes)).statics.answers
    soft = {"surface.support.0.hold": "xy", "surface.support.0.spring": [0.0, 0.0, 1e6]}
    on_springs = draft(load_preset(DOME_MODES, {**changes, **soft})).statics.answers
    # a dome stands on its membrane: turning at the base matters little, giving way a lot
    assert stiff.vibration.hertz[0] > 1.0005 * hinged.vibration.hertz[0] > 1.5 * on_springs.vibration.hertz[0]
    assert not np.isclose(hinged.buckling.factor[0], on_springs.buckling.factor[0], rtol=1e-3)
