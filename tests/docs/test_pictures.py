"""Every picture of the README and of the site is made by `docs/_build/make.py`, and what is quick of it runs here."""

import re
import shutil
from pathlib import Path

import pytest

import dsfab
from docs._build import make, wires
from docs._build.drawings import CONCEPTS
from dsfab.app.hops.components import COMPONENTS
from dsfab.core.toml_files import shipped_presets
from dsfab.render.light import QUICK
from dsfab.render.picture import StructurePicture
from tests.bad_meshes import obj
from tests.designs import rough_presets
from tests.shapes import grid

ROOT = Path(__file__).resolve().parents[2]
MEDIA, OWN = ROOT / "docs" / "media", ROOT / "docs" / "examples"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def test_pictures_and_scripts_of_pictures_correspond():
    made = {MEDIA / file for name in make.MAKERS for file in make.files(name)}
    assert made == {path for path in MEDIA.rglob("*") if path.is_file()}


def test_pictures_stay_small():
    """Whoever clones the repository takes them all."""
    assert sum(path.stat().st_size for path in MEDIA.rglob("*") if path.is_file()) < 4e6


def test_pages_show_nothing_else():
    """But drawings of the paper's page, which `dsfab reproduce` makes."""
    shown = {
        (page.parent / target).resolve()
        for page in PAGES
        for target in re.findall(r"!\[[^]]*\]\(([^)]+\.webp)\)", page.read_text(encoding="utf-8"))
    }
    assert {path for path in shown if MEDIA not in path.parents} == set()
    assert shown <= set(MEDIA.rglob("*.webp"))
    assert len(shown) > 30


@pytest.mark.parametrize("name", [name for name in make.DESIGNS if name != "figurine"])
def test_the_input_files_of_each_gallery_design_exist(name):
    """Built are most of them elsewhere; here each is at least read, as `make` reads it. Bob's mesh lies apart."""
    preset, changes = make.DESIGNS[name]
    given = dsfab.preset_for(preset) if Path(preset).suffix == ".obj" else dsfab.load_preset(preset, changes)
    assert given.statics.thickness > 0


def test_the_caption_of_each_option_names_all_changed_keys():
    """Each is a preset, none is another one, and its words name every key that was changed, or the method."""
    presets = {words: dsfab.load_preset("dome", changes) for words, changes in make.OPTIONS.items()}
    assert len({preset.model_dump_json() for preset in presets.values()}) == len(make.OPTIONS) == 6
    for words, changes in make.OPTIONS.items():
        assert not changes or any(key in words for key in changes), words


def test_every_drawing_of_the_concepts_is_shown():
    page = (ROOT / "docs" / "concepts.md").read_text(encoding="utf-8")
    assert set(re.findall(r"concepts/(\w+)\.webp", page)) == set(CONCEPTS)


APART, ROUGHER = 3.0, 4.0
"""Times the distance of members and the edges of triangles in small pictures."""


@pytest.fixture(scope="module")
def rough(tmp_path_factory):
    """The presets of the gallery, beside the mesh that one of them names, and those that ship, on coarser meshes."""
    folder = tmp_path_factory.mktemp("gallery")
    shutil.copy(OWN / "canopy.obj", folder)
    (folder / "presets").mkdir()
    rough_presets(folder / "presets", shipped_presets().values(), APART, ROUGHER)
    return rough_presets(folder, (OWN / f"{name}.toml" for name in make.OURS), APART, ROUGHER)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*make.OURS, "options", "guides"])
def test_pictures_of_designs_are_drawn_small(name, rough, rough_shares, tmp_path, monkeypatch):
    """Those whose commands run nowhere else: a command of a picture that fails fails here."""
    monkeypatch.setattr(make, "MEDIA", tmp_path)
    monkeypatch.setattr(StructurePicture.render, "__defaults__", (QUICK,))
    for size in ("PANEL", "WHOLE", "OPTION", "GUIDED"):
        monkeypatch.setattr(make, size, (120, 90))
    monkeypatch.setattr(make, "DESIGNS", {key: (rough / f"{key}.toml", {}) for key in make.OURS})
    monkeypatch.setattr(make, "CANOPY", rough / "canopy.toml")
    monkeypatch.setattr("dsfab.core.toml_files.PRESETS", (rough / "presets",))
    make.MAKERS[name](name)
    assert {path.name for path in tmp_path.glob("*.webp")} == set(make.files(name))


@pytest.mark.slow
@pytest.mark.parametrize("name", CONCEPTS)
def test_a_drawing_of_a_concept_is_made_from_a_design(name, tmp_path, monkeypatch):
    monkeypatch.setattr(make, "MEDIA", tmp_path)
    (tmp_path / "concepts").mkdir()
    make.MAKERS[name](name)
    assert (tmp_path / "concepts" / f"{name}.webp").stat().st_size > 5000


@pytest.mark.slow
def test_the_grasshopper_canvas_shows_all_sockets_and_answers(tmp_path, monkeypatch):
    monkeypatch.setattr(StructurePicture.render, "__defaults__", (QUICK,))
    plate = grid(12, 12, 4.0, 4.0)
    (tmp_path / "plate.obj").write_bytes(obj(plate.V, plate.F))
    canvas = wires.drawn(tmp_path / "plate.obj")
    told = [text.get_text() for text in canvas.axes[0].texts]
    one = COMPONENTS["structure"]
    assert {each.name for each in (*one.inputs, *one.outputs)} <= set(told)
    assert f"Mesh   {len(plate.F)} triangles" in told
    (mass,) = (float(words[:-2]) for words in told if words.endswith(" t"))
    assert mass > 0
    assert len(canvas.axes[1].images) == 1
