"""Smooth STEP of curved sheets: spline skins on both sides, and ruled walls.

chart_fields : division of the surface into charts that project onto a plane without folds.
charts : both skins over each chart, as splines.
edges  : outlines as curves on the skins.
solid  : faces with shared edges, and the STEP text.
build  : construction of pieces, and their comparison with the mesh."""
