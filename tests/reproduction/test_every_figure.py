"""Figures of the paper are made, up to eight times coarser, in small; app/test_reproduce.py looks at the page."""

import pytest
from PIL import Image

from dsfab.render.light import QUICK
from dsfab.reproduction import drawing, figures
from dsfab.reproduction.published import FIGURES

ELSEWHERE = ("hanging_bar", "sphere")
"""Figures that app/test_reproduce.py makes."""

ALIKE = ("camel_ears", "camel_none", "camel_nose")
"""Other loads on the head of camel_head: reproduction/test_paper_presets.py computes them."""

FINER = {"pirate": 4.1}
"""Times the edges of a figure whose mesh shows all details on no coarser one: each that is too coarse takes seconds."""

COMPARED = ("bob", "bridge")
"""Figures, besides those, with which the paper shows a comparison."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "figure", [one for one in FIGURES if one.preset not in ELSEWHERE + ALIKE], ids=lambda one: one.preset
)
def test_each_figure_of_the_paper_is_made_with_its_pictures(figure, tmp_path, monkeypatch, rough_shares):
    for name, size in (("SMALL", (96, 72)), ("LARGE", (128, 96)), ("LIGHT", QUICK)):
        monkeypatch.setattr(drawing, name, size)
    monkeypatch.setattr(figures, "RUNS", 1)
    made = figures.make_figure(figure, tmp_path, FINER.get(figure.preset, 8.0))
    assert made.error == ""
    assert [one.rendition.name for one in made.ways] == list(figures.RENDITION_TITLES)
    assert len(made.shown) == 1 + len(figures.STEPS)
    assert bool(made.comparisons) == (figure.preset in COMPARED)
    files = [one.file for one in made.shown if one.file]
    assert len(files) > len(figures.STEPS) - 2
    for file in files:
        with Image.open(tmp_path / file) as picture:
            assert picture.size in ((96, 72), (128, 96)), file
