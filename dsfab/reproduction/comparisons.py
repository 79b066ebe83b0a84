"""Comparisons in the paper (Madan et al.)."""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from dsfab.core.errors import DsfabError
from dsfab.design import Design, draft
from dsfab.diffusion import Modes
from dsfab.preset.file import with_overrides
from dsfab.render import PAPER as RENDER_PAPER
from dsfab.render.picture import Look, picture
from dsfab.reproduction import drawing
from dsfab.reproduction.drawing import SMALL, PaperComparison, PaperPicture, paper_picture, previewer_of, save_picture
from dsfab.reproduction.earlier_methods import StressLine, integrated_design, ribbons, traced_lines
from dsfab.reproduction.upsampling import upsampled_beside_exact
from dsfab.results import DiffusionResult
from dsfab.slicing.measures.pattern_quality import PatternQuality
from dsfab.study.baselines.structures import mode_like_field


def earlier_work_comparison(design: Design, folder: Path, shown: Mapping[str, PaperPicture]) -> PaperComparison:
    """Compare a design with stripes of an integrated field, and with traced lines. shown : pictures by file name."""
    name = design.preset.name
    integrated, lines = integrated_design(design), traced_lines(design)
    rows = []
    for show, title in (("major", "Major stripes"), ("minor", "Minor stripes"), ("structure", "Structure")):
        drawn_picture = paper_picture(integrated, folder, show, f"{name}-integrated", f"{title}, integrated")
        rows.append(tuple(cell for cell in (shown.get(f"{name}-{show}.webp"), drawn_picture) if cell))
    crosses = shown.get(f"{name}-directions.webp")
    rows.append(tuple(cell for cell in (crosses, _lines_picture(design, folder, lines)) if cell))
    all_lines = [*lines[0], *lines[1]]
    words = (
        "Earlier methods choose a direction on every face and integrate one field over all faces, or they trace lines "
        "one after another. Around some points, no choice of directions is consistent on all faces. Diffusion needs "
        "no such choice, and Madan et al. say that their stripes are more regular around these points. "
        f"{_measures_text(design, integrated)}{len(all_lines)} lines were traced, as dense as the stripes. "
        f"{sum(line.loose for line in all_lines)} ends of these lines lie inside the surface, because the line came "
        "too near to another line or to a place without a clear direction."
    )
    return PaperComparison("Beside earlier work", words, tuple(rows))


def _lines_picture(design: Design, folder: Path, lines: tuple[list[StressLine], list[StressLine]]) -> PaperPicture:
    surface, title = design.surface, "Lines traced along the principal directions"
    V, F, family = [surface.V], [surface.F], [np.full(surface.m, 2)]
    for k, family_lines in enumerate(lines):
        if not family_lines:
            continue
        apart = surface.area / sum(line.length for line in family_lines)
        points, faces = ribbons(surface, family_lines, 0.25 * apart, 0.1 * apart)
        F.append(faces + sum(map(len, V)))
        V.append(points)
        family.append(np.full(len(faces), k))
    file = f"{design.preset.name}-traced.webp"
    look = Look(SMALL, palette=replace(RENDER_PAPER, families=RENDER_PAPER.tints))
    try:
        image = picture(np.vstack(V), np.vstack(F), family=np.concatenate(family), look=look)
    except DsfabError as error:
        return PaperPicture("", title, str(error))
    save_picture(image, folder / file)
    return PaperPicture(file, title, "Major red, minor blue.")


def _measures_text(design: Design, integrated: Design) -> str:
    try:
        quality, rival = (candidate.quality(symmetry=False) for candidate in (design, integrated))
    except DsfabError as error:
        return f"Nothing can be measured ({error}). "
    better = sum(a < b for a, b in zip(_quality_numbers(quality), _quality_numbers(rival), strict=True))
    return (
        f"Measures of the stripes from diffusion: {_quality_text(quality)}. Measures of the integrated stripes: "
        f"{_quality_text(rival)}. Stripes from diffusion are better in {better} of these "
        f"{len(_quality_numbers(quality))} measures. "
    )


def _quality_numbers(quality: PatternQuality) -> tuple[float, ...]:
    families = quality.major, quality.minor
    return (
        *(family.deviation for family in families),
        *(family.evenness for family in families),
        -quality.crossing_angle,
        float(quality.dead_ends),
    )


def _quality_text(quality: PatternQuality) -> str:
    major, minor = quality.major, quality.minor
    return (
        f"on average, the angle between members and stress is {major.deviation:.0f} (major) and {minor.deviation:.0f} "
        f"(minor) degrees; members cross at {quality.crossing_angle:.0f} degrees or more; P95/P5 of the spacing is "
        f"{major.evenness:.1f} (major) and {minor.evenness:.1f} (minor); {quality.dead_ends} dead ends"
    )


CHANGES: Mapping[str, Mapping[str, Any]] = {
    "As the preset says": {},
    "Both frequencies 25": {"pattern.major.frequency": 25.0, "pattern.minor.frequency": 25.0},
    "Both thresholds -0.4: wider": {"pattern.major.threshold": -0.4, "pattern.minor.threshold": -0.4},
}
"""Titles and settings of three pictures of one design; the modes are the same in all pictures."""

PAPER = 37  # Frames a second in the pattern editor of Madan, Jacobson and Levin, on a laptop of 2015.


