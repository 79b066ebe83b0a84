"""Models of wedges for CalculiX, and what it finds: buckling factors with their shapes, and paths of loads."""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dsfab.arrays import Floats, Ints
from dsfab.errors import StaticsError
from dsfab.study.nonlinear.solid import WedgeModel
from dsfab.study.verification.solids import CCX

SMALLEST = 1e-3
"""Steps of the load are halved down to this share of it before the program gives up."""
STEPS = 20
"""So many steps to each factor, or more where the program needs them."""
FACTOR = re.compile(r"^\s+1\s+(\S+)\s*$", re.MULTILINE)
TABLE = re.compile(r"^ displacements .* time +(\S+)\s*$", re.MULTILINE)


@dataclass(frozen=True, eq=False)
class LoadPath:
    """load : (k,) factors on the loads, from 0 on.    u : (k, w, 3) metres, of the nodes that were watched.
    whole : whether the last one that was asked for was reached."""

    load: Floats
    u: Floats
    whole: bool


def require_ccx() -> str:
    """The path of CalculiX. Raises StaticsError where it is not installed."""
    found = shutil.which(CCX)
    if found is None:
        raise StaticsError(
            "the nonlinear check is done by CalculiX, and its program ccx is not on the path; install it (Debian and "
            "Ubuntu: apt install calculix-ccx), or leave out --nonlinear"
        )
    return found


def lowest_buckling(model: WedgeModel, seconds: float) -> tuple[float, Floats]:
    """The lowest factor on the loads at which the solid buckles by linear theory, and (p, 3) its shape, any size.

    Raises StaticsError where CalculiX finds none.
    """
    step = ["*STEP\n*BUCKLE\n1\n*CLOAD\n", *_loads(model.force), "*NODE PRINT, NSET=ALL\nU\n*END STEP\n"]
    told, data = _run([*_model(model, model.solid.nodes), *step], seconds)
    _, _, table = data.partition("B U C K L I N G")
    factor, shape = FACTOR.search(table), _tables(data)
    if not (factor and shape):
        raise StaticsError(f"CalculiX found no buckling of the solid: {told.strip()[-200:]}")
    mode = np.zeros_like(model.solid.nodes)
    last = shape[-1][1]
    mode[last[:, 0].astype(int) - 1] = last[:, 1:]
    return float(factor[1]), mode


def load_path(model: WedgeModel, nodes: Floats, factors: tuple[float, ...], watched: Ints, seconds: float) -> LoadPath:
    """How nodes (w,) move as loads grow to each of `factors` in turn, in `STEPS` steps each, with large displacements.

    nodes : (p, 3) where the solid is at first, metres. Where the program cannot go on the path ends.
    """
    text = [*_model(model, nodes), "*NSET, NSET=WATCHED\n", *_rows("%d\n", watched + 1)]
    for factor in factors:
        text.append(f"*STEP, NLGEOM, INC=1000\n*STATIC\n{1 / STEPS}, 1., {SMALLEST}, {1 / STEPS}\n*CLOAD\n")
        text += [*_loads(factor * model.force), "*NODE PRINT, NSET=WATCHED\nU\n*END STEP\n"]
    told, data = _run(text, seconds)
    tables = _tables(data)
    if not tables:
        raise StaticsError(f"CalculiX found no equilibrium under the first step of the load: {told.strip()[-200:]}")
    time = np.array([0.0, *(time for time, _ in tables)])
    u = np.stack([np.zeros((len(watched), 3)), *(table[table[:, 0].argsort(), 1:] for _, table in tables)])
    load = np.interp(time, np.arange(len(factors) + 1), [0.0, *factors])
    return LoadPath(load, u, bool(time[-1] > len(factors) - 1e-6))


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


def _run(text: list[str], seconds: float) -> tuple[str, str]:
    """What CalculiX says and its .dat file, of an .inp file."""
    with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
        (Path(folder) / "solid.inp").write_text("".join(text), encoding="ascii")
        try:
            done = subprocess.run(
                [require_ccx(), "solid"], cwd=folder, capture_output=True, text=True, timeout=seconds, check=False
            )
        except subprocess.TimeoutExpired:
            raise StaticsError(
                f"CalculiX did not come to an end within {seconds / 60:.0f} minutes; make the mesh coarser "
                "(surface.edge), or give it more: --minutes"
            ) from None
        result = Path(folder) / "solid.dat"
        return done.stdout, result.read_text(encoding="ascii") if result.exists() else ""


def _tables(data: str) -> list[tuple[float, Floats]]:
    """The time of each table of displacements, and (k, 4) numbers of nodes with their displacements."""
    heads = list(TABLE.finditer(data))
    found = []
    for head, following in zip(heads, [*heads[1:], None], strict=True):
        lines = data[head.end() : following.start() if following else None].strip().splitlines()
        table = [line.split() for line in lines]
        numbers = [[float(word) for word in words] for words in table if len(words) == 4 and words[0].isdigit()]
        found.append((float(head[1]), np.array(numbers)))
    return found


def _rows(template: str, *columns: Ints | Floats) -> Iterator[str]:
    """`template % row` for every row of the columns."""
    yield "".join(template % row for row in zip(*(column.tolist() for column in columns), strict=True))
