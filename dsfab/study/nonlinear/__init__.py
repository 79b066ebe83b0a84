"""Load at which a design buckles or snaps through, computed by CalculiX."""

from dataclasses import dataclass, replace

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import StaticsError
from dsfab.core.messages import length
from dsfab.design import Design, Progress, loads_on, silent
from dsfab.preset.file import with_overrides
from dsfab.study.calculix import LoadPath, WedgeModel, load_path, lowest_buckling, require_ccx, solid_model

CANDIDATE, JUMP = 10.0, 5.0
"""A load step is a snap-through if its ratio of displacement to load is large. The ratio exceeds JUMP times the ratio
of the step before, and CANDIDATE times the ratio of the first step."""


@dataclass(frozen=True, eq=False)
class NonlinearCheck:
    """Load factors at which a design fails, computed by CalculiX with large displacements.
    linear    : load factor at which the perfect solid buckles by linear theory. None if it does not buckle;
                then the other values are 0 or empty.
    limit     : load factor at which the imperfect solid fails, or the largest computed factor.
    given_way : True if the solid fails.    minutes : time limit that stopped the computation; 0 if it was not stopped.
    imperfection : largest distance between the imperfect and the perfect solid, metres.
    moved     : largest displacement (m) under the loads, or at the load factor `limit` if it is below 1.
    load, u   : (k,) solved load factors, and (k,) largest displacement at each factor, metres.
    edge      : edge length (m) if the surface was cut again for this check; else 0."""

    case: str
    linear: float | None
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
    def sentence(self) -> str:
        model = f"CalculiX, {self.triangles:,} quadratic wedges"
        if self.linear is None:
            return f"{self.case}: by linear theory, the sheet does not buckle under this load ({model})"
        how, stop = f"the sheet gives way at {self.limit:.3g} times its load", ""
        if self.minutes:
            how = f"the sheet was solved up to {self.limit:.3g} times its load"
            stop = (
                f", then stopped at the time limit of {self.minutes:.3g} minutes (--minutes): the sheet may bear more"
            )
        elif not self.given_way:
            how = f"the sheet bears {self.limit:.3g} times its load, and may bear more"
        mesh = f" on a mesh with edges of {length(self.edge)}, without fillets" if self.edge else ""
        return (
            f"{self.case}: {how}, with large displacements and an imperfection of {length(self.imperfection)} in the "
            f"shape of the first buckling mode{stop}. By linear theory the sheet buckles at {self.linear:.3g} times "
            f"its load ({model}{mesh}, linear elastic material)"
        )


def nonlinear_check(
    design: Design,
    case: str | None = None,
    imperfection: float | None = None,
    minutes: float = 60.0,
    progress: Progress = silent,
    edge: float | None = None,
) -> NonlinearCheck:
    """Find the load factor at which a design's cut sheet fails, computed with large displacements.
    case         : load case or combination; default: the first combination, or the first case if there is none.
    imperfection : initial deviation from the perfect shape, metres; default: 1/300 of the design's longest extent.
    minutes      : time limit of each run of CalculiX.    edge : smallest edge length (m); 0 for the design's mesh.
    Raises StaticsError for spring supports, a time of 0, loads without support, and if CalculiX fails."""
    if not minutes > 0:
        raise StaticsError(f"the time limit of {minutes:g} minutes is not positive; give --minutes 60, or more")
    require_ccx()
    requested_design, design = design, without_fillets(design, edge, progress)
    cases, surface = design.statics.cases, design.surface
    name = case or next((case_name for case_name in cases if cases[case_name].factors is not None), next(iter(cases)))
    if name not in cases:
        raise StaticsError(f"{name!r} is no load case of this design; use one of {', '.join(cases)}")
    amount = float(np.ptp(surface.V, axis=0).max()) * (1 / 300) if imperfection is None else imperfection
    if not 0 <= amount < surface.size:
        raise StaticsError(f"the imperfection of {amount:g} m is negative or larger than the design; give metres")
    sheet, statics = design.sheet, design.preset.statics
    load = loads_on(surface, sheet, {name: cases[name].load})[name]
    normal = np.zeros_like(surface.V)
    for corner in surface.F.T:
        np.add.at(normal, corner, surface.normals * surface.areas[:, None])
    normal = sheet.carry(normal)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    model = solid_model(sheet.surface, normal, statics.thickness, statics.elastic, load)
    result = solid_check(model, name, amount, 60 * minutes, progress)
    return result if design is requested_design else replace(result, edge=surface.mean_edge)


