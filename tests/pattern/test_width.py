"""Widths of stripes: constant in metres, graded by stress, bounded, and scaled to a wanted share of material."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dsfab
from dsfab.core.errors import PatternError, PresetError
from dsfab.core.messages import length
from dsfab.design import draft
from dsfab.design.stripe_pattern import corrected_pattern
from dsfab.pattern import (
    CornerPhase,
    EvenFamily,
    ModeFamily,
    Stripes,
    Widths,
    mean_duty_factor,
    relative_stresses,
    slopes,
    solved_factor,
    vertex_means,
)
from dsfab.pattern.stripes import wave
from dsfab.preset.file import with_overrides
from dsfab.preset.model import Width
from dsfab.slicing import cut
from tests.designs import sliced
from tests.presets import DOME_MODES, GLOBE_MODES, on_modes
from tests.shapes import ZOO, grid, jittered, zoo

COARSE = {
    "dome": {"surface.edge": 0.5, "pattern.width": {}},
    "cantilever": {"surface.edge": 0.05, "pattern.width": {}},
    "globe": {"surface.edge": 0.1, "pattern.width": {}},
}


@pytest.fixture(scope="module")
def coarse():
    """Cut, not yet thickened."""
    return {name: sliced(dsfab.load_preset(on_modes(name), changes)) for name, changes in COARSE.items()}


def with_width(design, name, **width):
    asked = dsfab.load_preset(on_modes(name), {**COARSE[name], "pattern.width": width})
    return dsfab.Design.from_preset(asked, design).until("slicing")


def kept_share(design) -> float:
    cells = design.slicing.cells
    return cells.surface.areas[cells.material].sum() / design.surface.area


def sheet_of(surface, *layers, snap=0.0):
    return cut(surface, [layer.field for layer in layers], [layer.levels for layer in layers], snap)


# --- what widths are made of


def test_slope_of_a_linear_phase_is_its_gradient_and_means_keep_constants_and_integrals():
    plate = jittered(grid(9, 7, 2.0, 1.0))
    assert slopes(plate, plate.V @ [3.0, -4.0, 0.0] + 0.2) == pytest.approx(np.full(plate.n, 5.0), rel=1e-12)
    for surface in (plate, ZOO["closed"]()):
        x = np.random.default_rng(0).normal(size=(surface.m, 2))
        means = vertex_means(surface, x)
        assert surface.vertex_areas @ means == pytest.approx(surface.areas @ x, rel=1e-12)
        assert vertex_means(surface, np.full(surface.m, 2.5)) == pytest.approx(np.full(surface.n, 2.5))


def test_slope_does_not_vanish_on_a_ridge():
    """|x| has slope 1 on both sides and on the ridge, where the mean of the gradients is zero."""
    plate = grid(10, 4, 2.0, 1.0)
    assert slopes(plate, np.abs(plate.V[:, 0] - 1)) == pytest.approx(np.ones(plate.n))


def test_slope_over_a_radius_is_half_the_range_of_the_phase_there():
    """On the ridge of z = s^2 / 2 the mean of |s| over a disc of radius R is 4 R / (3 pi); far from it |s| stays."""
    plate = grid(60, 30, 2.0, 1.0)
    s = plate.V[:, 0] - 1
    inner = np.abs(plate.V[:, 1] - 0.5) < 0.1
    for radius in (0.15, 0.25):
        slope = slopes(plate, s**2 / 2, radius)
        assert slope[inner & (np.abs(s) < 1e-9)] == pytest.approx(4 * radius / (3 * np.pi), rel=0.12)
        far = inner & (np.abs(np.abs(s) - 0.55) < 0.02)
        assert slope[far] == pytest.approx(np.abs(s[far]), rel=0.03)
    assert slopes(plate, s**2 / 2)[inner & (np.abs(s) < 1e-9)].max() < 0.04


# --- constant


@pytest.mark.parametrize("angle", [0.0, 0.4, 1.2])
@pytest.mark.parametrize("member", [0.01, 0.07, 0.13])
def test_members_on_a_plate_have_the_requested_width(angle, member):
    """z = f (x cos + y sin): lines 1/f apart; every boundary of material inside lies member / 2 from one of them."""
    plate, f = jittered(grid(9, 6, 2.0, 1.0)), 5.3
    along = np.array([np.cos(angle), np.sin(angle), 0])
    family = ModeFamily.from_mode(plate, "major", Stripes(f, 0.31), plate.V @ along)
    sheet = sheet_of(plate, family.layers(Widths("constant", member=member))[0])
    kept = sheet.subset().surface
    border = kept.V[kept.edges.ends[kept.edges.boundary]]
    outer = ((np.abs(border[:, :, :2]) < 1e-12) | (np.abs(border[:, :, :2] - [2, 1]) < 1e-12)).all(axis=1).any(axis=1)
    z = f * border[~outer] @ along + 0.31
    assert len(z) > 10
    assert np.abs(z - np.round(z)) / f == pytest.approx(np.full(z.shape, member / 2), abs=1e-12)
    if angle == 0:
        middles = (np.arange(12) - 0.31) / f
        edges = np.clip([middles - member / 2, middles + member / 2], 0, 2)
        assert kept.area == pytest.approx((edges[1] - edges[0]).sum(), rel=1e-12)


def test_members_keep_their_width_where_the_mode_flattens():
    """x = cos(pi s / 2) on 0 < s < 2: plain members swell towards s = 0 and 2, constant ones do not."""
    plate = grid(400, 2, 2.0, 0.02)
    family = ModeFamily.from_mode(plate, "major", Stripes(6.0, 0.5), np.cos(np.pi * plate.V[:, 0] / 2))

    def widths(rule):
        kept = sheet_of(plate, family.layers(rule)[0]).subset().surface
        s = np.sort(np.unique(np.round(kept.V[kept.V[:, 1] == 0, 0], 9)))
        groups = np.split(s, np.flatnonzero(np.diff(s) > 0.0051) + 1)
        return np.array([np.ptp(g) for g in groups if g[0] > 0.01 and g[-1] < 1.99])

    plain, constant = widths(Widths()), widths(Widths("constant", member=0.05))
    assert len(plain) == len(constant) == 12
    assert plain.max() > 2.5 * plain.min()
    assert constant == pytest.approx(np.full(12, 0.05), rel=0.03)


# --- graded


def test_graded_share_is_proportional_to_the_stress():
    """Stress 1 + 3 x on a plate of length 2, thin stripes along x: the kept share in a slot at x is c (1 + 3 x)."""
    plate = grid(40, 4, 2.0, 1.0)
    stress = 1 + 3 * plate.V[:, 0]
    for q in (0.5, 1.0, 2.0):
        family = ModeFamily.from_mode(plate, "major", Stripes(20.0, 0.1, 0.5), plate.V[:, 1], stress)
        widths = Widths("graded", q=q)
        factor = mean_duty_factor(plate, [family], widths)
        sheet = sheet_of(plate, family.layers(widths, factor)[0])
        assert sheet.surface.areas[sheet.material].sum() == pytest.approx(0.5 * 0.5 * 2, rel=1e-3)
        middle, areas = sheet.surface.centroids[:, 0], sheet.surface.areas * sheet.material
        slots = np.add.reduceat(areas[np.argsort(middle)], np.searchsorted(np.sort(middle), np.arange(0, 2, 0.05)))
        local = stress[plate.V[:, 1] == 0] ** q
        expected = (local[1:] + local[:-1]) / 2
        assert slots / slots.sum() == pytest.approx(expected / expected.sum(), rel=2e-3)


def test_families_share_the_material_as_their_stresses_and_thresholds_ask():
    plate = grid(4, 4, 1.0, 1.0)
    stress = relative_stresses(plate, np.tile([-3.0, 1.0], (plate.m, 1)))
    assert stress == pytest.approx(np.tile([1.5, 0.5], (plate.n, 1)))
    one, two = (ModeFamily.from_mode(plate, "a", Stripes(5.0, 0.0, 0.6), plate.V[:, 0], s) for s in stress.T)
    factor = mean_duty_factor(plate, [one, two], Widths("graded"))
    d = [2 * family.half_widths(Widths("graded"), factor) for family in (one, two)]
    assert d[0] == pytest.approx(np.full(plate.n, 0.3))  # mean duty (1 - 0.6) / 2, at the ratio 3 : 1
    assert d[1] == pytest.approx(np.full(plate.n, 0.1))
    wider = replace(two, stripes=Stripes(5.0, 0.0, 0.2))
    assert wider.half_widths(Widths("graded"), factor) == pytest.approx(np.full(plate.n, 0.1))  # twice as wide
    even = mean_duty_factor(plate, [one, two], Widths("graded", q=0))
    assert two.half_widths(Widths("graded", q=0), even) == pytest.approx(np.full(plate.n, 0.1))


def test_stress_that_is_nowhere_cannot_be_followed():
    plate = grid(3, 3, 1.0, 1.0)
    with pytest.raises(PatternError, match="the surface has no stress"):
        relative_stresses(plate, np.zeros((plate.m, 2)))
    corner = np.zeros(plate.n)
    corner[0] = 1
    family = ModeFamily.from_mode(plate, "major", Stripes(5.0), plate.V[:, 0], corner)
    with pytest.raises(PatternError, match=r"cannot keep 50\.0% .*at most 3\.\d%"):
        mean_duty_factor(plate, [family], Widths("graded"))


# --- bounds


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    name=st.sampled_from(list(ZOO)),
    rule=st.sampled_from(["plain", "constant", "graded", "stressed"]),
    low=st.floats(0, 0.05).map(lambda share: round(share, 4)),
    span=st.floats(0, 0.2).map(lambda share: round(share, 4)),
    factors=st.tuples(st.floats(0, 5), st.floats(0, 5)),
)
def test_widths_in_metres_stay_within_their_bounds_and_grow_with_the_factor(name, rule, low, span, factors):
    surface = ZOO[name]()
    x = surface.V[:, 0] / surface.size + 0.1 * np.sin(9 * surface.V[:, 1] / surface.size)
    stress = np.random.default_rng(3).exponential(size=surface.n)
    family = ModeFamily.from_mode(surface, "major", Stripes(7.0, 0.2, 0.1), x, stress)
    size = surface.size
    widths = Widths(rule, member=0.03 * size, min_width=low * size, max_width=(low + span) * size)
    less, more = (family.half_widths(widths, f) for f in sorted(factors))
    assert ((less >= 0) & (less <= more) & (more <= 0.5)).all()
    for d in (less, more):
        metres = 2 * d / family.slope
        assert (metres[d < 0.5] >= low * size * (1 - 1e-12)).all()
        if low + span > 0:
            assert (metres <= (low + span) * size * (1 + 1e-12)).all()


def test_gaps_narrower_than_min_gap_are_filled():
    """Stress s from 0 to 2 along stripes 0.1 apart, d = s / 4 periods: the gap 0.1 (1 - s / 2) is filled under 0.03."""
    plate = grid(100, 20, 2.0, 1.0)
    s = plate.V[:, 0]
    family = ModeFamily.from_mode(plate, "major", Stripes(10.0, 0.03, 0.0), plate.V[:, 1], s)
    widths = Widths("graded", min_gap=0.03)
    d = family.half_widths(widths)
    assert (d[s > 1.401] == 0.5).all()
    assert d[s < 1.399] == pytest.approx(s[s < 1.399] / 4)
    void = sheet_of(plate, family.layers(widths)[0]).subset(~sheet_of(plate, family.layers(widths)[0]).material).surface
    assert void.V[:, 0].max() < 1.43
    assert sheet_of(plate, family.layers(Widths("graded"))[0]).subset().surface.V[:, 0].max() == 2


@zoo
def test_plain_widths_without_bounds_are_the_thresholds(name):
    surface = ZOO[name]()
    x = surface.V[:, 0] / surface.size
    family = ModeFamily.from_mode(surface, "major", Stripes(7.0, 0.2, 0.35), x)
    layer = family.layers(Widths())[0]
    assert np.array_equal(layer.field, x)
    assert np.array_equal(layer.levels, Stripes(7.0, 0.2, 0.35).levels(x))
    assert layer.half_width == pytest.approx(np.full(surface.n, 0.65 / 4))
    bounded = sheet_of(surface, family.layers(Widths(min_width=1e-9 * surface.size))[0])
    plain = sheet_of(surface, layer)
    areas = [s.surface.areas[s.material].sum() for s in (plain, bounded)]
    assert areas[0] == pytest.approx(areas[1], rel=1e-12)


def test_wider_stripes_end_as_touching_stripes():
    stripes = Stripes(3.0, 0.1, 0.6)
    assert stripes.with_width_factor(1) is stripes
    assert stripes.with_width_factor(2.0).threshold == pytest.approx(0.2)
    assert stripes.with_width_factor(99).threshold == -1
    assert stripes.with_width_factor(0).threshold == 1


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"rule": "narrow"}, "must be plain, constant, graded or stressed"),
        ({"rule": "constant"}, "needs the key member"),
        ({"member": -1.0}, "member = -1.0 must be a length"),
        ({"min_width": np.inf}, "min_width = inf must be"),
        ({"max_width": np.nan}, "max_width = nan must be"),
        ({"min_gap": -0.1}, "min_gap = -0.1 must be"),
        ({"q": 5.0}, "q = 5.0 must lie between 0"),
        ({"min_width": 0.2, "max_width": 0.1}, "min_width = 0.2 m is more than max_width = 0.1 m"),
    ],
)
def test_impossible_widths_are_refused(values, says):
    with pytest.raises(PatternError, match=says):
        Widths(**values)


# --- the wanted share


@pytest.mark.parametrize(
    "share",
    [
        lambda f: min(0.3 * f, 1),
        lambda f: 1 - np.exp(-f),
        lambda f: 0.1 + 0.9 * f**3 / (1 + f**3),
        lambda f: min(1e-4 * f, 0.9),
        lambda f: min(300 * f, 0.9),
        lambda f: np.clip(f - 20, 0, 1),
    ],
)
@pytest.mark.parametrize("wanted", [0.15, 0.5, 0.85])
def test_the_factor_for_a_share_is_found_in_few_steps(share, wanted):
    asked = []
    factor = solved_factor(lambda f: asked.append(f) or share(f), wanted, 1e-6)
    assert share(factor) == pytest.approx(wanted, abs=1e-6)
    assert len(asked) < 28


@pytest.mark.parametrize(
    "share",
    [lambda f: min(0.45 * f, 1), lambda f: 1 - np.exp(-0.6 * f), lambda f: 0.3 + 0.15 * f**3, lambda f: 0.4 * f**0.5],
)
@pytest.mark.parametrize("off", [0.8, 0.97, 1.0, 1.04, 1.3])
@pytest.mark.parametrize("slope", [0.2, 0.8])
def test_a_good_first_guess_saves_steps(share, off, slope):
    """The share is wanted that a factor near 1 gives; the slope is a rough one. No cut is made of all material."""
    asked = []
    factor = solved_factor(lambda f: asked.append(f) or share(f), share(off), 4e-4, slope)
    assert share(factor) == pytest.approx(share(off), abs=4e-4)
    assert len(asked) <= (1 if off == 1 else 6)
    assert max(asked) < 3.5


def test_an_unreachable_share_is_refused_with_the_reachable_range():
    for wanted, says in ((0.1, "at least 20.0%"), (0.95, "at most 90.0%")):
        with pytest.raises(PatternError, match=f"cannot keep {wanted:.1%} of the surface: {says}"):
            solved_factor(lambda f: min(0.2 + f, 0.9), wanted, 1e-3)
    with pytest.raises(PatternError, match=r"cannot be 50\.0%"):
        solved_factor(lambda f: 0.2 if f < 0.7 else 0.8, 0.5, 1e-3)


def test_the_search_takes_the_nearest_share_beside_a_small_jump():
    """As where a tidied end comes or goes: by .6 %, from .2 % under what is wanted; then no more cuts are made."""
    asked = []

    def share(f: float) -> float:
        asked.append(f)
        return min(0.5 * f + (0.006 if f > 0.996 else 0.0), 0.9)

    assert share(solved_factor(share, 0.5, 4e-4)) == pytest.approx(0.498, abs=1e-4)
    assert len(asked) < 18


def test_the_search_accepts_a_jump_within_its_tolerance():
    """By .6 %, from .2 % under what is wanted: nearer than .1 % there is nothing."""

    def share(f: float) -> float:
        return min(0.5 * f + (0.006 if f > 0.996 else 0.0), 0.9)

    with pytest.raises(PatternError, match=r"cannot be 50\.0%.*nearest possible: 49\.80%"):
        solved_factor(share, 0.5, 4e-4, jump=0.001)
    assert share(solved_factor(share, 0.5, 4e-4, jump=0.003)) == pytest.approx(0.498, abs=1e-4)


JUMPING = {
    "slicing.loose": "keep",
    "surface.edge": 0.1,
    "pattern.tidy": True,
    "pattern.keep": 0.0,
    "pattern.rim": 0.0,
    "pattern.major.frequency": 4.8,
    "pattern.minor.frequency": 5.7,
    "pattern.major.phase": 0.59,
    "pattern.minor.phase": 0.89,
    "pattern.width": {"rule": "constant", "min_width": 0.012, "min_gap": 0.012, "solid_fraction": 0.311},
}
"""A coarse plate on which the end of a member comes as widths grow: what is drawn jumps from 30.94 % of it to more than
31.1 %, and what is left when slits are filled from 32.07 % to 32.5 %."""


@pytest.mark.parametrize(("wanted", "nearest"), [(0.3220, 0.3207), (0.3232, 0.3251)])
def test_the_nearest_share_is_delivered_with_a_note(wanted, nearest):
    """Once 32.49 % was delivered for 32.1: the first that was allowed."""
    preset = dsfab.load_preset("cantilever", JUMPING)
    assert preset.pattern.width.solid_fraction_tolerance == 0.005
    design = draft(with_overrides(preset, {"pattern.width.solid_fraction": wanted}))
    share = design.sheet.surface.area / design.surface.area
    assert share == pytest.approx(nearest, abs=1e-4)
    assert [note.text for note in design.notes if f"{nearest:.2%} is the nearest possible share, because" in note.text]


def test_a_share_past_a_jump_is_refused_where_no_more_is_allowed():
    preset = dsfab.load_preset("cantilever", JUMPING)
    with pytest.raises(
        PatternError,
        match=r"cannot be 31\.1% of the surface, .*\(nearest possible: 30\.94%\).*allow a larger .*_tolerance",
    ):
        _ = draft(with_overrides(preset, {"pattern.width.solid_fraction_tolerance": 0.001})).pattern


def test_a_small_jump_of_the_share_gives_a_note():
    """31.9 % is wanted, and 31.87 % is there: less than the share may miss anyway is not told, more is."""
    preset = dsfab.load_preset("cantilever", JUMPING)
    for wanted, told in ((0.3190, False), (0.3240, True)):
        notes = draft(with_overrides(preset, {"pattern.width.solid_fraction": wanted})).notes
        assert any("is the nearest" in note.text for note in notes) == told


@pytest.mark.slow
def test_competitors_have_the_actual_mass_of_the_design():
    """A plate that carries, of which 43.9 % is wanted and 43.88 % is there."""
    from dsfab.study import compare

    spacings = {"pattern.method": "stripes", "pattern.major.spacing": 0.36, "pattern.minor.spacing": 0.22}
    around = {"pattern.tidy": True, "pattern.keep": 0.1, "pattern.rim": 0.02, "surface.edge": 0.13}
    asked = {**spacings, **around, "pattern.width.solid_fraction": 0.439}
    found = compare(draft(dsfab.load_preset("cantilever", asked)), ["thinner", "grid"])
    own = found["design"].mass
    assert own / found.full.mass == pytest.approx(0.43878, abs=2e-4)
    assert [found[name].mass for name in ("thinner", "grid")] == pytest.approx([own, own], rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "width"),
    [
        ("cantilever", {"rule": "plain"}),
        ("cantilever", {"rule": "constant"}),
        ("cantilever", {"rule": "graded", "min_gap": 0.03}),
        ("dome", {"rule": "plain", "max_width": 0.7}),
        ("dome", {"rule": "graded", "q": 0.5, "min_width": 0.02}),
        ("globe", {"rule": "graded", "min_gap": 0.03}),
    ],
)
def test_the_wanted_share_is_kept_to_a_thousandth(coarse, name, width):
    design = with_width(coarse[name], name, solid_fraction=0.55, **width)
    assert kept_share(design) == pytest.approx(0.55, abs=1e-3)
    assert design.pattern.factor != 1
    assert [note.stage for note in design.notes if "solid_fraction = 55.0%" in note.text] == ["pattern"]


def test_a_share_below_keep_and_rim_is_refused(coarse):
    with pytest.raises(PatternError, match=r"cannot keep 2\.0% of the surface: at least"):
        with_width(coarse["cantilever"], "cantilever", solid_fraction=0.02)


def test_a_solved_member_width_is_the_one_that_gives_the_share(coarse):
    solved = with_width(coarse["globe"], "globe", rule="constant", solid_fraction=0.4)
    member = solved.pattern.factor * np.sqrt(solved.surface.area) / 100
    assert f"members are {length(member)} wide" in " ".join(note.text for note in solved.notes)
    again = with_width(coarse["globe"], "globe", rule="constant", member=member)
    assert kept_share(again) == pytest.approx(kept_share(solved), abs=1e-9)


# --- in a design


def test_a_plain_design_is_cut_as_its_thresholds_say(coarse):
    for name, design in coarse.items():
        ask, pattern = design.preset.pattern, design.pattern
        for family, modes in (("major", design.diffusion.major), ("minor", design.diffusion.minor)):
            stripes, at = getattr(ask, family).stripes, pattern.names.index(family)
            x = modes.mode(getattr(ask, family).mode)
            assert np.array_equal(pattern.fields[at], x), name
            assert np.array_equal(pattern.levels[at], stripes.levels(x))
        assert pattern.factor == 1
        assert all(np.isinf(d).all() for n, d in zip(pattern.names, pattern.half_widths, strict=True) if n == "keep")


STRESSED = {"rule": "stressed", "steps": 2}


@pytest.mark.parametrize(
    "width", [{"rule": "plain"}, {"rule": "constant", "member": 0.1}, {"rule": "graded"}, STRESSED]
)
def test_cells_agree_with_the_wave_and_the_carried_half_widths(coarse, width):
    """What a shader draws: material where p(z) > 1 - 4 d, z and d linear over each face."""
    design = coarse["globe"]
    changes = {f"pattern.width.{k}": v for k, v in width.items()} | {"slicing.snap": 0.0, "pattern.keep": 0.0}
    design = dsfab.revise(design, dsfab.load_preset(GLOBE_MODES, COARSE["globe"] | changes))
    cells, pattern = design.slicing.cells, design.pattern
    assert pattern.names == ("major", "minor")
    value = []
    for k, family in enumerate(pattern.names):
        ask = getattr(design.preset.pattern, family)
        modes = getattr(design.diffusion, family)
        z = cells.carry(ask.stripes.phases(modes.mode(ask.mode)))[cells.surface.F].mean(axis=1)
        d = cells.carry(pattern.half_widths[k])[cells.surface.F].mean(axis=1)
        value.append(wave(z) - (1 - 4 * d))
    material = np.maximum(*value) > 0
    clear = (np.abs(value) > 1e-6).all(axis=0) & (cells.surface.areas > 1e-9)
    assert clear.mean() > 0.95
    assert (material == cells.material)[clear].all()


def test_the_width_of_each_family_follows_the_stress_along_it(coarse):
    """Major stripes run along the primary stress; on the sphere the two differ from pole to equator."""
    design = with_width(coarse["globe"], "globe", rule="graded")
    for name, principal in zip(("major", "minor"), design.diffusion.tensors.principal.T, strict=True):
        d = design.pattern.half_widths[design.pattern.names.index(name)]
        size = vertex_means(design.surface, np.abs(principal))
        partly = (d > 0) & (d < 0.5)
        ratio = d[partly] / size[partly]
        assert (d[size == 0] == 0).all()
        assert len(ratio) > 0.7 * design.surface.n
        assert ratio == pytest.approx(np.full(len(ratio), ratio[0]), rel=1e-9)


def test_widths_restart_at_the_pattern_and_give_the_fresh_design(coarse):
    old = coarse["cantilever"]
    new = with_width(old, "cantilever", rule="graded", solid_fraction=0.5, min_width=0.01)
    assert new.diffusion is old.diffusion
    fresh = dsfab.run(new.preset)
    assert np.array_equal(new.solid.V, fresh.solid.V)
    assert new.notes == fresh.notes


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"rule": "constant"}, r"pattern\.width: the width rule 'constant' needs the key member"),
        ({"min_width": 0.2, "max_width": 0.1}, r"pattern\.width: min_width = 0\.2 m is more than max_width"),
        ({"rule": "grade"}, r"pattern\.width\.rule = 'grade': .*did you mean graded\?"),
        ({"solid_fraction": 1.0}, r"pattern\.width\.solid_fraction = 1\.0: should be less than 1"),
        ({"q": -1.0}, r"pattern\.width\.q = -1\.0"),
        ({"meber": 1.0}, r"unknown key pattern\.width\.meber; did you mean member\?"),
    ],
)
def test_impossible_presets_are_refused_with_their_key(changes, says):
    with pytest.raises(PresetError, match=says):
        dsfab.load_preset(DOME_MODES, {"pattern.width": changes})


def test_crowded_members_of_one_width_leave_no_slit():
    """Three quarters of the lines are 1 m apart, most others 0.35 m, some 0.1 m: around a load these become one."""
    density = np.where(np.arange(400) < 300, 1.0, 1 / 0.35)
    density[-50:] = 1 / 0.1
    nothing = np.zeros((0, 3))
    phase = CornerPhase(np.zeros(400), nothing, nothing, np.zeros(0, dtype=bool))
    family = EvenFamily("major", Stripes(1.0), phase, (), density, density, np.ones(400))
    thin, wide, closed = (family.half_widths(Widths("constant", member=member)) for member in (0.15, 0.7, 1.2))
    assert thin[:300] == pytest.approx(np.full(300, 0.075))
    assert thin[300] == pytest.approx(0.15 / 2 / 0.35)
    some = family.half_widths(Widths("constant", member=0.2))
    assert some[[0, 300, -1]] == pytest.approx([0.1, 0.25, 0.5])  # as asked; thinner than 0.2 m; one
    assert wide[[0, 300]] == pytest.approx([0.35, 0.4375])
    wider = [family.half_widths(Widths("constant", member=x))[300] for x in np.linspace(0.15, 0.4, 400)]
    assert (np.diff(wider) >= 0).all()
    assert np.diff(wider).max() < 0.02  # no jump
    assert closed[[0, 300]] == pytest.approx([0.5, 0.5])
    plain = family.half_widths(Widths(), 1.2)
    assert (plain == plain[0]).all()


@pytest.mark.parametrize("rule", ["graded", "stressed"])
def test_evenly_spaced_members_leave_no_slit_where_the_stress_is_large(rule):
    """Half-widths of .1 times the stress: up to .25 as asked, up to .2875 thinner, from .3125 on one."""
    stress = np.ones(400)
    stress[-8:] = [2.4, 2.6, 2.85, 2.9, 3.0, 3.1, 3.2, 9.0]
    nothing = np.zeros((0, 3))
    phase = CornerPhase(np.zeros(400), nothing, nothing, np.zeros(0, dtype=bool))
    family = EvenFamily("major", Stripes(1.0, threshold=0.6), phase, (), np.ones(400), np.ones(400), stress)
    found = family.half_widths(Widths(rule))
    assert found[:392] == pytest.approx(np.full(392, 0.1))
    assert found[392:] == pytest.approx([0.24, 0.25, 0.25, 0.275, 0.375, 0.475, 0.5, 0.5])
    wide = family.half_widths(Widths(rule), 2.4)  # half of the members leave openings like that: 1.25 times the usual
    assert wide[[0, 392, -1]] == pytest.approx([0.24, 0.5, 0.5])
    grown = np.array([family.half_widths(Widths(rule), factor) for factor in np.linspace(0.5, 3, 500)])
    assert (np.diff(grown, axis=0) >= -1e-12).all()
    assert np.diff(grown, axis=0).max() < 0.1  # no jump: every share can be reached
    bounded = family.half_widths(Widths(rule, max_width=0.48))
    assert bounded.max() == pytest.approx(0.24)


@pytest.mark.slow
def test_round_corners_and_filled_specks_are_in_the_share():
    """The fillets of the dome alone are .17 % of its surface."""
    design = dsfab.Design.from_preset(dsfab.load_preset("dome", {"surface.edge": 0.5}))
    assert design.preset.pattern.fillet > 0
    assert design.sheet.surface.area / design.surface.area == pytest.approx(0.4, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "edge", "asked"),
    [
        ("barrel_vault", 0.7, 0.6),
        pytest.param("barrel_vault", 0.35, 0.8, marks=pytest.mark.slow),
        pytest.param("dome", 0.6, 0.7, marks=pytest.mark.slow),
        pytest.param("globe", 0.12, 0.8, marks=pytest.mark.slow),
    ],
)
def test_a_share_holds_where_members_are_wider_than_openings(name, edge, asked):
    """Of so much material openings must be narrow: a vault of 60 % kept 26 %, for all of them were to be filled.

    The dome's close by rings, each of over 1 % of it: .706 is the nearest to .7.
    """
    made = draft(dsfab.load_preset(name, {"surface.edge": edge, "pattern.width.solid_fraction": asked}))
    assert made.sheet.surface.area / made.surface.area == pytest.approx(asked, abs=0.0065 if name == "dome" else 0.006)


def test_bridges_are_in_the_share_too():
    """Stripes of a share x keep x + .02 with round corners, and a tenth of what they lack of the half for bridges."""
    aims: list[float] = []
    asked: list[float] = []

    def made(taken: float, _: float) -> SimpleNamespace:
        aims.append(0.4 - taken)
        return SimpleNamespace(factor=1.0)

    def bridged() -> float:
        asked.append(aims[-1])
        return 0.1 * (0.5 - aims[-1])

    _, total = corrected_pattern(Width(solid_fraction=0.4), made, lambda x: x, lambda _: 0.02, bridged)
    assert aims[-1] + 0.02 + 0.1 * (0.5 - aims[-1]) == pytest.approx(0.4, abs=4e-4)
    assert total == 0.4
    assert len(asked) < len(aims)  # not before the rest is known


def test_a_bridge_that_comes_and_goes_is_not_sought_for_longer_than_the_nearer_side_is_allowed():
    """Of stripes of over 40.15 % a gap is bridged, by 1.2 % of the surface; .6 % round corners are everywhere.

    Each round takes seconds: six of them, none twice, where it were ten.
    """
    aims: list[float] = []

    def made(taken: float, _: float) -> SimpleNamespace:
        aims.append(0.41 - taken)
        return SimpleNamespace(factor=1.0, aim=aims[-1])

    def bridged() -> float:
        return 0.012 if aims[-1] > 0.4015 else 0.0

    width = Width(solid_fraction=0.41, solid_fraction_tolerance=0.005)
    best, total = corrected_pattern(width, made, lambda x: x, lambda _: 0.006, bridged)
    assert len(aims) <= 6
    assert np.diff(sorted(aims)).min() > 4e-4  # none twice
    assert total == pytest.approx(best.aim + 0.006)  # the side without it is the nearer one
    assert 0.41 - 0.005 <= total < 0.41


@pytest.mark.slow
def test_a_share_holds_where_many_bridges_are_built(monkeypatch):
    """72 of them, between meridians that all meet at a skylight, were .6 % of the surface."""
    monkeypatch.setattr("dsfab.slicing.cutting.halving.GAIN", np.inf)
    arena = Path(__file__).parents[2] / "docs" / "examples" / "arena.toml"
    design = sliced(dsfab.load_preset(arena))
    assert any("bridges between members where openings are narrower" in note.text for note in design.notes)
    assert design.sheet.surface.area / design.surface.area == pytest.approx(0.3, abs=1e-3)
