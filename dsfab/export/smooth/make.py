"""The ladder of smooth STEP: build, ask OCCT about every piece, refit what it refuses, give up what stays refused.

charts found, skins fitted -> all pieces built -> file -> `check` -> `gate` -> refused pieces: tighter curves there
 ^                                                                |  still refused
 '------------- another layout of charts, for these only ---------'-> faceted, piece by piece
"""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats, Ints
from dsfab.errors import ExportError
from dsfab.export.budget import BudgetError, within
from dsfab.export.part import Part
from dsfab.export.program import Ahead
from dsfab.export.smooth.ask import Finding, findings, occt
from dsfab.export.smooth.charts import Atlas
from dsfab.export.smooth.edges import Allowed
from dsfab.export.smooth.file import Made, file_text, rest_of
from dsfab.export.smooth.gate import Gate, Verdict
from dsfab.export.smooth.layout import layout
from dsfab.export.smooth.limits import limits_of
from dsfab.export.smooth.outline import WALL, Sheet, sheet_of
from dsfab.export.smooth.seams import Key
from dsfab.export.smooth.solid import Builder, Model, Piece
from dsfab.sparse.threads import one_blas_thread
from dsfab.surface.mesh import Surface
from dsfab.units import MM_PER_M

FIT = 1 / 3
"""Tolerance of the skins, as a share of the distance that is allowed."""

LAYOUTS = ((68.0, 1, 0), (58.0, 1, 0), (52.0, 8, 1), (45.0, 12, 2), (40.0, 24, 3))
"""Degrees that a chart's normals may lean, charts at least, and where their seeds begin."""

LOOPS = 40
"""Outlines in a chart, about: opening, checking and measuring a face take OCCT their number squared."""

MOST_INSPECTED = 6000
"""After so many faces were read back, a minute or two, no further layout is tried."""

MOST_WALLS = 1500
"""Walls of a sheet that is to be made in a hurry: about ten seconds. Nor are more faces read back twice."""

REFITS = 2
"""How often the refused pieces of a layout are built tighter."""

DEFLECTION = 1 / 4
"""Of the triangles by which a piece is compared with the mesh, as a share of the distance that is allowed."""

SECONDS = 60
SECONDS_PER_FACE = 0.05
"""Time for a check, several times what was measured; it may not end."""


class _Taken(NamedTuple):
    """A piece that was accepted: the layout it is in, its number there, and its verdict."""

    model: Model
    number: int
    verdict: Verdict


_MADE: WeakKeyDictionary[Part, Made] = WeakKeyDictionary()


def made(part: Part) -> Made:
    """The smooth file of a part, made once; raises ExportError with the reason where no piece can be smooth."""
    if part not in _MADE:
        _MADE[part] = _Ladder(part).made()
    return _MADE[part]


def drafted(part: Part) -> tuple[int, int]:
    """Faces and bytes of a part's first smooth file, which nobody has checked; ExportError where none can be made."""
    ladder = _Ladder(part)
    with one_blas_thread():
        model = ladder.built(next(ladder.layouts()))[2]
    which = [k for k, piece in enumerate(model.pieces) if not piece.refused]
    if not which:
        raise ExportError(model.pieces[0].refused)
    return sum(model.pieces[k].faces for k in which), len(file_text(part, [(model, k) for k in which]))


