"""A design as a finite element model for CalculiX."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import StaticsError
from dsfab.core.messages import value_with_bound
from dsfab.design import Design, Log, Progress, acting_on, permanent_loads, sheet_load, surface_step
from dsfab.design.regions_and_loads import Loading, loadings
from dsfab.design.surface_and_statics import check_scale
from dsfab.export.analysis.calculix import CalculixModel, Element
from dsfab.preset.model import Preset
from dsfab.slicing import Sheet
from dsfab.statics import Equilibrium, SheetModel, SpreadLoad, elements_of, flat_axis, solve_cases
from dsfab.statics.boundary_conditions import all_clamped, held_faces, held_middles
from dsfab.statics.elements import edge_frames
from dsfab.study.verdict import BUDGET, LoadedSurface, mode_intervals, whole_sheet
from dsfab.study.verdict.estimates import ModeEstimate
from dsfab.surface import LoadCase, Surface, support_names

THIN = 0.01
"""Largest thickness of CPS6 sections, divided by the mean edge length.
CalculiX expands CPS6 elements to solid wedges, and only thin wedges come close to plane stress."""


def six_node_triangles(surface: Surface) -> tuple[Floats, Ints]:
    """Return the nodes (n + e, 3), metres, and the six-node triangles (m, 6) of a surface.
    Nodes: n vertices, e midpoints of edges. Triangles: corners 1, 2, 3, then midpoints of edges 1-2, 2-3, 3-1."""
    edges = surface.edges
    middles = surface.V[edges.ends].mean(axis=1)
    return np.concatenate([surface.V, middles]), np.concatenate([surface.F, surface.n + edges.of], axis=1)


def nodal_forces(surface: Surface, force: Floats, spread: SpreadLoad | None = None) -> Floats:
    """Return the forces (n + e, 3) on the nodes of six-node triangles, newtons: n vertices, then e edge midpoints.
    force  : (n, 3) newtons, all loads as forces on the vertices.
    spread : the part of these loads that is distributed on faces and edges."""
    middle = np.zeros((len(surface.edges.ends), 3))
    if spread is not None:
        on_bubbles = spread.bubble_forces(surface, elements_of("six_nodes"))[:, -3:]
        middle = np.einsum("ed,edx->ex", on_bubbles, edge_frames(surface))
    corner = force.copy()
    np.add.at(corner, surface.edges.ends.ravel(), -np.repeat(middle, 2, axis=0) / 2)
    return np.concatenate([corner, middle])


def held_nodes(surface: Surface, supports: Mapping[str, Bools]) -> dict[str, Bools]:
    """Return a mask (n + e, 3) for each support, by name: directions in which it fixes vertices and edge midpoints.
    supports : by name, a mask (n, 3) of the directions in which each support fixes vertices."""
    ends = surface.edges.ends
    unassigned = held_middles(surface, _held_by_any(surface, supports))
    directions = {}
    for name, fixed in supports.items():
        middles = unassigned & fixed[ends].any(axis=1)
        unassigned = unassigned & ~middles
        directions[name] = np.concatenate([fixed, middles])
    return directions


def _held_by_any(surface: Surface, supports: Mapping[str, Bools]) -> Bools:
    return np.asarray(np.logical_or.reduce([np.zeros((surface.n, 3), dtype=bool), *supports.values()]))


def six_node_model(
    sheet: SheetModel,
    supports: Mapping[str, Bools],
    steps: Mapping[str, Floats],
    springs: Floats | None = None,
    element: Element = "S6",
    axis: int = 2,
) -> CalculixModel:
    """Return the CalculiX model of a sheet.
    supports : by name, a mask (n, 3) of the directions in which each support fixes vertices.
    steps    : by name, nodal forces (n + e, 3) of load steps, N.    springs : (n, 3) stiffness of springs, N/m.
    element  : S6, or CPS6 for a flat sheet with in-plane loads.    axis : number of the axis normal to a CPS6 sheet."""
    surface, material, clamped = sheet.surface, sheet.material, sheet.clamped
    edges = surface.edges
    X, T = six_node_triangles(surface)
    still = np.zeros(len(X), dtype=bool)
    still[T[held_faces(surface, _held_by_any(surface, supports)).all(axis=1)]] = True
    if clamped is not None:
        still[surface.n :] = clamped
        still[edges.ends[clamped]] = True
    soft = np.zeros((len(X), 3))
    if springs is not None:
        soft[: surface.n] = springs
    node_supports = held_nodes(surface, supports)
    model = CalculixModel(
        X, T, sheet.thickness, material.young, material.poisson, steps, node_supports, still, soft, material.density
    )
    return model if element == "S6" else in_plane(model, axis, THIN * surface.mean_edge)


def axes_of_file(axis: int) -> Ints:
    """Return the numbers (3,) of the surface's axes that become x, y, z in the file. axis : axis that becomes z."""
    return np.asarray(np.roll(np.arange(3), 2 - axis))


