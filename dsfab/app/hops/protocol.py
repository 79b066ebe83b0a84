"""What Hops asks and is answered, after McNeel's own server in Python (`ghhops-server`, MIT): names of fields, types.

A component is described by `Inputs` and `Outputs`; a request holds, by parameter, branches of values, each with a type
of .NET and JSON of its own; the answer has the same form.
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
"""The types of .NET in which values are sent back."""

MANY = 2**31 - 1
"""What Hops takes for: as many as there are."""

UNITS = {"millimeters": "mm", "centimeters": "cm", "meters": "m", "inches": "in", "feet": "ft"}
"""Rhino's words for the units of a document."""


class HopsError(DsfabError):
    """A request that cannot be answered; its sentence is shown on the component."""


@dataclass(frozen=True)
class Parameter:
    """A socket of a component.

    many    : whether it takes, or gives, a list.
    wanted  : whether it has to be connected.
    """

    name: str
    nickname: str
    about: str
    kind: Kind
    many: bool = False
    wanted: bool = False

    def described(self) -> dict[str, Any]:
        """As Hops reads it."""
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
    """What is offered under a name; `solve` makes the values of the outputs, in their order, of a request."""

    name: str
    about: str
    inputs: tuple[Parameter, ...]
    outputs: tuple[Parameter, ...]
    solve: Callable[["Request"], Sequence[Any]]

    def described(self) -> dict[str, Any]:
        """As Hops reads it."""
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
        """The values of all outputs as Hops reads them."""
        values = zip(self.outputs, self.solve(request), strict=True)
        return {"values": [_sent(output, value) for output, value in values]}


@dataclass(frozen=True)
class Request:
    """Values by parameter, read: a mesh is (V, F), a point three numbers; a list where there may be many, else None.

    unit : of all lengths of the geometry, 'mm'.    key : the same for the same request.
    """

    values: Mapping[str, Any]
    unit: str
    key: str

    @property
    def metre(self) -> float:
        """How many metres one of its units is."""
        return METRES_PER[self.unit]


def read_request(component: HopsComponent, body: Mapping[str, Any]) -> Request:
    """A request to solve; raises HopsError, naming the parameter, for what is missing or of another type."""
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
