"""Section forces n, m and q: closed forms, equilibrium over sections, invariants, and the files that hold them."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

import dsfab
from dsfab.app.cli import main
from dsfab.core.errors import ExportError
from dsfab.export import FORMATS
from dsfab.statics import CONVENTION, Elements, SectionForces
from dsfab.statics.internal_forces import local_frames
from dsfab.surface import Surface
from tests.members.loaded_shells import carried, forces_of, loaded_strip, short_tube
from tests.shapes import ZOO, grid, jittered, sphere, subsurface
from tests.statics.supports import hold, order, rim


def test_a_strip_hogs_and_its_shear_is_the_force_at_its_tip():
    """m_x = -F (L - x): pressed against the normals, the side of the normals is stretched. q_x = F, exactly."""
    s, found = loaded_strip(16, 3, (0, 0, -100.0))
    assert_allclose(found.m[:, 0], -100 * (1 - s.centroids[:, 0]), atol=1e-6)
    assert_allclose(found.q, np.tile([100.0, 0.0], (s.m, 1)), atol=1e-4)
    assert_allclose(found.m[:, 1:], 0, atol=1e-5)
    assert_allclose(found.n, 0, atol=1e-6)


def test_needles_are_answered_by_constant_moments_which_balance_their_shear_too():
    s, found = loaded_strip(40, 8, (0, 0, -100.0), Elements("quadratic", "midedge"))
    inner = (s.centroids[:, 0] > 0.15) & (s.centroids[:, 0] < 0.85)
    assert_allclose(np.average(found.q[inner, 0], weights=s.areas[inner]), 100, rtol=0.03)
    assert_allclose(carried(s, found, 0, 0.4, 0.6)[2], -15.0, rtol=1e-4)


def test_a_strip_in_its_plane_pulls_above_and_shears_as_a_parabola():
    """n_x = F (L - x) y / I and n_xy = F (b^2 / 4 - y^2) / 2 I, for a force F down at the tip, per thickness."""
    s, found = loaded_strip(32, 8, (0, -1000.0, 0), width=0.2)
    b, total = 0.2, 1000 * 0.2
    y, x = s.centroids[:, 1] - b / 2, s.centroids[:, 0]
    inner = (x > 0.2) & (x < 0.8)
    bent = total * (1 - x) * y * 12 / b**3
    assert_allclose(found.n[inner, 0], bent[inner], atol=2e-3 * np.abs(bent).max())
    shear = -total * (b**2 / 4 - y**2) * 6 / b**3
    assert_allclose(found.n[inner, 2], shear[inner], atol=0.02 * np.abs(shear).max())
    assert_allclose(carried(s, found, 0, 0.2, 0.8)[:2], [0, -total], atol=1e-6)
    assert np.abs(found.m).max() == np.abs(found.q).max() == 0


def test_a_supported_plate_has_naviers_moments_and_edge_shear():
    """.04789 p a^2 in the middle, .338 p a across the middle of an edge [Timoshenko and Woinowsky-Krieger, table 8];
    q is that of the faces along the edge, drawn on to it."""
    moments, shears = [], []
    for cells in (8, 16, 32):
        s = jittered(grid(cells, cells, 1.0, 1.0))
        found = forces_of(s, hold(s, (np.ones(s.n, dtype=bool), "xy"), (rim(s), "z")), face=(0, 0, -1e3))
        middle = (np.linalg.norm(s.V - (0.5, 0.5, 0), axis=1).argmin() == s.F).any(axis=1)
        moments.append(abs(found.m[middle, :2].mean() / 47.89 - 1))
        side = (np.abs(s.centroids[:, 1] - 0.5) < 0.1) & (s.centroids[:, 0] < 0.12)
        shears.append(abs(np.polyfit(s.centroids[side, 0], found.q[side, 0], 1)[1] / 338 - 1))
        assert found.q[side, 0].min() > 0 > found.q[s.centroids[:, 0] > 0.9, 0].max()
    assert order(moments) > 1.2
    assert moments[-1] < 5e-3
    assert shears[-1] < 0.025 < shears[0]


def test_a_tube_under_pressure_has_the_hoop_force_p_r():
    s, fixed, out = short_tube()
    found = forces_of(s, fixed, face=1e4 * out)
    hoop = found.principal("n")
    assert_allclose(hoop.values, np.tile([1e4, 0.0], (s.m, 1)), atol=500)
    assert np.average(hoop.values[:, 0], weights=s.areas) == pytest.approx(1e4, rel=2e-3)
    assert np.abs(hoop.direction[:, 2]).max() < 0.05


def test_a_hemisphere_under_its_weight_has_the_dome_formulas():
    """n_phi = -w R / (1 + cos phi), n_theta = w R (1 / (1 + cos phi) - cos phi), on a base that is free to spread:
    rings are stretched from 51.8 degrees on [Timoshenko and Woinowsky-Krieger, 105]."""
    ball = sphere(4)
    s = subsurface(ball, ball.centroids[:, 2] > 0)
    x, y = (np.abs(s.V[:, axis]) < 1e-9 for axis in (0, 1))
    found = forces_of(s, hold(s, (rim(s), "z"), (x, "x"), (y, "y")), face=(0, 0, -1e3))
    cos = s.centroids[:, 2] / np.linalg.norm(s.centroids, axis=1)
    meridian = np.cross(s.normals, np.cross(s.normals, (0, 0, 1.0)))
    meridian /= np.linalg.norm(meridian, axis=1, keepdims=True)
    c, d = np.einsum("max,mx->am", found.frame, meridian)
    phi = found.n[:, 0] * c**2 + found.n[:, 1] * d**2 + 2 * found.n[:, 2] * c * d
    theta = found.n[:, 0] + found.n[:, 1] - phi
    for value, exact in ((phi, -1e3 / (1 + cos)), (theta, 1e3 * (1 / (1 + cos) - cos))):
        assert_allclose(value, exact, atol=100)
        assert np.sqrt(np.average((value - exact) ** 2, weights=s.areas)) < 20


def test_needle_faces_do_not_spoil_the_shear_around_them():
    """Nodes of a strip moved onto their neighbours, all but a hundredth of the way."""
    s = grid(16, 4, 1.0, 0.2)
    V = s.V.copy()
    near = np.flatnonzero((np.abs(V[:, 0] - 0.5) < 1e-9) & (np.abs(V[:, 1] - 0.1) < 0.06))
    V[near, 0] += 0.99 / 16
    s = Surface(V, s.F)
    fixed = hold(s, (s.V[:, 0] < 1e-9, "xyz"), (rim(s), "z"))
    found = forces_of(s, fixed, face=(0, 0, -1e3))
    even = forces_of(grid(16, 4, 1.0, 0.2), fixed, face=(0, 0, -1e3))
    assert np.abs(found.q).max() < 1.15 * np.abs(even.q).max()


def test_section_forces_equal_the_load_beyond_the_section():
    """A strip bent, sheared and pulled at once, and twisted by Poisson's ratio at its root."""
    s, found = loaded_strip(24, 4, (70.0, -30.0, -100.0), width=0.2, poisson=0.3)
    for low, high in ((0.4, 0.6), (0.02, 0.1), (0.9, 0.95)):
        assert_allclose(carried(s, found, 0, low, high), np.array([70.0, -30.0, -100.0]) * 0.2, rtol=1e-4)


