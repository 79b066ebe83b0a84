"""The element family: rigid motions, patch tests of all orders, flips, odd topologies, supports and loads on edges."""

import importlib.metadata

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import eye_array
from scipy.spatial.transform import Rotation

from dsfab import load_preset, run
from dsfab.core import sparse
from dsfab.core.errors import StaticsError
from dsfab.core.units import GRAVITY
from dsfab.statics import (
    PAPER,
    Elements,
    Material,
    SheetModel,
    SpreadLoad,
    bending_stiffness,
    equilibrium,
    factorisation,
    membrane_stiffness,
    solve,
    solve_statics,
    spread_load,
    stress,
)
from dsfab.statics.boundary_conditions import held_on_edges
from dsfab.statics.elements import edge_frames
from dsfab.surface import LoadCase, Surface
from dsfab.surface.loads.load_case import Force, Pressure, SelfWeight
from dsfab.surface.loads.pickers import Boundary, Box
from dsfab.surface.loads.supports import Support
from dsfab.verification import TESTS
from tests.presets import DOME_MODES
from tests.shapes import ZOO, grid, jittered, lifted, sphere, with_mixed_corners
from tests.statics.load_cases import STEEL, H, case
from tests.statics.sheets import BEST, PAIRS, SHEETS, SIX_NODES, pairs, sheets, unknowns


def stiffness(surface: Surface, elements: Elements, material: Material = STEEL, thickness: float = 0.05):
    return membrane_stiffness(surface, material, thickness, elements=elements) + bending_stiffness(
        surface, material, thickness, elements
    )


@pairs
@sheets
def test_only_the_six_rigid_motions_have_zero_energy(name, elements):
    """Edges turn with the sheet by w . t, bubbles stay zero. Hinges see only pairs of faces, so three leaves flap."""
    surface = SHEETS[name]()
    K = stiffness(surface, elements).toarray()
    assert np.abs(K - K.T).max() <= 1e-12 * np.abs(K).max()
    t = edge_frames(surface)[:, 0]
    scale = 1 / np.sqrt(K.diagonal())
    for axis in np.eye(3):
        shift = unknowns(surface, elements, np.tile(axis, (surface.n, 1)))
        turn = unknowns(surface, elements, np.cross(axis, surface.V), t @ axis)
        for motion in (shift, turn):
            assert np.abs(scale * (K @ motion)).max() <= 1e-11 * np.abs(motion / scale).max()
    values = np.linalg.eigvalsh(scale[:, None] * K * scale)
    expected = 8 if name == "three leaves" and elements.bending == "hinge" else 6
    assert values[0] > -1e-12
    assert np.count_nonzero(values < 1e-9) == expected


@pytest.mark.parametrize("elements", [BEST, Elements("quadratic", "midedge"), Elements("constant", "hhj")], ids=str)
@pytest.mark.parametrize("name", ["dome", "moebius", "three leaves", "pleat"])
def test_the_orientation_of_faces_does_not_change_the_solution(name, elements):
    surface, other = SHEETS[name](), with_mixed_corners(SHEETS[name]())
    held, loaded = surface.V[:, 1] < np.quantile(surface.V[:, 1], 0.3), surface.V[:, 1].argmax()
    load = case(surface, [(held, "xyz")], [(np.arange(surface.n) == loaded, (1e3, 2e3, -3e3))])
    one, two = (solve_statics(SheetModel(s, STEEL, H), load, elements) for s in (surface, other))
    assert np.abs(one.u - two.u).max() <= 1e-9 * np.abs(one.u).max()
    assert one.compliance == pytest.approx(two.compliance, rel=1e-9)
    a, b = (stress(s, STEEL, e.u, bubbles=e.bubbles) for s, e in ((surface, one), (other, two)))
    assert np.abs(a - b).max() <= 1e-9 * np.abs(a).max()


