"""A design as a model for CalculiX, with our own answer beside it: what a user needs to check us."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.design import Design
from dsfab.export.calculix import Element, Model
from dsfab.pipeline.log import Log, Progress
from dsfab.pipeline.structure import statics_step, surface_step
from dsfab.preset import Preset
from dsfab.statics import VERDICT, Equilibrium, SpreadLoad, flat_axis, solve_statics, spread_load
from dsfab.study.finite_elements import axes_of_file, nodal_forces, sheet_model
from dsfab.study.handover import sheet_load
from dsfab.surface import LoadCase, Surface
from dsfab.units import GRAVITY

UNRELIABLE = (
    "S6 shells are unreliable on cut curved sheets: CalculiX may refuse the file or answer far too soft; check the "
    "uncut sheet instead, or a sheet that is flat and loaded in its plane"
)


ROUNDING = 1e-9
"""Components under this share of the largest are shown as zero."""


@dataclass(frozen=True, eq=False)
class CheckModel:
    """A model, the surface it was made of, and our own answers to its steps with the elements for verdicts."""

    model: Model
    surface: Surface
    answers: Mapping[str, Equilibrium]
    warnings: tuple[str, ...]


def uncut_model(preset: Preset, progress: Progress | None = None) -> CheckModel:
    """The whole surface of a preset under its loads: S6 shells, or CPS6 if it is flat and loaded in its plane.

    Raises DsfabError for a preset that cannot be solved.
    """
    log = Log(progress)
    surface = surface_step(preset, log)
    load = statics_step(preset, surface, log).load
    supports = {f"SUPPORT_{k}": support.fixed(surface) for k, support in enumerate(preset.surface.support, 1)}
    weight = preset.statics.density * preset.statics.thickness * GRAVITY
    spread = spread_load(surface, preset.surface.load, weight)
    return _checked(preset, surface, load, supports, spread, "uncut", progress)


def cut_model(design: Design, progress: Progress | None = None) -> CheckModel:
    """The cut sheet of a design, with the loads of the uncut surface handed over to its vertices (`sheet_load`)."""
    sheet, preset = design.sheet, design.preset
    load = sheet_load(design.surface, sheet, design.load)
    held = (support.fixed(design.surface) for support in preset.surface.support)
    supports = {f"SUPPORT_{k}": sheet.between(fixed) for k, fixed in enumerate(held, 1)}
    return _checked(preset, sheet.surface, load, supports, None, "cut", progress)


def _checked(
    preset: Preset,
    surface: Surface,
    load: LoadCase,
    supports: dict[str, Bools],
    spread: SpreadLoad | None,
    kind: str,
    progress: Progress | None,
) -> CheckModel:
    sheet, axis = preset.statics, flat_axis(surface, load)
    element: Element = "S6" if axis is None else "CPS6"
    warnings = (UNRELIABLE,) if kind == "cut" and element == "S6" and not surface.is_flat else ()
    if progress:
        progress("check", f"solving {surface.m:,} triangles with {VERDICT}")
    material, thickness = sheet.material, sheet.thickness
    answer = solve_statics(surface, material, load, thickness, membrane="quadratic", bending="hhj", spread=spread)
    steps = {"loads of the preset": nodal_forces(surface, load.force, spread)}
    across = 2 if axis is None else axis
    model = sheet_model(surface, material, thickness, supports, steps, element=element, axis=across)
    turn = axes_of_file(across)
    notes = (
        *(f"WARNING: {text}" for text in warnings),
        f"The {kind} sheet, {thickness:g} m thick, solved in plane stress",
        *model.notes,
        *_on_supports(preset, model),
        *(
            line
            for name in steps
            for line in _expected(name, model, answer.u[:, turn], answer.reaction[:, turn], answer.compliance)
        ),
        "Reactions are as CalculiX prints them: the forces of its supports together with the loads on the same nodes",
        "Where the two differ by more than you accept, refine the mesh (surface.refine, surface.edge)",
    )
    return CheckModel(replace(model, name=preset.name, notes=notes), surface, dict.fromkeys(steps, answer), warnings)


def _on_supports(preset: Preset, model: Model) -> Iterator[str]:
    for (name, held), support in zip(model.supports.items(), preset.surface.support, strict=True):
        yield f"{name} holds {support.hold} at {int(held.any(axis=1).sum())} nodes"


def _expected(name: str, model: Model, u: Floats, reaction: Floats, compliance: float) -> Iterator[str]:
    """What CalculiX should find in one step, from our displacements and reactions (n, 3) in the file's axes."""
    force, node = model.steps[name], int(np.linalg.norm(u, axis=1).argmax())
    yield f"{name}: {_vector(force.sum(axis=0))} N in all. With {VERDICT} elements on the same triangles dsfab finds"
    yield f"  largest displacement {np.linalg.norm(u[node]):.6g} m of a corner, node {node + 1}, {_vector(u[node])} m"
    yield f"  internal energy {compliance / 2:.6g} J, half of the compliance"
    for support, held in model.supports.items():
        members: Bools = np.asarray(held.any(axis=1))
        printed = reaction[members[: len(u)]].sum(axis=0) + force[members].sum(axis=0)
        yield f"  reaction {_vector(printed)} N of {support}"


def _vector(values: Floats) -> str:
    """Three numbers, without those that are rounding."""
    kept = np.where(np.abs(values) > ROUNDING * np.abs(values).max(), values, 0.0)
    return "(" + ", ".join(f"{value:.6g}" for value in kept.tolist()) + ")"
