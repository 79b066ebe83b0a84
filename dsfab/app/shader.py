"""The shader that draws an uncut surface as if it were cut: a pixel that no stripe or kept region covers is discarded.

It asks the question that slicing answers with cuts, material is |z - k| < d for an integer k, from the same linear
fields at every pixel. So a change of pattern is a change of a few numbers on the graphics side.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dsfab.app.scene import Bytes, Floats32
from dsfab.arrays import Floats, Ints
from dsfab.pattern.wave import GLSL

FAR = 1e30
"""Distance from what is not there: infinity times a weight of zero would be no number."""

NO_REACH = -FAR
"""A reach that keeps nothing; with 0, values interpolated to just below 0 at the silhouette would be kept."""

BY_VERTEX = -1.0
"""A half-width of this value, as a uniform, is read at the vertices."""

_DECLARED = "//VTK::CustomUniforms::Dec"
_VERTEX = (
    (_DECLARED, "in vec4 stripesMC;\nin vec2 keptMC;\nout vec4 stripesVS;\nout vec2 keptVS;\n"),
    ("//VTK::CustomBegin::Impl", "  stripesVS = stripesMC;\n  keptVS = keptMC;\n"),
)
_FRAGMENT = (
    (_DECLARED, f"in vec4 stripesVS;\nin vec2 keptVS;\n{GLSL}\n"),
    (
        "//VTK::Clip::Impl",
        """
  vec2 dsD = vec2(dsHalfWidth.x < 0.0 ? stripesVS.z : dsHalfWidth.x, dsHalfWidth.y < 0.0 ? stripesVS.w : dsHalfWidth.y);
  vec2 dsZ = dsFrequency * stripesVS.xy + dsPhase;
  bool dsMajor = dsShown.x > 0.5 && (dsD.x >= 0.5 || wave(dsZ.x) > 1.0 - 4.0 * dsD.x);
  bool dsMinor = dsShown.y > 0.5 && (dsD.y >= 0.5 || wave(dsZ.y) > 1.0 - 4.0 * dsD.y);
  if (!(dsMajor || dsMinor || any(lessThan(keptVS, dsReach)))) discard;
""",
    ),
)


@dataclass(frozen=True)
class Settings:
    """The numbers of a pattern, of the major and of the minor family each.

    half_width : periods, 0 to 0.5, or `BY_VERTEX`.    shown : whether a family is drawn.
    reach      : metres kept around loads and supports, and at the rim, or `NO_REACH`.
    """

    frequency: tuple[float, float] = (1.0, 1.0)
    phase: tuple[float, float] = (0.0, 0.0)
    half_width: tuple[float, float] = (0.5, 0.5)
    reach: tuple[float, float] = (NO_REACH, NO_REACH)
    shown: tuple[float, float] = (1.0, 1.0)


WHOLE, NOTHING = Settings(), Settings(half_width=(0.0, 0.0))
"""All of the surface, and none of it: what a working shader draws wholly, and leaves away wholly."""


@dataclass(eq=False)
class StripeShader:
    """The shader of one body; `fields` and `settings` may be changed between pictures.

    fields : (n, 6) modes, half-widths in periods (major, minor each), distances in metres to what is kept and to the
             boundary.
    """

    fields: Floats
    _parts: list[Mapping[str, Any]] = field(default_factory=list)

    def attach(self, actor: Any, mapper: Any, mesh: Any, source: Ints) -> None:
        """Put the shader on an actor; `source` (k,) is the body's vertex that each point of its mesh comes from."""
        from vtkmodules.vtkCommonDataModel import vtkDataObject

        self._parts.append({"actor": actor, "mesh": mesh, "source": source})
        self.replace_fields(self.fields)
        for name in ("stripes", "kept"):
            mapper.MapDataArrayToVertexAttribute(name + "MC", name, vtkDataObject.FIELD_ASSOCIATION_POINTS, -1)
        code = actor.GetShaderProperty()
        for tag, text in _VERTEX:
            code.AddVertexShaderReplacement(tag, True, f"{tag}\n{text}", False)
        for tag, text in _FRAGMENT:
            code.AddFragmentShaderReplacement(tag, True, f"{tag}\n{text}", False)
        self.set(WHOLE)

    def replace_fields(self, fields: Floats) -> None:
        """Other modes, half-widths or distances, (n, 6), on the same geometry."""
        self.fields = fields
        values: Floats32 = np.where(np.isfinite(fields), fields, FAR).astype(np.float32)
        for part in self._parts:
            mesh, at = part["mesh"], part["source"]
            mesh.point_data["stripes"] = np.ascontiguousarray(values[at, :4])
            mesh.point_data["kept"] = np.ascontiguousarray(values[at, 4:])

    def recolour(self, face: Bytes) -> None:
        """Other colours of the faces, (m, 3)."""
        for part in self._parts:
            part["mesh"].cell_data["colour"] = np.array(face)

    def set(self, settings: Settings) -> None:
        """Other numbers: takes microseconds."""
        for part in self._parts:
            uniforms = part["actor"].GetShaderProperty().GetFragmentCustomUniforms()
            uniforms.SetUniform2f("dsFrequency", settings.frequency)
            uniforms.SetUniform2f("dsPhase", settings.phase)
            uniforms.SetUniform2f("dsHalfWidth", settings.half_width)
            uniforms.SetUniform2f("dsReach", settings.reach)
            uniforms.SetUniform2f("dsShown", settings.shown)
