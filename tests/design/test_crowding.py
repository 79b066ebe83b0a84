"""`[pattern] crowding = "avoid"`: other patterns are tried where openings would be filled side by side."""

from types import SimpleNamespace

import numpy as np
import pytest

import dsfab
from dsfab.design import draft, method_search, slicing_and_thickening
from dsfab.design.method_search import uncrowded_changes
from dsfab.design.pattern_measures import merged_members
from dsfab.design.slicing_and_thickening import filled_plate
from dsfab.pattern import FamilyRole
from dsfab.preset.model import Pattern
from dsfab.results import Attempt, FilledOpenings, PatternResult
from tests.shapes import annulus, square

ONE = Pattern(method="stripes", families="minor", minor={"spacing": 0.1})
LOOP = Pattern(method="stripes", families="minor", minor={"spacing": 0.3})
ANCHOR = np.array([0.0, 0.0, 0.0])


def touching(surface, where):
    """Members that touch at marked vertices."""
    d = np.where(where, 0.5, 0.2)
    return PatternResult(("minor",), (np.zeros(surface.n),), (np.zeros(0),), (d,))


def test_a_plate_of_members_is_measured_in_openings():
    surface = square(40)
    left = np.abs(surface.V - [-0.5, 0, 0]).max(axis=1) < 0.21
    right = np.abs(surface.V - [0.5, 0, 0]).max(axis=1) < 0.11
    plate = merged_members(ONE, surface, touching(surface, left | right))
    assert plate.openings == 16
    assert plate.place == pytest.approx([-0.5, 0, 0], abs=1e-9)
    assert merged_members(ONE, surface, touching(surface, np.zeros(surface.n, bool))) is None
    assert merged_members(ONE.model_copy(update={"families": "both"}), surface, touching(surface, left)) is None


def test_members_may_touch_in_kept_material():
    surface = square(40)
    centre = np.abs(surface.V).max(axis=1) < 0.21
    d, far = np.where(centre, 0.5, 0.2), np.full(surface.n, np.inf)
    kept_field = 0.3 - np.abs(surface.V).max(axis=1)
    fields, levels = (np.zeros(surface.n), kept_field), (np.zeros(0), np.zeros(1))
    assert merged_members(ONE, surface, PatternResult(("minor", "keep"), fields, levels, (d, far))) is None


def test_a_ring_around_a_column_head_is_no_plate(monkeypatch):
    surface = annulus(48, 36, inner=0.2, outer=2.0)
    monkeypatch.setattr(slicing_and_thickening, "largest_filling", lambda *_: None)
    radius = np.linalg.norm(surface.V, axis=1)
    ring, disc = radius < 1.0, np.linalg.norm(surface.V - [1.0, 0, 0], axis=1) < 0.7
    load = SimpleNamespace(supported=np.isclose(radius, 0.2))
    assert filled_plate(LOOP, surface, load, touching(surface, ring), (None, None)) is None
    assert filled_plate(LOOP, surface, load, touching(surface, disc), (None, None)).openings > 5
    free = SimpleNamespace(supported=np.zeros(surface.n, bool))
    assert filled_plate(LOOP, surface, free, touching(surface, ring), (None, None)).openings > 5


def changes(monkeypatch, place, **options):
    surface = square(4)
    supported = np.isclose(surface.V, ANCHOR).all(axis=1)
    load = SimpleNamespace(supported=supported, loaded=np.zeros(surface.n, bool))
    family = {"spacing": 0.4}
    pattern = Pattern(**{"method": "stripes", "major": family, "minor": family, "keep": 0.1, "rim": 0.1, **options})
    roles = FamilyRole("major", "hoops", 0.0), FamilyRole("minor", "arches", 0.0)
    monkeypatch.setattr(method_search, "roles_of_families", lambda design: roles)
    design = SimpleNamespace(
        preset=SimpleNamespace(pattern=pattern), surface=surface, statics=SimpleNamespace(load=load)
    )
    return list(uncrowded_changes(design, FilledOpenings(5, np.array(place))))


def test_up_to_four_changes_are_tried(monkeypatch):
    near = changes(monkeypatch, [0.5, 0, 0])
    assert near == [
        {"keep": 1.0},  # 0.5 + 0.4 sqrt(5 / pi)
        {"major.spacing": 0.5, "minor.spacing": 0.5},
        {"families": "minor"},
        {"rotate": 45.0},
    ]
    assert changes(monkeypatch, [1.05, 0, 0]) == near[1:]
    assert changes(monkeypatch, [1.05, 0, 0], rim=0.0) == [near[1], near[3]]
    assert changes(monkeypatch, [1.05, 0, 0], rotate=30.0) == near[1:3]
    assert changes(monkeypatch, [1.05, 0, 0], families="minor") == [
        {"minor.spacing": 0.5},
        {"families": "both"},
        {"rotate": 45.0},
    ]


def test_a_plate_is_worse_than_slits_and_better_than_dead_ends():
    slit, plate, dead = Attempt("", 3, 3, 0.5, 0, 9), Attempt("", 2, 2, 0.5, plate=5), Attempt("", 1, 1, 0.5, 1)
    assert sorted((plate, dead, slit), key=lambda one: one.rank) == [slit, plate, dead]


@pytest.mark.slow
def test_meridians_that_merge_at_the_crown_get_rings():
    """Meridians alone form a plate of nine openings at the crown of a dome; with rings, some of them end earlier."""
    alone = {"surface.edge": 0.8, "pattern.keep": 0.1, "pattern.families": "minor", "pattern.minor.spacing": 0.8}
    preset = dsfab.load_preset("dome", alone)
    crowded = draft(preset)
    assert merged_members(preset.pattern, crowded.surface, crowded.pattern).openings == 9
    made = draft(dsfab.load_preset("dome", {**alone, "pattern.crowding": "avoid"}))
    (note,) = (note.text for note in made.notes if "form a plate" in note.text)
    assert note.startswith("9 filled openings lie side by side around (0, 0, 3.92) m")
    assert "dsfab took pattern.families = 'both' instead" in note
    assert sum(note.text.startswith("members are") for note in made.notes) == 1
    taken = made.resolved_preset
    assert (taken.pattern.families, taken.pattern.crowding) == ("both", "note")
    again = draft(taken)
    assert all(np.array_equal(a, b) for a, b in zip(made.pattern.half_widths, again.pattern.half_widths, strict=True))
