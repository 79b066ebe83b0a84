"""Captions that are results: what the paper says is to be seen in a figure, looked for on both families' phases."""

import numpy as np

from dsfab.arrays import Bools, Floats
from dsfab.pipeline import Design
from dsfab.study.renditions import Rendition
from dsfab.study.webs import design_phases, links, loaded_patches, nearby, web

ANGLE, EVENNESS = 60.0, 3.0
"""A grid's members cross at so many degrees at least, and the P95 of their spacing is so many times the P5 at most."""

MOST = 0.995
"""A structure that brings less than so much of its load to a support is not praised without a word on that."""


def finding(claim: str, made: Rendition) -> str:
    """What was measured of a claim (see `PaperFigure`), as a clause; '' where nothing is claimed or nothing was made.

    made : a rendition whose stripes lie on modes.
    """
    if not claim or made.design is None:
        return ""
    if claim == "grid":
        return _grid(made)
    design = made.design
    phases, loads = design_phases(design), loaded_patches(design.surface, design.load.loaded)
    if claim == "web":
        told = web(design.surface, phases, loads[0], design.load.held).sentence
    else:
        told = _beams(design, phases, loads, between=claim == "beams")
    return f"{told}; it carries {made.carried:.0%} of the load" if made.carried < MOST else told


def _beams(design: Design, phases: Floats, loads: list[Bools], between: bool) -> str:
    """Lines that run unbroken from the load to the supports, or from one load to another one."""
    surface = design.surface
    first, second = (loads[0], loads[-1]) if between else (np.logical_or.reduce(loads), design.load.held)
    found = links(surface, phases, nearby(surface, first), nearby(surface, second))
    where = "from one load to the other" if between else "from the load to the supports"
    if not any(found):
        return f"no beam here, because no line of either family runs unbroken {where}"
    name = "a beam" if sum(found) == 1 else "beams"
    return f"{name}: {found[0]} major and {found[1]} minor lines run unbroken {where}"


def _grid(made: Rendition) -> str:
    told = f"members cross at {made.crossing:.0f} degrees or more, and P95 over P5 of their spacing is "
    told += f"{made.evenness:.3g}"
    if made.crossing >= ANGLE and made.evenness <= EVENNESS:
        return f"a grid: {told}"
    return f"no even grid here, because {told} (a grid: {ANGLE:g} degrees, {EVENNESS:g})"
