"""Presets: all choices of a design, one section per stage.

The models define keys, units, defaults and allowed ranges. `dsfab.preset.file` reads and writes them as TOML."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt
from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    PlainSerializer,
    Tag,
    WrapValidator,
    field_validator,
    model_validator,
)

from dsfab.core.errors import PatternError
from dsfab.core.units import GRAVITY
from dsfab.diffusion import Labelling, symmetry_group
from dsfab.diffusion.tensors import ISOTROPY
from dsfab.pattern import JUMP, Guide, Rule, Stripes, Widths
from dsfab.preset.checks import (
    AUTO_THICKNESS,
    auto_or_metres,
    case_mistakes,
    combines,
    follow_weights,
    judged_names,
    known_name,
    modulus,
    own_values,
    require_strength,
    resistance,
    specific_mass,
    thickness_or_auto,
    with_material,
)
from dsfab.preset.sections import Eurocode, Sizing, Workshop
from dsfab.preset.surface_section import AnySurface, Section, plain, surface_table
from dsfab.statics import Bending, Elements, Law, Material, Membrane, ResultRequest, SheetMaterial
from dsfab.surface import (
    Combination,
    LimitState,
    Load,
    PatternRegion,
    Vertices,
    action_mistakes,
    region_key,
    self_contained,
)
from dsfab.thickening import Extra, Side

STAGES = ("surface", "statics", "diffusion", "pattern", "slicing", "thickening", "export")  # Stages in their order.


class Statics(Section):
    """[statics]: the sheet's material, thickness and elements."""

    thickness: Annotated[float, Gt(0), WrapValidator(thickness_or_auto), PlainSerializer(auto_or_metres)]
    """Thickness of the sheet and of the solid, metres. auto: the smallest that meets the targets of [sizing]."""
    material: Annotated[str | None, AfterValidator(known_name)] = None
    """S235, GL24h, ... (see `dsfab materials`): gives default values of young, poisson, density and strength."""
    young: Annotated[float, Gt(0), AfterValidator(modulus)] = 210e9
    """Young's modulus, Pa."""
    poisson: Annotated[float, Gt(-1), Lt(0.5)] = 0.3
    density: Annotated[float, Ge(0), AfterValidator(specific_mass)] = 7850.0
    """Density, kg/m3."""
    law: Law = "plane_stress"
    """Material law: plane_stress (a thin sheet) or stvk (Saint Venant-Kirchhoff, exactly as in the paper)."""
    membrane: Membrane = "constant"
    """Membrane elements: constant strain (Madan et al.); quadratic or hybrid: slower, accurate in slender parts."""
    bending: Bending = "hinge"
    """Bending elements. hinge: for directions of the pattern (Madan et al.). midedge: converges to plate theory. hhj:
    most accurate."""
    stress: Literal["membrane", "layers", "auto"] = "membrane"
    """Stress that the pattern follows. membrane: stress in the middle of the thickness (Madan et al.); for a flat sheet
    that only bends, stress at its lower side. layers: stress of the whole thickness, with bending. auto: layers if
    bending stores at least half of the strain energy, else membrane."""
    strength: Annotated[float, Ge(0), AfterValidator(resistance)] = 0.0
    """Strength (Pa), with which the largest stress is compared: 235e6 for steel S235. 0: no comparison."""
    frequencies: Annotated[int, Ge(0), Le(10)] = 0
    """Number of natural frequencies of the uncut sheet to compute."""
    buckling: Annotated[int, Ge(0), Le(10)] = 0
    """Number of buckling factors of the uncut sheet to compute."""
    snow_mass: Annotated[float, Ge(0), Le(1)] = 0.0
    """Share of the snow that vibrates with the sheet, such as psi_2 of EN 1990. Permanent loads always vibrate."""
    check: bool = True
    """Refuse a sheet that moves by over a tenth of its span or stands on one vertex. Also refuse a support or load far
    from the surface. false: only report these faults."""

    _named = model_validator(mode="before")(with_material)

    def __eq__(self, other: object) -> bool:
        """Compare all values except the name of the material."""
        return isinstance(other, Statics) and self._values == other._values

    def __hash__(self) -> int:
        return hash(self._values)

    @property
    def _values(self) -> tuple[Any, ...]:
        return tuple(value for key, value in self if key != "material")

    @property
    def elastic(self) -> Material:
        """Young's modulus, Poisson's ratio and density."""
        return Material(self.young, self.poisson, self.density)

    @property
    def area_weight(self) -> float:
        """Weight of the uncut sheet, N/m2."""
        return self.density * self.thickness * GRAVITY

    def sheet(self, thickness: float | None = None) -> SheetMaterial:
        """Return the sheet's material and thickness (m); the default is the preset's thickness."""
        return SheetMaterial(self.elastic, self.thickness if thickness is None else thickness, self.law)

    @property
    def material_words(self) -> str:
        """Name of the material, such as 'GL24h'; 'GL24h, but for density' if the density differs; '' if unknown."""
        own_keys = own_values(dict(self))
        return f"{self.material}, but for {', '.join(own_keys)}" if self.material and own_keys else self.material or ""

    @property
    def is_sized(self) -> bool:
        """True if the thickness is a number, False for auto."""
        return self.thickness != AUTO_THICKNESS

    def require_strength(self) -> None:
        """Raise PresetError if the preset has neither a material nor a strength."""
        require_strength(self.material, self.strength)

    @property
    def elements(self) -> Elements:
        """Kinds of membrane and bending elements."""
        return Elements(self.membrane, self.bending)

    @property
    def analyses(self) -> ResultRequest:
        """Requested results: strength check, natural frequencies and buckling factors."""
        return ResultRequest(self.strength, self.frequencies, self.buckling)


