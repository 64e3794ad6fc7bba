"""Buttons that ask the renderer something: Blender stays usable until the answer is there, and Escape gives up."""

import tempfile
from pathlib import Path

import bpy

from .evaluation import EvaluationError
from .export import ExportError
from .process import Question, RendererError, find_command

LOOK_SECONDS = 0.1
"""Between two looks whether the answer is there."""
_REFUSALS = (RendererError, ExportError, EvaluationError, OSError)


def renderer_command() -> str:
    """The path of the renderer's command.

    Raises:
        RendererError: it was not found.
    """
    return find_command(bpy.context.preferences.addons[__package__].preferences.command.strip())


class Asks:
    """Base of the operators that ask the renderer something.

    Subclasses say what is asked (``arguments``) and what follows (``take``); both may raise errors in words, which
    are reported. A button goes on at once and Escape gives up; a script waits for the answer.
    """

    def arguments(self, context, folder: Path) -> list[str]:
        """Arguments of the command; the folder is there until the answer is taken."""
        raise NotImplementedError

    def take(self, context, question: Question) -> None:
        """Do what follows from the answer."""
        raise NotImplementedError

    def refused(self, context, why: str) -> None:
        """Do what follows where there is no answer, beside the report."""

    def execute(self, context):
        """Ask and wait."""
        if not self._ask(context):
            return {"CANCELLED"}
        try:
            self._question.wait()
        except RendererError as error:
            return self._refuse(context, str(error))
        return self._take(context)

    def invoke(self, context, event):
        """Ask, and look for the answer from time to time."""
        if not self._ask(context):
            return {"CANCELLED"}
        self._timer = context.window_manager.event_timer_add(LOOK_SECONDS, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        """Look for the answer, or for Escape."""
        if event.type == "ESC" and event.value == "PRESS":
            return self._refuse(context, f"{self.bl_label}: given up", "WARNING")
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        context.workspace.status_text_set(f"{self._question.status}. Esc: give up")
        try:
            answered = self._question.is_answered()
        except RendererError as error:
            return self._refuse(context, str(error))
        return self._take(context) if answered else {"PASS_THROUGH"}

    def cancel(self, context):
        """Blender ends the operator: a window is closed, or another file is opened."""
        self._stop(context)

    def _ask(self, context) -> bool:
        self._timer = None
        self._folder = tempfile.TemporaryDirectory(prefix="lightdepth-")
        try:
            arguments = self.arguments(context, Path(self._folder.name))
            self._question = Question(renderer_command(), arguments)
        except _REFUSALS as error:
            self._folder.cleanup()
            self.refused(context, str(error))
            self.report({"ERROR"}, str(error))
            return False
        return True

    def _take(self, context):
        try:
            self.take(context, self._question)
        except _REFUSALS as error:
            return self._refuse(context, str(error))
        self._stop(context)
        return {"FINISHED"}

    def _refuse(self, context, why: str, kind: str = "ERROR"):
        self.refused(context, why)
        self._stop(context)
        self.report({kind}, why)
        return {"CANCELLED"}

    def _stop(self, context) -> None:
        """Leave nothing behind, and show what has changed."""
        self._question.end()
        self._folder.cleanup()
        if self._timer is not None:
            context.window_manager.event_timer_remove(self._timer)
            context.workspace.status_text_set(None)
        for window in context.window_manager.windows:
            for area in window.screen.areas:
                area.tag_redraw()
