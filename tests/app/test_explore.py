"""`dsfab explore` and `dsfab preview`: every combination drawn once, each with the command that builds it."""

import re
import shlex
import time
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from dsfab.app import explore as variants_module
from dsfab.app.cli import main
from dsfab.app.options import picture_size
from dsfab.app.preview import picture_names
from dsfab.core.errors import DsfabError
from dsfab.design import design as stages
from dsfab.preset.file import load_preset, parse_override, preset_toml
from dsfab.render.lettering import PAPER
from dsfab.report.contact_sheet import ContactTile, column_count, contact_page, contact_sheet, tile_label
from dsfab.study.variations import (
    combinations,
    expected_seconds,
    parse_variations,
    short_names,
    spelled_value,
    stage_order,
)
from tests.presets import DOME_MODES

COARSE = ["--set", "surface.edge=0.9", "--set", "pattern.keep=0", "--size", "160x120"]


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, str, str]:
    code = main(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    code, out, err = run(capsys, *arguments)
    assert code == 1, out + err
    last = err.strip().splitlines()[-1]
    assert last.startswith("dsfab: ")
    assert "Traceback" not in err + out
    return last


def opened(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image)


class Page(HTMLParser):
    """What a browser would load and show."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.images: list[dict[str, str | None]] = []
        self.links: list[str] = []
        self.codes: list[str] = []
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag == "img":
            self.images.append(given)
        elif tag != "meta":
            self.open.append(tag)
        self.links += [value for key, value in attrs if key in ("src", "href") and value]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] == "code":
            self.codes.append(data)


def test_a_contact_sheet_and_a_page_with_every_combination(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solves: list[str] = []
    for stage in ("statics_step", "diffusion_step"):
        monkeypatch.setattr(stages, stage, _counted(getattr(stages, stage), stage, solves))
    folder = tmp_path / "sheet of mine"
    varies = [
        "--vary",
        "pattern.major.frequency=4:12:3",
        "--vary",
        "diffusion.r=1,100",
        "--vary=pattern.major.mode=1,9",
    ]
    code, out, _ = run(capsys, "explore", DOME_MODES, *COARSE, *varies, "-o", str(folder))
    assert code == 0
    assert "12 variants, 6 of them impossible" in out
    # one solve serves all; each r needs its modes once
    assert solves == ["statics_step", "diffusion_step", "diffusion_step"]
    names = [f"{n:03}.png" for n in (1, 3, 5, 7, 9, 11)]
    assert sorted(path.name for path in folder.iterdir()) == sorted([*names, "index.html", "sheet.png"])
    text = (folder / "index.html").read_text(encoding="utf-8")
    seen = Page(text)
    assert seen.open == []
    assert [image["src"] for image in seen.images] == names
    assert all(image["alt"] for image in seen.images)
    assert all((folder / link).is_file() for link in seen.links)  # opens offline: nothing else is asked for
    assert "http" not in text.replace("http-equiv", "")
    assert text.count("dsfab computes only 8 modes") == 6
    pictures = [opened(folder / name) for name in names]
    assert {picture.shape for picture in pictures} == {(120, 160, 3)}
    assert len({picture.tobytes() for picture in pictures}) == 6
    assert opened(folder / "sheet.png").shape[1] > 4 * 300
    # the command builds what the picture shows
    words = shlex.split(seen.codes[4])
    assert words[:3] == ["dsfab", "build", DOME_MODES]
    changes = dict(parse_override(words[i + 1]) for i, word in enumerate(words) if word == "--set")
    assert changes == {
        "surface.edge": 0.9, "pattern.keep": 0, "pattern.major.frequency": 8, "diffusion.r": 1, "pattern.major.mode": 1,
    }  # fmt: skip
    assert load_preset(DOME_MODES, changes).pattern.major.frequency == 8


def _counted(stage, name: str, calls: list[str]):
    def counted(*arguments, **options):
        calls.append(name)
        return stage(*arguments, **options)

    return counted


@pytest.mark.slow
def test_exploring_again_leaves_no_picture_of_the_run_before(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "005.png").write_bytes(b"mine")
    vary = "pattern.major.frequency="
    assert run(capsys, "explore", DOME_MODES, *COARSE, "--vary", vary + "4:12:3", "-o", str(tmp_path), "-q")[0] == 0
    assert (tmp_path / "003.png").is_file()
    assert run(capsys, "explore", DOME_MODES, *COARSE, "--vary", vary + "4,9", "-o", str(tmp_path), "-q")[0] == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == ["001.png", "002.png", "005.png", "index.html", "sheet.png"]
    assert (tmp_path / "005.png").read_bytes() == b"mine"


def test_another_surface_in_each_variant_is_drawn_as_itself(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, out, _ = run(capsys, "explore", DOME_MODES, *COARSE, "--vary", "surface.rise=2,6,-1", "-o", str(tmp_path))
    assert code == 1 or "impossible" in out  # a dome cannot be -1 m high
    code, out, _ = run(capsys, "explore", DOME_MODES, *COARSE, "--vary", "surface.rise=2,6", "-o", str(tmp_path))
    assert code == 0, out
    low, high = (_proportion(tmp_path / name) for name in ("001.png", "002.png"))
    assert high > 1.4 * low


def _proportion(path: Path) -> float:
    """Height over width of what is drawn in terracotta."""
    image = opened(path).astype(int)
    rows, cols = np.nonzero(image[:, :, 0] - image[:, :, 2] > 40)
    return float(np.ptp(rows) / np.ptp(cols))


def test_explore_asks_before_it_writes_many_variants(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    folder = tmp_path / "new"
    vary = ["--vary", "pattern.major.frequency=4:24:100", "--vary", "diffusion.r=1:100:100"]
    told = refused(capsys, "explore", DOME_MODES, *COARSE, *vary, "-o", str(folder))
    assert re.search(r"10,000 variants would take about \d+(\.\d)? (seconds|minutes|hours) and .*--yes", told)
    assert not folder.exists()


def test_more_than_the_limit_are_drawn_after_yes(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(variants_module, "UNCONFIRMED_VARIANTS", 1)
    vary = ["--vary", "pattern.major.frequency=4,8", "-o", str(tmp_path)]
    assert "add --yes" in refused(capsys, "explore", DOME_MODES, *COARSE, *vary)
    assert run(capsys, "explore", DOME_MODES, *COARSE, *vary, "--yes", "-q") == (0, "", "")


@pytest.mark.parametrize(
    ("vary", "told"),
    [
        ("pattern.major.frequency=4:24:0", "has 0 values; give a count"),
        ("pattern.major.frequency=4:24", "is not a range"),
        ("pattern.major.frequency=nan:24:3", "needs two finite numbers"),
        ("pattern.major.frequency=4:4:3", "the same value 3 times"),
        ("pattern.major.frequency", "is not KEY=VALUES"),
        ("pattern.major.frequency=4,,6", "has an empty value"),
        ("pattern.major.frequency=4,4", "lists a value twice"),
        ("pattern.major.frequenzy=4,6", "did you mean frequency?"),
        ("pattern.major.frequency=4,-6", "pattern.major.frequency = -6"),
    ],
)
def test_an_invalid_vary_option_is_refused_in_one_sentence(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, vary: str, told: str
) -> None:
    assert told in refused(capsys, "explore", DOME_MODES, "--vary", vary, "-o", str(tmp_path / "no"))
    assert not (tmp_path / "no").exists()


def test_the_same_key_twice_is_refused() -> None:
    with pytest.raises(DsfabError, match=r"diffusion\.r appears twice"):
        parse_variations(["diffusion.r=1,2", "diffusion.r=3"])


def test_all_variants_impossible_is_a_refusal(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    told = refused(
        capsys, "explore", DOME_MODES, *COARSE, "--vary", "pattern.major.mode=20,21", "-o", str(tmp_path / "no")
    )
    assert "none of the 2 variants can be drawn" in told
    assert not (tmp_path / "no").exists()


def test_a_full_disk_leaves_the_folder_unchanged(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("dsfab.report.contact_sheet.save", full)
    (tmp_path / "kept.txt").write_text("kept")
    told = refused(capsys, "explore", DOME_MODES, *COARSE, "--vary", "diffusion.r=1,10", "-o", str(tmp_path))
    assert "No space left on device" in told
    assert [path.name for path in tmp_path.iterdir()] == ["kept.txt"]


def test_preview_writes_one_picture(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    shown = {}
    for show, view in (("structure", "iso"), ("stress", "top"), ("loads", "30,20")):
        path = tmp_path / f"{show}.png"
        code, out, _ = run(capsys, "preview", DOME_MODES, *COARSE, "--show", show, "--view", view, "-o", str(path))
        assert code == 0
        assert str(path) in out
        shown[show] = opened(path)
        assert shown[show].shape == (120, 160, 3)
    assert len({picture.tobytes() for picture in shown.values()}) == 3


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--view", "diagonal"], "view 'diagonal' is not known"),
        (["--show", "beauty"], "show 'beauty' is not known"),
        (["--size", "1600"], "is not WIDTHxHEIGHT"),
        (["--size", "10x10"], "sides of 64 to 8000"),
        (["--size", "99999x100"], "sides of 64 to 8000"),
        (["-o", "picture.jpg"], "does not end in .png"),
        (["--set", "pattern.major.threshold=3"], "pattern.major.threshold = 3"),
    ],
)
def test_an_invalid_preview_option_is_refused_in_one_sentence(
    capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    assert told in refused(capsys, "preview", DOME_MODES, "--set", "surface.edge=0.9", *arguments)


def test_ranges_and_lists_expand_to_their_values() -> None:
    found = parse_variations(
        ["a.b=4:24:6", "a.c=0:1:5", "a.d=1,10,100", "e=plain,graded", "f=7:9:1", "g=0:10:4", "h=true,false"]
    )
    assert found["a.b"] == [4, 8, 12, 16, 20, 24]
    assert all(isinstance(value, int) for value in found["a.b"])
    assert found["a.c"] == [0, 0.25, 0.5, 0.75, 1]
    assert found["a.d"] == [1, 10, 100]
    assert found["e"] == ["plain", "graded"]
    assert found["f"] == [7]
    assert found["g"] == [0, 3.333, 6.667, 10]
    assert found["h"] == [True, False]
    for values in found.values():  # what is spelled reads back as the same value
        assert [parse_override(f"k={spelled_value(value)}")[1] for value in values] == values


def test_the_order_of_drawing_changes_early_stages_least() -> None:
    values = parse_variations(["pattern.major.phase=0,0.5", "diffusion.r=1,10", "statics.thickness=1,2"])
    listed = list(combinations(values))
    order = stage_order(listed)
    assert sorted(order) == list(range(8))
    ordered = [
        (listed[i]["statics.thickness"], listed[i]["diffusion.r"], listed[i]["pattern.major.phase"]) for i in order
    ]
    assert ordered == sorted(ordered)
    assert expected_seconds(values, {"surface": 100.0, "statics": 10.0, "diffusion": 1.0}, 0.5) == 100 + 20 + 4 + 4


def test_key_names_are_shortened_as_long_as_they_stay_distinct() -> None:
    keys = ["pattern.major.frequency", "pattern.minor.frequency", "diffusion.r", "pattern.keep"]
    assert list(short_names(keys).values()) == ["major.frequency", "minor.frequency", "r", "keep"]


@pytest.mark.parametrize(
    ("runs", "across"), [((6, 3), 3), ((3, 4, 2), 8), ((12,), 4), ((1,), 1), ((2, 50), 8), ((48,), 8)]
)
def test_rows_hold_whole_runs_of_the_fastest_keys(runs: tuple[int, ...], across: int) -> None:
    assert column_count(int(np.prod(runs)), runs) == across


def test_sizes_are_read_as_width_and_height() -> None:
    assert picture_size("1600x1200") == (1600, 1200)
    assert picture_size("3000X2000") == (3000, 2000)


def test_text_on_a_page_cannot_become_markup() -> None:
    tile = ContactTile(1, (("name", '"<b>"'),), "dsfab build '<i>'", None, "bad <script> & more")
    text = contact_page([tile], "<dome>", "a < b", 1)
    assert "<script>" not in text
    assert "<b>" not in text
    assert "<i>" not in text
    assert Page(text).open == []
    assert contact_sheet([tile], "<dome>", "a < b", 1, 300, 4 / 3, PAPER).size[0] >= 300


@pytest.mark.slow
def test_a_film_runs_forth_and_back_over_one_key(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    vary = ["--vary", "pattern.major.frequency=4,8,12", "--fps", "10", "-o", str(tmp_path)]
    for kind in ("gif", "webp"):
        assert run(capsys, "explore", DOME_MODES, *COARSE, *vary, "--animate", kind, "-q")[0] == 0
        with Image.open(tmp_path / f"dome_modes.{kind}") as film:
            assert film.n_frames == 4
            frames, long = [], []
            for place in range(4):
                film.seek(place)
                frames.append(np.asarray(film.convert("RGB")).astype(int))
                long.append(film.info["duration"])
        assert frames[0].shape[1] == 160
        assert frames[0].shape[0] > 120  # with a line below
        same = np.abs(frames[1] - frames[3]).mean()
        assert 2 * same < np.abs(frames[0][:120] - frames[1][:120]).mean()
        assert np.abs(frames[0][:120] - opened(tmp_path / "001.png")).mean() < 6
        assert long == [400, 100, 400, 100]


@pytest.mark.parametrize(
    ("more", "told"),
    [
        (
            ["--vary", "pattern.major.frequency=4,8", "--vary", "diffusion.r=1,10"],
            "needs exactly one key with several values",
        ),
        (["--vary", "pattern.major.frequency=4"], "but 0 keys have several"),
        (["--vary", "pattern.major.frequency=4,8", "--fps", "0"], "--fps 0 is not between"),
    ],
)
def test_a_film_that_makes_no_sense_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, more: list[str], told: str
) -> None:
    assert told in refused(capsys, "explore", DOME_MODES, *more, "--animate", "gif", "-o", str(tmp_path / "no"))


@pytest.mark.slow
def test_several_pictures_share_a_page(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    one, page = tmp_path / "one.png", tmp_path / "page.png"
    assert run(capsys, "preview", DOME_MODES, *COARSE, "--show", "major_mode", "-o", str(one), "-q") == (0, "", "")
    shown = ["--show", "modes,structure,utilisation"]
    code, _, err = run(capsys, "preview", DOME_MODES, *COARSE, *shown, "-o", str(page))
    assert code == 0
    assert "left out: utilisation: utilisation needs a strength" in err
    assert opened(page).shape == (120, 3 * 160, 3)
    assert np.array_equal(opened(page)[:, :160], opened(one))
    assert "nothing can be shown" in refused(
        capsys,
        "preview",
        DOME_MODES,
        *COARSE,
        "--show",
        "directions,utilisation",
        "--set",
        "diffusion.r=1",
        "-o",
        str(one),
    )


def test_the_option_all_shows_the_pictures_that_the_preset_can_give() -> None:
    plain, strong = load_preset(DOME_MODES), load_preset(DOME_MODES, {"statics.strength": 3e6})
    assert {"structure", "families", "loads", "stress", "displacement"} <= set(picture_names("all", plain))
    assert set(picture_names("all", strong)) - set(picture_names("all", plain)) == {"utilisation"}
    assert picture_names("deflection,displacement", plain) == ("displacement",)
    with pytest.raises(DsfabError, match="'beauty' is not known"):
        picture_names("structure,beauty", plain)


def test_transparent_ground_keeps_the_shadows(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = tmp_path / "clear.png"
    assert run(capsys, "preview", DOME_MODES, *COARSE, "--ground", "transparent", "-o", str(path), "-q")[0] == 0
    clear = opened(path).astype(int)
    assert clear.shape == (120, 160, 4)
    assert (clear[0, :, 3] == 0).all()
    shadow = (clear[:, :, 3] > 10) & (clear[:, :, 3] < 200)
    assert 0.02 < shadow.mean() < 0.6
    assert run(capsys, "preview", DOME_MODES, *COARSE, "--ground", "white", "-o", str(path), "-q")[0] == 0
    white = opened(path).astype(int)
    assert (white[0] == 255).all()
    over = clear[:, :, :3] * (clear[:, :, 3:] / 255) + 255 - clear[:, :, 3:]
    assert np.abs(over - white).mean() < 1.5  # laid on white it is the white one
    assert "ground 'lawn' is not known" in refused(capsys, "preview", DOME_MODES, *COARSE, "--ground", "lawn")


def test_reactions_are_a_layer(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    shown = {}
    for layers in ("none", "reactions", "all"):
        path = tmp_path / f"{layers}.png"
        code, _, err = run(capsys, "preview", DOME_MODES, *COARSE, "--layers", layers, "-o", str(path), "-q")
        assert code == 0, err
        picture = opened(path).astype(int)
        red, green, blue = (picture[:, :, k] for k in range(3))
        shown[layers] = int(((red - green > 30) & (blue - green > 30)).sum())  # purple
    assert shown["none"] == 0
    assert min(shown["reactions"], shown["all"]) > 20
    assert "--layers 'birds' is unknown" in refused(capsys, "preview", DOME_MODES, "--layers", "loads,birds")


@pytest.mark.slow
def test_load_arrows_appear_only_on_the_picture_of_the_loads(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    blue = {}
    given: dict[str, tuple[str, ...]] = {"default": (), "asked": ("--layers", "loads")}
    for name, options in given.items():
        path = tmp_path / f"{name}.png"
        shown = "--show", "loads,structure"
        code, _, err = run(capsys, "preview", "dome", *COARSE, *shown, *options, "-o", str(path), "-q")
        assert code == 0, err
        picture = opened(path).astype(int)
        arrow = picture[:, :, 2] - picture[:, :, 0] > 60
        blue[name] = [int(half.sum()) for half in np.split(arrow, 2, axis=1)]
    assert blue["default"][0] > 50
    assert blue["default"][1] == 0
    assert min(blue["asked"]) > 50


def test_a_watched_preset_is_drawn_again_when_it_is_saved_and_errors_are_printed(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, path = tmp_path / "mine.toml", tmp_path / "mine.png"
    good = preset_toml(load_preset(DOME_MODES, {"surface.edge": 0.9}))
    steps = iter(
        [
            lambda: file.write_text(good.replace("frequency = ", "frequenzy = ", 1)),
            lambda: None,  # nothing new: nothing is drawn
            file.unlink,
            lambda: file.write_text(good.replace("keep = 0.35", "keep = 0.9")),
        ]
    )
    sizes: list[bytes] = []

    def wait(_: float) -> None:
        sizes.append(path.read_bytes())
        step = next(steps, None)
        if step is None:
            raise KeyboardInterrupt
        step()

    monkeypatch.setattr(time, "sleep", wait)
    file.write_text(good)
    code, out, err = run(capsys, "preview", str(file), "--watch", "--size", "160x120", "-o", str(path))
    assert code == 0
    assert out.count("mine.png") == 2
    assert err.count("did you mean frequency?") == 1
    assert "Traceback" not in err
    assert sizes[0] == sizes[1] == sizes[2] == sizes[3]
    assert ("keep = 0.35" in good) == (sizes[4] != sizes[0])
    monkeypatch.undo()
    assert "--watch needs a file" in refused(capsys, "preview", "dome", "--watch")


def test_a_narrow_label_shortens_names_before_values():
    from PIL import ImageFont

    tile = ContactTile(1, (("major.frequency", "5.143"), ("minor.frequency", "11")), "dsfab build", None)
    font = ImageFont.load_default(size=17)
    for room in (500, 330, 230, 170):
        text = tile_label(tile, room, font)
        assert "5.143" in text
        assert text.endswith(" 11")
        assert font.getlength(text) <= room
    assert tile_label(tile, 500, font) == "major.frequency 5.143   minor.frequency 11"
    assert tile_label(tile, 50, font).endswith("...")
