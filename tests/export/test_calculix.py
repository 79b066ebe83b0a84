"""The .inp file: what stands in it, what is refused, and that CalculiX itself reads it as it was meant."""

from dataclasses import replace

import numpy as np
import pytest

from dsfab.core.errors import ExportError
from dsfab.export.analysis.calculix import CalculixModel, cards, write_calculix
from dsfab.statics import Material, SheetModel, SpreadLoad
from dsfab.study.check_model import axes_of_file, in_plane, nodal_forces, six_node_model, six_node_triangles
from dsfab.surface import Surface
from tests.calculix import ccx, needs_ccx
from tests.shapes import ZOO, grid, zoo

STRIP = grid(8, 4, 2.0, 1.0)
MATERIAL = Material(2e9, 0.3, 1000.0)
THICKNESS, PULL = 0.01, 3e3
"""Metres, and newtons per metre at the end of the strip."""


def pulled_strip(element: str = "CPS6", axis: int = 2, **changes) -> CalculixModel:
    """A strip pulled along its length: rollers at one end, and free to get narrower."""
    turn = np.argsort(axes_of_file(axis))
    surface = Surface(STRIP.V[:, turn], STRIP.F)
    rollers, rest = np.zeros((2, surface.n, 3), dtype=bool)
    rollers[STRIP.V[:, 0] == 0, 0] = True
    rest[(STRIP.V[:, :2] == 0).all(axis=1), 1] = True
    rest[:, 2] = True
    end = surface.edges.boundary & (STRIP.V[surface.edges.ends, 0] == 2).all(axis=1)
    load = SpreadLoad.broadcast(STRIP, edge=end[:, None] * np.array([PULL, 0, 0]))
    force = nodal_forces(STRIP, load.vertex_forces(STRIP), load)
    given = {
        "supports": {"SUPPORT_1": rollers[:, turn], "SUPPORT_2": rest[:, turn]},
        "steps": {"pull": force[:, turn]},
        **changes,
    }
    return six_node_model(SheetModel(surface, MATERIAL, THICKNESS), element=element, axis=axis, **given)


def text(model: CalculixModel) -> list[str]:
    return "".join(cards(model)).splitlines()


def after(lines: list[str], card: str, count: int = 1) -> list[str]:
    at = next(i for i, line in enumerate(lines) if line.startswith(card))
    return lines[at + 1 : at + 1 + count]


@needs_ccx
@pytest.mark.parametrize(("element", "axis"), [("CPS6", 2), ("CPS6", 0), ("CPS6", 1), ("S6", 2)])
def test_a_pulled_strip_stretches_as_hooke_says(element, axis, tmp_path):
    """u = q x / (E h), v = -nu q y / (E h); the energy is half of the force times the stretch."""
    (found,) = ccx(pulled_strip(element, axis), tmp_path)
    nodes = six_node_triangles(STRIP)[0]
    stretch = PULL / (MATERIAL.young * THICKNESS)
    exact = stretch * np.stack([nodes[:, 0], -MATERIAL.poisson * nodes[:, 1], 0 * nodes[:, 0]], axis=1)
    assert np.abs(found.u - exact).max() < 1e-6 * stretch
    assert found.energy == pytest.approx(PULL * 2 * stretch / 2, rel=1e-5)
    assert found.reaction["SUPPORT_1"] == pytest.approx([-PULL, 0, 0], abs=1e-4 * PULL)


@needs_ccx
@pytest.mark.parametrize("element", ["CPS6", "S6"])
def test_load_cases_are_separate_steps_and_springs_give_way(element, tmp_path):
    """Springs of k in all at one end: their mean displacement is F / k, exactly, and the strip stretches beyond it."""
    k = 5e5
    at_end = STRIP.V[:, 0] == 0
    springs = np.zeros((STRIP.n, 3))
    springs[at_end, 0] = k * np.array([0.5, 1, 1, 1, 0.5]) / 4
    fixed = np.zeros((STRIP.n, 3), dtype=bool)
    fixed[(STRIP.V[:, :2] == 0).all(axis=1), 1] = True
    fixed[:, 2] = element == "S6"
    pull = pulled_strip(element).steps["pull"]
    model = pulled_strip(
        element, springs=springs, supports={"SUPPORT_1": fixed}, steps={"pull": pull, "push twice": -2 * pull}
    )
    first, second = ccx(model, tmp_path)
    stretch = PULL * 2 / (MATERIAL.young * THICKNESS)
    assert springs[:, 0] @ first.u[: STRIP.n, 0] == pytest.approx(PULL, rel=1e-5)
    moved = np.mean(first.u[: STRIP.n][STRIP.V[:, 0] == 2, 0])
    assert moved == pytest.approx(PULL / k + stretch, rel=0.01)  # and a little more, around the points
    assert second.u == pytest.approx(-2 * first.u, abs=1e-6 * moved)


