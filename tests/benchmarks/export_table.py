"""Every format of a design: size, seconds, volume error, and what a program of somebody else finds in the file.

    python tests/benchmarks/export_table.py [sphere dome cantilever tower bob] [-o FOLDER] [--only .stl,.step]

Rows of a Markdown table. The error is that of the volume (area of the uncut sheet in .vtu, length of lines) as dsfab
reads it back; FreeCAD and gmsh use a quick rule that is wrong by up to 1 % on faces with many holes.
Meshes are looked for in DSFAB_MESHES; the folder gltf-validator is in, in GLTF_VALIDATOR.
Seconds are dsfab's, writing and reading back, on the clock. Asked where they are installed: admesh, prusa-slicer,
FreeCAD (freecadcmd), gmsh, cadaclysm, ifcopenshell, ezdxf, rhino3dm, VTK, the glTF validator of Khronos.
"""

import argparse
import csv
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.design import run
from dsfab.design.design import Design
from dsfab.design.output.files import deliverable
from dsfab.export import Written, write
from dsfab.preset.file import load_preset, with_overrides

DESIGNS = ("sphere", "dome", "cantilever", "tower", "bob")
FORMATS = (".stl", ".3mf", ".obj", ".ply", ".off", ".glb", ".3dm", ".ifc", ".step", ".smooth.step", ".stpz", ".brep",
           ".lines.step", ".dxf", ".svg", ".csv", ".json", ".vtu")  # fmt: skip
SECONDS = 300

FREECAD = """
import json, os, sys, time
import Part, Mesh
found = {}
for path in json.load(open(os.environ["DSFAB_FILES"])):
    begin = time.time()
    try:
        if path.endswith((".step", ".brep")):
            shape = Part.read(path)
            said = {"solids": len(shape.Solids), "valid": all(s.isValid() for s in shape.Solids),
                    "volume": sum(s.Volume for s in shape.Solids), "faces": len(shape.Faces),
                    "edges": len(shape.Edges), "length": sum(e.Length for e in shape.Edges)}
            picture = os.environ.get("DSFAB_PICTURE")
            if picture and path.endswith(picture):
                points, faces = shape.tessellate(0.002 * shape.BoundBox.DiagonalLength)
                Mesh.Mesh([[tuple(points[i]) for i in f] for f in faces]).write(path + ".freecad.stl")
        else:
            mesh = Mesh.Mesh(path)
            said = {"triangles": mesh.CountFacets, "closed": mesh.isSolid(), "volume": mesh.Volume}
    except Exception as error:
        said = {"error": str(error)[:80]}
    found[path] = said | {"seconds": time.time() - begin}
    json.dump(found, open(os.environ["DSFAB_FILES"] + ".found", "w"))
"""

VALIDATE = """
const fs = require('fs'), validator = require(process.argv[1] + '/node_modules/gltf-validator');
validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])), {maxIssues: 0})
  .then(report => console.log(JSON.stringify(report)));
"""

GMSH = """
import sys, gmsh
gmsh.initialize(interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
gmsh.model.occ.importShapes(sys.argv[1])
gmsh.model.occ.synchronize()
solids = gmsh.model.getEntities(3)
print(len(solids), sum(gmsh.model.occ.getMass(*s) for s in solids), len(gmsh.model.getEntities(1)))
"""

KERNEL = """
import sys, cadaclysm, numpy as np
with cadaclysm.open(sys.argv[1]) as scene:
    closed, volume = [], 0.0
    for one in scene.placements:
        with one.geometry.brep as body:
            closed.append(body.manifold.is_manifold and body.manifold.is_closed)
            if body.manifold.faces > 1500:  # its triangles of so many spline faces take minutes
                volume = np.nan
                continue
        mesh = one.geometry.mesh64
        V, F = (np.asarray(x).reshape(-1, 3) for x in (mesh.positions, mesh.indices))
        a, b, c = (V[F[:, i]] - V[0] for i in range(3))
        volume += float(np.einsum("mi,mi->", a, np.cross(b, c)) / 6)
    print(len(closed), all(closed), volume, len(scene.diagnostics))
"""


@dataclass
class Row:
    """A file, what it cost, what dsfab's own reader found, and the words of others."""

    path: Path
    seconds: float
    found: str = "-"
    off: float = float("nan")
    said: str = ""

    def add(self, said: str, volume: float = float("nan"), true: float = float("nan")) -> None:
        """The words of another reader, with how far the volume that it finds is off, if it says one."""
        error = "" if np.isnan(volume) or not volume else f", volume error {abs(volume / true - 1):.0e}"
        self.said = "; ".join(filter(None, [self.said, said + error]))


def made(name: str) -> Design:
    mesh = Path(os.environ.get("DSFAB_MESHES", ".")) / f"{name}.obj"
    return run(load_preset(name, {"surface.unit": "m"}, mesh) if mesh.is_file() else load_preset(name))


