"""The beam model of a design as plain records for files, SI units."""

from typing import TYPE_CHECKING, Any

from dsfab.materials import MATERIALS
from dsfab.pipeline import Design

if TYPE_CHECKING:
    from dsfab.frame import Frame


def beam_records(design: Design) -> dict[str, Any]:
    """`frame_records` of a design, and `actions`, by case, permanent, snow, wind or variable; `description`; `told`,
    sentences on how far beams answer as the sheet does.

    Raises StaticsError where there are no members with an axis, or nothing carries their loads.
    """
    return frame_records(design.frame) | {
        "actions": dict(design.frame.actions),
        "description": design.preset.description,
        "told": [one.told for one in design.frame_agreement()],
    }


def frame_records(frame: "Frame") -> dict[str, Any]:
    """`frame`: columns of the beam model, see `dsfab.frame.Frame`, and `material`."""
    named = MATERIALS.get(frame.material.name)
    names = (
        *("points", "nodes", "ends", "width", "thickness", "eccentricity", "length", "fixed", "spring"),
        *("area", "inertia", "shear_area"),
    )
    return {
        "frame": {name: getattr(frame, name) for name in names}
        | {
            "z": frame.axes[:, 2],
            "member": [frame.members[k] if k >= 0 else "" for k in frame.member],
            "loads": dict(frame.loads),
            "combinations": {name: dict(factors) for name, factors in frame.combinations.items()},
        },
        "material": {
            "name": frame.material.name,
            "young": frame.material.young,
            "shear": frame.material.shear,
            "poisson": frame.material.poisson,
            "density": frame.material.density,
            "expansion": named.expansion if named else None,
        },
    }
