"""Members against EN 1993-1-1 and EN 1995-1-1: formulas worked by hand, and worked examples of others."""

from dataclasses import replace
from math import pi, sqrt
from typing import get_args

import numpy as np
import pytest

from dsfab.core.errors import PresetError, StaticsError
from dsfab.core.materials import MATERIALS
from dsfab.design import Design
from dsfab.design.member_model import eurocode_rules
from dsfab.members.eurocode import STEEL, TIMBER, MemberBays, Rules, SteelFactors, TimberFactors, shortest, utilisation
from dsfab.members.eurocode import steel as en1993
from dsfab.members.eurocode import timber as en1995
from dsfab.members.eurocode.checks import Rectangle, moment_factor
from dsfab.members.eurocode.grades import DURATIONS, k_mod
from dsfab.members.eurocode.steel import steel_checks
from dsfab.members.eurocode.timber import timber_checks
from dsfab.preset.file import load_preset
from dsfab.preset.sections import Duration
from tests.members.bars import bar

N, VY, VZ, MT, MY, MZ = range(6)


def of_steel(bays: MemberBays, grade="S235", **factors) -> dict[str, float]:
    """The largest of each check, by name."""
    found = steel_checks(bays, bays.forces["load"], STEEL[grade], (210e9, 81e9), SteelFactors(**factors))
    return {check.name: float(value.max()) for check, value in found.items()}


def of_timber(bays: MemberBays, grade="C24", duration="medium", young=11e9, **factors) -> dict[str, float]:
    found = timber_checks(bays, bays.forces["load"], TIMBER[grade], young, duration, TimberFactors(**factors))
    return {check.name: float(value.max()) for check, value in found.items()}


# --- steel


def test_a_flat_in_tension_and_in_compression():
    """100 x 10 of S235 bears 235 kN."""
    assert of_steel(bar(0.1, 0.01, 0.5, N=117.5e3))["tension"] == pytest.approx(0.5)
    pressed = of_steel(bar(0.1, 0.01, 0.5, N=-47e3))
    assert (pressed["tension"], pressed["compression"]) == pytest.approx((0, 0.2))
    assert of_steel(bar(0.1, 0.01, 0.5, N=117.5e3), gamma_m0=1.1)["tension"] == pytest.approx(0.55)


@pytest.mark.parametrize(("thickness", "megapascals"), [(0.02, 355), (0.06, 335), (0.15, 295), (0.3, 285)])
def test_thick_plates_yield_earlier(thickness, megapascals):
    assert STEEL["S355"].fy(thickness) == megapascals * 1e6


def test_bending_and_axial_force_meet_at_the_plastic_resistance():
    """(6.32): at N = .6 N_pl a rectangle bears M_pl (1 - .36), about either axis."""
    n, plastic = 0.6 * 235e3, 235e6 * np.array([0.1 * 0.01**2, 0.01 * 0.1**2]) / 4
    for name, M in zip(("My", "Mz"), plastic, strict=True):
        found = of_steel(bar(0.1, 0.01, 0.1, N=n, **{name: 0.64 * M}))
        assert found["bending and axial force"] == pytest.approx(1)
    both = of_steel(bar(0.1, 0.01, 0.1, My=0.3 * plastic[0], Mz=-0.5 * plastic[1]))
    assert both["bending and axial force"] == pytest.approx(0.8)


def test_shear_is_that_of_the_elastic_distribution_and_takes_its_part_of_bending():
    """1.5 V / A over f_y / sqrt(3); from half of V_pl on the yield strength is less: at .8 of it by (1.6 - 1)^2."""
    V = 0.8 * 1e-3 * 235e6 / sqrt(3)
    found = of_steel(bar(0.1, 0.01, 0.1, Vz=V, N=0.5 * 235e3))
    assert found["shear and torsion"] == pytest.approx(1.2)
    assert found["bending and axial force"] == pytest.approx((0.5 / 0.64) ** 2)
    assert of_steel(bar(0.1, 0.01, 0.1, Vy=V / 2, N=0.5 * 235e3))["bending and axial force"] == pytest.approx(0.25)


