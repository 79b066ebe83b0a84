"""What steers evenly spaced stripes besides the stress: `[pattern] rotate` and `[[pattern.guide]]`.

A guide on one side of a symmetric design, or an angle beside a mirror, leaves less symmetry to the pattern than
surface, supports and loads have.
"""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.diffusion import Symmetry
from dsfab.errors import PatternError
from dsfab.pattern import Frames, Guidance, StressDirections
from dsfab.preset import Pattern
from dsfab.results import Steered
from dsfab.surface import Surface, generated_group
from dsfab.surface.cover import one_sided_pieces

SAME_SENSE = 0.9
"""A mirror or turn keeps the sense of turning on this share of the surface: on all of it, but for the mesh."""
OFF = 0.3
"""Guides may differ from their images by this share: a region is picked to one edge."""


@dataclass(frozen=True, eq=False)
class Steering:
    """The angle, radians, that stripes are turned by from the stress; what guides ask; the symmetry that is left."""

    turn: float
    guidance: tuple[Guidance, ...]
    symmetry: Symmetry | None
    told: str = ""

    def confidence(self, surface: Surface, stress: Floats) -> Floats:
        """(m,) how clear directions are, 0 to 1, of how clear the stress is."""
        return np.minimum(stress + self.guided(surface), 1.0) if self.guidance else stress

    def guided(self, surface: Surface) -> Floats:
        """(m,) what guides weigh."""
        return np.asarray(sum((guide.weight for guide in self.guidance), np.zeros(surface.n))[surface.F].mean(axis=1))

    def steered(self, surface: Surface, along: Floats, given: StressDirections, over: Bools) -> Steered:
        """What became of it: along (n, 3) are the directions of the major stripes; over (n,) see `crossed_over`."""
        one, two = ((np.einsum("mcx,mx->mc", along[surface.F], given.direction[:, k]) ** 2).sum(axis=1) for k in (0, 1))
        crossed = over[surface.F].mean(axis=1) > 0.5
        told = [self.told] * bool(self.told)
        if share := float(surface.areas @ crossed) / surface.area:
            told.append(
                f"the two stresses cross: on {share:.0%} of the surface members go on as the other family, so that "
                "none ends where they do"
            )
        along_one = one / np.maximum(one + two, np.finfo(float).tiny)
        return Steered(along_one, self.guided(surface), crossed, "; ".join(told))


def steering(ask: Pattern, frames: Frames, symmetry: Symmetry | None, spacing: float) -> Steering:
    """What steers the stripes of a pattern.

    symmetry : of surface, supports and loads.    spacing : metres, for guides without a reach.

    Raises PatternError for an angle on a surface with one side, and for a guide that acts nowhere.
    """
    oblique = ask.rotate % 90 != 0
    if oblique and one_sided_pieces(frames.surface.F, frames.surface.edges).any():
        raise PatternError(
            f"pattern.rotate = {ask.rotate:g}: nothing says which way to turn on a surface with one side only, like a "
            "Moebius strip; use 0 or 90"
        )
    guidance = Guidance.of(frames, ask.guide, spacing)
    kept, told = symmetry, ""
    if symmetry is not None and (oblique or guidance):
        every = np.ones(symmetry.order, dtype=bool)
        turned = _same_sense(frames.surface, symmetry) if oblique else every
        guided = _same_guides(frames, symmetry, guidance) if guidance else every
        kept, left = _subgroup(symmetry, turned & guided)
        who = [f"rotate = {ask.rotate:g}"] * (not turned.all()) + ["guides"] * (not guided.all())
        if who:
            told = (
                f"surface, supports and loads are the same at {symmetry.order} images, the pattern at {left} of them: "
                f"{' and '.join(who)} {'break' if who[-1] == 'guides' else 'breaks'} the rest"
            )
    return Steering(float(np.radians(ask.rotate)), guidance, kept, told)


def _same_sense(surface: Surface, symmetry: Symmetry) -> Bools:
    """(g,) whether what turns counter-clockwise on the surface does so in its image too."""
    normal = surface.normals
    same = [
        np.linalg.det(R) * np.einsum("mi,mi->m", normal @ R.T, normal[face]) > 0
        for R, face in zip(symmetry.R, symmetry.faces, strict=True)
    ]
    return np.array([surface.areas @ one > SAME_SENSE * surface.area for one in same])


def _same_guides(frames: Frames, symmetry: Symmetry, guidance: tuple[Guidance, ...]) -> Bools:
    """(g,) whether the image of each guide is a guide."""
    area, n = frames.surface.vertex_areas, frames.surface.n
    each = [guide.tensors(frames) for guide in guidance]
    every = np.asarray(sum(each))
    sizes = [np.linalg.norm(one, axis=(1, 2)) for one in each]
    same = np.ones(symmetry.order, dtype=bool)
    for k, (R, T) in enumerate(zip(symmetry.R, symmetry.maps, strict=True)):
        image = (T @ every.reshape(n, 9)).reshape(n, 3, 3)
        off = np.linalg.norm(image - R @ every @ R.T, axis=(1, 2))
        same[k] = all((area * (size > 0)) @ off < OFF * (area @ size) for size in sizes)
    return same


def _subgroup(symmetry: Symmetry, keep: Bools) -> tuple[Symmetry | None, int]:
    """What is left of a group, if that is a group and more than the identity; and its elements."""
    R, maps = symmetry.R[keep], tuple(T for T, kept in zip(symmetry.maps, keep, strict=True) if kept)
    if len(R) < 2 or len(generated_group(list(R))) != len(R):
        return None, 1
    return Symmetry(R, maps, symmetry.faces[keep]), len(R)
