"""The section [surface] of a preset: a mesh or a procedural shape, with its supports and loads."""

import base64
import inspect
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, Union

import numpy as np
from annotated_types import Ge
from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    PlainSerializer,
    PlainValidator,
    Tag,
    ValidationError,
    create_model,
    model_validator,
)

from dsfab.core.errors import PresetError
from dsfab.core.toml_files import PRESETS
from dsfab.preset.checks import mistakes
from dsfab.surface import (
    DEFAULT_TRIANGLES,
    SHAPES,
    ActionKind,
    CaseName,
    Combination,
    CombinationRule,
    DesignFactors,
    Load,
    SizeField,
    Support,
    Surface,
    SurfaceInFile,
    Up,
    en1990_combinations,
    normalized_surface,
    refined_surface,
    remeshed_surface,
    surface_in_file,
)


class Section(BaseModel):
    """A section of a preset: immutable and without unknown keys. Its constructor raises PresetError."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True, allow_inf_nan=False)

    def __init__(self, /, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise PresetError(f"{type(self).__name__.lower()}: {mistakes(error, type(self))}") from None

    # pydantic must not call this constructor, so that one message lists the mistakes in all sections of a file
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]


class SurfaceSection(Section):
    """Keys of [surface] for all kinds of surfaces."""

    model_config = ConfigDict(defer_build=True)  # checks are built on first use: they take half of the start time

    support: tuple[Support, ...] = ()
    load: tuple[Load, ...] = ()
    combination: tuple[Combination, ...] = ()
    """Combinations: sums of load cases, each multiplied by its factor."""
    combinations: CombinationRule | None = None
    """Standard by which dsfab creates further load combinations, besides `combination`."""
    actions: dict[CaseName, ActionKind] = {}
    """Kind of action of each case for the standard, by name of the case; not needed for weight, snow and wind."""
    factors: DesignFactors | None = None
    """Factors of the standard that a national annex changes."""
    refine: Annotated[float, Ge(0)] = 0.0
    """Largest edge length, metres; longer edges are divided. 0: no edge is divided."""
    smooth: bool = False
    """Make the surface smooth. With `refine`: by Loop subdivision. With `edge`: new vertices lie on a smooth surface
    through the old vertices. Boundaries and creases do not change."""

    @property
    def sums(self) -> tuple[Combination, ...]:
        """Load combinations of the preset, followed by the load combinations of the standard `combinations`."""
        return (*self.combination, *self.standard_sums)

    @property
    def standard_sums(self) -> tuple[Combination, ...]:
        """Load combinations of EN 1990; empty if the preset has no key `combinations`."""
        if self.combinations is None:
            return ()
        return tuple(en1990_combinations(self.load, self.actions, self.combinations, self.factors or DesignFactors()))

    @property
    def by_stress(self) -> bool:
        """True if the mesh has shorter edges where the stress changes."""
        return False

    def build(self) -> Surface:
        """Return the surface; raises SurfaceError for an invalid surface."""
        return refined_surface(self.base_surface(), self.refine, self.smooth) if self.refine else self.base_surface()

    def base_surface(self) -> Surface:
        """Return the surface before refinement."""
        raise NotImplementedError


class OwnSurface(SurfaceSection):
    """Keys for a surface from the user's own mesh; dsfab may make a new mesh with other edge lengths."""

    edge: Annotated[float, Ge(0)] = 0.0
    """Edge length of a new mesh of equal triangles, metres; boundaries and creases do not change. 0: no new mesh."""
    finest: Annotated[float, Ge(0)] = 0.0
    """Smallest edge length, metres, at the places of `finest_at`; needs `edge`. 0: all edges have equal lengths."""
    finest_at: Literal["curvature", "stress", "both"] = "curvature"
    """Places of shorter edges: where the surface is curved, where its stress changes, or both. The stress is from a
    solve on equal triangles. Stress should change along an edge by at most a quarter of the root mean square stress."""

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if self.edge and self.refine:
            raise ValueError("give either edge (a new mesh) or refine (division of long edges), not both")
        if self.finest and not self.edge:
            raise ValueError("finest needs the key edge (the edge length of flat places); give both keys")
        if self.finest_at != "curvature" and not self.finest:
            raise ValueError(
                f"finest_at = {self.finest_at!r} needs the key finest, the shortest edge length; give both keys"
            )
        if self.finest > self.edge:
            raise ValueError(f"finest = {self.finest:g} must not be larger than edge = {self.edge:g}")
        return self

    @property
    def by_stress(self) -> bool:
        return self.finest_at != "curvature"

    def build(self, sizes: Sequence[SizeField] = (), base: Surface | None = None) -> Surface:
        """Return the surface. Raises SurfaceError for an invalid surface.
        sizes : edge lengths of a new mesh.    base : result of `base_surface()`, if the caller has it."""
        base = base or self.base_surface()
        if not self.edge:
            return refined_surface(base, self.refine, self.smooth) if self.refine else base
        curved = self.finest if self.finest_at != "stress" else 0.0
        return remeshed_surface(base, self.edge, curved, self.smooth, sizes)


