"""Kinds of faulty or rare content are read or refused in the same way in several formats."""

import numpy as np
import pygltflib
import pytest
import rhino3dm

from dsfab.core.errors import SurfaceError
from dsfab.surface import Surface, read_surface
from dsfab.surface.files.mesh_files import raw_mesh
from tests.surface.mesh_writers import WRITERS, ifc_roof_file, threemf_file
from tests.surface.named_files import read_in_this_process
from tests.surface.test_inventory import MIRROR, ROOF, dropped, glb, layer, rhino_mesh, rhino_model, saved, with_block
from tests.surface.test_overlaps import halves, vault

VAULT, QUADS = vault()


@pytest.fixture(autouse=True)
def within(monkeypatch):
    read_in_this_process(monkeypatch)


@pytest.mark.parametrize("metres", [1.0, 1e-3, 0.0254])
@pytest.mark.parametrize("suffix", ["3mf", "ifc"])
def test_a_vault_with_both_diagonals_is_as_large_in_each_unit(suffix, metres, tmp_path):
    F, path = np.vstack([halves(QUADS), halves(QUADS[::3], other=True)[:, ::-1]]), tmp_path / f"vault.{suffix}"
    if suffix == "3mf":
        threemf_file(path, VAULT / metres, F, {1.0: "meter", 1e-3: "millimeter", 0.0254: "inch"}[metres])
    else:
        ifc_roof_file(path, VAULT, F, **{1.0: {}, 1e-3: {"prefix": "MILLI"}, 0.0254: {"unit": "inch"}}[metres])
    assert raw_mesh(path).metres == metres
    surface = read_surface(path, mend=True)
    assert surface.m == 2 * len(QUADS)
    assert surface.area == pytest.approx(Surface(VAULT, halves(QUADS)).area, rel=1e-9)


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "dxf", "3mf"])
def test_numbers_too_large_for_any_unit_are_refused_in_each_format(suffix, tmp_path):
    WRITERS[suffix](path := tmp_path / f"roof.{suffix}", 1e160 * VAULT, halves(QUADS))
    with pytest.raises(
        SurfaceError,
        match=r"has coordinates up to 8e\+160, which are too large in any unit; export "
        r"the file again$",
    ):
        read_surface(path, mend=True)


@pytest.mark.parametrize("suffix", WRITERS)
def test_closed_parts_with_one_common_corner_are_refused_in_each_format(suffix, tmp_path):
    V = np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    F = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3], [0, 4, 5], [0, 6, 4], [0, 5, 6], [4, 6, 5]])
    WRITERS[suffix](path := tmp_path / f"parts.{suffix}", V, F)
    with pytest.raises(SurfaceError, match=r"parts touch in a point inside the surface \(first: vertex \d\); join or"):
        read_surface(path, mend=True)


def mirrored_instances(folder):
    extension = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": 2, "SCALE": 3}}}
    numbers = {"TRANSLATION": [[0, 0, 0], [9, 0, 0]], "SCALE": [[1, 1, 1], [-1, 1, 1]]}
    yield glb(folder / "instances.glb", [{"extensions": extension}], extension, **numbers)
    yield glb(folder / "nodes.glb", [{"scale": [-1, 1, 1], "children": [1]}, {"scale": [1, 1, -1]}], roots=1)
    model, place = with_block(rhino_model(), MIRROR), rhino3dm.Transform(1.0)
    place.M11 = -1.0
    inner = rhino3dm.InstanceReference(model.InstanceDefinitions[0].Id, rhino3dm.Transform(1.0))
    model.InstanceDefinitions.Add("house", "", "", "", rhino3dm.Point3d(0, 0, 0), (inner,), (layer(model, ""),))
    model.Objects.AddInstanceObject(rhino3dm.InstanceReference(model.InstanceDefinitions[1].Id, place))
    yield saved(model, folder / "nested.3dm")


def test_mirrored_instances_of_rare_kinds_look_up(tmp_path):
    for path in mirrored_instances(tmp_path):
        raw = raw_mesh(path)
        assert (Surface(raw.V, raw.F).normals[:, 2] > 0).all(), path


def test_a_hidden_object_of_a_3dm_file_is_named(tmp_path):
    model = with_block(rhino_model(), MIRROR)
    (about := rhino3dm.ObjectAttributes()).Visible = False
    model.Objects.AddMesh(rhino_mesh(), about)
    path = saved(model, tmp_path / "roof.3dm")
    assert "1 hidden object" in dropped(path)
    assert read_surface(path).area == pytest.approx(ROOF.area)


def test_shapes_that_dsfab_does_not_read_are_named(tmp_path):
    WRITERS["obj"](path := tmp_path / "roof.obj", ROOF.V, ROOF.F)
    path.write_text(path.read_text() + "cstype bspline\ndeg 1 1\nsurf 0 1 0 1 1 2 3 4\nend\ncurv 0 1 1 2\nend\n")
    assert dropped(path) == "1 curve; 1 free-form surface"
    file = pygltflib.GLTF2().load(str(glb(tmp_path / "roof.glb", [{"skin": 0}])))
    file.meshes[0].primitives[0].targets = [{"POSITION": 0}]
    file.save(str(path := tmp_path / "roof.glb"))
    assert {"1 skin", "1 morph target"} <= {*dropped(path).split("; ")}
