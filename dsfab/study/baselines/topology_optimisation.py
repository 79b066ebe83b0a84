"""Topology optimisation by SIMP, and a structure that is cut along a level line of its densities."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from dsfab.core.arrays import Bools, Floats, lock
from dsfab.core.errors import PatternError, StaticsError
from dsfab.pattern import Layer, solved_factor, vertex_means
from dsfab.statics import FaceStiffness, SheetModel, optimality_step
from dsfab.study.baselines.structures import ComparisonTask, Structure, Variant, area_share, matched_structure
from dsfab.surface import LoadCase, Surface


def face_filter(surface: Surface, radius: float) -> csr_array:
    """Return the filter matrix (m, m), which averages over faces up to `radius` metres apart [Sigmund 2007]."""
    i, j = cKDTree(surface.centroids).query_pairs(radius, output_type="ndarray").T
    overlap = radius - np.linalg.norm(surface.centroids[i] - surface.centroids[j], axis=1)
    diagonal = np.arange(surface.m)
    row, column = np.concatenate([i, j, diagonal]), np.concatenate([j, i, diagonal])
    weight = np.concatenate([overlap, overlap, np.full(surface.m, radius)]) * surface.areas[column]
    total = np.bincount(row, weight, surface.m)
    return csr_array((weight / total[row], (row, column)), shape=(surface.m, surface.m))


def filtered_sensitivity(H: csr_array, density: Floats, sensitivity: Floats) -> Floats:
    """Return filtered sensitivities (m,) [Andreassen et al. 2011, eq. 11].
    H : (m, m) matrix of `face_filter`.    density : (m,) density of each face, 0 to 1.
    sensitivity : (m,) sensitivity of the compliance to each density, divided by the face's area [Sigmund 1997]."""
    return np.asarray(H @ (density * sensitivity) / np.maximum(density, 1e-3))


@dataclass(frozen=True)
class Simp:
    """Options of SIMP, a method of topology optimisation.
    radius       : radius of the filter, metres; 0: see `filter_radius`.
    iterations   : largest number of iterations for each penalisation.
    penalisation : final exponent p. Density x gives the stiffness void + x^p (1 - void) [Bendsoe, Sigmund 1999].
    steps        : number of steps in which p rises from 1 [Petersson and Sigmund 1998]; 0: p is constant.
    void         : stiffness of an empty face / of a full face.    move : largest change of a density in an iteration.
    change       : iterations end if all densities change by less than this value.
    Raises StaticsError for values out of range."""

    radius: float = 0.0
    iterations: int = 30
    penalisation: float = 3.0
    steps: int = 4
    void: float = 1e-9
    move: float = 0.2
    change: float = 0.01

    def __post_init__(self) -> None:
        is_valid = self.radius >= 0 and self.iterations >= 1 and self.penalisation >= 1 and self.change >= 0
        is_valid = is_valid and self.steps >= 0
        if not (is_valid and 0 < self.void < 1 and 0 < self.move <= 1):
            raise StaticsError(
                f"{self}: SIMP needs values of 0 or more for radius, steps and change, of 1 or more for iterations and "
                "penalisation, and values between 0 and 1 for void and move"
            )

    def filter_radius(self, surface: Surface) -> float:
        """Return the radius of the filter, metres. If `radius` is 0, the surface's size determines it."""
        return self.radius or max(0.03 * float(np.sqrt(surface.area)), 1.1 * surface.mean_edge)

    @property
    def penalisations(self) -> Floats:
        """Values (steps + 1,) of the penalisation exponent p, in the order of use."""
        return np.linspace(1.0 if self.steps else self.penalisation, self.penalisation, self.steps + 1)

    def stiffness(self, density: Floats) -> Floats:
        """Return the stiffness of each face (m,), divided by the stiffness of a full face."""
        return np.asarray(self.void + (1 - self.void) * density**self.penalisation)

    def slope(self, density: Floats) -> Floats:
        """Return the derivative (m,) of `stiffness` by the density of each face."""
        return np.asarray((1 - self.void) * self.penalisation * density ** (self.penalisation - 1))


@dataclass(frozen=True, eq=False)
class Densities:
    """Result of topology optimisation by SIMP.
    density : (m,) density of each face, 0 (void) to 1 (material).    seconds, cpu : wall and processor time (s).
    history : (iterations,) compliance (J) before each iteration."""

    density: Floats
    history: Floats
    seconds: float
    cpu: float

    def __post_init__(self) -> None:
        lock(self, "density", np.float64, (None,))
        lock(self, "history", np.float64, (None,))

    @property
    def compliance(self) -> float:
        """Compliance (J) before the last iteration."""
        return float(self.history[-1])

    def grey(self, surface: Surface) -> float:
        """Return the fraction of the surface's area with a density between 0.1 and 0.9."""
        return float(surface.areas @ ((self.density > 0.1) & (self.density < 0.9))) / surface.area


