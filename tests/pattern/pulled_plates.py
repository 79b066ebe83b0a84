"""A plate that is pulled along x, and guides for its stripes."""

import numpy as np

from dsfab.results import CaseResult, StaticsResult
from dsfab.statics import Equilibrium
from dsfab.surface import LoadCase
from tests.pattern.loaded_cases import Case
from tests.shapes import grid, jittered


def pulled(**more) -> Case:
    """3 by 3 m, pulled along x by the same stress everywhere."""
    surface = jittered(grid(30, 30, 3.0, 3.0), 0.2)
    held = np.zeros((surface.n, 3), dtype=bool)
    load = LoadCase(held, np.zeros((surface.n, 3)), np.zeros(surface.n, dtype=bool))
    asked = {"pattern.symmetry": "none", **{f"pattern.{key}": value for key, value in more.items()}}
    given = Case(surface, load, (0.375, 0.375), asked)
    sigma = np.zeros((surface.m, 3, 3))
    sigma[:, 0, 0] = 2e6
    given.__dict__["statics"] = stressed(given, sigma)
    return given


def stressed(given: Case, sigma: np.ndarray) -> StaticsResult:
    """Under stresses (m, 3, 3) of which no place moves more than another."""
    nothing = np.zeros((given.surface.n, 3))
    answer = given.load, Equilibrium(nothing, nothing, 0.0, 0.0), sigma, None
    return StaticsResult(*answer, {name: CaseResult(*answer) for name in given.preset.followed_weights})


def towards(angle: float) -> list[float]:
    a = np.radians(angle)
    return [float(np.cos(a)), float(np.sin(a)), 0.0]
