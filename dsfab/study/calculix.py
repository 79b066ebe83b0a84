"""Solid models of sheets for CalculiX, made of quadratic wedge elements."""

import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dsfab.core.arrays import Bools, Floats, Ints
from dsfab.core.errors import StaticsError
from dsfab.statics import Material
from dsfab.study.check_model import held_nodes
from dsfab.surface import LoadCase, Surface

CCX = "ccx"  # CalculiX's solver program
ENERGY = re.compile(r"total internal energy.*?\n\s*\n\s*(\S+)")
Projection = Callable[[Floats], tuple[Floats, Floats]]  # points -> nearest surface points and unit normals


@dataclass(frozen=True, eq=False)
class Wedges:
    """A solid with one quadratic wedge (C3D15) for each of m triangles of a sheet.
    nodes   : (p, 3) positions, metres.    middles : (e, 2) node numbers at edge midpoints: bottom and top.
    elements : (m, 15) node numbers of each wedge: bottom corners, top corners, midpoints of bottom edges, midpoints of
               top edges, midpoints of upright edges.
    columns : (n, 3) node numbers at each vertex of the sheet: bottom, top, and middle of the thickness."""

    nodes: Floats
    elements: Ints
    columns: Ints
    middles: Ints


def wedges(surface: Surface, thickness: float, projection: Projection) -> Wedges:
    """Return the solid of a sheet with the middle surface `surface` and a thickness (m).
    projection : function that maps points to their nearest points on the exact surface and the normals there."""
    edges, F = surface.edges, surface.F
    n, e = surface.n, len(edges.ends)
    corner, normal = projection(surface.V)
    middle, across = projection(surface.V[edges.ends].mean(axis=1))
    up, over = thickness / 2 * normal, thickness / 2 * across
    nodes = np.concatenate([corner - up, corner + up, corner, middle - over, middle + over])
    columns = np.arange(n)[:, None] + n * np.arange(3)
    middles = 3 * n + np.arange(e)[:, None] + e * np.arange(2)
    # reverse the corners of faces whose normal is opposite to that of their vertices
    turned = (surface.normals * normal[F[:, 0]]).sum(axis=1) < 0
    F, numbers = (np.where(turned[:, None], F[:, ::-1], F), np.where(turned[:, None], edges.of[:, [1, 0, 2]], edges.of))
    parts = [columns[F, 0], columns[F, 1], middles[numbers, 0], middles[numbers, 1], columns[F, 2]]
    return Wedges(nodes, np.concatenate(parts, axis=1), columns, middles)


def solid_compliance(
    solid: Wedges, material: Material, fixed_nodes: Ints, gravity: Floats, seconds: float = 600.0
) -> float | None:
    """Return the compliance (J) of a solid under its own weight; None if CalculiX is not installed.
    fixed_nodes : their numbers.  gravity : (3,) m/s2.  seconds : time limit. Raises StaticsError if CalculiX fails."""
    program = shutil.which(CCX)
    if program is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "solid.inp").write_text(_input_text(solid, material, fixed_nodes, gravity), encoding="ascii")
        try:
            process = subprocess.run(
                [program, "solid"], cwd=folder, capture_output=True, text=True, timeout=seconds, check=False
            )
        except subprocess.TimeoutExpired as error:
            raise StaticsError(f"CalculiX did not solve the solid within {seconds:g} s") from error
        result = Path(folder) / "solid.dat"
        match = ENERGY.search(result.read_text(encoding="ascii")) if result.exists() else None
    if process.returncode or not match:
        raise StaticsError(f"CalculiX did not solve the solid: {process.stdout.strip()[-200:]}")
    return 2 * float(match[1])


def _input_text(solid: Wedges, material: Material, fixed_nodes: Ints, gravity: Floats) -> str:
    size = float(np.linalg.norm(gravity))
    used = np.unique(solid.elements)
    lines = ["*NODE, NSET=ALL", *(f"{k + 1},{','.join(f'{x:.12e}' for x in solid.nodes[k])}" for k in used)]
    lines.append("*ELEMENT, TYPE=C3D15, ELSET=S")
    lines += [f"{k},{','.join(map(str, row + 1))}" for k, row in enumerate(solid.elements, start=1)]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{material.young},{material.poisson}"]
    lines += ["*DENSITY", f"{material.density}", "*SOLID SECTION, ELSET=S, MATERIAL=M", "*BOUNDARY"]
    lines += [f"{k + 1},1,3" for k in np.intersect1d(fixed_nodes, used)]
    lines += ["*STEP", "*STATIC", "*DLOAD", f"S,GRAV,{size},{','.join(f'{x / size:.12e}' for x in gravity)}"]
    lines += ["*EL PRINT, ELSET=S, TOTALS=ONLY", "ELSE", "*END STEP", ""]
    return "\n".join(lines)


