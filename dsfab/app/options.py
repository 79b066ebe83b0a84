"""Options that several commands share."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from dsfab.app.terminal import Reporter, print_lines
from dsfab.core.errors import DsfabError, PresetError
from dsfab.core.messages import byte_size, table

if TYPE_CHECKING:
    from dsfab.design.design import Design
    from dsfab.export import Estimate
    from dsfab.preset.model import Preset
    from dsfab.preset.proposal import MeshWishes, Proposal


Switch = partial(Parameter, negative=())  # Marks a flag that has no opposite flag --no-NAME.
OutputName = partial(Parameter, name=["-o", "--output"])  # Parameter for a file or a folder of results.
SMALLEST, LARGEST = 64, 8000  # Limits on the sides of a picture, pixels.
Set = Annotated[
    tuple[str, ...], Parameter(name="--set", negative=(), help="Replace a value of the preset: KEY=VALUE (repeatable).")
]
Mesh = Annotated[Path | None, Parameter(name="--mesh", help="Mesh file that takes the place of the preset's surface.")]
Quiet = Annotated[bool, Switch(name=["--quiet", "-q"], help="Print errors only.")]
Unit = Annotated[str | None, Parameter(name="--unit", help="Unit of the mesh file: mm, cm, m, in, ft.")]
Up = Annotated[
    str | None, Parameter(name="--up", help="Axis of the mesh file that points to the sky: x, y, z, -x, -y, -z.")
]
MaxTriangles = Annotated[
    int | None, Parameter(name="--max-triangles", help="Largest number of triangles of the mesh file [4 million].")
]

View = Annotated[str, Parameter(help="Direction of view: iso, top, front, side, or azimuth,elevation in degrees.")]
Show = Annotated[
    str,
    Parameter(
        help="What to draw: structure, families, stress, major, minor; of the uncut sheet: loads, directions, "
        "major_mode, "
        "minor_mode, vonmises, utilisation, energy, displacement, buckling, frequency; fabrication (preview only): the "
        "finished solid with marks at its smallest member, gap, wall and edge; members (preview only): the finished "
        "sheet with the names of its members."
    ),
]


def picture_size(text: str) -> tuple[int, int]:
    """Return width and height (pixels) from a text such as '1600x1200'. Raises DsfabError for an invalid text."""
    words = text.lower().split("x")
    if len(words) == 2 and all(word.isdigit() for word in words):
        width, height = int(words[0]), int(words[1])
        if all(SMALLEST <= side <= LARGEST for side in (width, height)):
            return width, height
    raise DsfabError(
        f"--size {text!r} is not WIDTHxHEIGHT with sides of {SMALLEST} to {LARGEST} pixels, such as 1600x1200"
    )


def built_folder(name: str) -> Path | None:
    """Return the path of a folder of `dsfab build`; None for a preset or file. Raises PresetError for other folders."""
    from dsfab.core.toml_files import shipped_presets

    folder = Path(name)
    if name in shipped_presets() or not folder.is_dir():
        return None
    from dsfab.export import complete_folder

    complete_folder(folder)
    if not (folder / "preset.toml").is_file():
        raise PresetError(f"{folder} has no preset.toml, so dsfab did not build it; give a preset or a built folder")
    return folder


Stand = Annotated[
    str | None,
    Parameter(
        name="--stand",
        help="Supports of the mesh: feet, loops (column heads), edge (all around), ring (inner edge), edges (both), "
        "hung, ends, sides, posts, corners, tent, walls, hollows, columns, base. A height in metres supports the edge "
        "up to this height above its lowest point. [dsfab chooses]",
    ),
]
BuiltIn = Annotated[bool, Switch(name="--built-in", help="Clamp the mesh at its supports: it cannot rotate there.")]
LoadWish = Annotated[
    tuple[str, ...],
    Parameter(
        name="--load",
        negative=(),
        help="Load of a mesh besides its weight: snow, wind, people, services or none; with a value in kPa: snow=1.2 "
        "(repeatable).",
    ),
]
Only = Annotated[
    tuple[str, ...],
    Parameter(
        name="--only",
        negative=(),
        help="Read only this layer, block, node, object, assembly or storey of the mesh file (repeatable).",
    ),
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class MeshFlags:
    """Options for the parts, supports and loads of a mesh."""

    stand: Stand = None
    built_in: BuiltIn = False
    load: LoadWish = ()
    only: Only = ()

    @property
    def wishes(self) -> "MeshWishes":
        """The user's choices for the parts, supports and loads of a mesh."""
        from dsfab.preset.proposal import MeshWishes

        return MeshWishes(self.stand or "", self.built_in, self.load, self.only)


