"""What reading a file may cost: triangles, bytes, vertices and seconds, each checked before it is spent.

All of them follow from the number of triangles that is accepted, so that one option lifts them all.
"""

import time
from dataclasses import dataclass, field

from dsfab.errors import SurfaceError

DEFAULT_TRIANGLES = 4_000_000
"""Triangles of a file unless asked otherwise: twice what the whole line was ever tried with."""
BYTES_EACH = 500
"""Bytes of a file for each triangle: a text file with normals, textures and colours at every corner takes 350."""
VERTICES_EACH = 3
"""Vertices for each triangle: a soup has three."""
SECONDS_EACH = 6e-5
"""Seconds for each triangle: the slowest reader takes a sixth of it on one core of 2020."""
SMALLEST = 20.0
"""Seconds that any file may take."""


class MalformedFileError(ValueError):
    """What is wrong with the content of a file, in words for its user; `guard.readable` adds the file's name."""


@dataclass(frozen=True)
class Budget:
    """How much one file may take.

    triangles : most triangles that it may have.
    started   : when the reading began, seconds of the process's clock.
    """

    triangles: int = DEFAULT_TRIANGLES
    started: float = field(default_factory=time.monotonic)

    @property
    def bytes(self) -> int:
        """Most bytes of the file, and of what it is unpacked to."""
        return BYTES_EACH * self.triangles

    @property
    def seconds(self) -> float:
        """Most seconds."""
        return max(SMALLEST, SECONDS_EACH * self.triangles)

    def require_triangles(self, count: int) -> None:
        """Raise SurfaceError for more triangles than are accepted."""
        self._require(count, self.triangles, "triangles")

    def require_vertices(self, count: int, what: str = "vertices") -> None:
        """Raise SurfaceError for more vertices, or other records, than the accepted triangles can have."""
        self._require(count, VERTICES_EACH * self.triangles, what)

    def require_bytes(self, count: int, what: str = "bytes") -> None:
        """Raise SurfaceError for more bytes than a file of the accepted triangles has; `what` says of which kind."""
        self._require(count, self.bytes, what)

    def require_time(self) -> None:
        """Raise SurfaceError once the reading took too long."""
        if time.monotonic() - self.started > self.seconds:
            raise SurfaceError(f"reading took more than {self.seconds:.0f} s; {_LIFT}")

    def _require(self, count: int, most: int, what: str) -> None:
        if count > most:
            raise SurfaceError(f"the file has {count:,} {what}, and {most:,} is the limit; {_LIFT}")


_LIFT = "make the mesh coarser, or allow more with --max-triangles N (surface.max_triangles in a preset)"
"""What to do about any of the limits."""
