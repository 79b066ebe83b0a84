"""Presets: everything that a design depends on, one section per stage.

The models below are the one place where keys, units, defaults and allowed ranges are written down. How they are read
from TOML, overridden and written back is in `dsfab.preset.file`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Lt
from pydantic import AfterValidator, Discriminator, Field, Tag, field_validator, model_validator

from dsfab.core.errors import PatternError
from dsfab.core.units import GRAVITY
from dsfab.diffusion import Labelling, symmetry_group
from dsfab.diffusion.tensors import ISOTROPY
from dsfab.pattern import JUMP, Guide, Rule, Stripes, Widths
from dsfab.preset.checks import (
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
    with_material,
)
from dsfab.preset.sections import Eurocode, Workshop
from dsfab.preset.surface_section import AnySurface, Section, plain, surface_table
from dsfab.statics import Ask, Bending, Elements, Law, Material, Membrane, SheetMaterial
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

STAGES = ("surface", "statics", "diffusion", "pattern", "slicing", "thickening", "export")
"""The seven words, in the order in which a design is made."""


class Statics(Section):
    """[statics]: the sheet's material, thickness and elements."""

    thickness: Annotated[float, Gt(0)]
    """Metres; also the thickness of the finished solid."""
    material: Annotated[str | None, AfterValidator(known_name)] = None
    """S235, GL24h, ... (see `dsfab materials`): gives young, poisson, density and strength where these are left out."""
    young: Annotated[float, Gt(0), AfterValidator(modulus)] = 210e9
    """Young's modulus, Pa."""
    poisson: Annotated[float, Gt(-1), Lt(0.5)] = 0.3
    density: Annotated[float, Ge(0), AfterValidator(specific_mass)] = 7850.0
    """kg/m3."""
    law: Law = "plane_stress"
    """plane_stress (a thin sheet) or stvk (the paper to the letter)."""
    membrane: Membrane = "constant"
    """constant strain (the paper), or quadratic or hybrid: right for slender parts too, at several times the cost."""
    bending: Bending = "hinge"
    """hinge (the paper's; good for directions), midedge (converges to the plate) or hhj (the most accurate)."""
    stress: Literal["membrane", "layers", "auto"] = "membrane"
    """What the pattern follows: membrane, the stress of the middle surface (the paper; of a flat sheet that only bends,
    which has none there, that of its lower side); layers, that of all layers, bending counts; auto: layers where
    bending stores at least half of the energy."""
    strength: Annotated[float, Ge(0), AfterValidator(resistance)] = 0.0
    """Pa that the largest stress is compared with (steel S235: 235e6); 0 compares nothing."""
    frequencies: Annotated[int, Ge(0), Le(10)] = 0
    """How many natural frequencies of the uncut sheet to find."""
    buckling: Annotated[int, Ge(0), Le(10)] = 0
    """How many load factors to find at which the uncut sheet buckles."""
    check: bool = True
    """Refuse before the cut what moves by over a tenth of its span, stands on one vertex, or is held or loaded at a
    point far off the surface; false only tells it."""

    _named = model_validator(mode="before")(with_material)

    def __eq__(self, other: object) -> bool:
        """Whether the values are the same: what a material is called makes no difference."""
        return isinstance(other, Statics) and self._values == other._values

    def __hash__(self) -> int:
        return hash(self._values)

    @property
    def _values(self) -> tuple[Any, ...]:
        return tuple(value for key, value in self if key != "material")

    @property
    def elastic(self) -> Material:
        """The material of the sheet as the statics know it."""
        return Material(self.young, self.poisson, self.density)

    @property
    def weight(self) -> float:
        """Of the uncut sheet, newtons per square metre."""
        return self.density * self.thickness * GRAVITY

    def sheet(self, thickness: float | None = None) -> SheetMaterial:
        """What the sheet is made of; as thick as given, metres, or as it is."""
        return SheetMaterial(self.elastic, self.thickness if thickness is None else thickness, self.law)

    @property
    def material_words(self) -> str:
        """'GL24h', or 'GL24h, but for density'; nothing where no material is named."""
        own = own_values(dict(self))
        return f"{self.material}, but for {', '.join(own)}" if self.material and own else self.material or ""

    def require_strength(self) -> None:
        """Raises PresetError where neither the material nor a strength is known: members cannot be checked then."""
        require_strength(self.material, self.strength)

    @property
    def elements(self) -> Elements:
        """The elements that it is solved with."""
        return Elements(self.membrane, self.bending)

    @property
    def ask(self) -> Ask:
        """With strength, frequencies or buckling, statics by other elements are solved again by those of `Ask`."""
        return Ask(self.strength, self.frequencies, self.buckling)


