"""Sheets that lie on themselves, numbers of few digits, and laws of reading: no unit, turn or order matters."""

from itertools import permutations

import numpy as np
import pytest
import trimesh

from dsfab.core.arrays import polygon_perimeter
from dsfab.core.errors import SurfaceError
from dsfab.preset.proposal.reading import mesh_in_file
from dsfab.surface import Surface, is_scan, mended_mesh, parallel_remarks
from dsfab.surface.clean.overlaps import overlap_remarks, overlapping_faces
from dsfab.surface.clean.seams import joined_at_points
from dsfab.surface.files import separate_process
from dsfab.surface.files.mesh_files import raw_mesh
from dsfab.surface.files.reader import describe, oriented_surface, read_surface, surface_of_file
from dsfab.surface.files.reading import LARGEST_STEP, DrawingBudget, number_steps
from dsfab.surface.files.rhino_and_step import read_occt, read_rhino_meshes
from dsfab.surface.shapes import dome, plate
from dsfab.surface.topology import boundary_loops
from tests.shapes import folded, glued, grid, jittered, joined, lifted, sphere, stacked, three_leaves, tube

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
BOTH_DIAGONALS = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]])


def vault(cells=6, twist=0.0):
    """The vertices and quads of a barrel of 6 x 8 m, 2 m high; a twist makes its quads a little uneven."""
    u, y = np.meshgrid(np.linspace(-1, 1, cells + 1), np.linspace(0, 8, cells + 1), indexing="ij")
    V = np.stack([3 * u, y, 2 * (1 - u**2) + twist * u * y], axis=-1).reshape(-1, 3)
    k = np.arange((cells + 1) ** 2).reshape(cells + 1, -1)
    return V, np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)


def halves(quads, other=False):
    """The triangles of quads, cut along their first or their other diagonal."""
    corners = ([0, 1, 3], [1, 2, 3]) if other else ([0, 1, 2], [0, 2, 3])
    return np.concatenate([quads[:, corner] for corner in corners])


def area(V, F):
    return Surface(V, F).area


def facts(mesh):
    """The area, the number of pieces, and the lengths of the boundaries of a mended mesh, as shares of its size."""
    surface = oriented_surface(mesh.V, mesh.F)
    size = np.sqrt(surface.area)
    loops = [polygon_perimeter(surface.V[loop]) for loop in boundary_loops(surface.F, surface.edges)]
    return surface.area, surface.pieces[0], np.sort(loops) / size


@pytest.mark.parametrize("order", list(permutations(range(4))))
def test_a_square_with_both_diagonals_is_one_square(order):
    for turned in range(4):
        F = BOTH_DIAGONALS[list(order)]
        F[turned] = F[turned, ::-1]
        mesh = mended_mesh(SQUARE, F)
        assert len(mesh.F) == 2
        assert area(mesh.V, mesh.F) == pytest.approx(1.0, abs=1e-15)
        assert mesh.repairs == ("dsfab dropped 2 faces of a second copy of the sheet",)


@pytest.mark.parametrize("twist", [0.0, 0.02])
@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("share", [1, 3])
def test_quads_that_are_also_triangles_count_once(twist, apart, share):
    """All quads, or each third, also along their other diagonal, from the other side, and before the sheet itself."""
    V, quads = vault(twist=twist)
    again = halves(quads[::share], other=True)[:, ::-1]
    once, n = halves(quads), len(V) if apart else 0
    mesh = mended_mesh(np.vstack([V, V]) if apart else V, np.vstack([again, once + n]))
    assert len(mesh.F) == len(once)
    assert facts(mesh)[1] == 1
    assert len(facts(mesh)[2]) == 1
    assert area(mesh.V, mesh.F) == pytest.approx(area(V, once), rel=1e-3 if twist else 1e-12)


