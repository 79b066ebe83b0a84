"""STEP with step = 'members': a curved sheet as four-sided patches on shared curves, and ruled walls.

regions, fillets : regions of the sheet, chains of mesh edges between regions, round corners of openings.
region_division, borders : division of regions at bends and at ends of members; straight borders.
curves, lines, patch_sides : curves along chains on both skins; sides of four-sided regions.
patches, trimmed : Coons patches of four-sided regions; trimmed surfaces of all other regions.
trimmed_division, trimmed_corrections : division and correction of trimmed surfaces far from their edges or the mesh.
model, sharp_corners, fillet_edges : vertices, edges, walls and faces in a form that OCCT can fillet.
draft, build : sequence of all steps, STEP text, and checks of the file by OCCT."""
