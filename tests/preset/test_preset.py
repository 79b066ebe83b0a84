"""Presets: shipped ones, round trip, overrides, and one sentence for every mistake."""

import subprocess
import sys
import tomllib
from itertools import pairwise
from pathlib import Path

import pytest
import tomli_w

from dsfab import run
from dsfab.app.editor.workspace import open_preset
from dsfab.core.errors import DsfabError, PresetError
from dsfab.core.materials import KEYS, MATERIALS, STOCK
from dsfab.core.toml_files import PRESETS, preset_headline, shipped_presets
from dsfab.design.output.archive import sections
from dsfab.preset.file import load_preset, parse_override, preset_from, preset_toml, require_mesh, with_overrides
from dsfab.preset.model import STAGES, Preset
from dsfab.preset.surface_section import FileSurface

SHIPPED = sorted(shipped_presets())


def test_preset_names_are_unique_over_all_folders():
    files = [path.stem for folder in PRESETS for path in folder.glob("*.toml")]
    assert sorted(files) == SHIPPED
    assert {path.parent.name for path in shipped_presets().values()} == {"presets", "paper"}


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_presets_are_valid_described_and_named_after_their_file(name):
    preset = load_preset(name)
    assert preset.name == name
    assert len(preset.description) > 20
    assert preset_headline(shipped_presets()[name]) == preset.description.split("\n")[0]
    text = shipped_presets()[name].read_text(encoding="utf-8")
    sections = [line.strip("[]").split(".")[0] for line in text.splitlines() if line.startswith("[")]
    order = [(*STAGES, "sizing", "workshop", "eurocode").index(section) for section in sections]
    assert order == sorted(order), "sections stand in the order of the stages, the workshop and the checks last"


@pytest.mark.parametrize("name", SHIPPED)
def test_a_complete_preset_written_and_read_again_is_the_same(name, tmp_path):
    preset = load_preset(name)
    file = tmp_path / "again.toml"
    file.write_text(preset_toml(preset), encoding="utf-8")
    again = load_preset(file)
    assert again == preset
    assert again.first_difference(preset) is None
    written = tomllib.loads(file.read_text())
    assert set(written) == {"name", "description", "fabrication", "sizing", "workshop", "eurocode", *STAGES}, (
        "defaults are written out"
    )


def test_short_lists_are_written_on_one_line(tmp_path):
    """A box of two corners was ten lines of a design's preset, and four feet of it were a page of its report."""
    box = {"pick": "box", "min": [-1.5, 0, 1e-9], "max": [1, 2.25, 3], "boundary": True}
    text = preset_toml(
        load_preset("dome", {"surface.support": [{"at": box}], "export.formats": ["stl", "3mf"]}), for_people=True
    )
    assert "\nmin = [-1.5, 0.0, 1e-09]\n" in text
    assert '\nformats = ["stl", "3mf"]\n' in text
    (tmp_path / "again.toml").write_text(text)
    assert preset_toml(load_preset(tmp_path / "again.toml")) == text
    odd = {"a": ['x, "]', "y\\"], "b": [[1.0, 2.0], [3.0, 4.0]], "c": [10**12] * 9, "d": []}
    from dsfab.preset.file import short_lists

    written = short_lists(tomli_w.dumps(odd))
    assert tomllib.loads(written) == odd
    assert written.splitlines()[1:4] == ["b = [", "    [1.0, 2.0],", "    [3.0, 4.0],"]
    assert max(map(len, written.splitlines())) < 100


def test_a_folder_that_was_built_is_its_preset(tmp_path):
    (tmp_path / "preset.toml").write_text(preset_toml(load_preset("dome")))
    assert load_preset(tmp_path) == load_preset("dome")


def test_a_shipped_preset_by_path_is_the_one_by_name():
    assert load_preset(shipped_presets()["dome"]) == load_preset("dome")