class Diffusion(Section):
    """[diffusion]: anisotropic diffusion that follows the stress, and its eigenmodes."""

    r: Annotated[float, Ge(1), Le(1e4)] = 100.0
    """Anisotropy ratio. With 1, the modes ignore the stress; with 10 to 100, the modes follow the stress."""
    gamma: Annotated[float, Gt(0)] = 1.0
    """Factor on the loads (force magnitude of Madan et al.). Only the choice of isotropic faces uses it."""
    labelling: Labelling = "signed"
    """Principal stress that major stripes follow. signed: the more tensile. magnitude: larger size (Madan et al.)."""
    isotropy: Annotated[float, Ge(0), Lt(1)] = ISOTROPY
    """A face is isotropic if its principal stresses differ by at most this fraction of their root mean square."""
    modes: Annotated[int, Ge(1), Le(50)] = 5
    """Number of eigenmodes for each family."""
    follow: str | None = None
    """Name of the case or combination that the pattern follows. combined: sum of the absolute stresses of all cases or
    combinations. Default: combined if there are several cases."""
    weights: dict[str, float] = Field(default_factory=dict)
    """Weight of each combination in the combined sum, or of each case if there are no combinations; default 1."""
    symmetry: tuple[str, ...] = ()
    """Required symmetry of the pattern about its centre: x, y or z for a mirror, rot:6:z for turns by 60 degrees."""

    @field_validator("symmetry")
    @classmethod
    def _check_symmetry(cls, words: tuple[str, ...]) -> tuple[str, ...]:
        try:
            symmetry_group(words)
        except PatternError as error:
            raise ValueError(str(error)) from None
        return words


def _number_or_word(value: Any) -> str:
    return "auto" if isinstance(value, str) else "number"


AUTO: Literal["auto"] = "auto"  # Value of the keys mode, phase and min_width that leaves the choice to dsfab.
Mode = Annotated[
    Annotated[int, Ge(1), Le(50), Tag("number")] | Annotated[Literal["auto"], Tag("auto")],
    Discriminator(_number_or_word),
]
Phase = Annotated[
    Annotated[float, Tag("number")] | Annotated[Literal["auto"], Tag("auto")], Discriminator(_number_or_word)
]
LeastWidth = Annotated[
    Annotated[float, Ge(0), Tag("number")] | Annotated[Literal["auto"], Tag("auto")], Discriminator(_number_or_word)
]