def in_plane(model: CalculixModel, axis: int, thickness: float) -> CalculixModel:
    """Return the model with CPS6 elements, with the two axes in the sheet's plane as x and y.
    axis      : number of the axis normal to the sheet.    thickness : largest thickness of the section, metres.
    Raises StaticsError for a sheet that is not flat."""
    if np.ptp(model.nodes[:, axis]) > 1e-9 * np.ptp(model.nodes, axis=0).max():
        raise StaticsError("the sheet is not flat, so CPS6 elements cannot be used; choose S6 elements")
    turn = axes_of_file(axis)
    nodes = model.nodes[:, turn] * (1, 1, 0) + 0.0  # + 0.0 turns -0 into 0
    notes = list(model.notes)
    if axis != 2:
        notes.append(f"AXES: x and y of this file are the axes {'xyz'[turn[0]]} and {'xyz'[turn[1]]} of the surface")
    share = min(1.0, thickness / model.thickness)
    if share < 1:
        notes.append(
            f"SECTION: a thickness of {model.thickness * share:.6g} m with Young's modulus {model.young / share:.6g} "
            f"Pa replaces a thickness of {model.thickness:.6g} m with {model.young:.6g} Pa, because CalculiX elements "
            f"need a small thickness for "
            f"plane stress. Displacements and reactions do not change; divide stresses by {1 / share:.5g}"
        )
    return replace(
        model,
        element="CPS6",
        nodes=nodes,
        thickness=model.thickness * share,
        young=model.young / share,
        steps={name: force[:, turn] for name, force in model.steps.items()},
        supports={name: directions[:, turn] for name, directions in model.supports.items()},
        springs=model.springs[:, turn],
        notes=tuple(notes),
    )


UNRELIABLE = (
    "S6 shells are unreliable on cut curved sheets. CalculiX may refuse the file or compute displacements that are "
    "far too large. Check the uncut sheet instead, or a flat sheet that is loaded in its plane"
)
LOADS = {
    "uncut": "Loads are those of the uncut sheet, with its whole weight; the cut sheet weighs less",
    "cut": "Loads are those of the cut sheet: its own weight, and loads of coverings on the nearest material",
}
"""A note on the loads for the model file of the uncut sheet, and a note for that of the cut sheet."""


@dataclass(frozen=True, eq=False)
class CheckModel:
    """A CalculiX model, its surface, and dsfab's solutions (`answers`) for comparison with results of CalculiX."""

    model: CalculixModel
    surface: Surface
    answers: Mapping[str, Equilibrium]
    warnings: tuple[str, ...]


def uncut_model(preset: Preset, progress: Progress | None = None) -> CheckModel:
    """Return the CalculiX model of a preset's uncut surface, with a load step for each load case and combination."""
    log = Log(progress)
    surface = surface_step(preset, log)
    check_scale(preset, surface, log)
    acting = [loading for loading in loadings(preset, surface) if loading.name]
    supports = {
        f"SUPPORT_{k}": support.fixed_directions(surface)
        for k, support in enumerate(acting_on(preset, surface).support, 1)
    }
    permanent = permanent_loads(preset, surface, acting[0].load)
    setting = LoadedSurface(surface, preset.statics.sheet(), {case.name: case.load for case in acting}, permanent)
    modes = _mode_lines(preset, setting, whole_sheet(surface), progress)
    return _check_model(preset, surface, acting, supports, "uncut", progress, modes)


def cut_model(design: Design, progress: Progress | None = None) -> CheckModel:
    """Return the CalculiX model of a design's cut sheet."""
    sheet, preset = design.sheet, design.preset
    nothing = SpreadLoad.broadcast(sheet.surface)  # spread loads are already part of the vertex forces
    acting = [
        Loading(name, sheet_load(design.surface, sheet, case.load), nothing, case.factors)
        for name, case in design.statics.cases.items()
    ]
    surface, supports = design.surface, acting_on(preset, design.surface).support
    fixed = (
        sheet.vertices_between(surface, support.fixed_directions(surface), support.fixed_edges(surface))
        for support in supports
    )
    held_directions = {f"SUPPORT_{k}": directions for k, directions in enumerate(fixed, 1)}
    modes = _mode_lines(preset, LoadedSurface.from_design(design), design.slicing.cells.subset(), progress)
    return _check_model(preset, sheet.surface, acting, held_directions, "cut", progress, modes)


def _mode_lines(preset: Preset, setting: LoadedSurface, material: Sheet, progress: Progress | None) -> list[str]:
    if not (request := preset.statics.analyses).modes:
        return []
    modes = mode_intervals(setting, material, request, BUDGET, progress)
    lines = [
        f"Lowest factor of linear buckling, {name}: {_ascii_estimate(estimate)}"
        for name, estimate in modes.buckling.items()
    ]
    lines += [f"Lowest natural frequency: {_ascii_estimate(modes.hertz, 'Hz')}"] if modes.hertz else []
    if lines:
        assumed = f"; {modes.assumed}" if modes.assumed else ""
        meshes = f"Buckling factors and frequencies are extrapolated from {len(modes.levels)} meshes"
        lines.append(f"{meshes}{assumed}; no analysis step in this file computes buckling factors or frequencies")
    return [*lines, *modes.refusals]