CUT = {"surface.edge": 0.6, "pattern.major.spacing": 2.0, "pattern.minor.spacing": 1.0,
       "surface.load": [{"kind": "self_weight", "case": "dead"},
       {"kind": "snow", "pressure": 1e3, "case": "snow"}],
       "surface.combination": [{"name": "all", "factors": {"dead": 1.35, "snow": 1.5}}]}  # fmt: skip


@pytest.fixture(scope="module")
def dome_design():
    return dsfab.run(dsfab.load_preset("dome", CUT))


@pytest.mark.slow
def test_sections_of_a_cut_dome_carry_the_load_above_them(dome_design):
    """Ribs three faces wide, between the free edges of openings: within .2 %."""
    found, s = dome_design.section_forces, dome_design.sheet.surface
    assert list(found) == ["dead", "snow", "all"]
    loads = dome_design._loads_on_sheet(found)
    top = s.V[:, 2].max()
    for name, forces in found.items():
        low, high = 0.35 * top, 0.65 * top
        phi = np.clip((s.V[:, 2] - low) / (high - low), 0, 1)
        assert carried(s, forces, 2, low, high)[2] == pytest.approx(phi @ loads[name].force[:, 2], rel=2e-3), name
    for what in ("n", "m", "q"):
        dead, snow, total = (getattr(found[name], what) for name in found)
        assert_allclose(total, 1.35 * dead + 1.5 * snow, atol=1e-6 * np.abs(total).max())
    assert dome_design.section_forces is found


