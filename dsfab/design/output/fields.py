"""Lines and fields of a design for drawings and ParaView, with their SI units."""

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

FULL = 0.5
"""Half-width in periods at which the stripes of a family touch everywhere: one sheet, without members."""


def design_lines(design: Design, tolerance: float = 0.0) -> tuple[StructureLine, ...]:
    """Edges of the kept sheet by family, then the middles of its members; metres, on the middle surface.

    tolerance : metres that points left out may be off the polylines; lengths are those of all points.
    A family whose stripes are nowhere, or touch everywhere, has no middles.
    """
    pattern, sheet, surface = design.pattern, design.sheet, design.surface
    phases = [stripe_phase(design, k) for k in range(len(pattern.names))]
    lines = edge_lines(sheet, surface, pattern.names, phases)
    half_widths = dict(zip(pattern.names, pattern.half_widths, strict=True))  # alike where a family has several
    for k, name in enumerate(pattern.names):
        z, d = phases[k], half_widths[name]
        if z is None or pattern.names.index(name) < k or not ((d > 0).any() and (d < FULL).any()):
            continue
        if isinstance(z, CornerLines):
            assert pattern.even is not None
            lines += chart_lines(sheet, surface, pattern.names, name, pattern.even.chart, d)
        else:
            lines += centre_lines(sheet, name, z, d)
    return tuple(replace(line, points=simplified_line(line.points, tolerance)) for line in lines)


def stripe_phase(design: Design, k: int) -> Phase:
    """Whose integers are the middles of the stripes of field k: z (n,), or that at corners where no value at a vertex
    serves; None for a field that draws none."""
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
    """By name, values at the vertices (n, ...) or in the faces (m, ...).

    Vertices: displacement of every load case, forces, what is held, modes, and for each family the phase z (middles of
    members at its integers), the half-width d and the wave of z. Faces: stress in xyz, its principal values and the
    isotropic faces as the tensors of the diffusion see them (gamma times the stress).

    The phase of evenly spaced stripes is no field of the vertices: instead of it there are the distance from the
    nearest middle and the density of the lines that are drawn; d and the wave count in these lines as well.
    """
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
    """(n,) metres from what regions are kept around, by their names; beyond their reach too large, but finite."""
    ask, surface = design.preset.pattern, design.surface
    found = {}
    if ask.keep and "keep" in design.pattern.names:
        found["keep"] = distance_to_vertices(surface, design.load.held | design.load.loaded, ask.keep)
    if ask.rim and "rim" in design.pattern.names:
        found["rim"] = distance_to_boundary(surface, ask.rim)
    return {name: np.where(np.isfinite(away), away, surface.size) for name, away in found.items()}


def _even_fields(even: EvenStripes, family: int) -> dict[str, Floats]:
    """What has one value at each vertex: of lines that one of the openings there draws, the nearest counts."""
    name, chart, density = STRIPES[family], even.chart, even.density[:, family]
    weights = chart.weights.tocoo()
    row, vertex = (index.astype(np.int64) for index in weights.coords)
    here = (weights.data >= ON_SIMPLEX) & (chart.scale[row, family] > 0)
    z = chart.z[row[here], family]
    off = np.full(len(density), 0.5)  # where the lines have no phase: as between two
    np.minimum.at(off, vertex[here], np.abs(z - np.rint(z)))
    return {
        f"{name} middle [m]": off / density,
        f"{name} density [1/m]": np.asarray(density),
        f"{name} wave [1]": wave(off),
    }