@needs_ccx
def test_shells_with_clamped_edges_do_not_turn_there(tmp_path):
    """A cantilever strip, nu = 0: its end moves by q L^4 / (8 E h^3 / 12) under a load q per area, as a beam."""
    surface, h, young, q = grid(16, 2, 2.0, 0.25), 0.01, 1e9, 10.0
    root = surface.V[:, 0] == 0
    clamped = surface.edges.boundary & root[surface.edges.ends].all(axis=1)
    load = SpreadLoad.broadcast(surface, face=(0, 0, -q))
    force = nodal_forces(surface, load.vertex_forces(surface), load)
    supports = {"SUPPORT_1": np.repeat(root[:, None], 3, axis=1)}
    model = six_node_model(SheetModel(surface, Material(young, 0.0), h, clamped=clamped), supports, {"q": force})
    (found,) = ccx(model, tmp_path)
    tip = -found.u[: surface.n][surface.V[:, 0] == 2, 2].mean()
    assert tip == pytest.approx(q * 2.0**4 / (8 * young * h**3 / 12), rel=0.01)
    assert found.reaction["SUPPORT_1"][2] == pytest.approx(
        force[np.isin(model.nodes[:, 0], 0, invert=True), 2].sum() * -1
    )


@zoo
def test_forces_on_nodes_do_the_work_of_the_load_on_every_quadratic_field(name):
    """Six-node triangles integrate a load on a quadratic displacement exactly: compared with midpoint quadrature."""
    surface = ZOO[name]()
    on_face = np.random.default_rng(1).normal(size=(surface.m, 3))
    load = SpreadLoad.broadcast(surface, face=on_face)
    force = nodal_forces(surface, load.vertex_forces(surface), load)
    X, T = six_node_triangles(surface)
    u = ((X / surface.size) ** 2) @ np.array([[1.0, 2, 3], [4, -5, 6], [7, 8, -9]])
    # the rule with the middles of the sides is exact for quadratic functions
    work = np.einsum("m,mkx,mx->", surface.areas / 3, u[T[:, 3:]], on_face)
    scale = np.abs(on_face).sum() * surface.areas.max()
    assert np.einsum("px,px->", force, u) == pytest.approx(work, abs=1e-10 * scale)
    assert force.sum(axis=0) == pytest.approx((surface.areas[:, None] * on_face).sum(axis=0), abs=1e-10 * scale)


def test_the_file_says_its_units_and_names_every_support_and_load():
    lines = text(replace(pulled_strip("S6"), notes=("a note\nin two lines",), name="roof"))
    comments = [line for line in lines if line.startswith("**")]
    assert any("metres" in line and "newtons" in line and "pascals" in line for line in comments)
    assert "** a note in two lines" in comments
    assert comments[0].startswith(f"** roof: {STRIP.m} six-node shells (S6), {len(pulled_strip().nodes)} nodes")
    assert after(lines, "*SHELL SECTION") == ["0.01"]
    assert after(lines, "*ELASTIC") == ["2000000000, 0.3"]
    assert after(lines, "*DENSITY") == ["1000"]
    for card in ("*NSET, NSET=SUPPORT_1", "*NSET, NSET=LOAD_1", "** LOAD CASE 1: pull"):
        assert lines.count(card) == 1
    assert lines.index("*NSET, NSET=LOAD_1") < lines.index("*STEP")


