"""Smooth STEP of curved sheets: spline skins on both sides, trimmed by the pattern's edges, and ruled walls.

layout : division of the surface into charts that project onto a plane without folds; outlines in each chart.
charts : both skins over each chart, as splines through sample points.
edges  : the outlines as curves on the skins.
solid  : faces with shared edges, piece by piece, and the STEP text.
acceptance : OCCT's findings compared with the mesh, and data that all layouts share.
build  : the sequence of building, checking by OCCT (`worker.pieces`), refitting, and facets for refused pieces.
"""