def test_torsion_reduces_the_shear_resistance():
    """(6.28): half of V_pl beside a torque of .4 is .5 / .6 of what is left, so that (2 x .833 - 1)^2 is taken."""
    tau = 235e6 / sqrt(3)
    torque = 0.4 * tau * Rectangle(np.array(0.1), np.array(0.01)).Wt.item()
    found = of_steel(bar(0.1, 0.01, 0.1, Vz=0.5 * 1e-3 * tau, Mt=torque, N=0.5 * 235e3))
    assert found["bending and axial force"] == pytest.approx((0.5 / (1 - (2 * 0.5 / 0.6 - 1) ** 2)) ** 2)


def test_torsion_of_a_square_and_of_a_thin_strip():
    """T / (.208 a^3) [Timoshenko], and 3 T / (b t^2) of what is thin."""
    assert float(Rectangle(np.array(0.1), np.array(0.1)).Wt) == pytest.approx(0.208 * 1e-3, rel=3e-3)
    assert float(Rectangle(np.array(1.0), np.array(1e-3)).Wt) == pytest.approx(1e-6 / 3, rel=1e-3)
    torque = 1e-6 / 3 * 235e6 / sqrt(3)
    assert of_steel(bar(1.0, 1e-3, 0.1, Mt=torque))["shear and torsion"] == pytest.approx(1, rel=1e-3)


@pytest.mark.parametrize(
    ("slenderness", "curve", "chi"), [(0.655, "b", 0.808), (0.2, "c", 1.0), (0.1, "d", 1.0), (1.0, "c", 0.5399)]
)
def test_reduction_factors(slenderness, curve, chi):
    """The first is of a worked example of the European Convention for Constructional Steelwork (Steel Buildings in
    Europe, part 4, A.5: a column of HE 300 B)."""
    assert float(en1993.reduction(np.array(slenderness), curve)) == pytest.approx(chi, abs=6e-4)


def test_a_flat_buckles_over_its_thin_side_first():
    """100 x 10, a metre long: slenderness 346.4 / 93.91 = 3.689, phi = 8.158, chi = .0648."""
    found = of_steel(bar(0.1, 0.01, 1.0, N=-10e3))
    assert found["buckling out of the surface"] == pytest.approx(10 / 235 / 0.06479, rel=1e-3)
    lam = sqrt(12) * 10 / 93.913
    phi = 0.5 * (1 + 0.49 * (lam - 0.2) + lam**2)
    assert found["buckling in the surface"] == pytest.approx(10 / 235 * (phi + sqrt(phi**2 - lam**2)), rel=1e-3)
    safer = of_steel(bar(0.1, 0.01, 1.0, N=-10e3), gamma_m1=1.1)
    assert safer["buckling in the surface"] == pytest.approx(1.1 * found["buckling in the surface"])
    twice = of_steel(bar(0.1, 0.01, 0.5, N=-10e3), buckling_length=2.0)
    assert twice["buckling out of the surface"] == pytest.approx(found["buckling out of the surface"])


def test_an_upright_flat_buckles_sideways_as_a_lying_one_does():
    """(6.54) of 40 x 4 over a metre, with the critical moment pi / L sqrt(E I G It)."""
    lying, upright = of_steel(bar(0.04, 0.004, 1.0, Mz=100)), of_steel(bar(0.004, 0.04, 1.0, My=100))
    torsion = 0.04 * 0.004**3 / 3 * (1 - 0.63 * 0.1)
    critical = pi * sqrt(210e9 * 81e9 * 0.04 * 0.004**3 / 12 * torsion)
    lam = sqrt(0.004 * 0.04**2 / 6 * 235e6 / critical)
    phi = 0.5 * (1 + 0.76 * (lam - 0.2) + lam**2)
    expected = 100 / (0.004 * 0.04**2 / 6 * 235e6) * (phi + sqrt(phi**2 - lam**2))
    assert lying["lateral torsional buckling"] == pytest.approx(expected, rel=5e-3)
    assert upright["lateral torsional buckling"] == pytest.approx(lying["lateral torsional buckling"])


