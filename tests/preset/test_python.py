"""Presets made in Python: of meshes in memory, with the checks and the words of TOML, saved and built again."""

import pickle
import tomllib
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh

import dsfab
from dsfab.app.cli import main
from dsfab.app.editor.workspace import OpenedPreset
from dsfab.core.errors import DsfabError, PresetError, SurfaceError
from dsfab.design.output.archive import MESH, read_archive
from dsfab.preset.file import preset_from, preset_toml, with_overrides
from dsfab.preset.surface_section import FileSurface, MeshSurface
from dsfab.surface import SHAPES, Surface
from tests.shapes import ZOO

HYPAR = SHAPES["hypar"](side=6.0, rise=2.0, edge=0.5)
GIVEN: dict[str, Any] = {
    "supports": [dsfab.Support(dsfab.Boundary())],
    "loads": [dsfab.SelfWeight(), dsfab.Snow(800.0)],
    "statics": dsfab.Statics(thickness=0.05),
}
PATTERN = {"keep": 0.2, "rim": 0.2, "major": {"spacing": 1.0}, "minor": {"spacing": 1.0}, "method": "stripes"}
TABLES: dict[str, Any] = {
    "support": [{"at": {"pick": "boundary"}}],
    "load": [{"kind": "self_weight"}, {"kind": "snow", "pressure": 800.0}],
}
"""`GIVEN` as TOML has it."""


def preset(surface: Any, **changes: Any) -> dsfab.Preset:
    return dsfab.Preset(surface=surface, **{**GIVEN, **changes})


SURFACES: dict[str, Callable[[], Any]] = {
    "Surface": lambda: HYPAR,
    "trimesh": HYPAR.to_trimesh,
    "pyvista": HYPAR.to_pyvista,
    "compas": lambda: SimpleNamespace(to_vertices_and_faces=lambda: (HYPAR.V.tolist(), HYPAR.F.tolist())),
    "(V, F)": lambda: (HYPAR.V, HYPAR.F),
    "a table": lambda: {"mesh": HYPAR.to_trimesh()},
    "a section": lambda: preset((HYPAR.V, HYPAR.F)).surface,
}


@pytest.mark.parametrize("kind", SURFACES)
def test_every_mesh_in_memory_makes_the_same_preset(kind: str) -> None:
    made = preset(SURFACES[kind]())
    assert made == preset(HYPAR)
    assert isinstance(made.surface, MeshSurface)
    assert np.array_equal(made.surface.build().V, HYPAR.V)
    assert np.array_equal(made.surface.build().F, HYPAR.F)
    other = HYPAR.V.copy()
    other[0, 2] += 1e-12
    assert preset((other, HYPAR.F)).first_difference(made) == "surface"


def test_objects_tables_and_toml_are_the_same_preset() -> None:
    shape = {"shape": "hypar", "side": 6.0, "rise": 2.0, "edge": 0.5}
    read = preset_from({"name": "design", "surface": shape | TABLES, "statics": {"thickness": 0.05}})
    assert preset(shape) == read
    assert preset(shape, supports=TABLES["support"], loads=TABLES["load"], statics={"thickness": 0.05}) == read
    assert dsfab.Preset(surface=read.surface, statics=read.statics) == read
    assert preset({**shape, "load": [{"kind": "wind"}]}) == read  # what is given beside the surface takes its place


def test_a_path_starts_at_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    HYPAR.to_trimesh().export("roof.obj")
    for surface in ("roof.obj", Path("roof.obj"), {"file": "roof.obj"}):
        made = preset(surface)
        assert isinstance(made.surface, FileSurface)
        assert made.surface.file == tmp_path / "roof.obj"
        assert made.surface.build().m == HYPAR.m


def test_a_mesh_in_memory_is_checked_as_one_of_a_file_is() -> None:
    unused = np.vstack([HYPAR.V[:1] + 50, HYPAR.V])
    made = preset((unused, HYPAR.F + 1)).surface.build()
    assert np.array_equal(made.V, HYPAR.V)
    turned = HYPAR.F.copy()
    turned[3] = turned[3][::-1]
    assert (preset(Surface(HYPAR.V, turned)).surface.build().normals[:, 2] > 0).all()
    with pytest.raises(SurfaceError, match="1 edge has more than two faces"):
        preset(Surface(np.vstack([np.zeros(3), np.eye(3), [[0, -1, 0]]]), [[0, 1, 2], [0, 1, 3], [1, 0, 4]]))


