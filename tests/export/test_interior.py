"""STEP by members: points inside of regions near which trimmed faces are, and a second try with more of them."""

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from dsfab.core.errors import ExportError
from dsfab.export.cad.step.by_members import build
from dsfab.export.cad.step.by_members.build import NotByMembersError
from dsfab.export.cad.step.by_members.regions import INNER, MORE, RegionInterior
from dsfab.export.cad.step.shared.lifting import Lifting
from dsfab.export.cad.step.shared.plan import SolidPlan
from tests.export.member_networks import cylinder_strip, draft_of, striped


def test_long_cells_have_more_points_where_faces_are_to_be_fine():
    given = cylinder_strip()
    part, _, _ = draft_of(given, striped(given))
    plan = SolidPlan(part)
    sheet = plan.curved.striped()
    few = RegionInterior(sheet, Lifting.from_sheet(plan.surface, plan.curved), 1.0)
    around = np.unique(sheet.F)[[0, -1]]
    chains = {0: SimpleNamespace(points=around), 1: SimpleNamespace(points=around[:1])}
    net = SimpleNamespace(
        weights=sheet.weights,
        cell=np.arange(len(sheet.F)) % 3,
        parent={7: 1},
        chains=chains,
        loops={2: [[(0, True)], [(1, True)]], 0: [[(0, True), (0, False)]], 7: [[(0, True)]]},
    )
    regions = [2, 0, 7]
    cells = [int((net.cell == net.parent.get(k, k)).sum()) for k in regions]
    for interior, each in ((few, INNER), (replace(few, fine=True), INNER + MORE)):
        found = interior.points(net, regions)
        assert list(found) == regions
        assert [len(found[k]) for k in regions] == [len(each) * count for count in cells]
        for k in regions:
            np.testing.assert_array_equal(found[k], interior.points(net, [k])[k], "each has its own")
    thick = replace(few, fine=True, thickness=1e9).points(net, regions)
    P = np.asarray(sheet.weights @ few.lifting.skins.points)
    sides = np.linalg.norm(P[sheet.F] - P[np.roll(sheet.F, 1, axis=1)], axis=2).max(axis=1)
    assert sides.max() < np.linalg.norm(P[around[0]] - P[around[1]]) / 6
    assert [len(some) for some in thick.values()] == [len(INNER) * count for count in cells]
    net.loops[0] = [[(1, True)]]
    small = replace(few, fine=True, thickness=1e9).points(net, regions)
    assert len(small[0]) == len(INNER + MORE) * cells[1], "of a small region every cell is long"
    np.testing.assert_array_equal(small[2], thick[2])
    assert few.points(net, []) == {}


def test_weights_are_inside_of_a_cell_and_different():
    weights = np.array(INNER + MORE)
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    assert weights.min() > 0
    assert len(np.unique(weights.round(6), axis=0)) == len(weights)


def test_a_file_that_is_too_far_off_is_tried_once_more_with_finer_faces(monkeypatch):
    given = cylinder_strip()
    part, _, _ = draft_of(given, striped(given))
    tried, volume = [], ExportError("the volume of the curved solid along members differs by 2.1%")
    complaints = iter(
        [build.RoughError("the solid of curved patches along members is 7.5 mm from the mesh"), volume, volume]
    )

    def drafted(part, plan, fine):
        tried.append(fine)
        raise next(complaints)

    monkeypatch.setattr(build, "occt", nullcontext)
    monkeypatch.setattr(build, "member_draft", drafted)
    for asked in ([False, True], [False, True, False]):  # not for other reasons
        with pytest.raises(NotByMembersError, match="volume"):
            build.member_file(replace(part))
        assert tried == asked
