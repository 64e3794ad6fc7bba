"""A panorama to its pose in the world."""