def test_overrides_and_text_keep_every_bit_of_the_mesh() -> None:
    made = preset((HYPAR.V / 3, HYPAR.F))
    again = preset_from(tomllib.loads(preset_toml(made)))
    assert again == made
    finer = with_overrides(made, {"surface.refine": 0.1})
    assert finer.surface.build().m > made.surface.build().m
    assert with_overrides(finer, {"surface.refine": 0.0}) == made
    assert f"Python mesh: {HYPAR.n} vertices" in preset_toml(made, for_people=True)


BALL = {"pick": "ball", "center": [0, 0]}


@pytest.mark.parametrize(
    ("wrong", "table"),
    [
        ({"supports": [dsfab.Support(dsfab.Ball((0, 0), 1))]}, {"support": [{"at": {**BALL, "radius": 1}}]}),
        ({"supports": [{"at": BALL}]}, {"support": [{"at": BALL}]}),
        ({"supports": [dsfab.Support("rim")]}, {"support": [{"at": "rim"}]}),
        ({"supports": [{"at": {"pick": "al"}}]}, {"support": [{"at": {"pick": "al"}}]}),
        ({"loads": [dsfab.Snow("much")]}, {"load": [{"kind": "snow", "pressure": "much"}]}),
        ({"loads": [dsfab.Snow(float("nan"))]}, {"load": [{"kind": "snow", "pressure": float("nan")}]}),
        ({"loads": [{"kind": "snw"}]}, {"load": [{"kind": "snw"}]}),
        ({"loads": 3}, {"load": 3}),
        (
            {"combinations": [dsfab.Combination("uls", {"x": 1})]},
            {"combination": [{"name": "uls", "factors": {"x": 1}}]},
        ),
    ],
)
def test_errors_of_python_arguments_use_the_keys_of_toml(wrong: dict[str, Any], table: dict[str, Any]) -> None:
    shape = {"shape": "hypar", "edge": 1.0}
    with pytest.raises(PresetError) as read:
        preset_from({"name": "design", "surface": shape | TABLES | table, "statics": {"thickness": 0.05}})
    with pytest.raises(PresetError) as made:
        preset(shape, **wrong)
    assert "surface." in str(made.value)
    unstated = [text for text in str(made.value).split("; ") if text not in str(read.value)]
    assert not [text for text in unstated if "'hold': 'xyz'" not in text], (str(made.value), str(read.value))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: preset(HYPAR, pattern={"mayor": {}}), r"unknown key pattern\.mayor; did you mean major\?"),
        (lambda: preset(HYPAR, statics={}), r"statics\.thickness is missing"),
        (lambda: dsfab.Preset(supports=[]), "surface is missing; statics is missing"),
        (
            lambda: preset({"mesh": HYPAR, "side": 1}),
            r"unknown key surface\.side \(known here: .*refine, smooth, edge, finest, finest_at, mesh",
        ),
        (lambda: preset({"mesh": "AAAA"}), r"surface\.mesh: dsfab cannot read the text of this mesh"),
        (
            lambda: preset(HYPAR, supports=[dsfab.Support("rim")]),
            r"support\.0\.at needs pick = \.\.\.: use one of all, box",
        ),
        (lambda: dsfab.Statics(thickness=-1), r"^statics: thickness = -1: should be greater than 0$"),
        (lambda: preset_from({"supports": []}), "unknown key supports"),
        (lambda: preset(3), "an object of type int is not a mesh"),
        (lambda: preset((HYPAR.V * np.nan, HYPAR.F)), "vertices are not finite"),
        (lambda: dsfab.run(preset("nowhere.obj")), "nowhere.obj does not exist; check the path"),
        (
            lambda: dsfab.run(preset((HYPAR.V * 1000, HYPAR.F))),
            r'check the unit \(dsfab\.Surface\.of\(mesh, "mm"\) for millimetres\) and statics\.thickness',
        ),
        (lambda: dsfab.run(preset(two_roofs(), supports=[dsfab.Support(dsfab.Side("x", "min", 1.0))])), "no support"),
    ],
)
def test_invalid_arguments_are_refused_in_one_sentence(make: Callable[[], object], says: str) -> None:
    with pytest.raises(DsfabError, match=says) as caught:
        make()
    assert "\n" not in str(caught.value)


def two_roofs() -> trimesh.Trimesh:
    """Two pieces, 20 m apart."""
    roof = HYPAR.to_trimesh()
    return trimesh.util.concatenate([roof, roof.copy().apply_translation([20, 0, 0])])