class Diffusion(Section):
    """[diffusion]: from stress to modes."""

    r: Annotated[float, Ge(1), Le(1e4)] = 100.0
    """Anisotropy: 1 ignores the stress, 10 to 100 follow it."""
    gamma: Annotated[float, Gt(0)] = 1.0
    """Factor on the loads before faces are told isotropic or not (the paper's force magnitude)."""
    labelling: Labelling = "signed"
    """signed: major stripes follow tension; magnitude: the larger stress (the paper)."""
    isotropy: Annotated[float, Ge(0), Lt(1)] = ISOTROPY
    """Faces whose principal stresses differ by less than this share are isotropic."""
    modes: Annotated[int, Ge(1), Le(50)] = 5
    """Modes computed per family."""
    follow: str | None = None
    """A case or combination; or combined, the sum of the sizes of their stresses: the default with several cases."""
    weights: dict[str, float] = Field(default_factory=dict)
    """combined: weight of each combination (each case, without combinations) in the sum; 1 when left out."""
    symmetry: tuple[str, ...] = ()
    """Symmetry that the pattern must have: x, y or z for a mirror, rot:6:z for sixths of a turn; through the centre."""

    @field_validator("symmetry")
    @classmethod
    def _known(cls, words: tuple[str, ...]) -> tuple[str, ...]:
        try:
            symmetry_group(words)
        except PatternError as error:
            raise ValueError(str(error)) from None
        return words


def _number_or_word(value: Any) -> str:
    return "auto" if isinstance(value, str) else "number"


AUTO: Literal["auto"] = "auto"
"""What stands for a mode or a phase that is to be chosen (see `dsfab.design.mode_search`)."""

Mode = Annotated[
    Annotated[int, Ge(1), Le(50), Tag("number")] | Annotated[Literal["auto"], Tag("auto")],
    Discriminator(_number_or_word),
]
Phase = Annotated[
    Annotated[float, Tag("number")] | Annotated[Literal["auto"], Tag("auto")],
    Discriminator(_number_or_word),
]

LeastWidth = Annotated[
    Annotated[float, Ge(0), Tag("number")] | Annotated[Literal["auto"], Tag("auto")],
    Discriminator(_number_or_word),
]


def _is_some(value: Any) -> bool:
    """Whether a value that nobody has checked is another number than 0: a text may be one, too ("0")."""
    try:
        return float(value) != 0
    except (TypeError, ValueError, OverflowError):
        return bool(value)


class Family(Section):
    """[pattern.major] or [pattern.minor]: one family of stripes."""

    mode: Mode = 1
    """Which mode the stripes run on; 1 is the first that is not constant. auto: of the first four, the stiffest."""
    frequency: Annotated[float, Ge(0), Le(1000)] = 8.0
    """Stripes per unit of the mode (a surface has about 0.5 to 3 units from end to end). 0: as spacing asks. Evenly
    spaced stripes have none."""
    spacing: Annotated[float, Ge(0)] = 0.0
    """Metres from the middle of one stripe to the next, in the mean over the surface. 0: as frequency says; of
    evenly spaced stripes a twelfth of the surface's side, but not less than an edge of its mesh."""
    phase: Phase = 0.0
    """Shift of the stripes, in periods. auto: the stiffest of several."""
    threshold: Annotated[float, Ge(-1), Le(1)] = 0.0
    """-1 everything is material, 0 half, 1 nothing."""

    @model_validator(mode="before")
    @classmethod
    def _one_of_both(cls, values: Any) -> Any:
        if isinstance(values, dict):
            spacing = _is_some(values.get("spacing"))
            if spacing and "frequency" not in values:
                return {**values, "frequency": 0.0}
            if spacing == _is_some(values.get("frequency", True)):
                raise ValueError("give either frequency or spacing, and leave the other out or set it to 0")
        return values

    def distance(self, area: float, edge: float) -> float:
        """Metres between evenly spaced stripes on a surface of that area: a twelfth of its side where not given.

        edge : metres, the mean one of its mesh: stripes that are closer than that have to be asked for.
        """
        return self.spacing or max(float(np.sqrt(area)) / STRIPES_ACROSS, edge)

    @property
    def number(self) -> int:
        """The mode; 1 where it is still to be chosen."""
        return 1 if self.mode == AUTO else self.mode

    @property
    def shift(self) -> float:
        """The phase; 0 where it is still to be chosen."""
        return 0.0 if self.phase == AUTO else self.phase

    @property
    def stripes(self) -> Stripes:
        """The stripes; at frequency 1 where `spacing` asks for another, which takes a mode (see `frequency_for`)."""
        return Stripes(self.frequency or 1.0, self.shift, self.threshold)


