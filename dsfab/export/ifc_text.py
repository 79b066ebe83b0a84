"""The entities of an IFC4 file: project, units and building once, an element for each piece."""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

from dsfab.arrays import Floats, Ints
from dsfab.export.part import Details
from dsfab.export.step_pieces import Numbered, quoted
from dsfab.export.text import listed_rows, one_line
from dsfab.units import MM_PER_M

DIGITS = 6
"""Decimals of coordinates: 1e-6 mm."""
PLATE_SETS = {
    "Qto_PlateBaseQuantities": {"Width": "LENGTH", "NetVolume": "VOLUME", "NetWeight": "WEIGHT"},
    "Dsfab_PieceQuantities": {"NetSurfaceArea": "AREA"},
}
"""Sets of quantities of a piece, the standard's first, and their kinds; its width is the sheet's thickness."""
Naming = Callable[[str], str]
"""From a word to an identifier."""


class Place(NamedTuple):
    """Numbers of what elements refer to; 0 for a material or properties that are not known.

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
    """The header; its time is fixed, so that the same solid gives the same file."""
    title = quoted(one_line(name))
    return (
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION(('ViewDefinition [ReferenceView_V1.2]'),'2;1');\n"
        f"FILE_NAME('{title}.ifc','1970-01-01T00:00:00',('dsfab'),(''),'dsfab {version}','dsfab {version}','');\n"
        "FILE_SCHEMA(('IFC4'));\nENDSEC;\nDATA;\n"
    )


def building(new: Numbered, name: str, details: Details, naming: Naming) -> Place:
    """Units, project, site and building around the elements, and what all of these share."""
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
    """What elements are parts of, in the building: placements and containment go by the whole. They share a material
    and properties."""
    title, listed = quoted(one_line(name)), ",".join(f"#{k}" for k in elements)
    whole = new.add(f"IFCROOF('{naming('roof')}',$,'{title}',$,'diffusion structure',#{at.placement},$,$,.FREEFORM.)")
    new.add(f"IFCRELAGGREGATES('{naming('parts')}',$,$,$,#{whole},({listed}))")
    new.add(f"IFCRELCONTAINEDINSPATIALSTRUCTURE('{naming('contained')}',$,$,$,(#{whole}),#{at.building})")
    if at.material:
        new.add(f"IFCRELASSOCIATESMATERIAL('{naming('made of')}',$,$,$,({listed}),#{at.material})")
    if at.properties:
        new.add(f"IFCRELDEFINESBYPROPERTIES('{naming('properties of all')}',$,$,$,({listed}),#{at.properties})")


def _on_site(new: Numbered, context: int, origin: tuple[float, float, float]) -> None:
    """Where the model lies in the coordinates of a survey, metres; which one that is nobody said."""
    metre = new.add("IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)")
    survey = new.add(f"IFCPROJECTEDCRS('unknown','that of the mesh file',$,$,$,$,#{metre})")
    east, north, up = map(real, origin)
    new.add(f"IFCMAPCONVERSION(#{context},#{survey},{east},{north},{up},1.,0.,{real(1 / MM_PER_M)})")


def surface_style(new: Numbered, name: str, colour: tuple[float, float, float]) -> int:
    """A colour, 0 to 1, by a name."""
    red, green, blue = map(real, colour)
    rgb = new.add(f"IFCCOLOURRGB($,{red},{green},{blue})")
    shading = new.add(f"IFCSURFACESTYLESHADING(#{rgb},0.)")
    return new.add(f"IFCSURFACESTYLE('{quoted(name)}',.BOTH.,(#{shading}))")


def _units(new: Numbered) -> Iterator[int]:
    """Millimetres, and m2, m3, kg, Pa, rad, kg/m3 for what is not a length."""
    yield new.add("IFCSIUNIT(*,.LENGTHUNIT.,.MILLI.,.METRE.)")
    for kind, unit in (("AREA", "SQUARE_METRE"), ("VOLUME", "CUBIC_METRE"), ("PRESSURE", "PASCAL")):
        yield new.add(f"IFCSIUNIT(*,.{kind}UNIT.,$,.{unit}.)")
    yield new.add("IFCSIUNIT(*,.PLANEANGLEUNIT.,$,.RADIAN.)")
    kilogram, metre = new.add("IFCSIUNIT(*,.MASSUNIT.,.KILO.,.GRAM.)"), new.add("IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)")
    yield kilogram
    parts = [new.add(f"IFCDERIVEDUNITELEMENT(#{unit},{power})") for unit, power in ((kilogram, 1), (metre, -3))]
    yield new.add(f"IFCDERIVEDUNIT((#{parts[0]},#{parts[1]}),.MASSDENSITYUNIT.,$)")


def _material(new: Numbered, measures: Mapping[str, float], called: str) -> int:
    """The material and its numbers; 0 if none is known."""
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
    """The thickness; 0 if it is not known."""
    if measures.get("thickness", 0) <= 0:
        return 0
    value = single_value(new, "Thickness", "IFCPOSITIVELENGTHMEASURE", measures["thickness"] * MM_PER_M)
    return new.add(f"IFCPROPERTYSET('{naming('properties')}',$,'Dsfab_Sheet',$,(#{value}))")


def single_value(new: Numbered, name: str, kind: str, value: float) -> int:
    return new.add(f"IFCPROPERTYSINGLEVALUE('{name}',$,{kind}({real(value)}),$)")


def element(
    new: Numbered,
    at: Place,
    which: tuple[str, int],
    mesh: tuple[Floats, Ints],
    amounts: Mapping[str, float],
    naming: Naming,
) -> int:
    """One piece, of V (n, 3), millimetres, and triangles (m, 3) whose corners count from 1, its colour and its
    quantities; returns its number."""
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
    """Triangles (m, 3), whose corners count from 1, of a closed body V (n, 3) in a style; returns its number."""
    points = "".join(listed_rows(f"(%.{DIGITS}f,%.{DIGITS}f,%.{DIGITS}f),", *V.T))
    listed = new.add(f"IFCCARTESIANPOINTLIST3D(({points}))")
    triangles = "".join(listed_rows("(%d,%d,%d),", *corners.T))
    faces = new.add(f"IFCTRIANGULATEDFACESET(#{listed},$,.T.,({triangles}),$)")
    new.add(f"IFCSTYLEDITEM(#{faces},(#{style}),$)")
    return faces


def real(value: float) -> str:
    """A number as ISO 10303-21 wants it: with a point."""
    text = f"{value:.12g}".upper()
    head, e, power = text.partition("E")
    return (head if "." in head else head + ".") + e + power