def _ascii_estimate(estimate: ModeEstimate, unit: str = "") -> str:
    return value_with_bound(estimate.value, estimate.finite_bound, unit).replace("±", "+-")


def _check_model(
    preset: Preset,
    surface: Surface,
    acting: Sequence[Loading],
    held_directions: Mapping[str, Bools],
    kind: str,
    progress: Progress | None,
    modes: Sequence[str] = (),
) -> CheckModel:
    cases = {loading.name: loading.load for loading in acting if loading.factors is None}
    load, axis = acting[0].load, flat_axis(surface, *cases.values())
    element: Element = "S6" if axis is None else "CPS6"
    warnings = (UNRELIABLE,) if kind == "cut" and element == "S6" and not surface.is_flat else ()
    if progress:
        progress("check", f"solving {surface.m:,} triangles with {elements_of('six_nodes')}")
    answers = _answers(preset, surface, acting, cases)
    steps = {loading.name: nodal_forces(surface, loading.load.force, loading.spread) for loading in acting}
    across = 2 if axis is None else axis
    sheet = preset.statics
    holding = {name: fixed for name, fixed in held_directions.items() if fixed.any()}
    held_sheet = SheetModel(surface, sheet.elastic, sheet.thickness, clamped=all_clamped(load))
    model = six_node_model(held_sheet, holding, steps, load.spring, element, across)
    turn = axes_of_file(across)
    stored = {name: (a.compliance - float(np.sum(load.spring * a.u**2))) / 2 for name, a in answers.items()}
    rigid = {name: np.where(load.fixed, answer.reaction, 0.0)[:, turn] for name, answer in answers.items()}
    notes = (
        *(f"WARNING: {text}" for text in warnings),
        f"The {kind} sheet, {sheet.thickness:g} m thick, is solved in plane stress",
        LOADS[kind],
        *model.notes,
        *_support_lines(preset, model),
        *(
            line
            for name, answer in answers.items()
            for line in _expected_lines(name, model, answer.u[:, turn], rigid[name], stored[name])
        ),
        *modes,
        "Each reaction is the sum that CalculiX prints: the force of a rigid support plus the loads on its nodes",
        "If CalculiX and dsfab differ by more than you accept, refine the mesh (surface.refine, surface.edge)",
    )
    return CheckModel(replace(model, name=preset.name, notes=notes), surface, answers, warnings)


def _answers(
    preset: Preset, surface: Surface, acting: Sequence[Loading], cases: Mapping[str, LoadCase]
) -> dict[str, Equilibrium]:
    spreads = {loading.name: loading.spread for loading in acting if loading.name in cases}
    sums = {loading.name: loading.factors for loading in acting if loading.factors is not None}
    sheet, pair = preset.statics, elements_of("six_nodes")
    model = SheetModel(surface, sheet.elastic, sheet.thickness)
    return solve_cases(model, cases, pair, spreads=spreads, combinations=sums)


def _support_lines(preset: Preset, model: CalculixModel) -> Iterator[str]:
    names = support_names(preset.surface.support)
    for k, (name, support) in enumerate(zip(names, preset.surface.support, strict=True), 1):
        if (directions := model.supports.get(f"SUPPORT_{k}")) is not None:
            called = f" ({name})" if support.name else ""
            yield f"SUPPORT_{k}{called} holds {support.hold} at {int(directions.any(axis=1).sum())} nodes"
        if support.spring:
            yield f"the support {name} has springs with a total stiffness of {_vector(np.array(support.spring))} N/m"
        if support.clamp:
            yield f"the support {name} is clamped: supported edges do not rotate"


def _expected_lines(name: str, model: CalculixModel, u: Floats, reaction: Floats, energy: float) -> Iterator[str]:
    force, node = model.steps[name], int(np.linalg.norm(u, axis=1).argmax())
    pair = elements_of("six_nodes")
    yield (
        f"{name}: total load {_vector(force.sum(axis=0))} N. Results of dsfab with elements {pair} on these triangles:"
    )
    yield f"  largest displacement {np.linalg.norm(u[node]):.6g} m of a corner, node {node + 1}, {_vector(u[node])} m"
    yield f"  internal energy {energy:.6g} J of the sheet: half of the compliance, minus the energy of springs"
    for support, directions in model.supports.items():
        members: Bools = np.asarray(directions.any(axis=1))
        printed = reaction[members[: len(u)]].sum(axis=0) + force[members].sum(axis=0)
        yield f"  reaction {_vector(printed)} N of {support}"


def _vector(values: Floats) -> str:
    significant = np.where(np.abs(values) > 1e-9 * np.abs(values).max(), values, 0.0)
    return "(" + ", ".join(f"{value:.6g}" for value in significant.tolist()) + ")"
