"""IFC4 (ISO 16739): a roof of plates or of members."""

import importlib.util
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dsfab import __version__
from dsfab.core.arrays import Floats, Ints
from dsfab.core.errors import ExportError
from dsfab.core.units import MM_PER_M
from dsfab.export.cad.step.entities import StepEntities, piece_name, references, step_string
from dsfab.export.members import MemberFacts, facts_of_members
from dsfab.export.mesh.soundness import solids_of
from dsfab.export.part import Details, MemberShape, Part
from dsfab.export.readback import ReadBack, check_mesh, check_shapes, layer_colour
from dsfab.export.writing import comma_separated_rows, one_line
from dsfab.surface import link_components, signed_volume, total_area

PLATE_SETS = {
    "Qto_PlateBaseQuantities": ("Width", "NetVolume", "NetWeight"),
    "Dsfab_PieceQuantities": ("NetSurfaceArea",),
}
"""Names of the quantities of a plate, by quantity set. IFC calls the thickness of a plate `Width`."""
KINDS = dict.fromkeys(("Length", "Width", "Thickness"), "LENGTH")
for _kind in ("Area", "Volume", "Weight"):
    KINDS |= dict.fromkeys((f"Net{_kind}", f"Gross{_kind}"), _kind.upper())
KINDS["NetSurfaceArea"] = "AREA"  # kinds of quantities by name
Naming = Callable[[str], str]  # function that returns the IFC identifier of an entity from a text, such as "roof"


class Place(NamedTuple):
    """Numbers of IFC entities to which all elements refer. `material` and `properties` are 0 if unknown."""

    body: int
    building: int
    placement: int
    part: int
    material: int
    properties: int
    style: int


def file_header(name: str, version: str) -> str:
    """Return the header of an IFC file. version : version of dsfab."""
    title = step_string(one_line(name))
    return (
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('ViewDefinition [ReferenceView_V1.2]'),'2;1');\n"
        f"FILE_NAME('{title}.ifc','1970-01-01T00:00:00',('dsfab'),(''),'dsfab {version}','dsfab {version}','');\n"
        "FILE_SCHEMA(('IFC4'));\nENDSEC;\nDATA;\n"
    )


def building(entities: StepEntities, name: str, details: Details, naming: Naming) -> Place:
    """Add the IFC entities that all parts of the roof need, such as units; return their numbers."""
    title, measures = step_string(one_line(name)), details.measures
    units = references(_units(entities))
    origin = entities.add("IFCCARTESIANPOINT((0.,0.,0.))")
    axes = entities.add(f"IFCAXIS2PLACEMENT3D(#{origin},$,$)")
    context = entities.add(f"IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-05,#{axes},$)")
    body = entities.add(f"IFCGEOMETRICREPRESENTATIONSUBCONTEXT('Body','Model',*,*,*,*,#{context},$,.MODEL_VIEW.,$)")
    if any(details.origin):
        _on_site(entities, context, details.origin)
    assignment = entities.add(f"IFCUNITASSIGNMENT({units})")
    project = entities.add(f"IFCPROJECT('{naming('project')}',$,'{title}',$,$,$,$,(#{context}),#{assignment})")
    placement = entities.add(f"IFCLOCALPLACEMENT($,#{axes})")
    site = entities.add(f"IFCSITE('{naming('site')}',$,'Site',$,$,#{placement},$,$,.ELEMENT.,$,$,$,$,$)")
    house = entities.add(f"IFCBUILDING('{naming('building')}',$,'Building',$,$,#{placement},$,$,.ELEMENT.,$,$,$)")
    entities.add(f"IFCRELAGGREGATES('{naming('sites')}',$,$,$,#{project},(#{site}))")
    entities.add(f"IFCRELAGGREGATES('{naming('buildings')}',$,$,$,#{site},(#{house}))")
    style = surface_style(entities, "structure", (0.62, 0.66, 0.7))
    material = _material(entities, measures, details.material or "material")
    part = entities.add(f"IFCLOCALPLACEMENT(#{placement},#{axes})")
    return Place(body, house, placement, part, material, _properties(entities, measures, naming), style)


