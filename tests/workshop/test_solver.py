"""A solver that empties sheets: our own measure of what it says against shapely's, and that nothing gets worse."""

import importlib.util
import json
import subprocess

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Polygon

from dsfab.core.errors import PatternError
from dsfab.design import Design
from dsfab.export import ProgramError
from dsfab.preset.file import load_preset
from dsfab.workshop import workshop_plan
from dsfab.workshop.nesting import NestedPart, NestedSheet, nest_parts, with_fewer_sheets
from dsfab.workshop.nesting import sheets as emptying
from dsfab.workshop.nesting.sheets import least_clearance, polygon_distance
from tests.workshop.drawn_parts import bowed, least_gap

GAP, SIZE = 0.008, (2.5, 1.25)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(st.floats(0.2, 2), st.floats(0.04, 0.3), st.floats(-2, 2)),
    st.tuples(st.floats(0.2, 2), st.floats(0.04, 0.3), st.floats(-2, 2)),
    st.tuples(st.floats(-1, 1), st.floats(-0.6, 0.6), st.floats(0, 6)),
)
def test_distances_of_parts_are_those_of_shapely(one, two, place):
    P = bowed("one", *one).outline
    Q = bowed("two", *two).moved_by(place[2], np.array(place[:2])).outline
    assert polygon_distance(P, Q) == pytest.approx(Polygon(P).distance(Polygon(Q)), abs=1e-9)
    assert polygon_distance(Q, P) == polygon_distance(P, Q)


def test_a_part_within_another_or_beyond_the_edge_is_not_clear():
    box = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert polygon_distance(box, 0.2 * box + 0.4) == polygon_distance(0.2 * box + 0.4, box) == 0
    assert least_clearance([0.5 * box + 0.1], (2.0, 1.0), GAP) == pytest.approx(0.1)
    assert least_clearance([box - 0.1], (2.0, 1.0), GAP) == pytest.approx(-0.1)


def two_sheets():
    parts = [bowed(name, 1.0, 0.1, 0.0) for name in ("one", "two")]
    return [NestedSheet(SIZE, (NestedPart(part, 0.0, (0.6, 0.1)),)) for part in parts]


def test_a_valid_nest_of_the_solver_is_taken(monkeypatch):
    def says(program, path, seconds):
        with open(path, encoding="utf-8") as file:
            job = json.load(file)
        assert (job["length"], job["height"]) == SIZE
        assert [turns for _, turns in job["items"]] == [[0.0, 90.0, 180.0, 270.0]] * 2
        return json.dumps([[0, 0.0, 0.6, 0.1], [1, -180.0, 0.6, 0.3]])

    monkeypatch.setattr(emptying, "last_line", says)
    (sheet,) = with_fewer_sheets(two_sheets(), GAP)
    assert [round(one.turn, 9) for one in sheet.parts] == [0, round(np.pi, 9)]
    assert least_gap([sheet]) == pytest.approx(0.05)


@pytest.mark.parametrize(
    "said",
    [
        "[[0, 0.0, 0.6, 0.1], [1, 0.0, 0.6, 0.207]]",  # a millimetre less than the gap
        "[[0, 0.0, 0.6, 0.1], [1, 0.0, 0.6, 1.2]]",  # nearer to the edge than the gap
        "[[0, 0.0, 0.6, 0.1]]",
        "[[0, 0.0, 0.6, 0.1], [7, 0.0, 0.6, 0.5]]",
        "null",
        "no JSON",
        ProgramError("it crashed"),
        subprocess.TimeoutExpired("spyrrow", 20),
    ],
)
def test_an_invalid_or_missing_nest_leaves_the_sheets_unchanged(said, monkeypatch):
    def says(program, path, seconds):
        if isinstance(said, Exception):
            raise said
        return said

    monkeypatch.setattr(emptying, "last_line", says)
    before = two_sheets()
    assert with_fewer_sheets(before, GAP) == before


def test_without_spyrrow_the_error_names_the_package_to_install(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    design = Design.from_preset(load_preset("cantilever", {"workshop.nesting": "spyrrow"}))
    with pytest.raises(
        PatternError, match=r"needs the library spyrrow; install it with: pip install .dsfab\[nesting\]"
    ):
        workshop_plan(design)  # before anything is solved


@pytest.mark.slow
def test_spyrrow_empties_a_sheet_keeps_the_gap_and_says_the_same_twice():
    pytest.importorskip("spyrrow")
    parts = [bowed(f"P{k}", 2.2, 0.12, 0.3) for k in range(4)] + [bowed(f"Q{k}", 0.4, 0.1, 0.0) for k in range(8)]
    sheets = [sheet for some in (parts[:-3], parts[-3:]) for sheet in nest_parts(some, [SIZE], GAP)]
    once, again = (with_fewer_sheets(sheets, GAP, grain=True) for _ in range(2))
    assert (len(sheets), len(once)) == (2, 1)
    assert sorted(one.part.id for one in once[0].parts) == sorted(part.id for part in parts)
    assert least_gap(once) >= GAP - 1e-9
    assert {round(one.turn, 6) for one in once[0].parts} <= {0.0, round(np.pi, 6)}
    places = [[(one.part.id, one.turn, one.shift) for sheet in some for one in sheet.parts] for some in (once, again)]
    assert places[0] == places[1]