@pytest.mark.parametrize(
    ("changes", "stage"),
    [
        ({"surface.span": 11}, "surface"),
        ({"surface.load.1.force": [0, 0, -1]}, "surface"),
        ({"statics.thickness": 0.05}, "statics"),
        ({"diffusion.gamma": 2, "pattern.minor.mode": 2}, "diffusion"),
        ({"pattern.major.threshold": 0.2}, "pattern"),
        ({"slicing.pinch": "split"}, "slicing"),
        ({"export.formats": ["stl"]}, "export"),
        ({"description": "another"}, None),
    ],
)
def test_the_first_section_that_differs_is_found(changes, stage):
    assert load_preset("dome", changes).first_difference(load_preset("dome")) == stage


@pytest.mark.parametrize(
    ("text", "pair"),
    [
        ("pattern.major.frequency=12", ("pattern.major.frequency", 12)),
        ("a.b = [0, 1.5]", ("a.b", [0, 1.5])),
        ("statics.law=stvk", ("statics.law", "stvk")),
        ('statics.law="stvk"', ("statics.law", "stvk")),
        ("x=-1e3", ("x", -1000.0)),
        ("x=a=b", ("x", "a=b")),
    ],
)
def test_overrides_are_toml_values_or_bare_words(text, pair):
    assert parse_override(text) == pair


@pytest.mark.parametrize("text", ["pattern.major.frequency", "=3", ""])
def test_overrides_without_key_or_value_are_refused(text):
    with pytest.raises(PresetError, match="is not KEY=VALUE; write for instance --set pattern"):
        parse_override(text)


def test_a_mesh_takes_the_place_of_a_shape_and_keeps_supports_and_loads(tmp_path):
    preset = load_preset("dome", {"surface.unit": "mm"}, mesh=tmp_path / "roof.obj")
    assert isinstance(preset.surface, FileSurface)
    assert preset.surface.file == tmp_path / "roof.obj"
    assert preset.surface.unit == "mm"
    assert preset.surface.support == load_preset("dome").surface.support
    assert preset.surface.load == load_preset("dome").surface.load


