"""The answers of the statics as pictures: a value on every face, and for shapes where the vertices are drawn."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from dsfab.arrays import Floats
from dsfab.errors import DsfabError
from dsfab.render.colouring import STEEPEST, Bar, Colouring, banded, rising, stress_label
from dsfab.render.lettering import round_length
from dsfab.wording import length

if TYPE_CHECKING:
    from dsfab.pipeline.design import Design
    from dsfab.preset import Preset

MOVES = 0.08
"""Shapes are exaggerated until the farthest vertex moves by this share of the surface's size, or a little less."""

YIELDS = (96, 40, 150)
"""Faces stressed beyond the strength: violet, which the scale of colours does not have."""


def asking(preset: "Preset", show: str) -> "Preset":
    """The preset, asking for the one mode that is to be shown if it asks for none."""
    from dsfab.preset_file import overridden

    key = {"buckling": "buckling", "frequency": "frequencies"}.get(show)
    asks = key is None or getattr(preset.statics, key)
    return preset if asks else overridden(preset, {f"statics.{key}": 1})


def answer_colouring(design: "Design", show: str) -> Colouring:
    """Colours of one of `dsfab.render.colouring.ANSWERS`.

    Raises DsfabError for an answer that the preset does not ask for, or that was not found.
    """
    if show == "displacement":
        return _displaced(design)
    if show in ("buckling", "frequency"):
        return _mode(design, show)
    stress, by = design.statics.answers.stress, _by(design)
    if show == "energy":
        return _scaled(stress.energy, energy_label, f"strain energy per area, uncut sheet, {by}")
    if show == "vonmises":
        words = f"von Mises stress, largest of both surfaces {stress_label(stress.peak.stress)}, uncut sheet, {by}"
        return _scaled(stress.largest, stress_label, words)
    strength = design.preset.statics.strength
    if not strength:
        raise DsfabError("utilisation needs a strength to compare with: --set statics.strength=235e6 (Pa, steel S235)")
    share = stress.utilisation(strength)
    words = f"stress over a strength of {stress_label(strength)}, largest {share.max():.0%}, uncut sheet, {by}"
    shown = _scaled(np.minimum(share, 1.0), lambda value: f"{value:.2g}" if value < 0.01 else f"{value:.0%}", words)
    face = np.where((share > 1)[:, None], np.array(YIELDS, dtype=np.uint8), shown.face)
    return Colouring(face, shown.bar, None, words)


def energy_label(joules: float) -> str:
    """'12 J/m2', '3.1 kJ/m2', '40 mJ/m2'."""
    factor, unit = next(
        ((f, u) for f, u in ((1e6, "MJ"), (1e3, "kJ"), (1.0, "J"), (1e-3, "mJ")) if abs(joules) >= f), (1e-6, "uJ")
    )
    return f"{joules / factor:.3g} {unit}/m2"


def _scaled(value: Floats, label: Callable[[float], str], words: str) -> Colouring:
    """Colours from nothing to the percentile where the colours of stress end too."""
    limit, bands = banded(float(np.percentile(value, STEEPEST)))
    bar = Bar(limit, ("0", "", label(limit)), ("", "and more" if value.max() > 1.01 * limit else ""), bands=bands)
    return Colouring(rising(value / limit, bands), bar, None, words)


def _displaced(design: "Design") -> Colouring:
    u = design.statics.answers.equilibrium.u
    size = np.linalg.norm(u, axis=1)
    largest = float(size.max())
    factor = round_length(MOVES * design.surface.size / largest) if largest > 0 else 1.0
    words = f"moves by {length(largest)} at most, drawn {_times(factor)} x, uncut sheet, {_by(design)}"
    limit, bands = banded(largest)
    bar = Bar(limit, ("0", "", length(limit)), ("", ""), bands=bands)
    face = rising(size[design.surface.F].mean(axis=1) / limit, bands)
    return Colouring(face, bar, design.surface.V + factor * u, words)


def _by(design: "Design") -> str:
    """Whose answer it is: elements differ by more than a picture shows."""
    elements = design.statics.answers.elements
    return f"by {elements}" if elements.bending else f"by {elements.membrane} strain in its plane"


def _times(factor: float) -> str:
    """'5,000', '0.2'."""
    return f"{factor:,.0f}" if factor >= 1 else f"{factor:g}"


def _mode(design: "Design", show: str) -> Colouring:
    answers = design.statics.answers
    if show == "buckling" and answers.buckling is not None and len(answers.buckling.factor):
        shape = answers.buckling.shapes[0]
        shape = -shape if np.einsum("ni,ni->", shape, design.load.force) < 0 else shape  # the way the load pushes
        words = f"buckles at {answers.buckling.factor[0]:.3g} x the load"
    elif show == "frequency" and answers.vibration is not None:
        shape, words = answers.vibration.shapes[0], f"swings at {answers.vibration.hertz[0]:.3g} Hz"
    else:
        key = {"buckling": "buckling", "frequency": "frequencies"}[show]
        why = "; ".join(answers.refusals) or ("the load compresses no part of the sheet" if answers.buckling else "")
        raise DsfabError(f"there is no shape of {show} to show: {why or f'ask for it with --set statics.{key}=1'}")
    size = np.linalg.norm(shape, axis=1)
    bar = Bar(1.0, ("", "", ""), ("still", "moves most"))
    V = design.surface.V + MOVES * design.surface.size * shape
    return Colouring(rising(size[design.surface.F].mean(axis=1)), bar, V, f"{words}, uncut sheet, exaggerated")
