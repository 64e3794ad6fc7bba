"""Panorama, clicks, depth or points to meshes of the real place."""
