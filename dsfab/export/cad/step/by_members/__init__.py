"""STEP files of a curved sheet, with four-sided patches and ruled walls.

regions, fillets : regions of the sheet, chains (rows of mesh edges) between regions, round corners of openings.
region_division, borders : division of regions; smooth borders between regions.
curves, lines, patch_sides : curves along chains; sides of four-sided regions.
patches, trimmed : four-sided Coons patches; trimmed surfaces of all other regions.
trimmed_division, trimmed_corrections : division and correction of trimmed surfaces.
model, sharp_corners, fillet_edges : vertices, edges, walls and faces.
draft, build : sequence of all steps, STEP text, and checks."""
