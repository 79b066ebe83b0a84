"""How near to the optimum shipped presets are: their compliance over that of the full plate, and what was aimed at.

Each is one solve on the mesh as cut, by the elements of `compliance_once`. Targets were set, and finer meshes measured,
with quadratic + midedge, by which slender cut parts are stiffer by 1 %: edges of 0.02, 0.014 and 0.01 m: cantilever
1.799, 1.798, 1.801; cantilever_light 3.203, 3.203, 3.186. Topology optimisation (SIMP, 60 steps, its
level line cut at the same area and solved alike) reaches 1.58 and 2.53 on these two.
"""

import pytest

import dsfab
from dsfab.study.comparison import comparison
from dsfab.study.judges import solved_loads
from tests.designs import sliced
from tests.presets import SPHERE_GRADED_MODES


def over_full(design) -> float:
    compared = comparison(design, against=())
    return compared.design.compliance / compared.full.compliance


@pytest.mark.parametrize(
    ("name", "share", "target", "recorded"),
    [
        ("cantilever", 0.5, 1.85, 1.80),
        pytest.param("cantilever_light", 0.3, 3.4, 3.20, marks=pytest.mark.slow),
        pytest.param(SPHERE_GRADED_MODES, 0.5, 2.8, 1.713, marks=pytest.mark.slow, id="sphere_graded_modes"),
    ],
)
def test_presets_reach_their_targets(name, share, target, recorded):
    design = sliced(dsfab.load_preset(name))
    assert design.sheet.surface.area / design.surface.area == pytest.approx(share, abs=1e-3)
    assert len(design.slicing.pieces) == 1
    ratio = over_full(design)
    assert ratio <= target
    assert ratio == pytest.approx(recorded, rel=0.01)


@pytest.mark.slow
def test_the_graded_sphere_reaches_its_target_by_the_best_elements():
    """Its cut leaves a needle of 7 micrometres on which hhj is solved to 1e-8 or 3e-8, by the number of threads."""
    compared = comparison(sliced(dsfab.load_preset("sphere_graded")), against=())
    ratio = compared.design.compliance / compared.full.compliance
    assert compared.design.structure.sheet.surface.area / compared.task.surface.area == pytest.approx(0.5, abs=1e-3)
    (found,) = solved_loads(compared.task, compared.design.structure).values()
    assert str(found.equilibrium.elements) == "hybrid+hhj"
    assert found.equilibrium.residual < 1e-7
    assert ratio <= 1.5
    assert ratio == pytest.approx(1.366, rel=0.01)


@pytest.mark.slow
def test_method_auto_keeps_the_target_without_phases_by_hand():
    """The phases that were found by hand, and the 120 runs of cantilever_light, with evened widths: 3.20.

    On a third of the preset's triangles; on its own mesh 3.129. Of half of the material it is 1.672 and 1.680: that the
    best is taken there, too, the bracket of design/test_method.py tells.

    Slits between tidied modes are filled, as between evenly spaced stripes: with 11 of them left, stripes that are 5 %
    softer were taken, 1.758. Only phases are searched for: stripes win here, and the next test finds the modes too.
    """
    share = 0.3
    keys = {f"pattern.{family}.phase": "auto" for family in ("major", "minor")}
    widths = {"pattern.width.rule": "stressed", "pattern.width.solid_fraction": share}
    design = dsfab.run(
        dsfab.load_preset("cantilever", {**keys, **widths, "pattern.method": "auto", "surface.edge": 0.035})
    )
    assert design.sheet.surface.area / design.surface.area == pytest.approx(share, abs=1e-3)
    ratio = over_full(design)
    assert ratio <= 3.2
    assert ratio == pytest.approx(3.187, rel=0.01)


@pytest.mark.slow
def test_auto_reaches_the_target_of_the_cantilever_too():
    """On a coarser mesh than the preset's: 1.795 there, 1.804 where edges are 0.025 m, 1.828 on its own; 55 tried."""
    auto = {f"pattern.{family}.{key}": "auto" for family in ("major", "minor") for key in ("mode", "phase")}
    design = dsfab.run(dsfab.load_preset("cantilever", {**auto, "surface.edge": 0.035}))
    assert design.pattern.choice is not None
    assert design.pattern.mode == (1, 1)
    assert len(design.pattern.choice.candidates) > 32
    assert over_full(design) <= 1.85
