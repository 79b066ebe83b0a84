"""What halves of a cut miss of the whole, on boxes whose faces do not reach their edges."""

import numpy as np
import pytest

from dsfab.core.errors import ExportError
from dsfab.export.cad.step import soundness
from dsfab.export.cad.step.by_members import build
from dsfab.export.cad.step.worker.shapes import compound, gauss_kronrod_volume
from dsfab.export.cad.step.worker.use import (
    ALONE_LIMIT,
    INVALID,
    TOGETHER_LIMIT,
    VolumeErrors,
    thickness_edges,
    volume_errors,
)

SIDE = 100.0


def square_face(at: np.ndarray, axis: int, share: float, outwards: bool):
    """A square face around a point, normal to an axis, with so much less area than one of `LEAST_SIDE`."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.gp import gp_Ax3, gp_Dir, gp_Pln, gp_Pnt

    half, normal = SIDE / 2 * np.sqrt(1 - share), np.eye(3)[axis] * (1 if outwards else -1)
    plane = gp_Pln(gp_Ax3(gp_Pnt(*at), gp_Dir(*normal), gp_Dir(*np.eye(3)[axis - 1])))
    return BRepBuilderAPI_MakeFace(plane, -half, half, -half, half).Face()


def halves(section: float, skin: float = 0.0):
    """Two cubes beside each other: each face between them lacks a share of its area, and so does one of a skin."""
    return [
        compound(
            [
                square_face(middle + way * SIDE / 2 * np.eye(3)[axis], axis, less(axis, way, middle[0]), way > 0)
                for axis in range(3)
                for way in (-1, 1)
            ]
        )
        for middle in (np.array([-SIDE / 2, 0, 0]), np.array([SIDE / 2, 0, 0]))
        for less in [
            lambda axis, way, x: section if axis == 0 and way * x < 0 else skin * (axis == 1 and way > 0 and x > 0)
        ]
    ]


@pytest.mark.parametrize(
    ("section", "skin", "sound"), [(0.0, 0.0, True), (2e-4, 0.0, True), (1e-3, 0.0, False), (0.0, 1e-3, False)]
)
def test_sections_may_have_gaps_and_skins_may_not(section, skin, sound):
    """Around each cube's own middle a section's missing area counts with half a side for a height, over the volume of
    both; around one point it does not count at all."""
    whole = 2 * SIDE**3
    missed = volume_errors(halves(section, skin), whole)
    assert missed.alone == pytest.approx(section / 6 + skin / 12, rel=1e-3, abs=1e-12)
    assert (missed.fault == 0) == sound
    if 0 < section < 1e-3:
        assert missed.alone > TOGETHER_LIMIT > 1e-9 > missed.together
    if not sound:
        assert missed.fault == pytest.approx(missed.alone, rel=1e-2)


def test_of_halves_that_are_not_valid_nothing_is_measured():
    assert volume_errors([], 1.0) is INVALID
    assert INVALID.fault == 1
    assert VolumeErrors(ALONE_LIMIT, TOGETHER_LIMIT).fault == 0
    assert VolumeErrors(ALONE_LIMIT, 2 * TOGETHER_LIMIT).fault == 2 * TOGETHER_LIMIT


def test_cubes_beside_each_other_are_one_volume():
    assert gauss_kronrod_volume(compound(halves(0.0)), 1e-6) == pytest.approx(2 * SIDE**3, rel=1e-9)


def test_short_pieces_of_a_rim_do_not_count_as_edges_across_the_sheet():
    """A plate of 60 mm whose sides of 180 mm are three edges each: across it are its four corners."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
    from OCP.gp import gp_Pnt, gp_Vec

    outline = BRepBuilderAPI_MakePolygon()
    for x, y in ((0, 0), (60, 0), (120, 0), (180, 0), (180, 100), (120, 100), (60, 100), (0, 100)):
        outline.Add(gp_Pnt(x, y, 0))
    outline.Close()
    plate = BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(outline.Wire()).Face(), gp_Vec(0, 0, 60)).Shape()
    assert [length for _, length in thickness_edges(plate)] == pytest.approx([60] * 4)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"missed": [0, 0, 1.0]}, "half-space cut 3 of 8 of the curved solid along members is not valid"),
        (
            {"missed": [0, 0, 2.04e-4]},
            "after half-space cut 3 of 8, the parts together lack 2.0e-04 of the volume of the curved solid",
        ),
        ({"sound": 8, "boxed": False, "box_missed": 1.0}, "a cut with a box of the curved solid along members is not"),
        (
            {"sound": 8, "boxed": False, "box_missed": 3e-5},
            "after a cut with a box, the parts together lack 3.0e-05 of",
        ),
    ],
)
def test_a_cut_that_misses_volume_is_not_said_to_be_invalid(said, words):
    usual = {"plain": 1.0, "volume": 1.0, "valid": True, "sound": 2, "boxed": True, "closed": True, "again": True}
    usual |= {"missed": [0.0], "box_missed": 0.0}
    with pytest.raises(ExportError, match=words):
        build.require_use(usual | said)


def test_a_trial_cut_reports_the_volume_that_its_halves_miss(tmp_path, monkeypatch):
    said = {"halves": True, "off": 0.00015, "box": []}
    monkeypatch.setattr(soundness, "occt_report", lambda *_, seconds: said)
    assert soundness.cut_fault(tmp_path, 1)[0].startswith(
        "a trial cut in OCCT changes the total volume by 1.5e-04 (relative)"
    )
