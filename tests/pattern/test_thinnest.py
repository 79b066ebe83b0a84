"""Evenly spaced members of graded width are as wide as the sheet is thick, unless it is said otherwise."""

import numpy as np
import pytest

from dsfab import load_preset
from dsfab.core.errors import PresetError
from dsfab.design import draft
from dsfab.preset.model import Width
from tests.presets import DOME_MODES

pytestmark = pytest.mark.slow

COARSE = {"surface.edge": 0.5, "pattern.major.spacing": 1.6, "pattern.minor.spacing": 1.1}
GRADED = {**COARSE, "pattern.width.rule": "graded"}


def narrowest(made) -> float:
    """Metres: the width of the stripes that are drawn everywhere, at the vertex where it is least."""
    pattern = made.pattern
    found = []
    for name, half in zip(pattern.names, pattern.half_widths, strict=True):
        if half is not None and name in ("major", "minor"):
            slope = pattern.even.slope[:, ("major", "minor").index(name)]
            found.append(float((2 * half / slope).min()))
            if len(found) == 2:
                break
    return min(found)


@pytest.fixture(scope="module")
def free():
    return draft(load_preset("dome", {**GRADED, "pattern.width.min_width": 0}))


def test_members_are_no_thinner_than_the_sheet(free):
    assert narrowest(free) < 0.02  # a hairline of a third of the thickness
    made = draft(load_preset("dome", GRADED), earlier=free)
    assert narrowest(made) == pytest.approx(made.preset.statics.thickness, rel=1e-9)
    assert made.pattern.half_widths[0] is not None


def test_a_width_that_is_said_counts(free):
    for said in (0.03, 0.07):
        made = draft(load_preset("dome", {**GRADED, "pattern.width.min_width": said}), earlier=free)
        assert narrowest(made) == pytest.approx(said, rel=1e-9)


@pytest.mark.slow
def test_thick_sheets_and_narrow_bounds_leave_a_pattern():
    """Half of what equally wide members would be, or the widest that is allowed."""
    thick = {**GRADED, "statics.thickness": 0.5}
    half = 0.5 * 0.4 / (1 / 1.6 + 1 / 1.1)
    bounded = {**GRADED, "pattern.width.max_width": 0.04, "pattern.width.solid_fraction": 0.0}
    for changes, least in ((thick, half), (bounded, 0.04)):
        by_itself, said = (
            draft(load_preset("dome", {**changes, "pattern.width.min_width": one})).pattern for one in ("auto", least)
        )
        assert all(np.array_equal(a, b) for a, b in zip(by_itself.half_widths, said.half_widths, strict=True))


def test_other_rules_and_modes_have_no_limit(free):
    """The paper's stripes are as they were; `auto` and 0 are the same there."""
    for name, changes in (("dome", {**COARSE, "pattern.width": {"rule": "constant", "solid_fraction": 0.4}}),
                          (DOME_MODES, {"surface.edge": 0.5, "pattern.width.rule": "graded"})):  # fmt: skip
        one, two = (draft(load_preset(name, {**changes, "pattern.width.min_width": least})) for least in ("auto", 0))
        assert all(np.array_equal(a, b) for a, b in zip(one.pattern.half_widths, two.pattern.half_widths, strict=True))


def test_min_width_is_a_length_or_auto():
    assert Width().asked_least == 0
    assert Width(min_width=0.2).asked_least == 0.2
    assert Width(rule="graded").widths(1.0, 0.3).min_width == 0.3
    assert Width(rule="graded", min_width=0).widths(1.0, 0.3).min_width == 0
    with pytest.raises(PresetError, match="min_width = 'thin': should be 'auto' or a number"):
        Width(min_width="thin")
