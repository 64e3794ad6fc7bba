"""Measurements of fidelity and speed against full path tracing and other renderers: ``python -m bench``."""
