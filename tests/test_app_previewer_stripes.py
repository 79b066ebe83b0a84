"""Evenly spaced stripes as they are drawn: what is seen is what is cut, and light shows no seam of the chart."""

import numpy as np
import pytest

from dsfab.app.light import QUICK
from dsfab.app.panels import shows
from dsfab.app.previewer import Previewer
from dsfab.app.scene import shading
from dsfab.app.striping import StripedMesh, only_numbers
from dsfab.design import Draft
from dsfab.errors import DsfabError
from dsfab.pattern import distance_to_boundary
from dsfab.pipeline import draft, run
from dsfab.preset_file import load_preset, overridden
from tests.test_app_previewer import SIZE, difference, exact

EVEN = {"pattern.method": "stripes", "pattern.major.frequency": 0, "pattern.minor.frequency": 0}
DOME = {**EVEN, "surface.edge": 0.5, "pattern.major.spacing": 1.1, "pattern.minor.spacing": 0.55}
MOST = 2e-3
"""Share of the silhouette's pixels that may differ."""


@pytest.fixture(scope="module")
def dome() -> Draft:
    return draft(load_preset("dome", DOME))


@pytest.fixture(scope="module")
def globe() -> Draft:
    both = {"pattern.major.spacing": 0.2, "pattern.minor.spacing": 0.2}
    return draft(load_preset("globe", {**EVEN, **both}))


RULES = {
    "plain": {"pattern.width": {}},
    "constant": {"pattern.width": {"rule": "constant", "member": 0.2}},
    "graded": {"pattern.width": {"rule": "graded", "q": 1.0}},
    "rim and bounds": {"pattern.rim": 0.6, "pattern.width": {"min_width": 0.25}},
    "share": {"pattern.width": {"rule": "constant", "solid_fraction": 0.45}},
    "not halved": {"pattern.halve": False},
}


@pytest.mark.parametrize("rule", RULES)
def test_the_shader_draws_what_the_exact_cut_leaves(dome: Draft, rule: str) -> None:
    made = draft(overridden(dome.preset, RULES[rule]), old=dome)
    assert made.pattern.even
    assert len(set(made.pattern.even.chart.scale.ravel())) > 2 or rule == "not halved"  # some are halved
    with Previewer(made, marks=False) as previewer:
        d=difference(made, previewer); print(rule, d)
        assert d < MOST
        assert previewer.mask(SIZE).sum() < 0.98 * exact(previewer, made.surface).sum()


def test_a_closed_surface_agrees_too(globe: Draft) -> None:
    with Previewer(globe, marks=False, view="20,30") as previewer:
        d=difference(globe, previewer); print(d)
        assert d < MOST