def end_face_nodes(solid: Wedges, surface: Surface, marked: Bools) -> Ints:
    """Return the numbers of nodes at boundary edges with two marked ends. marked : (n,) mask of sheet vertices."""
    edges = surface.edges
    is_marked = edges.boundary & marked[edges.ends].all(axis=1)
    return np.unique(np.concatenate([solid.columns[edges.ends[is_marked]].ravel(), solid.middles[is_marked].ravel()]))


THICKNESS_SHARES = (1 / 6, 1 / 6, 2 / 3)  # shares of a vertex's force on its lower, upper and middle nodes


@dataclass(frozen=True, eq=False)
class WedgeModel:
    """A solid with its supports and forces.
    fixed    : (q, 2) pairs of a node number and a direction (0 to 2) in which the node cannot move.
    opposite : (r, 3) two node numbers and a direction (0 to 2) in which the two nodes move by opposite amounts.
    force    : (p, 3) forces on the nodes, newtons."""

    solid: Wedges
    material: Material
    fixed: Ints
    opposite: Ints
    force: Floats


def solid_model(surface: Surface, normal: Floats, thickness: float, material: Material, load: LoadCase) -> WedgeModel:
    """Return a solid of the sheet `surface`, with the supports and forces of a load case.
    normal : (n, 3) unit normals at the vertices, all on one side of the sheet.    thickness : metres.
    Raises StaticsError for spring supports."""
    if load.spring.any():
        raise StaticsError("the nonlinear check cannot use springs at supports; make these supports rigid")
    across = normal[surface.edges.ends].sum(axis=1)
    normals = iter((normal, across / np.linalg.norm(across, axis=1, keepdims=True)))
    solid = wedges(surface, thickness, lambda points: (points, next(normals)))
    fixed, opposite = _supports(solid, surface, load, held_nodes(surface, {"HELD": load.fixed})["HELD"])
    force = np.zeros_like(solid.nodes)
    for column, share in zip(solid.columns.T, THICKNESS_SHARES, strict=True):
        np.add.at(force, column, share * load.force)
    return WedgeModel(solid, material, fixed, opposite, force)


def _supports(solid: Wedges, surface: Surface, load: LoadCase, held_directions: Bools) -> tuple[Ints, Ints]:
    n = surface.n
    vertex, direction = np.nonzero(held_directions[:n])
    edge, edge_direction = np.nonzero(held_directions[n:])
    fixed = np.stack([solid.columns[vertex, 2], direction], axis=1)
    at_vertices = np.concatenate([solid.columns[vertex, :2], direction[:, None]], axis=1)
    at_edges = np.concatenate([solid.middles[edge], edge_direction[:, None]], axis=1)
    pairs = np.concatenate([at_vertices, at_edges])
    edges = np.flatnonzero(load.clamped)
    stiff = np.unique(np.concatenate([solid.columns[surface.edges.ends[edges]].ravel(), solid.middles[edges].ravel()]))
    clamped = np.stack([np.repeat(stiff, 3), np.tile(np.arange(3), len(stiff))], axis=1)
    return np.unique(np.concatenate([fixed, clamped]), axis=0), pairs[~np.isin(pairs[:, :2], stiff).any(axis=1)]


ATTEMPT = re.compile(r"^ *\d+ +\d+ +\d+(U?) +\d+ +(\S+) +\S+ +(\S+) *$", re.MULTILINE)
"""Line of CalculiX's .sta file for a time step. Groups: "U" if no equilibrium was found, start time, step length."""
TABLE = re.compile(r"^ displacements .* time +(\S+)\s*$", re.MULTILINE)


@dataclass(frozen=True)
class CcxFiles:
    """Text that CalculiX has written so far: messages, results, time steps. ended : True if it ended by itself."""

    said: str
    results: str
    attempts: str
    ended: bool

    def tables(self) -> list[tuple[float, Floats]]:
        """Return the time and the rows (node number, three displacements), (k, 4), of each table of displacements."""
        data = self.results[: self.results.rfind("\n") + 1]  # the last line may be incomplete
        heads = list(TABLE.finditer(data))
        parsed = []
        for head, following in zip(heads, [*heads, None][1:], strict=True):
            lines = data[head.end() : following.start() if following else None].strip().splitlines()
            table = [line.split() for line in lines]
            numbers = [[float(word) for word in words] for words in table if len(words) == 4 and words[0].isdigit()]
            parsed.append((float(head[1]), np.array(numbers).reshape(-1, 4)))
        return parsed

    def failures(self) -> list[tuple[float, float]]:
        """Return the start time and the length of each time step for which CalculiX found no equilibrium."""
        return [(float(start), float(step)) for failed, start, step in ATTEMPT.findall(self.attempts) if failed]