def _is_nonzero(value: Any) -> bool:
    try:
        return float(value) != 0
    except (TypeError, ValueError, OverflowError):
        return bool(value)


class Family(Section):
    """[pattern.major] or [pattern.minor]: one family of stripes."""

    mode: Mode = 1
    """Number of the eigenmode; mode 1 is the first that is not constant. auto: mode of the stiffest design, 1 to 4."""
    frequency: Annotated[float, Ge(0), Le(1000)] = 8.0
    """Stripes per unit of the eigenmode's values. On a surface, these values span 0.5 to 3 units.
    0: `spacing` is used instead. Evenly spaced stripes have no frequency."""
    spacing: Annotated[float, Ge(0)] = 0.0
    """Mean distance (m) between the centre lines of stripes. 0: `frequency` is used instead. Default of evenly spaced
    stripes: a twelfth of the root of the surface's area, but at least the mean edge length of the mesh."""
    phase: Phase = 0.0
    """Shift of the stripes, in periods. auto: the phase, out of several, that gives the stiffest design."""
    threshold: Annotated[float, Ge(-1), Le(1)] = 0.0
    """Stripes lie where a triangle wave is above this height: with -1 all is material, with 0 half, with 1 nothing."""

    @model_validator(mode="before")
    @classmethod
    def _one_of_both(cls, values: Any) -> Any:
        if isinstance(values, dict):
            spacing = _is_nonzero(values.get("spacing"))
            if spacing and "frequency" not in values:
                return {**values, "frequency": 0.0}
            if spacing == _is_nonzero(values.get("frequency", True)):
                raise ValueError("give either frequency or spacing; leave the other key out or set that key to 0")
        return values

    def distance(self, area: float, edge: float) -> float:
        """Return the spacing (m) of evenly spaced stripes. area : of the surface, m2.    edge : mean edge, m."""
        return self.spacing or max(float(np.sqrt(area)) / STRIPES_ACROSS, edge)

    @property
    def number(self) -> int:
        """Number of the mode; 1 for auto."""
        return 1 if self.mode == AUTO else self.mode

    @property
    def shift(self) -> float:
        """Phase in periods; 0 for auto."""
        return 0.0 if self.phase == AUTO else self.phase

    @property
    def stripes(self) -> Stripes:
        """Stripes of the family. If `spacing` is set, the frequency is 1 until the eigenmode is known."""
        return Stripes(self.frequency or 1.0, self.shift, self.threshold)


class Width(Section):
    """[pattern.width]: width of the stripes of both families."""

    rule: Rule = "plain"
    """plain: widths from the key threshold (Madan et al.). constant: equal widths in metres. graded: wider where the
    stress is larger. stressed (stiffest, slowest): several solves; members become wider where the energy is largest."""
    member: Annotated[float, Ge(0)] = 0.0
    """Width of the members if rule is constant, metres. 0: solid_fraction gives the width."""
    q: Annotated[float, Ge(0), Le(4)] = 1.0
    """Exponent: the share of material grows with this power of the stress. For rule stressed: only at the start."""
    steps: Annotated[int, Ge(1), Le(50)] = 8
    """Number of trials for the rule stressed. Each trial cuts and solves the sheet."""
    min_width: LeastWidth = AUTO
    """Smallest width of members, metres. 0: no limit. auto: a limit for evenly spaced members only: the thickness
    for the rule graded, and half of the thickness for the rule stressed if pattern.workshop is true. The limit is at
    most half of the width that members would have if all were equally wide."""
    max_width: Annotated[float, Ge(0)] = 0.0
    """Largest width of members, metres. 0: no limit."""
    min_gap: Annotated[float, Ge(0)] = 0.0
    """Smallest gap between two stripes of a family, metres; narrower gaps become material. 0: no limit."""
    solid_fraction: Annotated[float, Ge(0), Lt(1)] = 0.0
    """Share of the surface that is material, including keep and rim. Widths are scaled to this share. 0: no scaling."""
    solid_fraction_tolerance: Annotated[float, Ge(0), Le(0.1)] = JUMP
    """Largest error of solid_fraction if no width gives this share, because ends of members appear or vanish."""

    @model_validator(mode="after")
    def _check_widths(self) -> "Width":
        try:
            self.widths(1.0)
        except PatternError as error:
            raise ValueError(str(error)) from None
        return self

    @property
    def asked_least(self) -> float:
        """Requested smallest width of members, metres; 0 for auto."""
        return 0.0 if self.min_width == AUTO else self.min_width

    def widths(self, length: float, least: float = 0.0) -> Widths:
        """Return the rule for widths. If only `solid_fraction` gives the width, `member` starts at 1 % of `length` (m).
        least : smallest width (m) if `min_width` is auto; reduced to `max_width` if `max_width` is smaller."""
        solved = self.rule == "constant" and self.solid_fraction > 0 and not self.member
        member = length / 100 if solved else self.member
        low = min(least, self.max_width or least) if self.min_width == AUTO else self.min_width
        return Widths(self.rule, member, self.q, low, self.max_width, self.min_gap)