def test_a_relative_mesh_path_starts_at_the_folder_of_the_preset(tmp_path):
    (tmp_path / "mine.toml").write_text(shipped_presets()["figurine"].read_text())
    assert load_preset(tmp_path / "mine.toml").surface.file == tmp_path / "bob.obj"


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"pattern.guide": 1}, r"pattern\.guide = 1: should be a list"),
        ({"pattern.major.frequncy": 3}, r"unknown key pattern\.major\.frequncy; did you mean frequency\? \("),
        ({"pattern.major.frequency": -3}, r"pattern\.major\.frequency = -3: should be greater than or equal to 0"),
        ({"pattern.major.threshold": 1.5}, r"pattern\.major\.threshold = 1\.5: should be less than or equal to 1"),
        ({"pattern.minor.mode": 0}, r"pattern\.minor\.mode = 0: should be greater than or equal to 1"),
        ({"pattern.major.frequency": float("nan")}, r"pattern\.major\.frequency = nan: should be a finite number"),
        (
            {"surface.shape": "dom"},
            r"surface\.shape = 'dom' is not known; did you mean dome\?; use one of .*sphere.*, or a file",
        ),
        (
            {"surface.raduis": 3},
            r"unknown key surface\.raduis.*known here: support, load, combination, .*refine, smooth, shape, span",
        ),
        ({"surface.span": -1}, r"surface\.span = -1: should be greater than 0"),
        ({"statics.law": "plane_stres"}, r"statics\.law = 'plane_stres': should be .*; did you mean plane_stress\?"),
        ({"statics.thickness": "thick"}, r"statics\.thickness: 'thick' is neither a number of metres nor auto"),
        (
            {"statics.material": "GL24"},
            r"statics\.material: 'GL24' is not known; did you mean GL24h\?; use one of S235, .*, PLA, or leave "
            r"material out",
        ),
        ({"statics.material": 3}, r"statics\.material = 3: should be a valid string"),
        ({"statics.young": 11}, r"statics\.young: 11 Pa is too small for a stiffness; write 11e9 for 11 GPa"),
        ({"statics.young": 210000}, r"too small for a stiffness; write 210000e6 for 210000 MPa"),
        (
            {"statics.density": 7.85},
            r"statics\.density: 7\.85 kg/m3 is too little for a solid; write 7850 if you mean 7\.85 t/m3",
        ),
        ({"statics.strength": 235}, r"statics\.strength: 235 Pa is too small for a strength; write 235e6 for 235 MPa"),
        ({"statics.poisson": 0.5}, r"statics\.poisson = 0\.5: should be less than 0\.5"),
        ({"diffusion.r": 0.5}, r"diffusion\.r = 0\.5: should be greater than or equal to 1"),
        (
            {"surface.load.1.kind": "forse"},
            r"surface\.load\.1\.kind = 'forse' is not known; did you mean force\?; use one of force, pressure",
        ),
        (
            {"surface.load.1.strength": 3},
            r"unknown key surface\.load\.1\.strength \(known here: at, force, kind, case, name\)",
        ),
        ({"surface.support.0.at.pick": "bxo"}, r"support\.0\.at\.pick = 'bxo' is not known; did you mean box\?"),
        ({"surface.support.0.at": {"axis": "z"}}, r"support\.0\.at needs pick = \.\.\.: use one of all, box"),
        ({"surface.support.0.at.axxis": "z"}, r"unknown key surface\.support\.0\.at\.axxis"),
        (
            {"surface.support.0.at": {"pick": "ball", "center": [0, 0, 0]}},
            r"surface\.support\.0\.at\.radius is missing",
        ),
        ({"surface.support.0.hold": "zz"}, r"surface\.support\.0\.hold = 'zz'"),
        ({"surfce.x": 3}, r"unknown key surfce; did you mean surface\?"),
        ({"pattern.major": 3}, r"pattern\.major = 3"),
        ({"surface.load.5.force": [0, 0, 1]}, r"'5' is not the number of an entry in this list; use 0 to 1"),
        ({"name.x": 1}, r"--set name\.x: name holds a value and is not a section"),
        ({"name.x.y": 1}, r"--set name\.x\.y: the key before 'x' holds a value and is not a section"),
        ({"name": "../up"}, r"name = '\.\./up'"),
        ({"export.formats": ["stp"]}, r"export\.formats\.0 = 'stp': .*did you mean step\?"),
        ({"statics": {}}, r"statics\.thickness is missing"),
        ({"surface": {}}, r"surface needs shape = \.\.\.: use one of plate.*, or a file"),
    ],
)
def test_invalid_values_are_refused_with_key_value_range_and_nearest_name(changes, says):
    with pytest.raises(PresetError, match=says) as caught:
        load_preset("dome", changes)
    assert "\n" not in str(caught.value)


def test_all_invalid_keys_of_a_preset_are_reported_at_once():
    with pytest.raises(PresetError) as caught:
        load_preset("dome", {"pattern.major.frequency": -3, "statics.young": 0, "colour": "red"})
    for key in ("pattern.major.frequency", "statics.young", "unknown key colour"):
        assert key in str(caught.value)


@pytest.mark.parametrize(
    ("write", "says"),
    [
        (lambda p: p.write_text("name = 'x"), "is not valid TOML"),
        (lambda p: p.write_text("a = " + "[" * 100_000), "is not valid TOML: the tables are nested too deeply"),
        (lambda p: p.write_text("a" + ".a" * 5_000 + " = 1"), "is not valid TOML: the tables are nested too deeply"),
        (lambda p: p.write_text("a = " + "9" * 5000), "is not valid TOML: a number has too many digits"),
        (lambda p: p.write_bytes(b"\xff\xfe\x00rubbish"), "is not a text file"),
        (lambda p: p.mkdir(), "is a folder; give a preset file or one of"),
        (lambda p: None, "not found"),
    ],
)
def test_unreadable_preset_files_are_refused(write, says, tmp_path):
    path = tmp_path / "odd.toml"
    write(path)
    with pytest.raises(PresetError, match=says):
        load_preset(path)