def test_buckling_and_bending_by_hand():
    """(6.61), (6.62) of 60 x 60 of S235, 2 m long, N = 100 kN, My = 1 kNm all along, Mz = -1 .. 1 kNm."""
    a, fy = 0.06, 215e6  # over 40 mm thick
    lam = 2.0 / (a / sqrt(12)) / (pi * sqrt(210e9 / fy))
    phi = 0.5 * (1 + 0.49 * (lam - 0.2) + lam**2)
    n = 100e3 / (a**2 * fy) * (phi + sqrt(phi**2 - lam**2))
    m = 1e3 / (a**3 / 6 * fy)
    mz = np.linspace(-1e3, 1e3, 5)
    found = of_steel(bar(a, a, 2.0, N=-100e3, My=1e3, Mz=mz))
    k_strong, k_weak = 0.4 * (1 + 0.6 * n), 1.0 * (1 + 0.6 * n)  # z counts as the strong axis; lambda is over 1
    assert lam > 1
    tilted = found["lateral torsional buckling"]
    one = n + k_strong * tilted + k_weak * m
    other = n + (1 - 0.05 / 0.15 * n) * tilted + k_weak * m
    assert found["buckling and bending"] == pytest.approx(max(one, other), rel=1e-6)
    assert of_steel(bar(a, a, 2.0, N=100e3, My=1e3))["buckling and bending"] == 0


@pytest.mark.parametrize(
    ("moment", "factor"),
    [
        ((1, 1, 1, 1, 1), 1.0),
        ((1, 0.5, 0, -0.5, -1), 0.4),
        ((1, 0.75, 0.5, 0.25, 0), 0.6),
        ((0, 0.75, 1, 0.75, 0), 0.95),
        ((-0.5, 0.5, 1, 0.5, -0.5), 0.925),
        ((-1, 0, 0.5, 0, -1), 0.5),
        ((1, 0, -0.8, -0.7, -0.5), 0.79),
        ((-0.5, 0.5, 1, 0.8, 0.5), 0.975),
        ((0, 0, 0, 0, 0), 1.0),
    ],
)
def test_moment_factors_of_the_table(moment, factor):
    """EN 1993-1-1, table B.3: straight lines, a beam on two supports, one with fixed ends."""
    assert moment_factor(np.array([moment], dtype=float)).item() == pytest.approx(factor)
    assert moment_factor(-2.0 * np.array([moment[::-1]], dtype=float)).item() == pytest.approx(factor)


# --- timber


def test_a_post_of_a_worked_example():
    """97 x 97 of C24, 2.7 m, 30 kN, service class 1 [haunch.dev, timber post]: k_c = .326, 25 % and 76 %."""
    found = of_timber(bar(0.097, 0.097, 2.7, N=-30e3), service_class=1)
    assert found["compression"] == pytest.approx(0.247, abs=1e-3)
    assert found["stability as a column"] == pytest.approx(0.757, abs=2e-3)
    assert float(en1995.column_factor(np.array(1.635), TIMBER["C24"])) == pytest.approx(0.326, abs=5e-4)


def test_a_column_with_bending_of_a_worked_example():
    """73 x 198 of C24, 1 m long, 5 kN, 2 and 1 kNm [STAAD.Pro, V. EC5: design strengths 12.92 and 14.77 N/mm2, relative
    slendernesses .298 and .809]; (6.24) by hand."""
    k = 0.5 * (1 + 0.2 * (0.809 - 0.3) + 0.809**2)
    k_c = 1 / (k + sqrt(k**2 - 0.809**2))
    area, weak, strong = 73 * 198, 198 * 73**2 / 6, 73 * 198**2 / 6
    expected = 5e3 / area / (k_c * 12.92) + 1e6 / weak / 14.77 + 0.7 * 2e6 / strong / 14.77
    found = of_timber(bar(0.198, 0.073, 1.0, N=-5e3, My=1e3, Mz=2e3))
    assert found["stability as a column"] == pytest.approx(expected, rel=2e-3)
    assert of_timber(bar(0.198, 0.073, 1.0, N=-50e3))["compression"] == pytest.approx(0.268, abs=1e-3)


