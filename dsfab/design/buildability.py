"""Faults of a design, such as a support at a single vertex."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dsfab.core.errors import StaticsError, SurfaceError
from dsfab.core.limits import (
    AT_ONE_VERTEX,
    FAR_FROM_SURFACE,
    FEW_VERTICES,
    LARGEST_MOVE,
    LEAST_LOAD_SHARE,
    SOME_REACTION,
)
from dsfab.core.messages import force, length, point_words
from dsfab.design.regions_and_loads import Acting, acting_on, whole_surface
from dsfab.preset.model import Preset
from dsfab.results import CaseResult, StaticsResult
from dsfab.statics import SupportEntry, load_entries, support_entries
from dsfab.surface import Nearest, Snow, Surface, Wind, load_names, support_names

NEVERTHELESS = "(statics.check = false switches this check off)"


class Objection(NamedTuple):
    """A fault of a design, as a text. refuses : True if dsfab refuses to build a design with this fault."""

    text: str
    refuses: bool = True


def objections(preset: Preset, surface: Surface, cases: Mapping[str, CaseResult]) -> Iterator[Objection]:
    """Yield the faults of a solved uncut sheet, the most serious first. cases : results by name of the load case."""
    acting, weight = acting_on(preset, surface), preset.statics.area_weight
    yield from _moving(surface, cases)
    if point := _on_one_vertex(surface, acting, cases):
        yield point
    else:
        answers = {name: case.equilibrium for name, case in cases.items()}
        yield from _on_few_vertices(support_entries(surface, acting.support, answers))
    yield from _past_faces(acting, surface, weight)
    yield from _on_supports(acting, surface, weight, cases)


def require_buildable(preset: Preset, statics: StaticsResult) -> None:
    """Raise StaticsError with the most serious fault, if any, unless statics.check is false."""
    if why := refusal(preset, statics):
        raise StaticsError(why)


def refusal(preset: Preset, statics: StaticsResult) -> str:
    """Return the most serious fault of a sheet as a text; '' without a fault, or if `statics.check` is false."""
    return f"{statics.objections[0]} {NEVERTHELESS}" if preset.statics.check and statics.objections else ""


def off_surface(preset: Preset, surface: Surface) -> tuple[str, ...]:
    """Return a sentence for each support or load that acts at a point too far from the surface's nearest vertex.
    Raises SurfaceError with the first sentence, unless `statics.check` is false."""
    section, messages, surface = preset.surface, [], whole_surface(preset, surface)
    names = [*support_names(section.support), *load_names(section.load)]
    for name, entry in zip(names, (*section.support, *section.load), strict=True):
        picker = getattr(entry, "at", None)
        for point in picker.places(surface) if isinstance(picker, Nearest) else ():
            away = float(np.linalg.norm(surface.V - point, axis=1).min())
            if away > FAR_FROM_SURFACE * surface.size:
                messages.append(
                    f"{name} is at {point_words(point)}, {length(away)} away from the nearest vertex of the "
                    "surface: move the point, or check its unit (metres)"
                )
    if messages and preset.statics.check:
        raise SurfaceError(f"{messages[0]} {NEVERTHELESS}")
    return tuple(messages)


def _moving(surface: Surface, cases: Mapping[str, CaseResult]) -> Iterator[Objection]:
    worst = max(cases, key=lambda name: cases[name].equilibrium.largest_displacement)
    answer, span = cases[worst].equilibrium, float(np.ptp(surface.V, axis=0).max())
    if answer.largest_displacement > LARGEST_MOVE * span:
        vertex = int(np.linalg.norm(answer.u, axis=1).argmax())
        yield Objection(
            f"the sheet would move by {length(answer.largest_displacement)}{_case_clause(worst, cases)} at "
            f"{point_words(surface.V[vertex])}, over a tenth of its span of {length(span)}: increase "
            "statics.thickness, take a stiffer material, a smaller load or more supports, or check the units"
        )


def _on_one_vertex(surface: Surface, acting: Acting, cases: Mapping[str, CaseResult]) -> Objection | None:
    sizes = [np.linalg.norm(case.equilibrium.reaction, axis=1) for case in cases.values() if case.factors is None]
    shares = [size / size.sum() for size in sizes if size.any()]
    least = np.min(shares, axis=0) if shares else np.zeros(surface.n)
    vertex = int(least.argmax())
    if least[vertex] <= AT_ONE_VERTEX:
        return None
    names = zip(support_names(acting.support), acting.support, strict=True)
    holding = " and ".join(name for name, support in names if support.at.vertices(surface)[vertex])
    return Objection(
        f"{least[vertex]:.0%} of the sum of all reactions acts on one vertex, at {point_words(surface.V[vertex])} "
        f"({holding}), but a sheet cannot stand on a point: support a region there, with pick = 'ball' or a larger "
        f"depth"
    )


def _on_few_vertices(entries: Sequence[SupportEntry]) -> Iterator[Objection]:
    for entry in entries:
        share = max(entry.share.values(), default=0.0)
        if entry.vertices < FEW_VERTICES and share > SOME_REACTION:
            count = "1 vertex" if entry.vertices == 1 else f"{entry.vertices} vertices"
            yield Objection(
                f"{entry.name} holds only {count}, at {point_words(entry.place)}, and carries up to {share:.0%} of "
                f"the reaction. The stress at this place depends on the mesh; support a region: use pick = 'ball' or "
                f"raise depth",
                refuses=False,
            )


def _past_faces(acting: Acting, surface: Surface, weight: float) -> Iterator[Objection]:
    climate = [load for load in acting.load if isinstance(load, Snow | Wind)]
    for load, entry in zip(climate, load_entries(surface, climate, weight), strict=True):
        if entry.total < LEAST_LOAD_SHARE * load.pressure * entry.area:
            yield Objection(
                f"{entry.name} acts parallel to its faces, and puts only {force(entry.total)} on {entry.area:.3g} m2: "
                f"change the direction of the load, or pick other faces"
            )


def _on_supports(
    acting: Acting, surface: Surface, weight: float, cases: Mapping[str, CaseResult]
) -> Iterator[Objection]:
    free = ~next(iter(cases.values())).load.fixed
    for name, load in zip(load_names(acting.load), acting.load, strict=True):
        if not load.forces(surface, weight)[free].any():
            yield Objection(
                f"{name} acts only on supports, in the directions that these supports hold, so the sheet does not "
                f"carry this load; move the load or the supports",
                refuses=False,
            )


def _case_clause(name: str, cases: Mapping[str, CaseResult]) -> str:
    return f" under {name}" if len(cases) > 1 else ""
