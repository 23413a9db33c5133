"""Scenes in the files of other programs: COLMAP, OpenSfM and OpenDroneMap in, COLMAP, PLY, LAS and GeoJSON out."""