def test_tension_bending_shear_and_torsion_by_hand():
    """50 x 100 of C24, k_mod .8, gamma 1.3: f_t = 8.923, f_m = 14.77, f_v = 2.462 N/mm2."""
    found = of_timber(bar(0.1, 0.05, 1.0, N=10e3, My=200, Mz=300, Vy=1e3, Vz=2e3, Mt=50.0))
    tension = 10e3 / 5000 / (14.5 * 0.8 / 1.3)
    y, z = 2e5 / (100 * 50**2 / 6) / (24 * 0.8 / 1.3), 3e5 / (50 * 100**2 / 6) / (24 * 0.8 / 1.3)
    assert found["tension"] == pytest.approx(tension)
    assert found["bending"] == pytest.approx(max(y + 0.7 * z, 0.7 * y + z))
    assert found["bending and tension"] == pytest.approx(tension + max(y + 0.7 * z, 0.7 * y + z))
    assert found["shear"] == pytest.approx(1.5 * sqrt(5) * 1e3 / (0.67 * 5000) / (4 * 0.8 / 1.3))
    stress = 50e3 / (0.246 * 100 * 50**2)  # a side ratio of 2 [Timoshenko]
    assert found["torsion"] == pytest.approx(stress / (1.1 * 4 * 0.8 / 1.3), rel=5e-3)
    assert (found["bending and compression"], found["stability as a column"]) == (0, 0)


def test_a_stocky_column_does_not_buckle():
    """(6.19) is with the square of compression; up to a relative slenderness of .3 the column is no more."""
    found = of_timber(bar(0.1, 0.1, 0.2, N=-60e3, My=500))
    expected = (60e3 / 1e4 / (21 * 0.8 / 1.3)) ** 2 + 5e5 / (1e6 / 6) / (24 * 0.8 / 1.3)
    assert found["bending and compression"] == pytest.approx(expected)
    assert found["stability as a column"] == pytest.approx(expected)


@pytest.mark.parametrize(("slenderness", "factor"), [(0.5, 1), (0.75, 0.9975), (1.0, 0.81), (2.0, 0.25)])
def test_beams_that_tilt(slenderness, factor):
    assert float(en1995.beam_factor(np.array(slenderness))) == pytest.approx(factor, abs=3e-3)


def test_a_slender_beam_tilts():
    """(6.33) with (6.31): 20 x 200 of C24, 3 m, bent over its strong axis."""
    slim = Rectangle(np.array([[0.2]]), np.array([[0.02]]))
    critical = pi / 3 * sqrt(7400e6 * 462e6 * 0.2 * 0.02**3 / 12 * slim.It.item())
    lam = sqrt(24e6 * 0.02 * 0.2**2 / 6 / critical)
    assert lam > 1.4
    M = 300.0
    stress = M / (0.02 * 0.2**2 / 6) / (24e6 * 0.8 / 1.3)
    found = of_timber(bar(0.2, 0.02, 3.0, Mz=M))
    assert found["stability as a beam"] == pytest.approx(stress * lam**2)
    pressed = of_timber(bar(0.2, 0.02, 3.0, Mz=M, N=-100.0))
    slender = 3.0 / (0.02 / sqrt(12)) / pi * sqrt(21 / 7400)
    k_c = float(en1995.column_factor(np.array(slender), TIMBER["C24"]))
    alone = 100.0 / (0.2 * 0.02) / (k_c * 21e6 * 0.8 / 1.3)
    assert pressed["stability as a beam"] == pytest.approx((stress * lam**2) ** 2 + alone)


def test_a_lath_that_is_bent_into_shape():
    """E t / 2 R: 18 mm at a radius of 8 m and E = 13.8 GPa are 15.5 N/mm2, of 48 x .6 / 1.2 always."""
    found = of_timber(bar(0.08, 0.036, 0.6, curvature=-1 / 8), "LVL 48 P", young=13.8e9, layer=0.018)
    stress = 13.8e3 * 18 / 2 / 8000
    assert found["bending into shape alone"] == pytest.approx(stress / 24)
    assert found["bending"] == pytest.approx(stress / 32)
    assert "bending into shape alone" not in of_timber(bar(0.08, 0.036, 0.6, curvature=-1 / 8), "LVL 48 P")


def test_lvl_that_is_long_or_deep_bears_less():
    one, long = (of_timber(bar(0.2, 0.05, length, N=1e4), "LVL 48 P")["tension"] for length in (3.0, 6.0))
    assert long / one == pytest.approx(2**0.075)
    flat, deep = (of_timber(bar(width, 0.05, 0.1, Mz=1e3), "LVL 48 P")["bending"] for width in (0.3, 0.6))
    assert deep / flat == pytest.approx(2**0.15 / 4)