NO_MESH_FLAGS = MeshFlags()  # No option is set, so dsfab chooses supports and loads.


@Parameter(name="*")
@dataclass(frozen=True)
class Source(MeshFlags):
    """Options of the command line that change a preset."""

    set_: Set = ()
    mesh: Mesh = None
    unit: Unit = None
    up: Up = None
    max_triangles: MaxTriangles = None

    def read_preset(
        self, name: str, proposal: "Proposal | None" = None, thickness: Literal["sized", "guessed", "open"] = "sized"
    ) -> "Preset":
        """Return the preset of a name or file, with these options' changes. proposal : proposed preset for a mesh.
        thickness : what replaces the thickness `auto`: "sized" a computed value, "guessed" a guess, "open" nothing.
        Raises PresetError for an unknown or invalid preset."""
        from dsfab.preset.file import load_preset, require_mesh, with_overrides

        proposal = proposal or self.proposal(name)
        if proposal:
            preset = with_overrides(proposal.preset, self.overrides())
        else:
            preset = load_preset(name, self.overrides(), self.mesh)
            if self.mesh is None:
                require_mesh(preset)
        if thickness == "open" or preset.statics.is_sized:
            return preset
        from dsfab.study import guessed_preset, sized_preset

        if thickness == "guessed":
            return guessed_preset(preset)
        return _built_preset(preset) or sized_preset(preset)

    def proposal(self, name: str) -> "Proposal | None":
        """Return the preset that dsfab proposes for a mesh file; None if `name` is a preset."""
        from dsfab.preset.proposal import OWN, propose
        from dsfab.surface import MESH_SUFFIXES

        suffix = Path(name).suffix.lower()
        # an unknown suffix counts as a mesh, because the mesh reader's error lists the formats
        is_mesh_file = suffix in MESH_SUFFIXES or (Path(name).is_file() and suffix not in ("", ".toml"))
        mesh_file = name if is_mesh_file else self.mesh if name == OWN else None
        if mesh_file is None:
            self._require_no_wishes(name)
            return None
        if mesh_file is name and self.mesh is not None:
            raise PresetError(f"{name} and --mesh {self.mesh} name two meshes; leave one of the meshes out")
        material = self.overrides().get("statics.material")
        material = material if isinstance(material, str) else None
        return propose(Path(mesh_file), self.unit, self.up, material, self.max_triangles, wishes=self.wishes)

    def _require_no_wishes(self, name: str) -> None:
        if self.stand or self.built_in or self.load:
            raise PresetError(
                f"{name} is a preset, which states supports and loads; --stand, --built-in and --load need a mesh file"
            )

    def overrides(self) -> dict[str, Any]:
        """Return all changes of the preset, by dotted key. Raises PresetError for invalid options."""
        options = {"unit": self.unit, "up": self.up, "max_triangles": self.max_triangles, "only": [*self.only] or None}
        return self.set_values() | {f"surface.{key}": value for key, value in options.items() if value is not None}

    def set_values(self) -> dict[str, Any]:
        """Return the values of --set, by dotted key. Raises PresetError for a text without the form KEY=VALUE."""
        from dsfab.preset.file import parse_override

        return dict(parse_override(text) for text in self.set_)

    def with_overrides(self, *texts: str) -> "Source":
        """Return a copy with further changes. texts : changes of the form KEY=VALUE."""
        return replace(self, set_=(*self.set_, *texts))

    def command_words(self, name: str) -> list[str]:
        """Return arguments of a command line: the preset `name` and these options."""
        words = [name, *(word for text in self.set_ for word in ("--set", text))]
        words += ["--mesh", str(self.mesh)] if self.mesh is not None else []
        words += ["--unit", self.unit] if self.unit is not None else []
        words += ["--stand", self.stand] if self.stand is not None else []
        words += ["--built-in"] * self.built_in + [word for text in self.load for word in ("--load", text)]
        words += [word for name in self.only for word in ("--only", name)]
        words += ["--max-triangles", str(self.max_triangles)] if self.max_triangles is not None else []
        return words + (["--up", self.up] if self.up is not None else [])


