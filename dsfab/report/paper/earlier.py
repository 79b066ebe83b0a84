"""The bridge beside earlier work: one field integrated over chosen directions, and lines traced one after another."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from dsfab.errors import DsfabError
from dsfab.pipeline import Design
from dsfab.render import PAPER
from dsfab.render.picture import Look, picture
from dsfab.report.paper.drawing import (
    SMALL,
    PaperComparison,
    PaperPicture,
    paper_picture,
    save_picture,
)
from dsfab.slicing.pattern_quality import PatternQuality
from dsfab.study.integration import integrated_design
from dsfab.study.tracing import StressLine, ribbons, traced

BAND = 0.25
"""Width of a traced line as it is drawn, over the distance from one to the next."""

LIFT = 0.1
"""Of that distance: lines lie so far above the surface, to be seen."""


def beside_earlier(design: Design, folder: Path, shown: Mapping[str, PaperPicture]) -> PaperComparison:
    """As many stripes by diffusion, by one field over directions that are chosen on every face, and as traced lines."""
    name = design.preset.name
    other, lines = integrated_design(design), traced(design)
    rows = []
    for show, title in (("major", "Major stripes"), ("minor", "Minor stripes"), ("structure", "Structure")):
        drawn = paper_picture(other, folder, show, f"{name}-integrated", f"{title}, integrated")
        rows.append(tuple(one for one in (shown.get(f"{name}-{show}.webp"), drawn) if one))
    crosses = shown.get(f"{name}-directions.webp")
    rows.append(tuple(one for one in (crosses, _lines_picture(design, folder, lines)) if one))
    both = [*lines[0], *lines[1]]
    words = (
        "Earlier methods choose a direction on every face and integrate one field over all of them, or trace lines one "
        "after another. Where directions part or turn round a point, no choice of signs is right everywhere; diffusion "
        "makes no choice, and the paper says that its stripes are more regular there. "
        f"{_compared(design, other)}"
        f"Traced as far apart as the stripes: {len(both)} lines, {sum(line.loose for line in both)} of whose ends lie "
        "inside the surface, for they came too near to another line or to where no direction is clear."
    )
    return PaperComparison("Beside earlier work", words, tuple(rows))


def _lines_picture(design: Design, folder: Path, lines: tuple[list[StressLine], list[StressLine]]) -> PaperPicture:
    surface, title = design.surface, "Lines traced along the principal directions"
    V, F, family = [surface.V], [surface.F], [np.full(surface.m, 2)]
    for k, one in enumerate(lines):
        if not one:
            continue
        apart = surface.area / sum(line.length for line in one)
        points, faces = ribbons(surface, one, BAND * apart, LIFT * apart)
        F.append(faces + sum(map(len, V)))
        V.append(points)
        family.append(np.full(len(faces), k))
    file = f"{design.preset.name}-traced.webp"
    look = Look(SMALL, palette=replace(PAPER, families=PAPER.tints))
    try:
        drawn = picture(np.vstack(V), np.vstack(F), family=np.concatenate(family), look=look)
    except DsfabError as error:
        return PaperPicture("", title, str(error))
    save_picture(drawn, folder / file)
    return PaperPicture(file, title, "Major red, minor blue.")


def _compared(design: Design, other: Design) -> str:
    """What was measured of stripes by diffusion and of integrated ones, and in how many numbers diffusion is better."""
    try:
        own, rival = (one.quality(symmetry=False) for one in (design, other))
    except DsfabError as error:
        return f"Nothing can be measured ({error}). "
    better = sum(a < b for a, b in zip(_numbers(own), _numbers(rival), strict=True))
    return (
        f"Measured, by diffusion: {_regular(own)}. Integrated: {_regular(rival)}. "
        f"Diffusion is the better one in {better} of these {len(_numbers(own))} numbers. "
    )


def _numbers(found: PatternQuality) -> tuple[float, ...]:
    """The smaller, the better."""
    both = found.major, found.minor
    return (
        *(one.deviation for one in both),
        *(one.evenness for one in both),
        -found.crossing_angle,
        float(found.dead_ends),
    )


def _regular(found: PatternQuality) -> str:
    major, minor = found.major, found.minor
    return (
        f"members lie {major.deviation:.0f} and {minor.deviation:.0f} degrees off the stress (major and minor, in the "
        f"mean), cross at {found.crossing_angle:.0f} degrees or more, P95/P5 of their spacing is {major.evenness:.1f} "
        f"and {minor.evenness:.1f}, and {found.dead_ends} ends lie in the air"
    )
