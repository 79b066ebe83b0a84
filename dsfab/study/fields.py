"""The fields of a design on its uncut surface, named with their SI units: what to colour it by in ParaView."""

import numpy as np

from dsfab.arrays import Floats
from dsfab.design import Design
from dsfab.pattern.wave import wave
from dsfab.study.lines import stripe_phase


def design_fields(design: Design) -> dict[str, Floats]:
    """By name, values at the vertices (n, ...) or in the faces (m, ...).

    Vertices: displacement of every load case, forces, what is held, modes, and for each family the phase z (middles of
    members at its integers), the half-width d and the wave of z. Faces: stress in xyz, its principal values and the
    isotropic faces as the tensors of the diffusion see them (gamma times the stress).
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
    for k, name in enumerate(pattern.names):
        z = stripe_phase(design, k)
        if z is None:
            fields[f"{name} distance [m]"] = -np.asarray(pattern.fields[k])
        else:
            fields |= {f"{name} phase [1]": z, f"{name} wave [1]": wave(z)}
            fields[f"{name} half-width [1]"] = np.asarray(pattern.half_widths[k])
    return fields
