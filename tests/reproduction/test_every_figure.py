"""Every figure of the paper is made, eight times coarser, with small pictures; app/test_reproduce.py looks at the page."""

import pytest
from PIL import Image

from dsfab.render.light import QUICK
from dsfab.reproduction import drawing, figures
from dsfab.reproduction.published import FIGURES


@pytest.mark.slow
@pytest.mark.parametrize("figure", FIGURES, ids=lambda figure: figure.preset)
def test_each_figure_of_the_paper_is_made_with_all_its_pictures(figure, tmp_path, monkeypatch):
    for name, size in (("SMALL", (96, 72)), ("LARGE", (128, 96)), ("LIGHT", QUICK)):
        monkeypatch.setattr(drawing, name, size)
    monkeypatch.setattr(figures, "RUNS", 1)
    made = figures.make_figure(figure, tmp_path, 8.0)
    assert made.error == ""
    assert [one.rendition.name for one in made.ways] == list(figures.RENDITION_TITLES)
    assert len(made.shown) == 1 + len(figures.STEPS)
    assert made.comparisons
    files = [one.file for one in made.shown] + [one.picture.file for one in made.ways if one.picture.file]
    for file in files:
        with Image.open(tmp_path / file) as picture:
            assert picture.size in ((96, 72), (128, 96)), file
