"""IFC4 (ISO 16739): a roof of plates, or of named members, with material, quantities and drawings."""

import importlib.util
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.entities import NumberedEntities, piece_name, step_string
from dsfab.export.mesh.soundness import solids_of
from dsfab.export.part import Details, MemberShape, Part
from dsfab.export.readback import (
    ReadBack,
    check_mesh,
    check_shapes,
    count_error,
    layer_colour,
    member_entries,
    member_facts,
)
from dsfab.export.writing import comma_separated_rows, one_line
from dsfab.surface import link_components, signed_volume, total_area

PLATE_SETS = {
    "Qto_PlateBaseQuantities": {"Width": "LENGTH", "NetVolume": "VOLUME", "NetWeight": "WEIGHT"},
    "Dsfab_PieceQuantities": {"NetSurfaceArea": "AREA"},
}
"""Sets of quantities of a piece, the standard's first, and their kinds; its width is the sheet's thickness."""
Naming = Callable[[str], str]
"""Function from a word to an identifier."""


class Place(NamedTuple):
    """Entity numbers that elements refer to; 0 for an unknown material or unknown properties.

    placement : of the whole.    part : of each of its parts, relative to that.
    """

    body: int
    building: int
    placement: int
    part: int
    material: int
    properties: int
    style: int


def file_header(name: str, version: str) -> str:
    """Return the header; its time is fixed, so that equal solids give equal files."""
    title = step_string(one_line(name))
    return (
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('ViewDefinition [ReferenceView_V1.2]'),'2;1');\n"
        f"FILE_NAME('{title}.ifc','1970-01-01T00:00:00',('dsfab'),(''),'dsfab {version}','dsfab {version}','');\n"
        "FILE_SCHEMA(('IFC4'));\nENDSEC;\nDATA;\n"
    )


def building(entities: NumberedEntities, name: str, details: Details, naming: Naming) -> Place:
    """Add units, project, site and building, and the entities that all elements share; return their numbers."""
    title, measures = step_string(one_line(name)), details.measures
    units = ",".join(f"#{k}" for k in _units(entities))
    origin = entities.add("IFCCARTESIANPOINT((0.,0.,0.))")
    axes = entities.add(f"IFCAXIS2PLACEMENT3D(#{origin},$,$)")
    context = entities.add(f"IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-05,#{axes},$)")
    body = entities.add(f"IFCGEOMETRICREPRESENTATIONSUBCONTEXT('Body','Model',*,*,*,*,#{context},$,.MODEL_VIEW.,$)")
    if any(details.origin):
        _on_site(entities, context, details.origin)
    assignment = entities.add(f"IFCUNITASSIGNMENT(({units}))")
    project = entities.add(f"IFCPROJECT('{naming('project')}',$,'{title}',$,$,$,$,(#{context}),#{assignment})")
    placement = entities.add(f"IFCLOCALPLACEMENT($,#{axes})")
    site = entities.add(f"IFCSITE('{naming('site')}',$,'Site',$,$,#{placement},$,$,.ELEMENT.,$,$,$,$,$)")
    house = entities.add(f"IFCBUILDING('{naming('building')}',$,'Building',$,$,#{placement},$,$,.ELEMENT.,$,$,$)")
    entities.add(f"IFCRELAGGREGATES('{naming('sites')}',$,$,$,#{project},(#{site}))")
    entities.add(f"IFCRELAGGREGATES('{naming('buildings')}',$,$,$,#{site},(#{house}))")
    style = surface_style(entities, "structure", (0.62, 0.66, 0.7))
    material = _material(entities, measures, details.records.get("material") or "material")
    part = entities.add(f"IFCLOCALPLACEMENT(#{placement},#{axes})")
    return Place(body, house, placement, part, material, _properties(entities, measures, naming), style)


def roof(entities: NumberedEntities, place: Place, name: str, elements: list[int], naming: Naming) -> None:
    """Add the roof that holds elements, with its placement, and the material and properties of the elements."""
    title, listed = step_string(one_line(name)), ",".join(f"#{k}" for k in elements)
    roof_entity = entities.add(
        f"IFCROOF('{naming('roof')}',$,'{title}',$,'diffusion structure',#{place.placement},$,$,.FREEFORM.)"
    )
    entities.add(f"IFCRELAGGREGATES('{naming('parts')}',$,$,$,#{roof_entity},({listed}))")
    entities.add(f"IFCRELCONTAINEDINSPATIALSTRUCTURE('{naming('contained')}',$,$,$,(#{roof_entity}),#{place.building})")
    if place.material:
        entities.add(f"IFCRELASSOCIATESMATERIAL('{naming('made of')}',$,$,$,({listed}),#{place.material})")
    if place.properties:
        entities.add(f"IFCRELDEFINESBYPROPERTIES('{naming('properties of all')}',$,$,$,({listed}),#{place.properties})")