def densities(
    sheet: SheetModel,
    loads: Mapping[str, LoadCase],
    area: float,
    solid: Bools | None = None,
    weights: Mapping[str, float] | None = None,
    options: Simp | None = None,
) -> Densities:
    """Return the densities of faces, 0 to 1, that minimise the compliance [Andreassen et al. 2011].
    area    : required sum of density * face area, m2.
    solid   : (m,) mask of faces with density 1.    weights : weight of each load's compliance, 1 by default.
    Raises StaticsError without supports, or if `area` is below that of the solid faces or above that of the surface."""
    options, surface = options or Simp(), sheet.surface
    solid = np.zeros(surface.m, dtype=bool) if solid is None else solid
    share = _start_density(surface, area, solid)
    clock, cpu = time.perf_counter(), time.process_time()
    K = FaceStiffness.from_sheet(sheet, list(loads.values()))
    H = face_filter(surface, options.filter_radius(surface))
    case_weights = np.array([1.0 if weights is None else weights[name] for name in loads])
    x, factor, history = np.where(solid, 1.0, share), None, []
    for p in options.penalisations:
        step_options = replace(options, penalisation=float(p))
        for _ in range(options.iterations):
            factor = K.factor(step_options.stiffness(x), factor)
            energy = K.energies(factor(K.force)) @ case_weights
            history.append(float(step_options.stiffness(x) @ energy))
            gain = filtered_sensitivity(H, x, step_options.slope(x) * energy / surface.areas)
            updated = optimality_step(x, gain, surface.areas, area, solid, options.move)
            step, x = np.abs(updated - x).max(), updated
            if step < options.change:
                break
    return Densities(x, np.array(history), time.perf_counter() - clock, time.process_time() - cpu)


def _start_density(surface: Surface, area: float, solid: Bools) -> float:
    solid_area = float(surface.areas[solid].sum())
    if not solid_area < area < surface.area:
        raise StaticsError(
            f"SIMP cannot use {area:.4g} m2 of material: the surface has {surface.area:.4g} m2, and {solid_area:.4g} "
            f"m2 are kept regions; choose an area between these values, or set a smaller pattern.keep or pattern.rim"
        )
    return (area - solid_area) / (surface.area - solid_area)


def simp(task: ComparisonTask) -> list[Variant]:
    """Return a list with the structure whose material covers the faces with the largest densities of SIMP."""
    free = free_task(task)
    return [Variant("", lambda: _cut_structure(free, optimised_densities(free)))]


def free_task(task: ComparisonTask, options: Simp | None = None) -> ComparisonTask:
    """Return the task without a rim. The kept discs around loads and supports get the radius of the SIMP filter."""
    radius = (options or Simp()).filter_radius(task.surface)
    return replace(task, preset=task.preset.with_pattern(keep=radius, rim=0.0))


def optimised_densities(task: ComparisonTask, options: Simp | None = None) -> Densities:
    """Return the result of SIMP for a task. The loads include the self-weight."""
    statics, weights = task.preset.statics, task.preset.followed_weights
    sheet = statics.sheet().model_for(task.surface)
    loads = {name: load.of_thickness(task.surface, task.share) for name, load in task.loads.items()}
    return densities(sheet, loads, task.area, task.kept_faces, weights, options)


def level_set_structure(task: ComparisonTask, density: Floats) -> Structure:
    """Return the structure of material area `task.area` where the density is largest. density : (m,) for each face."""
    return matched_structure(task, partial(_level_set_layers, vertex_means(task.surface, density)))


def _cut_structure(task: ComparisonTask, result: Densities) -> Structure:
    try:
        return level_set_structure(task, result.density)
    except PatternError as error:
        raise PatternError(
            f"{error}; SIMP left {result.grey(task.surface):.0%} of the area at a density between void and material"
        ) from None


def _level_set_layers(field: Floats, task: ComparisonTask, share: float, tolerance: float) -> Sequence[Layer]:
    high, low = float(field.max()), float(field.min())
    margin = 1e-3 * (high - low)
    every = np.full(task.surface.n, np.inf)

    def layers(depth: float) -> list[Layer]:
        level = high + margin - depth * (high - low + 2 * margin)
        return [*task.kept_layers, Layer("simp", field, np.array([level]), every)]

    return layers(solved_factor(lambda depth: area_share(task, layers(depth)), share, tolerance))