@pytest.mark.parametrize("other", [False, True])
def test_two_strips_that_overlap_by_a_third_are_one_vault(other):
    """No crossing: the quads of the second strip have the same corners, but perhaps other diagonals."""
    V, quads = vault()
    both, faces = np.vstack([V, V]), np.vstack([halves(quads[:24]), halves(quads[12:], other) + len(V)])
    mesh = mended_mesh(both, faces)
    (words,) = overlap_remarks(both, faces, faces[:0, 0])
    assert words.startswith("24 of 96 faces lie on other faces in the same plane")
    assert len(mesh.F) == 2 * len(quads)
    assert facts(mesh)[:2] == (pytest.approx(area(V, halves(quads)), rel=1e-12), 1)


def test_a_gap_between_two_edges_at_one_place_gets_no_face():
    V = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, -1, 0], [1, 0, 0]], dtype=float)
    assert joined_at_points(V, np.array([[0, 1, 2], [0, 3, 4]]))[1] == 0


def test_sheets_with_other_seams_are_one_sheet():
    """Two plates of 3 x 2 m in other divisions share their corners only."""
    for nx, ny in ((2, 3), (5, 4), (7, 1)):
        both = joined(grid(3, 2, 3.0, 2.0), jittered(grid(nx, ny, 3.0, 2.0)))
        mesh = mended_mesh(both.V, both.F)
        assert facts(mesh)[:2] == (pytest.approx(6.0, rel=1e-12), 1)
        assert "second copy" in mesh.repairs[-1] or "on top of other faces" in mesh.repairs[-1]


def test_two_curved_sheets_with_other_divisions_and_one_border_are_one():
    """Inside their common border they part by up to a thousandth, and are one piece."""

    def sheet(seed):
        flat = jittered(grid(12, 12, 10.0, 10.0), seed=seed)
        x, y = flat.V[:, :2].T
        return Surface(np.c_[x, y, 0.03 * x * (10 - x) + 0.02 * y**2], flat.F)

    one, other = sheet(1), sheet(2)
    both = joined(one, Surface(other.V, other.F[:, ::-1]))
    mesh = mended_mesh(both.V, both.F)
    assert "second copy of the sheet" in mesh.repairs[-1]
    assert facts(mesh)[:2] == (pytest.approx(one.area, rel=1e-3), 1)


def test_sheets_at_a_distance_folds_and_crossing_sheets_stay():
    flat = grid(8, 6, 4.0, 3.0)
    for surface in (stacked(flat, 0.2), folded(0.05), three_leaves(), tube(12, 4), sphere(2), glued(dome(edge=0.9))):
        overlapping = overlapping_faces(surface.V, surface.F)
        assert len(overlapping.whole) == len(overlapping.part) == 0


def test_a_doubled_ribbon_of_small_faces_is_one_ribbon():
    """1.2 km long, with edges of 1 m: its faces are below a millionth of its size squared."""
    ribbon = grid(1200, 1, 1200.0, 1.0)
    both = joined(ribbon, Surface(ribbon.V, ribbon.F[:, ::-1]))
    (words,) = overlap_remarks(both.V, both.F, both.F[:0, 0])
    assert words.startswith("2400 of 4,800 faces lie on other faces")
    assert len(mended_mesh(both.V, both.F).F) == ribbon.m


def test_a_corner_far_away_makes_no_scan_and_no_sheet_on_another():
    """Three floors, and a triangle with a corner 1000 km away, beside which they are small, thin and close."""
    floor = grid(16, 12, 4.0, 3.0)
    floors = joined(stacked(floor, 3.0), Surface(floor.V + [0, 0, 6.0], floor.F))
    both = joined(floors, Surface([[0, 5, 0], [1, 5, 0], [1, 6, 1e6]], [[0, 1, 2]]))
    assert list(overlap_remarks(both.V, both.F, both.F[:0, 0])) == []
    assert not is_scan(both.V, both.F)