class Width(Section):
    """[pattern.width]: how wide the stripes of both families are."""

    rule: Rule = "plain"
    """plain: as the thresholds say (the paper); constant: the same width in metres; graded: as the stress is large;
    stressed: graded, then cut, solved and widened where it works most, over and over: the stiffest, and the slowest."""
    member: Annotated[float, Ge(0)] = 0.0
    """constant: width of the members, metres; with solid_fraction it is solved for and may be left out."""
    q: Annotated[float, Ge(0), Le(4)] = 1.0
    """graded: the share of material grows with this power of the stress; stressed: it begins like that."""
    steps: Annotated[int, Ge(1), Le(50)] = 8
    """stressed: how often the sheet is cut and solved."""
    min_width: LeastWidth = AUTO
    """Metres; no member is made thinner. 0 sets no limit. auto: evenly spaced members of graded width are no thinner
    than the sheet is thick, or than half of what equally wide ones would be if that is less. With pattern.workshop
    those of stressed width than half of the thickness, or the same. Others have no limit."""
    max_width: Annotated[float, Ge(0)] = 0.0
    """Metres; no member is made wider. 0 sets no limit."""
    min_gap: Annotated[float, Ge(0)] = 0.0
    """Metres; narrower gaps between two stripes of a family are filled. 0 fills none."""
    solid_fraction: Annotated[float, Ge(0), Lt(1)] = 0.0
    """Share of the surface to keep, with keep and rim: widths are scaled until it is met. 0 leaves them as they are."""
    solid_fraction_tolerance: Annotated[float, Ge(0), Le(0.1)] = JUMP
    """Where that share jumps past the wanted one, as ends of members come and go, the nearest is taken if it misses by
    no more than this share of the surface, and told in a note."""

    @model_validator(mode="after")
    def _possible(self) -> "Width":
        try:
            self.widths(1.0)
        except PatternError as error:
            raise ValueError(str(error)) from None
        return self

    @property
    def asked_least(self) -> float:
        """Metres that no member is to be thinner than, where that is said; 0 where not."""
        return 0.0 if self.min_width == AUTO else self.min_width

    def widths(self, length: float, least: float = 0.0) -> Widths:
        """The rule; members whose width is solved for are counted in hundredths of a length, metres.

        least : metres that members are no thinner than where `min_width` is auto, unless `max_width` is less.
        """
        solved = self.rule == "constant" and self.solid_fraction > 0 and not self.member
        member = length / 100 if solved else self.member
        low = min(least, self.max_width or least) if self.min_width == AUTO else self.min_width
        return Widths(self.rule, member, self.q, low, self.max_width, self.min_gap)


def _with_curves(thing: Any) -> Any:
    """A support, load, guide ... with the curves of the drawing that its picker names in it."""
    at = getattr(thing, "at", None)
    held = self_contained(at)
    return thing if held is at else replace(thing, at=held)


Method = Literal["modes", "stripes", "auto"]
FAMILIES = ("major", "minor")
"""Names of the two families of stripes."""

STRIPES_ACROSS = 12
"""Evenly spaced stripes across a square surface, where no spacing is given."""


