"""Solids in other people's programs: admesh, which repairs STL files, finds nothing to repair."""

import re
import shutil
import subprocess

import pytest

from dsfab.export import stl
from dsfab.export.part import Part
from dsfab.thickening import Solid
from dsfab.units import MM_PER_M
from tests.test_thickening_zoo import fuzzed

SEEDS = (0, 1, 2, 3, 4, 6, 7, 8, 11, 13)
"""Plates, spheres, saddles and Moebius strips, with exact hits, near hits and noise; pinches joined and split."""

pytestmark = pytest.mark.skipif(shutil.which("admesh") is None, reason="admesh is not installed (Debian: admesh)")

REPAIRS = ("Edges fixed", "Facets removed", "Facets added", "Facets reversed", "Backwards edges", "Normals fixed")


def read_by_admesh(solid: Solid, path) -> dict[str, float]:
    """What admesh tells about a solid in a binary STL file, by its own words."""
    part = stl.prepare(Part(MM_PER_M * solid.V, solid.F, "part", is_solid=True))
    path.write_bytes(b"".join(stl.encode(part)))
    told = subprocess.run(["admesh", path], capture_output=True, text=True, check=True, timeout=60).stdout
    return {name.strip(): float(value) for name, value in re.findall(r"([A-Z][A-Za-z -]+?)\s*:\s*(-?[\d.]+)", told)}


@pytest.mark.parametrize("seed", SEEDS)
def test_admesh_repairs_nothing_and_measures_our_volume(seed, tmp_path):
    solid = fuzzed(seed)
    assert solid is not None
    told = read_by_admesh(solid, tmp_path / "part.stl")
    assert {name: told[name] for name in REPAIRS} == dict.fromkeys(REPAIRS, 0)
    assert told["Degenerate facets"] == 0
    assert told["Number of facets"] == len(solid.F)
    assert told["Volume"] == pytest.approx(solid.volume * MM_PER_M**3, rel=1e-4)  # it adds up in single precision


def test_admesh_finds_a_face_that_is_turned_over(tmp_path):
    """The test above can fail."""
    solid = fuzzed(0)
    assert solid is not None
    F = solid.F.copy()
    F[7] = F[7, ::-1]
    turned = Solid(solid.V, F, solid.genus, solid.pieces)
    assert read_by_admesh(turned, tmp_path / "part.stl")["Facets reversed"] == 1