def test_a_lap_of_two_panels_is_named_and_stays():
    left, right = grid(4, 2, 2.0, 1.0), grid(4, 2, 2.0, 1.0)
    lap = joined(left, Surface(right.V + [1.7, 0.13, 0], right.F))
    assert mended_mesh(lap.V, lap.F).repairs == ()
    (words,) = parallel_remarks(lap.V, lap.F)
    assert words.startswith("8 of 32 faces lie partly on other faces in the same plane (first: 3, 7, ")
    assert words.endswith("cut these faces where they meet other faces")


def test_faces_whose_corners_fall_together_are_not_compared():
    V, F = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=float), np.array([[0, 1, 2], [2, 1, 0]])
    assert list(overlap_remarks(V, F, F[:0, 0])) == []


def test_a_flange_on_a_sheet_keeps_the_wall_on_it_closed():
    """Without the flange the wall would end in a free edge: the flange stays, and is named."""
    flat = grid(6, 6, 6.0, 6.0)
    corners = np.array([[1.3, 2, 0], [2.3, 2, 0], [2.3, 4, 0], [1.3, 4, 0], [2.3, 2, 1], [2.3, 4, 1]])
    flange = Surface(corners, np.array([[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]))
    both = joined(flat, flange)
    overlapping = overlapping_faces(both.V, both.F)
    assert len(overlapping.whole) == 0
    assert {flat.m, flat.m + 1} <= {*overlapping.part.tolist()}


def test_a_copy_of_a_fine_sheet_is_no_scan():
    """A repair of a scan would fill its small openings."""
    fine = grid(60, 60, 10.0, 10.0)
    assert not is_scan(fine.V, np.vstack([fine.F, fine.F[:, ::-1]]))


IN_PROCESS = {"meshes": lambda path, only: read_rhino_meshes(path, DrawingBudget(), only), "cad": read_occt}
UNITS = {"m": 1.0, "mm": 1e3, "in": 1 / 0.0254}


def barrel(angle, y):
    """Points (..., 3) of a barrel with a radius of 3.25 m, 6 m wide and 2 m high."""
    return np.stack([3.25 * np.cos(angle), y, 3.25 * np.sin(angle) - 1.25], axis=-1)


LOW = np.arcsin(1.25 / 3.25)


def step_panels(folder):
    """Cylinders between arcs; the second of each pair is extruded backwards along the reversed arc."""
    b3d = pytest.importorskip("build123d")
    for unit, scale in UNITS.items():
        faces = []
        for k in range(4):
            arcs = [[tuple(scale * x) for x in barrel(np.linspace(LOW, np.pi - LOW, 3), np.full(3, 2.0 * y))]
                    for y in (k, k + 1)]  # fmt: skip
            there = b3d.Edge.make_three_point_arc(*arcs[0])
            back = b3d.Edge.make_three_point_arc(*arcs[1][::-1])
            faces += [b3d.Face.extrude(edge, (0, way * 2 * scale, 0)) for edge, way in ((there, 1), (back, -1))]
        path = folder / f"panels_{unit}.step"
        b3d.export_step(b3d.Compound(children=faces), path, unit=getattr(b3d.Unit, unit.upper()))
        yield path


def panel_faces(scale):
    """Vertices (n, 3) and triangles of four panels, and of the same panels in other halves and the other direction."""
    angle, y = np.meshgrid(np.linspace(LOW, np.pi - LOW, 33), np.linspace(0, 8, 5), indexing="ij")
    k = np.arange(angle.size).reshape(angle.shape)
    quads = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], axis=-1).reshape(-1, 4)
    return scale * barrel(angle, y).reshape(-1, 3), np.vstack([halves(quads), halves(quads, other=True)[::-1, ::-1]])


def dxf_panels(folder):
    ezdxf = pytest.importorskip("ezdxf")
    for unit, scale in UNITS.items():
        drawing, (V, F) = ezdxf.new(units={"m": 6, "mm": 4, "in": 1}[unit]), panel_faces(scale)
        for corners in V[F].tolist():
            drawing.modelspace().add_3dface([*corners, corners[2]])
        drawing.saveas(folder / f"panels_{unit}.dxf")
        yield folder / f"panels_{unit}.dxf"


