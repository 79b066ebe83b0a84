"""What is judged: a sheet, what it is made of, and what holds and loads it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, eye_array

from dsfab.errors import StaticsError
from dsfab.pipeline import held_vertices, sheet_loads
from dsfab.pipeline.design import Design
from dsfab.slicing import Sheet
from dsfab.statics import SheetMaterial, flat_axis
from dsfab.statics.mechanisms import require_held
from dsfab.statics.supports import all_clamped
from dsfab.surface import LoadCase, Surface, pieces


@dataclass(frozen=True, eq=False)
class LoadedSurface:
    """All that competitors share: the uncut surface, what the sheet is made of, and the loads on the uncut surface by
    case, with the same supports in each."""

    surface: Surface
    made: SheetMaterial
    loads: Mapping[str, LoadCase]

    @classmethod
    def of(cls, design: Design, share: float = 1.0) -> "LoadedSurface":
        """That of a design, its cases and combinations, with `share` of its thickness."""
        statics = design.preset.statics
        made, surface = statics.sheet(share * statics.thickness), design.surface
        loads = {name: case.load.of_thickness(surface, share) for name, case in design.statics.cases.items()}
        return cls(surface, made, loads)


class Dropped(NamedTuple):
    """A piece of material that reaches no support: its area, m2, and a point in it, metres."""

    area: float
    place: tuple[float, float, float]


def whole_sheet(surface: Surface) -> Sheet:
    """The uncut surface as a sheet of itself, for judging what has no openings."""
    n, m = surface.n, surface.m
    return Sheet(surface, np.arange(m), np.zeros(m, dtype=np.int64), csr_array(eye_array(n)))


def attached_material(
    setting: LoadedSurface, material: Sheet
) -> tuple[Sheet, tuple[Dropped, ...], dict[str, LoadCase]]:
    """What of the material reaches a support over edges, what does not (largest first), and the loads on what does.

    Raises StaticsError when nothing is held, when a load stands on a piece that is not or finds no material, and when
    the supports leave a motion free.
    """
    s, load = material.surface, next(iter(setting.loads.values()))
    count, label = pieces(s.F, s.edges)
    area = np.bincount(label, s.areas, count)
    reach = np.bincount(label, held_vertices(setting.surface, material, load)[s.F].any(axis=1), count) > 0
    if not reach.any():
        raise StaticsError("no piece of material reaches a support; set pattern.keep to protect the supports")
    loose = sorted(np.flatnonzero(~reach).tolist(), key=lambda k: -area[k])
    dropped = []
    for k in loose:
        x, y, z = s.centroids[int((label == k).argmax())].tolist()
        dropped.append(Dropped(float(area[k]), (x, y, z)))
    sheet = material.kept(reach[label]) if loose else material
    loads = sheet_loads(setting.surface, material, sheet, setting.loads)
    _require_held(sheet.surface, loads)
    return sheet, tuple(dropped), loads


def _require_held(surface: Surface, loads: Mapping[str, LoadCase]) -> None:
    """Raise StaticsError for a sheet that can move without deforming."""
    load, axis = next(iter(loads.values())), flat_axis(surface, *loads.values())
    fixed = load.fixed.copy()
    if axis is not None:
        fixed[:, axis] = True
    require_held(surface, load, fixed, all_clamped(load))
