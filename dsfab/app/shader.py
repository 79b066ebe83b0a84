"""The shader that draws an uncut surface as if it were cut: a pixel that no stripe or kept region covers is discarded.

It asks the question that slicing answers with cuts, material is |z - k| < d for an integer k, from the same linear
fields at every pixel. So a change of pattern is a change of a few numbers on the graphics side.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dsfab.app.scene import Bytes, Colour, Floats32
from dsfab.app.window import put
from dsfab.arrays import Floats, Ints
from dsfab.pattern.wave import GLSL

FAR = 1e30
"""Distance from what is not there: infinity times a weight of zero would be no number."""

NO_REACH = -FAR
"""A reach that keeps nothing; with 0, values interpolated to just below 0 at the silhouette would be kept."""

BY_VERTEX = -1.0
"""A half-width of this value, as a uniform, is read at the vertices."""

SHADE = 0.82
"""Walls are this much darker than the faces beside them, apart from the light on them."""

STEEPEST = 4.0
"""A slab that is seen along itself shows at most this many half thicknesses of its wall."""

_DECLARED = "//VTK::CustomUniforms::Dec"
_VERTEX = (
    (
        _DECLARED,
        "in vec4 stripesMC;\nin vec2 keptMC;\nout vec4 stripesVS;\nout vec2 keptVS;\nout vec3 dsWhere;\n",
    ),
    ("//VTK::CustomBegin::Impl", "  stripesVS = stripesMC;\n  keptVS = keptMC;\n  dsWhere = vertexMC.xyz;\n"),
)
_FRAGMENT = (
    (
        _DECLARED,
        f"""in vec4 stripesVS;
in vec2 keptVS;
in vec3 dsWhere;
{GLSL}
"""
        """
// how deep in material: of the major and of the minor stripes, and of what is kept; material is > 0
vec3 dsDepth(vec4 stripes, vec2 kept) {
  vec2 d = vec2(dsHalfWidth.x < 0.0 ? stripes.z : dsHalfWidth.x, dsHalfWidth.y < 0.0 ? stripes.w : dsHalfWidth.y);
  vec2 z = dsFrequency * stripes.xy + dsPhase;
  float major = dsShown.x < 0.5 ? -1.0 : d.x >= 0.5 ? 1.0 : wave(z.x) - (1.0 - 4.0 * d.x);
  float minor = dsShown.y < 0.5 ? -1.0 : d.y >= 0.5 ? 1.0 : wave(z.y) - (1.0 - 4.0 * d.y);
  vec2 reach = dsReach - kept;
  return vec3(major, minor, max(reach.x, reach.y));
}
float dsMost(vec3 depth) { return max(depth.x, max(depth.y, depth.z)); }
""",
    ),
    (
        "//VTK::Clip::Impl",
        """
  vec3 dsHere = dsDepth(stripesVS, keptVS);
  if (dsMost(dsHere) <= 0.0) discard;
""",
    ),
)


# a slab: the ray goes through it sideways, and so through the fields, which are linear here; it ends in face or wall.
# A program of its own: software rendering runs both sides of every `if`
_WALLS = (
    "//VTK::Clip::Impl",
    """
  vec3 dsWall = vec3(0.0);
  vec3 px = dFdx(dsWhere), py = dFdy(dsWhere), ray = normalize(dsWhere - dsEye);
  vec4 sx = dFdx(stripesVS), sy = dFdy(stripesVS);
  vec2 kx = dFdx(keptVS), ky = dFdy(keptVS);
  vec3 normal = normalize(cross(px, py));
  float along = dot(ray, normal);
  vec3 across = (ray - along * normal) * dsThick / max(abs(along), dsSteep);
  float xx = dot(px, px), xy = dot(px, py), yy = dot(py, py), det = max(xx * yy - xy * xy, 1e-30);
  vec2 ab = vec2(dot(across, px) * yy - dot(across, py) * xy, dot(across, py) * xx - dot(across, px) * xy) / det;
  vec4 ds = ab.x * sx + ab.y * sy;
  vec2 dk = ab.x * kx + ab.y * ky;
  vec3 dsHere = dsDepth(stripesVS - ds, keptVS - dk);
  bool top = dsMost(dsHere) > 0.0;
  for (float t = -0.75; t < 1.01 && dsMost(dsHere) <= 0.0; t += 0.25) {
    dsHere = dsDepth(stripesVS + t * ds, keptVS + t * dk);
  }
  if (!top && dsMost(dsHere) > 0.0) {
    vec2 g = 0.5 * vec2(dsMost(dsDepth(stripesVS + sx, keptVS + kx)) - dsMost(dsDepth(stripesVS - sx, keptVS - kx)),
                        dsMost(dsDepth(stripesVS + sy, keptVS + ky)) - dsMost(dsDepth(stripesVS - sy, keptVS - ky)));
    dsWall = -((g.x * yy - g.y * xy) * px + (g.y * xx - g.x * xy) * py) / det;
    dsWall = dot(dsWall, dsWall) > 0.0 ? normalize(dsWall) : -normalize(across);
  }
  if (dsMost(dsHere) <= 0.0) discard;