def rhino_panels(folder):
    rhino3dm = pytest.importorskip("rhino3dm")
    for unit, scale in UNITS.items():
        model, mesh, (V, F) = rhino3dm.File3dm(), rhino3dm.Mesh(), panel_faces(scale)
        names = {"m": "Meters", "mm": "Millimeters", "in": "Inches"}
        model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, names[unit])
        for point in V.tolist():
            mesh.Vertices.Add(*point)
        for face in F.tolist():
            mesh.Faces.AddFace(*face)
        model.Objects.AddMesh(mesh)
        model.Write(str(folder / f"panels_{unit}.3dm"), 7)
        yield folder / f"panels_{unit}.3dm"


PANELS = {".step": step_panels, ".dxf": dxf_panels, ".3dm": rhino_panels}


def ply(path, V, F, kind):
    """A binary PLY with numbers of 4 or 8 bytes."""
    rows = np.empty(len(F), [("n", "u1"), ("v", "<i4", 3)])
    rows["n"], rows["v"] = 3, F
    word = {"<f4": "float", "<f8": "double"}[kind]
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(V)}\n" + "".join(
        f"property {word} {axis}\n" for axis in "xyz"
    )
    head += f"element face {len(F)}\nproperty list uchar int vertex_indices\nend_header\n"
    path.write_bytes(head.encode() + V.astype(kind).tobytes() + rows.tobytes())
    return path


def off(path, V, F):
    """An OFF with six digits, as gmsh writes it."""
    lines = [f"OFF\n{len(V)} {len(F)} 0", *(" ".join(f"{x:.6g}" for x in p) for p in V.tolist())]
    path.write_text("\n".join([*lines, *("3 {} {} {}".format(*f) for f in F.tolist())]) + "\n")
    return path


@pytest.mark.parametrize("suffix", [".ply", ".stl", ".glb", ".obj", ".off"])
def test_a_vault_with_both_diagonals_is_one_vault_in_each_format(suffix, tmp_path):
    """Each third quad of a barrel also along its other diagonal, as exporters write it; glTF has y up."""
    V, quads = vault()
    F = np.vstack([halves(quads), halves(quads[::3], other=True)[:, ::-1]])
    path = tmp_path / f"vault{suffix}"
    turned = V[:, [0, 2, 1]] * [1, 1, -1] if suffix == ".glb" else V
    trimesh.Trimesh(turned, F, process=False).export(path)
    surface = read_surface(path, mend=True)
    assert surface.m == 2 * len(quads)
    assert surface.area == pytest.approx(area(V, halves(quads)), rel=1e-6)
    assert any("lie on other faces in the same plane" in fault for fault in describe(path).faults)


@pytest.mark.parametrize("suffix", [pytest.param(".step", marks=pytest.mark.slow), ".dxf", ".3dm"])
def test_panels_drawn_twice_are_as_large_in_each_unit(suffix, tmp_path, monkeypatch):
    """Four panels of a barrel, each also drawn from its other end: in metres, millimetres and inches."""
    monkeypatch.setattr(separate_process, "foreign_triangles", lambda kind, path, _, only: IN_PROCESS[kind](path, only))
    sizes = [read_surface(path, mend=True).area for path in PANELS[suffix](tmp_path)]
    assert len(sizes) == 3
    assert sizes == pytest.approx([sizes[0]] * 3, rel=1e-7 if suffix == ".3dm" else 1e-9)  # rhino3dm: 32-bit vertices
    assert sizes[0] == pytest.approx(61.1, abs=0.1)


SITE = {"near": [0, 0, 0], "town": [2600.3, 1200.7, 400], "land": [691234.5, 334567.8, 500], "far": [4.4e6, 5.3e6, 500]}