def without_fillets(design: Design, edge: float | None, progress: Progress) -> Design:
    """Return the design without fillets in the corners of openings.
    edge : smallest edge length (m) of the surface mesh; for 0, the design is returned unchanged.
    Raises StaticsError for an edge that is negative or longer than the surface."""
    if edge is not None and not 0 <= edge < design.surface.size:
        raise StaticsError(f"the edge length {edge:g} m is negative or longer than the surface; give metres or 0")
    changes: dict[str, float] = {}
    if edge and 0 < getattr(design.preset.surface, "edge", 0.0) < edge:
        changes["surface.edge"] = edge
    if edge != 0 and design.preset.pattern.fillet:
        changes["pattern.fillet"] = 0.0
    if not changes:
        return design
    return Design.from_preset(with_overrides(design.preset, changes), design, progress).until("slicing")


def solid_check(
    model: WedgeModel, case: str, imperfection: float, seconds: float, progress: Progress
) -> NonlinearCheck:
    """Find the load factor at which a solid buckles by linear theory, and the factor at which it fails.
    imperfection : initial deviation from the perfect shape, metres.
    seconds : time limit of each run of CalculiX.    case : name of the load case, for messages."""
    progress("nonlinear", f"CalculiX computes linear buckling of a model of {len(model.solid.elements):,} wedges")
    lowest = lowest_buckling(model, seconds)
    if lowest is None:
        return NonlinearCheck(case, None, 0.0, False, 0.0, 0.0, np.zeros(0), np.zeros(0), len(model.solid.elements))
    linear, mode = lowest
    shape = mode / np.linalg.norm(mode, axis=1).max()
    shape *= np.sign((shape * model.force).sum()) or 1.0  # the imperfection gets the direction of the loads
    middle = model.solid.columns[:, 2]
    watched = middle[:: -(-len(middle) // 1000)]  # watch at most 1000 vertices
    largest_factor = 1.2 * linear
    progress("nonlinear", f"solving up to {largest_factor:.3g} times the loads, with large displacements")
    start = model.solid.nodes + imperfection * shape
    path = load_path(model, start, (largest_factor,), watched, seconds, last_point)
    limit_step, given_way = limit_of(path)
    # finer steps do not help if there is no equilibrium just above the last load
    has_no_equilibrium = given_way and limit_step == len(path.load) - 1
    if not has_no_equilibrium and (fine := softest_range(path)) is not None:
        progress("nonlinear", f"solving from {fine[0]:.3g} to {fine[1]:.3g} times the loads in finer steps")
        closer = load_path(model, start, fine, watched, seconds, last_point)
        path = closer if limit_of(closer)[1] else path
    limit_step, given_way = limit_of(path)
    load, u = path.load, np.linalg.norm(path.u, axis=2).max(axis=1)
    moved = float(np.interp(min(1.0, load[limit_step]), load[: limit_step + 1], u[: limit_step + 1]))
    wedges, minutes = len(model.solid.elements), seconds / 60 if path.late and not given_way else 0.0
    limit = float(load[limit_step])
    return NonlinearCheck(case, linear, limit, given_way, imperfection, moved, load, u, wedges, minutes=minutes)


def softest_range(path: LoadPath) -> tuple[float, float] | None:
    """Return the range of load factors in which displacements grow fastest; None if finer steps are not needed."""
    moves = _relative_moves(path)
    step = int(moves.argmax())
    below, above = float(path.load[max(step - 1, 1)]), float(path.load[min(step + 2, len(path.load) - 1)])
    return (below, above) if moves[step] > CANDIDATE and above - below > 0.02 * above else None


def limit_of(path: LoadPath) -> tuple[int, bool]:
    """Return the number of the last state that the structure bears, and True if the structure then fails."""
    moves = _relative_moves(path)
    jump = (moves[1:] > JUMP * moves[:-1]) & (moves[1:] > CANDIDATE)
    soft = np.flatnonzero((moves > 100) | np.concatenate([[False], jump]))
    if len(soft):
        return int(soft[0]), True
    return len(path.load) - 1, not (path.whole or path.late)


def last_point(path: LoadPath) -> int | None:
    """Return the number of the state at which the computation of a path may stop; None to continue."""
    limit_step, snaps = limit_of(replace(path, whole=True))
    moves = _relative_moves(path)
    for start, increment in path.failed:
        if start <= limit_step and start > 1 and moves[start - 1] > 2 and increment <= 0.025 * path.load[start]:
            return start
    return limit_step + 1 if snaps else None


def _relative_moves(path: LoadPath) -> Floats:
    load = np.maximum(np.diff(path.load), 1e-12 * path.load[-1])
    moves = np.linalg.norm(np.diff(path.u, axis=0), axis=(1, 2)) / load
    return np.asarray(moves / moves[0])
