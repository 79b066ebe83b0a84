"""Lines and fields of a design for drawings and ParaView, with SI units."""

from dataclasses import replace

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.design.design import Design
from dsfab.pattern import distance_to_boundary, distance_to_vertices
from dsfab.pattern.stripes import wave
from dsfab.results import EvenStripes
from dsfab.slicing.cutting.sheet import ON_SIMPLEX
from dsfab.slicing.measures.lines import STRIPES, CornerLines, Phase, centre_lines, chart_lines, edge_lines
from dsfab.surface import StructureLine, simplified_line
from dsfab.surface.fields import CornerField


def design_lines(design: Design, tolerance: float = 0.0) -> tuple[StructureLine, ...]:
    """Return the edges of the sheet by family, then the centre lines of its members, in metres on the middle surface.
    tolerance : largest distance (m) from omitted points to the simplified lines; lengths are those of the full lines.
    A family without stripes, or with stripes that touch everywhere, has no centre lines."""
    pattern, sheet, surface = design.pattern, design.sheet, design.surface
    phases = [stripe_phase(design, k) for k in range(len(pattern.names))]
    lines = edge_lines(sheet, surface, pattern.names, phases)
    half_widths = dict(zip(pattern.names, pattern.half_widths, strict=True))
    for k, name in enumerate(pattern.names):
        z, d = phases[k], half_widths[name]
        if z is None or pattern.names.index(name) < k or not ((d > 0).any() and (d < 0.5).any()):
            continue  # stripes touch if their half-widths are half a period
        if isinstance(z, CornerLines):
            assert pattern.even is not None
            lines += chart_lines(sheet, surface, pattern.names, name, pattern.even.chart, d)
        else:
            lines += centre_lines(sheet, name, z, d)
    return tuple(replace(line, points=simplified_line(line.points, tolerance)) for line in lines)


def stripe_phase(design: Design, k: int) -> Phase:
    """Return the phase of field k, which is an integer on centre lines; None for a field without stripes.
    The phase is given at the vertices (n,), or at the corners of faces if vertices have several values."""
    pattern = design.pattern
    field = pattern.fields[k]
    if pattern.names[k] not in STRIPES:
        return None
    if isinstance(field, CornerField):
        return CornerLines(field, pattern.levels[k])
    assert isinstance(field, np.ndarray)
    if field.ndim == 2:
        return np.asarray(field.mean(axis=1))
    which = STRIPES.index(pattern.names[k])
    return np.asarray(pattern.frequency[which] * field + pattern.phase[which])


def design_fields(design: Design) -> dict[str, Floats]:
    """Return fields by name, at the vertices (n, ...) or in the faces (m, ...).

    Vertices: displacement of every load case, forces, supports and modes; for each family the phase z (an integer on
    centre lines), the half-width d and the wave of z. Faces: stress in xyz, principal values of the diffusion tensors
    times gamma, and the isotropic faces.

    Evenly spaced stripes have no phase at vertices, but the distance from the nearest centre line and the density of
    lines; d and the wave refer to these lines."""
    statics, tensors = design.statics, design.diffusion.tensors
    fields = {
        "force [N]": design.load.force,
        "held [1]": design.load.fixed.astype(np.float64),
        "loaded [1]": design.load.loaded.astype(np.float64),
    }
    cases = statics.cases if len(statics.cases) > 1 else {"": statics}
    for name, case in cases.items():
        tail = f" {name}" if name else ""
        fields[f"displacement{tail} [m]"] = case.equilibrium.u
        fields[f"stress{tail} [Pa]"] = case.sigma
    fields["principal stress x gamma [Pa]"] = tensors.principal
    fields["isotropic [1]"] = tensors.isotropic.astype(np.float64)
    for family, modes in (("major", design.diffusion.major), ("minor", design.diffusion.minor)):
        fields |= {f"{family} mode {k} [1]": modes.mode(k) for k in range(1, len(modes.lam) + 1)}
    pattern = design.pattern
    for name, away in _distances(design).items():
        fields[f"{name} distance [m]"] = away
    for k, name in enumerate(pattern.names):
        z = stripe_phase(design, k)
        if z is None:
            continue
        if isinstance(z, CornerLines):
            assert pattern.even is not None
            fields |= _even_fields(pattern.even, STRIPES.index(name))
        else:
            fields |= {f"{name} phase [1]": z, f"{name} wave [1]": wave(z)}
        fields[f"{name} half-width [1]"] = np.asarray(pattern.half_widths[k])
    return fields


def _distances(design: Design) -> dict[str, Floats]:
    """Return the distance (n,), m, of each vertex from supports and loads ("keep") and from the boundary ("rim")."""
    options, surface = design.preset.pattern, design.surface
    distances = {}
    if options.keep and "keep" in design.pattern.names:
        distances["keep"] = distance_to_vertices(surface, design.load.supported | design.load.loaded, options.keep)
    if options.rim and "rim" in design.pattern.names:
        distances["rim"] = distance_to_boundary(surface, options.rim)
    return {name: np.where(np.isfinite(away), away, surface.size) for name, away in distances.items()}


def _even_fields(even: EvenStripes, family: int) -> dict[str, Floats]:
    """Return fields at vertices; at a vertex with several phases, the nearest line counts."""
    name, chart, density = STRIPES[family], even.chart, even.density[:, family]
    weights = chart.weights.tocoo()
    row, vertex = (index.astype(np.int64) for index in weights.coords)
    on_vertex = (weights.data >= ON_SIMPLEX) & (chart.scale[row, family] > 0)
    z = chart.z[row[on_vertex], family]
    distance = np.full(len(density), 0.5)  # for vertices without a line
    np.minimum.at(distance, vertex[on_vertex], np.abs(z - np.rint(z)))
    return {
        f"{name} middle [m]": distance / density,
        f"{name} density [1/m]": np.asarray(density),
        f"{name} wave [1]": wave(distance),
    }
