"""Which stress the pattern follows: the middle surface's, the lower side's of a slab, or that of all layers."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dsfab.arrays import Floats
from dsfab.diffusion import layer_stress, only_bends
from dsfab.pipeline.loadings import Loading
from dsfab.preset import Preset
from dsfab.statics import Answers, SheetStress, sheet_stress, solve_for
from dsfab.surface import Surface

BENDS = 0.5
"""`auto` follows all layers where bending stores at least this share of the strain energy."""


class FollowedStress(NamedTuple):
    """(m, 3, 3) Pa under each loading: sigma of the middle surface, or of a slab's lower side, and the layers' stress
    where that is followed in its place, else None; and what a person should know, or ''."""

    sigma: Sequence[Floats]
    layered: Sequence[Floats] | None = None
    told: str = ""


def followed_layers(
    preset: Preset, surface: Surface, acting: Sequence[Loading], answers: Sequence[Answers], sigma: Sequence[Floats]
) -> FollowedStress:
    """What [statics] stress asks for, of a sheet that was solved with bending.

    sigma : (m, 3, 3) Pa each, of its middle surface.

    Raises StaticsError where it must be solved again, by elements that are fit for moments, and cannot be.
    """
    ask = preset.statics.stress
    if is_slab(surface, answers):
        lower = [stress.tensor("bottom") for stress in _moments(preset, surface, acting, answers)]
        return FollowedStress(
            lower, None, "the sheet is flat and bends: the pattern follows the stress at its lower side"
        )
    share = bending_share(preset, surface, acting, answers)
    if ask == "layers" or (ask == "auto" and share >= BENDS):
        stresses = _moments(preset, surface, acting, answers)
        told = f"the pattern follows the stress of all layers of the sheet: bending stores {share:.0%} of its energy"
        return FollowedStress(
            sigma, [layer_stress(surface, one.tensor("middle"), _bent(one)) for one in stresses], told
        )
    if ask == "membrane" and share >= BENDS:
        told = (
            f"bending stores {share:.0%} of the sheet's energy, and the pattern follows its middle surface, which that "
            'does not stress; judge it beside statics.stress = "layers": either may be the stiffer'
        )
        return FollowedStress(sigma, None, told)
    return FollowedStress(sigma)


def bending_share(preset: Preset, surface: Surface, acting: Sequence[Loading], answers: Sequence[Answers]) -> float:
    """Share of the strain energy that bending stores, 0 to 1, under the loads that the pattern follows; 0 without any.

    As the sheet was solved: by `hinge` elements it is a rough figure (see `hinge_energy`).
    """
    weights = [preset.followed.get(loading.name, 0.0) for loading in acting]
    bent = sum(w * float(a.stress.bending_energy @ surface.areas) for w, a in zip(weights, answers, strict=True))
    whole = sum(w * float(a.stress.energy @ surface.areas) for w, a in zip(weights, answers, strict=True))
    return bent / whole if whole > 0 else 0.0


def is_slab(surface: Surface, answers: Sequence[Answers]) -> bool:
    """Whether the surface is flat and its middle next to free of stress under all loadings."""
    stresses = [each.stress for each in answers]
    return surface.is_flat and only_bends(
        np.stack([one.membrane for one in stresses]), np.stack([one.bending for one in stresses])
    )


def _moments(
    preset: Preset, surface: Surface, acting: Sequence[Loading], answers: Sequence[Answers]
) -> list[SheetStress]:
    """The stress under each loading. Hinges scatter too much for directions: a sheet that was answered by them is
    solved again."""
    if answers[0].elements.bending != "hinge":
        return [each.stress for each in answers]
    model = preset.statics.sheet().on(surface)
    solved = solve_for(model, {str(k): loading.load for k, loading in enumerate(acting)}, "stress")
    return [sheet_stress(model, one.elements, one) for one in solved.values()]


def _bent(stress: SheetStress) -> Floats:
    """(m, 3, 3) Pa, what bending adds at the bottom."""
    return stress.tensor("bottom") - stress.tensor("middle")
