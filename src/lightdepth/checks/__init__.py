"""Is a loaded scene fit to be rendered? What spoils the picture is found before any time is spent on it.

Each file knows one kind of mistake. Errors make a rendering meaningless; warnings and hints say what to look at.
"""

from lightdepth.checks.coverage import Coverage, Hole
from lightdepth.checks.inspection import (
    Inspection,
    find_problems,
    forget_checked_places,
    frames_problems,
    inspect_file,
    inspect_scene,
)
from lightdepth.checks.photographs import PhotographReport
from lightdepth.checks.plate import PlateReport
from lightdepth.checks.problem import Problem, Severity

__all__ = [
    "Coverage",
    "Hole",
    "Inspection",
    "PhotographReport",
    "PlateReport",
    "Problem",
    "Severity",
    "find_problems",
    "forget_checked_places",
    "frames_problems",
    "inspect_file",
    "inspect_scene",
]
