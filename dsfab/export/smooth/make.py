"""The ladder of smooth STEP: build, ask OCCT about every piece, refit what it refuses, give up what stays refused.

    charts found, skins fitted -> all pieces built -> file -> `check` -> refused pieces: their crossing edges tighter
         ^                                                                |  still refused
         '---------------- another layout of charts ---------------------'-> faceted, piece by piece

A piece is accepted when its solid, read back, is valid, closed, becomes triangles, has the faces that were written and
the volume of the mesh, and no gap is wider than a twentieth of the thickness. BRepCheck's word alone is not enough:
it calls edges valid within whatever tolerance they have.
"""

import json
import subprocess
import tempfile
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Bools, Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.part import Part
from dsfab.export.planar import Polyhedron, polyhedron
from dsfab.export.plate_text import Entities
from dsfab.export.program import ProgramError, last_line
from dsfab.export.shells import solids_of
from dsfab.export.smooth import check
from dsfab.export.smooth.charts import charts_of, excess
from dsfab.export.smooth.layout import layout
from dsfab.export.smooth.outline import Sheet, sheet_of
from dsfab.export.smooth.solid import Builder, Key, Model, Piece
from dsfab.export.smooth.text import SmoothText
from dsfab.export.step_pieces import closing
from dsfab.export.step_text import header, planar_faces
from dsfab.surface.mesh import Surface
from dsfab.surface.topology import boundary_loops, edge_table
from dsfab.units import MM_PER_M

GAP = 1 / 20
"""Widest gap between a skin and the edges on it, as a share of the thickness."""

FIT = 1 / 40
"""Tolerance of the skins, as a share of the thickness."""

VOLUME = 5e-3
"""Largest change of a volume, beside what the smooth surface has more than the triangles between its points."""

LAYOUTS = ((68.0, 1, 0), (58.0, 1, 0), (52.0, 8, 1), (45.0, 12, 2))
"""Degrees that a chart's normals may lean, charts at least, and where their seeds begin."""

LOOPS = 40
"""Outlines in a chart, about: opening, checking and measuring a face take OCCT their number squared."""

MOST_INSPECTED = 6000
"""After so many faces were read back, a minute or two, no further layout is tried."""

REFITS = 3
"""How often the refused pieces of a layout are built tighter."""

SKINS = "curved solid with spline skins"
"""What the file says about itself."""

SECONDS = 60
SECONDS_PER_FACE = 0.05
"""Time for a check, several times what was measured; it may not end."""


@dataclass(frozen=True, eq=False)
class Made:
    """The smooth pieces of a part and the text of the file.

    pieces  : of the sheet; smooth counts those that were accepted.
    gap     : widest among these, millimetres; off : largest distance of a skin from the mesh's vertices.
    volume  : of all solids, as OCCT finds it, cubic millimetres.
    refused : why others were not, or ''.
    """

    text: str
    pieces: int
    smooth: int
    faces: int
    gap: float
    off: float
    volume: float
    refused: str

    @property
    def told(self) -> str:
        """How the file was made."""
        some = "" if self.smooth == self.pieces else f"{self.smooth} of {self.pieces} pieces, the rest faceted, "
        why = f" ({self.refused})" if self.refused else ""
        return f"{some}its skins within {self.off:.2g} mm of the vertices, gaps under {self.gap:.2g} mm{why}"


class _Tried(NamedTuple):
    """The pieces of a layout: which were accepted, with what volume, and why the first of the others was not."""

    sheet: Sheet
    model: Model
    accepted: Bools
    reason: str
    volume: float


_MADE: WeakKeyDictionary[Part, Made] = WeakKeyDictionary()


def made(part: Part) -> Made:
    """The smooth file of a part, made once; raises ExportError with the reason where no piece can be smooth."""
    if part not in _MADE:
        _MADE[part] = _Ladder(part).made()
    return _MADE[part]


def drafted(part: Part) -> tuple[int, int]:
    """Faces and bytes of a part's first smooth file, which nobody has checked; ExportError where none can be made."""
    ladder = _Ladder(part)
    lean, fewest, start = ladder.layouts[0]
    model = ladder.built(np.deg2rad(lean), max(fewest, ladder.enough), start)[2]
    which = [k for k, piece in enumerate(model.pieces) if not piece.refused]
    return sum(model.pieces[k].faces for k in which), len(ladder.text(model, which))


