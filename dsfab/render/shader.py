"""Shader that draws an uncut surface as if it were cut.

Material is where |z - k| < d for an integer k. Phase z and half-width d are linear on each face."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from dsfab.core.arrays import Floats, Ints
from dsfab.pattern.stripes import GLSL
from dsfab.render.scene import Bytes, Colour, Floats32, set_array

INFINITE_DISTANCE = 1e30  # distance (m) in place of infinity, because infinity times 0 is not a number
NO_REACH = -INFINITE_DISTANCE  # no material is kept; 0 would keep material where rounding makes distances negative
BY_VERTEX = -1.0  # half-width that tells the shader to read half-widths at the vertices

_DECLARED, _VERTEX_CODE = "//VTK::CustomUniforms::Dec", "//VTK::CustomBegin::Impl"
_CLIP, _COLOURS = "//VTK::Clip::Impl", "//VTK::TCoord::Impl"

FIELDS = ("modes", "widths", "kept")  # names of the three pairs of columns of `StripeShader.fields`
TIE = 2e-6  # rounding margin (periods): half-width 0 must draw nothing, 1/2 everything

# (wave(t) + 1) / 4 is the distance from phase t to the nearest half-integer. A stripe of half-width d covers a pixel
# if this distance exceeds 1/2 - d. The vertex shader computes t - 1/2 and 1/2 - d, to save time per pixel.
_STRIPES = f"""
  vec2 dsWide = HALF;
  vec2 dsTie = vec2(dsWide.x > 0.0 ? -{TIE} : {TIE}, dsWide.y > 0.0 ? -{TIE} : {TIE});
  dsStripes = vec4(dsFrequency * modesMC + dsPhase - 0.5, 0.5 - dsWide + dsTie);
"""
_HALF = "vec2(dsDrawn.x < 0.0 ? widthsMC.x : dsDrawn.x, dsDrawn.y < 0.0 ? widthsMC.y : dsDrawn.y)"
_REACHED = "  dsReached = dsReach - keptMC;\n"
_THIN = """
  vec2 dsOff = abs(dsStripes.xy - roundEven(dsStripes.xy));
  vec3 dsHere = vec3(dsOff - dsStripes.zw, REACHED);
  if (all(lessThanEqual(dsOff, dsStripes.zw)) && REACHED <= 0.0) discard;
