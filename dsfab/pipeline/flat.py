"""Slabs: a flat sheet that is loaded across its plane has stress in its sides only, and these its members follow."""

from collections.abc import Sequence

import numpy as np

from dsfab.arrays import Floats
from dsfab.pipeline.loadings import Loading
from dsfab.preset import Statics
from dsfab.statics import Answers, sheet_stress, solve_for
from dsfab.surface import Surface

UNSTRESSED = 1e-3
"""A middle surface with less than this share of the stress of the sides leaves nothing to follow."""


def only_bends(surface: Surface, answers: Sequence[Answers]) -> bool:
    """Whether the surface is flat and its middle next to free of stress under all loadings."""
    if not surface.is_flat:
        return False
    middle, sides = (max(float(np.abs(x).max()) for x in part) for part in _parts(answers))
    return middle < UNSTRESSED * sides


def _parts(answers: Sequence[Answers]) -> tuple[list[Floats], list[Floats]]:
    stresses = [each.stress for each in answers]
    return [stress.membrane for stress in stresses], [stress.bending for stress in stresses]


def bending_stress(
    statics: Statics, surface: Surface, acting: Sequence[Loading], answers: Sequence[Answers]
) -> list[Floats]:
    """(m, 3, 3) Pa under each loading, at the side that normals point away from: where a slab's weight pulls it.

    Hinges scatter too much for directions: a sheet that was answered by them is solved again.
    """
    if answers[0].elements.bending != "hinge":
        return [each.stress.tensor("bottom") for each in answers]
    model = statics.sheet().on(surface)
    solved = solve_for(model, {str(k): loading.load for k, loading in enumerate(acting)}, "stress")
    return [sheet_stress(model, one.elements, one).tensor("bottom") for one in solved.values()]
