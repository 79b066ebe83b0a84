"""Controls of the editor's page, such as sliders."""

from dataclasses import asdict, dataclass, replace
from typing import Any, get_args

import numpy as np

from dsfab.core.materials import MATERIALS
from dsfab.diffusion import Labelling
from dsfab.pattern import Rule
from dsfab.preset.model import Family, Pattern, Preset
from dsfab.render.striped_mesh import EXACT_REACH_SHARE
from dsfab.surface import Surface


@dataclass(frozen=True)
class Control:
    """A control on the editor's page, for a key of a preset.
    kind  : number, whole, choice, switch, length (metres), words (a list), size (three lengths) or material.
    low, high, step : range and step of the slider.    live : True if the browser alone can draw a changed value.
    word  : word that the key accepts in place of a number, such as "auto".
    worth : number that has the same effect as `word`, or None.
    method  : pattern.method that has this control; '' if all methods have this control.
    instead : spacing (metres) that the page shows if the value is 0."""

    group: str
    key: str
    label: str
    kind: str = "number"
    unit: str = ""
    low: float = 0.0
    high: float = 1.0
    step: float = 0.01
    log: bool = False
    live: bool = True
    word: str = ""
    choices: tuple[str, ...] = ()
    hint: str = ""
    method: str = ""
    instead: float = 0.0
    worth: float | None = None


def rounded_to_one_digit(value: float) -> float:
    """Round a positive number to one significant digit."""
    digit = 10.0 ** np.floor(np.log10(value))
    return float(digit * max(round(value / digit), 1))


def surface_controls(surface: Surface) -> list[Control]:
    """Return the controls for the stripe directions, the sheet, the mesh and the workshop."""
    return [*_direction_controls(), *_sheet_controls(surface), *_mesh_controls(surface), *_workshop_controls(surface)]


def _direction_controls() -> list[Control]:
    flow = "directions"
    return [
        Control(
            flow, "diffusion.r", "follow stress", low=1, high=1e4, log=True, live=False, hint="r; 1 ignores stress."
        ),
        Control(flow, "diffusion.gamma", "load factor", low=0.01, high=100, log=True, live=False, hint=_GAMMA),
        Control(flow, "diffusion.labelling", "major follows", "choice", choices=get_args(Labelling), live=False),
        Control(flow, "diffusion.modes", "modes", "whole", low=1, high=20, step=1, live=False, hint="Number of modes."),
        Control(flow, "diffusion.symmetry", "symmetry", "words", live=False, hint=_MODE_SYMMETRY, method="modes"),
    ]


_GAMMA = (
    "gamma: factor on the loads. Faces with similar principal stresses count as isotropic; gamma decides how similar "
    "they must be."
)
_MODE_SYMMETRY = "Symmetries of the modes (comma list): x, y or z for a mirror, rot:6:z for rotations by 60° about z."


def _sheet_controls(surface: Surface) -> list[Control]:
    sheet, thin = "sheet and material", rounded_to_one_digit(surface.size / 3000)
    return [
        Control(sheet, "statics.thickness", "thickness", "length", "m", thin, 30 * thin, thin / 10, live=False),
        Control(sheet, "statics.material", "material", "material", choices=tuple(MATERIALS), live=False),
        Control(sheet, "statics.young", "stiffness", unit="Pa", low=1e8, high=1e12, log=True, live=False, hint=_YOUNG),
        Control(sheet, "statics.poisson", "Poisson's ratio", low=0, high=0.49, live=False),
        Control(sheet, "statics.density", "density", unit="kg/m3", low=0, high=9000, step=10, live=False),
        _limit_control(Control(sheet, "statics.strength", "strength", "number", "Pa", 1e6, 1e9, hint=_STRENGTH)),
    ]


_YOUNG = "Young's modulus."
_STRENGTH = "Reports compare the largest stress with this strength; off: no comparison."


def _mesh_controls(surface: Surface) -> list[Control]:
    fine, coarse = rounded_to_one_digit(surface.size / 150), rounded_to_one_digit(surface.size / 5)
    return [
        _limit_control(Control("mesh", "surface.refine", "no edge over", "length", "m", fine, coarse, hint=_REFINE)),
        Control("mesh", "surface.smooth", "round facets", "switch", live=False, hint=_SMOOTH),
    ]


_REFINE = "Triangles are divided until no edge is longer than this; off: no triangle is divided."
_SMOOTH = "When triangles are divided, vertices also move, so that the surface becomes smoother (Loop subdivision)."


