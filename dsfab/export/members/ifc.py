"""IFC4: a roof of an IfcMember, or IfcPlate, for each member: name, triangles, material, quantities, and its drawings.

Lengths are in millimetres, areas, volumes and masses in m2, m3 and kg. Families are presentation layers.
`Dsfab_MemberQuantities` has length, width and thickness by these names, for plates too, where the standard's set has
others. Gross is all of a member's body; net is without the crossings that are counted with wider members, so that the
net volumes of all members are that of the structure. `files` of the records, by the names of members, become document
references.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dsfab import __version__
from dsfab.arrays import Floats, Ints
from dsfab.export.ifc import MM2, MM3, flushed, identifier, joined_face_sets, millimetre_model
from dsfab.export.ifc_text import Naming, Place, beginning, building, face_set, real, roof, surface_style
from dsfab.export.member_shape import MemberShape
from dsfab.export.members.shapes import check_shapes, layer_colour, member_entries, member_facts
from dsfab.export.part import Part
from dsfab.export.readback import ReadBack
from dsfab.export.step_pieces import Numbered, quoted
from dsfab.surface import connected, signed_volume
from dsfab.units import MM_PER_M

KINDS = {"Length": "LENGTH", "Width": "LENGTH", "Thickness": "LENGTH", "NetArea": "AREA", "NetVolume": "VOLUME"}
KINDS |= {"NetWeight": "WEIGHT", "GrossArea": "AREA", "GrossVolume": "VOLUME", "GrossWeight": "WEIGHT"}
"""Kinds of quantities by their names."""


def encode(part: Part) -> Iterator[bytes]:
    """Project, site and building, then a member after the other; the same part gives the same bytes."""
    new, details = Numbered(1), part.details
    naming = partial(identifier, f"{part.name} members")
    yield beginning(part.name, __version__).encode()
    at = building(new, part.name, details, naming)
    entries, drawings = member_entries(part), details.records.get("files", {})
    layers = dict.fromkeys(shape.layer for shape in details.shapes)
    styles = {name: surface_style(new, name, _tint(name)) for name in layers}
    shown: dict[str, list[int]] = {name: [] for name in layers}
    elements = []
    for shape in details.shapes:
        name, style = shape.id, styles[shape.layer]
        items = _listed([face_set(new, V, F + 1, style) for V, F in _shells(shape)])
        body = new.add(f"IFCSHAPEREPRESENTATION(#{at.body},'Body','Tessellation',({items}))")
        shown[shape.layer].append(body)
        made = _element(new, at, shape, body, naming)
        _measured(new, made, _amounts(shape, entries[name], details.measures), shape, naming)
        _described(new, made, entries[name], naming)
        _documented(new, made, (name, drawings.get(name, ())), naming)
        elements.append(made)
        yield from flushed(new)
    roof(new, at, part.name, elements, naming)
    for name, bodies in shown.items():
        new.add(f"IFCPRESENTATIONLAYERASSIGNMENT('{quoted(name)}',$,({_listed(bodies)}),$)")
    yield from flushed(new)
    yield b"ENDSEC;\nEND-ISO-10303-21;\n"


def check(part: Part, path: Path) -> ReadBack:
    """Read back with ifcopenshell: each member by its name, its triangles closed, its volume."""
    model = millimetre_model(part, path)
    found = {}
    for element in sorted(model.by_type("IfcBuildingElement"), key=lambda one: one.id()):  # it gives kind after kind
        if element.is_a() in ("IfcMember", "IfcPlate"):
            found[element.Name] = joined_face_sets(element.Representation.Representations[0].Items)
    return check_shapes(part, found)


def _shells(shape: MemberShape) -> Iterator[tuple[Floats, Ints]]:
    """Its bodies that do not hang together, each V (n, 3) and F (m, 3)."""
    F = shape.F
    count, of = connected(len(shape.V), F.ravel(), np.roll(F, -1, axis=1).ravel())
    for k in range(count):
        mine = F[of[F[:, 0]] == k]
        if len(mine):
            used, corner = np.unique(mine, return_inverse=True)
            yield shape.V[used], corner.reshape(-1, 3)


def _tint(layer: str) -> tuple[float, float, float]:
    red, green, blue = (round(x / 255, 3) for x in layer_colour(layer))
    return red, green, blue


def _listed(numbers: list[int]) -> str:
    return ",".join(f"#{k}" for k in numbers)


def _element(new: Numbered, at: Place, shape: MemberShape, body: int, naming: Naming) -> int:
    product = new.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,(#{body}))")
    kind, defined = ("IFCPLATE", "SHEET") if shape.plate else ("IFCMEMBER", "MEMBER")
    name = quoted(shape.id)
    return new.add(
        f"{kind}('{naming(f'member {shape.id}')}',$,'{name}',$,'{quoted(shape.layer)}',#{at.part},#{product},"
        f"'{name}',.{defined}.)"
    )


def _amounts(shape: MemberShape, entry: Mapping[str, Any], measures: Mapping[str, float]) -> dict[str, float]:
    """Of one member: millimetres, m2, m3, kg."""
    volume, area = signed_volume(shape.V, shape.F) / MM3, entry["area"] / MM2
    own = entry["own_area"] / entry["area"] if entry["area"] else 1.0
    found = {"Length": entry["length"], "Width": entry["width"]["median"]}
    found = {key: value for key, value in found.items() if value}
    if measures.get("thickness", 0) > 0:
        found["Thickness"] = MM_PER_M * measures["thickness"]
    for word, share in (("Gross", 1.0), ("Net", own)):
        found |= {f"{word}Area": share * area, f"{word}Volume": share * volume}
        if measures.get("density", 0) > 0:
            found[f"{word}Weight"] = share * volume * measures["density"]
    return found


def _measured(new: Numbered, made: int, amounts: Mapping[str, float], shape: MemberShape, naming: Naming) -> None:
    """The standard's set of quantities, and all of them by plain names."""
    title = "Qto_PlateBaseQuantities" if shape.plate else "Qto_MemberBaseQuantities"
    usual = {key: value for key, value in amounts.items() if key.endswith(("Volume", "Weight"))}
    if shape.plate:
        usual |= {key: value for key, value in amounts.items() if key.endswith("Area")}
        usual |= {"Width": amounts["Thickness"]} if "Thickness" in amounts else {}  # so the standard calls it
    elif "Length" in amounts:
        usual |= {"Length": amounts["Length"]}
    for name, some in ((title, usual), ("Dsfab_MemberQuantities", amounts)):
        values = [new.add(f"IFCQUANTITY{KINDS[key]}('{key}',$,$,{real(value)},$)") for key, value in some.items()]
        held = naming(f"{name} of {shape.id}")
        one = new.add(f"IFCELEMENTQUANTITY('{held}',$,'{name}',$,$,({_listed(values)}))")
        new.add(f"IFCRELDEFINESBYPROPERTIES('{naming(f'measured {name} of {shape.id}')}',$,$,$,(#{made}),#{one})")