@pytest.mark.parametrize("write", ["six digits", "ply", "stl", "double"])
@pytest.mark.parametrize("site", SITE)
def test_too_few_digits_far_away_are_named_and_refused(site, write, tmp_path):
    """A dome 20 m wide with edges of .9 m: the words state step and edge, and no unit is blamed."""
    V, F = dome(edge=0.9).V + SITE[site], dome(edge=0.9).F
    if write == "six digits":
        path = off(tmp_path / "roof.off", V, F)
    elif write == "stl":
        path = tmp_path / "roof.stl"
        trimesh.Trimesh(V, F, process=False).export(path)
    else:
        path = ply(tmp_path / "roof.ply", V, F, "<f8" if write == "double" else "<f4")
    raw = raw_mesh(path)
    words = [text for text in raw.record.read if "steps" in text]
    expected = {"six digits": {"land": 1.0, "far": 10.0}, "double": {}}.get(write, {"far": 0.5})
    if site not in expected:
        assert words == [] or number_steps(raw.V, raw.F)[0] < LARGEST_STEP
        assert surface_of_file(path, raw).surface.m == len(F)
        assert words == [] or site in ("town", "land")
        return
    assert f"has steps of {expected[site]:g} in this file" in words[0]
    assert words[0].endswith("export the mesh near the origin")
    sentence = rf"[xy] has steps of {expected[site]:g} m in this file \(.*\), but the mean edge length is .* m: export"
    with pytest.raises(SurfaceError, match=sentence):
        surface_of_file(path, raw)
    assert describe(path).faces == len(F)


def test_a_file_of_round_numbers_near_the_origin_has_no_steps():
    for surface in (grid(8, 8, 8.0, 8.0), plate(edge=0.5)):
        assert number_steps(surface.V, surface.F) == (0.0, "")
        assert number_steps(surface.V + [2.6e6, 1.2e6, 0.1], surface.F) == (0.0, "")
    whole = grid(8, 8, 8.0, 8.0)
    assert number_steps(whole.V + [451230, 541230, 520], whole.F) == (0.0, "")
    assert "32-bit numbers" in number_steps(whole.V + [451230, 541230 + 1 / 16, 520], whole.F)[1]


def test_closed_parts_with_one_common_corner_stay_as_they_are():
    """Two tetrahedra with one common vertex have no border that a face could join."""
    V = np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    F = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3], [0, 4, 5], [0, 6, 4], [0, 5, 6], [4, 6, 5]])
    mesh = mended_mesh(V, F)
    assert mesh.repairs == ()
    assert len(mesh.F) == 8


def test_open_cones_tip_to_tip_are_not_called_closed():
    V = np.array([[0, 0, 0], [1, 0, 1], [-1, 1, 1], [-1, -1, 1], [1, 0, -1], [-1, 1, -1], [-1, -1, -1]], dtype=float)
    F = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [0, 5, 4], [0, 6, 5], [0, 4, 6]])
    with pytest.raises(SurfaceError, match=r"^parts touch in a point inside the surface \(first: vertex 0\)"):
        oriented_surface(V, F)


def beside(division):
    """Two plates of 4 x 4 m side by side; the first has another division along the seam."""
    return joined(grid(4, division, 4.0, 4.0), Surface(grid(4, 4, 4.0, 4.0).V + [4, 0, 0], grid(4, 4, 4.0, 4.0).F))


VAULT, QUADS = vault()
SADDLE = lifted(lambda x, y: 0.2 * x * y)
ROOF = dome(edge=0.9)
ZOO = {
    "both diagonals": (SQUARE, BOTH_DIAGONALS),
    "quads twice": (VAULT, np.vstack([halves(QUADS), halves(QUADS[::3], other=True)])),
    "soup": (ROOF.V[ROOF.F.ravel()], np.arange(3 * ROOF.m).reshape(-1, 3)),
} | {
    name: (surface.V, surface.F)
    for name, surface in {
        "copy": joined(SADDLE, SADDLE),
        "slab": stacked(grid(6, 4, 3.0, 2.0), 0.1),
        "seam": beside(4),
        "other seam": beside(3),
        "dome": ROOF,
        "tube": tube(12, 4),
    }.items()
}


