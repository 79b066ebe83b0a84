"""Smooth STEP of curved sheets: spline skins on both sides, trimmed by the pattern's edges, and ruled walls.

chart_fields : division of the surface into charts that project onto a plane without folds.
charts : both skins over each chart, as splines through sample points.
edges  : the outlines as curves on the skins.
solid  : faces with shared edges, piece by piece, and the STEP text.
build  : layouts of charts; pieces are built, checked by OCCT (`worker.pieces`), compared with the mesh, refitted."""