def written(design: Design, suffix: str, folder: Path) -> Row:
    """The file, or why it is not there."""
    path, told, done, begin = folder / f"a{suffix}", list[str](), list[Written](), time.perf_counter()
    if suffix == ".smooth.step":
        design = replace(design, preset=with_overrides(design.preset, {"export.step": "smooth"}))
    try:
        thing, how = deliverable(design, path.suffix if suffix == ".smooth.step" else suffix)
        write(thing, path, name=design.preset.name, note=told.append, report=done.append, **how)
    except DsfabError as error:
        return Row(path, time.perf_counter() - begin, said=f"refused: {error}")
    found = done[0].found
    how_made = told[0].split(" (allowed")[0][:110] if told else ""
    return Row(path, done[0].seconds, f"{found.count:,} {found.what}", found.off, how_made)


def asked(command: list[object]) -> str:
    done = subprocess.run([str(x) for x in command], capture_output=True, text=True, timeout=SECONDS, check=False)
    return done.stdout + done.stderr


def admesh(path: Path) -> tuple[str, float]:
    said = asked(["admesh", path])
    numbers = {k.strip(): float(v) for k, v in re.findall(r"([A-Z][A-Za-z ]+?)\s*:\s*(-?[\d.]+)", said)}
    faults = ("Degenerate facets", "Edges fixed", "Facets removed", "Facets added", "Facets reversed",
              "Backwards edges", "Normals fixed", "Total disconnected facets")  # fmt: skip
    return f"admesh: {sum(numbers[x] for x in faults):.0f} repairs", numbers["Volume"]


def slicer(path: Path) -> tuple[str, float]:
    info = dict(re.findall(r"^(\w+) = +(.+)$", asked(["prusa-slicer", "--info", path]), re.M))
    return f"PrusaSlicer: manifold {info.get('manifold')}", float(info.get("volume", "nan"))


def khronos(path: Path) -> tuple[str, float]:
    where = os.environ.get("GLTF_VALIDATOR", "")
    if not where:
        return "GLTF_VALIDATOR is not set", float("nan")
    report = json.loads(asked(["node", "-e", VALIDATE, where, path]))
    found = report["issues"]
    return f"Khronos: {found['numErrors']} errors, {found['numWarnings']} warnings", float("nan")


def rhino(path: Path) -> tuple[str, float]:
    import rhino3dm

    model = rhino3dm.File3dm.Read(str(path))
    shapes = [item.Geometry for item in model.Objects]
    curves = [x for x in shapes if x.ObjectType == rhino3dm.ObjectType.Curve]
    smooth = sum(type(x) is rhino3dm.NurbsCurve for x in curves)
    mesh = next(x for x in shapes if x.ObjectType == rhino3dm.ObjectType.Mesh)
    V = np.array([(v.X, v.Y, v.Z) for v in mesh.Vertices])
    a, b, c = (V[[mesh.Faces[i][k] for i in range(mesh.Faces.Count)]] for k in range(3))
    volume = float(np.einsum("mi,mi->", a, np.cross(b, c)) / 6)
    valid = all(x.IsValid for x in shapes)
    return f"rhino3dm: valid {valid}, {len(curves)} curves, {smooth} NURBS, mesh closed {mesh.IsClosed}", volume


def building(path: Path) -> tuple[str, float]:
    import ifcopenshell
    import ifcopenshell.validate

    log = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(ifcopenshell.open(str(path)), log)
    return f"ifcopenshell: {len(log.statements)} faults", float("nan")


def drawing(path: Path) -> tuple[str, float]:
    import ezdxf

    document = ezdxf.readfile(path)
    kinds = [entity.dxftype() for entity in document.modelspace()]
    count = ", ".join(f"{kinds.count(kind)} {kind}" for kind in sorted(set(kinds)))
    return f"ezdxf: {len(document.audit().errors)} errors; {count}", float("nan")


def gmsh(path: Path) -> tuple[str, float]:
    words = asked([sys.executable, "-c", GMSH, path]).split()
    if len(words) != 3:
        return f"gmsh: {' '.join(words)[-60:]}", float("nan")
    solids, volume, curves = words
    return (f"gmsh: {solids} solids" if solids != "0" else f"gmsh: {curves} curves"), float(volume)


def kernel(path: Path) -> tuple[str, float]:
    """Volume of the triangles that it makes, so to their tolerance."""
    found = re.search(r"^(\d+) (\w+) (\S+) (\d+)$", said := asked([sys.executable, "-c", KERNEL, path]), re.M)
    if found is None:
        return f"cadaclysm: {said.strip()[-60:]}", float("nan")
    solids, closed, volume, faults = found.groups()
    return f"cadaclysm: {solids} solids, closed {closed}, {faults} faults", float(volume)


def paraview(path: Path) -> tuple[str, float]:
    import pyvista

    grid = pyvista.read(path)
    return f"VTK: {grid.n_cells:,} triangles, {len(grid.array_names)} fields", float("nan")


