"""Photographs of a mirror ball to one HDR panorama around the ball."""