def _on_site(entities: NumberedEntities, context: int, origin: tuple[float, float, float]) -> None:
    """Add the position of the model in a survey's coordinates (m); the file cannot name the survey."""
    metre = entities.add("IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)")
    survey = entities.add(f"IFCPROJECTEDCRS('unknown','that of the mesh file',$,$,$,$,#{metre})")
    east, north, up = map(real, origin)
    entities.add(f"IFCMAPCONVERSION(#{context},#{survey},{east},{north},{up},1.,0.,{real(1 / MM_PER_M)})")


def surface_style(entities: NumberedEntities, name: str, colour: tuple[float, float, float]) -> int:
    """Add a named colour, 0 to 1; return its number."""
    red, green, blue = map(real, colour)
    rgb = entities.add(f"IFCCOLOURRGB($,{red},{green},{blue})")
    shading = entities.add(f"IFCSURFACESTYLESHADING(#{rgb},0.)")
    return entities.add(f"IFCSURFACESTYLE('{step_string(name)}',.BOTH.,(#{shading}))")


def _units(entities: NumberedEntities) -> Iterator[int]:
    yield entities.add("IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.)")
    for kind, unit in (("AREA", "SQUARE_METRE"), ("VOLUME", "CUBIC_METRE"), ("PRESSURE", "PASCAL")):
        yield entities.add(f"IFCSIUNIT(*,.{kind}UNIT.,$,.{unit}.)")
    yield entities.add("IFCSIUNIT(*,.PLANEANGLEUNIT.,$,.RADIAN.)")
    kilogram, metre = (
        entities.add("IFCSIUNIT(*,.MASSUNIT.,.KILO.,.GRAM.)"),
        entities.add("IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)"),
    )
    yield kilogram
    parts = [entities.add(f"IFCDERIVEDUNITELEMENT(#{unit},{power})") for unit, power in ((kilogram, 1), (metre, -3))]
    yield entities.add(f"IFCDERIVEDUNIT((#{parts[0]},#{parts[1]}),.MASSDENSITYUNIT.,$)")


def _material(entities: NumberedEntities, measures: Mapping[str, float], material_name: str) -> int:
    """Add the material and its values; 0 if none is known."""
    kinds = {
        "density": ("Pset_MaterialCommon", "MassDensity", "IFCMASSDENSITYMEASURE"),
        "young": ("Pset_MaterialMechanical", "YoungModulus", "IFCMODULUSOFELASTICITYMEASURE"),
        "poisson": ("Pset_MaterialMechanical", "PoissonRatio", "IFCPOSITIVERATIOMEASURE"),
    }
    sets: dict[str, list[int]] = {}
    for key, (group, name, kind) in kinds.items():
        if measures.get(key, 0) > 0:
            sets.setdefault(group, []).append(single_value(entities, name, kind, measures[key]))
    if not sets:
        return 0
    material = entities.add(f"IFCMATERIAL('{step_string(one_line(material_name))}',$,$)")
    for group, values in sets.items():
        entities.add(f"IFCMATERIALPROPERTIES('{group}',$,({','.join(f'#{k}' for k in values)}),#{material})")
    return material


def _properties(entities: NumberedEntities, measures: Mapping[str, float], naming: Naming) -> int:
    if measures.get("thickness", 0) <= 0:
        return 0
    value = single_value(entities, "Thickness", "IFCPOSITIVELENGTHMEASURE", measures["thickness"] * MM_PER_M)
    return entities.add(f"IFCPROPERTYSET('{naming('properties')}',$,'Dsfab_Sheet',$,(#{value}))")


def single_value(entities: NumberedEntities, name: str, kind: str, value: float) -> int:
    """Add a property with a number; return its entity number."""
    return entities.add(f"IFCPROPERTYSINGLEVALUE('{name}',$,{kind}({real(value)}),$)")