class FileSurface(OwnSurface):
    """A surface from a mesh file."""

    file: Path
    """OBJ, PLY, STL, OFF, GLB, glTF, 3MF, 3DM, DXF, STEP, BREP or IFC file. A relative path starts at the preset's
    folder; in Python, it starts at the current folder."""
    only: tuple[str, ...] = ()
    """Names of the parts of the file that form the surface: layers, blocks, nodes, objects, assemblies, storeys. A name
    also selects the parts inside. By default all visible parts."""
    unit: str | None = None
    """Unit of the file's numbers: mm, cm, m, in, ft ...; GLB and 3MF files contain their unit."""
    up: Up = "z"
    """Axis of the file that points upwards. In all other keys, z points upwards. dsfab rotates GLB files by itself."""
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Point of the file that becomes the origin of the design, metres, with z up; for files with survey coordinates."""
    mend: bool = False
    """Repair small faults: join vertices that nearly touch, remove tiny pieces and faces without area, close tiny
    holes, straighten uneven edges."""
    repair: bool = False
    """Repair a raw scan: as `mend`; also split edges with more than two faces, and give all normals the same side.
    Remove small pieces (under a twentieth of the largest), and fill holes (outline under 15 % of the largest side)."""
    max_triangles: Annotated[int, Ge(1)] | None = None
    """Largest number of triangles in the file; also limits its bytes, vertices and reading time. Default: 4 million."""

    @property
    def waits(self) -> bool:
        """True for a shipped preset that needs the user's mesh."""
        return self.file.parent in PRESETS and not self.file.exists()

    def base_surface(self) -> Surface:
        """Return the surface in the file, metres; raises PresetError if the preset needs the user's mesh."""
        return self.read().surface

    def read(self) -> SurfaceInFile:
        """Return the surface, with a record of repairs. Raises PresetError if the user's mesh is missing."""
        if self.waits:
            raise PresetError(
                f"this preset needs your mesh in place of {self.file.name}: write "
                'dsfab.load_preset(name, mesh="FILE"), or add --mesh FILE to a command'
            )
        limit = self.max_triangles or DEFAULT_TRIANGLES
        result = surface_in_file(self.file, self.unit, self.up, self.mend, limit, self.repair, self.only)
        if not any(self.origin):
            return result
        return replace(result, surface=Surface(result.surface.V - self.origin, result.surface.F))


def _mesh_from(value: Any) -> Surface:
    if not isinstance(value, str):
        V_F = isinstance(value, tuple | list) and len(value) == 2
        return normalized_surface(Surface.from_mesh(*value) if V_F else Surface.of(value))
    try:
        data = zlib.decompress(base64.b64decode(value, validate=True))
        n, m = np.frombuffer(data, "<i8", 2)
        V, F = np.frombuffer(data, "<f8", 3 * n, 16), np.frombuffer(data, "<i8", 3 * m, 16 + 24 * n)
    except (ValueError, zlib.error):
        raise ValueError("dsfab cannot read the text of this mesh; give surface.file instead") from None
    return normalized_surface(Surface(V.reshape(-1, 3), F.reshape(-1, 3)))


def _mesh_text(surface: Surface) -> str:
    sizes = np.array([surface.n, surface.m], dtype="<i8")
    data = sizes.tobytes() + surface.V.astype("<f8").tobytes() + surface.F.astype("<i8").tobytes()
    return base64.b64encode(zlib.compress(data, 1)).decode("ascii")


