"""Protocol of Hops, Grasshopper's client for components [McNeel's server `ghhops-server`, MIT]."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import DsfabError
from dsfab.core.units import METRES_PER
from dsfab.preset.proposal import origin_near
from dsfab.surface import Surface
from dsfab.surface.clean.seams import equal_merged
from dsfab.surface.files.reading import declared_unit
from dsfab.surface.files.rhino_and_step import read_rhino_json

Kind = Literal["Mesh", "Curve", "Point", "Number", "Text"]
NET_TYPES: dict[Kind, str] = {
    "Mesh": "Rhino.Geometry.Mesh",
    "Curve": "Rhino.Geometry.Curve",
    "Point": "Rhino.Geometry.Point3d",
    "Number": "System.Double",
    "Text": "System.String",
}
"""Names of the .NET types of output values."""

UNLIMITED = 2**31 - 1  # Hops takes this number as "no limit".


class HopsError(DsfabError):
    """A request that dsfab cannot answer; the component shows the message."""


@dataclass(frozen=True)
class HopsParameter:
    """An input or output of a component. is_list : True for a list.    is_required : True if the input is required."""

    name: str
    nickname: str
    about: str
    kind: Kind
    is_list: bool = False
    is_required: bool = False

    def description_json(self) -> dict[str, Any]:
        """Return the parameter in the form that Hops reads."""
        return {
            "Name": self.name,
            "Nickname": self.nickname,
            "Description": self.about,
            "ParamType": self.kind,
            "ResultType": NET_TYPES[self.kind],
            "AtLeast": 1 if self.is_required else 0,
            "AtMost": UNLIMITED if self.is_list else 1,
        }


@dataclass(frozen=True)
class HopsComponent:
    """A component for Grasshopper. solve : function that returns all outputs for a request."""

    name: str
    about: str
    inputs: tuple[HopsParameter, ...]
    outputs: tuple[HopsParameter, ...]
    solve: Callable[["HopsRequest"], Sequence[Any]]

    def description_json(self) -> dict[str, Any]:
        """Return the component in the form that Hops reads."""
        return {
            "Uri": f"/{self.name}",
            "Name": self.name,
            "Nickname": self.name,
            "Description": self.about,
            "Category": "dsfab",
            "Subcategory": "dsfab",
            "Inputs": [parameter.description_json() for parameter in self.inputs],
            "Outputs": [parameter.description_json() for parameter in self.outputs],
        }

    def answer(self, request: "HopsRequest") -> dict[str, Any]:
        """Compute the outputs for a request; return them in the form that Hops reads."""
        values = zip(self.outputs, self.solve(request), strict=True)
        return {"values": [_output_json(output, value) for output, value in values]}


@dataclass(frozen=True)
class HopsRequest:
    """Inputs of a component in a request.
    values : input values by parameter name; None if absent. A mesh is a `TriangleFile`, a point is three numbers.
    unit   : unit of all lengths, such as 'mm'.    key : text that is equal for equal inputs."""

    values: Mapping[str, Any]
    unit: str
    key: str

    @property
    def metre(self) -> float:
        """Length of the request's unit, metres."""
        return METRES_PER[self.unit]

    @cached_property
    def surface(self) -> Surface:
        """The mesh in the coordinates of the model, metres. Raises SurfaceError for an invalid mesh."""
        mesh = self.values["mesh"]
        return Surface.from_mesh(*equal_merged(mesh.V, mesh.F), self.unit)

    @cached_property
    def origin(self) -> Floats:
        """Origin (3,) of the design in the coordinates of the model, metres."""
        return np.array(origin_near(self.surface))

    def in_model(self, points: Floats) -> Floats:
        """Convert points (k, 3) from the design, in metres, to the model's coordinates, in the model's unit."""
        return np.asarray((points + self.origin) / self.metre)


def read_request(component: HopsComponent, body: Mapping[str, Any]) -> HopsRequest:
    """Return the request in the JSON object `body`. Raises HopsError for invalid values."""
    items_by_name: dict[str, list[tuple[str, str]]] = {}
    try:
        for entry in body["values"]:
            branches = entry["InnerTree"].values()
            items_by_name[entry["ParamName"]] = [(item["type"], item["data"]) for branch in branches for item in branch]
    except (KeyError, TypeError, AttributeError):
        raise HopsError("this is not a request of Hops; use a Hops component") from None
    word = str(body.get("modelunits") or "Meters")
    unit = declared_unit(word) or ""
    if unit not in METRES_PER:
        raise HopsError(
            f"the unit of the model is {unit or word}; set the model to one of these units: {', '.join(METRES_PER)}"
        )
    key = json.dumps([component.inputs[0].name, sorted(items_by_name.items()), word])
    values = {entry.name: _parameter_value(entry, items_by_name.get(entry.name, [])) for entry in component.inputs}
    return HopsRequest(values, unit, key)


def _parameter_value(parameter: HopsParameter, items: Sequence[tuple[str, str]]) -> Any:
    if not items:
        if parameter.is_required:
            raise HopsError(f"{parameter.name}: nothing is connected; {parameter.about}")
        return [] if parameter.is_list else None
    if len(items) > 1 and not parameter.is_list:
        raise HopsError(f"{parameter.name}: {len(items)} values are connected; connect a single value")
    values = [_value(parameter, data) for _, data in items]
    return values if parameter.is_list else values[0]


def _value(parameter: HopsParameter, data: str) -> Any:
    try:
        if parameter.kind == "Mesh":
            return read_rhino_json(data)
        value = json.loads(data)
        if parameter.kind == "Point":
            return tuple(_number(value[axis]) for axis in "XYZ")
        return _number(value) if parameter.kind == "Number" else str(value)
    except DsfabError as error:
        raise HopsError(f"{parameter.name}: {error}") from None
    except (KeyError, TypeError, ValueError):
        raise HopsError(f"{parameter.name}: {data[:40]!r} is not a {parameter.kind.lower()}") from None


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(value)
    return number


def _output_json(parameter: HopsParameter, value: Any) -> dict[str, Any]:
    values = value if parameter.is_list else [value]
    if parameter.kind not in ("Mesh", "Curve"):  # values of these kinds are JSON already
        values = [json.dumps(item) for item in values]
    items = [{"type": NET_TYPES[parameter.kind], "data": text} for text in values]
    return {"ParamName": parameter.name, "InnerTree": {"0": items}}
