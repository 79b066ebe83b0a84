"""Feet, holes, trimming and splitting: volumes in closed form, topology, and the tests that every solid passes."""

import json

import numpy as np
import pytest
import trimesh

import dsfab
from dsfab.app.cli import main
from dsfab.core.arrays import polygon_perimeter
from dsfab.core.errors import PresetError, SolidError
from dsfab.surface import Surface
from dsfab.surface.loads.pickers import All, Ball, Side
from dsfab.thickening import Base, Solid, SplitBodies, offsets, parts, thicken, with_extras
from dsfab.thickening.extras.cutting import Holes, Trim
from dsfab.thickening.extras.feet_and_rings import Feet, Ring, bend_points
from dsfab.thickening.self_intersection import intersecting_pairs
from tests.shapes import grid, jittered, moebius, sphere


@pytest.fixture(scope="module")
def thick_plate():
    surface = jittered(grid(20, 10, 2.0, 1.0))
    return thicken(surface, offsets(surface, 0.03).D), Base(surface, surface, lambda marks: marks)


@pytest.fixture(scope="module")
def shell():
    ball = sphere(4)
    return thicken(ball, offsets(ball, 0.1).D), Base(ball, ball, lambda marks: marks)


def made(what: tuple[Solid, Base], *extras) -> Solid:
    """The solid with extras, judged by others, in double and in single precision."""
    solid = with_extras(what[0], extras, what[1])
    mesh = trimesh.Trimesh(solid.V, solid.F, process=False)
    assert mesh.is_volume
    assert mesh.volume == pytest.approx(solid.volume, rel=1e-9)
    assert len(intersecting_pairs(solid.V, solid.F)) == 0
    assert solid.notes == what[0].notes
    euler = len(solid.V) - len(mesh.edges_unique) + len(solid.F)
    assert 2 * solid.genus == 2 * mesh.body_count - euler
    return solid


def rod(diameter: float, length: float) -> float:
    """Volume of a prism of 48 sides in a cylinder, 0.3 % less than that of the cylinder."""
    return 24 * (diameter / 2) ** 2 * np.sin(np.pi / 24) * length


def test_holes_take_their_volume_and_make_handles(thick_plate):
    solid = made(thick_plate, Holes(at=((0.5, 0.5, 0.0), (1.5, 0.5, 0.0)), diameter=0.1, depth=0.2))
    assert solid.volume == pytest.approx(0.06 - 2 * rod(0.1, 0.03), rel=1e-9)
    assert (solid.genus, solid.pieces) == (2, 1)


def test_a_hole_keeps_its_depth(shell):
    """Into one side of a hollow ball: its void opens, the other side stays whole."""
    solid = made(shell, Holes(at=((0.0, 0.0, 1.0),), diameter=0.2, depth=0.4))
    assert (solid.genus, solid.pieces) == (0, 1)
    assert shell[0].volume - solid.volume == pytest.approx(rod(0.2, 0.1), rel=0.05)
    assert made(shell, Holes(at=((0.0, 0.0, 0.0),), diameter=0.2, depth=4.0)).genus == 1


def test_holes_follow_their_axis(thick_plate):
    solid = made(thick_plate, Holes(at=((0.5, 0.5, 0.0),), diameter=0.1, depth=0.5, axis=(1.0, 0.0, 1.0)))
    assert solid.volume == pytest.approx(0.06 - rod(0.1, 0.03 * np.sqrt(2)), rel=1e-9)


def test_a_trim_removes_the_side_of_its_normal(thick_plate):
    solid = made(thick_plate, Trim(point=(0.5, 0.0, 0.0), normal=(2.0, 0.0, 0.0)))
    assert solid.volume == pytest.approx(0.5 * 0.03, rel=1e-9)
    assert solid.box[1][0] == pytest.approx(0.5)


def test_a_trim_box_keeps_its_inside(thick_plate):
    solid = made(thick_plate, Trim(low=(0.1, 0.2, -1.0), high=(0.7, 0.9, 0.005)))
    assert solid.volume == pytest.approx(0.6 * 0.7 * 0.02, rel=1e-9)
    assert solid.box == pytest.approx(np.array([[0.1, 0.2, -0.015], [0.7, 0.9, 0.005]]))


