"""Drawings as people and machines write them: arrays of blocks, bombs, files that are cut off, and their bounds."""

import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from dsfab.core.errors import SurfaceError
from dsfab.surface import ClosedCurves
from dsfab.surface.files.drawings import SAME_PLACE, closed_loops, read_dxf
from dsfab.surface.files.reading import Content, DrawingBudget, contents
from dsfab.surface.loads.outlines import enclosed_area
from tests.fuzz.corpus import ENTITIES, dxf
from tests.surface.outline_drawings import drawing


def test_a_grid_of_insertions_has_all_its_curves(tmp_path):
    """An array of blocks (MINSERT) is as many curves as it has places; only the first one was read."""
    document = drawing(tmp_path)
    document.blocks.new("oculus").add_circle((0, 0), 100)
    grid_of = {"row_count": 3, "column_count": 4, "row_spacing": 500, "column_spacing": 300}
    document.modelspace().add_blockref("oculus", (0, 0), dxfattribs=grid_of)
    document.saveas(tmp_path / "grid.dxf")
    centres = np.array([loop.mean(axis=0)[:2] for loop in loops_of(tmp_path / "grid.dxf")])
    wanted = np.array([(0.3 * i, 0.5 * j) for i in range(4) for j in range(3)])
    assert len(centres) == 12
    assert (np.linalg.norm(centres[:, None] - wanted, axis=2).min(axis=0) < 1e-3).all()


def loops_of(path: Path) -> tuple[np.ndarray, ...]:
    return ClosedCurves(path).loops()


def test_blocks_within_blocks_are_bounded(tmp_path):
    """Ten in each of nine in one another, a thousand million circles or nothing at all; a block that holds itself."""
    for name, filled in (("full", True), ("empty", False)):
        document = drawing(tmp_path)
        block = document.blocks.new("b0")
        if filled:
            block.add_circle((0, 0), 100)
        for level in range(1, 10):
            block = document.blocks.new(f"b{level}")
            for k in range(10):
                block.add_blockref(f"b{level - 1}", (k, 0))
        document.modelspace().add_blockref("b9", (0, 0))
        document.saveas(tmp_path / f"{name}.dxf")
        with pytest.raises(SurfaceError, match=r"2,001 entities, but 2,000 is the limit; put the outlines"):
            read_dxf(tmp_path / f"{name}.dxf", DrawingBudget(entities=2000))
    document = drawing(tmp_path)
    document.blocks.new("self").add_blockref("self", (1, 0))
    document.modelspace().add_blockref("self", (0, 0))
    document.saveas(tmp_path / "self.dxf")
    with pytest.raises(SurfaceError, match=r"self\.dxf cannot be read as DXF \(the file's blocks are nested more than"):
        loops_of(tmp_path / "self.dxf")
    document = drawing(tmp_path)
    document.blocks.new("b").add_circle((0, 0), 100)
    many = {"row_count": 30_000, "column_count": 30_000, "row_spacing": 1, "column_spacing": 1}
    document.modelspace().add_blockref("b", (0, 0), dxfattribs=many)
    document.saveas(tmp_path / "many.dxf")
    with pytest.raises(SurfaceError, match=r"entities, but 50,000 is the limit"):
        loops_of(tmp_path / "many.dxf")


def test_a_drawing_over_the_size_limit_is_refused_before_reading(tmp_path):
    for name in ("a.dxf", "a.3dm"):
        with (tmp_path / name).open("wb") as file:
            file.truncate(10**9)  # no byte of it is on the disk
        with pytest.raises(SurfaceError, match=r"1,000,000,000 bytes, but 50,000,000 is the limit"):
            loops_of(tmp_path / name)
    late = DrawingBudget(started=time.monotonic() - 61)
    with pytest.raises(SurfaceError, match=r"took more than 60 s; put"):
        late.require("bytes", 0)
    with pytest.raises(SurfaceError, match=r"took more than 60 s; put"):
        list(closed_loops([spatial(np.array([[0, 0], [3, 0]])), spatial(np.array([[3, 0], [0, 4]]))], "here", late))


@pytest.mark.parametrize("name", ENTITIES)
def test_a_truncated_drawing_is_refused_or_gives_the_same_curves(name, tmp_path):
    """At every byte of a small file: refused, or the same curves."""
    data = dxf(ENTITIES[name])
    whole = written(tmp_path / "whole.dxf", data)
    for size in range(1, len(data), 11):
        with suppress(SurfaceError):
            part = written(tmp_path / f"{size}.dxf", data[:size])
            assert [a.tolist() for a in part] == [a.tolist() for a in whole], size