@pytest.mark.parametrize("elements", [e for e in PAIRS if e.bending != "hinge"], ids=str)
def test_patch_a_plate_bent_to_any_quadric_has_the_exact_energy_and_balance(elements):
    """w = quadratic: constant curvature. An edge turns by (w_y, -w_x) . t, and its middle leaves the chord."""
    surface = jittered(grid(7, 5, 2.0, 1.0))
    a, b, c = 0.3, -0.7, 0.4  # w = a x^2 + b x y + c y^2
    x, y, _ = surface.V.T
    w = a * x**2 + b * x * y + c * y**2
    spin = np.stack([b * x + 2 * c * y, -(2 * a * x + b * y), 0 * x], axis=1)
    first, last = surface.edges.ends.T
    t = edge_frames(surface)[:, 0]
    turns = np.einsum("kex,ex->ke", np.stack([spin[first], spin[last]]), t)
    middle = surface.V[surface.edges.ends].mean(axis=1)
    leaves = a * middle[:, 0] ** 2 + b * middle[:, 0] * middle[:, 1] + c * middle[:, 1] ** 2 - (w[first] + w[last]) / 2
    bubble = leaves[:, None] * np.array([0.0, 0.0, 1.0])
    u = np.stack([0 * w, 0 * w, w], axis=1)
    X = unknowns(surface, elements, u, turns.mean(axis=0), (turns[1] - turns[0]) / 2, bubble)
    K = bending_stiffness(surface, STEEL, H, elements)
    D, nu = STEEL.bending_stiffness(H), STEEL.poisson
    xx, yy, xy = 2 * a, 2 * c, b
    density = D / 2 * (xx**2 + yy**2 + 2 * nu * xx * yy + 2 * (1 - nu) * xy**2)
    assert pytest.approx(density * surface.area, rel=1e-10) == X @ (K @ X) / 2
    outside = np.zeros(surface.n, dtype=bool)
    outside[surface.edges.ends[surface.edges.boundary]] = True
    inner = np.concatenate([np.repeat(~outside, 3), np.tile(~surface.edges.boundary, len(elements.on_edges))])
    residual = K @ X
    assert np.abs(residual[inner]).max() <= 1e-9 * np.abs(residual).max()


@pytest.mark.parametrize("membrane", ["quadratic", "hybrid"])
def test_quadratic_edges_bend_in_their_plane_exactly_and_constant_strain_cannot(membrane):
    """u = (x y, -x^2 / 2), nu = 0: strain xx = y, nothing else; energy E h / 2 times the integral of y^2."""
    surface = jittered(grid(8, 2, 4.0, 1.0))
    material, thickness = Material(2e9, 0.0), 0.02
    field = lambda p: np.stack([p[:, 0] * p[:, 1], -(p[:, 0] ** 2) / 2, 0 * p[:, 0]], axis=1)  # noqa: E731
    first, last = surface.edges.ends.T
    u = field(surface.V)
    bubble = field(surface.V[surface.edges.ends].mean(axis=1)) - (u[first] + u[last]) / 2
    exact = 2e9 * 0.02 / 2 * 4.0 / 3
    rich, poor = Elements(membrane, None), Elements("constant", None)
    energy = {}
    for elements in (rich, poor):
        X = unknowns(surface, elements, u, bubble=bubble)
        energy[elements] = X @ (membrane_stiffness(surface, material, thickness, elements=elements) @ X) / 2
    assert energy[rich] == pytest.approx(exact, rel=1e-10)
    assert energy[poor] > 1.05 * exact
    framed = np.einsum("edx,ex->ed", edge_frames(surface), bubble)[:, :2]
    sigma = stress(surface, material, u, bubbles=framed)
    assert sigma[:, 0, 0] == pytest.approx(2e9 * surface.centroids[:, 1], rel=1e-9)
    assert np.abs(sigma[:, 1, 1]).max() <= 1e-6 * np.abs(sigma).max()
    assert np.abs(sigma[:, 0, 1]).max() <= 1e-6 * np.abs(sigma).max()


