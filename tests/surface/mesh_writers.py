"""Writers of a mesh with all digits of its numbers, by the suffix of the file; V is in metres for IFC."""

from tests.surface.named_files import dxf_file, ifc_element, ifc_model, rhino_file
from tests.surface.test_inventory import archive, mesh_text, model
from tests.surface.test_overlaps import ply


def obj_file(path, V, F):
    lines = ["v {!r} {!r} {!r}\n".format(*point) for point in V.tolist()]
    path.write_text("".join([*lines, *("f {} {} {}\n".format(*face) for face in (F + 1).tolist())]))


def stl_file(path, V, F):
    corners = "facet normal 0 0 1\nouter loop\n" + 3 * "vertex {!r} {!r} {!r}\n" + "endloop\nendfacet\n"
    facets = "".join(corners.format(*numbers) for numbers in V[F].reshape(-1, 9).tolist())
    path.write_text(f"solid roof\n{facets}endsolid roof\n")


def threemf_file(path, V, F, unit="meter"):
    archive(path, model([("", mesh_text(V, F=F))], '<item objectid="1"/>', f'unit="{unit}"'))


def ifc_roof_file(path, V, F, **unit):
    building, body, (top, _) = ifc_model(**unit)
    ifc_element(building, body, top, "IfcRoof", "Roof", (V, F))
    building.write(str(path))


WRITERS = {
    "obj": obj_file,
    "ply": lambda path, V, F: ply(path, V, F, "<f8"),
    "stl": stl_file,
    "dxf": lambda path, V, F: dxf_file(path, (("Roof", V, F),)),
    "3dm": lambda path, V, F: rhino_file(path, (("Roof", V, F),)),
    "3mf": threemf_file,
    "ifc": ifc_roof_file,
}
