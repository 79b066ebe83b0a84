"""Colours of the faces of a picture, and the colour bar."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np

from dsfab.core.arrays import Floats
from dsfab.core.errors import DsfabError
from dsfab.core.messages import length
from dsfab.render.lettering import Palette, round_length
from dsfab.render.scene import Bytes
from dsfab.surface import hat_gradients

if TYPE_CHECKING:
    from PIL.Image import Image

    from dsfab.design import Design
    from dsfab.preset.model import Preset

ShownResult = Literal[
    "structure", "stress", "families", "major", "minor", "loads", "directions", "major_mode", "minor_mode", "vonmises",
    "utilisation", "energy", "displacement", "buckling", "frequency",
]  # fmt: skip

STATICS_RESULTS = ("vonmises", "utilisation", "energy", "displacement", "buckling", "frequency")
DEFORMED = ("displacement", "buckling", "frequency")  # results that are drawn as a deformed shape
MODE_FIELDS = ("major_mode", "minor_mode")  # pictures of the modes of both families
WHOLE_SHEET = ("loads", "directions", *MODE_FIELDS, *STATICS_RESULTS)  # pictures of the uncut sheet, without stripes
COLOUR_PERCENTILE = 98.0  # percentile of the stress at the end of the colour scale; higher peaks get the last colour

# blue is compression, red is tension; colour-blind people can distinguish blue and red
_DIVERGING = np.array(
    [(33, 80, 140), (84, 140, 190), (166, 200, 222), (240, 236, 228), (238, 190, 160), (210, 110, 80), (150, 38, 40)],
    dtype=np.float64,
)

# teal is negative and ochre is positive, for values other than stress
_SIGNED = np.array(
    [(0, 84, 82), (53, 151, 143), (160, 209, 200), (244, 241, 234), (223, 194, 125), (184, 122, 44), (112, 62, 8)],
    dtype=np.float64,
)

# larger values are darker, so that a grey print is readable
_RISING = np.array(
    [(240, 236, 228), (246, 208, 148), (232, 148, 84), (196, 80, 56), (128, 28, 52), (64, 10, 44)], dtype=np.float64
)


@dataclass(frozen=True, eq=False)
class ColourBar:
    """Colour scale of a picture. limit : value at the right end; the left end is -limit if values have a sign, else 0.
    labels  : labels below the left end, middle and right end.    names : labels above the left and right end.
    colours : (k, 3) from left to right.    bands : number of steps; 0 for a smooth scale."""

    limit: float
    labels: tuple[str, str, str]
    names: tuple[str, str]
    colours: Floats = field(default_factory=lambda: _RISING)
    bands: int = 0


@dataclass(frozen=True, eq=False)
class Colouring:
    """Colours (m, 3) of faces as bytes. bar : colour bar, or None.
    V : (n, 3) vertices of a deformed surface, m; None draws the undeformed surface.    words : text for the caption."""

    face: Bytes
    bar: ColourBar | None = None
    V: Floats | None = None
    words: str = ""


def check_show(show: str) -> None:
    """Raise DsfabError unless `show` is the name of a picture that needs no finished sheet or solid."""
    if show == "fabrication":
        raise DsfabError(
            "show = 'fabrication' needs the finished solid; in dsfab preview, use 'fabrication' without other pictures"
        )
    if show == "members":
        raise DsfabError(
            "show = 'members' needs the finished sheet; in dsfab preview, use 'members' without other pictures"
        )
    if show not in get_args(ShownResult):
        raise DsfabError(f"show {show!r} is not known; use one of {', '.join(get_args(ShownResult))}")


def face_colouring(design: "Design", show: str, palette: Palette) -> Colouring:
    """Return the colours of the uncut surface's faces in the picture `show`.
    Raises DsfabError for a result that the preset does not request."""
    if show in STATICS_RESULTS:
        return answer_colouring(design, show)
    if show == "stress":
        principal = design.diffusion.tensors.principal
        value = np.take_along_axis(principal, np.abs(principal).argmax(axis=1)[:, None], axis=1)[:, 0]
        limit, bands = band_limit(float(np.percentile(np.abs(value), COLOUR_PERCENTILE)))
        label = stress_label(limit)
        bar = ColourBar(limit, (f"-{label}", "0", label), ("compression", "tension"), _DIVERGING, 2 * bands)
        return Colouring(diverging_colours(value / limit, 2 * bands), bar)
    if show in MODE_FIELDS:
        return _mode_colouring(design, show)
    neutral = palette.plain
    colour = {"major": palette.families[0], "minor": palette.families[2], "loads": neutral, "directions": neutral}
    face = np.broadcast_to(np.array(colour.get(show, palette.members), dtype=np.uint8), (design.surface.m, 3))
    if show == "loads":
        total = float(np.linalg.norm(design.load.force.sum(axis=0)))
        return Colouring(face, words=f"loads, {force_label(total)} in all")
    if show == "directions":
        if design.preset.combines:
            return Colouring(
                face,
                words="directions for the combined load cases: red bars follow the largest stress, "
                "blue bars cross the red bars",
            )
        return Colouring(face, ColourBar(1.0, ("", "", ""), ("compression", "tension"), _DIVERGING))
    return Colouring(face)


def _mode_colouring(design: "Design", show: str) -> Colouring:
    if design.pattern.even:
        raise DsfabError(
            f"show = {show!r} needs pattern.method = 'modes'; show structure, families or directions instead"
        )
    name = show.removesuffix("_mode")
    modes = getattr(design.diffusion, name)
    number = getattr(design.preset.pattern, name).mode
    value = modes.mode(number)
    limit = float(np.abs(value).max())
    bar = ColourBar(limit, (f"-{limit:.2g}", "0", f"{limit:.2g}"), ("", ""), _SIGNED)
    face = ramp((value[design.surface.F].mean(axis=1) / limit + 1) / 2, _SIGNED)
    eigenvalue = modes.lam[number - 1] * design.surface.area
    return Colouring(face, bar, None, f"{name} mode {number}, eigenvalue {eigenvalue:.4g} / area, uncut sheet")


def mode_gradient(design: "Design", show: str) -> Floats:
    """Return the gradient (m, 3) of a mode on each face (1/m). show : `major_mode` or `minor_mode`."""
    surface, name = design.surface, show.removesuffix("_mode")
    value = getattr(design.diffusion, name).mode(getattr(design.preset.pattern, name).mode)
    return np.asarray(np.einsum("mia,mi->ma", hat_gradients(surface), value[surface.F]))


def band_limit(limit: float) -> tuple[float, int]:
    """Return a round number not below `limit`, and the number of colour bands (4 to 10)."""
    if not limit > 0:
        return 1.0, 4
    step = round_length(limit / 4)
    count = int(np.ceil(limit / step - 1e-9))
    return count * step, count


def diverging_colours(share: Floats, bands: int = 0) -> Bytes:
    """Return colours (k, 3) for values (k,) from -1 (compression) to 1 (tension)."""
    return ramp((np.clip(share, -1, 1) + 1) / 2, _DIVERGING, bands)


def rising_colours(share: Floats, bands: int = 0) -> Bytes:
    """Return colours (k, 3) for values (k,) from 0 to 1."""
    return ramp(np.clip(share, 0, 1), _RISING, bands)


def signed_colours(share: Floats) -> Bytes:
    """Return colours (k, 3) for values (k,) from -1 to 1 that are not stresses."""
    return ramp((np.clip(share, -1, 1) + 1) / 2, _SIGNED)


def ramp(share: Floats, colours: Floats, bands: int = 0) -> Bytes:
    """Return `colours` (q, 3), interpolated at values (k,), 0 to 1. bands : number of steps; 0 for a smooth scale."""
    if bands:
        share = np.clip(np.floor(share * bands), 0, bands - 1) / (bands - 1)
    place, positions = share * (len(colours) - 1), np.arange(len(colours))
    return np.stack([np.interp(place, positions, channel) for channel in colours.T], axis=1).astype(np.uint8)


def stress_label(pascals: float) -> str:
    """Return a stress as text: "12 MPa", "350 kPa"."""
    size = abs(pascals)
    factor, unit = next(((f, u) for f, u in ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa")) if size >= f), (1.0, "Pa"))
    return f"{pascals / factor:.3g} {unit}"


def force_label(newtons: float) -> str:
    """Return a force as text: "1.2 kN", "350 N"."""
    newtons = float(f"{newtons:.3g}")
    factor, unit = next(((f, u) for f, u in ((1e6, "MN"), (1e3, "kN"), (1.0, "N")) if newtons >= f), (1e-3, "mN"))
    return f"{newtons / factor:.3g} {unit}"


def with_bar(image: "Image", bar: ColourBar, palette: Palette) -> "Image":
    """Return the picture with the colour bar."""
    from PIL import Image, ImageDraw, ImageFont

    width, height = image.size
    letter = max(height / 46, 9.0)
    left_edge, base, bar_pixels = 0.035 * width, height - 6.6 * letter, round(0.22 * width)
    row = ramp(np.linspace(0, 1, bar_pixels), bar.colours, bar.bands)
    strip = np.broadcast_to(row, (max(round(0.55 * letter), 4), bar_pixels, 3))
    image.paste(Image.fromarray(np.ascontiguousarray(strip)), (round(left_edge), round(base)))
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(size=0.9 * letter)
    top, label_base = base - 0.5 * letter, base + 1.55 * letter
    draw.text((left_edge, top), bar.names[0], fill=palette.text, font=font, anchor="ls")
    draw.text((left_edge + bar_pixels, top), bar.names[1], fill=palette.text, font=font, anchor="rs")
    for share, text, anchor in zip((0.0, 0.5, 1.0), bar.labels, ("ls", "ms", "rs"), strict=True):
        draw.text((left_edge + share * bar_pixels, label_base), text, fill=palette.text, font=font, anchor=anchor)
    return image


EXAGGERATION = 0.08  # largest drawn displacement of a vertex, divided by the size of the surface
YIELD_COLOUR = (96, 40, 150)  # violet, for faces whose stress exceeds the strength


def preset_with_mode(preset: "Preset", show: str) -> "Preset":
    """Return the preset, with a request for the buckling mode or frequency that the picture `show` displays."""
    from dsfab.preset.file import with_overrides

    key = {"buckling": "buckling", "frequency": "frequencies"}.get(show)
    is_set = key is None or getattr(preset.statics, key)
    return preset if is_set else with_overrides(preset, {f"statics.{key}": 1})


def answer_colouring(design: "Design", show: str) -> Colouring:
    """Return the colours of the faces for a result of the statics. Raises DsfabError if the result is missing."""
    if show == "displacement":
        return _displacement_colouring(design)
    if show in ("buckling", "frequency"):
        return _shape_colouring(design, show)
    stress, by = design.statics.answers.stress, _elements_text(design)
    if show == "energy":
        return scaled_colouring(stress.energy, energy_label, f"strain energy per area of the uncut sheet, {by}")
    if show == "vonmises":
        words = (
            f"largest von Mises stress in each face of the uncut sheet, up to {stress_label(stress.peak.stress)}, {by}"
        )
        return scaled_colouring(stress.largest, stress_label, words)
    strength = design.preset.statics.strength
    if not strength:
        raise DsfabError("utilisation needs a strength to compare with: --set statics.strength=235e6 (Pa, steel S235)")
    share = stress.utilisation(strength)
    words = f"stress / strength of {stress_label(strength)}, largest {share.max():.0%}, uncut sheet, {by}"
    return utilisation_colouring(share, words)


def utilisation_colouring(share: Floats, words: str) -> Colouring:
    """Return colours of faces for utilisations (m,). words : text for the caption."""
    limited = np.minimum(share, 1.0)
    shown = scaled_colouring(limited, lambda value: f"{value:.2g}" if value < 0.01 else f"{value:.0%}", words)
    face = np.where((share > 1)[:, None], np.array(YIELD_COLOUR, dtype=np.uint8), shown.face)
    return Colouring(face, shown.bar, None, words)


def energy_label(joules: float) -> str:
    """Return an energy per area as text: "12 J/m2", "3.1 kJ/m2"."""
    units = ((1e6, "MJ"), (1e3, "kJ"), (1.0, "J"), (1e-3, "mJ"))
    factor, unit = next(((f, u) for f, u in units if abs(joules) >= f), (1e-6, "uJ"))
    return f"{joules / factor:.3g} {unit}/m2"


def scaled_colouring(value: Floats, label: Callable[[float], str], words: str) -> Colouring:
    """Return colours of faces for positive values (m,). label : writes a value as text.    words : for the caption."""
    limit, bands = band_limit(float(np.percentile(value, COLOUR_PERCENTILE)))
    bar = ColourBar(limit, ("0", "", label(limit)), ("", "and more" if value.max() > 1.01 * limit else ""), bands=bands)
    return Colouring(rising_colours(value / limit, bands), bar, None, words)


def _displacement_colouring(design: "Design") -> Colouring:
    u = design.statics.answers.equilibrium.u
    size = np.linalg.norm(u, axis=1)
    largest = float(size.max())
    factor = round_length(EXAGGERATION * design.surface.size / largest) if largest > 0 else 1.0
    times = f"{factor:,.0f}" if factor >= 1 else f"{factor:g}"
    words = (
        f"displacement of the uncut sheet, at most {length(largest)}, drawn {times} times as large, "
        f"{_elements_text(design)}"
    )
    limit, bands = band_limit(largest)
    bar = ColourBar(limit, ("0", "", length(limit)), ("", ""), bands=bands)
    face = rising_colours(size[design.surface.F].mean(axis=1) / limit, bands)
    return Colouring(face, bar, design.surface.V + factor * u, words)


def _elements_text(design: "Design") -> str:
    elements = design.statics.answers.elements
    return f"with {elements} elements" if elements.bending else f"with in-plane {elements.membrane} elements"


def _shape_colouring(design: "Design", show: str) -> Colouring:
    answers = design.statics.answers
    if show == "buckling" and answers.buckling is not None and len(answers.buckling.factor):
        shape = answers.buckling.shapes[0]
        shape = -shape if np.einsum("ni,ni->", shape, design.load.force) < 0 else shape  # the shape moves with the load
        words = f"buckles at {answers.buckling.factor[0]:.3g} x the load"
    elif show == "frequency" and answers.vibration is not None:
        shape, words = answers.vibration.shapes[0], f"swings at {answers.vibration.hertz[0]:.3g} Hz"
    else:
        key = {"buckling": "buckling", "frequency": "frequencies"}[show]
        why = "; ".join(answers.refusals) or ("the load compresses no part of the sheet" if answers.buckling else "")
        raise DsfabError(f"no mode shape of {show} was computed: {why or f'ask for it with --set statics.{key}=1'}")
    size = np.linalg.norm(shape, axis=1)
    bar = ColourBar(1.0, ("", "", ""), ("still", "moves most"))
    V = design.surface.V + EXAGGERATION * design.surface.size * shape
    return Colouring(rising_colours(size[design.surface.F].mean(axis=1)), bar, V, f"{words}, uncut sheet, exaggerated")
