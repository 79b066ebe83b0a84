"""Forces of members, summed up from those of the sheet: closed forms of beams, rings, arches and grids."""

import csv
from types import SimpleNamespace

import numpy as np
import openpyxl
import pytest

import dsfab
from dsfab.core.errors import ExportError, StaticsError
from dsfab.export import Details
from dsfab.export.tables.forces import sheet_names
from dsfab.members import Member, MemberGraph
from dsfab.members.eurocode import MemberBays, Rules, utilisation
from dsfab.members.frame import STATIONS, member_cuts, member_forces
from dsfab.members.frame.forces import PLANES, MemberCuts, forces_in
from dsfab.statics import Material
from dsfab.surface import Surface
from tests.members.axes import axis
from tests.members.loaded_shells import forces_of, loaded_strip, short_tube
from tests.shapes import grid, jittered
from tests.statics.supports import hold

N, VY, VZ, MT, MY, MZ = range(6)


def whole_graph(surface, line, cells) -> MemberGraph:
    """A graph of one member of these cells."""
    member = Member("A1", "strip", "major", 0, 1, cells, 1.0, line, np.full((len(line.s), 2), 0.1), ())
    return MemberGraph(SimpleNamespace(surface=surface), np.arange(surface.m), (member,), ())


def borne(surface, found, line, at, cells=None) -> np.ndarray:
    """(k, 6) of a member along `line`, of all cells or of some, at arc lengths (k,)."""
    graph = whole_graph(surface, line, np.arange(surface.m) if cells is None else np.asarray(cells))
    cut = MemberCuts.from_member(graph, graph.members[0], np.array(at), ("bay",) * len(at))
    return forces_in(graph, "A1", cut, {"load": found}).forces["load"]


STRIP = axis(np.outer(np.linspace(0, 1, 21), [1, 0, 0]) + [0, 0.075, 0], [0, 0, 1])


def test_a_cantilever_pressed_against_its_normals():
    """V = F down on what lies before the section, M = F (L - x), and the side of the normals is stretched."""
    s, found = loaded_strip(16, 3, (0, 0, -100.0))
    at = np.array([0.2, 0.5, 0.8])
    total = 100 * 0.15
    rows = borne(s, found, STRIP, at)
    assert rows[:, VZ] == pytest.approx(-total, rel=1e-3)
    assert rows[:, MY] == pytest.approx(total * (1 - at), rel=4e-3)
    assert np.abs(rows[:, [N, VY, MT, MZ]]).max() < 2e-3 * total


@pytest.mark.parametrize("across", [2, 6])
def test_a_cantilever_in_its_plane(across):
    """The same in the sheet: Vy = F, Mz = F (L - x); a force to the left stretches the right side. By means of its
    faces a rib of two of them would have three quarters of that."""
    s, found = loaded_strip(32, across, (0, 1000.0, 0), width=0.15)
    at = np.array([0.3, 0.5, 0.7])
    rows = borne(s, found, STRIP, at)
    assert rows[:, VY] == pytest.approx(150, rel=0.01)
    assert rows[:, MZ] == pytest.approx(150 * (1 - at), rel=2e-2)
    assert np.abs(rows[:, [VZ, MT, MY]]).max() < 1e-6


def test_a_strip_in_torsion_has_its_torque():
    """Forces f up and down on the halves of its end twist it by f b^2 / 4: half of that is in forces on free edges."""
    s = jittered(grid(40, 4, 1.0, 0.1))
    root, tip = s.V[:, 0] < 1e-9, s.V[:, 0] > 1 - 1e-9
    at_tip = (tip[s.edges.ends].all(axis=1) & s.edges.boundary)[:, None]
    side = np.sign(s.V[s.edges.ends].mean(axis=1)[:, 1:2] - 0.05)
    clamped = root[s.edges.ends].all(axis=1)
    found = forces_of(
        s, hold(s, (root, "xyz")), edge=at_tip * side * (0, 0, 4e3), clamped=clamped, material=Material(210e9, 0.3)
    )
    line = axis(np.outer(np.linspace(0, 1, 21), [1, 0, 0]) + [0, 0.05, 0], [0, 0, 1])
    rows = borne(s, found, line, [0.4, 0.5, 0.6])
    assert rows[:, MT] == pytest.approx(10.0, rel=0.02)
    assert np.abs(rows[:, [N, VY, VZ, MZ]]).max() < 1


def test_cuts_of_bays_end_at_free_edges(vault):
    """At round corners a part of a cut belongs to the crossing member; no bay is judged there."""
    cuts = member_cuts(vault.members)
    long = {name: np.ptp(cut.s.reshape(-1, STATIONS), axis=1) > 0.4 for name, cut in cuts.items()}
    assert sum(bays.sum() for bays in long.values()) > 50
    for name, cut in cuts.items():
        ends = np.bincount(cut.sections.end_station, minlength=len(cut.s)).reshape(-1, STATIONS)
        assert (ends[long[name]] == 2 * PLANES).all(), name


