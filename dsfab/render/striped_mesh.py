"""The mesh on which a pattern is drawn, with the settings of the shader."""

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
from dsfab.render.shader import BY_VERTEX, INFINITE_DISTANCE, NO_REACH, StripeSettings
from dsfab.results import EvenStripes, PatternResult
from dsfab.surface import DividedField, Surface

EXACT_REACH_SHARE = 1 / 8  # distances are exact up to this fraction of the surface's size, for any preset
REGION_FACTOR = 1e33  # huge factor on distances from drawn regions, so `keep` adds no material around regions


@dataclass(frozen=True, eq=False)
class StripedMesh:
    """Mesh on which stripes are drawn: n' vertices, m' faces.
    The mesh is the uncut surface (n vertices, m faces), cut open where phases of evenly spaced stripes do not match."""

    uncut: Surface
    even: EvenStripes | None

    @classmethod
    def from_design(cls, design: Design) -> Self:
        """Return the mesh of a design."""
        return cls(design.surface, design.pattern.even)

    @property
    def surface(self) -> Surface:
        """Surface (n', m') to draw."""
        return self.even.chart.surface if self.even else self.uncut

    def is_same_mesh(self, mesh: "StripedMesh") -> bool:
        """Return True if two meshes, and the stripe phases on these meshes, are equal."""
        if self.uncut is not mesh.uncut or (self.even is None) != (mesh.even is None):
            return False
        if self.even is None or mesh.even is None or self.even is mesh.even:
            return True
        a, b = self.even.chart, mesh.even.chart
        pairs = (a.z, b.z), (a.surface.F, b.surface.F), (a.surface.V, b.surface.V)
        return all(np.array_equal(x, y) for x, y in pairs)

    def carry(self, x: Floats) -> Floats:
        """Interpolate values (n, ...) at vertices of the uncut surface; return (n', ...) at vertices of this mesh."""
        return self.even.chart.carry(x) if self.even else x

    def on_faces(self, x: Bytes) -> Bytes:
        """Return colours (m', 3) on this mesh, from colours (m, 3) on the uncut surface."""
        return x[self.even.chart.parent] if self.even else x

    def at_corners(self, x: Floats32) -> Floats32:
        """Return corner normals (m', 3, 3) on this mesh, from (m, 3, 3) on the uncut surface."""
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
        """Unit normals (n', 3) of `surface`."""
        return self.uncut.vertex_normals if self.even is None else unit_vectors(self.carry(self.uncut.vertex_normals))

    def phases(self, design: Design) -> Floats:
        """Return the phases (n', 2) of the two families of stripes, or the eigenmodes for stripes on eigenmodes."""
        if self.even:
            return self.even.chart.z
        mode, modes = design.pattern.mode, design.diffusion
        return np.stack([modes.major.mode(mode[0]), modes.minor.mode(mode[1])], axis=1)

    @cached_property
    def shares(self) -> Floats:
        """Factors (n', 2) that convert half-widths to units of phase; 0 where there is no phase."""
        if self.even is None:
            return np.ones((self.uncut.n, 2))
        return self.carry(self.even.slope / self.even.density) * self.even.chart.scale

    def half_widths(self, pattern: PatternResult) -> Floats:
        """Return half-widths (n', 2) of the two families, in units of phase."""
        local = [pattern.half_width(name) for name in FAMILIES]
        if self.even is None:
            return np.stack(local, axis=1)
        even, finest = self.even, list[Floats]()
        for k, d in enumerate(local):
            finest.append(finest_half_widths(d, even.slope[:, k], even.density[:, k], len(even.wanted[k])))
        return self.carry(np.stack(finest, axis=1)) * even.chart.scale


@derived
def distances(design: Design) -> tuple[Floats, Floats]:
    """Return distances (n,) to loads and supports, and distances (n,) to the boundary, m. If the preset has
    solid regions or bands, the first array has scaled distances to these regions and bands."""
    surface, load, pattern = design.surface, design.load, design.preset.pattern
    reach = max(EXACT_REACH_SHARE * surface.size, pattern.keep, pattern.rim)
    to_held = distance_to_vertices(surface, load.supported | load.loaded, reach)
    if pattern.drawn_regions:
        to_held = REGION_FACTOR * _distances_outside(design, to_held)
    return to_held, distance_to_boundary(surface, reach)


