"""The passes of finishing: their order, their counts, and results that a sheet works out once."""

import numpy as np
import pytest

from dsfab.slicing import cut, filled_slits, openings_of
from dsfab.slicing.finishing.finish import FinishingOptions, finish, passes
from dsfab.slicing.finishing.flat_openings import flat_openings_of
from tests.shapes import square

PLAIN = FinishingOptions(0.05, "join", 0.06, sized=False, opening=0.0, merge="none", neck=0.0, fillet=0.0)
ALL = FinishingOptions(
    0.05,
    "join",
    0.06,
    sized=False,
    opening=0.06,
    merge="slits",
    neck=0.07,
    fillet=0.03,
    least=(0.02, 0.03),
    tolerance=0,
)


def grid_sheet():
    """A plate with openings between two families of members."""
    surface = square()
    x, y, _ = surface.V.T
    fields = [np.stack([z + 0.2, z - 0.2], axis=1) for z in (y / 0.5 + 0.5, x / 0.25 + 0.5)]
    return surface, cut(surface, fields, [np.arange(-6.0, 8.0)] * 2, 0)


def test_passes_run_in_their_order():
    before_rounding = ["pinches", "merged", "filled", "filled", "bridged", "merged", "spikes"]
    names = [name for name, _ in passes(square(), ALL)]
    assert names == [*before_rounding, "rounded", "widths", "improved"]
    assert [name for name, _ in passes(square(), PLAIN)] == ["pinches"]
    sized = ALL._replace(sized=True, fillet=0.0, least=(0.0, 0.0), tolerance=None)
    assert [name for name, _ in passes(square(), sized)][:3] == ["pinches", "filled", "merged"]


def test_finishing_adds_material_and_counts_what_it_changed():
    surface, cells = grid_sheet()
    finished = finish(cells, surface, ALL._replace(tolerance=None))
    assert len(finished.radii) > 100
    assert finished.cells.material_area > cells.surface.areas[cells.material].sum()
    assert finished.unwidened is not None
    assert finish(cells, surface, PLAIN).cells is cells
    improved = finish(cells, surface, PLAIN._replace(tolerance=0.02))
    assert improved.counts["flips"] + improved.counts["collapses"] > 0
    assert "smallest angle" in improved.shape
    assert improved.cells.material_area == pytest.approx(cells.surface.areas[cells.material].sum(), rel=0.02)


def test_a_sheet_works_out_its_openings_and_walls_once():
    _, cells = grid_sheet()
    assert openings_of(cells) is openings_of(cells)
    assert flat_openings_of(cells) is flat_openings_of(cells)
    assert cells.walls is cells.walls
    filled, count = filled_slits(cells)
    assert count == 0
    assert filled is cells
