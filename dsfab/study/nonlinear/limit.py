"""`nonlinear_check`: linear buckling of a design as a solid, its shape as an imperfection, and what that then bears."""

from dataclasses import dataclass

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import StaticsError
from dsfab.pipeline import Design, Progress, loads_on, silent
from dsfab.study.nonlinear.calculix import LoadPath, load_path, lowest_buckling, require_ccx
from dsfab.study.nonlinear.solid import WedgeModel, solid_model
from dsfab.wording import length

OF_SPAN = 1 / 300
"""Imperfection over the span, where none is given."""
BEYOND = 1.2
"""The path goes so far, in times of the linear factor."""
SOFT = 100.0
"""A structure has given way when a step of the load moves it so many times as far as the first one did."""
CANDIDATE, JUMP = 10.0, 5.0
"""What is looked at in finer steps, and how much farther than the step before a snap moves."""
NEAR = 0.02
"""Factors that differ by less than this share need no finer steps between them."""
WATCHED = 1000
"""Vertices of the sheet whose displacements are read, at most."""


@dataclass(frozen=True, eq=False)
class NonlinearCheck:
    """What CalculiX finds of a design under one case.

    linear    : factor on the loads at which the perfect solid buckles by linear theory.
    limit     : factor at which the imperfect one gives way, or the largest that was reached.    given_way : whether.
    imperfection : metres, the largest; in the shape of that buckling.
    moved     : metres, the largest displacement under the loads as they are, or at the limit if that is less.
    load, u   : the path: factors (k,), and the largest displacement (k,), metres.    triangles : of the sheet.
    """

    case: str
    linear: float
    limit: float
    given_way: bool
    imperfection: float
    moved: float
    load: Floats
    u: Floats
    triangles: int

    @property
    def told(self) -> str:
        """A sentence."""
        how = (
            f"gives way at {self.limit:.3g} times its load"
            if self.given_way
            else f"bears {self.limit:.3g} times its load, and may bear more"
        )
        return (
            f"{self.case}: {how} with large displacements and an imperfection of {length(self.imperfection)} in the "
            f"shape of its first buckling; that comes at {self.linear:.3g} by linear theory (CalculiX, "
            f"{self.triangles:,} quadratic wedges, linear elastic material)"
        )


def nonlinear_check(
    design: Design,
    case: str | None = None,
    imperfection: float | None = None,
    minutes: float = 60.0,
    progress: Progress = silent,
) -> NonlinearCheck:
    """How much of its load the cut sheet of a design bears, as a solid, with large displacements.

    case : or combination; left out: the first combination, or the first case where there is none.    imperfection :
    metres; left out: a 300th of its longest side.    minutes : that each run of CalculiX may take.

    Raises StaticsError where CalculiX is missing or finds no answer, where nothing carries its loads, and for springs.
    """
    require_ccx()
    cases, surface = design.statics.cases, design.surface
    name = case or next((one for one in cases if cases[one].factors is not None), next(iter(cases)))
    if name not in cases:
        raise StaticsError(f"{name!r} is no load case of this design; use one of {', '.join(cases)}")
    amount = OF_SPAN * float(np.ptp(surface.V, axis=0).max()) if imperfection is None else imperfection
    if not 0 <= amount < surface.size:
        raise StaticsError(f"an imperfection of {amount:g} m is none of this design; give metres, for instance 0.02")
    sheet, statics = design.sheet, design.preset.statics
    load = loads_on(surface, sheet, {name: cases[name].load})[name]
    normal = sheet.carry(_vertex_normals(surface.V, surface.F, surface.normals * surface.areas[:, None]))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    model = solid_model(sheet.surface, normal, statics.thickness, statics.elastic, load)
    return solid_check(model, name, amount, 60 * minutes, progress)


def _vertex_normals(V: Floats, F: Ints, normal: Floats) -> Floats:
    """(n, 3) sums of the normals of faces, in proportion to their areas."""
    found = np.zeros_like(V)
    for corner in F.T:
        np.add.at(found, corner, normal)
    return found


def solid_check(
    model: WedgeModel, case: str, imperfection: float, seconds: float, progress: Progress
) -> NonlinearCheck:
    """The same of a solid; imperfection in metres, seconds that each run of CalculiX may take."""
    progress("nonlinear", f"linear buckling of {len(model.solid.elements):,} wedges by CalculiX")
    linear, mode = lowest_buckling(model, seconds)
    shape = mode / np.linalg.norm(mode, axis=1).max()
    shape *= np.sign((shape * model.force).sum()) or 1.0  # towards where the loads push it
    middle = model.solid.columns[:, 2]
    watched = middle[:: -(-len(middle) // WATCHED)]
    progress("nonlinear", f"loads up to {BEYOND * linear:.3g} times theirs, with large displacements")
    start, most = model.solid.nodes + imperfection * shape, BEYOND * linear
    path = load_path(model, start, (most,), watched, seconds)
    if (fine := softest(path)) is not None:
        progress("nonlinear", f"loads from {fine[0]:.3g} to {fine[1]:.3g} times theirs in finer steps")
        closer = load_path(model, start, fine, watched, seconds)
        path = closer if limit_of(closer)[1] else path
    at, given_way = limit_of(path)
    load, u = path.load, np.linalg.norm(path.u, axis=2).max(axis=1)
    moved = float(np.interp(min(1.0, load[at]), load[: at + 1], u[: at + 1]))
    return NonlinearCheck(
        case, linear, float(load[at]), given_way, imperfection, moved, load, u, len(model.solid.elements)
    )


def softest(path: LoadPath) -> tuple[float, float] | None:
    """The factors between which a path moves the structure most for its load; None where no step moves it much farther
    than the first, or where they are near each other already."""
    moves = _moves(path)
    step = int(moves.argmax())
    below, above = float(path.load[max(step - 1, 1)]), float(path.load[min(step + 2, len(path.load) - 1)])
    return (below, above) if moves[step] > CANDIDATE and above - below > NEAR * above else None


def limit_of(path: LoadPath) -> tuple[int, bool]:
    """The step of a path up to which the structure bears its load, and whether it gives way after it.

    It does where the next step moves it `SOFT` times as far for its load as the first one did, or `JUMP` times as far
    as the step before and over `CANDIDATE` times as far as the first: it has snapped into another shape. And where the
    path ends early.
    """
    moves = _moves(path)
    jump = (moves[1:] > JUMP * moves[:-1]) & (moves[1:] > CANDIDATE)
    soft = np.flatnonzero((moves > SOFT) | np.concatenate([[False], jump]))
    if len(soft):
        return int(soft[0]), True
    return len(path.load) - 1, not path.whole


def _moves(path: LoadPath) -> Floats:
    """(k - 1,) how far each step moves the structure for its load, over what the first one does."""
    load = np.maximum(np.diff(path.load), 1e-12 * path.load[-1])
    moves = np.linalg.norm(np.diff(path.u, axis=0), axis=(1, 2)) / load
    return np.asarray(moves / moves[0])