def test_a_preset_may_begin_with_a_byte_order_mark(tmp_path):
    """As Windows writes it: what is an invalid statement to Python's reader."""
    path = tmp_path / "mine.toml"
    path.write_bytes(b"\xef\xbb\xbf" + shipped_presets()["dome"].read_bytes())
    assert load_preset(path).surface == load_preset("dome").surface


def test_a_preset_that_needs_a_mesh_is_refused_until_the_mesh_file_exists(tmp_path, monkeypatch):
    (tmp_path / "roof.toml").write_text(shipped_presets()["roof"].read_text(encoding="utf-8"), encoding="utf-8")
    for part in ("core.toml_files", "preset.surface_section"):
        monkeypatch.setattr(f"dsfab.{part}.PRESETS", (tmp_path,))
    with pytest.raises(PresetError, match="preset roof needs your mesh: add --mesh FILE"):
        require_mesh(load_preset("roof"))
    with pytest.raises(PresetError, match=r'in place of roof\.obj: write dsfab\.load_preset\(name, mesh="FILE"\)'):
        run(load_preset("roof"))
    with pytest.raises(PresetError, match="preset roof needs your mesh"):
        open_preset("roof")
    (tmp_path / "roof.obj").write_text("a mesh")
    require_mesh(load_preset("roof"))


def test_surfaces_are_derived_with_the_preset_alone():
    """Twenty shapes of which each derives supports and loads of its own take longer than all else of the import."""
    code = (
        "from dsfab.preset.surface_section import SHAPE_SECTIONS as s, FileSurface, MeshSurface;"
        "from dsfab.preset.file import load_preset; load_preset('dome');"
        "every = (*s.values(), FileSurface, MeshSurface);"
        "print(sum(m.__pydantic_complete__ for m in every), s['dome'](span=3.0).span)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0", "3.0"]


def test_an_unknown_preset_name_suggests_the_nearest_name():
    with pytest.raises(PresetError, match="did you mean dome"):
        load_preset("dom")


def test_the_face_budget_of_presets_is_that_of_write():
    from dsfab.export import STEP_FACES

    assert load_preset("dome").export.step_faces == STEP_FACES


def test_presets_are_values():
    preset = load_preset("dome")
    with pytest.raises(ValueError, match="frozen"):
        preset.pattern.major.frequency = 3
    assert issubclass(PresetError, DsfabError)
    assert preset_from(preset.model_dump(mode="json", exclude_none=True)) == preset
    assert isinstance(preset, Preset)
    assert Path(shipped_presets()["dome"]).suffix == ".toml"


# --- materials by name


@pytest.mark.parametrize("name", MATERIALS)
def test_a_material_fills_its_values_and_names_its_source(name):
    statics = load_preset("dome", {"statics.material": name.upper()}).statics
    one = MATERIALS[name]
    assert statics.material == name
    assert (statics.young, statics.poisson, statics.density, statics.strength) == tuple(one.values.values())
    assert 1e9 < one.young < 1e12
    assert 0 < one.poisson < 0.5
    assert 300 < one.density < 9000
    assert 1e6 < one.strength < 1e9
    assert 1e-6 < one.expansion < 1e-4
    assert one.source
    assert one.says


DESIGN = {"GL24h": 19.2 * 0.8 / 1.25, "CLT": 14.5 / 2 * 0.8 / 1.25, "plywood": 37.5 * 0.8 / 1.2, "PLA": 50 / 2.5}
DESIGN |= {"aluminium 6082": 240 / 1.1, "concrete C30/37": 30 / 1.5, "GFRP": 170 / 3, "S235": 235, "S355": 355}
DESIGN |= {"S275": 275, "S460": 460, "C24": 14.5 * 0.8 / 1.3, "C30": 19 * 0.8 / 1.3, "LVL 48 P": 35 * 0.8 / 1.2}
DESIGN |= {"GL28h": 22.3 * 0.8 / 1.25, "GL32h": 25.6 * 0.8 / 1.25}


