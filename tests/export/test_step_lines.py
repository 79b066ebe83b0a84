"""Curves in STEP: every line is there once, as long as it is, near the mesh, with its name, layer and colour."""

import numpy as np
import pytest

from dsfab.core.errors import ExportError
from dsfab.export import Details, write
from dsfab.export.cad.step import file
from dsfab.export.cad.step.worker.shapes import step_facts
from dsfab.export.curves import curves_along
from dsfab.export.formats import suffix_of
from dsfab.surface.fields import StructureLine, polyline_length
from tests.export.striped_solids import ARCHED, FLAT


def helix(turns: float = 1.5, count: int = 200) -> np.ndarray:
    t = 2 * np.pi * turns * np.linspace(0, 1, count)
    return np.c_[np.cos(t), np.sin(t), 0.1 * t]


def test_a_helix_becomes_one_spline_of_its_length(tmp_path, inspected):
    t = 3 * np.pi
    (curve,) = curves_along(1000 * helix(), 0.5)
    assert (curve.degree, curve.deviation) == (3, pytest.approx(0.25, abs=0.25))
    x = curve(np.linspace(0, curve.knots[-1], 500))
    assert np.abs(np.hypot(x[:, 0], x[:, 1]) - 1000).max() < 0.6
    line = StructureLine("centre", "major", 2, 1, helix(), polyline_length(helix()))
    path = write(FLAT[0], tmp_path / "a.lines.step", details=Details((line,), 5e-4))
    assert step_facts(path) == {"lines": 1, "length": pytest.approx(1000 * t * np.hypot(1, 0.1), rel=5e-4)}
    assert "'centre-major-2.1 9470.9" in path.read_text()


@pytest.mark.parametrize("made", [FLAT, ARCHED], ids=["flat", "arched"])
def test_occt_finds_every_line_with_layers_and_colours(made, tmp_path, inspected):
    sheet, details = made
    text = write(sheet, tmp_path / "a.lines.step", details=details).read_text()
    found = step_facts(tmp_path / "a.lines.step")
    assert found["lines"] == len(details.lines)
    assert found["length"] == pytest.approx(sum(1000 * line.length for line in details.lines), rel=1e-3)
    assert text.count("PRESENTATION_LAYER_ASSIGNMENT") == len({line.layer for line in details.lines})
    assert all(f"'{line.id} {1000 * line.length:.3f} mm'" in text for line in details.lines)
    assert "COLOUR_RGB('',0.12,0.31,0.61)" in text


def test_a_file_of_fewer_or_shorter_lines_is_not_kept(tmp_path, monkeypatch):
    sheet, details = FLAT
    right = {"lines": len(details.lines), "length": 1000 * sum(line.length for line in details.lines)}
    for wrong in (right | {"lines": 3}, right | {"length": 0.9 * right["length"]}):
        monkeypatch.setattr(file, "inspection", lambda part, path, wrong=wrong: wrong)
        with pytest.raises(ExportError):
            write(sheet, tmp_path / "a.lines.step", details=details)
    assert not any(tmp_path.iterdir())


def test_two_words_make_a_suffix(tmp_path):
    assert suffix_of(tmp_path / "My.LINES.STEP") == ".lines.step"
    assert suffix_of(tmp_path / "my.part.step") == ".step"