def _described(new: Numbered, made: int, entry: Mapping[str, Any], naming: Naming) -> None:
    """What it is, and what it meets."""
    facts = {key: value for key, value in member_facts(entry).items() if not key.endswith("_mm")}
    if entry["counted_with"]:
        facts["crossings counted with"] = ", ".join(entry["counted_with"])
    values = []
    for key, value in facts.items():
        kind = "IFCTEXT" if key == "nodes" or key.startswith("crossings") else "IFCLABEL"  # of any length
        text = f"{kind}('{quoted(value)}')"
        values.append(new.add(f"IFCPROPERTYSINGLEVALUE('{key.capitalize()}',$,{text},$)"))
    name = entry["id"]
    one = new.add(f"IFCPROPERTYSET('{naming(f'facts of {name}')}',$,'Dsfab_Member',$,({_listed(values)}))")
    new.add(f"IFCRELDEFINESBYPROPERTIES('{naming(f'described {name}')}',$,$,$,(#{made}),#{one})")


def _documented(new: Numbered, made: int, drawings: tuple[str, Any], naming: Naming) -> None:
    """A reference to each drawing of a member; the same drawing may be that of several."""
    name, files = drawings
    for file in files:
        held = quoted(file)
        one = new.add(f"IFCDOCUMENTREFERENCE('{held}','{quoted(Path(file).stem)}','{held}','flat part',$)")
        new.add(f"IFCRELASSOCIATESDOCUMENT('{naming(f'drawing {file} of {name}')}',$,$,$,(#{made}),#{one})")
