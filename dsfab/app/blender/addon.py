"""dsfab in Blender: an add-on that builds a structure from the active object's mesh.

Written by `dsfab blender`. Install it in Preferences > Add-ons > Install from Disk. Its panel is in the sidebar (N)."""

import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import bpy
from mathutils import Matrix

bl_info = {
    "name": "dsfab",
    "description": "A structure that follows the forces in the mesh of the active object",
    "author": "the dsfab founders",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "3D View > Sidebar > dsfab",
    "category": "Mesh",
}

PYTHON = ""  # Path of the Python that has dsfab; empty for Blender's own Python.
MADE_OF = "dsfab_source"  # Custom property of results; its value is the source object's name.
WITH_FACES = {"MESH", "CURVE", "SURFACE", "META", "FONT"}  # Types of objects that Blender can turn into a mesh.


class BuildError(Exception):
    """Error of a build; Blender shows its message to the user."""


class Preferences(bpy.types.AddonPreferences):
    """Preferences of the add-on: the Python program that has dsfab."""

    bl_idname = __name__
    python: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Python of dsfab", description="Empty: Blender's own", default=PYTHON, subtype="FILE_PATH"
    )

    def draw(self, context: bpy.types.Context) -> None:
        self.layout.prop(self, "python")


class Wishes(bpy.types.PropertyGroup):
    """Settings of a build; the .blend file stores them."""

    preset: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Preset",
        description="A .toml file, or the name of a preset of dsfab; if empty, dsfab proposes a preset for the mesh",
        subtype="FILE_PATH",
    )
    changes: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Changes",
        description="New values for keys of the preset, separated by spaces: statics.material=S235 pattern.rotate=45",
    )


def mesh_file(source: bpy.types.Object, metres: float, path: Path) -> None:
    """Write an object with its modifiers to an OBJ file, in metres and world coordinates. Raises BuildError.
    metres : length of the scene's unit, m."""
    if source.get(MADE_OF):
        raise BuildError(f"{source.name} is a result of dsfab; select the object {source[MADE_OF]} instead")
    if source.type not in WITH_FACES:
        raise BuildError(f"{source.name} is not a surface; select a mesh")
    source.hide_set(False)  # Blender ignores the modifiers of hidden objects
    evaluated = source.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    try:
        if not len(mesh.polygons):
            raise BuildError(f"{source.name} has no faces; select a mesh with a surface")
        place = Matrix.Scale(metres, 4) @ evaluated.matrix_world
        lines = ["v {:.9g} {:.9g} {:.9g}".format(*(place @ vertex.co)) for vertex in mesh.vertices]
        lines += ["f " + " ".join(str(k + 1) for k in face.vertices) for face in mesh.polygons]
        path.write_text("\n".join(lines) + "\n", encoding="ascii")
    finally:
        evaluated.to_mesh_clear()


def command(python: str, mesh: Path, settings: Wishes, output: Path) -> list[str]:
    """Return the command line of the build. Raises BuildError if `settings.changes` has an unclosed quote."""
    preset = bpy.path.abspath(settings.preset)
    preset = str(Path(preset).resolve()) if Path(preset).is_file() else preset
    words = [preset, "--mesh", str(mesh)] if preset else [str(mesh)]
    try:
        changes = shlex.split(settings.changes)
    except ValueError as error:
        raise BuildError(f"changes: {error}; write KEY=VALUE pairs with spaces between them") from None
    words += [word for text in changes for word in ("--set", text)]
    words += ["--unit", "m", "--up", "z", "--format", "glb,members.glb", "--no-preview", "--quiet", "-o", str(output)]
    return [bpy.path.abspath(python) if python else sys.executable, "-m", "dsfab", "build", *words]


def failure_sentence(code: int, output: str) -> str:
    """Return a message about a failed build. code : exit code.    output : text that the build printed."""
    lines = [line for line in output.strip().splitlines() if line]
    messages = [line.removeprefix("dsfab: ") for line in lines if line.startswith("dsfab: ")]
    if "No module named dsfab" in output or "No module named 'dsfab'" in output:
        return "this Python has no dsfab; name another Python in the preferences of the add-on"
    return messages[-1] if messages else f"dsfab ended with {code}: {lines[-1] if lines else 'no word'}"


def import_meshes(path: Path, source: str, collection: bpy.types.Collection, metres: float) -> list[bpy.types.Object]:
    """Import the meshes of a GLB file into a collection; return the new objects.
    source : name of the object from which the structure was built.    metres : length of the scene's unit, m."""
    before = set(bpy.data.objects)
    unit = bpy.context.scene.unit_settings
    unit.scale_length = 1.0  # with 1.0 the importer does not scale; the loop below scales
    try:
        bpy.ops.import_scene.gltf(filepath=str(path))
    finally:
        unit.scale_length = metres
    imported_objects = [item for item in bpy.data.objects if item not in before]
    bpy.context.view_layer.update()
    meshes = [item for item in imported_objects if item.type == "MESH"]
    for item in meshes:
        place = Matrix.Scale(1 / metres, 4) @ item.matrix_world
        item.parent = None
        item.data.transform(place)
        item.matrix_world = Matrix.Identity(4)
        item[MADE_OF] = source
        for owner in list(item.users_collection):
            owner.objects.unlink(item)
        collection.objects.link(item)
    for item in set(imported_objects) - set(meshes):
        bpy.data.objects.remove(item)
    return meshes


