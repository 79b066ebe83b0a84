"""What a design keeps of evenly spaced stripes, as arrays by name (see `dsfab.delivery.archive`), and back.

field_k           of such a field: its values at the vertices; beside it
field_k_sign, field_k_shift, field_k_blank, field_k_wanted   how faces see it
part_...          the parts of faces on which other fields are linear, that have more values than vertices
even_...          the phases and what else `EvenStripes` holds; even_chart_... its chart, even_steered_... how they run
                  elsewhere than along the stress
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from dsfab.arrays import Floats
from dsfab.pattern import CornerPhase
from dsfab.results import EvenStripes, Steered
from dsfab.slicing import Chart
from dsfab.surface import Surface
from dsfab.surface.corner_field import CornerField
from dsfab.surface.divided import Divided, DividedField

Field = Floats | CornerField | DividedField
Arrays = dict[str, NDArray[Any]]
STEERED = ("along", "guided", "over")
"""What is kept of `Steered`; what it told is among the notes."""


def field_arrays(key: str, field: Field) -> Arrays:
    """The arrays of a field; one without corners is one array, called by the key."""
    if isinstance(field, DividedField):
        divided = field.divided
        rows = {"data": divided.weights.data, "indices": divided.weights.indices, "indptr": divided.weights.indptr}
        parts = {"V": divided.surface.V, "F": divided.surface.F, "parent": divided.parent, **rows}
        return {key: field.x, **{f"part_{name}": array for name, array in parts.items()}}
    if not isinstance(field, CornerField):
        return {key: field}
    seen = {"sign": _whole(field.sign), "shift": _whole(field.shift), "blank": field.blank}
    wanted = {} if field.wanted is None else {"wanted": field.wanted}
    return {key: field.x, **{f"{key}_{name}": array for name, array in (seen | wanted).items()}}


def division_of(surface: Surface, arrays: Mapping[str, NDArray[Any]]) -> Divided | None:
    """What the faces of a surface are divided into: arrays part_V (p, 3), metres, part_F ...; None where they are
    not."""
    if "part_V" not in arrays:
        return None
    parts = Surface(arrays["part_V"], arrays["part_F"])
    rows = tuple(arrays[f"part_{name}"] for name in ("data", "indices", "indptr"))
    return Divided(surface, parts, arrays["part_parent"], csr_array(rows, shape=(parts.n, surface.n)))


def field_of(key: str, divided: Divided | None, arrays: Mapping[str, NDArray[Any]]) -> Field:
    """The field with the array `key`, (n,) or (n, 2), perhaps on such parts of faces."""
    if f"{key}_sign" not in arrays:
        x = arrays[key]
        return DividedField(divided, x) if divided and len(x) == divided.surface.n else x
    sign, shift, blank = (arrays[f"{key}_{name}"] for name in ("sign", "shift", "blank"))
    return CornerField(arrays[key], sign, shift, blank, arrays.get(f"{key}_wanted"))


def even_arrays(even: EvenStripes) -> Arrays:
    """The arrays of evenly spaced stripes."""
    found: Arrays = {"even_slope": even.slope, "even_density": even.density, "even_first": np.array(even.first)}
    for k, (phase, wanted) in enumerate(zip(even.phases, even.wanted, strict=True)):
        found |= {f"even_{k}_value": phase.value, f"even_{k}_singular": phase.singular}
        found |= {f"even_{k}_sign": _whole(phase.sign), f"even_{k}_shift": _whole(phase.shift)}
        found[f"even_{k}_wanted"] = np.reshape(wanted, (len(wanted), len(phase.sign)))
    if even.forces is not None:
        found["even_forces"] = even.forces
    chart = even.chart
    rows = {"data": chart.weights.data, "indices": chart.weights.indices, "indptr": chart.weights.indptr}
    if steered := even.steered:
        found |= {f"even_steered_{name}": getattr(steered, name) for name in STEERED}
    whole = {"V": chart.surface.V, "F": chart.surface.F, "parent": chart.parent, "z": chart.z, "scale": chart.scale}
    return found | {f"even_chart_{name}": array for name, array in (whole | rows).items()}


def even_of(surface: Surface, arrays: Mapping[str, NDArray[Any]]) -> EvenStripes | None:
    """The evenly spaced stripes that have these arrays, as even_slope (n, 2); None where there are none of them."""
    if "even_slope" not in arrays:
        return None
    one, two = (_phase(arrays, k) for k in (0, 1))
    major, minor = (tuple(arrays[f"even_{k}_wanted"]) for k in (0, 1))
    part = {name: arrays[f"even_chart_{name}"] for name in ("V", "F", "parent", "z", "scale")}
    divided = Surface(part["V"], part["F"])
    rows = tuple(arrays[f"even_chart_{name}"] for name in ("data", "indices", "indptr"))
    weights = csr_array(rows, shape=(divided.n, surface.n))
    chart = Chart(divided, part["parent"].astype(np.int64), weights, part["z"], part["scale"])
    density, first = arrays["even_density"], int(arrays["even_first"])
    along, guided, over = (arrays.get(f"even_steered_{name}") for name in STEERED)
    steered = None if along is None or guided is None or over is None else Steered(along, guided, over)
    lines, forces = ((one, two), (major, minor), arrays["even_slope"], density, first, chart), arrays.get("even_forces")
    return EvenStripes(*lines, steered=steered, forces=forces)


def _whole(array: Floats) -> NDArray[Any]:
    """Whole numbers that were kept as floating ones."""
    return np.rint(array).astype(np.int64)


def _phase(arrays: Mapping[str, NDArray[Any]], k: int) -> CornerPhase:
    value, sign, shift, singular = (arrays[f"even_{k}_{name}"] for name in ("value", "sign", "shift", "singular"))
    return CornerPhase(value, sign, shift, singular)
