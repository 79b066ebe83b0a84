"""Closed curves out of DXF and 3DM files, as polygons: what an architect draws to say where something is."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats
from dsfab.errors import SurfaceError, did_you_mean
from dsfab.surface.formats.apart import read_rhino_apart
from dsfab.surface.formats.curves import LARGEST, Drawing, DrawingBudget
from dsfab.surface.formats.dxf import read_dxf
from dsfab.surface.formats.guard import readable
from dsfab.units import METRES_PER, metres_per

CLOSE = 1e-6
"""Ends of curves that are nearer than this share of the drawing's size are at one place."""
LAYERS_TOLD = 12
"""Layers of a file that are listed where the one that was asked for is not among them."""


@dataclass(frozen=True, eq=False)
class Marks:
    """What is drawn on a layer: its name as in the file, points (k, 3) and curves (k, 3), metres."""

    layer: str
    points: Floats
    curves: tuple[Floats, ...]

    def about(self, origin: Sequence[float]) -> "Marks":
        """The same with this point, metres, as the origin."""
        return Marks(self.layer, self.points - origin, tuple(run - origin for run in self.curves))

    @property
    def closed(self) -> list[Floats]:
        """The curves that end where they begin."""
        return [run for run in self.curves if _ends_meet(run)]

    @property
    def open(self) -> list[Floats]:
        """The others."""
        return [run for run in self.curves if not _ends_meet(run)]


def _ends_meet(run: Floats) -> bool:
    size = float(np.linalg.norm(np.ptp(run, axis=0)))
    return len(run) > 3 and float(np.linalg.norm(run[0] - run[-1])) <= CLOSE * size


_READERS = {".dxf": read_dxf, ".3dm": read_rhino_apart}


def closed_curves(path: Path, layer: str | None, unit: str | None) -> tuple[Floats, ...]:
    """The closed curves (k, 3) of a drawing, metres: of one layer, or of all. Lines and arcs that meet end to end are
    one curve.

    unit : of the file's numbers; left out, what the file says.

    Raises SurfaceError for a file or a layer that is not there, one without closed curves, curves that are open, a
    file that does not say its unit, and one that is larger than a drawing of outlines (`DrawingBudget`).
    """
    path = Path(path)
    if path.suffix.lower() not in _READERS:
        raise SurfaceError(f"{path} is no drawing that dsfab reads; give a .dxf or a .3dm file")
    try:
        about = path.stat()
    except OSError as error:
        raise SurfaceError(f"the drawing {path} cannot be read: {error.strerror}") from None
    return _read_once(path, layer, unit, about.st_mtime_ns, about.st_size)


def marks_on_layers(path: Path, words: Iterable[str], metres: float) -> dict[str, Marks]:
    """What is drawn on the layers of these names, in capitals or not, by name; only those with something on them.

    metres : in one unit of the file's numbers. Raises SurfaceError for a file that cannot be read, as `closed_curves`.
    """
    path = Path(path)
    drawing = _drawing(path, path.stat().st_size, DrawingBudget())
    found = {}
    for word in words:
        points = [metres * place for layer, place in drawing.points if layer.lower() == word]
        curves = [metres * run for layer, run in drawing.runs if layer.lower() == word and len(run) > 1]
        layer = next((one for one in drawing.layers if one.lower() == word), word)
        if points or curves:
            found[word] = Marks(layer, np.concatenate(points) if points else np.empty((0, 3)), tuple(curves))
    return found


@lru_cache(maxsize=16)
def _read_once(path: Path, layer: str | None, unit: str | None, _changed: int, size: int) -> tuple[Floats, ...]:
    """The curves of a file as it is now: pickers ask for them again and again."""
    budget = DrawingBudget()
    drawing = _drawing(path, size, budget)
    if layer is not None and layer not in drawing.layers:
        told = ", ".join(drawing.layers[:LAYERS_TOLD]) + (", ..." if len(drawing.layers) > LAYERS_TOLD else "")
        raise SurfaceError(
            f"{path} has no layer {layer!r}{did_you_mean(layer, drawing.layers)}; its layers are: {told}"
        )
    if unit is None and drawing.unit is None:
        raise SurfaceError(f'{path} does not say its unit; give unit = "mm", or one of {", ".join(METRES_PER)}')
    where = f"{path}" + (f", layer {layer!r}," if layer is not None else "")
    found = [run for name, run in drawing.runs if layer in (None, name) and len(run) > 1]
    if not found:
        raise SurfaceError(
            f"{where} has no curve; draw a closed one, as polyline, circle, ellipse, spline, lines or arcs"
        )
    if not all((np.abs(run) < LARGEST).all() for run in found):
        raise SurfaceError(f"{where} has a curve with a point that is none, or beyond all drawings; draw it again")
    metres = metres_per(unit or drawing.unit or "m")
    return tuple(metres * loop for loop in _loops(found, where, budget))


def _drawing(path: Path, size: int, budget: DrawingBudget) -> Drawing:
    """What a file of `size` bytes draws; raises SurfaceError for one that cannot be read, and beyond the budget."""
    with readable(path, "draw less into it", "it is damaged"):
        budget.require("bytes", size)
        return _READERS[path.suffix.lower()](path, budget)


def _loops(runs: list[Floats], where: str, budget: DrawingBudget) -> Iterator[Floats]:
    """Runs joined where their ends meet, the first of the file first: the closed curves, without their last point,
    which is the first.

    Raises SurfaceError for what stays open.
    """
    corners = np.concatenate([[run.min(axis=0), run.max(axis=0)] for run in runs])
    close = CLOSE * float(np.linalg.norm(np.ptp(corners, axis=0)))
    ends = cKDTree(np.concatenate([[run[0], run[-1]] for run in runs]))  # 2 k is where run k begins, 2 k + 1 its end
    free = np.ones(len(runs), dtype=bool)
    for first in range(len(runs)):
        if not free[first]:
            continue
        free[first], chain = False, [runs[first]]
        while np.linalg.norm(chain[0][0] - chain[-1][-1]) > close or (len(chain) == 1 and len(chain[0]) < 3):
            budget.require_time()
            near = (end for end in sorted(ends.query_ball_point(chain[-1][-1], close)) if free[end // 2])
            if (end := next(near, None)) is None:
                raise SurfaceError(_open(np.concatenate(chain), where))
            free[end // 2] = False
            chain.append(runs[end // 2][::-1] if end % 2 else runs[end // 2])
        whole = np.concatenate([chain[0], *(run[1:] for run in chain[1:])])
        yield whole[:-1]


def _open(run: Floats, where: str) -> str:
    ends = " and ".join(f"({', '.join(f'{x:.6g}' for x in end)})" for end in (run[0], run[-1]))
    gap = float(np.linalg.norm(run[0] - run[-1]))
    return (
        f"{where} has a curve that is open: its ends at {ends} are {gap:.3g} apart, in the file's unit; close it, or "
        "name the layer of the closed ones"
    )
