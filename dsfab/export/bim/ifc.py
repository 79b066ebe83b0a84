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
from dsfab.export.cad.step.entities import Numbered, piece_name, quoted
from dsfab.export.mesh.soundness import solids_of
from dsfab.export.part import Details, MemberShape, Part
from dsfab.export.readback import (
    ReadBack,
    check_mesh,
    check_shapes,
    differs,
    layer_colour,
    member_entries,
    member_facts,
)
from dsfab.export.writing import listed_rows, one_line
from dsfab.surface import connected, signed_volume, total_area

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


def beginning(name: str, version: str) -> str:
    """Return the header; its time is fixed, so that equal solids give equal files."""
    title = quoted(one_line(name))
    return (
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('ViewDefinition [ReferenceView_V1.2]'),'2;1');\n"
        f"FILE_NAME('{title}.ifc','1970-01-01T00:00:00',('dsfab'),(''),'dsfab {version}','dsfab {version}','');\n"
        "FILE_SCHEMA(('IFC4'));\nENDSEC;\nDATA;\n"
    )


def building(new: Numbered, name: str, details: Details, naming: Naming) -> Place:
    """Add units, project, site and building, and the entities that all elements share; return their numbers."""
    title, measures = quoted(one_line(name)), details.measures
    units = ",".join(f"#{k}" for k in _units(new))
    origin = new.add("IFCCARTESIANPOINT((0.,0.,0.))")
    axes = new.add(f"IFCAXIS2PLACEMENT3D(#{origin},$,$)")
    context = new.add(f"IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-05,#{axes},$)")
    body = new.add(f"IFCGEOMETRICREPRESENTATIONSUBCONTEXT('Body','Model',*,*,*,*,#{context},$,.MODEL_VIEW.,$)")
    if any(details.origin):
        _on_site(new, context, details.origin)
    assignment = new.add(f"IFCUNITASSIGNMENT(({units}))")
    project = new.add(f"IFCPROJECT('{naming('project')}',$,'{title}',$,$,$,$,(#{context}),#{assignment})")
    placement = new.add(f"IFCLOCALPLACEMENT($,#{axes})")
    site = new.add(f"IFCSITE('{naming('site')}',$,'Site',$,$,#{placement},$,$,.ELEMENT.,$,$,$,$,$)")
    house = new.add(f"IFCBUILDING('{naming('building')}',$,'Building',$,$,#{placement},$,$,.ELEMENT.,$,$,$)")
    new.add(f"IFCRELAGGREGATES('{naming('sites')}',$,$,$,#{project},(#{site}))")
    new.add(f"IFCRELAGGREGATES('{naming('buildings')}',$,$,$,#{site},(#{house}))")
    style = surface_style(new, "structure", (0.62, 0.66, 0.7))
    made_of = _material(new, measures, details.records.get("material") or "material")
    part = new.add(f"IFCLOCALPLACEMENT(#{placement},#{axes})")
    return Place(body, house, placement, part, made_of, _properties(new, measures, naming), style)


def roof(new: Numbered, at: Place, name: str, elements: list[int], naming: Naming) -> None:
    """Add the roof that holds elements, with its placement, and the material and properties of the elements."""
    title, listed = quoted(one_line(name)), ",".join(f"#{k}" for k in elements)
    whole = new.add(f"IFCROOF('{naming('roof')}',$,'{title}',$,'diffusion structure',#{at.placement},$,$,.FREEFORM.)")
    new.add(f"IFCRELAGGREGATES('{naming('parts')}',$,$,$,#{whole},({listed}))")
    new.add(f"IFCRELCONTAINEDINSPATIALSTRUCTURE('{naming('contained')}',$,$,$,(#{whole}),#{at.building})")
    if at.material:
        new.add(f"IFCRELASSOCIATESMATERIAL('{naming('made of')}',$,$,$,({listed}),#{at.material})")
    if at.properties:
        new.add(f"IFCRELDEFINESBYPROPERTIES('{naming('properties of all')}',$,$,$,({listed}),#{at.properties})")