"""
_DEPTH = """
// depth of a point in major stripes, minor stripes and kept material; a depth > 0 is inside
vec3 dsDepth(vec4 stripes, vec2 kept) {
  vec2 d = vec2(dsHalfWidth.x < 0.0 ? stripes.z : dsHalfWidth.x, dsHalfWidth.y < 0.0 ? stripes.w : dsHalfWidth.y);
  vec2 z = dsFrequency * stripes.xy + dsPhase;
  float major = dsShown.x < 0.5 ? -1.0 : d.x >= 0.5 ? 1.0 : wave(z.x) - (1.0 - 4.0 * d.x);
  float minor = dsShown.y < 0.5 ? -1.0 : d.y >= 0.5 ? 1.0 : wave(z.y) - (1.0 - 4.0 * d.y);
  vec2 reach = dsReach - kept;
  return vec3(major, minor, max(reach.x, reach.y));
}
float dsMost(vec3 depth) { return max(depth.x, max(depth.y, depth.z)); }
"""

# follows a ray from the eye through the thickness of the sheet, to a stripe's wall or the sheet's far face.
# a separate shader draws walls, because software rendering runs both branches of every `if`
_WALLS = """
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
"""
_TINTED = "  gl_FragData[0].rgb = dsHere.x > 0.0 ? dsMajor : dsHere.y > 0.0 ? dsMinor : dsRest;\n"
_WALL_COLOUR = "  if (dot(dsWall, dsWall) > 0.0) gl_FragData[0].rgb *= dsShade;\n"
_WALL_NORMAL = "  if (dot(dsWall, dsWall) > 0.0) gl_FragData[0].rgb = 0.5 * dsWall + 0.5;\n"


@dataclass(frozen=True)
class StripeSettings:
    """Values of a pattern for the shader, as pairs for the major and the minor family.
    half_width : half width of stripes, periods, 0 to 0.5, or `BY_VERTEX`.    shown : 1 for a visible family, else 0.
    reach      : widths (m) of material around loads and supports, and along the boundary; `NO_REACH` for none."""

    frequency: tuple[float, float] = (1.0, 1.0)
    phase: tuple[float, float] = (0.0, 0.0)
    half_width: tuple[float, float] = (0.5, 0.5)
    reach: tuple[float, float] = (NO_REACH, NO_REACH)
    shown: tuple[float, float] = (1.0, 1.0)


ALL_MATERIAL, NO_MATERIAL = StripeSettings(), StripeSettings(half_width=(0.0, 0.0))
"""Settings for a surface without openings, and for no material."""


@dataclass(frozen=True)
class ShaderProgram:
    """Optional parts of the shader's program. vary : names of values that differ between vertices.
    tinted : True if each family has its own colour."""

    vary: tuple[str, ...] = ("modes",)
    walls: bool = False
    normals: bool = False
    tinted: bool = False

    def vertex(self) -> tuple[tuple[str, str], ...]:
        """Return pairs for VTK's vertex shader: a tag in VTK's code, and the code to insert after this tag."""
        declared, code = [f"in vec2 {name}MC;" for name in self.vary], []
        if self.walls:
            declared.append("out vec4 stripesVS;\nout vec2 keptVS;\nout vec3 dsWhere;")
            widths_code, kept_code = (f"{name}MC" if name in self.vary else "vec2(0.0)" for name in FIELDS[1:])
            code.append(
                f"  stripesVS = vec4(modesMC, {widths_code});\n  keptVS = {kept_code};\n  dsWhere = vertexMC.xyz;\n"
            )
        else:
            declared.append("out vec4 dsStripes;")
            code.append(_STRIPES.replace("HALF", _HALF if "widths" in self.vary else "dsDrawn"))
            if "kept" in self.vary:
                declared.append("out vec2 dsReached;")
                code.append(_REACHED)
        return (_DECLARED, "\n".join(declared) + "\n"), (_VERTEX_CODE, "".join(code))

    def fragment(self) -> tuple[tuple[str, str], ...]:
        """Return pairs for VTK's fragment shader: a tag in VTK's code, and the code to insert after this tag."""
        colour = _TINTED if self.tinted and not self.normals else ""
        if self.walls:
            declared = f"in vec4 stripesVS;\nin vec2 keptVS;\nin vec3 dsWhere;\n{GLSL}\n{_DEPTH}"
            colour += _WALL_NORMAL if self.normals else _WALL_COLOUR
            return (_DECLARED, declared), (_CLIP, _WALLS), (_COLOURS, colour)
        reads_kept = "kept" in self.vary
        declared = "in vec4 dsStripes;\n" + ("in vec2 dsReached;\n" if reads_kept else "")
        thin = _THIN.replace("REACHED", "max(dsReached.x, dsReached.y)" if reads_kept else "-1.0")
        return (_DECLARED, declared), (_CLIP, thin), (_COLOURS, colour)


@dataclass(eq=False)
class StripeShader:
    """Shader of a body.
    fields : (n, 6) modes, half-widths (periods) of both families; distance (m) to loads and supports, and to boundary.
    tints  : colours of major, minor and remaining material; None for the colours of the faces."""

    fields: Floats
    tints: tuple[Colour, Colour, Colour] | None = None
    program: ShaderProgram = ShaderProgram()
    _parts: list[dict[str, Any]] = field(default_factory=list)

    def attach(self, actor: Any, mapper: Any, mesh: Any, source: Ints) -> None:
        """Use the shader for a VTK actor. source : (k,) row in `fields` for each point of the actor's mesh."""
        from vtkmodules.vtkCommonDataModel import vtkDataObject

        self._parts.append({"actor": actor, "mesh": mesh, "source": source, "program": None})
        self.replace_fields(self.fields)
        for name in FIELDS:
            mapper.MapDataArrayToVertexAttribute(name + "MC", name, vtkDataObject.FIELD_ASSOCIATION_POINTS, -1)
        self.set(ALL_MATERIAL)
        self.show_walls(None, 0.0)
        for uniforms in self._uniforms():
            uniforms.SetUniformf("dsSteep", 1 / 4.0)  # limits a ray's way along the sheet to 4 half-thicknesses
            uniforms.SetUniformf("dsShade", 0.82)  # walls are darker than faces
            for name, tint in zip(("dsMajor", "dsMinor", "dsRest"), self.tints or 3 * ((0, 0, 0),), strict=True):
                uniforms.SetUniform3f(name, [value / 255 for value in tint])
        self.colour_by("colour")

    def replace_fields(self, fields: Floats) -> None:
        """Replace the values `fields` (n, 6) at the vertices."""
        self.fields = fields
        values: Floats32 = np.where(np.isfinite(fields), fields, INFINITE_DISTANCE).astype(np.float32)
        for part in self._parts:
            mesh, source = part["mesh"], part["source"]
            for k, name in enumerate(FIELDS):
                set_array(mesh.GetPointData(), name, values[source, 2 * k : 2 * k + 2])

    def recolour(self, face: Bytes) -> None:
        """Replace the colours (m, 3) of the faces."""
        for part in self._parts:
            set_array(part["mesh"].GetCellData(), "colour", face)

    def set(self, settings: StripeSettings) -> None:
        """Replace the settings of the pattern."""
        shown_widths = [d if s > 0.5 else 0.0 for d, s in zip(settings.half_width, settings.shown, strict=True)]
        widths, reads_kept = min(shown_widths) < 0, max(settings.reach) > NO_REACH
        self._change_program(vary=("modes", *(("widths",) if widths else ()), *(("kept",) if reads_kept else ())))
        for uniforms in self._uniforms():
            uniforms.SetUniform2f("dsFrequency", settings.frequency)
            uniforms.SetUniform2f("dsPhase", settings.phase)
            uniforms.SetUniform2f("dsHalfWidth", settings.half_width)
            uniforms.SetUniform2f("dsDrawn", shown_widths)
            uniforms.SetUniform2f("dsReach", settings.reach)
            uniforms.SetUniform2f("dsShown", settings.shown)

    def show_walls(self, eye: Floats | None, half: float) -> None:
        """Show approximate walls as seen from `eye` (3,), scene units; None hides them. half : half the thickness."""
        walls = eye is not None and half > 0
        self._change_program(walls=walls)
        for uniforms in self._uniforms():
            uniforms.SetUniform3f("dsEye", [0.0, 0.0, 0.0] if eye is None else [float(x) for x in eye])
            uniforms.SetUniformf("dsThick", half if walls else 0.0)

    def colour_by(self, name: str) -> None:
        """Draw colours or normals in the pixels. name : "colour" or "normal"."""
        self._change_program(normals=name == "normal")

    def _change_program(self, **changes: Any) -> None:
        self.program = replace(self.program, tinted=self.tints is not None, **changes)
        for part in self._parts:
            if part["program"] == self.program:
                continue
            part["program"] = self.program
            code = part["actor"].GetShaderProperty()
            for tag, text in self.program.vertex():
                code.AddVertexShaderReplacement(tag, True, f"{tag}\n{text}", False)
            for tag, text in self.program.fragment():
                code.AddFragmentShaderReplacement(tag, True, f"{tag}\n{text}", False)

    def _uniforms(self) -> list[Any]:
        codes = [part["actor"].GetShaderProperty() for part in self._parts]
        return [uniforms for c in codes for uniforms in (c.GetVertexCustomUniforms(), c.GetFragmentCustomUniforms())]