def _with_curves(thing: Any) -> Any:
    picker = getattr(thing, "at", None)
    complete = self_contained(picker)
    return thing if complete is picker else replace(thing, at=complete)


Method = Literal["modes", "stripes", "auto"]
FAMILIES = ("major", "minor")  # Names of the families of stripes.
FILLET = 0.55
"""Smallest radius of round corners, divided by the thickness. The value is over 0.5 because corners are polygons."""
STRIPES_ACROSS = 12  # Default number of evenly spaced stripes across a square surface.


class Pattern(Section):
    """[pattern]: the two families of stripes, and parts that stay material."""

    method: Method = "modes"
    """modes: stripes on eigenmodes (Madan et al.). stripes: evenly spaced stripes along the stress. auto: the stiffest
    pattern without dead ends and slits. auto compares modes, stripes, and stripes with halving. With width.rule
    constant or graded and a solid_fraction, auto tries four widths: constant, graded, graded with half of width.q, and
    stressed. If the preset sets no spacing, auto compares several spacings."""
    halve: bool = True
    """For stripes. true: where stripes are too close, every second stripe ends on a crossing member. false: none."""
    families: Literal["both", "major", "minor"] = "both"
    """Families of stripes. One family has no crossings: the key halve has no effect; only keep and rim join members."""
    symmetry: Literal["auto", "none"] = "auto"
    """For stripes: symmetry. auto: as surface, supports and loads. none: the pattern may be asymmetric."""
    rotate: Annotated[float, Ge(-180), Le(180)] = 0.0
    """For stripes: rotation (degrees) of both families from the principal directions of the stress,
    counter-clockwise seen from the side of the normals or from outside a closed surface. 90 swaps major and minor."""
    forces: Literal["uncut", "optimal"] = "uncut"
    """For stripes: forces that set directions and graded widths. uncut: forces in the uncut sheet. optimal: forces in
    the stiffest sheet of varying thickness with the same material (solid_fraction), for stiffer flat designs."""
    weight_rounds: Annotated[int, Ge(0), Le(2)] = 0
    """For stripes: number of times that the directions are computed again with only the weight of the stripes. This
    helps if weight is most of the load. 0: the weight is that of the uncut sheet."""
    guide: tuple[Guide, ...] = ()
    """For stripes: curves and regions that set the direction of the stripes."""
    region: tuple[PatternRegion, ...] = ()
    """Parts of the surface that are solid or void, or have a solid band inside their edge: doors, oculi, bands."""
    major: Family = Family()
    minor: Family = Family()
    width: Width = Width()
    tidy: bool | None = None
    """Remove parts of members beyond their last crossing, and fill openings narrower than the members beside them.
    Default: true for evenly spaced stripes, false for stripes on eigenmodes."""
    keep: Annotated[float, Ge(0)] = 0.0
    """Distance (m) from loads and supports up to which the whole surface is material; 0: none."""
    rim: Annotated[float, Ge(0)] = 0.0
    """Width (m) of the band of material along the boundary; 0: none."""
    fillet: Annotated[float, Ge(0)] = 0.0
    """Radius (m) of the corners of openings, smaller where there is no space for it. 0: sharp corners."""
    crowding: Literal["note", "avoid"] = "note"
    """For stripes so close together that neighbouring openings would be filled. note: print a note. avoid: also try
    a larger value of keep, a larger spacing, one family and rotate = 45, and use the best pattern."""
    workshop: bool | None = None
    """Close narrow openings and narrow tips of openings, and widen narrow members. Limits: slicing.min_gap, min_member.
    Default: true for evenly spaced stripes, but false if width.rule is stressed; false for stripes on eigenmodes."""

    @model_validator(mode="before")
    @classmethod
    def _without_frequency(cls, values: Any) -> Any:
        if not (isinstance(values, dict) and values.get("method") == "stripes"):
            return values
        families = {name: values[name] for name in ("major", "minor") if isinstance(values.get(name), dict)}
        cleaned = {
            name: {key: value for key, value in family.items() if key != "frequency" or value != 0}
            for name, family in families.items()
        }
        return {**values, **cleaned}

    @model_validator(mode="after")
    def _steers_stripes(self) -> "Pattern":
        if self.forces == "optimal" and not self.width.solid_fraction:
            raise ValueError("forces = 'optimal' needs the share of material to keep: set width.solid_fraction")
        for name, idle in (("guide", ()), ("rotate", 0.0), ("forces", "uncut")):
            if self.method == "modes" and getattr(self, name) != idle:
                raise ValueError(
                    f"{name} has no effect on method = 'modes'; remove this key, or set method = 'stripes'"
                )
        for k, guide in enumerate(self.guide):
            if guide.member and guide.family not in self.family_names:
                raise ValueError(
                    f"guide.{k} is a {guide.family} member, but families = '{self.families}'; set the family of the "
                    f"guide to '{self.families}'"
                )
        return self

    @property
    def voids(self) -> tuple[int, ...]:
        """Numbers of the void regions, from 0."""
        return tuple(k for k, region in enumerate(self.region) if region.do == "void")

    @property
    def drawn_regions(self) -> int:
        """Number of regions that are solid or have a solid band. The pattern begins with a layer for each region."""
        return len(self.region) - len(self.voids)

    @property
    def rounds(self) -> int:
        """Number of times that directions are computed again: `weight_rounds` if `method` is stripes, else 0."""
        return self.weight_rounds if self.method == "stripes" else 0

    @property
    def is_steered(self) -> bool:
        """True if guides or a rotation turn the stripes away from the directions of the stress."""
        return bool(self.rotate or self.guide)

    @property
    def family_names(self) -> tuple[str, ...]:
        return FAMILIES if self.families == "both" else (self.families,)

    @property
    def drawn_families(self) -> tuple[Family, ...]:
        by_name = {"major": self.major, "minor": self.minor}
        return tuple(by_name[name] for name in self.family_names)

    @property
    def may_halve(self) -> bool:
        """True if stripes that come too close together may end on members of the other family."""
        return self.halve and self.families == "both"

    @property
    def removes_loose_ends(self) -> bool:
        return self.method == "stripes" if self.tidy is None else self.tidy

    @property
    def for_workshop(self) -> bool:
        """True if narrow members are widened and narrow openings are closed, by the limits of the workshop."""
        return self.method == "stripes" and self.width.rule != "stressed" if self.workshop is None else self.workshop

    @property
    def auto(self) -> bool:
        """True if dsfab chooses a mode or a phase."""
        return self.method == "modes" and any(AUTO in (family.mode, family.phase) for family in self.drawn_families)


