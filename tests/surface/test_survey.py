"""A roof in survey coordinates is the same roof, and becomes the same design, through each format and through Hops.

All digits of a double are in each file. DXF, STL, 3DM, GLB, IFC, STEP and Hops sort the vertices, the other readers
keep their order: this roof is written in sorted order. IFC and STEP may begin a face at another of its corners."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from dsfab.app.hops.components import COMPONENTS, preset_of_request, solve_preview
from dsfab.app.hops.protocol import read_request
from dsfab.design import Design
from dsfab.preset.file import with_overrides
from dsfab.preset.proposal import preset_for, propose
from dsfab.surface import Surface, read_surface
from dsfab.surface.files.rhino_and_step import read_rhino_json
from tests.shapes import grid
from tests.surface.mesh_writers import WRITERS
from tests.surface.named_files import read_in_this_process
from tests.surface.test_inventory import FAR, glb, rhino_mesh

FLAT = grid(8, 6, 12.0, 8.0)
X, Y, _ = FLAT.V.T
NEAR = Surface(np.round(np.c_[X, Y, 3 * (1 - (Y / 4 - 1) ** 2) + 0.02 * (X - 6) * (Y - 4)] * 1024) / 1024, FLAT.F)
"""A vault of 12 x 8 m, a little twisted; its vertices have few binary digits, so that 32 bits hold them in GLB."""
V, F = NEAR.V + FAR, NEAR.F
ORIGIN = np.array([466000.0, 5247000.0, 0.0])
COARSE = {"pattern.major.spacing": 2.0, "pattern.minor.spacing": 2.0, "surface.edge": 1.0, "statics.thickness": 0.06}


def step_file(path):
    """An assembly in millimetres at the survey coordinates, as CAD programs write it."""
    b = pytest.importorskip("build123d")
    corners = (1000 * NEAR.V[F]).tolist()
    faces = [b.Face(b.Wire.make_polygon([*map(tuple, triangle)], close=True)) for triangle in corners]
    roof = b.Compound(children=faces, label="roof").moved(b.Location(tuple(1000 * FAR)))
    b.export_step(b.Compound(children=[roof], label="site"), path)


FILES = {
    **{suffix: lambda path, write=write: write(path, V, F) for suffix, write in WRITERS.items()},
    "glb": lambda path: glb(path, [{"translation": [FAR[0], FAR[2], -FAR[1]]}], roof=NEAR),
    "step": step_file,
}


@pytest.fixture(autouse=True)
def within(monkeypatch):
    read_in_this_process(monkeypatch)


def written(folder: Path, suffix: str) -> Path:
    FILES[suffix](path := folder / f"roof.{suffix}")
    return path


def hops_request(unit="Meters", scale=1.0, **more):
    texts = {"mesh": json.dumps(rhino_mesh(V * scale, F).Encode())} | {k: json.dumps(x) for k, x in more.items()}
    values = [{"ParamName": name, "InnerTree": {"0": [{"type": "", "data": text}]}} for name, text in texts.items()]
    return read_request(COMPONENTS["preview"], {"values": values, "modelunits": unit})


@pytest.mark.parametrize("suffix", FILES)
def test_each_format_gives_the_doubles_of_the_file(suffix, tmp_path):
    """STEP has millimetres and a place: its metres may differ in the last bit, of a nanometre."""
    surface = read_surface(written(tmp_path, suffix))
    assert_allclose(surface.V, V, rtol=0, atol=1e-9 if suffix == "step" else 0)
    turn = [np.roll(face, -np.argmin(face)).tolist() for faces in (surface.F, F) for face in faces]
    assert turn[: len(F)] == turn[len(F) :] if suffix in ("step", "ifc") else np.array_equal(surface.F, F)


def values_of(preset):
    of_files = {"file", "mesh", "only", "unit", "up", "mend", "repair", "max_triangles", "origin"}
    return preset.model_dump(exclude={"surface": of_files})


def test_formats_and_hops_propose_the_same_preset_for_the_same_surface(tmp_path):
    first = propose(written(tmp_path, "obj"))
    assert first.preset.surface.origin == tuple(ORIGIN)
    assert len(first.preset.surface.support) == 2
    surface = first.preset.surface.base_surface()
    assert np.abs(surface.V - FAR + ORIGIN - NEAR.V).max() < 1e-9
    for suffix in ("3dm", "glb", "ifc"):
        proposal = propose(written(tmp_path, suffix))
        assert proposal.preset.surface.origin == tuple(ORIGIN)
        assert values_of(proposal.preset) == values_of(first.preset), suffix
        assert_array_equal(proposal.preset.surface.base_surface().V, surface.V)
    preset = preset_of_request(request := hops_request())
    assert values_of(preset) == values_of(preset_for(tmp_path / "roof.obj"))
    same = preset.surface.base_surface()
    assert all(map(np.array_equal, (request.surface.V, same.V, same.F), (V, surface.V, surface.F)))


def test_points_and_answers_of_hops_are_in_the_coordinates_of_the_model():
    """In millimetres; the unit of the preset and of the design is the metre."""
    foot = dict(zip("XYZ", (1000 * V[0]).tolist(), strict=True))
    request = hops_request("Millimeters", 1000.0, supports=foot)
    assert_array_equal(request.origin, ORIGIN)
    (support,) = preset_of_request(request).surface.support
    assert_allclose(support.at.center, V[0] - ORIGIN, rtol=0, atol=2e-9)
    assert_allclose(request.in_model(V - ORIGIN), 1000 * V, rtol=0, atol=2e-6)


def design(preset):
    return Design.from_preset(with_overrides(preset, COARSE)).until("slicing")


@pytest.fixture(scope="module")
def design_of_obj(tmp_path_factory):
    return design(preset_for(written(tmp_path_factory.mktemp("obj"), "obj")))


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [suffix for suffix in FILES if suffix != "obj"])
def test_each_format_gives_the_same_design(suffix, design_of_obj, tmp_path):
    """Its preset, bit for bit, of which one design is made. Where a face begins at another corner, sums have another
    order: the passes that finish the sheet may then leave other vertices, but the members and the area are the same."""
    asked, expected = with_overrides(preset_for(written(tmp_path, suffix)), COARSE), design_of_obj
    if suffix not in ("step", "ifc"):
        assert values_of(asked) == values_of(expected.preset)
        a, b = asked.surface.build(), expected.surface
        assert all(map(np.array_equal, (a.V, a.F), (b.V, b.F)))
        return
    same = Design.from_preset(asked).until("slicing")
    assert len(same.members.members) == len(expected.members.members) > 20
    assert same.sheet.surface.area == pytest.approx(
        expected.sheet.surface.area, rel={"step": 3e-4, "ifc": 1e-9}[suffix]
    )


@pytest.mark.slow
def test_hops_gives_the_same_design_in_the_coordinates_of_the_model(design_of_obj):
    lines = "\n".join(f"{key} = {value}" for key, value in COARSE.items())
    sheet, _, notes = solve_preview(hops_request(preset=lines))
    answer, expected = read_rhino_json(sheet), design_of_obj.sheet.surface
    assert all(map(np.array_equal, (answer.V, answer.F), (expected.V + ORIGIN, expected.F)))
    assert "the lines of the preset have their origin at the model's point (466 000, 5 247 000, 0) m" in notes