@pytest.mark.parametrize("thing", [HYPAR, HYPAR.to_trimesh(), HYPAR.to_pyvista(), (HYPAR.V, HYPAR.F), "roof.obj"])
def test_a_preset_of_a_mesh_alone_lists_the_missing_sections(thing: Any) -> None:
    with pytest.raises(
        PresetError, match="supports, loads and a thickness are missing; let dsfab propose them"
    ) as caught:
        dsfab.run(thing)
    example = str(caught.value).partition("for instance ")[2]
    design = eval(example, {"dsfab": dsfab, "mesh": SHAPES["dome"](span=8.0, edge=0.4)})
    assert design.solid.pieces >= 1


def test_a_preset_name_instead_of_a_preset_gives_advice() -> None:
    with pytest.raises(PresetError, match=r"dsfab\.run\(dsfab\.load_preset\('dome'\)\)"):
        dsfab.revise(dsfab.Design(preset(HYPAR)), "dome")
    with pytest.raises(PresetError, match=r"dsfab\.run\(dsfab\.load_preset\('dome'\)\)"):
        dsfab.sweep("dome", {"pattern.keep": [0.1]})


def test_the_editor_of_a_notebook_takes_a_mesh_in_a_preset_only() -> None:
    with pytest.raises(PresetError, match="supports, loads and a thickness are missing"):
        dsfab.edit(HYPAR)
    page = OpenedPreset(preset(HYPAR))
    assert page.open_toml(page.toml({})).preset == page.preset


@pytest.mark.slow
def test_a_saved_design_builds_again_with_the_command_line(tmp_path: Path) -> None:
    mesh = trimesh.Trimesh(HYPAR.V / 0.9, HYPAR.F, process=False)
    files = {"formats": ["stl", "3mf", "step"], "step": "tessellated"}  # design/test_design.py has a smooth one
    design = dsfab.run(preset(mesh, name="roof", pattern=PATTERN, export=files))
    design.save(tmp_path / "first", picture=False)
    (tmp_path / "first").rename(tmp_path / "moved")  # the mesh goes where the preset goes
    moved = tmp_path / "moved"
    read = dsfab.load_preset(moved / "preset.toml")
    assert read.surface.file == moved / MESH
    assert np.array_equal(read.surface.build().V, design.surface.V)
    found = read_archive(moved, read)
    assert found is not None, "what is in the folder is what its preset makes"
    assert np.array_equal(found.solid.V, design.solid.V)
    assert main(["build", str(moved / "preset.toml"), "-o", str(tmp_path / "again"), "--no-preview", "-q"]) == 0
    for name in ("roof.stl", "roof.3mf", "roof.step", "sheet.ply"):
        assert (tmp_path / "again" / name).read_bytes() == (moved / name).read_bytes(), name
    assert main(["build", str(moved / "preset.toml"), "-o", str(moved), "-f", "stl", "--no-preview", "-q"]) == 0
    assert 'file = "surface.ply"' in (moved / "preset.toml").read_text()
    assert np.array_equal(dsfab.load_preset(moved / "preset.toml").surface.build().V, design.surface.V)
    assert not (moved / "roof.step").exists(), "of the design before"


def test_a_mesh_in_memory_is_varied_and_goes_to_other_processes() -> None:
    given = preset(HYPAR, pattern=PATTERN)
    runs = dsfab.sweep(given, {"surface.refine": [0.0, 0.4], "pattern.keep": [0.2]}, metrics=["kept_share"])
    assert [run.error for run in runs] == ["", ""]
    again = pickle.loads(pickle.dumps(dsfab.Design(given)))
    assert again.preset == given
    assert dsfab.Design(given).surface is given.surface.build()


def test_the_dome_of_the_zoo_by_hand_is_the_one_by_file(tmp_path: Path) -> None:
    dome = ZOO["dome"]()
    (tmp_path / "dome.off").write_text(
        "\n".join(
            [
                f"OFF\n{dome.n} {dome.m} 0",
                *(" ".join(map(repr, row)) for row in (8 * dome.V).tolist()),
                *(f"3 {a} {b} {c}" for a, b, c in dome.F.tolist()),
            ]
        )
    )
    one, two = preset((8 * dome.V, dome.F)).surface.build(), preset(tmp_path / "dome.off").surface.build()
    assert np.array_equal(one.V, two.V)
    assert np.array_equal(one.F, two.F)