def _on_site(new: Numbered, context: int, origin: tuple[float, float, float]) -> None:
    """Add the position of the model in a survey's coordinates (m); the file cannot name the survey."""
    metre = new.add("IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)")
    survey = new.add(f"IFCPROJECTEDCRS('unknown','that of the mesh file',$,$,$,$,#{metre})")
    east, north, up = map(real, origin)
    new.add(f"IFCMAPCONVERSION(#{context},#{survey},{east},{north},{up},1.,0.,{real(1 / MM_PER_M)})")


def surface_style(new: Numbered, name: str, colour: tuple[float, float, float]) -> int:
    """Add a named colour, 0 to 1; return its number."""
    red, green, blue = map(real, colour)
    rgb = new.add(f"IFCCOLOURRGB($,{red},{green},{blue})")
    shading = new.add(f"IFCSURFACESTYLESHADING(#{rgb},0.)")
    return new.add(f"IFCSURFACESTYLE('{quoted(name)}',.BOTH.,(#{shading}))")


def _units(new: Numbered) -> Iterator[int]:
    yield new.add("IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.)")
    for kind, unit in (("AREA", "SQUARE_METRE"), ("VOLUME", "CUBIC_METRE"), ("PRESSURE", "PASCAL")):
        yield new.add(f"IFCSIUNIT(*,.{kind}UNIT.,$,.{unit}.)")
    yield new.add("IFCSIUNIT(*,.PLANEANGLEUNIT.,$,.RADIAN.)")
    kilogram, metre = new.add("IFCSIUNIT(*,.MASSUNIT.,.KILO.,.GRAM.)"), new.add("IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)")
    yield kilogram
    parts = [new.add(f"IFCDERIVEDUNITELEMENT(#{unit},{power})") for unit, power in ((kilogram, 1), (metre, -3))]
    yield new.add(f"IFCDERIVEDUNIT((#{parts[0]},#{parts[1]}),.MASSDENSITYUNIT.,$)")


def _material(new: Numbered, measures: Mapping[str, float], called: str) -> int:
    """Add the material and its values; 0 if none is known."""
    kinds = {
        "density": ("Pset_MaterialCommon", "MassDensity", "IFCMASSDENSITYMEASURE"),
        "young": ("Pset_MaterialMechanical", "YoungModulus", "IFCMODULUSOFELASTICITYMEASURE"),
        "poisson": ("Pset_MaterialMechanical", "PoissonRatio", "IFCPOSITIVERATIOMEASURE"),
    }
    sets: dict[str, list[int]] = {}
    for key, (group, name, kind) in kinds.items():
        if measures.get(key, 0) > 0:
            sets.setdefault(group, []).append(single_value(new, name, kind, measures[key]))
    if not sets:
        return 0
    material = new.add(f"IFCMATERIAL('{quoted(one_line(called))}',$,$)")
    for group, values in sets.items():
        new.add(f"IFCMATERIALPROPERTIES('{group}',$,({','.join(f'#{k}' for k in values)}),#{material})")
    return material


def _properties(new: Numbered, measures: Mapping[str, float], naming: Naming) -> int:
    if measures.get("thickness", 0) <= 0:
        return 0
    value = single_value(new, "Thickness", "IFCPOSITIVELENGTHMEASURE", measures["thickness"] * MM_PER_M)
    return new.add(f"IFCPROPERTYSET('{naming('properties')}',$,'Dsfab_Sheet',$,(#{value}))")


def single_value(new: Numbered, name: str, kind: str, value: float) -> int:
    """Add a property with a number; return its entity number."""
    return new.add(f"IFCPROPERTYSINGLEVALUE('{name}',$,{kind}({real(value)}),$)")