def test_the_frame_is_that_of_the_convention():
    for name in ZOO:
        s = ZOO[name]()
        x, y = local_frames(s).transpose(1, 0, 2)
        assert_allclose(np.cross(x, y), s.normals, atol=1e-9)
        level = np.abs(s.normals[:, 0]) <= 0.99
        assert (x[level, 0] > 0.14).all()
        assert (x[~level, 1] > 0.14).all()


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3), st.floats(-1, 1))
def test_principal_values_rebuild_the_tensor(tensor, lean):
    s = Surface(np.array([[0, 0, 0], [1, 0, lean], [0, 1, 0.3]]), np.array([[0, 1, 2]]))
    forces = SectionForces(
        local_frames(s), np.array([tensor]), np.zeros((1, 3)), np.zeros((1, 2)), *np.zeros((2, 1, 3, 3))
    )
    values, angle, direction = forces.principal("n")
    assert values[0, 0] >= values[0, 1]
    assert -90 <= angle[0] <= 90
    c, d = np.cos(np.radians(angle[0])), np.sin(np.radians(angle[0]))
    assert_allclose(direction[0], c * forces.frame[0, 0] + d * forces.frame[0, 1], atol=1e-9)
    turn = np.array([[c, -d], [d, c]])
    found = turn @ np.diag(values[0]) @ turn.T
    assert_allclose([found[0, 0], found[1, 1], found[0, 1]], tensor, atol=1e-9 * max(1.0, np.abs(tensor).max()))


@pytest.mark.slow
def test_the_table_is_read_by_any_program_and_says_its_axes_and_signs(dome_design, tmp_path):
    path = dome_design.write(tmp_path / "dome.forces.csv")
    with open(path, encoding="utf-8", newline="") as file:
        lines = file.readlines()
    said = [line[2:].strip() for line in lines if line.startswith("#")]
    assert said[0].startswith("units: metres and newtons")
    assert said[1 : 1 + len(CONVENTION)] == list(CONVENTION)
    table = list(csv.DictReader(lines[len(said) :]))
    s, found = dome_design.sheet.surface, dome_design.section_forces
    assert [row["case"] for row in table[:: s.m]] == ["dead", "snow", "all"]
    last = {key: np.array([float(row[key]) for row in table[-s.m :]]) for key in table[0] if key != "case"}
    assert (last["face"] == np.arange(1, s.m + 1)).all()
    assert_allclose(last["centre.z [m]"], s.centroids[:, 2], rtol=1e-6)
    assert_allclose(last["n_xy [N/m]"], found["all"].n[:, 2], rtol=1e-6)
    assert_allclose(last["m_y [N m/m]"], found["all"].m[:, 1], rtol=1e-6)
    assert_allclose(last["q_x [N/m]"], found["all"].q[:, 0], rtol=1e-6)
    assert_allclose(last["m_1 [N m/m]"], found["all"].principal("m").values[:, 0], rtol=1e-6)


def test_section_forces_are_written_for_paraview_on_the_cut_sheet(dome_design, tmp_path):
    import pyvista

    shown = pyvista.read(dome_design.write(tmp_path / "dome.forces.vtu"))
    assert shown.n_cells == dome_design.sheet.surface.m
    assert_allclose(shown.cell_data["snow m_x [N m/m]"], dome_design.section_forces["snow"].m[:, 0])
    assert_allclose(shown.cell_data["local y [1]"], dome_design.section_forces["snow"].frame[:, 1])
    first = shown.cell_data["snow n_1 direction [1]"]
    assert_allclose(np.einsum("mx,mx->m", first, dome_design.sheet.surface.normals), 0, atol=1e-9)
    assert CONVENTION[1] in [str(shown.field_data[name][0]) for name in shown.field_data]


@pytest.mark.parametrize("suffix", [".forces.csv", ".forces.vtu"])
def test_a_sheet_alone_has_none_and_a_spoilt_file_is_not_kept(suffix, dome_design, tmp_path, monkeypatch):
    with pytest.raises(ExportError, match="only a design has section forces"):
        dsfab.write(dome_design.sheet, tmp_path / f"a{suffix}")
    form = FORMATS[suffix]

    def spoilt(part):
        for piece in form.encode(part):
            yield piece if len(piece) < 2000 else piece.replace(b"1", b"2", 400)

    monkeypatch.setitem(FORMATS, suffix, replace(form, encode=spoilt))
    with pytest.raises((ExportError, ValueError)):
        dome_design.write(tmp_path / f"a{suffix}")
    assert not any(tmp_path.iterdir())


@pytest.mark.slow
def test_section_forces_are_exported_from_a_built_folder(tmp_path, capsys, unjudged):
    folder = tmp_path / "out"
    few = ["--set", "surface.edge=0.6", "--set", "pattern.major.spacing=2", "--format", "stl", "--no-preview"]
    assert main(["build", "dome", *few, "-o", str(folder)]) == 0
    assert main(["export", str(folder), "--to", "forces.csv"]) == 0
    assert "rows" in capsys.readouterr().out
    assert (folder / "dome.forces.csv").stat().st_size > 100_000
