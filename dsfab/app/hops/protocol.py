"""The protocol of Hops, after McNeel's own server in Python (`ghhops-server`, MIT).

`Inputs` and `Outputs` describe a component. A request has branches of values for each parameter, each with a type of
.NET and JSON of its own; the answer has the same form.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from dsfab.core.errors import DsfabError
from dsfab.core.units import METRES_PER
from dsfab.export import mesh_arrays

Kind = Literal["Mesh", "Curve", "Point", "Number", "Text"]
RESULTS: dict[Kind, str] = {
    "Mesh": "Rhino.Geometry.Mesh",
    "Curve": "Rhino.Geometry.Curve",
    "Point": "Rhino.Geometry.Point3d",
    "Number": "System.Double",
    "Text": "System.String",
}
"""Types of .NET of output values."""

MANY = 2**31 - 1
"""Number that Hops takes as unlimited."""

UNITS = {"millimeters": "mm", "centimeters": "cm", "meters": "m", "inches": "in", "feet": "ft"}
"""Rhino's words for the units of a document."""


class HopsError(DsfabError):
    """A request without an answer; the component shows its message."""


@dataclass(frozen=True)
class Parameter:
    """A socket of a component.

    many    : it takes, or gives, a list.
    wanted  : it must be connected.
    """

    name: str
    nickname: str
    about: str
    kind: Kind
    many: bool = False
    wanted: bool = False

    def described(self) -> dict[str, Any]:
        """Return its description for Hops."""
        return {
            "Name": self.name,
            "Nickname": self.nickname,
            "Description": self.about,
            "ParamType": self.kind,
            "ResultType": RESULTS[self.kind],
            "AtLeast": 1 if self.wanted else 0,
            "AtMost": MANY if self.many else 1,
        }


@dataclass(frozen=True)
class HopsComponent:
    """A component; `solve` maps a request to the values of the outputs, in their order."""

    name: str
    about: str
    inputs: tuple[Parameter, ...]
    outputs: tuple[Parameter, ...]
    solve: Callable[["Request"], Sequence[Any]]

    def described(self) -> dict[str, Any]:
        """Return its description for Hops."""
        return {
            "Uri": f"/{self.name}",
            "Name": self.name,
            "Nickname": self.name,
            "Description": self.about,
            "Category": "dsfab",
            "Subcategory": "dsfab",
            "Inputs": [one.described() for one in self.inputs],
            "Outputs": [one.described() for one in self.outputs],
        }

    def answer(self, request: "Request") -> dict[str, Any]:
        """Return the values of all outputs for Hops."""
        values = zip(self.outputs, self.solve(request), strict=True)
        return {"values": [_sent(output, value) for output, value in values]}


@dataclass(frozen=True)
class Request:
    """Values by parameter: a mesh is (V, F), a point three numbers; lists for list parameters, else None without a
    value.

    unit : of all lengths, such as 'mm'.    key : equal for equal requests.
    """

    values: Mapping[str, Any]
    unit: str
    key: str

    @property
    def metre(self) -> float:
        """Metres in one unit of the request."""
        return METRES_PER[self.unit]


def read_request(component: HopsComponent, body: Mapping[str, Any]) -> Request:
    """Return a request to solve; raise HopsError, with the parameter's name, for missing or wrong values."""
    sent: dict[str, list[tuple[str, str]]] = {}
    try:
        for one in body["values"]:
            branches = one["InnerTree"].values()
            sent[one["ParamName"]] = [(item["type"], item["data"]) for branch in branches for item in branch]
    except (KeyError, TypeError, AttributeError):
        raise HopsError("this is no request of Hops: it has no values, or others than Hops sends") from None
    word = str(body.get("modelunits") or "Meters").lower()
    if word not in UNITS:
        raise HopsError(f"the unit of the model is {word}; work in {', '.join(UNITS)}")
    key = json.dumps([component.inputs[0].name, sorted(sent.items()), word])
    return Request({one.name: _read(one, sent.get(one.name, [])) for one in component.inputs}, UNITS[word], key)


def _read(parameter: Parameter, sent: Sequence[tuple[str, str]]) -> Any:
    if not sent:
        if parameter.wanted:
            raise HopsError(f"{parameter.name}: nothing is connected; {parameter.about}")
        return [] if parameter.many else None
    if len(sent) > 1 and not parameter.many:
        raise HopsError(f"{parameter.name}: {len(sent)} values are connected, and it takes one")
    values = [_value(parameter, data) for _, data in sent]
    return values if parameter.many else values[0]


def _value(parameter: Parameter, data: str) -> Any:
    try:
        if parameter.kind == "Mesh":
            return mesh_arrays(data)
        value = json.loads(data)
        if parameter.kind == "Point":
            return tuple(_number(value[axis]) for axis in "XYZ")
        return _number(value) if parameter.kind == "Number" else str(value)
    except DsfabError as error:
        raise HopsError(f"{parameter.name}: {error}") from None
    except (KeyError, TypeError, ValueError):
        raise HopsError(f"{parameter.name}: {data[:40]!r} is no {parameter.kind.lower()}") from None


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(value)
    return number


def _sent(parameter: Parameter, value: Any) -> dict[str, Any]:
    values = value if parameter.many else [value]
    ready = ("Mesh", "Curve")  # JSON already
    items = [
        {"type": RESULTS[parameter.kind], "data": one if parameter.kind in ready else json.dumps(one)} for one in values
    ]
    return {"ParamName": parameter.name, "InnerTree": {"0": items}}
