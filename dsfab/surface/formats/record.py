"""What was read of a file, what was repaired in it and what was dropped, for people and for `design.json`."""

from dataclasses import dataclass, replace

from dsfab.arrays import Floats, Ints
from dsfab.surface.polygons import Polygons


@dataclass(frozen=True)
class FileRecord:
    """What became of the content of one file, a few words for each thing.

    read     : the format and what it holds; then what is doubtful about it.
    repaired : what is otherwise than in the file.
    dropped  : what the file has and the surface has not.
    """

    read: tuple[str, ...] = ()
    repaired: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()

    def also(self, repaired: tuple[str, ...] = (), dropped: tuple[str, ...] = ()) -> "FileRecord":
        """The record with more of what was repaired and dropped."""
        return replace(self, repaired=(*self.repaired, *repaired), dropped=(*self.dropped, *dropped))

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a person should know, a line each: all but the plain fact of what the file holds."""
        kinds = ("read", self.read[1:]), ("repaired", self.repaired), ("dropped", self.dropped)
        return tuple(f"{kind}: {text}" for kind, texts in kinds for text in texts)


NOTHING_READ = FileRecord()


@dataclass(frozen=True, eq=False)
class PolygonFile:
    """The polygons of a file, and remarks about the file.

    doubts : what is odd about it and may be a fault. dropped : what was passed over. unit : the one that its comments
    name. up : the axis that the program which wrote it has up, "y" or "z". None where they do not say.
    """

    mesh: Polygons
    doubts: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    unit: str | None = None
    up: str | None = None


@dataclass(frozen=True, eq=False)
class TriangleFile:
    """Triangles of a file: vertices V (n, 3) in its unit and faces F (m, 3); and remarks as of a `PolygonFile`.

    unit : the one that the file declares, None if it does not say. metres : in one of it.
    """

    V: Floats
    F: Ints
    unit: str | None = None
    metres: float = 1.0
    doubts: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