def _workshop_controls(surface: Surface) -> list[Control]:
    group, thin = "workshop", rounded_to_one_digit(surface.size / 3000)
    limits = {
        "min_member": (
            "min. member",
            "Width of the narrowest member that the workshop can make; dsfab reports narrower members.",
        ),
        "min_gap": (
            "min. gap",
            "Width of the narrowest opening that the workshop can make; dsfab reports narrower openings.",
        ),
        "min_wall": (
            "min. wall",
            "The thinnest wall of the solid that the workshop can make; dsfab reports thinner walls.",
        ),
    }
    return [
        *(
            _limit_control(Control(group, f"fabrication.{key}", label, "length", "m", thin, 100 * thin, hint=hint))
            for key, (label, hint) in limits.items()
        ),
        Control(group, "pattern.workshop", "no slits", "switch", live=False, hint=_NO_SLITS),
        Control(group, "fabrication.bed", "fits into", "size", "m", live=False, hint=_BED),
        Control(group, "fabrication.accept", "accept faults", "switch", live=False, hint=_ACCEPT),
    ]


_NO_SLITS = (
    "Closes openings and widens members that are too narrow for a workshop; the limits depend on the thickness. "
    "A dash means the default: on for evenly spaced stripes, unless the width rule is 'stressed'."
)
_BED = (
    "Space in the fabrication machine along x, y and z in metres, for instance 0.25 x 0.21 x 0.2; empty: no size check."
)

_ACCEPT = (
    "Build even if a load has no support, the sheet is a thin film, or a member or opening is too narrow to fabricate."
)


def _limit_control(control: Control) -> Control:
    return replace(control, log=True, live=False, word="off", worth=0.0)


def controls(preset: Preset, surface: Surface) -> list[dict[str, Any]]:
    """Return all controls of the page as values for JSON."""
    reach = rounded_to_one_digit(EXACT_REACH_SHARE * surface.size)
    families = [control for name in ("major", "minor") for control in _family_controls(name, preset, surface, reach)]
    pattern_controls = [*_method_controls(), *families, *_width_controls(reach), *_kept_controls(reach)]
    return [asdict(control) for control in (*pattern_controls, *surface_controls(surface))]


def _method_controls() -> list[Control]:
    group, fields, even = "stripes", Pattern.model_fields, "stripes"
    choices = (get_args(fields[name].annotation) for name in ("method", "families", "symmetry", "forces"))
    methods, shown, symmetries, forces = choices
    return [
        Control(group, "pattern.method", "method", "choice", choices=methods, live=False, hint=_METHOD),
        Control(group, "pattern.families", "families", "choice", choices=shown, hint=_FAMILIES),
        Control(group, "pattern.halve", "halve", "switch", live=False, hint=_HALVE, method=even),
        *(
            replace(control, live=False, method=even)
            for control in (
                Control(group, "pattern.symmetry", "symmetry", "choice", choices=symmetries, hint=_STRIPE_SYMMETRY),
                Control(group, "pattern.forces", "forces", "choice", choices=forces, hint=_FORCES),
                Control(group, "pattern.weight_rounds", "rounds", "whole", high=2, step=1, hint=_ROUNDS),
                Control(group, "pattern.rotate", "turn", unit="°", low=-90, high=90, step=1, hint=_TURN),
                Control(group, "pattern.crowding", "crowding", "choice", choices=("note", "avoid"), hint=_CROWDING),
            )
        ),
    ]


_METHOD = "modes: stripes along level lines of eigenmodes; stripes: evenly spaced stripes along the stress."
_FAMILIES = (
    "Families of stripes to draw. Members of a single family never cross; only the rim and kept regions connect them."
)
_HALVE = "Where stripes crowd, every second stripe ends on a crossing member."
_STRIPE_SYMMETRY = "auto: stripes have all symmetries of surface, supports and loads; none: dsfab ignores symmetries."
_FORCES = (
    "Stripes follow forces in the uncut sheet, or in the stiffest sheet of varying thickness. For that sheet, set a "
    "solid fraction."
)
_ROUNDS = (
    "Number of times that the stripes are computed again with their own weight; 0: the stripes are computed with the "
    "weight of the uncut sheet."
)
_CROWDING = "avoid: if neighbouring openings would be filled, dsfab tries up to four other patterns."
_TURN = "Angle between stripes and stress in degrees, for both families; 90 exchanges the families."