def editing_comparison(design: Design, folder: Path) -> PaperComparison:
    """Draw a pattern with the settings `CHANGES`; measure pictures per second while the stripe frequency changes."""
    title = "Frequency and thickness, edited"
    try:
        with previewer_of(design) as previewer:
            row = []
            for number, (name, changes) in enumerate(CHANGES.items(), 1):
                previewer.set(changes)
                file = f"{design.preset.name}-edited-{number}.webp"
                save_picture(previewer.picture(drawing.SMALL, quality=drawing.LIGHT, words=False), folder / file)
                row.append(PaperPicture(file, name, size=drawing.SMALL))
                previewer.display(design.preset)

            def change(number: int) -> None:
                previewer.set({"pattern.major.frequency": design.preset.pattern.major.frequency + 0.1 * number})
                previewer.frame(drawing.LARGE)

            rate, renderer = frames_a_second(change), previewer.renderer
    except DsfabError as error:
        return PaperComparison(title, f"Nothing can be drawn: {error}.", ())
    words = (
        "A slider changes a few numbers of the pattern, and dsfab solves no equations again. Measured: "
        f"{rate:.3g} complete pictures per second, of {drawing.LARGE[0]} by {drawing.LARGE[1]} pixels and "
        f"{design.surface.m:,} triangles, drawn by {renderer}. The paper reports {PAPER} pictures per second, on a "
        "graphics card. `dsfab edit bob` opens the editor; `dsfab bench --preview` measures more sizes on your machine."
    )
    return PaperComparison(title, words, (tuple(row),))


def frames_a_second(change: Callable[[int], None], frames: int = 24) -> float:
    """Return the median number of frames per second. change : function that draws a frame."""
    taken = list[float]()
    for number in range(frames):
        begin = time.perf_counter()
        change(number)
        taken.append(time.perf_counter() - begin)
    return 1 / median(taken[2:])


RATIOS = (1.0, 10.0, 100.0)  # Values of the anisotropy r in the comparison.


def comparisons(design: Design, folder: Path, shown: Mapping[str, PaperPicture]) -> list[PaperComparison]:
    """Return the paper's comparisons (Madan et al.) that belong to a design's preset. shown : pictures by file name."""
    name = design.preset.name
    if name == "hanging_bar":
        return [_michell_comparison(design, shown), _anisotropy_comparison(design, folder)]
    if name == "sphere":
        return [_von_mises_comparison(design, folder, shown), upsampled_beside_exact(design, folder)]
    if name == "bridge":
        return [earlier_work_comparison(design, folder, shown)]
    if name == "bob":
        words = "Result of the statics of Bob: the stress is concentrated between the head and the feet."
        again = tuple(shown[file] for file in ("bob-loads.webp", "bob-vonmises.webp") if file in shown)
        return [PaperComparison("Bob under his load", words, (again,)), editing_comparison(design, folder)]
    return []


def _michell_comparison(design: Design, shown: Mapping[str, PaperPicture]) -> PaperComparison:
    name = design.preset.name
    rows = (("directions", "structure"), ("major-mode", "major"), ("minor-mode", "minor"))
    pictures = (tuple(shown[file] for show in row if (file := f"{name}-{show}.webp") in shown) for row in rows)
    measured_text = "dsfab cannot cut this pattern, so nothing was measured"
    with suppress(DsfabError):
        quality = design.quality(symmetry=False)
        measured_text = (
            f"the mean angle between members and principal directions is {quality.deviation:.1f} degrees (the larger "
            f"value of both families), and members cross at {quality.crossing_angle:.0f} degrees or more"
        )
    words = (
        "In the stiffest frame of a given mass, members lie along principal directions of the stress, and cross at "
        "right angles [Michell 1904]. Stripes run perpendicular to the gradient of their mode. So stripes form this "
        f"frame if gradients follow the principal directions. For this figure, {measured_text}."
    )
    return PaperComparison("Towards the Michell truss", words, tuple(pictures))


def _anisotropy_comparison(design: Design, folder: Path) -> PaperComparison:
    rows = []
    for show, name in (("major_mode", "major mode 1"), ("minor_mode", "minor mode 1"), ("structure", "structure")):
        row = []
        for r in RATIOS:
            changed = draft(with_overrides(design.preset, {"diffusion.r": r}), earlier=design)
            row.append(paper_picture(changed, folder, show, f"r{r:g}-{design.preset.name}", f"r = {r:g}, {name}"))
        rows.append(tuple(row))
    words = (
        "With anisotropy r = 1 the stress has no effect, and both families have the same modes. With larger r, modes "
        "and their stripes follow the principal directions more closely."
    )
    return PaperComparison("The effect of the anisotropy r", words, tuple(rows))


def _von_mises_comparison(design: Design, folder: Path, shown: Mapping[str, PaperPicture]) -> PaperComparison:
    modes = Modes(np.zeros(1), mode_like_field(design.surface, design.statics.answers.stress.largest)[:, None])
    changed = with_overrides(design.preset, {"pattern.major.mode": 1, "pattern.minor.mode": 1})
    along = DiffusionResult(design.diffusion.tensors, modes, modes)
    stages: dict[str, Any] = {"surface": design.surface, "statics": design.statics, "pattern": design.pattern}
    striped = Design.from_results(changed, diffusion=along, **stages)
    name = design.preset.name
    field = shown.get(f"{name}-vonmises.webp")
    stripes = paper_picture(striped, folder, "major", f"{name}-vonmises", "Stripes along the von Mises stress")
    pairs = [tuple(shown.get(f"{name}-{family}{end}.webp") for end in ("-mode", "")) for family in ("major", "minor")]
    columns = (pairs[0], (field, stripes), pairs[1])
    rows = tuple(tuple(cell for column in columns if (cell := column[i])) for i in range(2))
    words = (
        "These stripes of the same frequency follow the von Mises stress, a single field. Away from the poles this "
        "field hardly changes, so there are few stripes. The two families of stripes from diffusion give rings and "
        "meridians everywhere."
    )
    return PaperComparison("Why not stripes along the von Mises stress?", words, rows)
