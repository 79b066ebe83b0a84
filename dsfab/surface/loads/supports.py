"""`Support`, rigid or on springs, and the names of supports and loads."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from typing import Annotated, ClassVar, Literal, Protocol

import numpy as np
from pydantic import AfterValidator, ConfigDict

from dsfab.core.arrays import Bools, Floats
from dsfab.core.errors import SurfaceError
from dsfab.surface.loads.outlines import Picker, edges_of
from dsfab.surface.loads.pickers import STRICT, Vector
from dsfab.surface.mesh import Surface

LONGEST_NAME = 40  # Largest number of characters of a name, because names must fit into a table.
SIGNS = " _-.,/+"  # Characters that a name may have besides letters and digits of any language.


def _checked_name(name: str) -> str:
    allowed = len(name) <= LONGEST_NAME and name == name.strip() and all(c.isalnum() or c in SIGNS for c in name)
    if not allowed:
        raise ValueError(
            f"{name[: LONGEST_NAME + 10]!r} must be up to {LONGEST_NAME} letters, digits, inner spaces and "
            f"{' '.join(SIGNS.strip())}"
        )
    return name


Name = Annotated[str, AfterValidator(_checked_name)]  # User's name of a support or load, or empty.


class _Support(Protocol):
    @property
    def name(self) -> str: ...


class _Load(_Support, Protocol):
    @property
    def kind(self) -> str: ...


def support_names(supports: Sequence[_Support]) -> list[str]:
    """Return the names of supports. A support without a name gets its number: 'support 2'."""
    return [support.name or f"support {number}" for number, support in enumerate(supports, 1)]


def load_names(loads: Sequence[_Load]) -> list[str]:
    """Return the names of loads. A load without a name gets its kind; several loads of a kind get numbers: 'snow 2'."""
    kinds = [load.kind.replace("_", " ") for load in loads]
    several = Counter(kind for kind, load in zip(kinds, loads, strict=True) if not load.name)
    numbers = {kind: count(1) for kind in several}
    return [
        load.name or (f"{kind} {next(numbers[kind])}" if several[kind] > 1 else kind)
        for kind, load in zip(kinds, loads, strict=True)
    ]


Hold = Literal["xyz", "xy", "xz", "yz", "x", "y", "z", ""]


class SupportError(SurfaceError, ValueError):
    """Error for a support with wrong values; also a ValueError, so that pydantic adds the preset's key."""


@dataclass(frozen=True)
class Support:
    """Supported vertices: `[[surface.support]]  at = { pick = "side", axis = "z", end = "min" }  hold = "xyz"`.
    hold   : letters of the axes along which the vertices are fixed; by default xyz, or none if a `spring` is set.
    spring : total stiffness along x, y and z, newtons per metre. Each vertex gets a part in proportion to its area.
    clamp  : true to prevent also the rotation of the picked edges about their own line.
    name   : text for lists of supports.
    Raises SupportError for a support without effect, a negative spring, or a spring along a fixed direction."""

    __pydantic_config__: ClassVar[ConfigDict] = STRICT
    at: Picker
    hold: Hold | None = None
    spring: Vector | None = None
    clamp: bool = False
    name: Name = ""

    def __post_init__(self) -> None:
        stiff = self.spring or (0.0, 0.0, 0.0)
        if self.hold is None:
            object.__setattr__(self, "hold", "" if any(stiff) else "xyz")
        if not all(0 <= k < np.inf for k in stiff):
            raise SupportError(f"spring = {list(stiff)} must be newtons per metre, 0 or more in each direction")
        shared_axes = [axis for axis, k in zip("xyz", stiff, strict=True) if k and axis in (self.hold or "")]
        if shared_axes:
            raise SupportError(
                f"hold = {self.hold!r} and spring = {list(stiff)} both act along {', '.join(shared_axes)}; use only "
                "one of them"
            )
        if not (self.hold or any(stiff) or self.clamp):
            raise SupportError(
                "the support holds nothing; give hold = 'xyz' or some of its letters, spring = [kx, ky, kz] in newtons "
                "per metre, or clamp = true"
            )

    def fixed_directions(self, surface: Surface) -> Bools:
        """Return a mask (n, 3): True where a vertex may not move along x, y or z."""
        return np.asarray(self.at.vertices(surface)[:, None] & np.array([axis in (self.hold or "") for axis in "xyz"]))

    def fixed_edges(self, surface: Surface) -> Bools:
        """Return a mask (e, 3): True where the points inside an edge may not move along x, y or z."""
        return np.asarray(edges_of(self.at, surface)[:, None] & np.array([axis in (self.hold or "") for axis in "xyz"]))

    def springs(self, surface: Surface) -> Floats:
        """Return the spring stiffness (n, 3) of each vertex along x, y and z, N/m. The column sums are `spring`.
        Raises SurfaceError for vertices without faces."""
        if self.spring is None:
            return np.zeros((surface.n, 3))
        share = np.where(self.at.vertices(surface), surface.vertex_areas, 0.0)
        if not share.any():
            raise SurfaceError("a spring is on vertices without faces; pick vertices of the surface")
        return np.asarray((share / share.sum())[:, None] * np.array(self.spring))

    def clamped_edges(self, surface: Surface) -> Bools:
        """Return a mask (e,) of the edges that may not rotate about their own line.
        Raises SurfaceError if `clamp` is set but no edge has both ends picked."""
        if not self.clamp:
            return np.zeros(len(surface.edges.ends), dtype=bool)
        edges = surface.edges
        ear = edges.boundary[edges.of].sum(axis=1) > 1
        across = np.zeros(len(edges.ends), dtype=bool)
        across[edges.of[ear]] = True
        is_clamped = np.asarray(edges_of(self.at, surface) & ~(across & ~edges.boundary))
        if not is_clamped.any():
            raise SurfaceError("clamp = true finds no edge with both ends picked; pick at least two neighbours")
        return is_clamped