class _Ladder:
    def __init__(self, part: Part) -> None:
        if part.curved is None:
            raise ExportError("smooth STEP needs the sheet, and only its solid is known")
        self.part, self.curved = part, part.curved()
        self.surface = Surface(self.curved.V, self.curved.F)
        self.limits = limits_of(part, self.surface, self.curved)
        t, distance = self.limits.thickness, self.limits.distance
        self.allowed = Allowed(t, distance, float(np.median(self.limits.chord)))
        self.inspected, self.most = 0, MOST_WALLS if part.hurry else MOST_INSPECTED
        self.taken, self.reason, self.pieces = list[_Taken](), "", 0
        self.left: Ints = part.F
        self.done = set[int]()
        self.asked, self.text = list[tuple[Model, int]](), ""
        if part.hurry:
            self._ask_walls()

    def made(self) -> Made:
        """Each solid in the first layout that has all its pieces accepted; those of other solids may be in others."""
        for fields in self.layouts():
            try:
                self._try(fields)
            except BudgetError:
                raise
            except ExportError as error:
                self.reason = self.reason or str(error)
                continue
            if not len(self.left) or self.inspected > self.most or self.part.hurry:
                break
        if not self.taken:
            raise ExportError(f"{self.reason}; write step = 'faceted'")
        return self._file()

    def layouts(self) -> Iterator[Floats]:
        """Fields (n, c) of one layout after another, each once: chart k is where field k is largest.

        The first one is for open sheets only: on a closed surface its charts become too flat, and fits fail.
        """
        some = LAYOUTS if self.surface.edges.boundary.any() else LAYOUTS[1:]
        known = set[bytes]()
        for lean, fewest, start in some:
            fields = layout(self.surface, float(np.deg2rad(lean)), max(fewest, self.enough), start)
            chart = fields.argmax(axis=1).tobytes()
            if chart not in known:
                yield fields
            known.add(chart)

    @cached_property
    def whole(self) -> Sheet:
        """The sheet in one chart."""
        return sheet_of(self.curved.divided(np.ones((self.surface.n, 1))), self.curved.shift)

    @property
    def enough(self) -> int:
        """Charts for all outlines of the sheet."""
        return sum(len(region.loops) for region in self.whole.regions) // LOOPS + 1

    def _ask_walls(self) -> None:
        """Raise ExportError where a sheet has too many walls for a hurry."""
        count = sum(run.beyond == WALL for region in self.whole.regions for loop in region.loops for run in loop)
        if count > MOST_WALLS:
            raise ExportError(
                f"its smooth solid would have {count} walls, more than {MOST_WALLS}, which take too long to be made "
                "unasked; ask for step = 'smooth'"
            )

    def built(self, fields: Floats) -> tuple[Gate, Builder, Model]:
        """The pieces of solids that are not done yet in a layout of charts."""
        atlas = Atlas(self.surface, self.curved, fields, FIT * self.limits.distance)
        atlas.make(np.unique(fields.argmax(axis=1)[self._near()]))
        sheet = sheet_of(self.curved.divided(atlas.fields), self.curved.shift)
        gate = Gate(self.part, sheet, self.limits)
        asked = self._asked(gate)
        atlas.make(np.unique(sheet.chart[np.isin(sheet.piece, asked)]), halve=False)
        why = {k: text for chart, text in atlas.failed.items() for k in np.unique(sheet.piece[sheet.chart == chart])}
        ready = [k for k in asked if k not in why]
        regions = tuple(region for region in sheet.regions if region.piece in ready)
        builder = Builder(replace(sheet, regions=regions), atlas.charts, self.allowed)
        pieces = [
            builder.piece(k, {}) if k in ready else Piece(refused=why.get(k, "it is done")) for k in range(sheet.count)
        ]
        return gate, builder, Model(atlas.charts, builder.nodes, pieces, self.limits.thickness)

    def _asked(self, gate: Gate) -> list[int]:
        """The pieces of solids that are not done yet."""
        return [k for k in range(gate.sheet.count) if int(gate.solid[k]) not in self.done]

    def _near(self) -> Ints:
        """Vertices of the surface on faces that the pieces of such solids may touch."""
        mine = np.isin(self.whole.piece, self._asked(Gate(self.part, self.whole, self.limits)))
        points = self.whole.V[np.unique(self.whole.F[mine])]
        marks = np.zeros(self.surface.n, dtype=bool)
        marks[cKDTree(MM_PER_M * self.surface.V).query(points)[1]] = True
        return np.unique(self.surface.F[marks[self.surface.F].any(axis=1)])

    def _try(self, fields: Floats) -> None:
        """A layout: its pieces of solids that are not done yet, refitted where they are refused."""
        with ExitStack() as programs:
            self._judged(programs, fields)

    def _judged(self, programs: ExitStack, fields: Floats) -> None:
        program = programs.enter_context(occt())
        with one_blas_thread():  # bands of a hundred: on two busy cores, threads took ten times as long
            gate, builder, model = self.built(fields)
        asked, levels = self._asked(gate), [dict[Key, int]() for _ in model.pieces]
        verdicts, todo = dict[int, Verdict](), asked
        for turn in range(REFITS + 1):
            ready = [k for k in todo if not model.pieces[k].refused]
            verdicts |= gate.verdicts({k: model.pieces[k] for k in todo}, self._found(program, model, ready))
            todo = [k for k in todo if len(verdicts[k].bad) and _tighten(model, k, levels[k], verdicts[k].bad)]
            if not todo or turn == REFITS or self.inspected > self.most:
                break
            program = programs.enter_context(occt())
            for k in todo:
                model.pieces[k] = builder.piece(k, levels[k])
        refused = {int(gate.solid[k]) for k in asked if verdicts[k].reason}
        taken = [k for k in asked if int(gate.solid[k]) not in refused]
        self.taken += [_Taken(model, k, verdicts[k]) for k in taken]
        self.done |= {int(gate.solid[k]) for k in taken}
        self.reason = next((verdicts[k].reason for k in asked if verdicts[k].reason), "")
        self.left, self.pieces = gate.without(self.done), len(model.pieces)

    def _found(self, program: Ahead, model: Model, which: list[int]) -> dict[int, Finding]:
        """What OCCT finds in the pieces, by piece; nothing when it does not end in time."""
        count = sum(model.pieces[k].faces for k in which)
        self.inspected += count
        self.asked = [(model, k) for k in which]
        self.text = file_text(self.part, self.asked)
        within(self.part, count, len(self.text))
        seconds = SECONDS + SECONDS_PER_FACE * count
        found = findings(program, self.text, DEFLECTION * self.limits.distance, seconds) if which else []
        return dict(zip(which, found, strict=True)) if len(found) == len(which) else {}

    def _file(self) -> Made:
        rest = rest_of(self.part, self.left) if len(self.left) else None
        taken = [(model, k) for model, k, _ in self.taken]
        text = self.text if rest is None and taken == self.asked else file_text(self.part, taken, rest)
        return Made(
            text=text,
            pieces=self.pieces,
            smooth=len(self.taken),
            faces=text.count("=ADVANCED_FACE("),
            gap=max(model.pieces[k].gap for model, k, _ in self.taken),
            there=max(verdict.there for _, _, verdict in self.taken),
            back=max(verdict.back for _, _, verdict in self.taken),
            limits=self.limits,
            volume=sum(verdict.volume for _, _, verdict in self.taken),
            refused=self.reason if len(self.left) else "",
        )


def _tighten(model: Model, k: int, level: dict[Key, int], bad: Floats) -> bool:
    """Raise the level of the runs nearest to the `bad` points; whether there was one to raise."""
    piece = model.pieces[k]
    x = np.linspace(0, 1, 9)
    samples = np.concatenate([curve(x) for edge in piece.edges for curve in (edge.upper, edge.lower)])
    tree = cKDTree(samples)
    reach = np.atleast_1d(tree.query(bad)[0]) + 1e-3 * model.thickness
    hit = {i // (2 * len(x)) for point, r in zip(bad, reach, strict=True) for i in tree.query_ball_point(point, r)}
    keys = {piece.keys[i] for i in hit if level.get(piece.keys[i], 0) < 2}
    level |= {key: level.get(key, 0) + 1 for key in keys}
    return bool(keys)
