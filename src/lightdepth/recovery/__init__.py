"""Inverse rendering of the place: the irradiance and the albedo of its real surfaces, recovered from the photograph."""