def test_design_strengths_are_characteristic_ones_over_partial_factors():
    assert DESIGN.keys() == MATERIALS.keys()
    for name, megapascals in DESIGN.items():
        assert MATERIALS[name].strength == pytest.approx(megapascals * 1e6, rel=0.01)


def test_every_material_has_a_stock_of_thicknesses_with_its_source():
    assert set(STOCK) == set(MATERIALS)
    for stock in STOCK.values():
        assert list(stock.millimetres) == sorted(set(stock.millimetres))
        assert stock.source
        assert max(b / a for a, b in pairwise(stock.millimetres)) <= 1.7, "a larger step would waste material"
        assert stock.metres[0] == stock.millimetres[0] / 1000


def test_a_thickness_may_be_left_to_sizing(tmp_path):
    preset = load_preset("dome", {"statics.thickness": "auto", "sizing.thicknesses": [0.04, 0.06]})
    assert not preset.statics.is_sized
    (tmp_path / "auto.toml").write_text(preset_toml(preset), encoding="utf-8")
    assert 'thickness = "auto"' in preset_toml(preset)
    assert load_preset(tmp_path / "auto.toml") == preset
    assert with_overrides(preset, {"statics.thickness": 0.05}).statics.is_sized
    with pytest.raises(PresetError, match=r"preset dome: statics\.thickness = 'auto' is not a number yet; give metres"):
        run(preset)


def test_own_values_override_a_material_and_a_new_material_resets_them():
    heavy = load_preset("dome", {"statics.material": "S355", "statics.density": 8000.0, "statics.strength": 0})
    assert (heavy.statics.young, heavy.statics.density, heavy.statics.strength) == (210e9, 8000.0, 0.0)
    assert heavy.statics.material_words == "S355, but for density, strength"
    timber = with_overrides(heavy, {"statics.material": "clt"}).statics  # though the preset says young = 210e9
    assert {key: getattr(timber, key) for key in KEYS} == MATERIALS["CLT"].values
    assert timber.material_words == "CLT"
    assert load_preset("barrel_vault").statics.material_words == ""


def test_a_written_preset_holds_the_material_and_only_changed_values(tmp_path):
    heavy = load_preset("dome", {"statics.material": "S355", "statics.density": 8000.0})
    (tmp_path / "again.toml").write_text(preset_toml(heavy), encoding="utf-8")
    written = tomllib.loads(preset_toml(heavy))["statics"]
    assert (written["material"], written["density"]) == ("S355", 8000.0)
    assert not {"young", "poisson", "strength"} & set(written)
    assert load_preset(tmp_path / "again.toml").statics.model_dump() == heavy.statics.model_dump()


def test_a_material_named_or_spelled_out_is_the_same_design():
    named = load_preset("barrel_vault", {"statics.material": "S235"})
    spelled = load_preset("barrel_vault", {f"statics.{key}": value for key, value in MATERIALS["S235"].values.items()})
    assert named.first_difference(spelled) is None
    assert named.statics == spelled.statics
    assert hash(named.statics) == hash(spelled.statics)
    assert named.statics != load_preset("barrel_vault", {"statics.material": "S355"}).statics  # that is stronger
    assert named.statics != "S235"
    assert sections(named) == sections(spelled), "what a folder keeps of one is not made again for the other"


def test_a_frequency_of_zero_may_be_a_text():
    """Found by the fuzzer: "0" was taken for a frequency, so that the preset was accepted, and refused once written."""
    with pytest.raises(PresetError, match="give either frequency or spacing"):
        load_preset("dome", {"pattern.major.frequency": "0", "pattern.major.spacing": 0.0})
    asked = load_preset("dome", {"pattern.major.frequency": "0", "pattern.major.spacing": "0.5"})
    assert (asked.pattern.major.frequency, asked.pattern.major.spacing) == (0.0, 0.5)