def test_feet_stand_under_the_picked_vertices(thick_plate):
    solid = made(thick_plate, Feet(at=Side(axis="x", end="min"), height=0.1, margin=0.05, sink=0.015))
    assert solid.volume == pytest.approx(0.06 + 0.1 * 1.1 * (0.1 - 0.015) + (0.1 * 1.1 - 0.05 * 1.0) * 0.03, rel=1e-9)
    assert solid.box[0] == pytest.approx([-0.05, -0.05, -0.1])


def test_parts_that_are_apart_get_a_foot_each(thick_plate):
    corners = [Ball(center=(x, y, 0.0), radius=0.15) for x in (0.0, 2.0) for y in (0.0, 1.0)]
    solid = made(thick_plate, *(Feet(at=at, height=0.2, margin=0.01, sink=0.01) for at in corners))
    marks = np.logical_or.reduce([at.vertices(thick_plate[1].surface) for at in corners])
    assert len(thick_plate[1].parts(marks)) == 4
    below = solid.V[solid.V[:, 2] < -0.1]
    assert len(below) == 16
    assert solid.genus == 0


def test_a_ring_beam_runs_around_a_plate(thick_plate):
    """The beam's middle line is 6 m long; inside of it lies a smaller plate."""
    solid = made(thick_plate, Ring(width=0.1, height=0.08))
    assert solid.volume == pytest.approx(6 * 0.1 * 0.08 + 1.9 * 0.9 * 0.03, rel=1e-9)
    assert solid.box == pytest.approx(np.array([[-0.05, -0.05, -0.04], [2.05, 1.05, 0.04]]))
    assert (solid.genus, solid.pieces) == (0, 1)


def test_ring_beams_follow_curved_boundaries_and_holes():
    """Half a ball without its top: the beams are rings with the section's area times the middle lines [Pappus]."""
    ball = sphere(4)
    ball = Surface(ball.V, ball.F[(ball.centroids[:, 2] > 0) & (ball.centroids[:, 2] < 0.9)])
    ball = Surface(ball.V[(used := np.unique(ball.F))], np.searchsorted(used, ball.F))
    ball = Surface(np.c_[ball.V[:, :2], np.where(ball.V[:, 2] < 1e-9, 0.0, ball.V[:, 2])], ball.F)
    shell = thicken(ball, offsets(ball, 0.02).D), Base(ball, ball, lambda marks: marks)
    length = polygon_perimeter(ball.V[ball.loops[0]])
    base = made(shell, Ring(width=0.06, height=0.1, at=Side(axis="z", end="min")))
    sunk = 0.03 * length * 0.02  # half of the section's width is in the shell already
    assert base.volume - shell[0].volume == pytest.approx(0.06 * 0.1 * length - sunk, rel=2e-3)
    both = made(shell, Ring(width=0.06, height=0.1))
    assert both.volume > base.volume + 0.8 * 0.06 * 0.08 * polygon_perimeter(ball.V[ball.loops[1]])
    assert (base.genus, both.genus) == (1, 1)


def test_a_ring_beam_runs_along_the_one_edge_of_a_moebius_strip():
    strip = moebius(80, 8, 0.8)
    offset = offsets(strip, 0.02)
    solid = thicken(strip, offset.at_corners(strip.F).reshape(-1, 3)[np.unique(strip.F, return_index=True)[1]])
    ringed = made((solid, Base(strip, strip, lambda marks: marks)), Ring(width=0.05, height=0.06))
    assert ringed.volume - solid.volume == pytest.approx(polygon_perimeter(strip.V[strip.loops[0]]) * 0.0025, rel=0.02)


def test_parts_of_a_split_fit_the_bed_and_keep_the_volume(thick_plate):
    solid = made(thick_plate, SplitBodies(bed=(0.7, 0.6, 1.0), apart=0.02))
    assert solid.pieces == 6
    assert solid.volume == pytest.approx(0.06, rel=1e-9)
    for part in trimesh.Trimesh(solid.V, solid.F, process=False).split():
        assert (np.ptp(part.vertices, axis=0) <= [0.7, 0.6, 1.0]).all()
    assert np.ptp(solid.V, axis=0) == pytest.approx([2.04, 1.02, 0.03])