def element(
    new: Numbered,
    at: Place,
    which: tuple[str, int],
    mesh: tuple[Floats, Ints],
    amounts: Mapping[str, float],
    naming: Naming,
) -> int:
    """Add a piece with its colour and quantities, V (n, 3), in millimetres, and triangles (m, 3) whose corners count
    from 1; return its number.
    """
    (name, i), (V, corners) = which, mesh
    faces = face_set(new, V, corners, at.style)
    shape = new.add(f"IFCSHAPEREPRESENTATION(#{at.body},'Body','Tessellation',(#{faces}))")
    product = new.add(f"IFCPRODUCTDEFINITIONSHAPE($,$,(#{shape}))")
    made = new.add(
        f"IFCPLATE('{naming(f'element {i}')}',$,'{quoted(one_line(name))}',$,'diffusion structure',"
        f"#{at.part},#{product},$,.SHEET.)"
    )
    for title, keys in PLATE_SETS.items():
        held = {key: value for key, value in amounts.items() if key in keys}
        values = [new.add(f"IFCQUANTITY{keys[key]}('{key}',$,$,{real(value)},$)") for key, value in held.items()]
        numbers = ",".join(f"#{k}" for k in values)
        quantities = new.add(f"IFCELEMENTQUANTITY('{naming(f'{title} {i}')}',$,'{title}',$,$,({numbers}))")
        new.add(f"IFCRELDEFINESBYPROPERTIES('{naming(f'{title} measured {i}')}',$,$,$,(#{made}),#{quantities})")
    return made


def face_set(new: Numbered, V: Floats, corners: Ints, style: int) -> int:
    """Add triangles (m, 3), whose corners count from 1, of a closed body V (n, 3) in a style; return their number."""
    points = "".join(listed_rows("(%.6f,%.6f,%.6f),", *V.T))
    listed = new.add(f"IFCCARTESIANPOINTLIST3D(({points}))")
    triangles = "".join(listed_rows("(%d,%d,%d),", *corners.T))
    faces = new.add(f"IFCTRIANGULATEDFACESET(#{listed},$,.T.,({triangles}),$)")
    new.add(f"IFCSTYLEDITEM(#{faces},(#{style}),$)")
    return faces


def real(value: float) -> str:
    """Return a number with a decimal point, as ISO 10303-21 demands."""
    text = f"{value:.12g}".upper()
    head, e, power = text.partition("E")
    return (head if "." in head else head + ".") + e + power


MM2, MM3 = MM_PER_M**2, MM_PER_M**3
PLACE = uuid.uuid5(uuid.NAMESPACE_URL, "dsfab")
"""Namespace of the identifiers."""


def ready() -> None:
    """Raise ExportError if ifcopenshell is not installed."""
    if importlib.util.find_spec("ifcopenshell") is None:
        raise ExportError('.ifc files need the library ifcopenshell; install it with: pip install "dsfab[ifc]"')


def prepare(part: Part) -> Part:
    """Return the part itself, because the text holds every significant digit."""
    return part


def encode(part: Part) -> Iterator[bytes]:
    """Yield project, site, building and roof, then a plate for each piece; equal parts give equal bytes."""
    shell, solids = solids_of(part)
    new, measures = Numbered(1), part.details.measures
    yield beginning(part.name, __version__).encode()
    naming = partial(identifier, part.name)
    at = building(new, part.name, part.details, naming)
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
        made = element(new, at, (name, i), (V, F + 1), amounts, naming)
        elements.append(made)
        yield from flushed(new)
    roof(new, at, part.name, elements, naming)
    yield from flushed(new)
    yield b"ENDSEC;\nEND-ISO-10303-21;\n"


def flushed(new: Numbered) -> Iterator[bytes]:
    """Yield the text of the pending entities and clear it."""
    yield "".join(new.text).encode("ascii")
    new.text.clear()


def identifier(name: str, what: str) -> str:
    """Return the 22 characters of an IFC identifier: a number of 128 bits in base 64."""
    value = uuid.uuid5(PLACE, f"{name}/{what}").int
    digits = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$"
    return "".join(digits[(value >> (6 * k)) & 63] for k in range(21, -1, -1))