@pytest.mark.parametrize("law", ["plane_stress", "stvk"])
@pytest.mark.parametrize("elements", PAIRS, ids=str)
def test_both_laws_stretch_a_bar_alike_with_all_elements(law, elements):
    """Out of its plane too (the bar is tilted, so that it is not solved in 2D)."""
    flat = jittered(grid(6, 2, 3.0, 0.5))
    turn = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    surface = Surface(flat.V @ turn.T, flat.F)
    axis = turn[:, 0]
    left, right, low = flat.V[:, 0] < 1e-9, flat.V[:, 0] > 3 - 1e-9, flat.V[:, 1] < 1e-9
    pulled = 1e4 * right[surface.edges.ends].all(axis=1) - 1e4 * left[surface.edges.ends].all(axis=1)
    both = SpreadLoad.broadcast(surface, edge=pulled[:, None] * axis)
    # six directions at three corners: statically determinate, so the supports carry nothing
    fixed = case(surface, [(left & low, "xyz"), (right & low, "yz"), (left & (flat.V[:, 1] > 0.5 - 1e-9), "z")]).fixed
    load = LoadCase(fixed, both.vertex_forces(surface), left)
    answer = solve_statics(SheetModel(surface, STEEL, H, law), load, elements, both)
    modulus = STEEL.young if law == "plane_stress" else STEEL.young / (1 - STEEL.poisson**2)
    ends_apart = (answer.u[right] @ axis).mean() - (answer.u[left] @ axis).mean()
    assert ends_apart == pytest.approx(1e4 * 3.0 / (modulus * H), rel=1e-6)
    sigma = stress(surface, STEEL, answer.u, law, answer.bubbles)
    assert np.einsum("i,mij,j->m", axis, sigma, axis) == pytest.approx(1e4 / H, rel=1e-6)


def test_edge_frames_are_orthonormal_and_normal_to_smooth_sheets():
    surface = sphere(3)
    frames = edge_frames(surface)
    assert np.abs(frames @ frames.transpose(0, 2, 1) - np.eye(3)).max() <= 1e-12
    middle = surface.V[surface.edges.ends].mean(axis=1)
    outward = middle / np.linalg.norm(middle, axis=1, keepdims=True)
    assert np.abs(np.einsum("ex,ex->e", frames[:, 2], outward)).min() > 0.998


def hub(*degrees: float, order=None) -> Surface:
    """Triangles of the same size on one edge, leaving it at these angles about it."""
    turn = np.radians(degrees)
    V = np.concatenate([[[0, 0, 0], [0, 1, 0]], np.stack([np.cos(turn), 0.5 + 0 * turn, np.sin(turn)], axis=1)])
    F = np.stack([0 * turn, 1 + 0 * turn, 2 + np.arange(len(turn))], axis=1).astype(int)
    return Surface(V, F if order is None else F[order])


@pytest.mark.parametrize(
    ("degrees", "normal"),
    [
        ((0, 180), 90),  # flat
        ((0, 90), 45),  # the mean of the faces' normals across a ridge
        ((0, 60), 30),  # a sharp one
        ((0, 10), 95),  # folded back: the line that both normals are near, not their mean (5 degrees)
        ((0, 180, 90), 90),  # a web under a flange: the flange's
        ((0, 180, 45, 135), 90),
    ],
)
def test_the_normal_of_an_edge_is_the_mean_or_the_best_line_of_its_face_normals(degrees, normal):
    expected = np.array([np.cos(np.radians(normal)), 0, np.sin(np.radians(normal))])
    for order in (None, np.arange(len(degrees))[::-1]):
        for surface in (hub(*degrees, order=order), with_mixed_corners(hub(*degrees, order=order))):
            n = edge_frames(surface)[0, 2]  # edge 0 joins vertices 0 and 1
            assert abs(n @ expected) == pytest.approx(1, abs=1e-5), n


@pytest.mark.parametrize("start", [0, 10, 37, 50, 90, 200])
def test_the_tie_of_three_leaves_is_broken_by_the_first(start):
    leaves = hub(start, start + 120, start + 240)
    first = leaves.normals[0]
    for surface in (leaves, with_mixed_corners(leaves)):
        assert abs(edge_frames(surface)[0, 2] @ first) == pytest.approx(1, abs=1e-9)


def test_spread_loads_give_the_vertex_forces_of_the_load_case():
    surface = ZOO["dome"]()
    loads = [Pressure(1e3), Pressure(-300.0, Box((0, 0, 0), (0.6, 0.6, 9))), SelfWeight((0.0, 1.0, -2.0))]
    built = LoadCase.build(surface, [Support(Boundary())], loads, weight=50.0)
    assert np.allclose(spread_load(surface, loads, 50.0).vertex_forces(surface), built.force, rtol=1e-12, atol=1e-9)
    assert not spread_load(surface, [Force(Boundary(), (1.0, 0.0, 0.0))]).face.any()