def test_parts_are_solids_of_their_own(thick_plate):
    split = made(thick_plate, SplitBodies(bed=(0.7, 0.6, 1.0), apart=0.02, dowel=0.01, deep=0.03))
    found = parts(split)
    assert [part.pieces for part in found] == [1] * 6
    assert sum(part.volume for part in found) == pytest.approx(split.volume, rel=1e-12)
    assert sum(len(part.F) for part in found) == len(split.F)
    assert [part.genus for part in found] == [0] * 6
    for part in found:
        mesh = trimesh.Trimesh(part.V, part.F, process=False)
        assert mesh.is_volume
        assert mesh.body_count == 1
        assert (np.ptp(part.V, axis=0) <= [0.7, 0.6, 1.0]).all()
    first = np.array([part.box[0] for part in found])
    assert (np.lexsort(first.T) == np.arange(6)).all()
    assert parts(thick_plate[0]) == (thick_plate[0],)


def test_voids_stay_with_their_parts(shell):
    ball = shell[0]
    twice = Solid(
        np.concatenate([ball.V, 0.5 * ball.V + [3, 0, 0]]), np.concatenate([ball.F, ball.F + len(ball.V)]), 0, 2
    )
    found = parts(twice)
    assert [part.volume for part in found] == pytest.approx([ball.volume, ball.volume / 8], rel=1e-9)
    assert [(part.genus, part.pieces) for part in found] == [(0, 1)] * 2


def test_a_build_writes_a_file_for_each_part(tmp_path, capsys):
    split = 'thickening.extra=[{kind="split",bed=[0.8,0.8,0.8],apart=0.05}]'
    words = ["build", "cantilever", "--set", "surface.edge=0.08", "-f", "stl", "--no-picture", "-q", "--set"]
    assert main([*words, split, "-o", str(tmp_path / "out")]) == 0
    names = json.loads((tmp_path / "out" / "design.json").read_text())["files"]
    assert names[0] == "cantilever.stl"
    assert names[1:] == [f"cantilever_{k}.stl" for k in range(1, len(names))]
    whole, *each = (trimesh.load_mesh(tmp_path / "out" / name) for name in names)
    assert len(each) >= 6
    assert sum(part.volume for part in each) == pytest.approx(whole.volume, rel=1e-6)
    assert all((part.extents <= 801).all() and part.body_count == 1 for part in each)  # millimetres


def test_dowels_are_drilled_into_every_cut_face(thick_plate):
    """Two cuts across x with two faces each, one across y with three: seven, in both parts."""
    solid = made(thick_plate, SplitBodies(bed=(0.7, 0.6, 1.0), apart=0.02, dowel=0.01, deep=0.03))
    assert solid.volume == pytest.approx(0.06 - 7 * rod(0.01, 0.06), rel=1e-9)
    assert (solid.genus, solid.pieces) == (0, 6)
    thick = made(thick_plate, SplitBodies(bed=(0.7, 0.6, 1.0), apart=0.02, dowel=0.02, deep=0.03))
    assert thick.volume == pytest.approx(0.06, rel=1e-9)  # the faces are too narrow for these


@pytest.mark.parametrize("bed", [(1.2, 2.0, 1.0), (3.0, 0.6, 1.0)])
def test_dowels_sit_in_the_middle_of_the_thickness(thick_plate, bed):
    off = Trim(low=(0.0, 0.0, -0.015), high=(2.0, 1.0, 0.005))
    solid = made(thick_plate, off, SplitBodies(bed=bed, apart=0.02, dowel=0.008, deep=0.03))
    assert solid.volume == pytest.approx(0.04 - rod(0.008, 0.06), rel=1e-9)


def test_dowels_find_the_material_of_bent_faces(shell):
    solid = made(shell, SplitBodies(bed=(1.5, 1.5, 1.5), apart=0.2, dowel=0.03, deep=0.05))
    assert shell[0].volume - solid.volume == pytest.approx(12 * rod(0.03, 0.1), rel=0.01)
    assert (solid.genus, solid.pieces) == (0, 8)