class Slicing(Section):
    """[slicing]: cut of the surface along the stripes into a sheet with openings."""

    snap: Annotated[float, Ge(0), Le(0.3)] = 0.05
    """A cut nearer to a vertex than this fraction of an edge goes through the vertex, to avoid thin triangles."""
    pinch: Literal["join", "split"] = "join"
    """Treatment of places where material touches only at a point. join: add a small disc. split: separate the parts."""
    min_opening: Annotated[float, Ge(0)] | None = None
    """Smallest size of openings, metres; smaller openings are filled. 0: none are filled. Default for stripes on
    eigenmodes: 0. Default for evenly spaced stripes: 15 % of their spacing, but not over the thickness if pattern.tidy
    is true. This default also fills openings under 35 % of the median size."""
    min_gap: Annotated[float, Ge(0)] | None = None
    """Smallest width (m) of openings with pattern.workshop. Narrower openings are bridged; narrower tips of openings
    are filled. 0: no limit. Default: a quarter of the thickness, at least 3 mm (small designs: 1 / 500 of the size)."""
    min_member: Annotated[float, Ge(0)] | None = None
    """Smallest width of members, metres; narrower members are widened. 0: no limit. Default with pattern.workshop: half
    of the thickness, or less if [pattern.width] asks for less. Default without pattern.workshop: widen only members
    under 0.8 times the median width, and only with pattern.tidy and pattern.fillet."""
    improve: bool = False
    """Improve the triangles of the cut mesh by flipping and removing edges, for finite elements and CAD."""
    tolerance: Annotated[float, Ge(0)] = 0.0
    """Largest distance (m) by which `improve` may move the edges of stripes. 0: the edges stay in place."""
    loose: Literal["drop", "keep", "refuse"] = "drop"
    """Treatment of pieces without a support. drop: leave pieces out. keep: keep pieces. refuse: stop with an error."""


