"""Stripes of material on an eigenmode [Diffusion Structures, section 3.5]."""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import PatternError
from dsfab.surface.fields import hat_gradients
from dsfab.surface.mesh import Surface

GLSL = "float wave(float t) { return 4.0 * abs(fract(t) - 0.5) - 1.0; }"  # The function `wave` for shaders.


def wave(t: Floats) -> Floats:
    """Return the triangle wave p(t) = 4 |fract(t) - 1/2| - 1 of t (...)."""
    return np.asarray(4 * np.abs(t - np.floor(t) - 0.5) - 1)


def half_width(threshold: float) -> float:
    """Return the half width of stripes in periods, at which `wave` is `threshold`."""
    return (1 - threshold) / 4


@dataclass(frozen=True)
class Stripes:
    """Stripes of material where p(frequency x + phase) > threshold; p is the triangle wave, x an eigenmode.
    frequency : stripes per unit of the mode; positive.    phase : shift in periods.
    threshold : -1 (all is material) to 1 (all is void).    Raises PatternError for other values."""

    frequency: float
    phase: float = 0.0
    threshold: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.frequency) and self.frequency > 0):
            raise PatternError(f"frequency = {self.frequency} must be positive")
        if not np.isfinite(self.phase):
            raise PatternError(f"phase = {self.phase} must be a finite number")
        if not -1 <= self.threshold <= 1:
            raise PatternError(f"threshold = {self.threshold} must lie between -1 (all material) and 1 (none)")

    @property
    def half_width(self) -> float:
        """Half width in periods: 0 (no material) to 0.5 (all material)."""
        return half_width(self.threshold)

    def with_width_factor(self, factor: float) -> "Stripes":
        """Return stripes whose half width is `factor` times as large, up to 0.5."""
        if factor == 1:  # return the same numbers, without rounding errors
            return self
        return replace(self, threshold=1 - 4 * min(factor * self.half_width, 0.5))

    def phases(self, x: Floats) -> Floats:
        """Return the phases (...) of a mode x (...): whole numbers on centre lines."""
        return self.frequency * x + self.phase

    def band(self, x: Floats, d: Floats) -> Floats:
        """Return pairs (n, 2): z + d and z - d. Here, z is the phase of a mode x (n,), and d (n,) a half width."""
        z = self.phases(x)
        return np.stack([z + d, z - d], axis=1)

    def middles(self, x: Floats) -> Floats:
        """Return the phases (k,), whole numbers, of centre lines on a mode x (n,), and up to two more at each end."""
        z = self.phases(x)
        return np.arange(np.floor(z.min()) - 1, np.ceil(z.max()) + 2)

    def value(self, x: Floats) -> Floats:
        """Return values (...) for a mode x (...): positive in material, negative in openings."""
        return wave(self.frequency * x + self.phase) - self.threshold

    def levels(self, x: Floats) -> Floats:
        """Return the values (k,) of a mode x (n,) at the edges of stripes, ascending.
        Stripes lie between the first and second value, the third and fourth, and so on."""
        d = self.half_width
        if d == 0:
            return np.empty(0)
        if d >= 0.5:  # everything is material, so a single level lies below all values
            return np.array([x.min() - 1.0 / self.frequency])
        k = self.middles(x)
        return (np.stack([k - d, k + d], axis=1).ravel() - self.phase) / self.frequency


def frequency_for(surface: Surface, x: Floats, spacing: float) -> float:
    """Return the frequency at which stripes on a mode x (n,) have the mean distance `spacing` (metres).
    The formula is the co-area formula [Federer 1959]. Raises PatternError for a constant mode."""
    gradient = np.einsum("mcx,mc->mx", hat_gradients(surface), x[surface.F])
    lines = float(surface.areas @ np.linalg.norm(gradient, axis=1))  # length (m) of all centre lines at frequency 1
    if not lines * spacing > 0:
        raise PatternError(
            "spacing must be a positive length in metres, and the mode of the stripes must not be constant"
        )
    return surface.area / (spacing * lines)
