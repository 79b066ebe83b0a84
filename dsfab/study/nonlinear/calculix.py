"""Models of wedges for CalculiX, and what it finds: buckling factors with their shapes, and paths of loads."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import StaticsError
from dsfab.study.nonlinear.running import CcxFiles, run_ccx
from dsfab.study.nonlinear.solid import WedgeModel

SMALLEST = 1e-3
"""Steps of the load are halved down to this share of it before the program gives up."""
STEPS = 10
"""So many steps to each factor, or more where the program needs them: it halves those that do not converge."""
FACTOR = re.compile(r"^\s+1\s+(\S+)\s*$", re.MULTILINE)


@dataclass(frozen=True, eq=False)
class LoadPath:
    """load : (k,) factors on the loads, from 0 on.    u : (k, w, 3) metres, of the nodes that were watched.
    whole   : whether the last factor that was asked for was reached.    late : whether time was over before.
    failed  : (f, 2) of each attempt without equilibrium: the point from which it started, and by how much it tried to
              raise the factor.
    """

    load: Floats
    u: Floats
    whole: bool
    late: bool = False
    failed: tuple[tuple[int, float], ...] = ()

    def until(self, last: int) -> "LoadPath":
        """The path up to its point `last`, where nobody asks for more."""
        failed = tuple((at, by) for at, by in self.failed if at <= last)
        return LoadPath(self.load[: last + 1], self.u[: last + 1], False, False, failed)


def _never(path: LoadPath) -> int | None:
    return None


def lowest_buckling(model: WedgeModel, seconds: float) -> tuple[float, Floats]:
    """The lowest factor on the loads at which the solid buckles by linear theory, and (p, 3) its shape, any size.

    Raises StaticsError where CalculiX finds none.
    """
    step = ["*STEP\n*BUCKLE\n1\n*CLOAD\n", *_loads(model.force), "*NODE PRINT, NSET=ALL\nU\n*END STEP\n"]
    files = run_ccx([*_model(model, model.solid.nodes), *step], seconds)
    if not files.ended:
        raise _late(seconds)
    _, _, table = files.results.partition("B U C K L I N G")
    factor, shape = FACTOR.search(table), files.tables()
    if not (factor and shape):
        raise StaticsError(f"CalculiX found no buckling of the solid: {files.said.strip()[-200:]}")
    mode = np.zeros_like(model.solid.nodes)
    last = shape[-1][1]
    mode[last[:, 0].astype(int) - 1] = last[:, 1:]
    return float(factor[1]), mode


def load_path(
    model: WedgeModel,
    nodes: Floats,
    factors: tuple[float, ...],
    watched: Ints,
    seconds: float,
    last: Callable[[LoadPath], int | None] = _never,
) -> LoadPath:
    """How nodes (w,) move as loads grow to each of `factors` in turn, in `STEPS` steps each, with large displacements.

    nodes : (p, 3) where the solid is at first, metres.    last : of a path so far, the point after which no more is
    asked, if there is one yet. Where the program cannot go on, or the seconds are over, the path ends.
    """
    text = [*_model(model, nodes), "*NSET, NSET=WATCHED\n", *_rows("%d\n", watched + 1)]
    for factor in factors:
        text.append(f"*STEP, NLGEOM, INC=1000\n*STATIC\n{1 / STEPS}, 1., {SMALLEST}, {1 / STEPS}\n*CLOAD\n")
        text += [*_loads(factor * model.force), "*NODE PRINT, NSET=WATCHED\nU\n*END STEP\n"]

    def until(files: CcxFiles) -> tuple[LoadPath, int | None]:
        path = _path(files, factors, len(watched))
        return path, last(path) if len(path.load) > 1 else None

    files = run_ccx(text, seconds, lambda files: until(files)[1] is not None)
    path, end = until(files)  # wherever the program was by then, the path ends at the same point
    if end is not None:
        return path.until(end)
    if len(path.load) == 1 and not files.ended:
        raise _late(seconds)
    if len(path.load) == 1:
        raise StaticsError(f"CalculiX found no equilibrium under the first step of the load: {files.said[-200:]}")
    return replace(path, late=not files.ended)


def _path(files: CcxFiles, factors: tuple[float, ...], count: int) -> LoadPath:
    """What was found so far of `count` nodes."""
    tables = [(time, table) for time, table in files.tables() if len(table) == count]
    time = np.array([0.0, *(time for time, _ in tables)])
    u = np.stack([np.zeros((count, 3)), *(table[table[:, 0].argsort(), 1:] for _, table in tables)])
    ends = np.arange(len(factors) + 1), np.array([0.0, *factors])
    failed = [
        (int(np.searchsorted(time, at + 1e-5)) - 1, float(np.interp(at + step, *ends) - np.interp(at, *ends)))
        for at, step in files.failures()
    ]
    return LoadPath(np.interp(time, *ends), u, bool(time[-1] > len(factors) - 1e-6), failed=tuple(failed))


def _late(seconds: float) -> StaticsError:
    return StaticsError(
        f"CalculiX did not come to an end within {seconds / 60:.3g} minutes; make the mesh coarser "
        "(--check-edge, surface.edge), or give it more: --minutes"
    )


def _model(model: WedgeModel, nodes: Floats) -> Iterator[str]:
    """Everything before the step."""
    solid, used = model.solid, np.unique(model.solid.elements)
    yield "*NODE, NSET=ALL\n"
    yield from _rows("%d, %.11e, %.11e, %.11e\n", used + 1, *nodes[used].T)
    yield "*ELEMENT, TYPE=C3D15, ELSET=SOLID\n"
    yield from _rows(", ".join(["%d"] * 16) + "\n", np.arange(1, len(solid.elements) + 1), *(solid.elements.T + 1))
    yield f"*MATERIAL, NAME=SOLID\n*ELASTIC\n{model.material.young:.12g}, {model.material.poisson:.12g}\n"
    yield "*SOLID SECTION, ELSET=SOLID, MATERIAL=SOLID\n*BOUNDARY\n"
    yield from _rows("%d, %d, %d\n", model.fixed[:, 0] + 1, model.fixed[:, 1] + 1, model.fixed[:, 1] + 1)
    one, other, way = (model.opposite + 1).T
    yield from _rows("*EQUATION\n2\n%d, %d, 1., %d, %d, 1.\n", one, way, other, way)


def _loads(force: Floats) -> Iterator[str]:
    node, way = np.nonzero(force)
    yield from _rows("%d, %d, %.11e\n", node + 1, way + 1, force[node, way])


def _rows(template: str, *columns: Ints | Floats) -> Iterator[str]:
    """`template % row` for every row of the columns."""
    yield "".join(template % row for row in zip(*(column.tolist() for column in columns), strict=True))
