"""The mesh on which a pattern is drawn, values at its vertices, and the settings of its shader.

Stripes on modes are drawn on the surface. Evenly spaced stripes have consistent phases on a chart only (see
`dsfab.slicing.Chart`): they are drawn on it, as if on two modes at frequency 1 and phase 0.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from dsfab.core.arrays import Floats, unit_vectors
from dsfab.core.derived import derived
from dsfab.design.design import Design
from dsfab.pattern import distance_to_boundary, distance_to_vertices
from dsfab.pattern.layers import finest_half_widths
from dsfab.preset.model import AUTO, FAMILIES, STAGES, Pattern, Preset
from dsfab.render.scene import Bytes, Floats32
from dsfab.render.shader import BY_VERTEX, FAR, NO_REACH, Settings
from dsfab.results import EvenStripes, PatternResult
from dsfab.surface import DividedField, Surface

SLIDING = 1 / 8
"""Largest reach with exact distances for all presets, over the size of the surface."""


DRAWN = 1e33
"""Factor for distances from drawn regions, which makes every reach 0 beside them, even `NO_REACH`."""
DRAWN_ONLY = -1e6
"""Reach for drawn regions alone: the shader reads distances only for reaches over `NO_REACH`."""


@dataclass(frozen=True, eq=False)
class StripedMesh:
    """Mesh of the stripes: the uncut surface (n, m), or the chart of evenly spaced stripes (n', m').

    Places, loads and supports always have the numbers of the uncut surface.
    """

    uncut: Surface
    even: EvenStripes | None

    @classmethod
    def of(cls, made: Design) -> Self:
        """Return the mesh of a design."""
        return cls(made.surface, made.pattern.even)

    @property
    def surface(self) -> Surface:
        """(n', m') mesh to draw; the same sheet as the uncut surface."""
        return self.even.chart.surface if self.even else self.uncut

    def same(self, other: "StripedMesh") -> bool:
        """Return whether the mesh and the phases of even stripes are equal."""
        if self.uncut is not other.uncut or (self.even is None) != (other.even is None):
            return False
        if self.even is None or other.even is None or self.even is other.even:
            return True
        one, two = self.even.chart, other.even.chart
        return all(
            np.array_equal(a, b)
            for a, b in ((one.z, two.z), (one.surface.F, two.surface.F), (one.surface.V, two.surface.V))
        )

    def carry(self, x: Floats) -> Floats:
        """Return values (n, ...) at the uncut vertices as values (n', ...) at the vertices of this mesh."""
        return self.even.chart.carry(x) if self.even else x

    def on_faces(self, x: Bytes) -> Bytes:
        """Return colours (m, 3) of the uncut faces as colours (m', 3) of this mesh."""
        return x[self.even.chart.parent] if self.even else x

    def at_corners(self, x: Floats32) -> Floats32:
        """Return normals (m, 3, 3) at corners of the uncut faces as normals (m', 3, 3) of this mesh."""
        if self.even is None:
            return x
        return np.asarray(self._corner_weights @ x[self.even.chart.parent], dtype=np.float32)

    @cached_property
    def _corner_weights(self) -> Floats:
        assert self.even is not None
        chart = self.even.chart
        rows, columns = np.broadcast_arrays(chart.surface.F[:, :, None], self.uncut.F[chart.parent][:, None, :])
        return np.asarray(chart.weights[rows.ravel(), columns.ravel()]).reshape(-1, 3, 3)

    @cached_property
    def normals(self) -> Floats:
        """(n', 3) unit normals of the uncut surface, so that light does not show its division."""
        if self.even is None:
            return self.uncut.vertex_normals
        return unit_vectors(self.carry(self.uncut.vertex_normals))

    def phases(self, made: Design) -> Floats:
        """Return (n', 2) modes of both families, or the phases of even stripes."""
        if self.even:
            return self.even.chart.z
        mode, modes = made.pattern.mode, made.diffusion
        return np.stack([modes.major.mode(mode[0]), modes.minor.mode(mode[1])], axis=1)

    @cached_property
    def shares(self) -> Floats:
        """(n', 2) half-widths on one side of a vertex over `PatternResult.half_widths`, its mean; 0 without a phase."""
        if self.even is None:
            return np.ones((self.uncut.n, 2))
        return self.carry(self.even.slope / self.even.density) * self.even.chart.scale

    def half_widths(self, pattern: PatternResult) -> Floats:
        """Return half-widths (n', 2) of both families, in periods of `phases`."""
        local = [pattern.half_width(name) for name in FAMILIES]
        if self.even is None:
            return np.stack(local, axis=1)
        even, finest = self.even, list[Floats]()
        for k, d in enumerate(local):
            finest.append(finest_half_widths(d, even.slope[:, k], even.density[:, k], len(even.wanted[k])))
        return self.carry(np.stack(finest, axis=1)) * even.chart.scale


def distances(made: Design) -> tuple[Floats, Floats]:
    """Return distances (n,) to loads and supports, and to the boundary (m), as far as a slider or the preset reaches.

    With drawn regions the first is the distance outside of them and of kept material, times `DRAWN`.
    """
    return _distances(made)


@derived
def _distances(made: Design) -> tuple[Floats, Floats]:
    surface, load, ask = made.surface, made.load, made.preset.pattern
    reach = max(SLIDING * surface.size, ask.keep, ask.rim)
    near = distance_to_vertices(surface, load.held | load.loaded, reach)
    if ask.drawn_regions:
        near = DRAWN * _outside(made, near)
    return near, distance_to_boundary(surface, reach)


def _outside(made: Design, near: Floats) -> Floats:
    """Return distances (n,) outside of kept material and drawn regions (m), roughly; 0 along their outlines."""
    surface, ask = made.surface, made.preset.pattern
    off = np.where(np.isfinite(near) & (ask.keep > 0), near - ask.keep, surface.size)
    for field in made.pattern.fields[: ask.drawn_regions]:
        x = field.at_vertices if isinstance(field, DividedField) else field
        assert isinstance(x, np.ndarray)
        if x.ndim == 1:
            # vertices on the outline of a solid region lie a little outside of it
            region = np.where(x > 0, -surface.mean_edge, 1e-3 * surface.mean_edge)
            off = np.where(x >= 0, np.minimum(off, region), off)
        else:
            off = np.where(x[:, 0] >= 0, np.minimum(off, x[:, 1]), off)
    return off


def fields(design: Design, mesh: StripedMesh, distances: tuple[Floats, Floats]) -> Floats:
    """Return phases, half-widths and distances (n', 6) (see `StripeShader`); distances : (n,) each."""
    return np.concatenate(
        [mesh.phases(design), mesh.half_widths(design.pattern), mesh.carry(finite(distances))], axis=1
    )


def finite(distances: tuple[Floats, Floats], far: float = FAR) -> Floats:
    """Return distances (n, 2) with a limit for infinity, because infinity times a weight of 0 is not a number."""
    return np.where(np.isfinite(distances), distances, far).T


def only_numbers(made: Preset, preset: Preset) -> bool:
    """Return whether a preset differs from the drawn preset in numbers of the shader only."""
    old, new = made.pattern, preset.pattern
    first = preset.first_difference(made)
    if first is None or STAGES.index(first) > STAGES.index("pattern"):
        return True
    if (
        first != "pattern"
        or old.region != new.region
        or old.width != new.width
        or new.width.solid_fraction
        or old.method != new.method
    ):
        return False
    if new.drawn_regions and new.keep != old.keep:
        return False
    if new.method != "modes":
        return new.method == "stripes" and _but_reaches(old) == _but_reaches(new)
    if new.width.widths(1.0).vary or new.auto:  # these depend on every number
        return False
    if new.major.spacing or new.minor.spacing:  # frequencies are solved for
        return False
    return (old.major.mode, old.minor.mode) == (new.major.mode, new.minor.mode)


def _but_reaches(pattern: Pattern) -> dict[str, object]:
    """Return the pattern without the numbers of the shader for even stripes, whose widths vary at vertices."""
    return pattern.model_dump(exclude={"keep", "rim", "fillet", "tidy"})


def numbers(preset: Preset, made: PatternResult, show: str) -> Settings:
    """Return the shader settings of a preset, with solved numbers of its pattern's result."""
    ask = preset.pattern
    pair, width = (ask.major, ask.minor), ask.width
    nothing = DRAWN_ONLY if ask.drawn_regions else NO_REACH
    reach, shown = (ask.keep or nothing, ask.rim or NO_REACH), _SHOWN.get(show, (1.0, 1.0))
    drawn = (shown[0] * ("major" in ask.family_names), shown[1] * ("minor" in ask.family_names))
    if made.even:
        return Settings(half_width=(BY_VERTEX, BY_VERTEX), reach=reach, shown=drawn)
    by_vertex = width.solid_fraction > 0 or width.widths(1.0).vary
    phase = [made.phase[k] if family.phase == AUTO else family.shift for k, family in enumerate(pair)]
    return Settings(
        (pair[0].frequency or made.frequency[0], pair[1].frequency or made.frequency[1]),
        (phase[0] % 1, phase[1] % 1),
        (BY_VERTEX, BY_VERTEX) if by_vertex else (pair[0].stripes.half_width, pair[1].stripes.half_width),
        reach,
        drawn,
    )


_SHOWN = {"major": (1.0, 0.0), "minor": (0.0, 1.0)}
