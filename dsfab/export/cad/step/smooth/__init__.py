"""Smooth STEP of curved sheets: spline skins on both sides, trimmed by the pattern's edges, and ruled walls.

chart_fields : division of the surface into charts that project onto a plane without folds.
charts : both skins over each chart, as splines through sample points.
edges  : outlines as curves on the skins.
solid  : faces with shared edges, piece by piece, and the STEP text.
build  : construction of pieces in several layouts of charts, and their comparison with the mesh."""