def turn(angle):
    """A rotation about the axis (1, 2, 3)."""
    k = np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


@pytest.mark.parametrize("name", ZOO)
def test_reading_depends_on_no_unit_place_turn_or_order(name):
    """The same area, pieces and boundary lengths, to 1e-9 relative; to 1e-6 after a move by 1e7."""
    V, F = ZOO[name]
    rng = np.random.default_rng(3)
    shuffle, renumber = rng.permutation(len(F)), rng.permutation(len(V))
    order = np.argsort(renumber)
    rolled = np.stack([np.roll(f, k) for f, k in zip(order[F[shuffle]], rng.integers(3, size=len(F)), strict=True)])
    last_bits = np.nextafter(V, V + rng.choice([-1.0, 1.0], V.shape))
    cases = [(scale * V, F, scale, 1e-9) for scale in (1000.0, 39.37, 1e-3)]
    cases += [(V @ turn(0.7).T, F, 1.0, 1e-9), (V[renumber], rolled, 1.0, 1e-9), (last_bits, F, 1.0, 1e-9)]
    cases += [(V + [1e7, -2e6, 300.0], F, 1.0, 1e-6), (V[:, [1, 0, 2]] * [1, -1, 1], F, 1.0, 1e-9)]
    expected = facts(mended_mesh(V, F))
    for moved, faces, scale, precision in cases:
        measured = facts(mended_mesh(moved, faces))
        assert measured[0] / scale**2 == pytest.approx(expected[0], rel=precision)
        assert measured[1] == expected[1]
        assert measured[2] == pytest.approx(expected[2], rel=precision)


@pytest.mark.slow
def test_proposed_supports_depend_on_no_unit_and_no_place(tmp_path):
    """A vault with every third quad drawn twice stands on the same lines in metres, inches and far away."""
    V, quads = vault(cells=12)
    F = np.vstack([halves(quads), halves(quads[::3], other=True)])
    lines = []
    for name, moved, unit in (("m", V, "m"), ("in", V / 0.0254, "in"), ("far", V + [1e7, -2e6, 300], "m")):
        path = tmp_path / f"{name}.obj"
        corners = "".join("v {!r} {!r} {!r}\n".format(*point) for point in moved.tolist())
        path.write_text(corners + "".join("f {} {} {}\n".format(*face) for face in (F + 1).tolist()))
        mesh = mesh_in_file(path, unit, "z")
        lines.append([place.length for place in mesh.places])
    assert len(lines[0]) == 2
    assert lines[1] == pytest.approx(lines[0], rel=1e-9)
    assert lines[2] == pytest.approx(lines[0], rel=1e-6)


@pytest.mark.parametrize(("share", "count"), [(0.85, 1), (0.75, 0)])
def test_sheets_are_parallel_if_the_smaller_has_over_four_fifths_of_the_area(share, count):
    """A far smaller sheet is another part, such as a patch or a canopy."""
    large, small = grid(8, 8, 1.0, 1.0), grid(8, 8, 1.0, share)
    both = joined(large, Surface(small.V + [0, (1 - share) / 2, 0.05], small.F))
    assert len(list(parallel_remarks(both.V, both.F))) == count


@pytest.mark.parametrize(("size", "is_far"), [(1.0, True), (1.4, False)])
def test_six_digits_are_remarked_if_a_mesh_is_a_hundred_times_its_size_away(size, is_far):
    """121 m away the sixth digit is a millimetre, and the edges are 2 cm long."""
    surface = grid(round(size / 0.02), 2, size, 0.04)
    words = number_steps(np.round(surface.V + [121.0 - size, 0, 0], 3), surface.F)[1]
    assert ("6 digits" in words) == is_far