def text(path: Path) -> tuple[str, float]:
    if path.suffix == ".csv":
        with open(path, encoding="utf-8", newline="") as file:
            return f"csv: {sum(1 for _ in csv.DictReader(file)):,} points", float("nan")
    if path.suffix == ".json":
        return f"json: {len(json.loads(path.read_text(encoding='utf-8'))['lines'])} lines", float("nan")
    return f"XML: {sum(1 for _ in ElementTree.parse(path).iter())} elements", float("nan")


def packed(path: Path) -> tuple[str, float]:
    with tempfile.TemporaryDirectory() as folder, zipfile.ZipFile(path) as archive:
        inside = Path(archive.extract(archive.namelist()[0], folder)).rename(Path(folder) / "a.step")
        said, volume = gmsh(inside)
    return f"zip: {archive.testzip() if archive.fp else 'sound'}; {said}", volume


READERS: dict[str, tuple[Callable[[Path], tuple[str, float]], ...]] = {
    ".stl": (admesh, slicer), ".3mf": (slicer,), ".glb": (khronos,), ".3dm": (rhino,), ".ifc": (building,),
    ".step": (kernel, gmsh), ".smooth.step": (kernel, gmsh), ".stpz": (packed,), ".lines.step": (gmsh,),
    ".dxf": (drawing,), ".svg": (text,), ".csv": (text,), ".json": (text,), ".vtu": (paraview,),
}  # fmt: skip
FREECAD_READS = (".obj", ".ply", ".off", ".step", ".smooth.step", ".brep", ".lines.step")


def freecad(rows: dict[str, Row], folder: Path, true: float) -> None:
    """All files of a design in one process; a file that it does not end with is said to be so."""
    listed = folder / "files.json"
    paths = [str(rows[suffix].path) for suffix in FREECAD_READS if suffix in rows and rows[suffix].path.exists()]
    listed.write_text(json.dumps(paths))
    script = folder / "look.py"
    script.write_text(FREECAD)
    try:
        subprocess.run(["freecadcmd", str(script)], env=os.environ | {"DSFAB_FILES": str(listed)}, timeout=2 * SECONDS,
                       capture_output=True, check=False)  # fmt: skip
        late = "FreeCAD: nothing"
    except subprocess.TimeoutExpired:
        late = f"FreeCAD: no end within {2 * SECONDS} s"
    answer = Path(f"{listed}.found")
    found = json.loads(answer.read_text()) if answer.exists() else {}
    for row in rows.values():
        if str(row.path) in paths:
            said = found.get(str(row.path))
            words = ", ".join(f"{k} {v:.6g}" if isinstance(v, float) else f"{k} {v}" for k, v in said.items()
                              if k not in ("volume", "seconds")) if said else ""  # fmt: skip
            row.add(
                f"FreeCAD: {words}, {said['seconds']:.1f} s" if said else late, (said or {}).get("volume", 0.0), true
            )


def table(name: str, folder: Path, only: tuple[str, ...]) -> None:
    design = made(name)
    solid, true = design.solid, 1e9 * design.solid.volume
    print(f"\n### {name}: {len(solid.F):,} triangles, {true:.6g} mm3, {solid.pieces} pieces\n", flush=True)
    print("| format | MB | s | holds | error | read by others |\n|---|---|---|---|---|---|", flush=True)
    folder.mkdir(parents=True, exist_ok=True)
    rows = {}
    for suffix in only:
        row = rows[suffix] = written(design, suffix, folder)
        for reader in READERS.get(suffix, ()) if row.path.exists() else ():
            if shutil.which({"admesh": "admesh", "slicer": "prusa-slicer"}.get(reader.__name__, "python")) is None:
                continue
            try:
                said, volume = reader(row.path)
            except subprocess.TimeoutExpired:
                said, volume = f"{reader.__name__}: no end within {SECONDS} s", float("nan")
            except Exception as error:  # a program of somebody else: whatever it does is a result
                said, volume = f"{reader.__name__}: {str(error)[:80]}", float("nan")
            row.add(said, volume, true)
        if not (suffix in FREECAD_READS and row.path.exists() and shutil.which("freecadcmd")):
            told(suffix[1:], row)
    if shutil.which("freecadcmd"):
        freecad(rows, folder, true)
        for suffix in FREECAD_READS:
            if suffix in rows and rows[suffix].path.exists():
                told(suffix[1:], rows[suffix])


def told(name: str, row: Row) -> None:
    """A row at once: what follows may take long."""
    size = f"{row.path.stat().st_size / 1e6:.2f}" if row.path.exists() else "-"
    error = "-" if np.isnan(row.off) else f"{abs(row.off):.0e}"
    print(f"| {name} | {size} | {row.seconds:.1f} | {row.found} | {error} | {row.said} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("designs", nargs="*", default=DESIGNS)
    parser.add_argument("-o", "--output", type=Path, default=Path("outputs/export_table"))
    parser.add_argument("--only", default=",".join(FORMATS), help="suffixes, as .stl,.step")
    ask = parser.parse_args()
    for name in ask.designs:
        table(name, ask.output / name, tuple(ask.only.split(",")))


if __name__ == "__main__":
    main()
