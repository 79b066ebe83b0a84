"""Solids in other people's programs: admesh and prusa-slicer, which repair STL files, find nothing to repair."""

import re
import shutil
import subprocess

import pytest

from dsfab.core.units import MM_PER_M
from dsfab.export.mesh import triangles
from dsfab.export.part import Part
from dsfab.thickening import Solid
from tests.thickening.solid_zoo import fuzzed

SEEDS = (0, 1, 2, 3, 4, 6, 7, 8, 11, 13)
"""Plates, spheres, saddles and Moebius strips, with exact hits, near hits and noise; pinches joined and split."""

needs_admesh = pytest.mark.skipif(shutil.which("admesh") is None, reason="admesh is not installed (Debian: admesh)")
needs_prusa = pytest.mark.skipif(
    shutil.which("prusa-slicer") is None, reason="prusa-slicer is not installed (Debian: prusa-slicer)"
)

REPAIRS = ("Edges fixed", "Facets removed", "Facets added", "Facets reversed", "Backwards edges", "Normals fixed")


def write_stl(solid: Solid, path) -> None:
    part = triangles.prepare_stl(Part(MM_PER_M * solid.V, solid.F, "part", is_solid=True))
    path.write_bytes(b"".join(triangles.encode_stl(part)))


def read_by_admesh(solid: Solid, path) -> dict[str, float]:
    """What admesh tells about a solid in a binary STL file, by its own words."""
    write_stl(solid, path)
    told = subprocess.run(["admesh", path], capture_output=True, text=True, check=True, timeout=60).stdout
    return {name.strip(): float(value) for name, value in re.findall(r"([A-Z][A-Za-z -]+?)\s*:\s*(-?[\d.]+)", told)}


def read_by_prusa(solid: Solid, path) -> dict[str, str]:
    """What prusa-slicer tells about it; lines on repairs only where it made some."""
    write_stl(solid, path)
    told = subprocess.run(["prusa-slicer", "--info", path], capture_output=True, text=True, check=True, timeout=60)
    return dict(re.findall(r"(\w+) = +(\S+)", told.stdout))


@needs_admesh
@pytest.mark.parametrize("seed", SEEDS)
def test_admesh_repairs_nothing_and_measures_our_volume(seed, tmp_path):
    solid = fuzzed(seed)
    assert solid is not None
    told = read_by_admesh(solid, tmp_path / "part.stl")
    assert {name: told[name] for name in REPAIRS} == dict.fromkeys(REPAIRS, 0)
    assert told["Degenerate facets"] == 0
    assert told["Number of facets"] == len(solid.F)
    assert told["Volume"] == pytest.approx(solid.volume * MM_PER_M**3, rel=1e-4)  # it adds up in single precision


@needs_admesh
def test_admesh_finds_a_face_that_is_turned_over(tmp_path):
    """The test above can fail."""
    solid = fuzzed(0)
    assert solid is not None
    F = solid.F.copy()
    F[7] = F[7, ::-1]
    turned = Solid(solid.V, F, solid.genus, solid.pieces)
    assert read_by_admesh(turned, tmp_path / "part.stl")["Facets reversed"] == 1


PRUSA_TELLS = {"size_x", "size_y", "size_z", *(f"{end}_{axis}" for end in ("min", "max") for axis in "xyz")} | {
    *("number_of_facets", "manifold", "number_of_parts", "volume")
}
"""All that prusa-slicer 2.5 tells about a file that it did not repair."""


@pytest.mark.slow
@needs_prusa
@pytest.mark.parametrize("seed", SEEDS)
def test_prusa_slicer_repairs_nothing_and_measures_our_volume(seed, tmp_path):
    solid = fuzzed(seed)
    assert solid is not None
    told = read_by_prusa(solid, tmp_path / "part.stl")
    assert set(told) == PRUSA_TELLS
    assert told["manifold"] == "yes"
    assert int(told["number_of_facets"]) == len(solid.F)
    assert float(told["volume"]) == pytest.approx(solid.volume * MM_PER_M**3, rel=1e-4)  # in single precision


@pytest.mark.slow
@needs_prusa
def test_prusa_slicer_finds_a_face_that_is_missing(tmp_path):
    """The test above can fail."""
    solid = fuzzed(0)
    assert solid is not None
    told = read_by_prusa(Solid(solid.V, solid.F[1:], solid.genus, solid.pieces), tmp_path / "part.stl")
    assert told["manifold"] == "no"


@pytest.mark.slow
@needs_prusa
@pytest.mark.parametrize("seed", [0, 8])
def test_prusa_slicer_makes_tool_paths_of_a_small_copy(seed, tmp_path):
    solid = fuzzed(seed)
    assert solid is not None
    write_stl(solid, tmp_path / "part.stl")
    paths = tmp_path / "part.gcode"
    ask = ["--export-gcode", "--scale-to-fit", "40,40,40", "--center", "100,100", "-o", paths]
    subprocess.run(["prusa-slicer", *ask, tmp_path / "part.stl"], capture_output=True, check=True, timeout=120)
    used = re.search(r"; filament used \[mm\] = ([\d.]+)", paths.read_text())
    assert used is not None
    assert float(used[1]) > 0
