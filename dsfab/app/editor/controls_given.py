"""The controls of what needs the surface, the statics or the diffusion made again, and of what a workshop can make."""

from dataclasses import replace
from typing import get_args

from dsfab.app.editor.control import Control, one_digit
from dsfab.diffusion import Labelling
from dsfab.materials import MATERIALS
from dsfab.surface import Surface


def given(surface: Surface) -> list[Control]:
    """All of them; lengths go by the size of the surface."""
    return [*_directions(), *_sheet(surface), *_mesh(surface), *_workshop(surface)]


def _directions() -> list[Control]:
    flow = "directions"
    return [
        Control(flow, "diffusion.r", "follow stress", low=1, high=1e4, log=True, live=False, hint="r: 1 ignores it."),
        Control(flow, "diffusion.gamma", "load factor", low=0.01, high=100, log=True, live=False, hint=_GAMMA),
        Control(flow, "diffusion.labelling", "major follows", "choice", choices=get_args(Labelling), live=False),
        Control(flow, "diffusion.modes", "modes", "whole", low=1, high=20, step=1, live=False, hint="How many."),
        Control(flow, "diffusion.symmetry", "symmetry", "words", live=False, hint=_ALIKE, method="modes"),
    ]


_GAMMA = "gamma: multiplies the loads before faces are told isotropic or not."
_ALIKE = "Symmetry that the modes must have: x, y or z for a mirror, rot:6:z for sixths of a turn; several with commas."


def _sheet(surface: Surface) -> list[Control]:
    sheet, thin = "sheet and material", one_digit(surface.size / 3000)
    return [
        Control(sheet, "statics.thickness", "thickness", "length", "m", thin, 30 * thin, thin / 10, live=False),
        Control(sheet, "statics.material", "material", "material", choices=tuple(MATERIALS), live=False),
        Control(sheet, "statics.young", "stiffness", unit="Pa", low=1e8, high=1e12, log=True, live=False, hint=_YOUNG),
        Control(sheet, "statics.poisson", "Poisson's ratio", low=0, high=0.49, live=False),
        Control(sheet, "statics.density", "density", unit="kg/m3", low=0, high=9000, step=10, live=False),
        _limit(Control(sheet, "statics.strength", "strength", "number", "Pa", 1e6, 1e9, hint=_STRENGTH)),
    ]


_YOUNG = "Young's modulus."
_STRENGTH = "What the largest stress is compared with, in reports; off compares nothing."


def _mesh(surface: Surface) -> list[Control]:
    fine, coarse = one_digit(surface.size / 150), one_digit(surface.size / 5)
    return [
        _limit(Control("mesh", "surface.refine", "no edge over", "length", "m", fine, coarse, hint=_REFINE)),
        Control("mesh", "surface.smooth", "round facets", "switch", live=False, hint=_SMOOTH),
    ]


_REFINE = "Triangles are divided until no edge is longer; off leaves them as they are."
_SMOOTH = "Dividing also rounds the facets (Loop subdivision)."


def _workshop(surface: Surface) -> list[Control]:
    group, thin = "workshop", one_digit(surface.size / 3000)
    limits = {
        "min_member": ("min. member", "The narrowest member that can be made; narrower ones are told."),
        "min_gap": ("min. gap", "The narrowest opening that can be made; narrower ones are told."),
        "min_wall": ("min. wall", "The thinnest wall of the solid that can be made; thinner ones are told."),
    }
    return [
        *(
            _limit(Control(group, f"fabrication.{key}", label, "length", "m", thin, 100 * thin, hint=hint))
            for key, (label, hint) in limits.items()
        ),
        Control(group, "pattern.workshop", "no slits", "switch", live=False, hint=_NO_SLITS),
        Control(group, "fabrication.bed", "fits into", "size", "m", live=False, hint=_BED),
        Control(group, "fabrication.accept", "accept faults", "switch", live=False, hint=_ACCEPT),
    ]


_NO_SLITS = (
    "Closes openings and widens members that are narrower than a workshop makes, by the sheet's thickness. "
    "A dash: on for evenly spaced stripes, but where widths follow the stress."
)
_BED = "Metres along x, y and z that fit into the machine, 0.25 x 0.21 x 0.2 for instance; empty checks nothing."


_ACCEPT = "Also with loads that nothing carries, a sheet that was thinned to a film, or what is under 1 mm and fails."


def _limit(control: Control) -> Control:
    """One whose slider runs in decades, and which is off at 0."""
    return replace(control, log=True, live=False, word="off", worth=0.0)
