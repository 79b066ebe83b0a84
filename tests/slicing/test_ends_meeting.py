"""Stripes that end at a face without a phase: on a plate of three rows of squares, where areas are known."""

import numpy as np
import pytest

from dsfab.slicing import Tidy, cut, tidied_sheet
from dsfab.slicing.cutting.polygon_mesh import PolygonMesh
from dsfab.slicing.cutting.sheet import VOID
from dsfab.surface import Surface
from dsfab.surface.fields import CornerField
from dsfab.surface.topology import manifold_faults
from tests.shapes import grid


@pytest.fixture(scope="module")
def panel() -> Surface:
    return grid(5, 3, 5.0, 3.0)


def stripe(plate: Surface, half: float, blank: np.ndarray) -> CornerField:
    """One along y = 1.5 but for blank faces (m,)."""
    y, d = plate.V[:, 1] - 1.5, np.full(plate.n, half)
    return CornerField(np.stack([y + d, y - d], axis=1), np.ones((plate.m, 3)), np.zeros((plate.m, 3)), blank)


def post(plate: Surface) -> np.ndarray:
    """One across it at x = 1, .2 wide."""
    x, d = plate.V[:, 0] - 1.0, np.full(plate.n, 0.1)
    return np.stack([x + d, x - d], axis=1)


def between(plate: Surface, low: float, high: float) -> np.ndarray:
    """(m,) the faces of the middle row between two places."""
    x, y, _ = plate.centroids.T
    return np.asarray((np.abs(y - 1.5) < 0.5) & (x > low) & (x < high))


def sheet_of_stripe(plate: Surface, blank: np.ndarray, half: float = 0.2):
    fields = [stripe(plate, half, blank), post(plate)]
    tidy = Tidy((True, True), (None, None), np.zeros(plate.n, dtype=bool))
    sheet = tidied_sheet(plate, fields, [[0.0], [0.0]], 0, tidy)
    assert sheet.surface.area == pytest.approx(plate.area)
    assert (np.diff(sheet.parent) >= 0).all()
    assert not manifold_faults(sheet.surface.F, sheet.surface.edges, sheet.surface.n)
    return sheet


def material(sheet) -> float:
    return float(sheet.surface.areas[sheet.material].sum())


@pytest.mark.parametrize("half", [0.05, 0.2, 0.45])
@pytest.mark.parametrize("faces", [(2.5, 3.0), (2.0, 2.5)])
def test_a_stripe_crosses_a_face_without_phase_at_its_full_width(panel, faces, half):
    """The straight lines between its two ends are its own edges: no corner of the face stays, none is missing."""
    blank = between(panel, *faces)
    assert blank.sum() == 1
    kept = material(sheet_of_stripe(panel, blank, half))
    assert kept == pytest.approx(5 * 2 * half + 0.2 * (3 - 2 * half), abs=1e-9)
    without = cut(panel, [stripe(panel, half, blank), post(panel)], [[0.0], [0.0]], 0)
    assert abs(material(without) - kept) > 1e-3  # a gap, or a node with corners


def test_one_end_alone_is_taken_off_to_the_last_crossing(panel):
    """The stripe goes no further than the blank faces, and comes out of them nowhere."""
    kept = material(sheet_of_stripe(panel, between(panel, 2.0, 5.0)))
    assert kept == pytest.approx(0.2 * 3 + 0.4 * 0.9, abs=1e-9)


def test_a_large_part_without_a_field_is_not_filled(panel):
    """Both its ends are at one gap, which is larger than what meets at a vertex."""
    blank = (panel.centroids[:, 0] > 2.0) & (panel.centroids[:, 0] < 4.0)
    sheet = sheet_of_stripe(panel, blank)
    assert not sheet.material[blank[sheet.parent]].any()


def test_a_node_is_a_joint_as_a_crossing_is(panel):
    """Its arms are parts of their own: one that leads nowhere goes, and the others stay."""
    blank = between(panel, 2.5, 3.0)
    mesh = PolygonMesh.from_surface(panel).with_material(3, panel.centroids[:, 1] > 1, blank)
    assert (mesh.also == np.where(blank, 3, VOID)).all()
    assert (mesh.with_material(4, np.ones(panel.m, dtype=bool), blank).also[blank] == 3).all()


@pytest.mark.parametrize("turned", [(), (0,), (1,), (0, 1)])
def test_a_stripe_end_at_a_corner_is_counted_once(turned):
    """A stripe along x - y = 1 enters a blank face at its corner (2, 1) and leaves it across the side that is opposite:
    two ends, though the faces below and to the left both see the first one at the corner."""
    plate = grid(5, 3, 5.0, 3.0)
    x, y, _ = plate.centroids.T
    blank, below, left = (np.hypot(x - a, y - b) < 1e-6 for a, b in ((7 / 3, 4 / 3), (7 / 3, 2 / 3), (5 / 3, 4 / 3)))
    assert blank.sum() == below.sum() == left.sum() == 1
    sign = np.ones((plate.m, 3))
    for k in turned:
        sign[(below, left)[k]] = -1
    z, d = plate.V[:, 0] - plate.V[:, 1] - 1, np.full(plate.n, 0.2)
    field = CornerField(np.stack([z + d, z - d], axis=1), sign, np.zeros((plate.m, 3)), blank)
    tidy = Tidy((True,), (None,), np.ones(plate.n, dtype=bool))
    cells = tidied_sheet(plate, [field], [[0.0]], 0, tidy)
    assert cells.material[blank[cells.parent]].any()