Mesh = Annotated[Surface, PlainValidator(_mesh_from), PlainSerializer(_mesh_text, return_type=str, when_used="json")]


class MeshSurface(OwnSurface):
    """A surface from a mesh in Python. `dsfab.save` writes the mesh to a file and names the file in the saved preset.
    mesh : a `Surface`, a mesh of another library (see `Surface.of`), or (V, F)."""

    mesh: Annotated[Mesh, Field(repr=False)]

    def base_surface(self) -> Surface:
        return self.mesh

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, MeshSurface):
            return False
        a, b = self.mesh, other.mesh
        same_mesh = a is b or (np.array_equal(a.V, b.V) and np.array_equal(a.F, b.F))
        return same_mesh and all(getattr(self, key) == getattr(other, key) for key in OwnSurface.model_fields)


class ShapeSurface(SurfaceSection):
    """A procedural surface; each shape adds its own parameters."""

    shape: str

    def base_surface(self) -> Surface:
        common_keys = set(SurfaceSection.model_fields) | {"shape"}
        return SHAPES[self.shape](**{k: v for k, v in self if k not in common_keys})


def _shape_model(name: str) -> type[ShapeSurface]:
    signature = inspect.signature(SHAPES[name], eval_str=True)
    fields: dict[str, Any] = {p.name: (p.annotation, p.default) for p in signature.parameters.values()}
    fields["shape"] = (Literal[name], name)
    return create_model(f"{name}_surface", __base__=ShapeSurface, **fields)


def _kind_of_surface(value: Any) -> str | None:
    values: dict[str, Any] = value if isinstance(value, dict) else getattr(value, "__dict__", {})
    return next((key for key in ("file", "mesh") if values.get(key) is not None), values.get("shape"))


SHAPE_SECTIONS = {name: _shape_model(name) for name in SHAPES}
if TYPE_CHECKING:
    AnySurface = SurfaceSection
else:
    _choices = {"file": FileSurface, "mesh": MeshSurface, **SHAPE_SECTIONS}
    AnySurface = Annotated[
        Union[tuple(Annotated[model, Tag(tag)] for tag, model in _choices.items())],  # noqa: UP007
        Discriminator(_kind_of_surface),
    ]


def plain(value: Any) -> Any:
    """Return a value in which tables, as in a preset file, replace all objects such as supports and loads."""
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {key: plain(part) for key, part in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [plain(part) for part in value] if isinstance(value, list | tuple) else value


def surface_table(surface: Any, lists: Mapping[str, Any]) -> Any:
    """Return the argument `surface` of `Preset` as a table.
    surface : a section, a table as in TOML, the path of a mesh file, a mesh of any library, or (V, F): vertices (n, 3),
              metres, and faces (m, 3).    lists : supports, loads and combinations to add to the table.
    Raises SurfaceError for an invalid mesh."""
    if isinstance(surface, str | Path):
        surface = {"file": Path(surface).absolute()}
    elif isinstance(surface, SurfaceSection | Mapping):
        surface = {key: part if key == "mesh" else plain(part) for key, part in dict(surface).items()}
        if isinstance(file := surface.get("file"), str | Path):
            surface["file"] = Path(file).absolute()
    else:
        surface = {"mesh": _mesh_from(surface)}
    return surface | {key: plain(part) for key, part in lists.items()}


EXAMPLE = (
    "dsfab.run(dsfab.Preset(surface=mesh, supports=[dsfab.Support(dsfab.Boundary())], loads=[dsfab.SelfWeight()], "
    "statics={'thickness': 0.05}))"
)
"""Example of the shortest preset for a mesh."""


def missing_preset(thing: Any) -> str:
    """Return an error message for an object that is not a preset. The message names the call that makes a preset."""
    if isinstance(thing, str | Path) and Path(thing).suffix in ("", ".toml"):
        return f"{str(thing)!r} is only the name of a preset; write dsfab.run(dsfab.load_preset({str(thing)!r}))"
    names: dict[type, str] = {str: repr(thing), tuple: "(V, F)", list: "[V, F]"}
    name = names.get(type(thing), f"a mesh of type {type(thing).__name__}")
    return (
        f"{name} is not a preset: supports, loads and a thickness are missing; let dsfab propose them, "
        f"dsfab.run(dsfab.preset_for(mesh)), or write for instance {EXAMPLE}"
    )