class Pattern(Section):
    """[pattern]: the two families, and what stays material besides them."""

    method: Method = "modes"
    """modes: stripes on eigenmodes (the paper); stripes: evenly spaced, `spacing` metres apart, along the stress;
    auto: of both, halved or not, with constant and graded widths (q, and half of it) where one of these is asked, and
    of the best stripes and modes with stressed ones, and stripes closer and wider where no spacing is asked: what has
    no dead end, no slit, and is then the stiffest."""
    halve: bool = True
    """stripes: leave out every second one where they crowd, ended on crossing members; false lets them crowd."""
    families: Literal["both", "major", "minor"] = "both"
    """Which families are drawn. One alone has no crossings: it is neither halved nor tidied, and rim and keep hold it
    together."""
    symmetry: Literal["auto", "none"] = "auto"
    """stripes: the mirrors and turns that surface, supports and loads have, or none of them."""
    rotate: Annotated[float, Ge(-180), Le(180)] = 0.0
    """stripes: degrees that both families are turned by from the stress, counter-clockwise as seen from where normals
    point to (outside, of a closed surface); 90 lets them change places."""
    forces: Literal["uncut", "optimal"] = "uncut"
    """stripes: whose forces they run along, and are graded by: of the uncut sheet, or of the stiffest sheet of varying
    thickness with the same material (solid_fraction). In a plane, and at edges and openings, the second is stiffer."""
    weight_rounds: Annotated[int, Ge(0), Le(2)] = 0
    """stripes: how often directions are sought again, each face as heavy as what stripes leave of it; 0: with the
    weight of the uncut sheet. Worth it where weight is most of the load."""
    guide: tuple[Guide, ...] = ()
    """stripes: curves and regions in which they run as is said there."""
    region: tuple[PatternRegion, ...] = ()
    """Doors, oculi, solid bands: parts of the surface that are solid, void, or have a solid band inside of their
    edge."""
    major: Family = Family()
    minor: Family = Family()
    width: Width = Width()
    tidy: bool | None = None
    """Take off stripes that end in the air or turn back, as far as the member that they cross last, and fill openings
    that are narrower than the members beside them. Left out: on for stripes of both families, off on modes (the
    paper)."""
    keep: Annotated[float, Ge(0)] = 0.0
    """Metres around loads and supports that stay material; 0 keeps nothing."""
    rim: Annotated[float, Ge(0)] = 0.0
    """Metres along the boundary that stay material; 0 keeps nothing."""
    fillet: Annotated[float, Ge(0)] = 0.0
    """Metres; radius of the rounded corners of openings, less where there is no room for it; 0 leaves them sharp."""
    workshop: bool | None = None
    """Close openings, fill tips and widen members that are narrower than a workshop makes, by slicing.min_gap and
    slicing.min_member. None: of evenly spaced stripes, but where widths follow the stress; of modes never."""

    @model_validator(mode="before")
    @classmethod
    def _without_frequency(cls, values: Any) -> Any:
        """Evenly spaced stripes have no frequency: where 0 is written for it, that is as if it were left out."""
        if not (isinstance(values, dict) and values.get("method") == "stripes"):
            return values
        families = {name: values[name] for name in ("major", "minor") if isinstance(values.get(name), dict)}
        plain = {
            name: {key: value for key, value in family.items() if key != "frequency" or value != 0}
            for name, family in families.items()
        }
        return {**values, **plain}

    @model_validator(mode="after")
    def _steers_stripes(self) -> "Pattern":
        if self.forces == "optimal" and not self.width.solid_fraction:
            raise ValueError("forces = 'optimal' needs the share of material to keep: set width.solid_fraction")
        for name, idle in (("guide", ()), ("rotate", 0.0), ("forces", "uncut")):
            if self.method == "modes" and getattr(self, name) != idle:
                raise ValueError(
                    f"{name} has no effect on method = 'modes', whose stripes run where the modes say; set method = "
                    "'stripes' or leave it out"
                )
        for k, guide in enumerate(self.guide):
            if guide.member and guide.family not in self.family_names:
                raise ValueError(
                    f"guide.{k} is to be a {guide.family} member, and families = '{self.families}' draws none; set its "
                    f"family to '{self.families}'"
                )
        return self

    @property
    def voids(self) -> tuple[int, ...]:
        """The regions that are void, counted from 0."""
        return tuple(k for k, region in enumerate(self.region) if region.do == "void")

    @property
    def drawn_regions(self) -> int:
        """How many regions are drawn as layers of their own, before all others: those that are not void."""
        return len(self.region) - len(self.voids)

    @property
    def rounds(self) -> int:
        """How often directions are sought again: `weight_rounds` of stripes whose method is given, else never."""
        return self.weight_rounds if self.method == "stripes" else 0

    @property
    def steered(self) -> bool:
        """Whether stripes are to run elsewhere than along the stress."""
        return bool(self.rotate or self.guide)

    @property
    def family_names(self) -> tuple[str, ...]:
        """Of the families that are drawn."""
        return FAMILIES if self.families == "both" else (self.families,)

    @property
    def drawn(self) -> tuple[Family, ...]:
        """The families that are drawn."""
        both = {"major": self.major, "minor": self.minor}
        return tuple(both[name] for name in self.family_names)

    @property
    def halved(self) -> bool:
        """Whether lines may be left out where they crowd: they end on members of the other family."""
        return self.halve and self.families == "both"

    @property
    def tidied(self) -> bool:
        """Whether loose ends are taken off."""
        return self.method == "stripes" and self.families == "both" if self.tidy is None else self.tidy

    @property
    def for_workshop(self) -> bool:
        """Whether nothing is left that is narrower than a workshop makes."""
        return self.method == "stripes" and self.width.rule != "stressed" if self.workshop is None else self.workshop

    @property
    def auto(self) -> bool:
        """Whether a mode or a phase is to be chosen."""
        return self.method == "modes" and any(AUTO in (family.mode, family.phase) for family in self.drawn)


