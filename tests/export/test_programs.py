"""Programs that others wrote open our files and find nothing to mend. Tests say what is missing where skipped.

Debian: admesh, prusa-slicer. pip: gmsh, cadaclysm. npm: gltf-validator (its folder in GLTF_VALIDATOR).
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import ezdxf
import numpy as np
import pytest

from dsfab.design.output.files import curved_sheet
from dsfab.export import Details, StepOptions, write
from dsfab.surface.fields import StructureLine
from dsfab.surface.shapes.roofs import barrel_vault
from dsfab.thickening import Solid, offsets, thicken
from tests.export.other_programs import module
from tests.export.striped_solids import ARCHED
from tests.shapes import grid, lifted
from tests.smooth import THICKNESS, holed, thickened


def program(name: str) -> Callable:
    return pytest.mark.skipif(shutil.which(name) is None, reason=f"the program {name} is not installed")


def ran(*command: object, limit: float = 120) -> str:
    """What a program says, on both channels; it must end with 0."""
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=limit, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def arched_solid() -> Solid:
    """A curved sheet of 120 x 120 x 8 mm: slicers have a bed of 200 mm unless told otherwise."""
    surface = lifted(lambda x, y: 2 * x * (0.12 - x), cells=8, length=0.12)
    return thicken(surface, offsets(surface, 0.008).D)


@pytest.fixture(scope="module")
def flat_solid() -> Solid:
    """A flat one of 200 x 100 x 8 mm."""
    surface = grid(8, 4, 0.2, 0.1)
    return thicken(surface, offsets(surface, 0.008).D)


@program("admesh")
def test_admesh_finds_nothing_to_mend_in_an_stl_file(arched_solid, tmp_path):
    said = ran("admesh", write(arched_solid, tmp_path / "arch.stl"))
    numbers = {key.strip(): float(value) for key, value in re.findall(r"([A-Z][A-Za-z ]+?)\s*:\s*(-?[\d.]+)", said)}
    assert numbers["Number of facets"] == len(arched_solid.F)
    assert numbers["Volume"] == pytest.approx(arched_solid.volume * 1e9, rel=1e-5)
    assert numbers["Number of parts"] == 1
    for fault in ("Degenerate facets", "Edges fixed", "Facets removed", "Facets added", "Facets reversed",
                  "Backwards edges", "Normals fixed", "Total disconnected facets"):  # fmt: skip
        assert numbers[fault] == 0, fault


@program("prusa-slicer")
@pytest.mark.parametrize("suffix", ["stl", "3mf"])
def test_prusaslicer_accepts_and_slices_the_solid(suffix, arched_solid, tmp_path):
    path, made = write(arched_solid, tmp_path / f"arch.{suffix}"), tmp_path / "arch.gcode"
    info = dict(re.findall(r"^(\w+) = +(.+)$", ran("prusa-slicer", "--info", path), re.M))
    assert info["manifold"] == "yes"
    assert (info["number_of_facets"], info["number_of_parts"]) == (str(len(arched_solid.F)), "1")
    assert float(info["volume"]) == pytest.approx(arched_solid.volume * 1e9, rel=1e-4)
    coarse = ("--layer-height", 0.3, "--fill-density", "0%", "--perimeters", 1, "--top-solid-layers", 0)
    said = ran("prusa-slicer", "--export-gcode", *coarse, "-o", made, path)
    assert "repair" not in said.lower()
    height = max(float(z) for z in re.findall(r"^;Z:([\d.]+)", made.read_text(), re.M) or [0.0])
    assert height == pytest.approx(1000 * np.ptp(arched_solid.box[:, 2]), abs=0.5)


GMSH = """
import sys, gmsh
gmsh.initialize(interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.importShapes(sys.argv[1])
gmsh.model.occ.synchronize()
solids = gmsh.model.getEntities(3)
volume = sum(gmsh.model.occ.getMass(*s) for s in solids)
gmsh.option.setNumber("Mesh.MeshSizeMin", float(sys.argv[2]))
gmsh.option.setNumber("Mesh.MeshSizeMax", float(sys.argv[2]))
gmsh.model.mesh.generate(3)
tetrahedra = gmsh.model.mesh.getElementsByType(4)[0]
print(len(solids), volume, len(tetrahedra))
"""


@module("gmsh")
@pytest.mark.parametrize("way", ["planar", "faceted"])
def test_gmsh_fills_a_step_file_with_tetrahedra(way, arched_solid, flat_solid, tmp_path, inspected):
    solid = flat_solid if way == "planar" else arched_solid
    path = write(solid, tmp_path / "a.step", step=way)
    solids, volume, tetrahedra = ran(sys.executable, "-c", GMSH, path, 30).split()[-3:]
    assert solids == "1"
    assert float(volume) in (pytest.approx(solid.volume, rel=1e-6), pytest.approx(solid.volume * 1e9, rel=1e-6))
    assert int(tetrahedra) > 50


STEP_WAYS = ("planar", "smooth", "faceted", "tessellated")


@pytest.fixture
def step_file(arched_solid, flat_solid, tmp_path, inspected, inspected_pieces) -> Callable[[str], tuple[Solid, Path]]:
    """A solid and its file, by the way to write it."""

    def made(way: str) -> tuple[Solid, Path]:
        solid, curved = flat_solid if way == "planar" else arched_solid, None
        if way == "smooth":
            surface = barrel_vault(2.0, 1.6, 0.5, 0.15)
            sheet = holed(surface, [[0.5, 0, 0.5]], 0.25)
            solid, curved = thickened(surface, sheet), partial(curved_sheet, surface, sheet, THICKNESS)
        return solid, write(solid, tmp_path / "a.step", step=StepOptions(way, curved=curved))

    return made


def references(value: object) -> Iterator[str]:
    """Entities that a parameter, or a list of them, names."""
    from steputils import p21

    if p21.is_reference(value):
        yield str(value)
    elif isinstance(value, tuple):
        for one in value:
            yield from references(one)


@module("steputils")
@pytest.mark.parametrize("way", STEP_WAYS)
def test_a_parser_of_iso_10303_21_finds_a_whole_and_closed_boundary(way, step_file):
    """The text by its grammar; then every name stands for an entity, and an edge has two sides or a solid is open."""
    from steputils import p21

    solid, path = step_file(way)
    (data,) = p21.readfile(path).data
    found = {
        name: [one.entity] if p21.is_simple_entity_instance(one) else list(one.entities)
        for name, one in data.instances.items()
    }
    entities = {name: some[0] for name, some in found.items()}
    named = {name for some in found.values() for one in some for name in references(one.params)}
    roots = {entities[name].name for name in found.keys() - named}
    assert named <= found.keys()
    assert all("REPRESENTATION" in root or root.endswith(("DEFINITION", "CATEGORY")) for root in roots), roots
    if way == "tessellated":
        points, triangles = (np.array(next(e for e in entities.values() if e.name == name).params[at]) for name, at in
                             (("COORDINATES_LIST", 2), ("TRIANGULATED_FACE", 6)))  # fmt: skip
        a, b, c = (points[triangles[:, i] - 1] for i in range(3))
        assert np.einsum("mi,mi->", a, np.cross(b, c)) / 6 == pytest.approx(solid.volume * 1e9, rel=1e-4)
        return
    sides = Counter((one.params[3], one.params[4]) for one in entities.values() if one.name == "ORIENTED_EDGE")
    edges = [name for name, one in entities.items() if one.name == "EDGE_CURVE"]
    assert len(edges) > 10
    assert sides == Counter((name, side) for name in edges for side in (".T.", ".F."))


KERNEL = """
import sys, cadaclysm, numpy as np
with cadaclysm.open(sys.argv[1]) as scene:
    (one,) = scene.placements
    with one.geometry.brep as body:
        found = body.manifold
    V, F = (np.asarray(x).reshape(-1, 3) for x in (one.geometry.mesh64.positions, one.geometry.mesh64.indices))
    a, b, c = (V[F[:, i]] - V[0] for i in range(3))
    print("found", len(scene.diagnostics), found.is_manifold and found.is_closed, found.faces,
          np.einsum("mi,mi->", a, np.cross(b, c)) / 6)
"""


@module("cadaclysm")
@pytest.mark.parametrize("way", STEP_WAYS[:3])
def test_a_kernel_that_is_not_occt_finds_a_closed_solid_in_a_step_file(way, step_file):
    """Its volume is that of its own triangles. Of tessellated geometry it reads none."""
    solid, path = step_file(way)
    faults, closed, faces, volume = ran(sys.executable, "-c", KERNEL, path).split("found ")[1].split()[:4]
    assert (faults, closed, int(faces)) == ("0", "True", path.read_bytes().count(b"=ADVANCED_FACE("))
    assert float(volume) == pytest.approx(solid.volume * 1e9, rel=0.02 if way == "smooth" else 1e-5)


VALIDATE = """
const fs = require('fs'), validator = require(process.argv[1] + '/node_modules/gltf-validator');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])))
  .then(report => console.log(JSON.stringify(report)));