class Thickening(Section):
    """[thickening]: from the sheet to a solid of the thickness in [statics]."""

    thinnest: Annotated[float, Gt(0), Le(1)] = 0.25
    """Refuse a solid that would have less than this share of its thickness where the surface is sharply curved."""
    side: Side = "mid"
    """Side of the surface on which the solid lies. mid: half on each side. out: side of the normals, or outside of a
    closed surface. in: opposite side."""
    strict: bool = False
    """Refuse a solid with faces that intersect after all repairs. false: only report the place."""
    extra: tuple[Annotated[Extra, Field(discriminator="kind")], ...] = ()
    """Changes of the solid, applied in the order of the list: kinds feet, ring, holes, trim and split."""


class Fabrication(Section):
    """[fabrication]: limits of the workshop. dsfab checks and reports them; only --fix changes the design."""

    min_member: Annotated[float, Ge(0)] = 0.0
    """Smallest width of members, metres. 0: only the limit of pattern.workshop is checked."""
    min_gap: Annotated[float, Ge(0)] = 0.0
    """Smallest width (m) of openings and, with pattern.workshop, their tips. 0: only the limit of pattern.workshop."""
    min_wall: Annotated[float, Ge(0)] = 0.0
    """Smallest thickness of walls of the solid, metres. 0: no check."""
    accept: bool = False
    """Write files of a design with faults. Faults are loads without a path to a support, very thin places where the
    solid would meet itself, and members and openings that are under 1 mm and also under their limit."""
    bed: tuple[Annotated[float, Gt(0)], Annotated[float, Gt(0)], Annotated[float, Gt(0)]] | None = None
    """Size of the machine along x, y, z, metres; the solid may be turned onto any side."""


FormatName = Literal[
    "stl", "3mf", "step", "stpz", "brep", "ifc", "obj", "ply", "off", "glb", "3dm", "dxf", "svg",
    "lines.step", "csv", "json", "members.json", "members.csv", "nodes.csv",
    "members.3dm", "members.ifc", "members.glb", "members.dxf", "vtu", "forces.vtu", "forces.csv",
    "member_forces.csv", "member_utilisation.csv", "saf.xlsx",
    "tcl", "beams.inp", "member_forces.xlsx",
]  # fmt: skip


