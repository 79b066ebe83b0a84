"""Surfaces from formulas: simple shapes for tests, and figures like the models in Madan, Jacobson and Levin's paper.
`SHAPES` lists the shapes by name. All shapes are deterministic, in metres with z up and normals up or outward.
Triangles are about `edge` metres wide."""

from collections.abc import Callable

from dsfab.surface.mesh import Surface
from dsfab.surface.shapes.figures import (
    boys_surface,
    bridge,
    camel_head,
    climbing_hold,
    duck_ring,
    mouse,
    pirate,
    turkey,
    twisty_tower,
)
from dsfab.surface.shapes.roofs import barrel_vault, elliptic_paraboloid, hypar, pavilion, plate
from dsfab.surface.shapes.round_shapes import catenoid, cylinder, dome, sphere, torus, tower

FIGURES: dict[str, Callable[..., Surface]] = {
    shape.__name__: shape
    for shape in (*(camel_head, duck_ring, mouse, climbing_hold, turkey, pirate), *(bridge, twisty_tower, boys_surface))
}
"""Shapes like the models in Madan, Jacobson and Levin's paper. Each shape takes a second or more to mesh."""

SHAPES: dict[str, Callable[..., Surface]] = {
    **{
        shape.__name__: shape
        for shape in (
            *(plate, barrel_vault, hypar, elliptic_paraboloid, dome, pavilion, catenoid, cylinder, tower),
            *(sphere, torus),
        )
    },
    **FIGURES,
}
"""Shapes by their names in a preset: `shape = "dome"`."""

__all__ = [
    "FIGURES", "SHAPES", "barrel_vault", "boys_surface", "bridge", "camel_head", "catenoid", "climbing_hold",
    "cylinder", "dome", "duck_ring", "elliptic_paraboloid", "hypar", "mouse", "pavilion", "pirate", "plate", "sphere",
    "torus", "tower", "turkey", "twisty_tower",
]  # fmt: skip
