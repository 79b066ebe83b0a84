"""The picture for the workshop: every measured place is ringed where it is seen, and missed limits are red."""

import numpy as np
import pytest
from PIL import Image

import dsfab
from dsfab.app.cli import main
from dsfab.preset.file import with_overrides
from dsfab.render.fabrication import Callout, callouts, with_callouts, workshop_picture
from dsfab.render.lettering import PAPER
from dsfab.render.view import View
from dsfab.study.fabrication import fabrication

SIZE = (320, 240)
AHEAD = View(
    np.array([0.0, 0.0, 5.0]), *np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, -1]]), 0.2, np.array([0, 0, 1.0]), True
)


@pytest.fixture(scope="module")
def cantilever():
    return dsfab.run(dsfab.load_preset("cantilever", {"surface.edge": 0.08, "statics.thickness": 0.01}))


def count(picture: np.ndarray, colour: tuple[int, int, int]) -> int:
    return int((np.abs(picture[..., :3].astype(int) - colour).max(axis=2) < 24).sum())


def test_a_callout_ring_is_drawn_at_the_projected_place():
    """At distance 5 the upper edge of the page is 1 m above its middle."""
    white = Image.new("RGB", (400, 400), (255, 255, 255))
    place = np.array([0.5, -0.25, 0.0])
    drawn = np.asarray(with_callouts(white, [Callout(place, ("", ""), (200, 0, 0))], AHEAD, PAPER))
    rows, columns = np.nonzero((drawn != 255).any(axis=2) & (np.arange(400)[:, None] > 200))
    ring = rows > 250 - 9
    assert columns[ring].mean() == pytest.approx(300, abs=1.5)
    assert (rows[ring].min() + rows[ring].max()) / 2 == pytest.approx(250, abs=1.5)
    assert with_callouts(white, [], AHEAD, PAPER) is white


def test_lines_do_not_cross():
    """Places in a row and words in a row: each its own."""
    white = Image.new("RGB", (400, 400), (255, 255, 255))
    colours = [(200, 0, 0), (0, 200, 0), (0, 0, 200)]
    order = [2, 0, 1]
    ones = [Callout(np.array([-0.6 + 0.6 * k, -0.5, 0]), ("", ""), colours[k]) for k in order]
    drawn = np.asarray(with_callouts(white, ones, AHEAD, PAPER)).astype(int)
    for k, colour in enumerate(colours):
        columns = np.nonzero(np.abs(drawn - colour).max(axis=2) < 60)[1]
        assert abs(columns.mean() - (80 + 120 * k)) < 20


def test_the_callouts_mark_the_measured_places(cantilever):
    made = fabrication(cantilever)
    found = {one.lines[0].rsplit(" ", 3)[-3]: one for one in callouts(made, PAPER)}
    assert set(found) == {"member", "gap", "edge", "wall"}
    assert np.array_equal(found["member"].place, made.features.member.place)
    assert found["wall"].lines == ("thinnest wall 10 mm", "no limit given")
    assert {one.colour for one in found.values()} == {PAPER.text}


def test_missed_limits_are_red_in_words_too(cantilever):
    limits = {"fabrication.min_member": 0.5, "fabrication.min_wall": 0.009, "fabrication.bed": [3, 3, 3]}
    limited = dsfab.revise(cantilever, with_overrides(cantilever.preset, limits))
    made = fabrication(limited)
    lines = {one.lines[0].split()[1]: (one.lines[1], one.colour) for one in callouts(made, PAPER)}
    assert lines["member"] == ("at least 500 mm: fail", PAPER.tension)
    assert lines["wall"] == ("at least 9 mm: pass", PAPER.load)
    pictures = [workshop_picture(d, fabrication(d), size=SIZE) for d in (cantilever, limited)]
    assert count(pictures[0], PAPER.tension) == 0
    assert count(pictures[1], PAPER.tension) > 20
    clear = workshop_picture(cantilever, fabrication(cantilever), size=SIZE, ground="transparent")
    assert clear.shape == (240, 320, 4)
    assert clear[120, 2, 3] == 0


def test_preview_shows_fabrication_and_explains_a_refusal(capsys, tmp_path):
    words = ["preview", "cantilever", "--set", "surface.edge=0.08", "--size", "320x240", "-o"]
    assert main([*words, str(tmp_path / "a.png"), "--show", "fabrication"]) == 0
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == SIZE
        assert count(np.asarray(picture), PAPER.plain) > 3000
    assert main([*words, str(tmp_path / "b.png"), "--show", "structure,fabrication"]) == 1
    assert "without other pictures" in capsys.readouterr().err


@pytest.mark.slow
def test_the_preview_of_a_built_folder_goes_into_it_without_new_computation(capsys, tmp_path, monkeypatch):
    folder = tmp_path / "out"
    assert (
        main(["build", "cantilever", "--set", "surface.edge=0.08", "-f", "stl", "--no-picture", "-o", str(folder)]) == 0
    )
    words = ["--size", "320x240", "-o"]
    assert main(["preview", "cantilever", "--set", "surface.edge=0.08", *words, str(tmp_path / "a.png")]) == 0
    assert main(["preview", str(folder), "--size", "320x240"]) == 0
    assert (folder / "cantilever.png").read_bytes() == (tmp_path / "a.png").read_bytes()
    finished = ["--show", "fabrication", *words]
    assert main(["preview", str(folder / "preset.toml"), *finished, str(tmp_path / "b.png")]) == 0
    monkeypatch.setattr("dsfab.design.run", None)
    assert main(["preview", str(folder), *finished, str(tmp_path / "c.png")]) == 0
    assert (tmp_path / "b.png").read_bytes() == (tmp_path / "c.png").read_bytes()
    (tmp_path / "empty").mkdir()
    assert main(["preview", str(tmp_path / "empty")]) == 1
    assert "has no preset.toml, so dsfab did not build it" in capsys.readouterr().err


@pytest.mark.slow
def test_build_and_inspect_draw_the_marked_picture_on_request(capsys, tmp_path, unjudged):
    folder = tmp_path / "out"
    words = ["build", "cantilever", "--set", "surface.edge=0.08", "-f", "stl", "--no-picture", "--marked"]
    assert main([*words, "-o", str(folder)]) == 0
    assert main(["inspect", str(folder), "-o", str(tmp_path / "a.png")]) == 0
    assert not (folder / "preview.png").exists()
    assert (folder / "fabrication.png").read_bytes() == (tmp_path / "a.png").read_bytes()
    assert main(["inspect", str(folder / "cantilever.stl"), "-o", str(tmp_path / "b.png")]) == 1
    assert "not with a mesh file" in capsys.readouterr().err
