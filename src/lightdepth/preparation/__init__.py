"""A scene made ready for a method: the place, which is prepared once, apart from the objects, which may move."""

from lightdepth.preparation.methods import METHODS, Prepared

__all__ = ["METHODS", "Prepared"]
