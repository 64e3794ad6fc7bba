"""Photographs to one HDR panorama."""