def roof(entities: StepEntities, place: Place, name: str, elements: list[int], naming: Naming) -> None:
    """Add an IFC roof that consists of `elements`: entity numbers of plates or members."""
    title, listed = step_string(one_line(name)), references(elements)
    roof_entity = entities.add(
        f"IFCROOF('{naming('roof')}',$,'{title}',$,'diffusion structure',#{place.placement},$,$,.FREEFORM.)"
    )
    entities.add(f"IFCRELAGGREGATES('{naming('parts')}',$,$,$,#{roof_entity},{listed})")
    entities.add(f"IFCRELCONTAINEDINSPATIALSTRUCTURE('{naming('contained')}',$,$,$,(#{roof_entity}),#{place.building})")
    if place.material:
        entities.add(f"IFCRELASSOCIATESMATERIAL('{naming('made of')}',$,$,$,{listed},#{place.material})")
    if place.properties:
        entities.add(f"IFCRELDEFINESBYPROPERTIES('{naming('properties of all')}',$,$,$,{listed},#{place.properties})")


def _on_site(entities: StepEntities, context: int, origin: tuple[float, float, float]) -> None:
    metre = entities.add("IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)")
    survey = entities.add(f"IFCPROJECTEDCRS('unknown','that of the mesh file',$,$,$,$,#{metre})")
    east, north, up = map(real, origin)
    entities.add(f"IFCMAPCONVERSION(#{context},#{survey},{east},{north},{up},1.,0.,{real(1 / MM_PER_M)})")


def surface_style(entities: StepEntities, name: str, colour: Sequence[float]) -> int:
    """Add a surface style with a colour (red, green, blue; 0 to 1); return its entity number."""
    rgb = entities.add(f"IFCCOLOURRGB($,{','.join(map(real, colour))})")
    shading = entities.add(f"IFCSURFACESTYLESHADING(#{rgb},0.)")
    return entities.add(f"IFCSURFACESTYLE('{step_string(name)}',.BOTH.,(#{shading}))")


def _units(entities: StepEntities) -> Iterator[int]:
    yield entities.add("IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.)")
    for kind, unit in (("AREA", "SQUARE_METRE"), ("VOLUME", "CUBIC_METRE"), ("PRESSURE", "PASCAL")):
        yield entities.add(f"IFCSIUNIT(*,.{kind}UNIT.,$,.{unit}.)")
    yield entities.add("IFCSIUNIT(*,.PLANEANGLEUNIT.,$,.RADIAN.)")
    kilogram = entities.add("IFCSIUNIT(*,.MASSUNIT.,.KILO.,.GRAM.)")
    metre = entities.add("IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)")
    yield kilogram
    parts = [entities.add(f"IFCDERIVEDUNITELEMENT(#{unit},{power})") for unit, power in ((kilogram, 1), (metre, -3))]
    yield entities.add(f"IFCDERIVEDUNIT((#{parts[0]},#{parts[1]}),.MASSDENSITYUNIT.,$)")


def _material(entities: StepEntities, measures: Mapping[str, float], material_name: str) -> int:
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
        entities.add(f"IFCMATERIALPROPERTIES('{group}',$,{references(values)},#{material})")
    return material


def _properties(entities: StepEntities, measures: Mapping[str, float], naming: Naming) -> int:
    if measures.get("thickness", 0) <= 0:
        return 0
    value = single_value(entities, "Thickness", "IFCPOSITIVELENGTHMEASURE", measures["thickness"] * MM_PER_M)
    return entities.add(f"IFCPROPERTYSET('{naming('properties')}',$,'Dsfab_Sheet',$,(#{value}))")