def check(part: Part, path: Path) -> ReadBack:
    """Read back with ifcopenshell: lengths in millimetres, every triangle, closed, the part's volume."""
    V, F = _arrays(millimetre_model(part, path))
    if not len(F):
        raise differs(part, "triangles", len(part.F), 0)
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
        raise ExportError(f"the IFC file of {part.name!r} does not read back in millimetres; write .step instead")
    return model


def _arrays(model: Any) -> tuple[Floats, Ints]:
    return joined_face_sets(model.by_type("IfcTriangulatedFaceSet"))


def joined_face_sets(items: Iterable[Any]) -> tuple[Floats, Ints]:
    """Join face sets of ifcopenshell into one mesh, V (n, 3) and F (m, 3)."""
    points, faces, at = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for item in items:
        points.append(np.array(item.Coordinates.CoordList, dtype=np.float64))
        faces.append(np.array(item.CoordIndex, dtype=np.int64) - 1 + at)
        at += len(points[-1])
    return np.concatenate(points), np.concatenate(faces)


KINDS = {"Length": "LENGTH", "Width": "LENGTH", "Thickness": "LENGTH", "NetArea": "AREA", "NetVolume": "VOLUME"}
"""Kinds of quantities by name."""
KINDS |= {"NetWeight": "WEIGHT", "GrossArea": "AREA", "GrossVolume": "VOLUME", "GrossWeight": "WEIGHT"}
"""Kinds of quantities by their names."""


def encode_members(part: Part) -> Iterator[bytes]:
    """Yield project, site and building, then each member; equal parts give equal bytes."""
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


def check_members(part: Part, path: Path) -> ReadBack:
    """Read back with ifcopenshell: each member by its name, its triangles closed, its volume."""
    model = millimetre_model(part, path)
    found = {}
    for element in sorted(model.by_type("IfcBuildingElement"), key=lambda one: one.id()):  # by_type sorts by kind
        if element.is_a() in ("IfcMember", "IfcPlate"):
            found[element.Name] = joined_face_sets(element.Representation.Representations[0].Items)
    return check_shapes(part, found)


def _shells(shape: MemberShape) -> Iterator[tuple[Floats, Ints]]:
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
    """Quantities of a member: millimetres, m2, m3, kg."""
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
    title = "Qto_PlateBaseQuantities" if shape.plate else "Qto_MemberBaseQuantities"
    usual = {key: value for key, value in amounts.items() if key.endswith(("Volume", "Weight"))}
    if shape.plate:
        usual |= {key: value for key, value in amounts.items() if key.endswith("Area")}
        usual |= {"Width": amounts["Thickness"]} if "Thickness" in amounts else {}  # the standard's word
    elif "Length" in amounts:
        usual |= {"Length": amounts["Length"]}
    for name, some in ((title, usual), ("Dsfab_MemberQuantities", amounts)):
        values = [new.add(f"IFCQUANTITY{KINDS[key]}('{key}',$,$,{real(value)},$)") for key, value in some.items()]
        held = naming(f"{name} of {shape.id}")
        one = new.add(f"IFCELEMENTQUANTITY('{held}',$,'{name}',$,$,({_listed(values)}))")
        new.add(f"IFCRELDEFINESBYPROPERTIES('{naming(f'measured {name} of {shape.id}')}',$,$,$,(#{made}),#{one})")


def _described(new: Numbered, made: int, entry: Mapping[str, Any], naming: Naming) -> None:
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
    name, files = drawings
    for file in files:
        held = quoted(file)
        one = new.add(f"IFCDOCUMENTREFERENCE('{held}','{quoted(Path(file).stem)}','{held}','flat part',$)")
        new.add(f"IFCRELASSOCIATESDOCUMENT('{naming(f'drawing {file} of {name}')}',$,$,$,(#{made}),#{one})")
