"""Reader of IFC files. It uses the library ifcopenshell."""

import importlib.util
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats, Ints, concatenated_mesh
from dsfab.core.errors import SurfaceError
from dsfab.surface.files.reading import (
    Content,
    MalformedFileError,
    TriangleFile,
    contents,
    declared_unit,
    hidden_on,
    ignored_clause,
    selected_parts,
)

NO_BODIES = ("Annotation", "Axis", "Box", "Clearance", "CoG", "FootPrint", "Lighting", "Profile", "Reference")
"""IFC representations that do not describe the shape of a building element [IFC 4.3, IfcShapeRepresentation]."""
LEVELS = 50  # Largest number of assemblies, storeys and buildings around an element; only damaged files have more.


def read_ifc(path: Path, only: Sequence[str] = ()) -> TriangleFile:
    """Return the triangles of all elements of a building, in the length unit of the file's project.
    only : names of the elements, classes (`IfcRoof`), layers, storeys and assemblies to read; by default all.
    Raises MalformedFileError for a file that is not IFC, SurfaceError for a file without faces."""
    import ifcopenshell
    import ifcopenshell.geom as geom

    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 512))
        end = file.read()
    if b"END-ISO-10303-21" not in end:  # ifcopenshell reads incomplete files without a warning
        raise MalformedFileError("the last line END-ISO-10303-21 is missing: the file is not IFC, or it is cut off")
    try:
        model = ifcopenshell.open(str(path))
    except Exception:  # ifcopenshell does not document its errors
        raise MalformedFileError("the file is damaged, or has a version of IFC unknown to ifcopenshell") from None
    counts, parts = Counter[Content](), list[tuple[Floats, Ints]]()
    elements = {element.id(): element for element in selected_parts(_visible_elements(model, counts), only, counts)}
    settings = geom.settings()
    for key, value in (("use-world-coords", True), ("convert-back-units", True), ("mesher-angular-deflection", 0.2)):
        settings.set(key, value)
    shapes: Any = geom.iterator(settings, model, 1, include=[*elements.values()]) if elements else None
    has_next = bool(elements) and shapes.initialize()
    while has_next:
        shape = shapes.get()
        V, F = np.array(shape.geometry.verts, dtype=np.float64), np.array(shape.geometry.faces, dtype=np.int64)
        if len(F) and shape.id in elements and _is_body(shape.context, elements[shape.id]):
            turn = -1 if _is_mirrored(elements[shape.id]) else 1
            parts.append((V.reshape(-1, 3), F.reshape(-1, 3)[:, ::turn]))
            counts[Content(f"{elements.pop(shape.id).is_a()} element")] += 1
        has_next = shapes.next()
    for element in elements.values():
        counts[Content(f"{element.is_a()} element", "dropped", "without faces")] += 1
    inventory = contents(counts)
    if not parts:
        over = ignored_clause(thing.text for thing in inventory)
        raise SurfaceError(f"the file has no element with faces{over}; export the elements together with their shapes")
    return TriangleFile(*concatenated_mesh(parts), _unit(model), content=inventory)


def _visible_elements(model: Any, counts: Counter[Content]) -> Iterator[tuple[list[str], Any]]:
    """Yield the names and the IFC entity of each visible building element. `counts` counts all elements left out."""
    from ifcopenshell.util.element import get_layers, get_parent

    for product in model.by_type("IfcProduct"):
        kind, layers = product.is_a(), [*get_layers(model, product)]
        is_element = not product.is_a("IfcFeatureElement") and kind != "IfcVirtualElement"
        if not (is_element and (product.is_a("IfcElement") or kind == "IfcProxy")):
            if product.Representation:  # products without a shape, such as storeys, are not counted
                counts[Content(f"{kind} object", "beside")] += 1
        elif hidden := [layer.Name for layer in layers if _is_hidden(layer)]:
            counts[hidden_on(hidden[0])] += 1
        elif product.Representation:
            names, outer = [kind, product.Name or "", *(layer.Name for layer in layers)], get_parent(product)
            while outer is not None and len(names) < LEVELS:
                names.append(outer.Name or "")
                outer = get_parent(outer)
            yield names, product
        elif not product.IsDecomposedBy:
            counts[Content(f"{kind} element", "dropped", "without a shape")] += 1


def _is_body(identifier: str, element: Any) -> bool:
    identifiers = {shape.RepresentationIdentifier for shape in element.Representation.Representations}
    return identifier == "Body" if "Body" in identifiers else identifier not in NO_BODIES


def _is_mirrored(element: Any) -> bool:
    from ifcopenshell.util.placement import get_mappeditem_transformation

    items = [item for shape in element.Representation.Representations for item in shape.Items]
    mapped = [get_mappeditem_transformation(item)[:3, :3] for item in items if item.is_a("IfcMappedItem")]
    return bool(mapped) and all(np.linalg.det(matrix) < 0 for matrix in mapped)


def _is_hidden(layer: Any) -> bool:
    styled = layer.is_a("IfcPresentationLayerWithStyle")
    return bool(styled and (layer.LayerOn is False or layer.LayerFrozen is True))


def _unit(model: Any) -> str | None:
    from ifcopenshell.util.unit import get_project_unit

    unit = get_project_unit(model, "LENGTHUNIT")
    prefix = (unit.Prefix or "") if unit is not None and unit.is_a("IfcSIUnit") else ""
    return "no stated unit" if unit is None else declared_unit(prefix + unit.Name)


def require_ifc() -> None:
    """Raise SurfaceError if ifcopenshell is not installed."""
    if importlib.util.find_spec("ifcopenshell") is None:
        raise SurfaceError('.ifc files need the library ifcopenshell; install it with: pip install "dsfab[ifc]"')