def element(
    entities: NumberedEntities,
    place: Place,
    which: tuple[str, int],
    mesh: tuple[Floats, Ints],
    amounts: Mapping[str, float],
    naming: Naming,
) -> int:
    """Add a piece with its colour and quantities, V (n, 3), in millimetres, and triangles (m, 3) whose corners count
    from 1; return its number.
    """
    (name, i), (V, corners) = which, mesh
    faces = face_set(entities, V, corners, place.style)
    shape = entities.add(f"IFCSHAPEREPRESENTATION(#{place.body},'Body','Tessellation',(#{faces}))")
    product = entities.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,(#{shape}))")
    plate = entities.add(
        f"IFCPLATE('{naming(f'element {i}')}',$,'{step_string(one_line(name))}',$,'diffusion structure',"
        f"#{place.part},#{product},$,.SHEET.)"
    )
    for title, keys in PLATE_SETS.items():
        set_amounts = {key: value for key, value in amounts.items() if key in keys}
        values = [
            entities.add(f"IFCQUANTITY{keys[key]}('{key}',$,$,{real(value)},$)") for key, value in set_amounts.items()
        ]
        numbers = ",".join(f"#{k}" for k in values)
        quantities = entities.add(f"IFCELEMENTQUANTITY('{naming(f'{title} {i}')}',$,'{title}',$,$,({numbers}))")
        entities.add(f"IFCRELDEFINESBYPROPERTIES('{naming(f'{title} measured {i}')}',$,$,$,(#{plate}),#{quantities})")
    return plate


def face_set(entities: NumberedEntities, V: Floats, corners: Ints, style: int) -> int:
    """Add triangles (m, 3), whose corners count from 1, of a closed body V (n, 3) in a style; return their number."""
    points = "".join(comma_separated_rows("(%.6f,%.6f,%.6f),", *V.T))
    listed = entities.add(f"IFCCARTESIANPOINTLIST3D(({points}))")
    triangles = "".join(comma_separated_rows("(%d,%d,%d),", *corners.T))
    faces = entities.add(f"IFCTRIANGULATEDFACESET(#{listed},$,.T.,({triangles}),$)")
    entities.add(f"IFCSTYLEDITEM(#{faces},(#{style}),$)")
    return faces


def real(value: float) -> str:
    """Return a number with a decimal point, as ISO 10303-21 demands."""
    text = f"{value:.12g}".upper()
    head, e, power = text.partition("E")
    return (head if "." in head else head + ".") + e + power


MM2, MM3 = MM_PER_M**2, MM_PER_M**3
PLACE = uuid.uuid5(uuid.NAMESPACE_URL, "dsfab")
"""Namespace of the identifiers."""


def require_ifcopenshell() -> None:
    """Raise ExportError if ifcopenshell is not installed."""
    if importlib.util.find_spec("ifcopenshell") is None:
        raise ExportError('.ifc files need the library ifcopenshell; install it with: pip install "dsfab[ifc]"')


def prepare(part: Part) -> Part:
    """Return the part itself, because the text holds every significant digit."""
    return part


def encode(part: Part) -> Iterator[bytes]:
    """Yield project, site, building and roof, then a plate for each piece; equal parts give equal bytes."""
    shell, solids = solids_of(part)
    entities, measures = NumberedEntities(1), part.details.measures
    yield file_header(part.name, __version__).encode()
    naming = partial(identifier, part.name)
    place = building(entities, part.name, part.details, naming)
    elements = []
    for i, shells in enumerate(solids):
        used, corner = np.unique(part.F[np.isin(shell, shells)], return_inverse=True)
        V, F = part.V[used], corner.reshape(-1, 3)
        amounts = {"NetVolume": signed_volume(V, F) / MM3, "NetSurfaceArea": total_area(V, F) / MM2}
        if measures.get("thickness", 0) > 0:
            amounts["Width"] = MM_PER_M * measures["thickness"]
        if "density" in measures:
            amounts["NetWeight"] = amounts["NetVolume"] * measures["density"]
        name = piece_name(part.name, i, len(solids))
        plate = element(entities, place, (name, i), (V, F + 1), amounts, naming)
        elements.append(plate)
        yield from pending_bytes(entities)
    roof(entities, place, part.name, elements, naming)
    yield from pending_bytes(entities)
    yield b"ENDSEC;\nEND-ISO-10303-21;\n"


def pending_bytes(entities: NumberedEntities) -> Iterator[bytes]:
    """Yield the text of the pending entities and clear it."""
    yield "".join(entities.text).encode("ascii")
    entities.text.clear()


def identifier(name: str, what: str) -> str:
    """Return the 22 characters of an IFC identifier: a number of 128 bits in base 64."""
    value = uuid.uuid5(PLACE, f"{name}/{what}").int
    digits = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$"
    return "".join(digits[(value >> (6 * k)) & 63] for k in range(21, -1, -1))


def check(part: Part, path: Path) -> ReadBack:
    """Read back with ifcopenshell: lengths in millimetres, every triangle, closed, the part's volume."""
    V, F = _arrays(millimetre_model(part, path))
    if not len(F):
        raise count_error(part, "triangles", len(part.F), 0)
    return check_mesh(part, V, F)


def millimetre_model(part: Part, path: Path) -> Any:
    """Read a file with ifcopenshell; raises ExportError if that fails, or if its lengths are not in millimetres."""
    import ifcopenshell
    import ifcopenshell.util.unit

    try:
        model = ifcopenshell.open(str(path))
        scale = ifcopenshell.util.unit.calculate_unit_scale(model)
    except Exception as error:  # ifcopenshell documents no errors
        raise ExportError(f"ifcopenshell cannot read the IFC file of {part.name!r}: {error}") from error
    if abs(scale * MM_PER_M - 1) > 1e-9:
        raise ExportError(f"the IFC file of {part.name!r} has lengths that are not in millimetres; write .step instead")
    return model


def _arrays(model: Any) -> tuple[Floats, Ints]:
    return joined_face_sets(model.by_type("IfcTriangulatedFaceSet"))


def joined_face_sets(items: Iterable[Any]) -> tuple[Floats, Ints]:
    """Join face sets of ifcopenshell into one mesh, V (n, 3) and F (m, 3)."""
    points, faces, offset = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for item in items:
        points.append(np.array(item.Coordinates.CoordList, dtype=np.float64))
        faces.append(np.array(item.CoordIndex, dtype=np.int64) - 1 + offset)
        offset += len(points[-1])
    return np.concatenate(points), np.concatenate(faces)


KINDS = {"Length": "LENGTH", "Width": "LENGTH", "Thickness": "LENGTH", "NetArea": "AREA", "NetVolume": "VOLUME"}
"""Kinds of quantities by name."""
KINDS |= {"NetWeight": "WEIGHT", "GrossArea": "AREA", "GrossVolume": "VOLUME", "GrossWeight": "WEIGHT"}
"""Kinds of quantities by their names."""


def encode_members(part: Part) -> Iterator[bytes]:
    """Yield project, site and building, then each member; equal parts give equal bytes."""
    entities, details = NumberedEntities(1), part.details
    naming = partial(identifier, f"{part.name} members")
    yield file_header(part.name, __version__).encode()
    place = building(entities, part.name, details, naming)
    entries, drawings = member_entries(part), details.records.get("files", {})
    layers = dict.fromkeys(shape.layer for shape in details.shapes)
    styles = {name: surface_style(entities, name, _tint(name)) for name in layers}
    shown: dict[str, list[int]] = {name: [] for name in layers}
    elements = []
    for shape in details.shapes:
        name, style = shape.id, styles[shape.layer]
        items = _references([face_set(entities, V, F + 1, style) for V, F in _shells(shape)])
        body = entities.add(f"IFCSHAPEREPRESENTATION(#{place.body},'Body','Tessellation',({items}))")
        shown[shape.layer].append(body)
        member = _element(entities, place, shape, body, naming)
        _add_quantities(entities, member, _amounts(shape, entries[name], details.measures), shape, naming)
        _add_facts(entities, member, entries[name], naming)
        _add_documents(entities, member, (name, drawings.get(name, ())), naming)
        elements.append(member)
        yield from pending_bytes(entities)
    roof(entities, place, part.name, elements, naming)
    for name, bodies in shown.items():
        entities.add(f"IFCPRESENTATIONLAYERASSIGNMENT('{step_string(name)}',$,({_references(bodies)}),$)")
    yield from pending_bytes(entities)
    yield b"ENDSEC;\nEND-ISO-10303-21;\n"


def check_members(part: Part, path: Path) -> ReadBack:
    """Read back with ifcopenshell: each member by its name, its triangles closed, its volume."""
    model = millimetre_model(part, path)
    meshes = {}
    for element in sorted(model.by_type("IfcBuildingElement"), key=lambda one: one.id()):  # by_type sorts by kind
        if element.is_a() in ("IfcMember", "IfcPlate"):
            meshes[element.Name] = joined_face_sets(element.Representation.Representations[0].Items)
    return check_shapes(part, meshes)


def _shells(shape: MemberShape) -> Iterator[tuple[Floats, Ints]]:
    F = shape.F
    count, component = link_components(len(shape.V), F.ravel(), np.roll(F, -1, axis=1).ravel())
    for k in range(count):
        shell_faces = F[component[F[:, 0]] == k]
        if len(shell_faces):
            used, corner = np.unique(shell_faces, return_inverse=True)
            yield shape.V[used], corner.reshape(-1, 3)


def _tint(layer: str) -> tuple[float, float, float]:
    red, green, blue = (round(x / 255, 3) for x in layer_colour(layer))
    return red, green, blue


def _references(numbers: list[int]) -> str:
    return ",".join(f"#{k}" for k in numbers)


def _element(entities: NumberedEntities, place: Place, shape: MemberShape, body: int, naming: Naming) -> int:
    product = entities.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,(#{body}))")
    kind, defined = ("IFCPLATE", "SHEET") if shape.plate else ("IFCMEMBER", "MEMBER")
    name = step_string(shape.id)
    return entities.add(
        f"{kind}('{naming(f'member {shape.id}')}',$,'{name}',$,'{step_string(shape.layer)}',#{place.part},#{product},"
        f"'{name}',.{defined}.)"
    )


def _amounts(shape: MemberShape, entry: Mapping[str, Any], measures: Mapping[str, float]) -> dict[str, float]:
    """Quantities of a member: millimetres, m2, m3, kg."""
    volume, area = signed_volume(shape.V, shape.F) / MM3, entry["area"] / MM2
    own_share = entry["own_area"] / entry["area"] if entry["area"] else 1.0
    amounts = {"Length": entry["length"], "Width": entry["width"]["median"]}
    amounts = {key: value for key, value in amounts.items() if value}
    if measures.get("thickness", 0) > 0:
        amounts["Thickness"] = MM_PER_M * measures["thickness"]
    for word, share in (("Gross", 1.0), ("Net", own_share)):
        amounts |= {f"{word}Area": share * area, f"{word}Volume": share * volume}
        if measures.get("density", 0) > 0:
            amounts[f"{word}Weight"] = share * volume * measures["density"]
    return amounts


def _add_quantities(
    entities: NumberedEntities, member: int, amounts: Mapping[str, float], shape: MemberShape, naming: Naming
) -> None:
    title = "Qto_PlateBaseQuantities" if shape.plate else "Qto_MemberBaseQuantities"
    usual = {key: value for key, value in amounts.items() if key.endswith(("Volume", "Weight"))}
    if shape.plate:
        usual |= {key: value for key, value in amounts.items() if key.endswith("Area")}
        usual |= {"Width": amounts["Thickness"]} if "Thickness" in amounts else {}  # the word in the standard
    elif "Length" in amounts:
        usual |= {"Length": amounts["Length"]}
    for name, set_amounts in ((title, usual), ("Dsfab_MemberQuantities", amounts)):
        values = [
            entities.add(f"IFCQUANTITY{KINDS[key]}('{key}',$,$,{real(value)},$)") for key, value in set_amounts.items()
        ]
        set_id = naming(f"{name} of {shape.id}")
        quantity_set = entities.add(f"IFCELEMENTQUANTITY('{set_id}',$,'{name}',$,$,({_references(values)}))")
        entities.add(
            f"IFCRELDEFINESBYPROPERTIES('{naming(f'measured {name} of {shape.id}')}',$,$,$,(#{member}),#{quantity_set})"
        )


def _add_facts(entities: NumberedEntities, member: int, entry: Mapping[str, Any], naming: Naming) -> None:
    facts = {key: value for key, value in member_facts(entry).items() if not key.endswith("_mm")}
    if entry["counted_with"]:
        facts["crossings counted with"] = ", ".join(entry["counted_with"])
    values = []
    for key, value in facts.items():
        kind = "IFCTEXT" if key == "nodes" or key.startswith("crossings") else "IFCLABEL"  # no limit of length
        text = f"{kind}('{step_string(value)}')"
        values.append(entities.add(f"IFCPROPERTYSINGLEVALUE('{key.capitalize()}',$,{text},$)"))
    name = entry["id"]
    property_set = entities.add(
        f"IFCPROPERTYSET('{naming(f'facts of {name}')}',$,'Dsfab_Member',$,({_references(values)}))"
    )
    entities.add(f"IFCRELDEFINESBYPROPERTIES('{naming(f'described {name}')}',$,$,$,(#{member}),#{property_set})")


def _add_documents(entities: NumberedEntities, member: int, drawings: tuple[str, Any], naming: Naming) -> None:
    name, files = drawings
    for file in files:
        file_name = step_string(file)
        reference = entities.add(
            f"IFCDOCUMENTREFERENCE('{file_name}','{step_string(Path(file).stem)}','{file_name}','flat part',$)"
        )
        entities.add(
            f"IFCRELASSOCIATESDOCUMENT('{naming(f'drawing {file} of {name}')}',$,$,$,(#{member}),#{reference})"
        )