def test_spread_loads_work_on_bubbles_as_their_integrals_say():
    """On one right triangle with legs 1: the integral of 4 phi_j phi_k is A / 3 = 1/6; on the edges 2 l / 3."""
    surface = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    frames = edge_frames(surface)
    spread = SpreadLoad.broadcast(surface, face=(3.0, 4.0, 6.0))
    on_bubbles = spread.bubble_forces(surface, BEST)[:, 2:]
    assert np.allclose(np.einsum("ed,edx->ex", on_bubbles, frames), [[0.5, 2 / 3, 1.0]] * 3)
    line = SpreadLoad.broadcast(surface, edge=[[3.0, 0, 0], [0, 0, 0], [0, 0, 0]])  # edge 0 joins vertices 0 and 1
    assert line.vertex_forces(surface).tolist() == [[1.5, 0, 0], [1.5, 0, 0], [0, 0, 0]]
    assert np.abs(line.bubble_forces(surface, Elements("quadratic", None))[0]).max() == pytest.approx(2.0)
    assert SpreadLoad.broadcast(surface, face=1.0).bubble_forces(surface, PAPER).shape == (3, 0)


def test_supports_hold_the_bubbles_of_their_edges():
    surface = grid(4, 4, 1.0, 1.0)
    ends = surface.edges.ends
    left = surface.V[:, 0] < 1e-9
    fixed = np.zeros((surface.n, 3), dtype=bool)
    fixed[left, 0] = fixed[left, 2] = True  # a diaphragm: free along y
    held = held_on_edges(surface, BEST, fixed, None)
    on = left[ends].all(axis=1)
    names = BEST.on_edges
    assert held[on][:, names.index("across")].all()
    assert held[on][:, names.index("normal")].all()
    assert not held[on][:, names.index("along")].any()
    assert not held[on][:, names.index("rotation")].any()
    assert not held[~on].any()


def test_a_held_region_holds_its_edges_but_a_held_rim_does_not_hold_the_corners_chords():
    surface = grid(6, 6, 1.0, 1.0)
    ends, rim = surface.edges.ends, np.zeros(surface.n, dtype=bool)
    rim[surface.edges.ends[surface.edges.boundary]] = True
    around = held_on_edges(surface, BEST, np.repeat(rim[:, None], 3, axis=1), None)
    assert np.array_equal(around[:, 2:].any(axis=1), surface.edges.boundary)
    assert not around[:, :2].any()
    region = surface.V[:, 0] < 0.4
    inside = held_on_edges(surface, BEST, np.repeat(region[:, None], 3, axis=1), None)
    assert np.array_equal(inside.all(axis=1), region[ends].all(axis=1))


def loaded_strip(cells: int = 8):
    surface = grid(4 * cells, cells, 1.0, 0.1)
    root, tip = surface.V[:, 0] < 1e-9, surface.V[:, 0] > 1 - 1e-9
    clamped = root[surface.edges.ends].all(axis=1)
    spread = SpreadLoad.broadcast(surface, edge=tip[surface.edges.ends].all(axis=1)[:, None] * np.array([0, 0, -100.0]))
    return surface, LoadCase(case(surface, [(root, "xyz")]).fixed, spread.vertex_forces(surface), tip), clamped, spread


@pytest.mark.parametrize("bending", ["midedge", "hhj"])
def test_a_sheet_held_along_one_line_needs_a_clamp_and_then_bends_like_a_beam(bending):
    """Tip sag P l^3 / (3 E I) with nu = 0; reactions and the clamp's moment balance the load."""
    surface, load, clamped, spread = loaded_strip()
    wood = Material(1e10, 0.0)
    with pytest.raises(StaticsError, match="turn about y"):
        solve_statics(SheetModel(surface, wood, H), load, Elements("quadratic", bending), spread)
    answer = solve_statics(SheetModel(surface, wood, H, clamped=clamped), load, Elements("quadratic", bending), spread)
    tip = surface.V[:, 0] > 1 - 1e-9
    beam = 10.0 / (3 * 1e10 * 0.1 * H**3 / 12)
    assert -answer.u[tip, 2].mean() == pytest.approx(beam, rel=1e-4 if bending == "hhj" else 2e-3)
    assert answer.reaction.sum(axis=0) == pytest.approx([0, 0, 10.0], abs=1e-6)
    assert answer.imbalance < 1e-7
    # the edges of the tip turn about y by P l^2 / (2 E I)
    turns = np.abs(answer.on_edges["rotation"][tip[surface.edges.ends].all(axis=1)])
    assert turns == pytest.approx(1.5 * beam, rel=1e-3 if bending == "hhj" else 5e-3)


