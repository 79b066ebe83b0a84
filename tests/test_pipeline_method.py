"""`[pattern] method = "auto"`: what is tried is told, the stiffest is taken, and it is made again without a search."""

import re

import numpy as np
import pytest

import dsfab
from dsfab.design import settled
from tests.presets import DOME_MODES

SMALL = {"surface.edge": 0.8, "pattern.major.spacing": 1.6, "pattern.minor.spacing": 1.6}


@pytest.fixture(scope="module")
def chosen():
    return dsfab.run(dsfab.load_preset(DOME_MODES, {**SMALL, "pattern.method": "auto"}))


def test_the_stiffest_is_taken_and_all_are_told(chosen):
    note = next(note.text for note in chosen.notes if note.text.startswith("method auto took"))
    taken = re.match(r"method auto took (.*?): of", note).group(1)
    tried = dict(re.findall(r"(?:^|[,;] )((?:halved stripes|stripes|modes), (?:constant|graded)) ([\d.]+) x", note))
    assert all(f"{way}, {rule} " in note for way in ("; stripes", "modes") for rule in ("constant", "graded"))
    assert float(tried[taken]) == min(map(float, tried.values()))


def test_the_settled_preset_makes_the_same_sheet(chosen):
    asked = settled(chosen.preset, chosen.pattern)
    assert asked == chosen.settled
    assert asked.pattern.method in ("stripes", "modes")
    again = dsfab.run(asked)
    assert np.array_equal(again.sheet.surface.V, chosen.sheet.surface.V)
    assert np.array_equal(again.sheet.surface.F, chosen.sheet.surface.F)
    assert settled(again.preset, again.pattern) is again.preset


def test_a_plain_width_is_not_exchanged():
    made = dsfab.pipeline.draft(
        dsfab.load_preset(DOME_MODES, {**SMALL, "pattern.method": "auto", "pattern.width": {"rule": "plain"}})
    )
    note = next(note.text for note in made.notes if note.text.startswith("method auto took"))
    assert note.count(", plain") >= 3
    assert "graded" not in note