def require_ccx() -> str:
    """Return the path of the program CalculiX (ccx). Raises StaticsError if it is not installed."""
    path = shutil.which(CCX)
    if path is None:
        raise StaticsError(
            "the nonlinear check needs CalculiX, but the program ccx is not on the path; install CalculiX (Debian "
            "and Ubuntu: apt install calculix-ccx), or leave out --nonlinear"
        )
    return path


def run_ccx(text: list[str], seconds: float, enough: Callable[[CcxFiles], bool] = lambda files: False) -> CcxFiles:
    """Run CalculiX on the lines of an .inp file, and return its output.
    seconds : time limit.    enough : function of the output so far; CalculiX is stopped if it returns True."""
    with tempfile.TemporaryDirectory(prefix="dsfab-") as name:
        folder = Path(name)
        (folder / "solid.inp").write_text("".join(text), encoding="ascii")
        with (folder / "said").open("wb") as output:
            process = subprocess.Popen(
                [require_ccx(), "solid"], cwd=folder, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT
            )
            try:
                _wait(process, folder, seconds, enough)
                return _files(folder, process.poll() is not None)
            finally:
                process.kill()
                process.wait()


def _wait(process: "subprocess.Popen[bytes]", folder: Path, seconds: float, enough: Callable[[CcxFiles], bool]) -> None:
    over, seen, attempts = time.monotonic() + seconds, 0, folder / "solid.sta"
    while process.poll() is None and (seconds_left := over - time.monotonic()) > 0:
        try:
            process.wait(min(0.2, seconds_left))
        except subprocess.TimeoutExpired:
            size = attempts.stat().st_size if attempts.exists() else 0
            if size > seen and enough(_files(folder, False)):
                return
            seen = size


def _files(folder: Path, ended: bool) -> CcxFiles:
    def text(name: str) -> str:
        path = folder / name
        return path.read_text(encoding="ascii", errors="replace") if path.exists() else ""

    return CcxFiles(text("said"), text("solid.dat"), text("solid.sta"), ended)


FACTOR = re.compile(r"^ +\d+ +(\S+) *$", re.MULTILINE)
FACTORS = (6, 24, 96)  # Requested numbers of buckling factors, in turn; many factors can be negative.
SETTLED = 0.01  # Relative change of the lowest positive factor at which the search ends.


@dataclass(frozen=True, eq=False)
class LoadPath:
    """Load-displacement path: k computed equilibrium states of a structure under growing loads.
    load    : (k,) load factors; the first is 0.    u : (k, w, 3) displacements of w nodes, metres.
    whole   : True if the path reaches the last requested factor.    late : True if the time limit ended the path.
    failed  : for each load step without equilibrium: number of the state before it, and increase of the factor."""

    load: Floats
    u: Floats
    whole: bool
    late: bool = False
    failed: tuple[tuple[int, float], ...] = ()

    def until(self, last_point: int) -> "LoadPath":
        """Return the path from its start to the state with the number `last_point`."""
        failed = tuple((point, by) for point, by in self.failed if point <= last_point)
        return LoadPath(self.load[: last_point + 1], self.u[: last_point + 1], False, False, failed)


def lowest_buckling(model: WedgeModel, seconds: float) -> tuple[float, Floats] | None:
    """Return the lowest buckling factor of a solid and its mode (p, 3); None without buckling. seconds : time limit."""
    lowest = np.inf
    for count in FACTORS:
        moved, factors, modes = _buckling_factors(model, count, seconds)
        earlier, positive = lowest, np.where(factors > 0, factors, np.inf)
        lowest = float(positive.min())
        if np.isfinite(positive).all() or abs(lowest - earlier) <= SETTLED * lowest < np.inf:
            break
    if not lowest * moved <= np.ptp(model.solid.nodes, axis=0).max():  # `lowest` is inf if no factor is positive
        return None
    mode, rows = np.zeros_like(model.solid.nodes), modes[int(positive.argmin())]
    mode[rows[:, 0].astype(int) - 1] = rows[:, 1:]
    return lowest, mode


def _buckling_factors(model: WedgeModel, count: int, seconds: float) -> tuple[float, Floats, list[Floats]]:
    load, table = [*load_lines(model.force), "*NODE PRINT, NSET=ALL\nU\n*END STEP\n"], "B U C K L I N G"
    steps = ["*STEP\n*STATIC\n*CLOAD\n", *load, f"*STEP\n*BUCKLE\n{count}\n*CLOAD, OP=NEW\n", *load]
    files = run_ccx([*model_lines(model, model.solid.nodes), *steps], seconds)
    if not files.ended:
        raise _timeout_error(seconds)
    factors = np.array(FACTOR.findall(files.results.partition(table)[2]), dtype=np.float64)
    (_, still), *modes = files.tables() or [(0.0, np.zeros((0, 4)))]
    if not len(factors) or len(modes) < len(factors):
        raise StaticsError(f"CalculiX found no buckling factor of the solid: {files.said.strip()[-200:]}")
    moved = float(np.linalg.norm(still[:, 1:], axis=1).max())
    return moved, factors, [rows for _, rows in modes[-len(factors) :]]


