"""Strips and tubes under load, and their section forces."""

import numpy as np

from dsfab.statics import Material, SectionForces, section_forces
from dsfab.surface import Surface
from tests.shapes import grid, jittered, tube
from tests.statics.stresses import BEST, H, solved
from tests.statics.supports import hold


def forces_of(surface, fixed, elements=BEST, **how) -> SectionForces:
    _, stress = solved(surface, fixed, elements, **how)
    return section_forces(surface, how.get("thickness", H), stress)


def loaded_strip(nx, ny, force, elements=BEST, poisson=0.0, width=0.15):
    """A cantilever of length 1, clamped at x = 0, with a force per length (3,) at its tip, N/m."""
    s = jittered(grid(nx, ny, 1.0, width))
    root, tip = s.V[:, 0] < 1e-9, s.V[:, 0] > 1 - 1e-9
    edge = (tip[s.edges.ends].all(axis=1) & s.edges.boundary)[:, None] * np.asarray(force, dtype=float)
    clamped = root[s.edges.ends].all(axis=1)
    how = {"edge": edge, "clamped": clamped, "material": Material(210e9, poisson)}
    return s, forces_of(s, hold(s, (root, "xyz")), elements, **how)


def short_tube():
    """A tube of radius 1 m, .2 m long, held against moving as a whole alone; its unit normals, outwards."""
    s = tube(64, 3, 1.0, 0.2)
    fixed = hold(s, (np.abs(s.V[:, 1]) < 1e-9, "y"), (np.abs(s.V[:, 0]) < 1e-9, "x"), (s.V[:, 2] < 1e-9, "z"))
    out = s.centroids * (1, 1, 0)
    return s, fixed, out / np.linalg.norm(out, axis=1, keepdims=True)


def carried(s: Surface, found: SectionForces, axis: int, low: float, high: float) -> np.ndarray:
    """(3,) newtons that pass sections across `axis` between two coordinates, from the low side on to the high one.

    The mean over the sections: of their virtual displacement phi e, phi from 0 to 1 in the band, the work is
    integral of (n grad phi - (q . grad phi) normal) . e, and m_nt dphi/dt along free edges.
    """
    phi = np.clip((s.V[s.F][:, :, axis] - low) / (high - low), 0, 1)
    t = found.frame
    corners = np.einsum("mkx,max->mka", s.V[s.F], t)
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    slope = np.linalg.solve(
        np.stack([a, b], axis=1), np.stack([phi[:, 1] - phi[:, 0], phi[:, 2] - phi[:, 0]], 1)[..., None]
    )
    gx, gy = slope[..., 0].T
    n = np.stack([found.n[:, 0] * gx + found.n[:, 2] * gy, found.n[:, 2] * gx + found.n[:, 1] * gy], axis=1)
    inside = np.einsum("ma,max->mx", n, t)
    across = (found.q[:, 0] * gx + found.q[:, 1] * gy)[:, None] * s.normals
    return s.areas @ (inside - across) + at_edges(s, found, corners, phi) @ s.normals


def at_edges(s: Surface, found: SectionForces, corners: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """(m,) of the line force m_nt on the free edges of each face."""
    way = np.roll(corners, -1, axis=1) - corners
    way /= np.linalg.norm(way, axis=2, keepdims=True)
    m = (found.corner_moments + np.roll(found.corner_moments, -1, axis=1)) / 2
    x, y = np.moveaxis(way, 2, 0)  # along the edge; out of the face is (y, -x)
    twist = x * y * (m[..., 0] - m[..., 1]) + (y * y - x * x) * m[..., 2]
    free = s.edges.boundary[s.edges.of]
    return (free * twist * (np.roll(phi, -1, axis=1) - phi)).sum(axis=1)