def test_lvl_shears_more_easily_over_its_thin_side():
    upright, flat = (of_timber(bar(0.1, 0.05, 0.1, **{V: 1e3}), "LVL 48 P")["shear"] for V in ("Vy", "Vz"))
    assert upright == pytest.approx(1.5 * 1e3 / 5e-3 / (4.2e6 * 0.8 / 1.2))
    assert flat / upright == pytest.approx(4.2 / 2.3)


def test_tapered_members_buckle_with_their_width_between_joints():
    given = bar(0.1, 0.01, 1.0, N=-10e3)
    ends = replace(given, width=np.array([[0.02, 0.1, 0.1, 0.1, 0.03]]))
    same, less = of_steel(given), of_steel(ends)
    assert less["buckling in the surface"] == same["buckling in the surface"]
    assert less["compression"] == pytest.approx(5 * same["compression"])


def test_durations_and_moisture():
    assert shortest(["permanent", "short", "medium"]) == "short"
    assert get_args(Duration) == DURATIONS
    assert [k_mod(one, 2) for one in DURATIONS] == [0.6, 0.7, 0.8, 0.9, 1.1]
    assert k_mod("medium", 3) == 0.65
    wet = of_timber(bar(0.1, 0.1, 0.2, N=1e3), service_class=3, duration="permanent")
    assert wet["tension"] == pytest.approx(of_timber(bar(0.1, 0.1, 0.2, N=1e3))["tension"] * 0.8 / 0.5)


def test_grades_have_the_names_and_strengths_of_materials():
    """Design strengths of `dsfab materials` are those of tension, with k_mod .8; yield strengths of thin plates."""
    assert {*STEEL, *TIMBER} <= MATERIALS.keys()
    for name, grade in STEEL.items():
        assert MATERIALS[name].strength == grade.fy(0.01)
    for name, grade in TIMBER.items():
        design = grade.ft * 0.8 / en1995.GAMMA[grade.product]
        assert MATERIALS[name].strength == pytest.approx(design, rel=6e-3)
        assert MATERIALS[name].young > grade.E05


# --- all of it


def rules(material="S235", strength=0.0, **more) -> Rules:
    return Rules(material, 210e9, 81e9, strength, **more)


def test_the_worst_of_all_cases_decides():
    bays = bar(0.1, 0.01, 0.5, N=[-1e3, -1e3, -2e3, 0, 0])
    pulled = np.array(bays.forces["load"]) * -20
    found = utilisation(
        MemberBays(*(getattr(bays, key) for key in list(vars(bays))[:-1]), {**bays.forces, "up": pulled}), rules()
    )
    check, case, _ = found.governing(0)
    assert (check.name, case) == ("tension", "up")
    assert found.largest[0] == pytest.approx(40 / 235)
    assert found.values["up"][0].max() == found.by_member["A1"]
    assert found.station["up"][0, found.checks.index(check)] == 2
    assert found.summary.startswith(
        "largest utilisation: A1, 17% (tension, EN 1993-1-1 6.2.3 (6.5)) under up; no member"
    )
    assert found.worst_bays(10) == [0]
    assert any("stability of the whole structure" in line for line in found.unchecked)


def test_other_materials_are_compared_with_their_strength_and_no_standard():
    """N / A + M / W with 3 tau^2: 100 x 10 mm."""
    bays = bar(0.1, 0.01, 0.5, N=-10e3, Mz=200.0, Vz=1e3)
    found = utilisation(bays, rules("PLA", 20e6))
    stress = 10e3 / 1e-3 + 200 / (0.01 * 0.1**2 / 6)
    assert found.largest[0] == pytest.approx(sqrt(stress**2 + 3 * (1.5 * 1e3 / 1e-3) ** 2) / 20e6)
    assert found.standard.startswith("no standard applies: dsfab has none for PLA")
    assert "no standard applies: the preset names no material" in utilisation(bays, rules("", 20e6)).standard
    with pytest.raises(StaticsError, match="gives neither a material nor a strength"):
        utilisation(bays, rules(""))


def test_a_plate_thicker_than_the_table_gives_a_note():
    found = utilisation(bar(0.5, 0.3, 2.0, N=1e3), rules())
    assert any("table of strengths ends at 200 mm" in line for line in found.assumed)


