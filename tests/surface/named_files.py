"""Files with a roof and walls that have names, written by programs that are not ours."""

import locale
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import trimesh

from dsfab.surface.files import separate_process
from dsfab.surface.files.ifc import read_ifc
from dsfab.surface.files.reading import DrawingBudget
from dsfab.surface.files.rhino_and_step import read_occt, read_rhino_meshes
from dsfab.surface.shapes import plate

ROOF, WALLS = plate(length=3.0, width=2.0, edge=1.0), plate(length=5.0, width=4.0, edge=1.0)
LOW = np.array([0.0, 0.0, -9.0])
"""Places the walls apart from the roof."""
PARTS = (("Roof", ROOF.V, ROOF.F), ("Walls", WALLS.V + LOW, WALLS.F))
READERS = {
    "meshes": lambda path, only: read_rhino_meshes(path, DrawingBudget(), only),
    "cad": read_occt,
    "ifc": read_ifc,
}


@contextmanager
def own_locale() -> Iterator[None]:
    """lib3mf's writer sets the locale of the whole process to C: tests after it would read ASCII from programs."""
    before = locale.setlocale(locale.LC_ALL)
    try:
        yield
    finally:
        locale.setlocale(locale.LC_ALL, before)


def read_in_this_process(monkeypatch) -> None:
    """Run foreign readers in this process: quicker by the second that a process takes to begin."""
    monkeypatch.setattr(separate_process, "foreign_triangles", lambda kind, path, _, only: READERS[kind](path, only))


def rhino_file(path: Path, parts=PARTS, layers=(), block="") -> Path:
    """3DM: `layers` are pairs of a name and the place of the layer above; without them each object has its own layer.
    block : name of a block around the first part."""
    rhino3dm = pytest.importorskip("rhino3dm")
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    for name, above in layers or [(name, None) for name, _, _ in parts]:
        entry = rhino3dm.Layer()
        entry.Name = name
        if above is not None:
            entry.ParentLayerId = model.Layers[above].Id
        model.Layers.Add(entry)
    for k, (name, V, F) in enumerate(parts):
        mesh, about = rhino3dm.Mesh(), rhino3dm.ObjectAttributes()
        about.LayerIndex, about.Name = len(model.Layers) - len(parts) + k, f"{name} object"
        for point in V.tolist():
            mesh.Vertices.AddPoint3d(*point)
        for face in F.tolist():
            mesh.Faces.AddFace(*face)
        if block and not k:
            model.InstanceDefinitions.Add(block, "", "", "", rhino3dm.Point3d(0, 0, 0), (mesh,), (about,))
            place = rhino3dm.Transform(1.0)
            model.Objects.AddInstanceObject(rhino3dm.InstanceReference(model.InstanceDefinitions[0].Id, place))
        else:
            model.Objects.AddMesh(mesh, about)
    assert model.Write(str(path), 7)
    return path


def dxf_file(path: Path, parts=PARTS, block="") -> Path:
    """DXF in metres, a layer for each part. block : name of a block around the first part."""
    document = ezdxf.new(units=6)
    for k, (name, V, F) in enumerate(parts):
        space = document.blocks.new(block) if block and not k else document.modelspace()
        mesh = space.add_mesh(dxfattribs={"layer": name})
        with mesh.edit_data() as data:
            data.vertices, data.faces = V.tolist(), F.tolist()
    if block:
        document.modelspace().add_blockref(block, (0, 0), dxfattribs={"layer": "blocks"})
    document.saveas(path)
    return path


def scene_file(path: Path, parts=PARTS, above="") -> Path:
    """OBJ or glTF by trimesh, in metres. above : name of a node above the first part."""
    scene = trimesh.Scene()
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]) if path.suffix in (".glb", ".gltf") else np.eye(3)
    for k, (name, V, F) in enumerate(parts):
        if above and not k:
            scene.graph.update(frame_to=above, frame_from=scene.graph.base_frame)
        parent = {"parent_node_name": above} if above and not k else {}
        geometry = {"geom_name": name if path.suffix == ".obj" else f"{name} mesh"}
        scene.add_geometry(trimesh.Trimesh(V @ turn, F, process=False), name, **geometry, **parent)
    scene.export(path)
    return path


