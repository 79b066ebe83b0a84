"""SIMP of half a sphere that is begun at ribs.

Begun even, or at random, it stays grey or falls apart, with filters of .3 to 1 m, a penalisation of 3 or 5, and grey
suppressed [Groenwold, Etman 2009]. Here there are three fields [Wang, Lazarov, Sigmund 2011]: densities x, their
filtered field, and that pushed towards 0 and 1 more and more strongly around a value that keeps the area. It begins at
meridians and rings. Snow on a void is carried to what is near, denser faces first; what acts on the crown stays there.

At 50 % it has 1.58 times the compliance of the uncut sheet, where the design by `auto` has 1.39, and the least 1.17. At
30 %, on triangles of .11 m, it is 5.6 times as soft at the best, begun at a design; that by `auto` is 2.43 times as
soft, and the least 1.54.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Floats
from dsfab.pattern import vertex_means
from dsfab.statics import FaceStiffness, optimality_step
from dsfab.study.baselines import ComparisonTask, Structure
from dsfab.study.baselines.topology_optimisation import face_filter, level_set_structure
from dsfab.surface import Surface

EDGE, RADIUS = 0.15, 0.3
"""Metres: of triangles, and of the filter."""
MERIDIANS, RINGS = 16, 5
"""Where it begins; from 12 x 4, 12 x 5 and 20 x 5 it ends 5, 9 and 20 % softer."""
SHARPER, STEPS = (4.0, 8.0, 16.0, 32.0), 10
"""How strongly densities are pushed apart, and steps with each."""
POWER, VOID, MOVE, LEAST = 3, 1e-4, 0.15, 1e-6
NEAR, FALL = 0.8, 1 / 3
"""Metres that snow is carried at most; it falls off like a bell whose width is this share of it."""
HIGH = 0.98
"""Share of the height above which loads stay."""


@dataclass(frozen=True, eq=False)
class Carrying:
    """Moves the forces at vertices towards denser ones. near : (n, n) how much each takes of another one."""

    surface: Surface
    near: csr_array
    stay: Floats

    @classmethod
    def over(cls, surface: Surface) -> "Carrying":
        """Of a dome whose crown is its highest place."""
        i, j = cKDTree(surface.V).query_pairs(NEAR, output_type="ndarray").T
        bell = np.exp(-((np.linalg.norm(surface.V[i] - surface.V[j], axis=1) / (FALL * NEAR)) ** 2))
        own = np.arange(surface.n)
        rows, columns = np.concatenate([i, j, own]), np.concatenate([j, i, own])
        values = np.concatenate([bell, bell, np.ones(surface.n)])
        z = surface.V[:, 2]
        high = z > z.min() + HIGH * np.ptp(z)
        return cls(surface, csr_array((values, (rows, columns)), shape=(surface.n,) * 2), high[:, None].astype(float))

    def __call__(self, density: Floats, force: Floats) -> Floats:
        """(n, 3) forces at vertices, where faces have these densities."""
        dense = np.maximum(vertex_means(self.surface, density), LEAST) ** POWER
        total = self.near.T @ dense
        return np.asarray(dense[:, None] * (self.near @ ((1 - self.stay) * force / total[:, None])) + self.stay * force)


def ribs(surface: Surface, area: float) -> Floats:
    """(m,) densities to begin with: meridians and rings as wide as the area allows."""
    x, y, z = surface.centroids.T
    radius = np.hypot(x, y)
    turn, rise = np.arctan2(y, x) / (2 * np.pi), np.arctan2(z, radius) / (np.pi / 2)
    off = [np.abs((at * k + 0.5) % 1 - 0.5) / k for at, k in ((turn, MERIDIANS), (rise, RINGS))]
    away = np.minimum(2 * np.pi * radius * off[0], np.pi / 2 * np.hypot(radius, z).mean() * off[1])
    order = np.argsort(away)
    last = away[order][np.searchsorted(np.cumsum(surface.areas[order]), area)]
    return np.where(away <= last, 0.95, 0.1)


def projected(filtered: Floats, sharp: float, middle: float) -> tuple[Floats, Floats]:
    """(m,) a field pushed towards 0 and 1, and the slope of that [Wang, Lazarov, Sigmund 2011, eq. 9]."""
    scale = np.tanh(sharp * middle) + np.tanh(sharp * (1 - middle))
    wave = np.tanh(sharp * (filtered - middle))
    return (np.tanh(sharp * middle) + wave) / scale, sharp * (1 - wave**2) / scale


def middle_of(filtered: Floats, areas: Floats, area: float, sharp: float) -> float:
    """Around which value to push, so that the area stays."""
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if areas @ projected(filtered, sharp, middle)[0] > area else (low, middle)
    return middle


def projected_simp(task: ComparisonTask) -> Structure:
    """What is cut of the filtered field, with the area of a task, whose preset follows one load."""
    task = replace(task, preset=task.preset.with_pattern(keep=RADIUS, rim=0.0))
    surface, (load,) = task.surface, task.loads.values()
    K = FaceStiffness.from_sheet(task.preset.statics.sheet().model_for(surface), [load])
    H, carried, solid = face_filter(surface, RADIUS), Carrying.over(surface), task.kept_faces
    moving = ~load.fixed.ravel()
    x = np.where(solid, 1.0, ribs(surface, task.area))
    force, factor = np.zeros_like(K.force), None
    for sharp in SHARPER:
        for _ in range(STEPS):
            filtered = np.where(solid, 1.0, H @ x)
            density, slope = projected(filtered, sharp, middle_of(filtered, surface.areas, task.area, sharp))
            force[: moving.sum(), 0] = carried(density, load.force).ravel()[moving]
            factor = K.factor(VOID + (1 - VOID) * density**POWER, factor)
            energy = K.energies(factor(force))[:, 0]
            gain = np.where(solid, 0.0, (1 - VOID) * POWER * density ** (POWER - 1) * energy * slope)
            x = optimality_step(x, (H.T @ gain) / surface.areas, surface.areas, task.area, solid, MOVE)
    return level_set_structure(task, H @ x)
