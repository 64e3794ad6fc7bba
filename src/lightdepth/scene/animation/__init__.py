"""Keys in the scene file: a file that moves becomes an ordinary one at each frame."""

from lightdepth.scene.animation.document import Animation
from lightdepth.scene.animation.sequence import SequenceTable
from lightdepth.scene.animation.shown import AnimationTable, ShownAnimation

__all__ = ["Animation", "AnimationTable", "SequenceTable", "ShownAnimation"]