class Slicing(Section):
    """[slicing]: from stripes to a sheet."""

    snap: Annotated[float, Ge(0), Le(0.3)] = 0.05
    """Cuts closer to a vertex than this share of an edge go through the vertex: no slivers."""
    pinch: Literal["join", "split"] = "join"
    """Where material would meet in a single point: join it with a small disc, or split it."""
    min_opening: Annotated[float, Ge(0)] | None = None
    """Metres; smaller openings, whichever stripes they lie between, are filled. 0 fills none; None: none on modes, and
    what is under 15 % of their spacing between evenly spaced stripes: specks that an edge leaves. Tidied ones leave no
    opening that is narrower than the members beside it anyway: of these it is what is also narrower than the sheet is
    thick. Of both also what is under 35 % of the size of most openings."""
    min_gap: Annotated[float, Ge(0)] | None = None
    """Metres; with pattern.workshop openings are bridged, and their tips filled, where they are narrower. 0 leaves
    them; None: a quarter of the thickness, or 3 mm if that is more (of small things a 500th of their size)."""
    min_member: Annotated[float, Ge(0)] | None = None
    """Metres; members between openings with round corners are widened where they are narrower, and narrower than 0.8 of
    what most are, of tidied stripes only; with pattern.workshop all members are, up to half of the thickness, or what
    [pattern.width] asks for if that is less (none by its min_width = 0), and None means that. 0 widens none."""
    improve: bool = False
    """Flip and collapse edges inside the triangles of the surface, for finite elements and CAD."""
    tolerance: Annotated[float, Ge(0)] = 0.0
    """Metres that `improve` may move the edges of stripes by; 0 moves none."""
    loose: Literal["drop", "keep", "refuse"] = "drop"
    """Pieces that reach no support: leave them out, build them too, or refuse the design."""


class Thickening(Section):
    """[thickening]: from the sheet to a solid; the thickness is that of [statics]."""

    thinnest: Annotated[float, Gt(0), Le(1)] = 0.25
    """Refuse a solid that sharp curvature makes locally thinner than this share of the thickness."""
    side: Side = "mid"
    """Where the sheet lies: mid (around the surface), out (where its normals point; outside of closed ones) or in."""
    strict: bool = False
    """Refuse a solid in which faces still intersect after all repairs, instead of telling where."""
    extra: tuple[Annotated[Extra, Field(discriminator="kind")], ...] = ()
    """Feet, ring, holes, trim, split: what is added to the solid or cut from it, in this order."""


