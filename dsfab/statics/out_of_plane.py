"""What holds a sheet out of its plane, where its loads lie in it: what its supports say of the plane is not enough."""

from dataclasses import dataclass, replace

from dsfab.errors import StaticsError
from dsfab.statics.mechanisms import require_held
from dsfab.statics.solve import flat_axis
from dsfab.statics.supports import all_clamped
from dsfab.surface import LoadCase, Surface

HELD = "its supports hold it out of its plane too"
UPRIGHT = f"{HELD}, and their edges do not turn: on hinges it would fall over"


@dataclass(frozen=True, eq=False)
class ModeSupports:
    """load : with the supports that a sheet vibrates and buckles on.   told : what was assumed of them, or ''."""

    load: LoadCase
    told: str = ""


def mode_supports(surface: Surface, load: LoadCase, plane: bool | None = None) -> ModeSupports:
    """The supports of a sheet that vibrates and buckles: those given, where it is not solved in its plane.

    A sheet that is loaded in its plane is mostly given supports in the plane alone, which leave it free to fall over.
    Where one of them holds a vertex or stands it on a spring, the sheet is held rigidly across its plane as well. Where
    it could still turn about a line through all of them (a wall on its base, a cantilever), the free edges between such
    vertices do not turn either: a support that holds a length of the sheet holds it upright.

    plane : whether it is solved in its plane; found from the load when left out.
    """
    axis = flat_axis(surface, load)
    if axis is None or plane is False:
        return ModeSupports(load)
    fixed, held = load.fixed.copy(), load.held
    fixed[held, axis] = True
    across = replace(load, fixed=fixed)
    try:
        require_held(surface, across, fixed, all_clamped(across))
    except StaticsError:
        edges = surface.edges
        upright = edges.boundary & held[edges.ends].all(axis=1)
        given = all_clamped(load)
        return ModeSupports(replace(across, clamped=upright if given is None else upright | given), UPRIGHT)
    return ModeSupports(across, HELD)
