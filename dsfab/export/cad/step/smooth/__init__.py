"""Smooth STEP of curved sheets: spline skins on both sides, trimmed by the pattern's edges, and ruled walls.

source   : what it takes, the uncut surface with offsets and the sheet that was cut from it.
splines  : curves; fits: many of them at once, through `rows` of samples.
patches  : surfaces; patch_fits: through points.
dense    : points of the skins between the vertices of the mesh.
layout   : the surface divided into charts that a plane sees whole.
charts   : the two skins over each chart, through `points`.
outline  : the outlines of the sheet in each chart, as runs of walls and of seams.
edges    : those runs as curves on the skins.
solid    : faces with shared edges, piece by piece.
text     : their entities.
limits   : how far the solid may be off the mesh; gate: whether it is.
plan     : what all layouts share, and the pieces built in one of them.
make     : the ladder: build, ask OCCT (`check` with `occt_volume`, a program of its own), refit what `refit` names,
           give pieces up.
"""
