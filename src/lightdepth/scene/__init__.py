"""The scene file, meshes and materials: one validated Scene of plain data."""