class Fabrication(Section):
    """[fabrication]: what the workshop can make. Checked and told; the design is not changed by it, but by --fix."""

    min_member: Annotated[float, Ge(0)] = 0.0
    """Metres; the narrowest member that can be made. 0 checks nothing, but what pattern.workshop keeps to."""
    min_gap: Annotated[float, Ge(0)] = 0.0
    """Metres; the narrowest opening, with pattern.workshop its tips, too. 0 as above."""
    min_wall: Annotated[float, Ge(0)] = 0.0
    """Metres; the thinnest wall of the solid. 0 checks nothing."""
    accept: bool = False
    """Write files of a design in spite of loads that nothing carries, of a sheet that was thinned to a film where it
    would meet itself, and of members and openings under 1 mm that fail their limit."""
    bed: tuple[Annotated[float, Gt(0)], Annotated[float, Gt(0)], Annotated[float, Gt(0)]] | None = None
    """Metres along x, y, z that fit into the machine; the solid may lie on any of its sides."""


FormatName = Literal[
    "stl", "3mf", "step", "stpz", "brep", "ifc", "obj", "ply", "off", "glb", "3dm", "dxf", "svg",
    "lines.step", "csv", "json", "members.json", "members.csv", "nodes.csv",
    "members.3dm", "members.ifc", "members.glb", "members.dxf", "vtu", "forces.vtu", "forces.csv",
    "member_forces.csv", "member_utilisation.csv", "saf.xlsx",
    "tcl", "beams.inp", "member_forces.xlsx",
]  # fmt: skip


class Export(Section):
    """[export]: the files."""

    formats: tuple[FormatName, ...] = ("stl", "3mf", "step")
    """See `dsfab export --help`: solids, lines, drawings, fields."""
    step_faces: Annotated[int, Gt(0)] = 30_000
    """Largest number of faces that a STEP file may have."""
    step: Literal["auto", "quick", "planar", "members", "smooth", "compact", "faceted", "tessellated"] = "auto"
    """STEP: planar (flat or folded), of lines and splines, faceted, or tessellated (for viewers);
    members: curved, of four-sided patches that CAD programs cut and measure as they should, else smooth, else faceted.
    smooth or compact: curved, of few skins, the smallest file; cutting it in CAD often fails.
    auto: planar where it can, else by members up to 7000 faces, else smooth where it is soon made and OCCT cuts it,
    else faceted where step_faces allows, else smooth.
    quick: the same, but by members for open surfaces alone, without cuts, and without the last, which may take minutes
    and come to nothing."""
    step_tolerance: Annotated[float, Ge(0)] = 0.0
    """Metres that planar, smooth or simplified STEP may be off the mesh; 0: a share of the thickness, faceted: none."""
    step_mb: Annotated[float, Ge(0)] = 0.0
    """Largest size of a STEP file in MB; 0 is no limit."""