def test_a_ring_beam_under_radial_load():
    """N = -p b R [Barlow], and nothing else."""
    s, fixed, out = short_tube()
    found = forces_of(s, fixed, face=-1e4 * out)
    a = np.linspace(0, 2 * np.pi, 129)
    circle = np.stack([np.cos(a), np.sin(a), 0 * a + 0.1], axis=1)
    rows = borne(s, found, axis(circle, circle * (1, 1, 0), closed=True), np.linspace(0.1, 6.1, 7))
    assert rows[:, N] == pytest.approx(-1e4 * 0.2, rel=0.01)
    assert np.abs(rows[:, 1:3]).max() < 0.02 * 2000
    assert np.abs(rows[:, 3:]).max() < 0.01 * 2000


def test_a_three_hinged_arch():
    """Two loads P at its quarters: H = P L / 4 f, and M = P L / 16 there. Half of it, whose crown moves up and down."""
    L, f, b, P = 8.0, 2.0, 0.4, 1000.0
    flat = grid(48, 3, L / 2, b)
    x = flat.V[:, 0]
    s = Surface(np.stack([x, flat.V[:, 1], 4 * f * x * (L - x) / L**2], axis=1), flat.F)
    foot, crown, quarter = x < 1e-9, x > L / 2 - 1e-9, np.abs(x - L / 4) < 1e-9
    edge = quarter[s.edges.ends].all(axis=1)[:, None] * np.array([0, 0, -P / b])
    found = forces_of(s, hold(s, (foot, "xyz"), (crown, "xy")), edge=edge, thickness=0.1)
    t = np.linspace(0, L / 2, 400)
    line = axis(np.stack([t, 0 * t + b / 2, 4 * f * t * (L - t) / L**2], axis=1), [0, 0, 1])
    slope = 4 * f * (L - 2 * t) / L**2
    normals = np.stack([-slope, 0 * t, 1 + 0 * t], axis=1) / np.sqrt(1 + slope**2)[:, None]
    line = axis(line.P, normals)
    H, at = P * L / 4 / f, np.interp([0.8, 1.4, 2.6, 3.2], t, line.s)
    rows = borne(s, found, line, at)
    X = np.interp(at, line.s, t)
    before = X < L / 4
    V = np.where(before, P, 0.0)
    y, k = 4 * f * X * (L - X) / L**2, 4 * f * (L - 2 * X) / L**2
    moment = np.where(before, P * X, P * L / 4) - H * y
    cos, sin = 1 / np.sqrt(1 + k**2), k / np.sqrt(1 + k**2)
    assert rows[:, N] == pytest.approx(-H * cos - V * sin, rel=0.02)
    assert rows[:, MY] == pytest.approx(-moment, rel=0.02, abs=0.005 * P * L / 16)
    assert rows[:, VZ] == pytest.approx(H * sin - V * cos, abs=0.06 * P)


