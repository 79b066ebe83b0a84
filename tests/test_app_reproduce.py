"""`dsfab reproduce`: the paper's figures on one page; and the pictures that it needed: directions and modes."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from dsfab.app.cli import main
from dsfab.app.terminal import Reporter
from dsfab.diffusion import diffusion_tensors
from dsfab.errors import DsfabError, SurfaceError
from dsfab.pipeline import draft
from dsfab.preset_file import load_preset, overridden
from dsfab.render.crosses import crosses
from dsfab.render.light import QUICK
from dsfab.render.palette import PAPER
from dsfab.render.previewer import TRIAL, Previewer
from dsfab.report.paper import drawing, figures
from dsfab.report.paper.comparisons import as_mode
from dsfab.report.paper.figures import _reached
from dsfab.report.paper.page import PageFacts, page
from dsfab.report.paper.volumes import sphere_volumes
from dsfab.results import Piece
from dsfab.study.paper import FIGURES
from dsfab.surface.hats import voronoi_mass
from tests.presets import DOME_MODES
from tests.zoo import grid, sphere

TWO = ("hanging_bar", "sphere")
ROUGH = ("--coarser", "6")


@pytest.fixture(autouse=True, scope="module")
def small():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(drawing, "SMALL", (96, 72))
        patch.setattr(drawing, "LARGE", (128, 96))
        patch.setattr(drawing, "LIGHT", QUICK)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("page")
    assert main(["reproduce", *reversed(TWO), *ROUGH, "-o", str(path), "--quiet"]) == 0
    return path


class Page(HTMLParser):
    """Tables as lists of rows of cells by section, everything that is asked for, and tags left open."""

    VOID = ("meta", "img", "br")

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self.text = (folder / "index.html").read_text(encoding="utf-8")
        self.sections: dict[str, list[list[str]]] = {}
        self.links: list[str] = []
        self.images: list[dict[str, str | None]] = []
        self.open: list[str] = []
        self.at = ""
        self.feed(self.text)

    def handle_starttag(self, tag, attrs):
        given = dict(attrs)
        if tag not in self.VOID:
            self.open.append(tag)
        if tag == "section":
            self.at = given.get("id", "")
            self.sections.setdefault(self.at, [])
        elif tag == "tr":
            self.sections[self.at].append([])
        elif tag in ("td", "th"):
            self.sections[self.at][-1].append("")
        elif tag == "img":
            self.images.append(given)
        self.links += [value for key, value in attrs if key in ("src", "href") and value and value[0] != "#"]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] in ("td", "th"):
            self.sections[self.at][-1][-1] += data


def test_the_page_shows_every_step_of_every_figure_and_opens_offline(folder):
    page = Page(folder)
    assert page.open == []
    assert [name for name in page.sections if name] == list(TWO)  # in the paper's order
    for name in TWO:
        for show in ("structure", *figures.STEPS):
            assert (folder / f"{name}-{show.replace('_', '-')}.webp").is_file()
    assert {link for link in page.links if link.endswith("webp")} == {path.name for path in folder.glob("*.webp")}
    assert all((folder / link).is_file() for link in page.links)
    assert "http" not in page.text
    assert "url(" not in page.text
    assert all(image["alt"] for image in page.images)
    assert "6 times coarser" in page.text
    for words in ("The effect of the anisotropy r", "Why not stripes along the von Mises stress?"):
        assert words in page.text


@pytest.mark.parametrize("name", TWO)
def test_the_rows_are_those_of_the_papers_tables(folder, name):
    figure = next(figure for figure in FIGURES if figure.preset == name)
    rows, row, timings = Page(folder).sections[name][4:], figure.row, figure.timings
    values = (row.gamma, row.r, *row.modes, *row.thresholds, *row.frequencies, *row.phases)
    assert [float(cell) for cell in rows[1]] == list(values)
    paper, ours = rows[3], rows[4]
    assert paper[:3] == ["paper", f"{timings.vertices:,}", f"{timings.triangles:,}"]
    assert paper[4] == "n/a"  # of both the paper times no bending; a sphere of ours bends
    assert (ours[4] == "n/a") == (name == "hanging_bar")
    assert float(paper[5]) == pytest.approx(timings.statics, abs=6e-4)
    assert 100 < int(ours[1].replace(",", "")) < timings.vertices / 10
    assert float(ours[8]) > 0


@pytest.mark.parametrize("name", TWO)
def test_every_figure_is_there_three_ways_with_what_was_measured_and_the_command(folder, name):
    page = Page(folder)
    measured = page.sections[name][1:4]
    assert [row[0] for row in measured] == ["The paper to the letter", "The preset", "dsfab's stripes"]
    assert all(row[1].endswith("%") and float(row[6]) >= 0 for row in measured)
    assert (measured[0][4] == "not carried") == (measured[0][3] == "0%")
    assert f"dsfab reproduce {name} --coarser 6" in page.text
    assert f"<code>dsfab build {name} --set surface.edge=" in page.text
    assert "labelled by the sign of their stress" in page.text
    for way in ("letter", "stripes"):
        assert (folder / f"{name}-{way}-structure.webp").is_file()


def test_pictures_differ_and_are_all_there(folder):
    seen = set()
    for path in sorted(folder.glob("*.webp")):
        with Image.open(path) as image:
            pixels = np.asarray(image.convert("RGB"))
        assert pixels.shape in ((72, 96, 3), (96, 128, 3))
        assert pixels.std() > 5
        seen.add(pixels.tobytes())
    # r = 100 is the figure itself, and without a stress both families have one mode
    assert len(seen) >= len(list(folder.glob("*.webp"))) - 4


def test_a_mesh_too_coarse_for_its_shape_is_made_finer_and_told(tmp_path, monkeypatch):
    """No edge over 0.1 m is taken: 0.19 m becomes 0.8 of it, three times."""

    def fussy(preset, *arguments, **others):
        if preset.surface.edge > 0.1:
            raise SurfaceError("the edge is too long")
        return draft(preset, *arguments, **others)

    own = load_preset("hanging_bar").surface.edge
    monkeypatch.setattr(figures, "draft", fussy)
    design, coarser = figures.coarsened(load_preset("hanging_bar"), 0.19 / own)
    assert coarser == pytest.approx(0.8**3 * 0.19 / own)  # 0.19, 0.152, 0.1216, 0.09728 m
    assert design.preset.surface.edge == pytest.approx(0.8**3 * 0.19)
    made = figures.FigurePictures(FIGURES[1], 1, 1, carried="all of it", coarser=1.5)
    text = page([made], PageFacts(2.0, "a machine"))
    assert "No mesh 2 times coarser has all its details: it was made 1.5 times coarser." in text
    assert "No mesh" not in page([made], PageFacts(1.5, "a machine"))
    monkeypatch.setattr(figures, "draft", lambda *_: (_ for _ in ()).throw(SurfaceError("never")))
    with pytest.raises(SurfaceError, match="never"):
        figures.coarsened(load_preset("hanging_bar"), 4.0)


STAND_INS = (
    "pavilion",
    "bridge",
    "camel_head",
    "camel_ears",
    "pirate",
    "climbing_hold",
    "bob",
    "mouse",
    "boys_surface",
)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*STAND_INS, "twisty_tower", "turkey"])
@pytest.mark.parametrize("coarser", [4.0, 8.0])
def test_every_stand_in_can_be_made_coarser(name, coarser):
    design, used = figures.coarsened(load_preset(name), coarser)
    assert 1 <= used <= coarser
    assert design.load.force.any()


@pytest.mark.slow
def test_a_figure_that_fails_is_told_in_its_place_and_the_old_page_leaves_nothing(tmp_path, capsys, monkeypatch):
    def failing(preset, *arguments, **others):
        if preset.name == "sphere":
            raise DsfabError("the sphere <rolled> away")
        return draft(preset, *arguments, **others)

    monkeypatch.setattr(figures, "draft", failing)
    (tmp_path / "mine.webp").write_bytes(b"mine")
    (tmp_path / "bob-loads.webp").write_bytes(b"old")
    (tmp_path / "index.html").write_text('<img src="bob-loads.webp">', encoding="utf-8")
    assert main(["reproduce", "rollers", "sphere", *ROUGH, "-o", str(tmp_path)]) == 1
    out, err = capsys.readouterr()
    assert "1 of 2 figures could not be made: sphere (the sphere <rolled> away)" in err.splitlines()[-1]
    assert "sphere: not made" in out
    page = Page(tmp_path)
    assert list(page.sections) == ["rollers", "sphere"]
    assert "Not made: the sphere &lt;rolled&gt; away" in page.text
    assert "Why not" not in page.text
    assert (tmp_path / "rollers-structure.webp").is_file()
    assert (tmp_path / "mine.webp").read_bytes() == b"mine"
    assert not (tmp_path / "bob-loads.webp").exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["bobb"], r"the paper has no figure 'bobb'; did you mean bob\?; its figures are pavilion, hanging_bar, .*"),
        (["bob", "--coarser", "0.5"], r"--coarser 0.5 is not between 1 and 8"),
        (["bob", "--coarser", "nan"], r"--coarser nan is not between 1 and 8"),
    ],
)
def test_a_mistake_is_refused_in_one_sentence(tmp_path, capsys, arguments, told):
    assert main(["reproduce", *arguments, "-o", str(tmp_path / "no")]) == 1
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert re.fullmatch(f"dsfab: {told}.*", lines[0])
    assert not (tmp_path / "no").exists()


def test_how_loads_reach_the_supports():
    whole, loose, bare = Piece(1.0, True, True), Piece(0.5, False, True), Piece(0.2, True, False)
    assert _reached([whole, bare]) == "the loads reach the supports through one piece"
    assert _reached([whole, whole]) == "the loads reach the supports through 2 pieces"
    assert _reached([whole, loose]) == "1 of 2 pieces that carry a load reach no support"
    assert _reached([bare]) == "the load is spread, and all of it is supported"
    assert "one piece reach" in _reached([bare, Piece(0.1, False, False)])


def stressed(surface, angle: float, r: float = 100.0):
    """A uniform stress: tension along `angle`, half as much compression across it."""
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    sigma = np.tile(turn @ np.diag([2e6, -1e6, 0]) @ turn.T, (surface.m, 1, 1))
    tensors = diffusion_tensors(surface, sigma, r)
    preset = SimpleNamespace(diffusion=SimpleNamespace(r=r), combines=False)
    return SimpleNamespace(surface=surface, diffusion=SimpleNamespace(tensors=tensors), preset=preset)


@pytest.mark.parametrize("degrees", [0.0, 30.0, 100.0])
def test_crosses_lie_along_the_principal_stresses(degrees):
    body = crosses(stressed(grid(24, 24, 1.0, 1.0), np.radians(degrees)), PAPER)
    corners = body.V.reshape(-1, 8, 3)
    along = corners[:, 4:].mean(axis=1) - corners[:, :4].mean(axis=1)
    colours = body.colour.reshape(len(corners), 12, 3)[:, 0]
    for name, angle in (("tension", degrees), ("compression", degrees + 90)):
        bars = along[(colours == PAPER.of(name)).all(axis=1)]
        assert len(bars) == len(along) // 2 > 50
        direction = np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])
        assert np.allclose(np.abs(bars @ direction), np.linalg.norm(bars, axis=1), rtol=1e-9)
    middles = corners[: len(corners) // 2].mean(axis=1)
    near = np.linalg.norm(middles[:, None] - middles, axis=2) + 9 * np.eye(len(middles))
    assert near.min() > 0.5 * np.linalg.norm(along[0])  # crosses stay apart


def test_without_anisotropy_there_are_no_directions():
    with pytest.raises(DsfabError, match="r = 1, so that diffusion prefers none"):
        crosses(stressed(grid(8, 8, 1.0, 1.0), 0.0, r=1.0), PAPER)


def test_a_field_becomes_as_large_as_a_mode():
    surface = sphere(4)
    z = surface.centroids[:, 2]
    value, mass = as_mode(surface, 5e6 + 3e6 * z), voronoi_mass(surface)
    assert mass @ value == pytest.approx(0.0, abs=1e-12)
    assert mass @ value**2 == pytest.approx(surface.area / (4 * np.pi))
    assert np.allclose(value, np.sqrt(3 / (4 * np.pi)) * surface.V[:, 2], atol=2e-2)  # on the unit sphere Y_10


@pytest.fixture(scope="module")
def dome():
    return draft(load_preset(DOME_MODES, {"surface.edge": 0.7, "statics.bending": "midedge"}))


@pytest.mark.parametrize("show", ["directions", "major_mode", "minor_mode"])
def test_directions_and_modes_are_drawn_on_the_whole_sheet(dome, show):
    with Previewer(dome, show=show, marks=False) as previewer:
        picture = previewer.picture(TRIAL, quality=QUICK)
        assert np.ptp(picture.reshape(-1, 3).astype(int), axis=0).min() > 50
        before = previewer.mask(TRIAL)
        previewer.set({"pattern.major.threshold": 0.9, "pattern.width": {"rule": "plain"}})
        assert np.array_equal(previewer.mask(TRIAL), before)


def test_a_previewed_mode_follows_its_number_and_directions_need_a_new_one(dome):
    with Previewer(dome, show="major_mode", marks=False) as previewer:
        first, told = previewer.picture(TRIAL, quality=QUICK), previewer.words
        previewer.set({"pattern.major.mode": 3})
        assert previewer.words.startswith("major mode 3")
        assert previewer.words != told
        assert not np.array_equal(previewer.picture(TRIAL, quality=QUICK), first)
    changed = overridden(dome.preset, {"diffusion.gamma": 2.0})
    with Previewer(dome, show="directions", marks=False) as previewer:
        assert not previewer.can_display(changed)
        with pytest.raises(DsfabError, match="other directions: make a new Previewer"):
            previewer.display(changed)


@pytest.mark.slow
def test_the_claim_on_the_sphere_is_written_as_data_and_a_chart(tmp_path):
    """In rough; the recorded files in outputs/paper are those of the preset's own mesh."""
    sphere_volumes(tmp_path, Reporter(quiet=True), coarser=3.5, shares=(0.5,))
    told = json.loads((tmp_path / "sphere_volumes.json").read_text())
    names = ["full", "design", "isotropic", "thinner", "plain", "row", "stripes"]
    assert [row["name"] for row in told["competitors"]] == names
    assert told["competitors"][2]["ratio_to_full"] is None or told["competitors"][2]["ratio_to_design"] > 1
    chart = (tmp_path / "sphere_volumes.svg").read_text()
    assert "the same, plain widths" in chart
    assert (tmp_path / "sphere_volumes.png").read_bytes().startswith(b"\x89PNG")