def test_hinges_cannot_be_clamped_and_say_so():
    surface, load, clamped, _ = loaded_strip(2)
    with pytest.raises(StaticsError, match=r"2 edges are clamped, but `hinge`"):
        solve_statics(SheetModel(surface, STEEL, H, clamped=clamped), load)
    with pytest.raises(StaticsError, match="one value for each"):
        solve_statics(SheetModel(surface, STEEL, H, clamped=clamped[:-1]), load, Elements("constant", "hhj"))


@pairs
def test_compliance_is_twice_the_energy_over_all_unknowns(elements):
    surface = ZOO["dome"]()
    spread = SpreadLoad.broadcast(surface, face=(10.0, 0.0, -1e3))
    rim = np.zeros(surface.n, dtype=bool)
    rim[surface.edges.ends[surface.edges.boundary]] = True
    load = LoadCase(np.repeat(rim[:, None], 3, axis=1), spread.vertex_forces(surface), rim)
    K = membrane_stiffness(surface, STEEL, H, elements=elements) + bending_stiffness(surface, STEEL, H, elements)
    answer = equilibrium(surface, K, load, elements, spread=spread)
    X = np.concatenate([answer.u.ravel(), *(answer.on_edges[name] for name in elements.on_edges)])
    assert answer.compliance == pytest.approx(X @ (K @ X), rel=1e-9)
    assert 0 <= answer.residual < 1e-12
    assert set(answer.on_edges) == set(elements.on_edges)
    assert (answer.bubbles is None) == (elements.membrane == "constant")


@pytest.mark.parametrize(("share", "says"), [(0.3, r"relative residual of the solution is 3\.8e-01"), (0.99, None)])
def test_a_poor_solution_is_refined_or_refused(share, says, monkeypatch):
    """A solver that is off by d leaves an error of d^k after k steps: refused where that does not halve it."""
    surface = grid(4, 4, 1.0, 1.0)
    load = case(surface, [(surface.V[:, 0] < 1e-9, "xy")], [(surface.V[:, 0] > 1 - 1e-9, (1.0, 0, 0))])
    factorise = factorisation.factorise

    def careless(*args, **kwargs):
        exact = factorise(*args, **kwargs)
        return lambda b: share * exact(b)

    monkeypatch.setattr(factorisation, "factorise", careless)
    monkeypatch.setattr(solve, "BALANCE", 1.0)
    if says:
        with pytest.raises(StaticsError, match=says):
            solve_statics(SheetModel(surface, STEEL, H), load)
    else:
        assert solve_statics(SheetModel(surface, STEEL, H), load).residual <= factorisation.ACCURATE


def test_long_beams_of_many_cells_are_not_taken_for_mechanisms():
    beam = TESTS["straight_beam_out_of_plane"]
    assert beam.problem(8, "union_jack").solve(BEST) == pytest.approx(beam.reference, rel=0.01)


def test_names_of_unknowns_and_their_number():
    surface = sphere(1)
    n, e = surface.n, len(surface.edges.ends)
    expected = {PAPER: 3 * n, Elements("quadratic", "midedge"): 3 * n + 3 * e, BEST: 3 * n + 5 * e}
    assert {pair: pair.unknowns(surface) for pair in expected} == expected
    assert BEST.in_plane.on_edges == ("along", "across")
    assert str(BEST) == "hybrid+hhj"
    assert BEST.on_edges == SIX_NODES.on_edges
    with pytest.raises(ValueError, match="no bending"):
        bending_stiffness(surface, STEEL, H, BEST.in_plane)


