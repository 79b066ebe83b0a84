"""The load that a design bears before it buckles or snaps, with large displacements, by CalculiX."""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import StaticsError
from dsfab.core.messages import length
from dsfab.design import Design, Progress, loads_on, silent
from dsfab.preset.file import overridden
from dsfab.study.calculix import LoadPath, WedgeModel, load_path, lowest_buckling, require_ccx, solid_model

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
SOFTENED, NARROW = 2.0, 0.025
"""No equilibrium is to be had any more where a step of the load moves it so many times as far as the first one did, and
no larger share of the load than this can be added."""
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
    edge      : metres, of the triangles of the surface that was cut anew for it; 0 for the sheet of the design itself.
    minutes   : of each run of CalculiX, where they were over before the end of the path; else 0.
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
    edge: float = 0.0
    minutes: float = 0.0

    @property
    def told(self) -> str:
        """A sentence."""
        how, stop = f"gives way at {self.limit:.3g} times its load", ""
        if self.minutes:
            how = f"followed to {self.limit:.3g} times its load"
            stop = f", then stopped because {self.minutes:.3g} minutes were over (--minutes): it may bear more"
        elif not self.given_way:
            how = f"bears {self.limit:.3g} times its load, and may bear more"
        mesh = f" of a surface with edges of {length(self.edge)}, cut without fillets" if self.edge else ""
        return (
            f"{self.case}: {how} with large displacements and an imperfection of {length(self.imperfection)} in the "
            f"shape of its first buckling{stop}; that buckling comes at {self.linear:.3g} by linear theory (CalculiX, "
            f"{self.triangles:,} quadratic wedges{mesh}, linear elastic material)"
        )


def nonlinear_check(
    design: Design,
    case: str | None = None,
    imperfection: float | None = None,
    minutes: float = 60.0,
    progress: Progress = silent,
    edge: float | None = None,
) -> NonlinearCheck:
    """How much of its load the cut sheet of a design bears, as a solid, with large displacements.

    case : or combination; left out: the first combination, or the first case where there is none.    imperfection :
    metres; left out: a 300th of its longest side.    minutes : that each run of CalculiX may take.    edge : metres, of
    the surface that is cut for it, or 0: see `without_fillets`.

    Raises StaticsError where CalculiX is missing or finds no answer, where nothing carries its loads, for springs, and
    for a time that is none.
    """
    if not minutes > 0:
        raise StaticsError(f"{minutes:g} minutes are no time for CalculiX; give it --minutes 60, or more")
    require_ccx()
    asked, design = design, without_fillets(design, edge, progress)
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
    found = solid_check(model, name, amount, 60 * minutes, progress)
    return found if design is asked else replace(found, edge=surface.mean_edge)


def without_fillets(design: Design, edge: float | None, progress: Progress) -> Design:
    """The design with sharp corners of openings: the arcs of a dome's fillets are half of its triangles, and change its
    linear buckling by .4 %.

    edge : metres, of the triangles of the surface that it is cut out of then, where the design's are shorter; 0 leaves
    everything as it is. A mesh that is taken as its file has it stays.

    Raises StaticsError for a length that is none.
    """
    if edge is not None and not 0 <= edge < design.surface.size:
        raise StaticsError(f"edges of {edge:g} m are none of this design; give metres, for instance 0.5, or 0")
    changes: dict[str, float] = {}
    if edge and 0 < getattr(design.preset.surface, "edge", 0.0) < edge:
        changes["surface.edge"] = edge
    if edge != 0 and design.preset.pattern.fillet:
        changes["pattern.fillet"] = 0.0
    return Design.of(overridden(design.preset, changes), design, progress).until("slicing") if changes else design


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
    path = load_path(model, start, (most,), watched, seconds, last_of)
    if not _stuck(path) and (fine := softest(path)) is not None:
        progress("nonlinear", f"loads from {fine[0]:.3g} to {fine[1]:.3g} times theirs in finer steps")
        closer = load_path(model, start, fine, watched, seconds, last_of)
        path = closer if limit_of(closer)[1] else path
    at, given_way = limit_of(path)
    load, u = path.load, np.linalg.norm(path.u, axis=2).max(axis=1)
    moved = float(np.interp(min(1.0, load[at]), load[: at + 1], u[: at + 1]))
    wedges, minutes = len(model.solid.elements), seconds / 60 if path.late and not given_way else 0.0
    return NonlinearCheck(
        case, linear, float(load[at]), given_way, imperfection, moved, load, u, wedges, minutes=minutes
    )


def _stuck(path: LoadPath) -> bool:
    """Whether there is no equilibrium under a little more: finer steps find no more of it."""
    at, given_way = limit_of(path)
    return given_way and at == len(path.load) - 1


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
    path ends early, but not for want of time.
    """
    moves = _moves(path)
    jump = (moves[1:] > JUMP * moves[:-1]) & (moves[1:] > CANDIDATE)
    soft = np.flatnonzero((moves > SOFT) | np.concatenate([[False], jump]))
    if len(soft):
        return int(soft[0]), True
    return len(path.load) - 1, not (path.whole or path.late)


def last_of(path: LoadPath) -> int | None:
    """The point after which a path has no more to tell, if it has come so far: the end of a snap, or where it is soft
    and a small step more has no equilibrium. CalculiX would halve that step many times, in vain."""
    at, snaps = limit_of(replace(path, whole=True))
    moves = _moves(path)
    for start, by in path.failed:
        if start <= at and start > 1 and moves[start - 1] > SOFTENED and by <= NARROW * path.load[start]:
            return start
    return at + 1 if snaps else None


def _moves(path: LoadPath) -> Floats:
    """(k - 1,) how far each step moves the structure for its load, over what the first one does."""
    load = np.maximum(np.diff(path.load), 1e-12 * path.load[-1])
    moves = np.linalg.norm(np.diff(path.u, axis=0), axis=(1, 2)) / load
    return np.asarray(moves / moves[0])
