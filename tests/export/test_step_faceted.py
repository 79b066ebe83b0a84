"""The text of faceted STEP: short, every point once, lines through the corners that are written, planes near them."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dsfab.export import write
from dsfab.export.cad.step import file, strategies
from dsfab.export.cad.step.entities import FACETED_DIGITS
from dsfab.export.part import part_of
from dsfab.thickening import Solid
from tests.export.other_programs import module
from tests.export.planar_solids import plate_with_hole
from tests.export.solids import solid_torus

UNIT = 10.0**-FACETED_DIGITS


def turned(solid: Solid, seed: int = 0) -> Solid:
    """Somewhere else, along no axis."""
    rotation = Rotation.random(rng=np.random.default_rng(seed))
    return replace(solid, V=solid.V @ rotation.as_matrix().T + [1.2, -3.4, 0.7])


def entities(solid: Solid) -> dict[int, tuple[str, str]]:
    """Word and arguments of every entity by its number."""
    part = replace(strategies.prepare(part_of(solid, "a", 10**6)), step="faceted")
    text = b"".join(file.encode(part)).decode()
    return {int(k): (word, rest) for k, word, rest in re.findall(r"^#(\d+)=([A-Z_0-9]+)\((.*)\);$", text, re.M)}


def numbers(text: str) -> np.ndarray:
    return np.array([float(x) for x in re.findall(r"-?\d+\.\d*", text)])


def references(text: str) -> list[int]:
    return [int(k) for k in re.findall(r"#(\d+)", text)]


@pytest.mark.parametrize("solid", [turned(solid_torus()), turned(plate_with_hole(), 1)], ids=["torus", "plate"])
def test_written_lines_join_the_written_corners_exactly(solid):
    found = entities(solid)
    points = [rest for word, rest in found.values() if word == "CARTESIAN_POINT"]
    assert len(points) == len(set(points))
    assert max(len(x) for rest in points for x in re.findall(r"\.(\d*)", rest)) == FACETED_DIGITS
    at = {k: numbers(rest) for k, (word, rest) in found.items() if word == "CARTESIAN_POINT"}
    vertex = {k: at[references(rest)[0]] for k, (word, rest) in found.items() if word == "VERTEX_POINT"}
    ends = {}
    for k, (word, rest) in found.items():
        if word != "EDGE_CURVE":
            continue
        p, q, line = references(rest)
        origin, vector = references(found[line][1])
        along = numbers(found[references(found[vector][1])[0]][1])
        assert (at[origin] == vertex[p]).all()
        steps = np.rint((vertex[q] - vertex[p]) / UNIT)
        assert (np.cross(steps, along) == 0).all()
        assert steps @ along > 0
        ends[k] = vertex[p], vertex[q]
    for word, rest in found.values():
        if word == "ADVANCED_FACE":
            *bounds, plane = references(rest)
            placement = found[references(found[plane][1])[0]][1]
            origin, axis = references(placement)
            normal = numbers(found[axis][1])
            assert np.linalg.norm(normal) == pytest.approx(1, abs=1e-3)
            steps = [k for bound in bounds for k in references(found[references(found[bound][1])[0]][1])]
            corners = np.array([x for k in steps for x in ends[references(found[k][1])[0]]])
            assert np.abs((corners - at[origin]) @ normal).max() < 4 * UNIT


def test_edges_along_an_axis_share_a_direction_whatever_their_lengths():
    directions = [rest for word, rest in entities(plate_with_hole()).values() if word == "DIRECTION"]
    assert len(directions) == 2 + 3 + 6  # of the header, of edges along three axes, and of faces


def test_a_turned_plate_still_has_ten_faces_and_is_valid(tmp_path, inspected):
    """Planes are found before the corners are rounded, which would tell small triangles from their neighbours."""
    solid = turned(plate_with_hole(), 2)
    write(solid, tmp_path / "a.step", step="faceted")
    assert (inspected["solids"], inspected["faces"], inspected["valid"]) == (1, 10, True)
    assert inspected["volume"] == pytest.approx(solid.volume * 1e9, rel=1e-6)


def test_corners_nearer_than_the_decimals_become_one(tmp_path, inspected):
    solid = solid_torus()
    V = solid.V.copy()
    a, b, *_ = solid.F[0]
    V[b] = V[a] + 3e-9  # metres: less than 1e-5 mm, more than 1e-6 mm
    write(replace(solid, V=V), tmp_path / "a.step", step="faceted")
    assert inspected["valid"]
    assert inspected["faces"] < len(solid.F)


def test_a_face_takes_less_than_900_bytes_and_files_are_reproducible():
    part = replace(strategies.prepare(part_of(turned(solid_torus()), "a", 10**6)), step="faceted")
    text = b"".join(file.encode(part))
    assert len(text) < 900 * len(part.F)
    assert b"".join(file.encode(part)) == text


@module("gmsh")
def test_gmsh_meshes_a_turned_faceted_solid_with_its_volume(tmp_path, inspected):
    import gmsh

    solid = turned(plate_with_hole(), 3)
    path = write(solid, tmp_path / "a.step", step="faceted")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.importShapes(str(path))
        gmsh.model.occ.synchronize()
        assert len(gmsh.model.getEntities(3)) == 1
        assert gmsh.model.occ.getMass(3, gmsh.model.getEntities(3)[0][1]) == pytest.approx(1e9 * solid.volume, rel=1e-6)
    finally:
        gmsh.finalize()