def test_the_recorded_comparison_on_the_sphere_says_what_the_paper_claims():
    """Under a quarter of the best isotropic compliance at 40 to 50 % of the material; five times stiffer and more."""
    told = json.loads((Path(__file__).parent.parent / "outputs" / "paper" / "sphere_volumes.json").read_text())
    gains = {row["volume"]: row["ratio_to_design"] for row in told["competitors"] if row["name"] == "isotropic"}
    assert len(gains) == 7
    assert min(gains[0.4], gains[0.5]) > 4
    masses = [row["mass_kg"] for row in told["competitors"] if row["volume"] == 0.4 and row["name"] != "full"]
    assert max(masses) / min(masses) < 1.002


def test_the_page_shows_the_chart_on_the_sphere_where_its_data_lie():
    from dsfab.app.reproduce import _volumes

    folder = Path(__file__).parent.parent / "outputs" / "paper"
    rows = _volumes(folder)
    text = page([], PageFacts(1.0, "a machine"), rows)
    assert 'src="sphere_volumes.svg"' in text
    own, iso = (
        next(row["compliance_J"] for row in rows if row["name"] == name and row["volume"] == 0.5)
        for name in ("design", "isotropic")
    )
    assert f"{iso / own:.3g} times at 50%" in text
    assert _volumes(folder / "nowhere") == []
    assert "sphere_volumes" not in page([], PageFacts(1.0, "a machine"))
