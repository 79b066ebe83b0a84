"""The points of a sweep: what each run changes, in the order of their numbers."""

import csv
import hashlib
import json
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from dsfab.arrays import Floats
from dsfab.errors import PresetError
from dsfab.preset import Preset
from dsfab.preset_file import overridden, parse_override
from dsfab.study.sweeps.plan import Plan
from dsfab.study.sweeps.values import Axis

Changes = dict[str, Any]

MOST = 1_000_000
"""More runs than this are a mistake in the grid."""

TRIED = 5000
"""As many runs are checked before anything is built: a mistake in a key shows in the first."""


def points(plan: Plan) -> list[Changes]:
    """What each run changes, each once. Raises PresetError for grids beyond `MOST` and CSV files that cannot be read.

    sobol : Sobol points, scrambled by the seed; the first N of more are the same N, so a sweep can be extended.
    lhs   : a Latin hypercube [McKay, Beckman, Conover 1979]; another N gives other points.
    """
    kind, _, rest = plan.sampling.partition(":")
    if kind == "csv":
        found: Iterator[Changes] = from_csv(Path(rest))
    elif kind == "grid":
        found = _grid(plan.axes)
    else:
        found = (point_on_axes(plan.axes, u) for u in _unit(kind, int(rest), len(plan.axes), plan.seed))
    return list({digest(changes): changes for changes in found}.values())


def digest(changes: Mapping[str, Any]) -> str:
    """A text that tells runs apart by what they change."""
    return hashlib.sha256(json.dumps(changes, sort_keys=True, default=str).encode()).hexdigest()[:20]


def point_on_axes(axes: list[Axis], u: Floats) -> Changes:
    """The point at u (k,) in 0..1 along each axis."""
    changes: Changes = {}
    for axis, place in zip(axes, u, strict=True):
        changes.update(axis.at(float(place)))
    return changes


def trials(plan: Plan) -> list[Changes]:
    """Points that show what is wrong with the keys and values of a search: each axis from end to end."""
    middle = np.full(len(plan.axes), 0.5)
    found = []
    for i, axis in enumerate(plan.axes):
        for u in np.linspace(0, 1, max(len(axis.rows), 3)):
            place = middle.copy()
            place[i] = u
            found.append(point_on_axes(plan.axes, place))
    return found


def check_points(preset: Preset, found: list[Changes]) -> None:
    """Raise PresetError, before anything is built, for keys and values that presets do not allow: each mistake once."""
    wrong: dict[str, None] = {}
    for changes in found[:TRIED]:
        try:
            overridden(preset, changes)
        except PresetError as error:
            wrong.setdefault(str(error))
    if wrong:
        shown = list(wrong)[:3]
        more = f" (and {len(wrong) - len(shown)} more mistakes)" if len(wrong) > len(shown) else ""
        raise PresetError("; ".join(shown) + more)


def _grid(axes: list[Axis]) -> Iterator[Changes]:
    listed = [axis.listed() for axis in axes]
    total = int(np.prod([float(len(one)) for one in listed]))
    if total > MOST:
        raise PresetError(f'the full grid has {total:,} runs; take fewer values, or sampling = "sobol:200"')
    for chosen in product(*listed):
        yield {key: value for part in chosen for key, value in part.items()}


def _unit(kind: str, count: int, dimensions: int, seed: int) -> Floats:
    """(count, dimensions) in 0..1."""
    if count > MOST:
        raise PresetError(f"{kind}:{count} asks for too many runs; take up to {MOST:,}")
    if kind == "lhs":
        return np.asarray(qmc.LatinHypercube(dimensions, rng=np.random.default_rng(seed)).random(count))
    sampler = qmc.Sobol(dimensions, rng=np.random.default_rng(seed))
    return np.asarray(sampler.random_base2(max(count - 1, 0).bit_length())[:count])


def from_csv(path: Path) -> Iterator[Changes]:
    """One run for each row; columns are dotted keys, with or without 'in:', and others are passed over when there are
    columns with 'in:'. Values as after --set."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise PresetError(f"points {path} cannot be read: {getattr(error, 'strerror', None) or error}") from None
    names = list(rows[0]) if rows else []
    keys = {name: name.removeprefix("in:") for name in names if name and name.startswith("in:")}
    keys = keys or {name: name for name in names if name}
    if not rows or not keys:
        raise PresetError(f"points {path.name} has no rows; give a header of dotted keys and a row for each run")
    for row in rows:
        yield {key: parse_override(f"{key}={row[name] or ''}")[1] for name, key in keys.items()}