"""


@program("node")
@pytest.mark.skipif("GLTF_VALIDATOR" not in os.environ, reason="GLTF_VALIDATOR names no folder with gltf-validator")
def test_the_validator_of_khronos_passes_a_glb_file(arched_solid, tmp_path):
    path = write(arched_solid, tmp_path / "a.glb")
    report = json.loads(ran("node", "-e", VALIDATE, os.environ["GLTF_VALIDATOR"], path))
    assert (report["issues"]["numErrors"], report["issues"]["numWarnings"]) == (0, 0)
    assert report["info"]["totalTriangleCount"] == len(arched_solid.F)


def test_ezdxf_audits_a_dxf_file(tmp_path):
    sheet, details = ARCHED
    audit = ezdxf.readfile(write(sheet, tmp_path / "a.dxf", details=details)).audit()
    assert (audit.errors, audit.fixes) == ([], [])


@module("rhino3dm")
def test_rhino3dm_reads_a_3dm_file_again(arched_solid, tmp_path):
    import rhino3dm

    points = np.array([[0.0, 0, 0], [0.1, 0, 0.1], [0.2, 0, 0]])
    line = StructureLine("centre", "major", 1, 1, points, 0.2 * np.sqrt(2))
    model = rhino3dm.File3dm.Read(str(write(arched_solid, tmp_path / "a.3dm", details=Details((line,)))))
    assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Millimeters
    assert sorted(layer.Name for layer in model.Layers) == ["centre-major", "sheet"]
    assert all(item.Geometry.IsValid for item in model.Objects)
    mesh = next(item.Geometry for item in model.Objects if item.Geometry.ObjectType == rhino3dm.ObjectType.Mesh)
    assert mesh.IsClosed
    assert mesh.Faces.Count == len(arched_solid.F)


@program("freecadcmd")
@pytest.mark.slow
@pytest.mark.parametrize("way", ["planar", "faceted"])
def test_freecad_finds_a_valid_solid_in_a_step_file(way, arched_solid, flat_solid, tmp_path, inspected):
    solid = flat_solid if way == "planar" else arched_solid
    path, script = write(solid, tmp_path / "a.step", step=way), tmp_path / "look.py"
    script.write_text(
        f"import Part\ns = Part.read({str(path)!r})\n"
        "print('found', len(s.Solids), all(x.isValid() for x in s.Solids), sum(x.Volume for x in s.Solids))\n"
    )
    words = re.search(r"found (\d+) (\w+) ([\d.e+]+)", ran("freecadcmd", script))
    assert words is not None
    assert words.group(1, 2) == ("1", "True")
    assert float(words.group(3)) == pytest.approx(solid.volume * 1e9, rel=1e-5)