def _built_preset(preset: "Preset") -> "Preset | None":
    from dsfab.preset.file import load_preset

    path, mesh = Path("outputs") / preset.name / "preset.toml", getattr(preset.surface, "file", None)
    if not path.is_file() or (mesh and mesh.is_file() and mesh.stat().st_mtime > path.stat().st_mtime):
        return None
    try:
        built = load_preset(path)
        sized = preset.with_thickness(built.statics.thickness)
    except DsfabError:
        return None
    a, b = (choices.model_dump(exclude={"surface": {"file", "mesh"}, "export": True}) for choices in (sized, built))
    return sized if a == b else None


UNCHANGED = Source()  # The preset without changes.


@Parameter(name="*")
@dataclass(frozen=True)
class StepFlags:
    """Options of STEP files."""

    step: Annotated[
        str | None,
        Parameter(
            help="Method for STEP: auto, quick, planar (flat, folded), members, smooth or compact (curved), faceted, "
            "tessellated."
        ),
    ] = None
    max_faces: Annotated[int | None, Parameter(help="Largest number of faces of a STEP file [export.step_faces].")] = (
        None
    )
    max_mb: Annotated[
        float | None, Parameter(help="Largest size of a STEP file in MB; 0: no limit [export.step_mb].")
    ] = None
    estimate: Annotated[
        bool, Switch(name="--estimate", help="Print size and time of each method for STEP, and write no file.")
    ] = False

    def overrides(self) -> tuple[str, ...]:
        """Return these options as texts KEY=VALUE."""
        options = {"step": self.step, "step_faces": self.max_faces, "step_mb": self.max_mb}
        return tuple(f"export.{key}={json.dumps(value)}" for key, value in options.items() if value is not None)


NO_FLAGS = StepFlags()  # No option is set, so the preset's own STEP options apply.


def estimate_step(preset: "Preset", reporter: Reporter, built: "Design | None" = None) -> int:
    """Print the expected number of faces, size, times and memory of a STEP file; return the exit code 0.
    built : design to estimate; None to compute the design of `preset`."""
    from dsfab.design import run

    with reporter:
        design = built or run(preset, reporter)
        reporter("export", "estimating STEP")
        lines = list(estimate_lines(design))
    print_lines(lines)
    return 0


def estimate_lines(design: "Design") -> Iterator[str]:
    """Yield a table of the methods to write a design as STEP, then notes, and reasons why a method is impossible."""
    from dsfab.design.output.files import deliverable
    from dsfab.export import step_estimates

    content, options = deliverable(design, ".step")
    options.pop("details", None)  # details such as the material hardly change the size of a STEP file
    estimates = step_estimates(content, name=design.preset.name, **options)
    head = ("STEP", "faces", "size", "write s", "open s", "memory to open", "")
    yield table(head, [_estimate_row(estimate) for estimate in estimates])
    for estimate in estimates:
        if estimate.refused or estimate.note:
            yield f"  {estimate.way}: {estimate.refused or estimate.note}"
    if not any(estimate.chosen for estimate in estimates):
        yield "no method can write a STEP file within the limits; raise --max-faces or --max-mb, or write stl or 3mf"


def _estimate_row(estimate: "Estimate") -> tuple[str, ...]:
    mark = "<- chosen" if estimate.chosen else ("refused" if estimate.refused else "")
    if not estimate.faces:
        return (estimate.way, *["-"] * 5, mark)
    times = (f"{estimate.write_seconds:.3g}", f"{estimate.open_seconds:.2g}")
    return (estimate.way, f"{estimate.faces:,}", byte_size(estimate.size), *times, byte_size(estimate.memory), mark)
