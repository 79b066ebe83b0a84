"""The structure coloured by what its bays bear of what they can, with the worst members named."""

import math

import numpy as np
from scipy.spatial import cKDTree

from dsfab.arrays import Floats
from dsfab.errors import DsfabError
from dsfab.pipeline import Design
from dsfab.report.compliance.document import Numbers, ReportFigure, Scale
from dsfab.report.compliance.pictures import SIZE, WHITE, jpeg, trimmed
from dsfab.report.compliance.words import nice

WORST = 10
"""Members that are listed, drawn and named."""
BANDS = 10
"""Of colour, or a few less."""
SAMPLES = 8
"""Points along a bay by which cells find it."""


def rating_figure(design: Design, number: Numbers) -> ReportFigure:
    """The picture, or why there is none."""
    from dsfab.render import band_colours, rated_members_picture

    found = design.member_utilisation
    value = bay_values(design)
    limit = float(np.nanmax(value)) if np.isfinite(value).any() else 1.0
    step = nice(max(limit, 1e-3) / BANDS)
    count = max(2, math.ceil(limit / step - 1e-9))
    band = np.where(np.isnan(value), -1, np.minimum(np.nan_to_num(value) / step, count - 1)).astype(np.int64)
    names = [found.bays.member[bay] for bay in found.worst_bays(WORST)]
    labels = [f"{100 * step * k:.4g} %" for k in range(count + 1)]
    caption = number.figure(
        f"What each bay bears of what it can, in the case and the check that decide. The {len(names)} worst members "
        "are named; plates, discs and fills are not checked and have no colour."
    )
    scale = Scale("utilisation: 100 % is full", band_colours(count), labels)
    try:
        pixels = trimmed(rated_members_picture(design, band, count, names, size=SIZE, palette=WHITE), WHITE.paper)
    except DsfabError as error:
        return ReportFigure(caption, b"", SIZE, missing=f"no picture: {error}")
    return ReportFigure(caption, jpeg(pixels), (pixels.shape[1], pixels.shape[0]), 0.86, scale)


def bay_values(design: Design) -> Floats:
    """(m,) utilisation: of the bay that each cell of the members' sheet is nearest to along its member. Where members
    cross, the larger; NaN where there is none."""
    graph, found = design.members, design.member_utilisation
    value = np.full(graph.sheet.surface.m, -np.inf)
    for name in dict.fromkeys(found.bays.member):
        member, own = graph.by_id[name], [k for k, one in enumerate(found.bays.member) if one == name]
        assert member.axis is not None
        s = np.array([np.linspace(found.bays.s[k, 0], found.bays.s[k, -1], SAMPLES) for k in own]).ravel()
        P = member.axis.at(s % member.axis.length if member.axis.closed else s)[0]
        nearest = np.asarray(cKDTree(P).query(graph.sheet.surface.centroids[member.cells])[1]) // SAMPLES
        value[member.cells] = np.maximum(value[member.cells], found.largest[np.array(own)[nearest]])
    return np.where(np.isinf(value), np.nan, value)