def single_value(entities: StepEntities, name: str, kind: str, value: float) -> int:
    """Add a property that has a number as value; return the entity number of the property. kind : IFC type."""
    return entities.add(f"IFCPROPERTYSINGLEVALUE('{name}',$,{kind}({real(value)}),$)")


def element(
    entities: StepEntities,
    place: Place,
    which: tuple[str, int],
    mesh: tuple[Floats, Ints],
    amounts: Mapping[str, float],
    naming: Naming,
) -> int:
    """Add a plate with colour and quantities; return its entity number. which : name and number of the plate.
    mesh : vertices (n, 3), mm, and triangles (m, 3) of vertex numbers from 1.    amounts : quantities by name."""
    (name, i), (V, corners) = which, mesh
    faces = face_set(entities, V, corners, place.style)
    shape = entities.add(f"IFCSHAPEREPRESENTATION(#{place.body},'Body','Tessellation',(#{faces}))")
    product = entities.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,(#{shape}))")
    plate = entities.add(
        f"IFCPLATE('{naming(f'element {i}')}',$,'{step_string(one_line(name))}',$,'diffusion structure',"
        f"#{place.part},#{product},$,.SHEET.)"
    )
    for title, keys in PLATE_SETS.items():
        ids = naming(f"{title} {i}"), naming(f"{title} measured {i}")
        _add_quantity_set(entities, plate, title, {key: amounts[key] for key in amounts if key in keys}, ids)
    return plate


def _add_quantity_set(
    entities: StepEntities, owner: int, title: str, amounts: Mapping[str, float], ids: tuple[str, str]
) -> None:
    values = [entities.add(f"IFCQUANTITY{KINDS[key]}('{key}',$,$,{real(value)},$)") for key, value in amounts.items()]
    quantities = entities.add(f"IFCELEMENTQUANTITY('{ids[0]}',$,'{title}',$,$,{references(values)})")
    entities.add(f"IFCRELDEFINESBYPROPERTIES('{ids[1]}',$,$,$,(#{owner}),#{quantities})")


def face_set(entities: StepEntities, V: Floats, corners: Ints, style: int) -> int:
    """Add a closed body; return its entity number. V : (n, 3), mm.    corners : (m, 3) vertex numbers from 1."""
    points = "".join(comma_separated_rows("(%.6f,%.6f,%.6f),", *V.T))
    listed = entities.add(f"IFCCARTESIANPOINTLIST3D(({points}))")
    triangles = "".join(comma_separated_rows("(%d,%d,%d),", *corners.T))
    faces = entities.add(f"IFCTRIANGULATEDFACESET(#{listed},$,.T.,({triangles}),$)")
    entities.add(f"IFCSTYLEDITEM(#{faces},(#{style}),$)")
    return faces


def real(value: float) -> str:
    """Return a number as IFC text, which needs a decimal point."""
    text = f"{value:.12g}".upper()
    head, e, power = text.partition("E")
    return (head if "." in head else head + ".") + e + power


MM2, MM3 = MM_PER_M**2, MM_PER_M**3
PLACE = uuid.uuid5(uuid.NAMESPACE_URL, "dsfab")  # namespace of the identifiers in IFC files


def require_ifcopenshell() -> None:
    """Raise ExportError if ifcopenshell is not installed."""
    if importlib.util.find_spec("ifcopenshell") is None:
        raise ExportError('.ifc files need the library ifcopenshell; install it with: pip install "dsfab[ifc]"')


def encode(part: Part) -> Iterator[bytes]:
    """Yield the bytes of an IFC file with a plate for each separate piece of the part."""
    shell, solids = solids_of(part)
    entities, measures = StepEntities(1), part.details.measures
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
        elements.append(element(entities, place, (name, i), (V, F + 1), amounts, naming))
        yield from pending_bytes(entities)
    roof(entities, place, part.name, elements, naming)
    yield from pending_bytes(entities)
    yield b"ENDSEC;\nEND-ISO-10303-21;\n"


def pending_bytes(entities: StepEntities) -> Iterator[bytes]:
    """Yield the text of the entities that are not yet written; then clear the list of entities."""
    yield "".join(entities.text).encode("ascii")
    entities.text.clear()


def identifier(name: str, what: str) -> str:
    """Return the IFC identifier (22 characters) of the entity `what` in the file `name`."""
    value = uuid.uuid5(PLACE, f"{name}/{what}").int
    digits = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$"
    return "".join(digits[(value >> (6 * k)) & 63] for k in range(21, -1, -1))


def check(part: Part, path: Path) -> ReadBack:
    """Read the file back, and compare unit, triangles and volume with those of the part."""
    return check_mesh(part, *joined_face_sets(millimetre_model(part, path).by_type("IfcTriangulatedFaceSet")))


def millimetre_model(part: Part, path: Path) -> Any:
    """Read a file with ifcopenshell. Raises ExportError if reading fails, or if the unit is not mm."""
    import ifcopenshell
    import ifcopenshell.util.unit

    try:
        model = ifcopenshell.open(str(path))
        scale = ifcopenshell.util.unit.calculate_unit_scale(model)
    except Exception as error:  # ifcopenshell does not document its errors
        raise ExportError(f"ifcopenshell cannot read the IFC file of {part.name!r}: {error}") from error
    if abs(scale * MM_PER_M - 1) > 1e-9:
        raise ExportError(
            f"the IFC file of {part.name!r} does not state its lengths in millimetres; write .step instead"
        )
    return model


def joined_face_sets(items: Iterable[Any]) -> tuple[Floats, Ints]:
    """Join face sets of ifcopenshell into one mesh of vertices (n, 3) and triangles (m, 3)."""
    points, faces, offset = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for item in items:
        points.append(np.array(item.Coordinates.CoordList, dtype=np.float64))
        faces.append(np.array(item.CoordIndex, dtype=np.int64) - 1 + offset)
        offset += len(points[-1])
    return np.concatenate(points), np.concatenate(faces)


def encode_members(part: Part) -> Iterator[bytes]:
    """Yield the bytes of an IFC file with all members."""
    entities, details = StepEntities(1), part.details
    naming = partial(identifier, f"{part.name} members")
    yield file_header(part.name, __version__).encode()
    place = building(entities, part.name, details, naming)
    facts = facts_of_members(part)
    layers = dict.fromkeys(shape.layer for shape in details.shapes)
    styles = {name: surface_style(entities, name, [round(x / 255, 3) for x in layer_colour(name)]) for name in layers}
    shown: dict[str, list[int]] = {name: [] for name in layers}
    elements = []
    for shape in details.shapes:
        name, style = shape.id, styles[shape.layer]
        items = references([face_set(entities, V, F + 1, style) for V, F in _shells(shape)])
        body = entities.add(f"IFCSHAPEREPRESENTATION(#{place.body},'Body','Tessellation',{items})")
        shown[shape.layer].append(body)
        member = _element(entities, place, shape, body, naming)
        _add_quantities(entities, member, _amounts(shape, facts[name], details.measures), shape, naming)
        _add_facts(entities, member, facts[name], naming)
        _add_documents(entities, member, (name, details.drawings.get(name, ())), naming)
        elements.append(member)
        yield from pending_bytes(entities)
    roof(entities, place, part.name, elements, naming)
    for name, bodies in shown.items():
        entities.add(f"IFCPRESENTATIONLAYERASSIGNMENT('{step_string(name)}',$,{references(bodies)},$)")
    yield from pending_bytes(entities)
    yield b"ENDSEC;\nEND-ISO-10303-21;\n"


def check_members(part: Part, path: Path) -> ReadBack:
    """Read the file back; compare the name, triangles and volume of each member with those in `part`."""
    model = millimetre_model(part, path)
    meshes = {}
    for element in sorted(model.by_type("IfcBuildingElement"), key=lambda item: item.id()):  # in the file's order
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


def _element(entities: StepEntities, place: Place, shape: MemberShape, body: int, naming: Naming) -> int:
    product = entities.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,(#{body}))")
    kind, defined = ("IFCPLATE", "SHEET") if shape.plate else ("IFCMEMBER", "MEMBER")
    name = step_string(shape.id)
    return entities.add(
        f"{kind}('{naming(f'member {shape.id}')}',$,'{name}',$,'{step_string(shape.layer)}',#{place.part},#{product},"
        f"'{name}',.{defined}.)"
    )


def _amounts(shape: MemberShape, facts: MemberFacts, measures: Mapping[str, float]) -> dict[str, float]:
    volume, area = signed_volume(shape.V, shape.F) / MM3, facts.area / MM2
    own_share = facts.own_area / facts.area if facts.area else 1.0
    amounts = {"Length": facts.length, "Width": facts.width}
    amounts = {key: value for key, value in amounts.items() if value}
    if measures.get("thickness", 0) > 0:
        amounts["Thickness"] = MM_PER_M * measures["thickness"]
    for word, share in (("Gross", 1.0), ("Net", own_share)):
        amounts |= {f"{word}Area": share * area, f"{word}Volume": share * volume}
        if measures.get("density", 0) > 0:
            amounts[f"{word}Weight"] = share * volume * measures["density"]
    return amounts


def _add_quantities(
    entities: StepEntities, member: int, amounts: Mapping[str, float], shape: MemberShape, naming: Naming
) -> None:
    title = "Qto_PlateBaseQuantities" if shape.plate else "Qto_MemberBaseQuantities"
    usual = {key: value for key, value in amounts.items() if key.endswith(("Volume", "Weight"))}
    if shape.plate:
        usual |= {key: value for key, value in amounts.items() if key.endswith("Area")}
        usual |= {"Width": amounts["Thickness"]} if "Thickness" in amounts else {}  # IFC calls the thickness Width
    elif "Length" in amounts:
        usual |= {"Length": amounts["Length"]}
    for name, set_amounts in ((title, usual), ("Dsfab_MemberQuantities", amounts)):
        ids = naming(f"{name} of {shape.id}"), naming(f"measured {name} of {shape.id}")
        _add_quantity_set(entities, member, name, set_amounts, ids)


def _add_facts(entities: StepEntities, member: int, facts: MemberFacts, naming: Naming) -> None:
    words = {key: value for key, value in facts.words.items() if not key.endswith("_mm")}
    if facts.counted_with:
        words["crossings counted with"] = ", ".join(facts.counted_with)
    values = []
    for key, value in words.items():
        # an IFCLABEL has at most 255 characters
        kind = "IFCTEXT" if key == "nodes" or key.startswith("crossings") else "IFCLABEL"
        text = f"{kind}('{step_string(value)}')"
        values.append(entities.add(f"IFCPROPERTYSINGLEVALUE('{key.capitalize()}',$,{text},$)"))
    name = facts.member.id
    property_set = entities.add(
        f"IFCPROPERTYSET('{naming(f'facts of {name}')}',$,'Dsfab_Member',$,{references(values)})"
    )
    entities.add(f"IFCRELDEFINESBYPROPERTIES('{naming(f'described {name}')}',$,$,$,(#{member}),#{property_set})")


def _add_documents(entities: StepEntities, member: int, drawings: tuple[str, Any], naming: Naming) -> None:
    name, files = drawings
    for file in files:
        file_name = step_string(file)
        reference = entities.add(
            f"IFCDOCUMENTREFERENCE('{file_name}','{step_string(Path(file).stem)}','{file_name}','flat part',$)"
        )
        entities.add(
            f"IFCRELASSOCIATESDOCUMENT('{naming(f'drawing {file} of {name}')}',$,$,$,(#{member}),#{reference})"
        )