class Preset(Section):
    """A whole preset. Units: metres, newtons, pascals, kilograms.

    roof = dsfab.Preset(
        surface=mesh,                       # of trimesh, pyvista, compas; (V, F); a path; or as in TOML
        supports=[dsfab.Support(dsfab.Boundary())],
        loads=[dsfab.SelfWeight(), dsfab.Snow(800.0)],
        statics=dsfab.Statics(thickness=0.05),
        pattern={"method": "stripes"},      # each section as an object or as its keys
    )
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]*$")] = "design"
    """Names the output folder."""
    description: str = ""
    surface: AnySurface
    statics: Statics
    diffusion: Diffusion = Diffusion()
    pattern: Pattern = Pattern()
    slicing: Slicing = Slicing()
    thickening: Thickening = Thickening()
    fabrication: Fabrication = Fabrication()
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
        """A preset of what Python holds: everything is checked, and refused in the same words, as in a file.

        surface : a mesh of trimesh, pyvista, compas, in metres (else `Surface.of(mesh, "mm")`); a `Surface`; (V, F):
                  vertices (n, 3), metres, and faces; the path of a mesh file; the section of another preset; or its
                  keys as in TOML, and `mesh` for one of these: {"mesh": mesh, "refine": 0.2}.
        supports, loads, combinations : of the surface, in place of its own: `dsfab.Support(...)`, `dsfab.Snow(...)`,
                  or their keys as in TOML.
        sections : name, description, statics, diffusion, pattern ..., each as an object or as its keys.

        Raises PresetError that lists every mistake with its key in TOML; SurfaceError for a mesh that is none.
        """
        given = {"support": supports, "load": loads, "combination": combinations}
        values = {key: plain(value) for key, value in sections.items()}
        if surface is not None:
            listed = {key: value for key, value in given.items() if value is not None}
            values["surface"] = surface_table(surface, listed)
        super().__init__(**values)

    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @model_validator(mode="after")
    def _names_cases(self) -> "Preset":
        given = self.surface
        if "member_utilisation.csv" in self.export.formats:
            self.statics.require_strength()
        wrong = list(action_mistakes(given.load, given.actions, given.combinations))
        if wrong := wrong or [*case_mistakes(*self._cases), *self.eurocode.case_mistakes(given.load)]:
            raise ValueError("; ".join(wrong))
        return self

    @model_validator(mode="after")
    def _keeps_its_count(self) -> "Preset":
        """A void takes vertices away: what counts them would mean others. Supports and loads are picked before."""
        drawn = tuple(None if one.do == "void" else one for one in self.pattern.region)
        lists: dict[str, Any] = {"pattern.guide": self.pattern.guide, "pattern.region": drawn}
        counted = [
            f"{key}.{k}.at"
            for key, listed in lists.items()
            for k, one in enumerate(listed)
            if isinstance(getattr(one, "at", None), Vertices)
        ]
        if counted and self.pattern.voids:
            void = region_key(self.pattern.region, self.pattern.voids[0])
            raise ValueError(
                f"{', '.join(counted)}: pick = 'vertices' counts the vertices of the mesh as it is given, and the void "
                f"{void} takes some of them away; use pick = 'nearest'"
            )
        return self

    @property
    def _cases(self) -> tuple[tuple[Load, ...], tuple[Combination, ...], str | None, dict[str, float]]:
        return self.surface.load, self.surface.sums, self.diffusion.follow, self.diffusion.weights

    def judged_in(self, state: LimitState, names: Iterable[str]) -> list[str]:
        """Those of some cases and combinations in which stress and buckling (`ULS`) or displacements (`SLS`) are
        judged: all of them where no combination is of a limit state."""
        return judged_names(names, self.surface.sums, state)

    @property
    def followed(self) -> dict[str, float]:
        """Weights of the cases or combinations that the pattern follows, by name (see `dsfab.preset.checks`)."""
        return follow_weights(*self._cases)

    @property
    def combines(self) -> bool:
        """Whether the pattern follows a sum of stress magnitudes rather than the stress of one case."""
        return combines(self.surface.load, self.diffusion.follow)

    def settled(self, mode: tuple[int, int], phase: tuple[float, float]) -> "Preset":
        """The preset with these modes and phases, of the major and of the minor family."""
        families = {
            name: getattr(self.pattern, name).model_copy(update={"mode": mode[k], "phase": phase[k]})
            for k, name in enumerate(("major", "minor"))
        }
        return self.model_copy(update={"pattern": self.pattern.model_copy(update=families)})

    def with_pattern(self, **changes: Any) -> "Preset":
        """The preset with other values in [pattern]."""
        return self.model_copy(update={"pattern": self.pattern.model_copy(update=changes)})

    def self_contained(self) -> "Preset":
        """The preset with the curves of drawings that pickers name in it; raises SurfaceError for one that is gone."""
        lists = {"surface": ("support", "load"), "pattern": ("guide", "region"), "thickening": ("extra",)}
        changes = dict[str, Any]()
        for name, keys in lists.items():
            section = getattr(self, name)
            found = {key: tuple(_with_curves(one) for one in getattr(section, key)) for key in keys}
            if any(new is not old for key in keys for new, old in zip(found[key], getattr(section, key), strict=True)):
                changes[name] = section.model_copy(update=found)
        return self.model_copy(update=changes) if changes else self

    def first_difference(self, other: "Preset") -> str | None:
        """The first stage whose section differs, or None; name and description make no difference.

        The surface is cut along the outlines of regions, and may be finer where its stress changes.
        """
        if self.surface.by_stress and self.statics != other.statics:
            return "surface"
        regions = self.pattern.region, other.pattern.region
        if len(regions[0]) != len(regions[1]) or not all(a.cut_as(b) for a, b in zip(*regions, strict=True)):
            return "surface"
        return next((stage for stage in STAGES if getattr(self, stage) != getattr(other, stage)), None)