class Export(Section):
    """[export]: file formats and options of STEP files."""

    formats: tuple[FormatName, ...] = ("stl", "3mf", "step")
    """File formats; `dsfab export --help` lists them."""
    step_faces: Annotated[int, Gt(0)] = 30_000
    """Largest number of faces that a STEP file may have."""
    step: Literal["auto", "quick", "planar", "members", "smooth", "compact", "faceted", "tessellated"] = "auto"
    """planar: flat or folded designs, with lines and splines. faceted: plane faces. tessellated: triangles for viewers.
    members: four-sided curved faces that CAD programs cut and measure well; if impossible, smooth or faceted. smooth,
    compact: a few large curved faces in the smallest file. CAD programs often cannot cut these faces. auto: the first
    possible of planar; members (up to 7000 faces); smooth (if fast and OCCT can cut it); faceted (up to step_faces);
    smooth. quick: like auto, but dsfab tries members only for open surfaces, tests no cut, and tries smooth once."""
    step_tolerance: Annotated[float, Ge(0)] = 0.0
    """Largest error (m) of planar, smooth or simplified STEP files. 0: a fraction of the thickness. faceted: exact."""
    step_mb: Annotated[float, Ge(0)] = 0.0
    """Largest size of a STEP file in MB; 0: no limit."""


