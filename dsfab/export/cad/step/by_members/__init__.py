"""STEP of curved sheets by members: untrimmed four-sided patches on shared curves, and ruled walls.

regions, fillets : regions of the sheet, chains of mesh edges between them, and round corners of openings.
region_division, borders : division of regions at bends and at ends of members; straight borders.
curves, lines, patch_sides : curves of degree 2 or 3 along chains on both skins, and sides of four-sided regions.
patches, trimmed : Coons patches of four-sided regions, and trimmed surfaces of all other regions.
trimmed_division, trimmed_corrections : trimmed regions divided or corrected if they miss their edges or the mesh.
model, sharp_corners, fillet_edges : vertices, edges, walls and faces, prepared so that OCCT can fillet the edges.
draft, build : the sequence of all steps, the STEP text, and OCCT's checks of the file."""