def _family_controls(name: str, preset: Preset, surface: Surface, reach: float) -> list[Control]:
    key, group, mode_count = f"pattern.{name}.", f"{name} stripes", preset.diffusion.modes
    spacing = Control(group, key + "spacing", "spacing", "length", "m", high=2 * reach, step=reach / 100, hint=_SPACING)
    return [
        replace(
            Control(group, key + "mode", "mode", "whole", low=1, high=mode_count, step=1, hint=_MODE, method="modes"),
            word="auto",
        ),
        Control(group, key + "frequency", "frequency", low=0.5, high=40, step=0.1, hint=_FREQUENCY, method="modes"),
        replace(spacing, instead=Family().distance(surface.area, surface.mean_edge)),
        Control(group, key + "phase", "phase", unit="periods", word="auto", hint=_PHASE, method="modes"),
        Control(group, key + "threshold", "threshold", low=-1, step=0.01, hint="-1: solid surface; 1: no material."),
    ]


_MODE = (
    "Number of the mode, a field that stripes follow; mode 1 is the smoothest. auto selects the mode with the "
    "stiffest design."
)
_PHASE = "Moves the stripes sideways."
_FREQUENCY = (
    "Number of stripes between places where the values of the mode differ by 1; a larger number gives a finer pattern."
)
_SPACING = "Metres from one stripe to the next. For stripes from modes, 0 means that the frequency sets the spacing."


def _width_controls(reach: float) -> list[Control]:
    key, group, fine = "pattern.width.", "width of members", reach / 200
    missed = key + "solid_fraction_tolerance"
    return [
        Control(group, key + "rule", "rule", "choice", choices=get_args(Rule), hint=_RULE),
        Control(group, key + "solid_fraction", "solid fraction", high=0.95, step=0.005, hint=_FRACTION),
        Control(group, missed, "may miss it by", high=0.1, step=0.001, live=False, hint=_MISSED),
        Control(group, key + "member", "width", "length", "m", high=reach, step=fine, hint="Of members, if constant."),
        Control(
            group, key + "q", "grading", high=4, step=0.05, hint="Widths of members grow with this power of the stress."
        ),
        Control(group, key + "steps", "steps", "whole", low=1, high=50, step=1, live=False, hint=_STEPS),
        Control(
            group, key + "min_width", "min. width", "length", "m", high=reach, step=fine, word="auto", hint=_THINNEST
        ),
        Control(group, key + "max_width", "max. width", "length", "m", high=reach, step=fine, hint=_NONE),
        Control(group, key + "min_gap", "fill gaps under", "length", "m", high=reach, step=fine, hint=_NONE),
    ]


_RULE = (
    "plain: thresholds of the families set the widths; constant: one width in metres; graded: the width grows with the "
    "stress; stressed: the strain energy in the cut sheet sets the widths."
)
_STEPS = (
    "Steps of the width rule 'stressed'. In each step dsfab cuts and solves the sheet, and changes widths. The "
    "stiffest sheet is kept."
)
_FRACTION = "Share of the surface that is material: widths are computed from this share. 0 does not change the widths."
_MISSED = "Largest allowed error, if the solid fraction cannot be met exactly. A note states the actual share."
_NONE = "0 sets no limit."
_THINNEST = (
    "0 sets no limit. auto: for evenly spaced members of graded width, the limit is the thickness of the sheet. The "
    "limit is at most half of the width that members would have if all were equally wide."
)


def _kept_controls(reach: float) -> list[Control]:
    keep_hint = "The surface stays material up to this distance (m) from loads and supports."
    return [
        Control("kept", "pattern.keep", "near loads", "length", "m", high=reach, step=reach / 200, hint=keep_hint),
        Control("kept", "pattern.rim", "rim", "length", "m", high=reach, step=reach / 200, hint="Along the boundary."),
        Control(
            "kept", "pattern.fillet", "round corners", "length", "m", high=reach / 20, step=reach / 2000, hint=_FILLET
        ),
        Control("kept", "pattern.tidy", "no loose ends", "switch", live=False, hint=_TIDY),
    ]


_FILLET = "Radius of the corners of openings; only the built solid shows it."
_TIDY = (
    "Removes the parts of members beyond their last crossing, and fills slits; only the built solid shows this "
    "change. A dash means the default: on for evenly spaced stripes."
)
