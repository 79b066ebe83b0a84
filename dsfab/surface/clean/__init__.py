"""Repair of meshes: seams, duplicate sheets, ragged borders, holes, raw scans."""