""",
)


_COLOURS = "//VTK::TCoord::Impl"
_TINTED = "  gl_FragData[0].rgb = dsHere.x > 0.0 ? dsMajor : dsHere.y > 0.0 ? dsMinor : dsKept;\n"
_WALL_COLOUR = "  if (dot(dsWall, dsWall) > 0.0) gl_FragData[0].rgb *= dsShade;\n"
_WALL_NORMAL = "  if (dot(dsWall, dsWall) > 0.0) gl_FragData[0].rgb = 0.5 * dsWall + 0.5;\n"


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
    tints  : colours of major, minor and kept material in place of those of the faces.
    """

    fields: Floats
    tints: tuple[Colour, Colour, Colour] | None = None
    _parts: list[dict[str, Any]] = field(default_factory=list)
    _walls: bool = False
    _normals: bool = False

    def attach(self, actor: Any, mapper: Any, mesh: Any, source: Ints) -> None:
        """Put the shader on an actor; `source` (k,) is the body's vertex that each point of its mesh comes from."""
        from vtkmodules.vtkCommonDataModel import vtkDataObject

        self._parts.append({"actor": actor, "mesh": mesh, "source": source, "program": (False, "")})
        self.replace_fields(self.fields)
        for name in ("stripes", "kept"):
            mapper.MapDataArrayToVertexAttribute(name + "MC", name, vtkDataObject.FIELD_ASSOCIATION_POINTS, -1)
        code = actor.GetShaderProperty()
        for tag, text in _VERTEX:
            code.AddVertexShaderReplacement(tag, True, f"{tag}\n{text}", False)
        for tag, text in _FRAGMENT:
            code.AddFragmentShaderReplacement(tag, True, f"{tag}\n{text}", False)
        self.set(WHOLE)
        self.look(None, 0.0)
        for uniforms in self._uniforms():
            uniforms.SetUniformf("dsSteep", 1 / STEEPEST)
            uniforms.SetUniformf("dsShade", SHADE)
            for name, tint in zip(("dsMajor", "dsMinor", "dsKept"), self.tints or 3 * ((0, 0, 0),), strict=True):
                uniforms.SetUniform3f(name, [value / 255 for value in tint])
        self.colour_by("colour")

    def replace_fields(self, fields: Floats) -> None:
        """Other modes, half-widths or distances, (n, 6), on the same geometry."""
        self.fields = fields
        values: Floats32 = np.where(np.isfinite(fields), fields, FAR).astype(np.float32)
        for part in self._parts:
            mesh, at = part["mesh"], part["source"]
            put(mesh.GetPointData(), "stripes", values[at, :4])
            put(mesh.GetPointData(), "kept", values[at, 4:])

    def recolour(self, face: Bytes) -> None:
        """Other colours of the faces, (m, 3)."""
        for part in self._parts:
            put(part["mesh"].GetCellData(), "colour", face)

    def set(self, settings: Settings) -> None:
        """Other numbers: takes microseconds."""
        for uniforms in self._uniforms():
            uniforms.SetUniform2f("dsFrequency", settings.frequency)
            uniforms.SetUniform2f("dsPhase", settings.phase)
            uniforms.SetUniform2f("dsHalfWidth", settings.half_width)
            uniforms.SetUniform2f("dsReach", settings.reach)
            uniforms.SetUniform2f("dsShown", settings.shown)

    def look(self, eye: Floats | None, half: float) -> None:
        """Show the walls of a sheet of this half thickness, as seen from `eye`, both in the scene's units; or none.

        A hint, no solid: walls are those of a slab in the plane of each triangle, and the rim of the surface has none.
        """
        self._walls = eye is not None and half > 0
        self._program()
        for uniforms in self._uniforms():
            uniforms.SetUniform3f("dsEye", [0.0, 0.0, 0.0] if eye is None else [float(x) for x in eye])
            uniforms.SetUniformf("dsThick", half if self._walls else 0.0)

    def colour_by(self, name: str) -> None:
        """Give out 'colour' or 'normal'."""
        self._normals = name == "normal"
        self._program()

    def _program(self) -> None:
        """Put together what the fragments need, and no more: VTK keeps the programs that it has compiled."""
        colour = _TINTED if self.tints and not self._normals else ""
        if self._walls:
            colour += _WALL_NORMAL if self._normals else _WALL_COLOUR
        for part in self._parts:
            if part["program"] == (self._walls, colour):
                continue
            part["program"] = (self._walls, colour)
            code = part["actor"].GetShaderProperty()
            for tag, text in (_WALLS if self._walls else _FRAGMENT[1], (_COLOURS, colour)):
                code.AddFragmentShaderReplacement(tag, True, f"{tag}\n{text}", False)

    def _uniforms(self) -> list[Any]:
        return [part["actor"].GetShaderProperty().GetFragmentCustomUniforms() for part in self._parts]
