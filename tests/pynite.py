"""Frames solved by PyNite (MIT), which is not ours: beams of Euler and Bernoulli."""

from typing import NamedTuple

import numpy as np

from dsfab.frame import Frame

AXES = ("DX", "DY", "DZ", "RX", "RY", "RZ")
FORCES = ("FX", "FY", "FZ", "MX", "MY", "MZ")


class Found(NamedTuple):
    """u, reaction : (n, 6)."""

    u: np.ndarray
    reaction: np.ndarray


def solved(frame: Frame) -> dict[str, Found]:
    """Displacements and reactions of every case and combination."""
    from Pynite import FEModel3D

    model = FEModel3D()
    model.add_material("m", frame.material.young, frame.material.shear, frame.material.poisson, 0.0)
    for k, point in enumerate(frame.points.tolist()):
        model.add_node(f"{k}", *point)
        model.def_support(f"{k}", *(bool(held) for held in frame.fixed[k]))
    for k, (i, j) in enumerate(frame.ends.tolist()):
        J, about_y, about_z = frame.inertia[k].tolist()
        model.add_section(f"{k}", float(frame.area[k]), about_y, about_z, J)
        model.add_member(f"{k}", f"{i}", f"{j}", "m", f"{k}", rotation=rotation(frame.axes[k]))
    for case, rows in frame.loads.items():
        for k, axis in np.argwhere(rows):
            model.add_node_load(f"{k}", FORCES[axis], float(rows[k, axis]), case=case)
    sums = {case: {case: 1.0} for case in frame.loads} | dict(frame.combinations)
    for name, factors in sums.items():
        model.add_load_combo(name, dict(factors))
    model.analyze_linear()
    nodes = [model.nodes[f"{k}"] for k in range(len(frame.points))]
    return {
        name: Found(
            np.array([[getattr(node, axis)[name] for axis in AXES] for node in nodes]),
            np.array([[getattr(node, f"Rxn{force}")[name] for force in FORCES] for node in nodes]),
        )
        for name in sums
    }


def rotation(axes: np.ndarray) -> float:
    """Degrees that PyNite's own axes of a member (3, 3) are turned by about its x, to become these."""
    x = axes[0]
    if np.hypot(x[0], x[2]) < 1e-9:  # upright: its y points along -x or x
        y = np.array([-np.sign(x[1]), 0.0, 0.0])
        z = np.array([0.0, 0.0, 1.0])
    else:
        z = np.cross(x, [0.0, 1.0, 0.0])
        z /= np.linalg.norm(z)
        y = np.cross(z, x)
    return float(np.degrees(np.arctan2(axes[1] @ z, axes[1] @ y)))
