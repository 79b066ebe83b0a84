"""The fields of a design on its uncut surface, named with their SI units: what to colour it by in ParaView."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.delivery.lines import stripe_phase
from dsfab.pattern import distance_to_boundary, distance_to_vertices
from dsfab.pattern.wave import wave
from dsfab.pipeline.design import Design
from dsfab.results import EvenStripes
from dsfab.slicing.lines import STRIPES, CornerLines
from dsfab.slicing.sheet import ON_SIMPLEX


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