class _Ladder:
    def __init__(self, part: Part) -> None:
        if part.curved is None:
            raise ExportError("smooth STEP needs the sheet, and only its solid is known")
        self.part, self.curved = part, part.curved()
        self.surface = Surface(self.curved.V, self.curved.F)
        self.t = 2 * MM_PER_M * float(np.median(np.linalg.norm(self.curved.D, axis=1)))
        self.tolerance = part.tolerance or FIT * self.t
        self.inspected = 0
        self.rounder = excess(self.surface)
        self.asked: tuple[list[int], str] = ([], "")

    def made(self) -> Made:
        """The best of the layouts: the first one without a refused piece."""
        best: _Tried | None = None
        reason = ""
        for lean, fewest, start in self.layouts:
            try:
                tried = self._tried(np.deg2rad(lean), max(fewest, self.enough), start)
            except ExportError as error:
                reason = reason or str(error)
                continue
            reason = tried.reason or reason
            if best is None or tried.accepted.sum() > best.accepted.sum():
                best = tried
            if best.accepted.all() or self.inspected > MOST_INSPECTED:
                break
        if best is None or not best.accepted.any():
            raise ExportError(f"{reason}; write step = 'faceted'")
        return self._file(best)

    @property
    def layouts(self) -> tuple[tuple[float, int, int], ...]:
        """The first one is for open sheets only: on a closed surface its charts become too flat, and fits fail."""
        return LAYOUTS if self.surface.edges.boundary.any() else LAYOUTS[1:]

    @cached_property
    def enough(self) -> int:
        """Charts for all outlines of the sheet."""
        F = self.curved.divided(np.ones((self.surface.n, 1))).F
        return len(boundary_loops(F, edge_table(F))) // LOOPS + 1

    def built(self, cone: float, fewest: int, start: int) -> tuple[Sheet, Builder, Model]:
        """All pieces in a layout of charts."""
        fields = layout(self.surface, cone, fewest, start)
        charts = charts_of(self.surface, self.curved, fields, self.tolerance)
        sheet = sheet_of(self.curved.divided(fields), self.curved.shift)
        builder = Builder(sheet, charts, self.t)
        return sheet, builder, Model(charts, builder.nodes, [builder.piece(k, {}) for k in range(sheet.count)], self.t)

    def _tried(self, cone: float, fewest: int, start: int) -> _Tried:
        """A layout, its pieces refitted where refused; which were accepted, and why the others were not."""
        sheet, builder, model = self.built(cone, fewest, start)
        levels = [dict[Key, int]() for _ in range(sheet.count)]
        wanted = self._volumes(sheet)
        measured = np.zeros(sheet.count)
        accepted, reasons = np.zeros(sheet.count, dtype=bool), [""] * sheet.count
        todo = list(range(sheet.count))
        for turn in range(REFITS + 1):
            found = self._asked(model, [k for k in todo if not model.pieces[k].refused])
            for k in todo:
                reasons[k] = self._reason(model.pieces[k], found.get(k), wanted[k])
                accepted[k] = not reasons[k]
                measured[k] = found[k]["volume"] if k in found else 0.0
            todo = [k for k in todo if not accepted[k] and k in found and (found[k]["bad"] or not self._fine(found[k]))]
            if not todo or turn == REFITS or self.inspected > MOST_INSPECTED:
                break
            for k in todo:
                _tighten(model, k, levels[k], np.array(found[k]["bad"]).reshape(-1, 3))
                model.pieces[k] = builder.piece(k, levels[k])
        reason = next((r for r in reasons if r), "")
        return _Tried(sheet, model, accepted, reason, float(measured[accepted].sum()))

    def _volumes(self, sheet: Sheet) -> Floats:
        """Millimetres cubed of the mesh solid of each piece: the sum over its faces of the prisms between the skins."""
        low, high = ((sheet.V + side * sheet.D)[sheet.F] for side in (-1, 1))
        d = sheet.D[sheet.F]
        total = np.zeros(len(sheet.F))
        for s, weight in ((-np.sqrt(0.6), 5 / 9), (0.0, 8 / 9), (np.sqrt(0.6), 5 / 9)):  # cubic in s: exact
            P = (low + high) / 2 + s * d
            cross = np.cross(P[:, 1] - P[:, 0], P[:, 2] - P[:, 0])
            total += weight * np.einsum("mi,mi->m", cross, d.mean(axis=1)) / 2
        return np.asarray(np.bincount(sheet.piece, total, sheet.count), dtype=np.float64)

    def _reason(self, piece: Piece, found: dict[str, Any] | None, wanted: float) -> str:
        """Why a piece is refused; '' when it is accepted."""
        if piece.refused:
            return piece.refused
        if found is None:
            return "OCCT did not read it within the time limit"
        gap = max(piece.gap, found["gap"])
        tests = (
            (found["valid"] and found["closed"], "OCCT finds it invalid"),
            (found["faces"] == piece.faces, f"OCCT reads {found['faces']} faces instead of {piece.faces}"),
            (found["tessellates"], "OCCT makes no triangles of a face"),
            (gap <= GAP * self.t, f"a gap of {gap:.2g} mm is wider than {GAP * self.t:.2g} mm"),
            (
                abs(found["volume"] - wanted) <= (VOLUME + self.rounder) * wanted,
                f"its volume is off by {found['volume'] / wanted - 1:.1%}",
            ),
        )
        return next((text for good, text in tests if not good), "")

    def _fine(self, found: dict[str, Any]) -> bool:
        """Whether tighter curves cannot make a refused piece better."""
        return bool(found["valid"] and found["tessellates"] and found["gap"] <= GAP * self.t)

    def _asked(self, model: Model, which: list[int]) -> dict[int, dict[str, Any]]:
        """What OCCT finds in the pieces, by piece; nothing when it does not end in time."""
        if not which:
            return {}
        text = self.text(model, which)
        limit = SECONDS + SECONDS_PER_FACE * sum(model.pieces[k].faces for k in which)
        self.asked = (which, text)
        self.inspected += sum(model.pieces[k].faces for k in which)
        with tempfile.TemporaryDirectory(prefix="dsfab-") as folder:
            path = Path(folder) / "a.step"
            path.write_text(text, encoding="ascii")
            found = answers(path, limit)
        return dict(zip(which, found, strict=True)) if len(found) == len(which) else {}

    def text(self, model: Model, which: list[int], rest: Ints | None = None) -> str:
        """The file of some pieces, and of the triangles `rest` (k, 3) of the part as planar faces."""
        new = Entities()
        writer, faces, shells = SmoothText(new, model), list[int](), list[int]()
        for i, k in enumerate(which):
            added = writer.piece(model.pieces[k])
            faces += added
            shells += [i] * len(added)
        name = self.part.name
        solids = [[i] for i in range(len(which))]
        if rest is None or not len(rest):
            head = header(name, SKINS, len(solids))
            return "".join([head, *new.text, *closing(np.array(shells), solids, np.array(faces), new.free, name)])
        shape, others = _planar(self.part, rest)
        texts, numbers, free = planar_faces(shape, new.free)
        solids += [[i + len(which) for i in one] for one in others]
        end = closing(np.r_[shells, shape.shell + len(which)], solids, np.r_[faces, numbers], free, name)
        return "".join([header(name, SKINS, len(solids)), *new.text, *texts, *end])

    def _rest(self, sheet: Sheet, accepted: Bools) -> Ints:
        """The triangles of the part that belong to pieces which were not accepted."""
        shell, solids = solids_of(self.part)
        first = sheet.F[np.unique(sheet.piece, return_index=True)[1], 0]
        nearest = np.asarray(cKDTree(self.part.V).query((sheet.V + sheet.D)[first])[1])
        at = np.full(len(self.part.V), -1)
        at[self.part.F] = shell[:, None]
        smooth = set(at[nearest[accepted]].tolist())
        kept = [i for one in solids for i in one if not smooth & set(one)]
        return np.asarray(self.part.F[np.isin(shell, kept)])

    def _file(self, best: _Tried) -> Made:
        model, accepted = best.model, best.accepted
        which = np.flatnonzero(accepted).tolist()
        rest = None if accepted.all() else self._rest(best.sheet, accepted)
        whole = rest is None and self.asked[0] == which
        text = self.asked[1] if whole else self.text(model, which, rest)
        return Made(
            text=text,
            pieces=len(accepted),
            smooth=len(which),
            faces=text.count("=ADVANCED_FACE("),
            gap=max(model.pieces[k].gap for k in which),
            off=max(chart.off for chart in model.charts),
            volume=best.volume,
            refused=best.reason,
        )