def new_collection(name: str, under: bpy.types.Collection) -> bpy.types.Collection:
    """Return a new collection inside `under` for the structure of object `name`. Removes the previous collection."""
    for earlier in [item for item in bpy.data.collections if item.get(MADE_OF) == name]:
        for part in (*earlier.children_recursive, earlier):
            for item in list(part.objects):
                if item.get(MADE_OF):
                    bpy.data.objects.remove(item)
                elif not set(item.users_collection) - {part}:
                    under.objects.link(item)  # objects that the user has put in the collection are kept
            bpy.data.collections.remove(part)
    collection = bpy.data.collections.new(f"{name} structure")
    collection[MADE_OF] = name
    under.children.link(collection)
    return collection


def view_layer_of(collection: bpy.types.Collection) -> bpy.types.LayerCollection:
    """Return the `LayerCollection` of a collection in the current view layer."""
    layers = [bpy.context.view_layer.layer_collection]
    while layers:
        layer = layers.pop()
        if layer.collection == collection:
            return layer
        layers.extend(layer.children)
    raise KeyError(collection.name)


def show_result(folder: Path, source: bpy.types.Object, metres: float) -> int:
    """Import the solid and the members from the folder of a build; return the number of members.
    source : object from which the structure was built.    metres : length of the scene's unit, m."""
    collection = new_collection(source.name, bpy.context.scene.collection)
    solid_file = next(path for path in folder.glob("*.glb") if not path.stem.endswith(".members"))
    for solid in import_meshes(solid_file, source.name, collection, metres):
        solid.name = f"{source.name} solid"
    members = bpy.data.collections.new(f"{source.name} members")
    collection.children.link(members)
    bodies = import_meshes(next(folder.glob("*.members.glb")), source.name, members, metres)
    view_layer_of(members).hide_viewport = True
    bpy.context.view_layer.objects.active = source  # the next build starts from the active object
    source.hide_set(True)
    return len(bodies)


class Build(bpy.types.Operator):
    """Build a structure from the mesh of the active object"""

    bl_idname = "dsfab.build"
    bl_label = "Build structure"
    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012  Blender reads it so

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Return True in object mode with an active object."""
        return context.mode == "OBJECT" and context.active_object is not None

    def _begin(self, context: bpy.types.Context) -> bool:
        self._folder = tempfile.TemporaryDirectory(prefix="dsfab-")
        self._source = context.active_object.name
        self._metres = context.scene.unit_settings.scale_length  # metres per unit of the scene
        folder = Path(self._folder.name)
        entry = context.preferences.addons.get(__name__)
        python = entry.preferences.python if entry and entry.preferences else PYTHON
        try:
            mesh = folder / f"{re.sub(r'[^A-Za-z0-9]+', '_', self._source)}.obj"  # the design gets the file's name
            mesh_file(context.active_object, self._metres, mesh)
            words = command(python, mesh, context.scene.dsfab, folder / "built")
            with (folder / "said.txt").open("wb") as log:  # a file, because a full pipe would stop the program
                environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
                self._process = subprocess.Popen(
                    words, stdin=subprocess.DEVNULL, stdout=log, stderr=log, cwd=folder, env=environment
                )
        except BuildError as error:
            return self._report_error(str(error))
        except OSError as error:
            return self._report_error(f"{words[0]} cannot be run ({error.strerror}); see the preferences of the add-on")
        return True

    def _report_error(self, text: str) -> bool:
        self.report({"ERROR"}, text)
        self._folder.cleanup()
        return False

    def _end(self) -> set[str]:
        folder = Path(self._folder.name)
        output = (folder / "said.txt").read_text(encoding="utf-8", errors="replace")
        source = bpy.data.objects.get(self._source)
        if self._process.returncode or source is None:
            missing_message = f"the object {self._source} does not exist any more"
            self._report_error(
                missing_message if source is None else failure_sentence(self._process.returncode, output)
            )
            return {"CANCELLED"}
        count = show_result(folder / "built", source, self._metres)
        self._folder.cleanup()
        self.report({"INFO"}, f"{source.name}: dsfab built a solid, and {count} members in a hidden collection")
        return {"FINISHED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Build the structure; return after the end of the build."""
        if not self._begin(context):
            return {"CANCELLED"}
        self._process.wait()
        return self._end()

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start the build; the user can continue to work."""
        if not self._begin(context):
            return {"CANCELLED"}
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.2, window=context.window)
        manager.modal_handler_add(self)
        context.workspace.status_text_set("dsfab is building. Press Esc to stop the build.")
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Finish if the build process has ended; cancel the process if the user presses Esc."""
        stopped = event.type == "ESC"
        if not stopped and self._process.poll() is None:
            return {"PASS_THROUGH"}
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        if not stopped:
            return self._end()
        self._process.kill()
        self._process.wait()
        self._folder.cleanup()
        return {"CANCELLED"}


class Panel(bpy.types.Panel):
    """Panel in the sidebar of the 3D view."""

    bl_idname = "VIEW3D_PT_dsfab"
    bl_label = "dsfab"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "dsfab"

    def draw(self, context: bpy.types.Context) -> None:
        for name in ("preset", "changes"):
            self.layout.prop(context.scene.dsfab, name)
        self.layout.operator(Build.bl_idname)


CLASSES = (Preferences, Wishes, Build, Panel)


def register() -> None:
    """Register the add-on's classes; Blender calls this function."""
    for registered_class in CLASSES:
        bpy.utils.register_class(registered_class)
    bpy.types.Scene.dsfab = bpy.props.PointerProperty(type=Wishes)


def unregister() -> None:
    """Unregister the add-on's classes; Blender calls this function."""
    del bpy.types.Scene.dsfab
    for registered_class in reversed(CLASSES):
        bpy.utils.unregister_class(registered_class)
