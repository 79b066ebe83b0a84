"""How large a STEP file may be, what one costs, and the refusal that says both.

Seconds and memory are of OCCT 8 on a busy machine of two cores (`tests/benchmarks/formats.py` measures them); other
programs are slower rather than faster.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.wording import duration

START = 1.5
"""Seconds that reading back takes at least: a process that loads OCCT."""


@dataclass(frozen=True)
class Cost:
    """Per face: seconds to write and read back, seconds for another program to open it, bytes of memory for that."""

    write: float
    open: float
    memory: float


COSTS = {
    "planar": Cost(3e-3, 1e-3, 30e3),
    "members": Cost(5e-3, 1e-3, 30e3),
    "smooth": Cost(2e-2, 4e-3, 30e3),
    "faceted": Cost(1e-3, 5e-4, 9e3),
    "simplified": Cost(1e-3, 5e-4, 9e3),
    "tessellated": Cost(2e-5, 1e-5, 1e3),
}


IN_USE = 6e-2
"""Seconds for each face of a file by members that is asked for by name: eight cuts of it, and what else is tried."""


class BudgetError(ExportError):
    """A STEP file with more faces, or of more bytes (an estimate; 0 if nobody knows), than the part may have."""

    def __init__(self, part: Part, faces: int, size: float = 0.0) -> None:
        self.part, self.way, self.faces, self.size = part, way_of(part), faces, size
        super().__init__(f"the STEP file of {part.name!r} would have {self.much}, {self.limit}; {advice(self)}")

    @property
    def by_faces(self) -> bool:
        """Whether faces are too many, or else bytes."""
        return self.faces > self.part.step_faces

    @property
    def made(self) -> str:
        """The way, and within what tolerance."""
        within = f" within {self.part.tolerance:.2g} mm" if self.way == "simplified" and self.part.tolerance else ""
        return self.way + within

    @property
    def much(self) -> str:
        """What is too much, as the end of `it would have ...`."""
        if self.by_faces:
            about = "about " if self.way == "simplified" else ""
            return f"{about}{self.faces:,} {'planar ' if self.way not in ('smooth', 'members') else ''}faces"
        return f"{self.size / 1e6:.3g} MB"

    @property
    def limit(self) -> str:
        """More than what."""
        if self.by_faces:
            return f"more than step_faces = {self.part.step_faces}"
        return f"more than step_mb = {self.part.step_mb:g} MB"

    @property
    def short(self) -> str:
        """Why this way was not taken, without the ways out."""
        return f"{self.made} it would have {self.much}, {self.limit}"

    @property
    def cost(self) -> str:
        """What this way would cost without a limit."""
        size = f"{self.size / 1e6:.3g} MB, " if self.size else ""
        seconds = writing(self.part, self.way, self.faces)
        return f"{self.made} {self.faces:,} faces ({size}about {duration(seconds)} to write and check)"


def within(part: Part, faces: int, size: float = 0.0) -> None:
    """Raise BudgetError where a file has more faces or bytes than the part may have."""
    if faces > part.step_faces or (part.step_mb and size > 1e6 * part.step_mb):
        raise BudgetError(part, faces, size)


def writing(part: Part, way: str, faces: int) -> float:
    """Seconds to write a part in some way, with so many faces, and to read it back."""
    tried = IN_USE if way == "members" and not part.hurry else 0.0
    return START + (COSTS[way].write + tried) * faces


def way_of(part: Part) -> str:
    """planar, members, smooth, faceted, simplified (faceted after it) or tessellated."""
    return "simplified" if part.step == "faceted" and part.simpler else part.step


def advice(error: BudgetError) -> str:
    """The ways out."""
    key = "step_faces" if error.by_faces else "step_mb"
    return f"write STL or 3MF instead, coarsen the mesh, simplify with step_tolerance, or raise {key}"


def none_within(refused: Sequence[BudgetError]) -> ExportError:
    """The refusal of a part whose every way is over the budget: what each would cost, and the ways out."""
    last = refused[-1]
    ways = ", ".join({one.way: one.cost for one in refused}.values())
    return ExportError(f"every STEP file of {last.part.name!r} would be {last.limit}: {ways}; {advice(last)}")
