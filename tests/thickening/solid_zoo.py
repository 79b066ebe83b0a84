"""Surfaces that are hard to thicken."""

from collections.abc import Callable

import numpy as np
import trimesh

import dsfab
from dsfab.core.errors import PatternError
from dsfab.core.toml_files import shipped_presets
from dsfab.slicing import cut, resolve_pinches
from dsfab.surface import Surface
from dsfab.thickening import Solid, offsets, thicken
from tests.shapes import ZOO, grid, jittered, lifted, moebius, projective_plane, sphere, torus


def crumpled() -> Surface:
    """A height field of random heights, smoothed a little."""
    z = np.random.default_rng(3).normal(size=(27, 27))
    z = 0.05 * (z[1:-1, 1:-1] + z[2:, 1:-1] + z[:-2, 1:-1] + z[1:-1, 2:] + z[1:-1, :-2])
    flat = grid(24, 24, 1.0, 1.0)
    return Surface(np.c_[flat.V[:, :2], z.ravel()], flat.F)


def creased_box() -> Surface:
    box = trimesh.creation.box().subdivide_to_size(0.2)
    return Surface(box.vertices, box.faces)


def tower() -> Surface:
    return dsfab.load_preset("tower", {"surface.edge": 0.9}).surface.build()


def boy_cut_open() -> Surface:
    return dsfab.load_preset("boys_surface", {"surface.edge": 0.244}).surface.build()


SHAPES: dict[str, Callable[[], Surface]] = {
    **{name: make for name, make in ZOO.items() if name not in ("tiny", "huge")},
    "moebius fine": lambda: moebius(120, 12, 0.8),
    "boy": lambda: projective_plane(4),
    "boy cut open": boy_cut_open,
    "torus": lambda: torus(48, 16, 1.0, 0.3),
    "tower": tower,
    "crumpled": crumpled,
    "creased box": creased_box,
}

SHAPE_OF = {name: dsfab.load_preset(name).surface.model_dump().get("shape") for name in sorted(shipped_presets())}

MESHES = [
    *("Botanic", "BubbleShell", "barrel_vault", "blub", "bob", "camelhead", "canopy_quad", "halftunnel", "hypar"),
    *("monkey_saddle_control", "roof_with_opening", "shell_tube", "spot", "torus"),
]

BASES = (
    lambda: jittered(grid(8, 6, 1.0, 1.0)),
    lambda: sphere(2),
    lambda: lifted(lambda x, y: (x - 0.5) * (y - 0.5) * 1.5, cells=7),
    lambda: moebius(24, 4, 0.8),
    lambda: lifted(lambda x, y: 4 * x * (1 - x) * y * (1 - y), cells=8),
)


def fuzzed(seed: int, bases: tuple[Callable[[], Surface], ...] = BASES, most: int = 6) -> Solid | None:
    """A coarse sheet cut by fields that hit levels exactly, nearly, or are noise; None where nothing is left.

    most : of the field's values before they are divided: how many lines cross a face.
    """
    random = np.random.default_rng(seed)
    surface = bases[seed % len(bases)]()
    t = surface.size / 2 * random.choice([0.01, 0.02, 0.04])
    denominator = random.choice([2, 4, 8])
    fields = [random.integers(-most, most + 1, surface.n) / denominator for _ in range(2)]
    if seed % 3 == 1:
        fields = [x + 1e-12 * random.normal(size=surface.n) for x in fields]
    if seed % 3 == 2:
        fields = [most / 1.5 * surface.V[:, i] + 0.3 * random.normal(size=surface.n) for i in range(2)]
    levels = [np.arange(-6.5, 7, 0.5) + random.choice([0, 0.25]) for _ in range(2)]
    try:
        cells = cut(surface, fields, levels, random.choice([0.05, 0.1]))
        sheet = resolve_pinches(cells, t / 2, "join" if seed % 2 else "split").sheet.subset()
    except PatternError:
        return None
    return thicken(sheet.surface, sheet.carry_corners(offsets(surface, t).at_corners(surface.F), surface.F))