def test_extras_are_made_in_their_order(thick_plate):
    cut = Trim(point=(1.0, 0.0, 0.0), normal=(1.0, 0.0, 0.0))
    hole = Holes(at=((1.0, 0.5, 0.0),), diameter=0.1, depth=0.2)
    assert made(thick_plate, hole, cut).volume == pytest.approx(0.03 - rod(0.1, 0.03) / 2, rel=1e-6)
    assert made(thick_plate).V is thick_plate[0].V


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        (Holes(at=((0.5, 0.5, 0.0), (5.0, 0.5, 0.0)), diameter=0.1, depth=0.2), "point 2 of 2 is not on material"),
        (Holes(at=((0.5, 0.5, 0.0),), diameter=0.0, depth=0.2), "diameter must be a positive length"),
        (Holes(at=((0.5, 0.5, 0.0),), diameter=0.1, depth=0.2, axis=(0.0, 0.0, 0.0)), "is a zero vector"),
        (Trim(), "needs the keys point and normal of a plane, or low and high"),
        (Trim(point=(0.0, 0.0, 0.0)), "needs the keys point and normal"),
        (Trim(low=(0.0, 0.0, 0.0), high=(1.0, 0.0, 1.0)), "low must be below high"),
        (Trim(point=(-1.0, 0.0, 0.0), normal=(1.0, 0.0, 0.0)), "removes the whole solid"),
        (SplitBodies(bed=(1.0, 1.0, 1.0), apart=0.0), "apart must be a positive length"),
        (SplitBodies(bed=(1.0, 0.0, 1.0), apart=0.1), "positive lengths"),
        (SplitBodies(bed=(1.0, 1.0, 1.0), apart=0.1, dowel=0.01), "dowel and deep"),
        (Ring(width=0.0, height=0.1), "width must be a positive length"),
        (Ring(width=1.2, height=0.1), "would cross itself near"),
        (
            Ring(width=0.1, height=0.1, at=Ball(center=(1.0, 0.5, 0.0), radius=0.1)),
            "has a picked vertex; check the key 'at'",
        ),
        (Feet(at=All(), height=-0.1, margin=0.05, sink=0.01), "height must be a positive length"),
    ],
)
def test_an_extra_that_cannot_be_made_is_refused(thick_plate, extra, words):
    with pytest.raises(SolidError, match=words):
        with_extras(thick_plate[0], [extra], thick_plate[1])


def test_a_foot_beside_the_solid_is_refused(thick_plate):
    gone = Trim(point=(0.5, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    with pytest.raises(SolidError, match="does not touch"):
        made(thick_plate, gone, Feet(at=Side(axis="x", end="min"), height=0.1, margin=0.05, sink=0.015))


def test_a_ring_beam_beside_the_solid_is_refused(thick_plate):
    inner = Trim(low=(0.5, 0.3, -1.0), high=(1.5, 0.7, 1.0))
    with pytest.raises(SolidError, match="does not touch"):
        made(thick_plate, inner, Ring(width=0.1, height=0.1))


def test_a_preset_has_extras():
    extras = [
        {
            "kind": "feet",
            "at": {"pick": "side", "axis": "x", "end": "min"},
            "height": 0.1,
            "margin": 0.02,
            "sink": 0.01,
        },
        {"kind": "holes", "at": [[-1.01, 0.0, -0.05]], "diameter": 0.02, "depth": 0.2, "axis": [1, 0, 0]},
    ]
    preset = dsfab.load_preset("cantilever", {"surface.edge": 0.08, "thickening.extra": extras})
    design = dsfab.run(preset)
    plain = dsfab.revise(design, dsfab.load_preset("cantilever", {"surface.edge": 0.08}))
    assert design.sheet is plain.sheet or design.sheet.surface.m == plain.sheet.surface.m
    assert design.solid.volume > plain.solid.volume
    assert design.solid.box[0][2] < plain.solid.box[0][2] - 0.09
    assert trimesh.Trimesh(design.solid.V, design.solid.F, process=False).is_volume


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ({"kind": "hole"}, "thickening.extra.0.kind = 'hole' is not known; did you mean holes"),
        ({}, "thickening.extra.0 needs kind"),
        ({"kind": "trim", "plane": 1}, r"unknown key thickening.extra.0.plane.*point, normal, low, high"),
        ({"kind": "split", "bed": [1, 1, 1]}, "thickening.extra.0.apart is missing"),
    ],
)
def test_mistakes_in_extras_are_named_by_their_key(extra, words):
    with pytest.raises(PresetError, match=words):
        dsfab.load_preset("cantilever", {"thickening.extra": [extra]})


@pytest.mark.parametrize(("bend", "corners"), [(0.8e-9, 4), (1.6e-9, 5)])
def test_a_ring_beam_has_sections_only_where_the_boundary_bends(bend, corners):
    """The boundary is 1 m long on each side, in edges of .25 m, and bends by as many radians at one vertex."""
    surface = grid(4, 4, 1.0, 1.0)
    V = surface.V.copy()
    V[np.isclose(V[:, 0], 0.5) & (V[:, 1] == 0), 1] -= bend / 8
    bent = Surface(V, surface.F)
    assert len(bend_points(bent, bent.loops[0])[0]) == corners