def _planar(part: Part, F: Ints) -> tuple[Polyhedron, list[list[int]]]:
    """Triangles of a part as planar faces, and the shells of their solids."""
    some = replace(part, F=F)
    shell, solids = solids_of(some)
    inward = np.isin(shell, [i for _, *inner in solids for i in inner])
    return polyhedron(some.V, np.where(inward[:, None], F[:, ::-1], F), shell), solids


def _tighten(model: Model, k: int, level: dict[Key, int], bad: Floats) -> None:
    """Raise the level of the runs that end where `bad` points are; of all when none is known."""
    piece = model.pieces[k]
    ends = np.array([model.nodes.at[v] for edge in piece.edges for v in (edge.start, edge.end)])
    hit = np.ones(len(piece.edges), dtype=bool)
    if len(bad):
        vertices = np.array([(edge.start, edge.end) for edge in piece.edges])
        away = np.linalg.norm(ends[None, :, :, :] - bad[:, None, None, :], axis=3).min(axis=2)
        nearest = vertices.ravel()[away.argmin(axis=1)]
        hit = np.asarray(np.isin(vertices, nearest).any(axis=1))
    for i in np.flatnonzero(hit):
        level[piece.keys[i]] = min(2, level.get(piece.keys[i], 0) + 1)


def answers(path: Path, limit: float) -> list[dict[str, Any]]:
    """What `check` says about each solid of a file; nothing when it takes longer than `limit` seconds, or fails."""
    try:
        return list(json.loads(last_line(check.__file__, str(path), seconds=limit))["solids"])
    except (subprocess.TimeoutExpired, ProgramError):
        return []
