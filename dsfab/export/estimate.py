"""What a STEP file will cost before it is written: faces, size, seconds to write and to open, memory of the receiver.

A STEP file of one face per triangle makes the program that opens it wait, not the one that writes it. Sizes are counted
from the entities that the writer would write, so they are right to a tenth; what a face costs is in
`dsfab.export.budget`. The ways are gone through in the order of `dsfab.export.ladder`, as when a file is written.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from dsfab.errors import ExportError
from dsfab.export import ladder, tessellated
from dsfab.export.budget import COSTS, START, BudgetError, way_of, within, writing
from dsfab.export.folds_text import planar_file
from dsfab.export.network.draft import member_draft, member_plan
from dsfab.export.part import Part
from dsfab.export.planar import polyhedron
from dsfab.export.shells import solids_of
from dsfab.export.simplify import usual_tolerance
from dsfab.export.smooth.build import first_draft
from dsfab.export.step_text import faceted_bytes


@dataclass(frozen=True)
class Estimate:
    """One way to write the file.

    way           : planar, members, smooth, faceted, simplified (faceted after it), tessellated ...
    faces         : of the file; triangles for tessellated. 0 where the way cannot be taken.
    size, memory  : bytes.
    write_seconds : until it is written and read back.
    open_seconds  : for the program that opens it.
    note          : how far it is off, and what else one should know.
    refused       : why this way cannot be taken; "" if it can.
    chosen        : whether `write` would take it.
    """

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
    """What each way would cost for a prepared part, the best way first, and the one that would be taken.

    Nothing is written, and nothing is checked by OCCT: a way that is chosen here may still be refused for its result.
    """
    found, taken = dict[str, Estimate](), ""
    for attempt in ladder.attempts(part):
        one = _refusal(attempt) if isinstance(attempt, BudgetError) else _estimate(attempt)
        found[one.way] = one
        if not one.refused:
            taken = one.way
            break
    for way in WAYS:
        if way not in found and (way not in ("smooth", "members") or part.curved is not None):
            found[way] = _other(part, way)
    return tuple(replace(found[way], chosen=way == taken) for way in WAYS if way in found)


def _refusal(error: BudgetError) -> Estimate:
    return _costs(error.part, error.way, error.faces, error.size, refused=f"{error.much}, {error.limit}")


def _estimate(part: Part) -> Estimate:
    """Of an attempt; refused where it cannot be made, or is over the budget."""
    way = way_of(part)
    try:
        faces, size, note = SHAPES[part.step](part)
        if part.step != "tessellated":
            within(part, faces, size)
    except BudgetError as error:
        return _refusal(error)
    except ExportError as error:
        return Estimate(way, refused=str(error))
    return _costs(part, way, faces, size, note)


def _costs(part: Part, way: str, faces: int, size: float, note: str = "", refused: str = "") -> Estimate:
    cost = COSTS[way]
    seconds = writing(part, way, faces) - (START if way == "tessellated" else 0.0)
    times = (seconds, cost.open * faces)
    return Estimate(way, faces, size, cost.memory * faces, *times, note, refused)


def _other(part: Part, way: str) -> Estimate:
    """Of a way that `attempts` does not come to: what it would cost if it were asked for."""
    if way == "planar":
        planar = replace(part, step=way)
        return _estimate(replace(planar, tolerance=part.tolerance or ladder.default_tolerance(planar)))
    if way != "simplified":
        return _estimate(replace(part, step=way))
    try:
        return _estimate(ladder.simpler(replace(part, step="faceted"), part.tolerance or usual_tolerance(part)))
    except BudgetError as error:
        return _refusal(error)
    except ExportError as error:
        return Estimate(way, refused=str(error))


def _planar(part: Part) -> tuple[int, float, str]:
    file = planar_file(part)
    return file.faces, float(sum(map(len, file.texts))), f"its outline within {file.deviation:.2g} mm of the mesh"


def _by_members(part: Part) -> tuple[int, float, str]:
    draft = member_draft(part, member_plan(part))
    return draft.faces, len(draft.text), ""


def _smooth(part: Part) -> tuple[int, float, str]:
    if default := ladder.default_tolerance(part):
        raise ExportError(f"a flat sheet is planar, within {default:.2g} mm")
    return *first_draft(
        part
    ), "not checked yet: pieces that OCCT refuses are made again, which may add a third, or faceted"


def _faceted(part: Part) -> tuple[int, float, str]:
    shape = polyhedron(part.V, part.F, solids_of(part)[0])
    return len(shape.normals), faceted_bytes(shape), part.note or "no deviation"


def _tessellated(part: Part) -> tuple[int, float, str]:
    note = f"no deviation; only on request: {tessellated.WARNING}"
    return len(part.F), tessellated.expected_bytes(part), note


SHAPES: dict[str, Callable[[Part], tuple[int, float, str]]] = {
    "planar": _planar,
    "members": _by_members,
    "smooth": _smooth,
    "faceted": _faceted,
    "tessellated": _tessellated,
}
"""For each `Part.step`: faces, bytes and a note; ExportError where the way cannot be taken."""

WAYS = ("planar", "members", "smooth", "faceted", "simplified", "tessellated")