def load_path(
    model: WedgeModel,
    nodes: Floats,
    factors: tuple[float, ...],
    watched: Ints,
    seconds: float,
    stop_point: Callable[[LoadPath], int | None] = lambda path: None,
    steps: int = 10,
) -> LoadPath:
    """Return the load-displacement path of a structure under growing loads, computed with large displacements.
    nodes : (p, 3) initial positions, metres.    watched : (w,) numbers of the nodes with returned displacements.
    factors : load factors to reach, in this order.    steps : number of load steps to each factor.
    stop_point : function of the path so far; it returns the number of the last needed state, or None to continue.
    Raises StaticsError if the first step fails."""
    text = [*model_lines(model, nodes), "*NSET, NSET=WATCHED\n", *_formatted_rows("%d\n", watched + 1)]
    for factor in factors:
        text.append(f"*STEP, NLGEOM, INC=1000\n*STATIC\n{1 / steps}, 1., 0.001, {1 / steps}\n*CLOAD\n")
        text += [*load_lines(factor * model.force), "*NODE PRINT, NSET=WATCHED\nU\n*END STEP\n"]

    def until(files: CcxFiles) -> tuple[LoadPath, int | None]:
        path = _path(files, factors, len(watched))
        return path, stop_point(path) if len(path.load) > 1 else None

    files = run_ccx(text, seconds, lambda files: until(files)[1] is not None)
    path, end = until(files)  # CalculiX may have computed points after `end`
    if end is not None:
        return path.until(end)
    if len(path.load) == 1 and not files.ended:
        raise _timeout_error(seconds)
    if len(path.load) == 1:
        raise StaticsError(f"CalculiX found no equilibrium under the first step of the load: {files.said[-200:]}")
    return replace(path, late=not files.ended)


def _path(files: CcxFiles, factors: tuple[float, ...], count: int) -> LoadPath:
    tables = [(time, table) for time, table in files.tables() if len(table) == count]
    time = np.array([0.0, *(time for time, _ in tables)])
    u = np.stack([np.zeros((count, 3)), *(table[table[:, 0].argsort(), 1:] for _, table in tables)])
    ends = np.arange(len(factors) + 1), np.array([0.0, *factors])
    failed = tuple(
        (int(np.searchsorted(time, start + 1e-5)) - 1, float(np.interp(start + step, *ends) - np.interp(start, *ends)))
        for start, step in files.failures()
    )
    return LoadPath(np.interp(time, *ends), u, bool(time[-1] > len(factors) - 1e-6), failed=failed)


def _timeout_error(seconds: float) -> StaticsError:
    return StaticsError(
        f"CalculiX did not end within {seconds / 60:.3g} minutes; make the mesh coarser (--check-edge, surface.edge), "
        "or raise the time limit with --minutes"
    )


def model_lines(model: WedgeModel, nodes: Floats) -> Iterator[str]:
    """Yield the part of an .inp file with nodes, elements, material and supports. nodes : (p, 3) positions, metres."""
    solid, used = model.solid, np.unique(model.solid.elements)
    yield "*NODE, NSET=ALL\n"
    yield from _formatted_rows("%d, %.11e, %.11e, %.11e\n", used + 1, *nodes[used].T)
    yield "*ELEMENT, TYPE=C3D15, ELSET=SOLID\n"
    numbers = np.arange(1, len(solid.elements) + 1)
    yield from _formatted_rows(", ".join(["%d"] * 16) + "\n", numbers, *(solid.elements.T + 1))
    yield f"*MATERIAL, NAME=SOLID\n*ELASTIC\n{model.material.young:.12g}, {model.material.poisson:.12g}\n"
    yield "*SOLID SECTION, ELSET=SOLID, MATERIAL=SOLID\n*BOUNDARY\n"
    yield from _formatted_rows("%d, %d, %d\n", model.fixed[:, 0] + 1, model.fixed[:, 1] + 1, model.fixed[:, 1] + 1)
    node, opposite_node, direction = (model.opposite + 1).T
    yield from _formatted_rows("*EQUATION\n2\n%d, %d, 1., %d, %d, 1.\n", node, direction, opposite_node, direction)


def load_lines(force: Floats) -> Iterator[str]:
    """Yield the part of an .inp file with the nodal forces. force : (p, 3) newtons."""
    node, direction = np.nonzero(force)
    yield from _formatted_rows("%d, %d, %.11e\n", node + 1, direction + 1, force[node, direction])


def _formatted_rows(template: str, *columns: Ints | Floats) -> Iterator[str]:
    yield "".join(template % row for row in zip(*(column.tolist() for column in columns), strict=True))
