"""Loaded surfaces whose stripes are spaced evenly."""

from dataclasses import dataclass, field
from functools import cache, cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from dsfab import load_preset
from dsfab.design.even_stripes import even_stripes
from dsfab.design.stripe_pattern import pattern_step
from dsfab.preset.file import with_overrides
from dsfab.results import CaseResult, EvenStripes, Log, StaticsResult, StressedSurface
from dsfab.slicing import cut
from dsfab.statics import Material, SheetModel, solve_statics, stress
from dsfab.surface import LoadCase, Surface, read_surface
from tests.meshes import mesh_file
from tests.presets import DOME_MODES
from tests.shapes import grid, jittered, sphere

TURN = Rotation.from_euler("xyz", [31, -57, 123], degrees=True).as_matrix()


@dataclass(frozen=True, eq=False)
class Case:
    """A surface with a load, and stripes so far apart, metres; more keys of the preset."""

    surface: Surface
    load: LoadCase
    spacing: tuple[float, float]
    more: dict = field(default_factory=dict)

    @property
    def preset(self):
        asked = {
            "pattern.method": "stripes",
            "pattern.keep": 0.0,
            "pattern.width.rule": "plain",
            "pattern.width.solid_fraction": 0.0,
        }
        for name, spacing in zip(("major", "minor"), self.spacing, strict=True):
            asked |= {f"pattern.{name}.spacing": spacing, f"pattern.{name}.frequency": 0.0, f"pattern.{name}.mode": 1}
            asked |= {f"pattern.{name}.phase": 0.0, f"pattern.{name}.threshold": 0.5}
        return with_overrides(load_preset(DOME_MODES), asked | self.more)

    @cached_property
    def statics(self) -> StaticsResult:
        material = Material(210e9, 0.3)
        answer = solve_statics(SheetModel(self.surface, material, 0.01 * np.sqrt(self.surface.area)), self.load)
        sigma = stress(self.surface, material, answer.u)
        cases = {name: CaseResult(self.load, answer, sigma, None) for name in self.preset.followed_weights}
        return StaticsResult(self.load, answer, sigma, None, cases)

    @property
    def stressed(self) -> StressedSurface:
        return StressedSurface(self.surface, self.statics, None)  # no modes

    @cached_property
    def even(self) -> EvenStripes:
        return even_stripes(self.preset, self.surface, self.statics)

    @cached_property
    def sheet(self):
        pattern = pattern_step(
            self.preset, StressedSurface(self.surface, self.statics, None), Log(None), even=self.even
        )
        return cut(self.surface, pattern.fields, pattern.levels, 0)

    @cached_property
    def material(self) -> np.ndarray:
        """(m,) share of each face that is material."""
        sheet = self.sheet
        return np.bincount(sheet.parent, sheet.surface.areas * sheet.material, self.surface.m) / self.surface.areas


def supported(surface: Surface, held: np.ndarray) -> LoadCase:
    """Under its own weight."""
    force = np.outer(surface.vertex_areas, [0.0, 0.0, -1e4])
    return LoadCase(np.repeat(held[:, None], 3, axis=1), force, np.zeros(surface.n, bool))


def on_rim(surface: Surface) -> np.ndarray:
    held = np.zeros(surface.n, bool)
    held[surface.edges.ends[surface.edges.boundary]] = True
    return held


def loaded_dome() -> Case:
    """A cap on a plane rim of a square with rounded sides, irregular mesh, loads without symmetry."""
    flat = jittered(grid(20, 20, 2.0, 2.0), 0.2)
    x, y = flat.V[:, 0] - 1, flat.V[:, 1] - 1
    surface = Surface(np.c_[5 * x, 5 * y, 2.2 * (2 - x**2 - 0.8 * y**2 + 0.1 * x * y)], flat.F)
    load = supported(surface, on_rim(surface))
    near = np.linalg.norm(surface.V[:, :2] - [1.5, -1.0], axis=1) < 1.0
    return Case(surface, LoadCase(load.fixed, load.force * (1 + 2 * near[:, None]), load.loaded), (1.3, 0.9))


def loaded_hypar() -> Case:
    """Two diagonal mirrors, to the mesh."""
    flat = jittered(grid(20, 20, 2.0, 2.0), 0.2)
    x, y = flat.V[:, 0] - 1, flat.V[:, 1] - 1
    surface = Surface(np.c_[4 * x, 4 * y, 1.5 * (x**2 - y**2)], flat.F)
    return Case(surface, supported(surface, on_rim(surface)), (1.0, 0.8))


def loaded_globe() -> Case:
    """Round: standing on a cap, pressed by its weight."""
    surface = sphere(4)
    return Case(surface, supported(surface, surface.V[:, 2] < -0.9), (0.45, 0.3))


def loaded_canopy() -> Case:
    surface = read_surface(mesh_file("canopy_quad.obj"), "m")
    low = surface.V[:, 2] < surface.V[:, 2].min() + 0.05 * np.ptp(surface.V[:, 2])
    return Case(surface, supported(surface, low), (0.06 * surface.size, 0.05 * surface.size))


CASES = {"dome": loaded_dome, "hypar": loaded_hypar, "globe": loaded_globe, "canopy": loaded_canopy}


@cache
def case(name: str) -> Case:
    return CASES[name]()


def difference(one: Case, two: Case, faces: np.ndarray | None = None) -> float:
    """Share of the area by which the material differs, face by face."""
    there = two.material if faces is None else two.material[faces]
    return float(one.surface.areas @ np.abs(one.material - there) / one.surface.area)
