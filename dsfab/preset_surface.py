"""The [surface] section of a preset: a mesh file or a procedural shape, what holds it and what presses on it."""

import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from annotated_types import Ge
from pydantic import BaseModel, ConfigDict, Discriminator, Tag, create_model

from dsfab.surface import SHAPES, Combination, Load, Support, Surface, read_surface, refined


class Section(BaseModel):
    """A section of a preset: frozen, and no key that dsfab does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True, allow_inf_nan=False)


class Given(Section):
    """What every surface has, wherever it comes from."""

    support: tuple[Support, ...] = ()
    load: tuple[Load, ...] = ()
    combination: tuple[Combination, ...] = ()
    """Sums of load cases (`case` of a load), each case multiplied with its factor."""
    refine: Annotated[float, Ge(0)] = 0.0
    """Metres; triangles are divided until no edge is longer. 0 leaves them as they are."""
    smooth: bool = False
    """Whether refining also rounds the facets (Loop subdivision)."""

    def build(self) -> Surface:
        """The surface itself; raises SurfaceError."""
        return refined(self.given(), self.refine, self.smooth) if self.refine else self.given()

    def given(self) -> Surface:
        """The surface before it is refined."""
        raise NotImplementedError


class FileSurface(Given):
    """A surface read from a mesh file."""

    file: Path
    """OBJ, PLY, STL, OFF, GLB or 3MF; relative paths start at the preset's folder."""
    unit: str | None = None
    """Unit of the file's numbers: mm, cm, m, in, ft ...; GLB and 3MF files know their own."""

    def given(self) -> Surface:
        return read_surface(self.file, self.unit)


class ShapeSurface(Given):
    """A procedural surface; each shape adds its own parameters."""

    shape: str

    def given(self) -> Surface:
        others = set(Given.model_fields) | {"shape"}
        return SHAPES[self.shape](**{k: v for k, v in self if k not in others})


def _shape_model(name: str) -> type[ShapeSurface]:
    """The section for one shape: its parameters, defaults and ranges are those of the function that makes it."""
    signature = inspect.signature(SHAPES[name], eval_str=True)
    fields: dict[str, Any] = {p.name: (p.annotation, p.default) for p in signature.parameters.values()}
    fields["shape"] = (Literal[name], name)
    return create_model(f"{name}_surface", __base__=ShapeSurface, **fields)


def _kind_of_surface(value: Any) -> str | None:
    values: dict[str, Any] = value if isinstance(value, dict) else getattr(value, "__dict__", {})
    return "file" if values.get("file") is not None else values.get("shape")


SHAPE_SECTIONS = {name: _shape_model(name) for name in SHAPES}
if TYPE_CHECKING:
    AnySurface = Given
else:
    _choices = {"file": FileSurface, **SHAPE_SECTIONS}
    AnySurface = Annotated[
        Union[tuple(Annotated[model, Tag(tag)] for tag, model in _choices.items())],  # noqa: UP007
        Discriminator(_kind_of_surface),
    ]
