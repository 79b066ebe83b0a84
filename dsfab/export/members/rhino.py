"""3DM for Rhino: a closed mesh and an axis for each member, both by its name, on a layer for each family.

Layers: `major`, `minor`, `rim` ... for bodies, `major axes` ... for axes, `nodes` for points. What is known of a member
is user text of its mesh. Millimetres; the file says so.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.errors import ExportError
from dsfab.export.along import curves_along, within
from dsfab.export.members.shapes import check_shapes, layer_colour, member_entries, member_facts
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack, differs
from dsfab.export.rhino import archive, empty_model, ids_of, new_layer, rhino_arrays, rhino_curve, rhino_mesh

NODES = "nodes"
"""The layer of points."""


def encode(part: Part) -> Iterator[bytes]:
    """Layers, then each member's mesh and axis, then the nodes."""
    import rhino3dm

    model, entries, shapes = empty_model(), member_entries(part), part.details.shapes
    ids = ids_of(part.name, (array for shape in shapes for array in (shape.V, shape.F)))
    bodies = list(dict.fromkeys(shape.layer for shape in shapes))
    with_axes = dict.fromkeys(shape.layer for shape in shapes if len(shape.axis))
    names = [(name, name) for name in bodies] + [(f"{name} axes", name) for name in with_axes] + [(NODES, "")]
    layers = {name: new_layer(model, ids, name, (*layer_colour(family), 255)) for name, family in names}
    for shape in shapes:
        about = _about(shape.id, layers[shape.layer], ids(f"body {shape.id}"))
        for key, value in member_facts(entries[shape.id]).items():
            about.SetUserString(key, value)
        model.Objects.AddMesh(rhino_mesh(shape.V, shape.F), about)
        if len(shape.axis):
            about = _about(shape.id, layers[f"{shape.layer} axes"], ids(f"axis {shape.id}"))
            model.Objects.AddCurve(rhino_curve(curves_along(shape.axis, within(part))), about)
    for node in part.details.records["nodes"]:
        about = _about(node["id"], layers[NODES], ids(f"node {node['id']}"))
        about.SetUserString("members", " ".join(node["members"]))
        model.Objects.AddPoint(rhino3dm.Point3d(*node["point"]), about)
    yield archive(model)


def _about(name: str, layer: int, identity: Any) -> Any:
    import rhino3dm

    about = rhino3dm.ObjectAttributes()
    about.Name, about.LayerIndex, about.Id = name, layer, identity
    return about


def check(part: Part, path: Path) -> ReadBack:
    """Read back with rhino3dm: valid, in millimetres, each member, axis and node by its name."""
    import rhino3dm

    model = rhino3dm.File3dm.Read(str(path))
    if model is None or model.Settings.ModelUnitSystem != rhino3dm.UnitSystem.Millimeters:
        raise ExportError(f"the .3dm file of {part.name!r} does not read back in millimetres; write .members.dxf")
    things = [(thing.Attributes.Name, thing.Geometry) for thing in model.Objects]
    if not all(shape.IsValid for _, shape in things):
        raise ExportError(f"rhino3dm finds the .3dm file of {part.name!r} invalid; write .members.dxf instead")
    kinds = rhino3dm.ObjectType
    names = {kind: [name for name, x in things if x.ObjectType == kind] for kind in (kinds.Curve, kinds.Point)}
    axes = [shape.id for shape in part.details.shapes if len(shape.axis)]
    for what, kind, wanted in (
        ("axes", kinds.Curve, axes),
        ("nodes", kinds.Point, [node["id"] for node in part.details.records["nodes"]]),
    ):
        if names[kind] != wanted:
            raise differs(part, what, len(wanted), len(names[kind]))
    found = {name: rhino_arrays(shape) for name, shape in things if shape.ObjectType == kinds.Mesh}
    return check_shapes(part, {name: (V, np.ascontiguousarray(F[:, :3])) for name, (V, F) in found.items()})