def written(path: Path, data: bytes) -> tuple[np.ndarray, ...]:
    path.write_bytes(data)
    return loops_of(path)


def test_invalid_numbers_in_a_drawing_are_refused_with_their_place(tmp_path):
    for k, (old, new) in enumerate((("40 3", "40 nan"), ("10 1", "10 1e300"), ("40 3", "40 1e13"))):
        data = dxf(ENTITIES["circle"].replace(old, new))
        with pytest.raises(SurfaceError, match=r"a CIRCLE has (radius|center) = "):
            written(tmp_path / f"{k}.dxf", data)


def test_many_lines_are_joined_in_about_as_many_steps(tmp_path):
    """1,500 lines of a ring in any order and either way round are one curve; each was compared with all others."""
    rng = np.random.default_rng(5)
    turn = 2 * np.pi * np.arange(1501) / 1500
    P = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    lines = [P[k : k + 2][:: rng.choice((1, -1))] for k in rng.permutation(1500)]
    (loop,) = closed_loops(lines, "here", DrawingBudget())
    assert len(loop) == 1500
    assert enclosed_area(loop[:, :2]) == pytest.approx(750 * np.sin(2 * np.pi / 1500), rel=1e-9)


def curves(*runs, far=5.0):
    """Closed loops of runs in the plane, and of one more curve of 3 x 4: ends within `close` = CLOSE x 5 meet."""
    box = np.array([[0, 0], [3, 0], [3, 4], [0, 4], [0, 0]]) * (far / 5.0)
    return [loop.tolist() for loop in closed_loops([spatial(box), *map(spatial, runs)], "here", DrawingBudget())][1:]


def spatial(run):
    return np.c_[np.asarray(run, dtype=float), np.zeros(len(run))]


def test_ends_meet_within_a_share_of_the_diagonal_of_all_curves():
    triangle = np.array([[1, 1], [2, 1], [2, 2], [1, 1]], dtype=float)
    for far in (5.0, 50.0):
        for gap, whole in ((1.0, True), (0.99, True), (1.01, False)):
            triangle[0] = 0, 0  # a gap is what it is to the last bit there
            triangle[-1] = gap * SAME_PLACE * far, 0
            if whole:
                assert curves(triangle, far=far) == [spatial(triangle[:-1]).tolist()]
            else:
                with pytest.raises(SurfaceError, match=r"here has an open curve, whose ends at \(0, 0, 0\)"):
                    curves(triangle, far=far)


def test_the_diagonal_is_that_of_every_curve():
    """Each curve alone would be closed by 5 CLOSE; together they are 500 wide, and either end of the box counts."""
    open_ = np.array([[0, 0], [3, 0], [3, 4], [0, 100 * SAME_PLACE]])
    for there in ([400, 300], [-400, -300]):
        far = np.array([[0, 0], [0, 1], [1, 1], [0, 0]]) + there
        found = list(closed_loops([spatial(open_), spatial(far)], "here", DrawingBudget()))
        assert [len(loop) for loop in found] == [3, 3]
        with pytest.raises(SurfaceError, match="open"):
            list(closed_loops([spatial(open_)], "here", DrawingBudget()))


def test_runs_of_many_points_are_joined_at_their_ends():
    there, back = [[1, 1], [1.5, 1], [2, 1]], [[1, 1], [1.2, 2], [1.8, 2], [2, 1]]
    assert curves(there, back) == [spatial([*there, *back[2:0:-1]]).tolist()]


def test_three_points_are_a_curve_and_two_are_not_however_near():
    assert curves([[1, 1], [2, 1], [1, 1]]) == [spatial([[1, 1], [2, 1]]).tolist()]
    near = 0.5 * SAME_PLACE * 5
    short, rest = [[1, 1], [1 + near, 1]], [[1 + near, 1], [2, 1], [2, 2], [1, 1]]
    assert curves(short, rest) == [spatial([*short, *rest[1:-1]]).tolist()]


@pytest.mark.parametrize(("layers", "lines"), [(5, 5), (6, 1)])
def test_objects_hidden_on_many_layers_are_one_line(layers, lines):
    counts = Counter({Content("hidden object", "beside", f"on layer {k}"): 2 for k in range(layers)})
    found = contents(counts)
    assert len(found) == lines
    assert sum(thing.count for thing in found) == 2 * layers