class Preset(Section):
    """A whole preset. Units: metres, newtons, pascals, kilograms.

    roof = dsfab.Preset(
        surface=mesh,                       # a mesh of trimesh, pyvista, compas; (V, F); a path; or keys as in TOML
        supports=[dsfab.Support(dsfab.Boundary())], loads=[dsfab.SelfWeight(), dsfab.Snow(800.0)],
        statics=dsfab.Statics(thickness=0.05),
        pattern={"method": "stripes"},      # each section is an object, or a table of its keys
    )"""

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")] = "design"
    """Name of the output folder."""
    description: str = ""
    surface: AnySurface
    statics: Statics
    diffusion: Diffusion = Diffusion()
    pattern: Pattern = Pattern()
    slicing: Slicing = Slicing()
    thickening: Thickening = Thickening()
    fabrication: Fabrication = Fabrication()
    sizing: Sizing = Sizing()
    workshop: Workshop = Workshop()
    eurocode: Eurocode = Eurocode()
    export: Export = Export()

    def __init__(
        self,
        /,
        *,
        surface: Any = None,
        supports: Sequence[Any] | None = None,
        loads: Sequence[Any] | None = None,
        combinations: Sequence[Any] | None = None,
        **sections: Any,
    ) -> None:
        """Create a preset from Python objects, with the checks and messages of a preset file.
        surface  : a mesh of trimesh, pyvista or compas, in metres; a `Surface`; (V, F): vertices (n, 3), metres, and
                   faces; the path of a mesh file; a section of another preset; or keys as in TOML, such as
                   {"mesh": mesh, "refine": 0.2}. For other units, use `Surface.of(mesh, "mm")`.
        supports, loads, combinations : objects (`dsfab.Support(...)`) or tables; these replace the lists in `surface`.
        sections : name, description, statics, diffusion, pattern ..., each as an object or as its keys.
        Raises PresetError that lists every mistake with its key in TOML, and SurfaceError for an invalid mesh."""
        surface_lists = {"support": supports, "load": loads, "combination": combinations}
        values = {key: plain(value) for key, value in sections.items()}
        if surface is not None:
            listed = {key: value for key, value in surface_lists.items() if value is not None}
            values["surface"] = surface_table(surface, listed)
        super().__init__(**values)

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @model_validator(mode="after")
    def _names_cases(self) -> "Preset":
        surface = self.surface
        if "member_utilisation.csv" in self.export.formats:
            self.statics.require_strength()
        wrong = list(action_mistakes(surface.load, surface.actions, surface.combinations))
        if wrong := wrong or [*case_mistakes(*self._cases), *self.eurocode.case_mistakes(surface.load)]:
            raise ValueError("; ".join(wrong))
        return self

    @model_validator(mode="after")
    def _keeps_its_count(self) -> "Preset":
        regions = tuple(None if entry.do == "void" else entry for entry in self.pattern.region)
        lists: dict[str, Any] = {"pattern.guide": self.pattern.guide, "pattern.region": regions}
        counted = [
            f"{key}.{k}.at"
            for key, listed in lists.items()
            for k, entry in enumerate(listed)
            if isinstance(getattr(entry, "at", None), Vertices)
        ]
        if counted and self.pattern.voids:
            void = region_key(self.pattern.region, self.pattern.voids[0])
            raise ValueError(
                f"{', '.join(counted)}: pick = 'vertices' needs all vertices of the mesh, but the void {void} removes "
                f"some of these vertices; use pick = 'nearest'"
            )
        return self

    @property
    def _cases(self) -> tuple[tuple[Load, ...], tuple[Combination, ...], str | None, dict[str, float]]:
        return self.surface.load, self.surface.sums, self.diffusion.follow, self.diffusion.weights

    def judged_in(self, state: LimitState, names: Iterable[str]) -> list[str]:
        """Return the cases and combinations to check for stress and buckling (`ULS`) or displacements (`SLS`).
        If no combination has a limit state, return all cases."""
        return judged_names(names, self.surface.sums, state)

    @property
    def followed_weights(self) -> dict[str, float]:
        """Weights of the cases or combinations that the pattern follows, by name (see `follow_weights`)."""
        return follow_weights(*self._cases)

    @property
    def combines(self) -> bool:
        """True if the pattern follows a sum of stresses, False for the stress of one case or combination."""
        return combines(self.surface.load, self.diffusion.follow)

    def with_modes(self, mode: tuple[int, int], phase: tuple[float, float]) -> "Preset":
        """Return the preset with the modes and phases of the major and the minor family."""
        families = {
            name: getattr(self.pattern, name).model_copy(update={"mode": mode[k], "phase": phase[k]})
            for k, name in enumerate(FAMILIES)
        }
        return self.with_pattern(**families)

    def with_thickness(self, thickness: float) -> "Preset":
        """Return the preset with a thickness (m). Round corners get a radius of at least `FILLET` times this thickness.
        If the thickness was auto and pattern.workshop is true, the thickness also is the smallest width of members."""
        slicing, fillet = self.slicing, self.pattern.fillet
        if not self.statics.is_sized and slicing.min_member is None and self.pattern.for_workshop:
            slicing = slicing.model_copy(update={"min_member": thickness})
        if fillet and fillet < FILLET * thickness:
            fillet = float(f"{FILLET * thickness:.2g}")
        pattern = self.pattern.model_copy(update={"fillet": fillet})
        statics = self.statics.model_copy(update={"thickness": thickness})
        return self.model_copy(update={"statics": statics, "pattern": pattern, "slicing": slicing})

    def with_pattern(self, **changes: Any) -> "Preset":
        """Return the preset with changed values in [pattern]."""
        return self.model_copy(update={"pattern": self.pattern.model_copy(update=changes)})

    def self_contained(self) -> "Preset":
        """Return the preset with curves in place of references to drawings. Raises SurfaceError for a lost drawing."""
        lists = {"surface": ("support", "load"), "pattern": ("guide", "region"), "thickening": ("extra",)}
        changes = dict[str, Any]()
        for name, keys in lists.items():
            section = getattr(self, name)
            entries = {k: tuple(_with_curves(entry) for entry in getattr(section, k)) for k in keys}
            if any(new is not old for k in keys for new, old in zip(entries[k], getattr(section, k), strict=True)):
                changes[name] = section.model_copy(update=entries)
        return self.model_copy(update=changes) if changes else self

    def first_difference(self, other: "Preset") -> str | None:
        """Return the first stage with different settings in two presets, or None for equal presets. The result is also
        "surface" if regions have different outlines, or if [statics] differs and the mesh depends on the stress."""
        if self.surface.by_stress and self.statics != other.statics:
            return "surface"
        regions = self.pattern.region, other.pattern.region
        if len(regions[0]) != len(regions[1]) or not all(a.cut_as(b) for a, b in zip(*regions, strict=True)):
            return "surface"
        return next((stage for stage in STAGES if getattr(self, stage) != getattr(other, stage)), None)