@pytest.mark.parametrize("elements", [PAPER, Elements("quadratic", "midedge"), BEST], ids=str)
@settings(max_examples=4, deadline=None, derandomize=True)
@given(axis=st.tuples(*[st.floats(-1, 1)] * 3), size=st.floats(1e-3, 1e3))
def test_turning_and_enlarging_a_structure_turns_and_enlarges_its_answer(elements, axis, size):
    """Sheet, thickness and pressure in the same proportion: displacements grow with the size, stresses stay."""
    surface = lifted(lambda x, y: 16 * x * (1 - x) * y * (1 - y), cells=5)
    R = Rotation.from_rotvec(np.array(axis) * 3).as_matrix()
    other = Surface(size * surface.V @ R.T, surface.F)
    rim = np.zeros(surface.n, dtype=bool)
    rim[surface.edges.ends[surface.edges.boundary]] = True
    held = np.repeat(rim[:, None], 3, axis=1)
    answers = []
    for sheet, thickness, push in ((surface, 0.02, [1e4, 0, -1e5]), (other, 0.02 * size, R @ [1e4, 0, -1e5])):
        spread = SpreadLoad.broadcast(sheet, face=push)
        load = LoadCase(held, spread.vertex_forces(sheet), rim)
        answers.append(solve_statics(SheetModel(sheet, STEEL, thickness), load, elements, spread))
    here, there = answers
    assert np.abs(there.u / size - here.u @ R.T).max() <= 1e-8 * here.largest_displacement
    assert there.compliance == pytest.approx(here.compliance * size**3, rel=1e-8)
    sigma = R @ stress(surface, STEEL, here.u, bubbles=here.bubbles) @ R.T
    assert np.abs(stress(other, STEEL, there.u, bubbles=there.bubbles) - sigma).max() <= 1e-8 * np.abs(sigma).max()


def test_mkl_is_found_without_a_search_of_the_installation(monkeypatch):
    pytest.importorskip("pypardiso", reason="the optional solver is not installed")
    if not any("mkl_rt" in file.name for file in importlib.metadata.files("mkl") or []):
        pytest.skip("MKL was not installed as a Python package")
    monkeypatch.delenv("PYPARDISO_MKL_RT", raising=False)
    monkeypatch.setattr("glob.glob", lambda *_, **__: pytest.fail("searched the whole installation"))
    solution = sparse.factorise(eye_array(3, format="csr") * 2.0, np.zeros((3, 3)), solver="PARDISO")(np.ones(3))
    assert solution == pytest.approx([0.5] * 3)


@pytest.mark.slow
@pytest.mark.parametrize("preset", ["cantilever", DOME_MODES])
def test_presets_name_their_elements(preset):
    """A flat sheet loaded in its plane (no bending) and a curved one; edges longer, to be quick."""
    coarse = {"surface.edge": 0.6 if preset == DOME_MODES else 0.1}
    designs = [
        run(load_preset(preset, {**coarse, **more}))
        for more in ({}, {"statics.membrane": "quadratic", "statics.bending": "hhj"})
    ]
    plain, rich = (design.statics for design in designs)
    surface, asked, answer = designs[1].surface, designs[1].preset.statics, rich.equilibrium
    weight = asked.density * asked.thickness * GRAVITY
    spread = spread_load(surface, designs[1].preset.surface.load, weight)
    again = solve_statics(
        SheetModel(surface, asked.elastic, asked.thickness, asked.law),
        rich.load,
        elements=Elements("quadratic", "hhj"),
        spread=spread,
    )
    assert answer.compliance == pytest.approx(again.compliance, rel=1e-12)
    assert np.allclose(rich.sigma, stress(surface, asked.elastic, again.u, asked.law, again.bubbles), rtol=1e-9)
    assert set(rich.equilibrium.on_edges) == set((BEST if preset == DOME_MODES else BEST.in_plane).on_edges)
    assert not plain.equilibrium.on_edges
    assert rich.sigma.shape == plain.sigma.shape
    assert rich.equilibrium.compliance == pytest.approx(plain.equilibrium.compliance, rel=0.5)
    balance = [statics.equilibrium.reaction.sum(axis=0) for statics in (rich, plain)]
    assert balance[0] == pytest.approx(balance[1], rel=1e-6, abs=1)