@pytest.mark.parametrize(
    ("grade", "strength", "gamma", "k_vol"), [("GL24h", 0.5e6, 1.25, (0.01 / 0.06) ** 0.2), ("C24", 0.4e6, 1.3, 1.0)]
)
def test_a_moment_that_opens_an_arc_pulls_across_the_grain(grade, strength, gamma, k_vol):
    """By hand: k_p 6 M / (b h^2) with k_p = 0.25 h / R, R = 10 m, over 1.4 k_vol f_t90 k_mod / gamma_M; shear is added
    [EN 1995-1-1, (6.50) to (6.56)]."""
    stress = 0.25 * 0.2 / 10 * 6 * 5e3 / (0.1 * 0.2**2)
    across = stress / (1.4 * k_vol * strength) * gamma / 0.8
    for sign in (1.0, -1.0):
        opened = of_timber(bar(0.1, 0.2, 3.0, sign * 0.1, My=sign * 5e3, Vz=2e3), grade)
        assert opened["shear with tension across the grain"] == pytest.approx(across + opened["shear"])
        closed = of_timber(bar(0.1, 0.2, 3.0, sign * 0.1, My=-sign * 5e3, Vz=2e3), grade)
        assert closed["shear with tension across the grain"] == 0
    assert of_timber(bar(0.1, 0.2, 3.0, 0.0, My=5e3), grade)["shear with tension across the grain"] == 0


def test_snow_opens_the_crown_of_a_vault_and_closes_its_haunches():
    """Members across the vault sag at the crown, where their inner side is stretched."""
    coarse = {"surface.edge": 0.5, "pattern.fillet": 0.0, "statics.material": "GL24h"}
    design = Design.from_preset(load_preset("barrel_vault", coarse)).until("slicing")
    bays = design.member_utilisation.bays
    opening = np.concatenate(list(bays.forces.values()))[:, :, 4] * bays.curvature
    across = [k for k in range(len(bays.member)) if np.abs(bays.curvature[k]).mean() > 0.05]
    curves = [design.members.by_id[bays.member[k]].curve for k in across]
    height = np.array(
        [np.interp(bays.s[k], curve.s, curve.P[:, 2]).mean() for k, curve in zip(across, curves, strict=True)]
    )
    at_crown = height > 0.9 * height.max()
    assert np.sign(opening[across])[at_crown].mean() > 0.7
    assert np.sign(opening[across])[~at_crown].mean() < -0.3


def test_lvl_names_the_tension_across_the_grain_as_unchecked():
    found = utilisation(bar(0.1, 0.1, 2.0, N=1e3), rules("LVL 48 P"))
    assert any("across the grain of curved members (6.4.3) is not checked" in line for line in found.assumed)
    assert not any("6.4.3" in line for line in utilisation(bar(0.1, 0.1, 2.0, N=1e3), rules("GL24h")).assumed)


def test_presets_name_the_rules_of_their_checks():
    vault = load_preset("snow_vault", {"statics.material": "GL24h", "eurocode.duration.snow": "short"})
    found = eurocode_rules(vault, ("dead", "snow", "left", "right", "all_over", "on_the_left", "on_the_right"))
    assert [found.durations[name] for name in ("dead", "snow", "all_over", "on_the_left")] == [
        *("permanent", "short"),
        *("short", "medium"),
    ]
    assert (
        found.loads == "Members are checked in 7 load cases and combinations, with the partial factors in the preset."
    )
    assert (found.material, found.timber.layer) == ("GL24h", 0)
    nothing = {"name": "still", "factors": {"dead": 1.35, "left": 0.0}}
    still = load_preset("snow_vault", {"surface.combination": [nothing], "eurocode.bent_in": True})
    alone = eurocode_rules(still, ("still",))
    assert (alone.durations["still"], alone.timber.layer) == ("permanent", 0.05)
    bent = load_preset("gridshell", {"eurocode.bent_in": True})
    alone = eurocode_rules(bent, ("load",))
    assert alone.timber.layer == bent.workshop.thickness
    assert (alone.loads.split(",")[0], alone.combined) == ("Loads have no partial factors", False)
    with pytest.raises(PresetError, match=r"eurocode.duration.snwo: no load has this case \(there are: dead, snow"):
        load_preset("snow_vault", {"eurocode.duration.snwo": "short"})
    with pytest.raises(PresetError, match=r"eurocode\.service_class"):
        load_preset("snow_vault", {"eurocode.service_class": 4})