def test_directions_that_a_whole_support_holds_are_written_for_its_set():
    model = pulled_strip("S6")
    lines = text(model)
    assert [line for line in lines if line.startswith("SUPPORT_")] == ["SUPPORT_1, 1, 1", "SUPPORT_2, 3, 3"]
    alone = [int(line.split(",")[0]) - 1 for line in lines if line.endswith(", 2, 2") and line[0].isdigit()]
    assert alone == np.flatnonzero(model.supports["SUPPORT_2"][:, 1]).tolist() == [0]
    assert not [line for line in text(pulled_strip("CPS6")) if line.endswith(", 3, 3")]


def test_middles_between_two_supports_are_held_once():
    fixed = np.zeros((2, STRIP.n, 3), dtype=bool)
    near = STRIP.V[:, 1] < 0.5
    fixed[0, (STRIP.V[:, 0] == 0) & near] = True
    fixed[1, (STRIP.V[:, 0] == 0) & ~near] = True
    one, two = pulled_strip(supports={"SUPPORT_1": fixed[0], "SUPPORT_2": fixed[1]}).supports.values()
    assert not (one & two).any()
    X = six_node_triangles(STRIP)[0]
    assert ((one | two)[:, 0] == (X[:, 0] == 0)).all()


def test_springs_alone_are_a_support():
    model = pulled_strip("S6", supports={}, springs=np.ones((STRIP.n, 3)))
    lines = text(model)
    assert not [line for line in lines if line.startswith("*BOUNDARY")]
    assert [line for line in lines if line.startswith("*SPRING")] == [f"*SPRING, ELSET=SPRING_{k}" for k in (1, 2, 3)]
    elements = [line.split(",")[0] for line in after(lines, "*ELEMENT, TYPE=SPRING1, ELSET=SPRING_3", STRIP.n)]
    assert [int(number) for number in elements] == list(range(STRIP.m + 2 * STRIP.n + 1, STRIP.m + 3 * STRIP.n + 1))
    assert [float(line) for line in after(lines, "*SPRING, ELSET=SPRING_3", 2)] == [3, 1]


def test_a_thin_section_keeps_the_stiffness_and_says_so():
    thick = pulled_strip("S6")
    thin = in_plane(thick, 2, 1e-4)
    assert thin.young * thin.thickness == pytest.approx(thick.young * thick.thickness)
    assert thin.thickness == pytest.approx(1e-4)
    assert any(note.startswith("SECTION") and "divide stresses by 100" in note for note in thin.notes)
    same = in_plane(thick, 2, 1.0)
    assert (same.thickness, same.young, same.notes) == (thick.thickness, thick.young, ())


def test_the_same_model_gives_the_same_bytes_and_an_older_file_is_replaced(tmp_path):
    path = tmp_path / "a.inp"
    path.write_text("old")
    assert write_calculix(pulled_strip(), path) == path
    assert path.read_bytes() == write_calculix(pulled_strip(), tmp_path / "b.inp").read_bytes()
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.inp", "b.inp"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"steps": {}}, "has no load step or no support"),
        ({"supports": {}}, "has no load step or no support"),
        ({"young": float("nan")}, "numbers that are not finite"),
        ({"triangles": np.array([[0, 1, 2, 3, 4, 10**6]])}, "1 triangles use node numbers"),
        (
            {"supports": {"my support": np.ones((len(pulled_strip().nodes), 3), dtype=bool)}},
            "is not valid for a node set",
        ),
        ({"nodes": np.random.default_rng(0).normal(size=pulled_strip().nodes.shape)}, "plane z = 0"),
    ],
)
def test_models_that_calculix_could_not_solve_are_refused(changes, message):
    with pytest.raises(ExportError, match=message):
        replace(pulled_strip("CPS6"), **changes)


def test_arrays_that_do_not_fit_are_a_mistake_of_ours():
    with pytest.raises(ValueError, match="expected an array of shape"):
        replace(pulled_strip(), springs=np.zeros((3, 3)))


def test_other_suffixes_and_missing_folders_are_refused(tmp_path):
    with pytest.raises(ExportError, match=r"name it a\.inp"):
        write_calculix(pulled_strip(), tmp_path / "a.txt")
    with pytest.raises(ExportError, match="folder does not exist"):
        write_calculix(pulled_strip(), tmp_path / "nowhere" / "a.inp")
    assert not list(tmp_path.iterdir())
