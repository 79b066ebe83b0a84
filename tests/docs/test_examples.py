"""The scripts of docs/examples run as they stand, and draw the pictures that are shown beside them."""

import runpy
from pathlib import Path

import pytest
from PIL import Image, ImageStat

from dsfab.render.light import QUICK
from dsfab.render.picture import StructurePicture

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "docs" / "examples").glob("*.py"))
SHOWN = ROOT / "docs" / "media" / "examples"


@pytest.mark.slow
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_an_example_runs_and_draws_its_picture(script, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(StructurePicture.render, "__defaults__", (QUICK,))  # light that takes less time
    runpy.run_path(str(script), run_name="__main__")
    with Image.open(tmp_path / f"{script.stem}.png") as made, Image.open(SHOWN / f"{script.stem}.webp") as shown:
        assert ImageStat.Stat(made.convert("L")).stddev[0] > 5  # there is something on it
        assert min(made.width, 1280) == pytest.approx(shown.width, abs=20)  # fonts differ; pages show 1280 pixels


def test_every_example_is_shown_with_a_sentence():
    assert len(SCRIPTS) >= 8
    assert {path.stem for path in SHOWN.glob("*.webp")} == {path.stem for path in SCRIPTS}
    for script in SCRIPTS:
        first = script.read_text(encoding="utf-8").splitlines()[0]
        assert first.startswith('"""'), script.name
        assert first.endswith(('."""', '?"""')), script.name
