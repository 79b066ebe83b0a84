"""Smooth STEP of curved sheets: spline skins on both sides, and ruled walls.

chart_fields : division of the surface into charts (parts) that project onto a plane without folds.
charts : spline surfaces for both skins of each chart.    edges : curves on the skins along the outlines.
solid  : faces with shared edges, STEP text.    build : construction of pieces, and comparison with the mesh."""