def cross(arm=1.0, width=0.1, cells=40) -> Surface:
    """Two strips that cross at right angles; each is two arms long."""
    whole = grid(cells, cells, 2 * arm, 2 * arm)
    V = whole.V - (arm, arm, 0)
    squeeze = np.linspace(-arm, arm, cells + 1)
    middle = np.linspace(-width / 2, width / 2, 5)
    lines = np.concatenate(
        [np.linspace(-arm, -width / 2, cells // 2 - 1)[:-1], middle, np.linspace(width / 2, arm, cells // 2 - 1)[1:]]
    )
    V = np.stack([np.interp(V[:, 0], squeeze, lines), np.interp(V[:, 1], squeeze, lines), 0 * V[:, 0]], axis=1)
    centre = V[whole.F].mean(axis=1)
    kept = whole.F[(np.abs(centre[:, :2]) < width / 2).any(axis=1)]
    used, F = np.unique(kept, return_inverse=True)
    return Surface(V[used], F.reshape(-1, 3))


def loaded_cross():
    """The cross with a load P in its middle and its four ends on supports: the sheet, P, and its section forces."""
    s, P = cross(), 400.0
    ends = np.abs(s.V[:, :2]).max(axis=1) > 1 - 1e-9
    middle = np.linalg.norm(s.V, axis=1).argmin()
    on = (s.edges.ends == middle).any(axis=1)
    length = np.linalg.norm(np.diff(s.V[s.edges.ends], axis=1)[:, 0], axis=1)
    down = on[:, None] * np.array([0, 0, -P / length[on].sum()])
    found = forces_of(
        s, hold(s, (ends, "z"), (np.arange(s.n) == middle, "xy"), (ends & (s.V[:, 0] > 0.9), "y")), edge=down
    )
    return s, P, found


def beam_of_cross(s, turn):
    """The axis and the cells of the beam along x (0) or y (1)."""
    line = axis(np.outer(np.linspace(-1, 1, 41), np.roll([1.0, 0, 0], turn)), [0, 0, 1])
    return line, np.flatnonzero(np.abs(s.centroids[:, 1 - turn]) < 0.05)


def test_a_grid_of_two_crossing_beams():
    """A load in the middle, four ends on supports: each arm bears a quarter, M = P x / 4 from its end, and sags."""
    s, P, found = loaded_cross()
    for turn in (0, 1):
        line, cells = beam_of_cross(s, turn)
        at = np.array([0.3, 0.6, 0.85, 1.4])
        rows = borne(s, found, line, at, cells)
        assert rows[:, MY] == pytest.approx(-P / 4 * np.minimum(at, 2 - at), rel=0.02)
        assert rows[[0, 1, 3], VZ] == pytest.approx(np.array([-P, -P, P]) / 4, rel=1e-3)
        assert rows[2, VZ] == pytest.approx(
            -P / 4, rel=0.1
        )  # a width from the corners of the node, where twist has no bound
        assert np.abs(rows[:, [N, VY, MZ]]).max() < 1e-6 * P


def test_the_shear_of_a_bay_balances_its_moments():
    """A quarter of the load everywhere, also beside the node, where sums of the sheet's shear are off."""
    s, P, found = loaded_cross()
    line, cells = beam_of_cross(s, 0)
    at = np.linspace(0.2, 0.92, STATIONS)
    assert abs(borne(s, found, line, at, cells)[-1, VZ] / (-P / 4) - 1) > 0.1
    graph = whole_graph(s, line, cells)
    cut = MemberCuts.from_member(graph, graph.members[0], at, ("bay",) * STATIONS)
    rows = member_forces(graph, {"load": found}, {"A1": cut})["A1"].forces["load"]
    assert rows[:, VZ] == pytest.approx(-P / 4, rel=0.03)


@pytest.fixture(scope="module")
def vault():
    return dsfab.Design.from_preset(dsfab.load_preset("barrel_vault", {"surface.edge": 0.4}))


@pytest.mark.slow
def test_members_of_a_design(vault):
    """MemberBays, names, and arches that are pressed all along."""
    found = vault.member_forces
    arches = [one for name, one in found.items() if name.startswith("B")]
    assert len(arches) > 5
    for one in arches:
        assert (one.forces["load"][:, N] < 0).all()
        assert one.envelope[:, :, 0] == pytest.approx(one.forces["load"])
        assert (np.diff(one.s) > 0).all()
        nodes = one.bay[0].split()
        assert all(name in {node.id for node in vault.members.nodes_along[one.member]} for name in nodes)


def test_the_thrusts_of_arches_carry_the_load_of_the_vault(vault):
    """Where joints with the bands at the springing lines begin, the arches bring down what lies above."""
    found = vault.member_forces
    down = 0.0
    for name, one in found.items():
        if name.startswith(("B", "rim")):
            axis = vault.members.by_id[name].axis
            for k in (0, -1):
                _, T, normal = axis.frames_at(one.s[[k]])
                F = one.forces["load"][k]
                vector = F[N] * T[0] + F[VY] * np.cross(normal[0], T[0]) + F[VZ] * normal[0]
                down += abs(vector[2])
    above = vault.sheet.surface.V[:, 2] > 0.2
    assert down == pytest.approx(-vault.cut_loads["load"].force[above, 2].sum(), rel=0.03)


def test_the_table_reads_back_and_says_its_units(vault, tmp_path):
    path = vault.write(tmp_path / "vault.member_forces.csv")
    lines = path.read_text(encoding="utf-8").splitlines()
    head = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    rows = list(csv.DictReader(lines[head:]))
    assert "newton metres" in lines[1]
    assert len(rows) == sum(len(one.s) for one in vault.member_forces.values())
    first = next(iter(vault.member_forces.values()))
    assert (rows[0]["member"], rows[0]["bay"], rows[0]["case"]) == (first.member, first.bay[0], "load")
    assert float(rows[0]["N [N]"]) == pytest.approx(first.forces["load"][0, N], rel=1e-6)
    assert float(rows[0]["Mz [N m]"]) == pytest.approx(first.forces["load"][0, MZ], rel=1e-6)


def test_the_workbook_has_a_sheet_for_each_member_and_the_largest_of_all(vault, tmp_path):
    """As openpyxl reads it."""
    path = vault.write(tmp_path / "vault.member_forces.xlsx")
    book = openpyxl.load_workbook(path, read_only=True)
    assert book.sheetnames == ["about", "largest", *vault.member_forces]
    first = next(iter(vault.member_forces.values()))
    head, *rows = book[first.member].iter_rows(values_only=True)
    assert head[:4] == ("case", "bay", "along [m]", "N [N]")
    assert np.array([row[3:] for row in rows]) == pytest.approx(first.forces["load"], rel=1e-9)
    largest = {(row[0], row[1]): row[2:] for row in book["largest"].iter_rows(values_only=True, min_row=2)}
    for name, one in vault.member_forces.items():
        value, case, bay, s = largest[name, "N [N]"]
        k = int(np.abs(one.forces["load"][:, N]).argmax())
        assert (value, case, bay) == (pytest.approx(one.forces["load"][k, N]), "load", one.bay[k])
        assert s == pytest.approx(one.s[k])
    book.close()
    assert path.read_bytes() == vault.write(tmp_path / "again.member_forces.xlsx").read_bytes()


def test_sheets_have_names_that_a_workbook_takes():
    names = sheet_names(["A[1]", "a_1_", "largest", "B" * 40, "B" * 41])
    assert names == ["A_1_", "a_1_ (2)", "largest (2)", "B" * 31, "B" * 27 + " (2)"]


def test_a_sheet_alone_has_no_members(tmp_path):
    with pytest.raises(ExportError, match="has no forces of members"):
        dsfab.write(grid(2, 2, 1.0, 1.0), tmp_path / "x.member_forces.csv")


def test_a_section_is_as_wide_as_its_member(vault):
    """Ribs of .2 m; the width is that of the section that was summed up."""
    arches = [one for name, one in vault.member_forces.items() if name.startswith("B")]
    assert np.median(np.concatenate([one.width for one in arches])) == pytest.approx(0.2, rel=0.02)


def rules_for(material, strength=0.0) -> Rules:
    return Rules(material, 11.5e9, 4.4e9, strength, {"load": "medium"})


def test_members_of_a_design_against_the_code(vault):
    """Of each bay the compression is that of its forces, its width and f_c; the sheet is pressed against its arches."""
    bays = MemberBays.from_forces(vault.members, vault.member_forces, 0.08)
    found = utilisation(bays, rules_for("GL24h"))
    arch = next(k for k, name in enumerate(bays.member) if name.startswith("B"))
    forces = vault.member_forces[bays.member[arch]]
    at = [k for k, bay in enumerate(forces.bay) if bay == bays.name[arch]]
    expected = max(-forces.forces["load"][at, N] / forces.width[at] / 0.08 / (24e6 * 0.8 / 1.25))
    compression = [check.name for check in found.checks].index("compression")
    assert found.worst[arch, compression] == pytest.approx(expected)
    assert bays.curvature[arch] == pytest.approx(-0.2247, rel=0.1)  # the arches' own, 1/m
    axis = vault.members.by_id[bays.member[arch]].axis
    assert bays.length[arch] < axis.length
    rings = next(name for name in bays.member if name.startswith("A"))
    own = [k for k, name in enumerate(bays.member) if name == rings]
    assert np.isin(bays.length[own], vault.members.bays(rings)).all()
    assert np.ptp(bays.length[own]) > 0
    assert bays.s[arch].tolist() == forces.s[at].tolist()


def test_the_table_of_utilisation_reads_back_worst_first(vault, tmp_path):
    found = utilisation(MemberBays.from_forces(vault.members, vault.member_forces, 0.08), rules_for("GL24h"))
    details = Details(utilisation=found)
    path = dsfab.write(vault.sheet.surface, tmp_path / "vault.member_utilisation.csv", details=details)
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    values = [float(row["utilisation"]) for row in rows]
    assert values == sorted(values, reverse=True)
    assert values[0] == pytest.approx(found.largest.max(), rel=1e-6)
    check, case, _ = found.governing(int(found.order[0]))
    assert (rows[0]["check"], rows[0]["clause"], rows[0]["case"]) == (check.name, check.clause, case)
    assert float(rows[0][str(check)]) == pytest.approx(values[0])
    assert float(rows[0]["thickness [m]"]) == 0.08
    assert float(rows[0]["bay [m]"]) == pytest.approx(found.bays.length[found.order[0]], rel=1e-6)
    assert any(line.startswith("# checked by: EN 1995-1-1:2004") for line in lines)
    assert sum(line.startswith("# not checked: ") for line in lines) == len(found.unchecked)


def test_without_a_strength_the_utilisation_file_is_refused(vault, tmp_path):
    with pytest.raises(StaticsError, match="gives neither a material nor a strength"):
        vault.write(tmp_path / "vault.member_utilisation.csv")
    with pytest.raises(ExportError, match="has no members to check"):
        dsfab.write(grid(2, 2, 1.0, 1.0), tmp_path / "x.member_utilisation.csv")
    assert not list(tmp_path.iterdir())