def threemf_file(path: Path, parts=PARTS, above="") -> Path:
    """3MF by lib3mf, in metres. above : name of an object with the first part as its component."""
    lib3mf = pytest.importorskip("lib3mf")
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(lib3mf.ModelUnit.Meter)
    for k, (name, V, F) in enumerate(parts):
        mesh = model.AddMeshObject()
        mesh.SetName(name)
        points = [lib3mf.Position((lib3mf.ctypes.c_float * 3)(*row)) for row in V.tolist()]
        mesh.SetGeometry(points, [lib3mf.Triangle((lib3mf.ctypes.c_uint32 * 3)(*row)) for row in F.tolist()])
        thing = mesh
        if above and not k:
            thing = model.AddComponentsObject()
            thing.SetName(above)
            thing.AddComponent(mesh, wrapper.GetIdentityTransform())
        model.AddBuildItem(thing, wrapper.GetIdentityTransform()).SetPartNumber(f"number {k}")
    with own_locale():
        model.QueryWriter("3mf").WriteToFile(str(path))
    return path


def step_file(path: Path, above="", names=("Roof", "Walls")) -> Path:
    """STEP by build123d: rectangles with the sizes of the parts, moved as assemblies in Rhino or SolidWorks are.
    above : name of an assembly around the first part."""
    b = pytest.importorskip("build123d")
    roof, walls = b.Face.make_rect(3000, 2000), b.Face.make_rect(5000, 4000).moved(b.Location((0, 0, -9000)))
    roof.label, walls.label = names
    inner = b.Compound(children=[roof], label=above).moved(b.Location((0, 0, 700))) if above else roof
    b.export_step(b.Compound(children=[inner, walls], label="hall"), path)
    return path


def ifc_model(unit="METRE", prefix=None, schema="IFC4"):
    """An empty model by ifcopenshell, with a building and two storeys; return model, context and storeys."""
    pytest.importorskip("ifcopenshell")
    from ifcopenshell.api import aggregate, context, owner, project, root
    from ifcopenshell.api import unit as units

    model = project.create_file(schema)
    if schema == "IFC2X3":  # this version needs an author
        author = owner.add_person(model), owner.add_organisation(model)
        owner.add_person_and_organisation(model, *author)
        owner.add_application(model)
    top = root.create_entity(model, ifc_class="IfcProject", name="Hall")
    if unit == "METRE":
        lengths = [units.add_si_unit(model, unit_type="LENGTHUNIT", prefix=prefix)]
    else:
        angle = units.add_si_unit(model, unit_type="PLANEANGLEUNIT")
        lengths = [units.add_conversion_based_unit(model, name=unit)] if unit else [angle]
    units.assign_unit(model, units=lengths)
    space = context.add_context(model, context_type="Model")
    body = context.add_context(
        model, context_type="Model", context_identifier="Body", target_view="MODEL_VIEW", parent=space
    )
    house = root.create_entity(model, ifc_class="IfcBuilding", name="House")
    aggregate.assign_object(model, products=[house], relating_object=top)
    storeys = [root.create_entity(model, ifc_class="IfcBuildingStorey", name=name) for name in ("Top", "Ground")]
    aggregate.assign_object(model, products=storeys, relating_object=house)
    return model, body, storeys


def ifc_element(model, body, storey, kind, name, mesh, place=(0.0, 0.0, 0.0)):
    """Add an element with a mesh: V in metres and faces, at a place in metres; return the element."""
    from ifcopenshell.api import geometry, root, spatial

    V, F = mesh
    element = root.create_entity(model, ifc_class=kind, name=name)
    faces = [tuple(map(int, face)) for face in F]
    shape = geometry.add_mesh_representation(model, context=body, vertices=[np.asarray(V).tolist()], faces=[faces])
    geometry.assign_representation(model, product=element, representation=shape)
    matrix = np.eye(4)
    matrix[:3, 3] = place
    geometry.edit_object_placement(model, product=element, matrix=matrix)
    if storey is not None:
        spatial.assign_container(model, products=[element], relating_structure=storey)
    return element


def ifc_file(path: Path) -> Path:
    """IFC: the roof on the upper storey, the walls on the lower storey."""
    model, body, storeys = ifc_model()
    for (name, V, F), storey, kind in zip(PARTS, storeys, ("IfcRoof", "IfcWall"), strict=True):
        ifc_element(model, body, storey, kind, name, (V, F))
    model.write(str(path))
    return path