def _distances_outside(design: Design, to_held: Floats) -> Floats:
    """Return rough distances (n,), m, to kept regions; negative inside. to_held : (n,) to loads and supports, m."""
    surface, pattern = design.surface, design.preset.pattern
    outside = np.where(np.isfinite(to_held) & (pattern.keep > 0), to_held - pattern.keep, surface.size)
    for field in design.pattern.fields[: pattern.drawn_regions]:
        x = field.at_vertices if isinstance(field, DividedField) else field
        assert isinstance(x, np.ndarray)
        if x.ndim == 1:
            # vertices on a solid region's outline (x = 0) get a small positive distance, as outside
            region = np.where(x > 0, -surface.mean_edge, 1e-3 * surface.mean_edge)
            outside = np.where(x >= 0, np.minimum(outside, region), outside)
        else:
            outside = np.where(x[:, 0] >= 0, np.minimum(outside, x[:, 1]), outside)
    return outside


def vertex_fields(design: Design, mesh: StripedMesh, distances: tuple[Floats, Floats]) -> Floats:
    """Return the columns (n', 6) of `StripeShader.fields`."""
    reaches = mesh.carry(finite_distances(distances))
    return np.concatenate([mesh.phases(design), mesh.half_widths(design.pattern), reaches], axis=1)


def finite_distances(distances: tuple[Floats, Floats], limit: float = INFINITE_DISTANCE) -> Floats:
    """Return distances (n, 2), with `limit` in place of infinity."""
    return np.where(np.isfinite(distances), distances, limit).T


def needs_only_settings(drawn_preset: Preset, preset: Preset) -> bool:
    """Return True if two presets differ only in numbers of the shader's settings."""
    old_pattern, new_pattern = drawn_preset.pattern, preset.pattern
    first_section = preset.first_difference(drawn_preset)
    if first_section is None or STAGES.index(first_section) > STAGES.index("pattern"):
        return True
    if (
        first_section != "pattern"
        or old_pattern.region != new_pattern.region
        or old_pattern.width != new_pattern.width
        or new_pattern.width.solid_fraction
        or old_pattern.method != new_pattern.method
    ):
        return False
    if new_pattern.drawn_regions and new_pattern.keep != old_pattern.keep:
        return False
    if new_pattern.method != "modes":
        return new_pattern.method == "stripes" and _without_reaches(old_pattern) == _without_reaches(new_pattern)
    if new_pattern.width.widths(1.0).vary or new_pattern.auto:  # widths may depend on any setting
        return False
    if new_pattern.major.spacing or new_pattern.minor.spacing:  # new frequencies must be computed from the spacing
        return False
    return (old_pattern.major.mode, old_pattern.minor.mode) == (new_pattern.major.mode, new_pattern.minor.mode)


def _without_reaches(pattern: Pattern) -> dict[str, object]:
    return pattern.model_dump(exclude={"keep", "rim", "fillet", "tidy"})


def shader_settings(preset: Preset, result: PatternResult, show: str) -> StripeSettings:
    """Return the shader settings of a preset."""
    pattern = preset.pattern
    pair, width = (pattern.major, pattern.minor), pattern.width
    nothing = 0.0 if pattern.drawn_regions else NO_REACH  # `NO_REACH` would make the shader ignore drawn regions
    reach, shown = (pattern.keep or nothing, pattern.rim or NO_REACH), _SHOWN_FAMILIES.get(show, (1.0, 1.0))
    shown_families = (shown[0] * ("major" in pattern.family_names), shown[1] * ("minor" in pattern.family_names))
    if result.even:
        return StripeSettings(half_width=(BY_VERTEX, BY_VERTEX), reach=reach, shown=shown_families)
    by_vertex = width.solid_fraction > 0 or width.widths(1.0).vary
    phase = [result.phase[k] if family.phase == AUTO else family.shift for k, family in enumerate(pair)]
    return StripeSettings(
        (pair[0].frequency or result.frequency[0], pair[1].frequency or result.frequency[1]),
        (phase[0] % 1, phase[1] % 1),
        (BY_VERTEX, BY_VERTEX) if by_vertex else (pair[0].stripes.half_width, pair[1].stripes.half_width),
        reach,
        shown_families,
    )


_SHOWN_FAMILIES = {"major": (1.0, 0.0), "minor": (0.0, 1.0)}
