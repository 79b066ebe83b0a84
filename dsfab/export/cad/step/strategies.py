"""Strategies for writing a solid as STEP: their estimated costs, and messages about the choice."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.errors import ExportError, NotMadeError
from dsfab.core.limits import OUTLINE, SIMPLIFIED_OFF_SURFACE
from dsfab.core.messages import count_phrase
from dsfab.export.cad.step import entities
from dsfab.export.cad.step.by_members.build import NotByMembersError, member_file
from dsfab.export.cad.step.by_members.draft import has_too_many, member_draft
from dsfab.export.cad.step.entities import DIGITS, FACETED_DIGITS, faceted_bytes, outward_polyhedron
from dsfab.export.cad.step.file_size import (
    COSTS,
    LOADING_SECONDS,
    BudgetError,
    no_strategy_error,
    require_budget,
    simplified_part,
    strategy_of,
    usual_tolerance,
    writing_seconds,
)
from dsfab.export.cad.step.flat_sheets import NotFlatError, outlines_of
from dsfab.export.cad.step.folded_sheets import flat_facets, folded_sheet, planar_file
from dsfab.export.cad.step.shared.plan import SolidPlan
from dsfab.export.cad.step.smooth.build import first_draft, smooth_file
from dsfab.export.cad.step.soundness import smooth_use
from dsfab.export.part import Curved, Part, without_collapsed
from dsfab.surface import Surface
from dsfab.surface.topology import edge_table, half_edges

ROUTES = ("auto", "quick", "planar", "members", "smooth", "compact", "faceted", "tessellated")

QUICK_FACTOR = 3
"""Factor by which step = 'quick' raises the limits for numbers of walls and layouts (divisions into charts).
If OCCT refuses the first layout, a second layout with different seams often succeeds."""

MEMBER_FACES_FACTOR = 2
"""Factor on the usual limit of faces when step = 'auto' tries step = 'members', after a faceted file was too large.
The next attempt would be a smooth file, which CAD programs usually fail to cut."""


def prepare(part: Part) -> Part:
    """Round the part to the decimals of the file. Raises ExportError if an edge has more than two triangles."""
    V, coarse = (np.round(part.V, digits) + 0.0 for digits in (DIGITS, FACETED_DIGITS))
    ends = np.stack(half_edges(part.F))
    short = ends[:, (coarse[ends[0]] == coarse[ends[1]]).all(axis=1)]
    V[short] = coarse[short]  # short edges collapse: their ends get fewer decimals and coincide
    part = without_collapsed(part, V, f"a STEP file with {FACETED_DIGITS} decimals")
    crowded = int((edge_table(part.F).count != 2).sum())
    if crowded:
        raise ExportError(
            f"{part.name!r} has more than two triangles at {count_phrase(crowded, 'edge')}, but a STEP solid has two "
            f"faces at each edge; write STL or 3MF instead"
        )
    return part


def attempts(part: Part) -> Iterator[Part | BudgetError]:
    """Yield the part for each possible strategy, the best first; a BudgetError replaces each part that is too large."""
    tighter = 1 / 4  # tolerance of the second planar file, as a fraction of the first; closer curves cross less often
    flat, chosen = 0.0, part.step in ("auto", "quick")
    if part.step == "members":
        yield part
        yield replace(part, step="smooth", cut=True)
        yield replace(part, step="faceted")
    if chosen or part.step == "planar":
        flat = default_tolerance(part)
        planar = replace(part, step="planar", tolerance=part.tolerance or flat)
        if flat or _may_be_planar(part):
            yield planar
            if planar.tolerance:
                yield replace(planar, tolerance=tighter * planar.tolerance)
    curved, quick = chosen and part.curved is not None and not flat, part.step == "quick"
    members = replace(part, step="members", hurry=1)
    if curved and _worth_members(part):
        yield members
    if part.step == "smooth" or curved:
        hurry = (QUICK_FACTOR if quick else 1) if curved else 0
        yield replace(part, step="smooth", hurry=hurry, cut=curved and not quick)
    if part.step == "tessellated":
        yield part
    if chosen or part.step == "faceted":
        faceted = replace(part, step="faceted")
        simple = _simpler_or_error(faceted, part.tolerance) if part.tolerance else faceted
        if isinstance(simple, Part | BudgetError):
            yield simple
        else:
            yield replace(faceted, note=f"not simplified, since {simple}")
    if chosen:
        yield from _last_attempts(faceted, members if curved and not quick else None, quick)


def _worth_members(part: Part) -> bool:
    sheet = _striped_sheet(part)
    return sheet is not None and (part.step == "auto" or bool(Surface(sheet.V, sheet.F).edges.boundary.any()))


def _striped_sheet(part: Part) -> Curved | None:
    try:
        curved = part.curved() if part.curved else None
    except ExportError:
        return None
    return curved if curved and curved.striped else None


def _last_attempts(part: Part, members: Part | None, quick: bool) -> Iterator[Part | BudgetError]:
    far_factor = 2  # with more than twice the allowed faces, further tries do not help
    is_far = False
    if not part.tolerance:
        simple = _simpler_or_error(part, usual_tolerance(part))
        is_far = isinstance(simple, BudgetError) and simple.faces > far_factor * part.step_faces
        if isinstance(simple, Part | BudgetError):
            yield simple
    if members:
        if has_too_many(members):
            yield replace(members, hurry=MEMBER_FACES_FACTOR)
        yield replace(part, step="smooth", cut=True)
    if not part.tolerance and not (quick and is_far):
        simple = _simpler_or_error(part, SIMPLIFIED_OFF_SURFACE * usual_tolerance(part))
        if isinstance(simple, Part | BudgetError):
            yield simple


def _simpler_or_error(part: Part, tolerance: float) -> Part | ExportError:
    try:
        return simpler(part, tolerance)
    except ExportError as error:
        return error


def simpler(part: Part, tolerance: float) -> Part:
    """Simplify a part within a tolerance (mm). Raises ExportError for a failure, BudgetError for too many faces."""
    return prepare(simplified_part(replace(part, tolerance=tolerance), tolerance))


def default_tolerance(part: Part) -> float:
    """Return the default tolerance (mm) of a STEP file of a flat or folded sheet; 0 for other solids."""
    try:
        return OUTLINE * outlines_of(part).thickness
    except ExportError:
        folded = folded_sheet(part) if _may_be_planar(part) else None
        return OUTLINE * folded.thickness if folded else 0.0


def _may_be_planar(part: Part) -> bool:
    flat = flat_facets(part)
    return flat is None or flat.has_creases or part.step == "planar"


def route_sentence(part: Part, refused: Sequence[ExportError]) -> str:
    """Describe how the STEP file was written, and why better strategies were refused."""
    if part.step == "planar":
        again = f" (a larger tolerance was refused: {refused[-1]})" if refused else ""
        folded = folded_sheet(part)
        flat = f", {folded.count} flat facets mitred at their folds" if folded else ""
        return f"STEP is planar{flat}, its outline within {part.tolerance:.3g} mm of the mesh{again}"
    if part.step == "tessellated":
        return f"STEP is tessellated: {entities.WARNING}"
    if part.step == "members":
        return f"STEP is by members, {member_file(part).summary}{_slow(refused) if part.hurry > 1 else ''}"
    if part.step == "smooth":
        slow = "" if part.hurry else _slow(refused)
        return (
            f"STEP is smooth, {smooth_file(part).summary}{slow}{members_clause(refused)}; "
            f"{_cutting_sentence(part, refused)}"
        )
    why = "; ".join(reasons(refused))
    note = f", {part.note}" if part.note else ""
    return f"STEP is faceted{note}" + (f": {why}" if why else "")


def _slow(refused: Sequence[ExportError]) -> str:
    over = " and ".join(reasons([error for error in refused if isinstance(error, BudgetError)]))
    return f"; writing the file had no time limit, because {over}" if over else ""


def _cutting_sentence(part: Part, refused: Sequence[ExportError]) -> str:
    use = smooth_use(part)
    if use.tried and not use.fault:
        return "a half-space cut valid"
    sentence = f"cutting the part in CAD fails ({use.fault})" if use.fault else "cutting the part in CAD may fail"
    return f"{sentence}: {way_to_cut(part, refused)} to cut it there"


def way_to_cut(part: Part, refused: Sequence[ExportError]) -> str:
    """Recommend a STEP strategy for cuts in CAD: 'members' or 'faceted'."""
    by_members = [error for error in refused if _is_by_members(error)]
    over = [error for error in by_members if isinstance(error, BudgetError)]
    if over:
        return f"raise {'step_faces' if over[-1].by_faces else 'step_mb'} and write step = 'members'"
    vain = any(isinstance(error, NotByMembersError) and not error.if_asked for error in by_members)
    return "write step = 'faceted'" if vain or _striped_sheet(part) is None else "write step = 'members'"


def members_clause(refused: Sequence[ExportError]) -> str:
    """Explain why step = 'members' failed; "" if dsfab did not try that strategy."""
    why = [error.reason if isinstance(error, BudgetError) else str(error) for error in refused if _is_by_members(error)]
    return f"; not by members, since {why[-1].removeprefix('by members, ')}" if why else ""


def _is_by_members(error: ExportError) -> bool:
    return isinstance(error, NotByMembersError) or (isinstance(error, BudgetError) and error.way == "members")


def reasons(refused: Sequence[ExportError]) -> list[str]:
    """Return the reasons why strategies were refused, without repetitions."""
    remaining = [error for error in refused if not isinstance(error, NotFlatError)] or refused
    return list(dict.fromkeys(_reason_with_advice(error, str(error)) for error in remaining))


def _reason_with_advice(error: ExportError, why: str) -> str:
    if isinstance(error, BudgetError):
        return error.reason
    return f"{why}: write step = 'members'" if isinstance(error, NotByMembersError) and error.if_asked else why


def refusal(refused: Sequence[ExportError]) -> ExportError:
    """Return the error for a part that no strategy can write. refused : errors of the tried strategies."""
    over = [error for error in refused if isinstance(error, BudgetError)]
    if not over:
        return refused[-1]
    remaining = [error for error in refused if not isinstance(error, (BudgetError, NotFlatError))]
    final_reasons = {_is_by_members(x): _reason_with_advice(x, str(x).split("; ")[0]) for x in remaining}
    begin = {True: "by members, ", False: ""}
    sentences = [("" if "members" in why else begin[members]) + why for members, why in final_reasons.items()]
    tried = f" (tried too: {'; '.join(sentences)})" if sentences else ""
    return NotMadeError(f"{no_strategy_error(over) if len({error.way for error in over}) > 1 else over[-1]}{tried}")


@dataclass(frozen=True)
class Estimate:
    """Estimated cost of one strategy. size, memory : size of the file, and memory to open it, bytes.
    way     : planar, members, smooth, faceted, simplified (fewer triangles, then faceted), tessellated.
    faces   : number of faces, or of triangles if tessellated; 0 if the strategy fails.
    write_seconds, open_seconds : time to write and read back, and time for another program to open the file.
    refused : reason for the refusal, or "".    chosen : True if `write` would use this strategy."""

    way: str
    faces: int = 0
    size: float = 0.0
    memory: float = 0.0
    write_seconds: float = 0.0
    open_seconds: float = 0.0
    note: str = ""
    refused: str = ""
    chosen: bool = False


def estimates(part: Part) -> tuple[Estimate, ...]:
    """Estimate the cost of each strategy for a prepared part, the best first."""
    by_strategy, taken = dict[str, Estimate](), ""
    for attempt in attempts(part):
        estimate = _estimate(attempt) if isinstance(attempt, Part) else _refusal(attempt)
        by_strategy[estimate.way] = estimate
        if not estimate.refused:
            taken = estimate.way
            break
    for strategy in WAYS:
        if strategy not in by_strategy and (strategy not in ("smooth", "members") or part.curved is not None):
            by_strategy[strategy] = _requested_estimate(part, strategy)
    return tuple(replace(by_strategy[name], chosen=name == taken) for name in WAYS if name in by_strategy)


def _refusal(error: ExportError, strategy: str = "") -> Estimate:
    if not isinstance(error, BudgetError):
        return Estimate(strategy, refused=str(error))
    return _costs(error.part, error.way, error.faces, error.size, refused=f"{error.excess}, {error.limit}")


def _estimate(part: Part) -> Estimate:
    strategy = strategy_of(part)
    try:
        faces, size, note = SHAPES[part.step](part)
        if part.step != "tessellated":
            require_budget(part, faces, size)
    except ExportError as error:
        return _refusal(error, strategy)
    return _costs(part, strategy, faces, size, note)


def _costs(part: Part, strategy: str, faces: int, size: float, note: str = "", refused: str = "") -> Estimate:
    cost = COSTS[strategy]
    seconds = writing_seconds(part, strategy, faces) - (LOADING_SECONDS if strategy == "tessellated" else 0.0)
    return Estimate(strategy, faces, size, cost.memory * faces, seconds, cost.open * faces, note, refused)


def _requested_estimate(part: Part, strategy: str) -> Estimate:
    if strategy == "planar":
        planar = replace(part, step=strategy)
        return _estimate(replace(planar, tolerance=part.tolerance or default_tolerance(planar)))
    if strategy != "simplified":
        return _estimate(replace(part, step=strategy))
    simple = _simpler_or_error(replace(part, step="faceted"), part.tolerance or usual_tolerance(part))
    return _estimate(simple) if isinstance(simple, Part) else _refusal(simple, strategy)


def _estimate_planar(part: Part) -> tuple[int, float, str]:
    file = planar_file(part)
    return file.faces, float(sum(map(len, file.texts))), f"the outline is within {file.deviation:.2g} mm of the mesh"


def _estimate_by_members(part: Part) -> tuple[int, float, str]:
    draft = member_draft(part, SolidPlan(part))
    return draft.faces, len(draft.text), ""


def _estimate_smooth(part: Part) -> tuple[int, float, str]:
    if default := default_tolerance(part):
        raise ExportError(f"the sheet is flat or folded; write step = 'planar' (within {default:.2g} mm)")
    note = "not checked yet: dsfab fits pieces that OCCT refuses again, and writes them faceted if the second fit fails"
    return *first_draft(part), note


def _estimate_faceted(part: Part) -> tuple[int, float, str]:
    shape, _ = outward_polyhedron(part)
    return len(shape.normals), faceted_bytes(shape), part.note or "no deviation"


def _estimate_tessellated(part: Part) -> tuple[int, float, str]:
    return (
        len(part.F),
        entities.expected_bytes(part),
        f"the file has the same triangles as the mesh; dsfab writes this kind only on request: {entities.WARNING}",
    )


SHAPES: dict[str, Callable[[Part], tuple[int, float, str]]] = {
    "planar": _estimate_planar,
    "members": _estimate_by_members,
    "smooth": _estimate_smooth,
    "faceted": _estimate_faceted,
    "tessellated": _estimate_tessellated,
}
"""Function of each strategy `Part.step`. It returns the number of faces, bytes and a note, or raises ExportError."""

WAYS = ("planar", "members", "smooth", "faceted", "simplified", "tessellated")
