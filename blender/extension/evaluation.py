"""The scene as a rendering sees it: render visibility, render levels of modifiers, the frame's animation.

Blender makes such a dependency graph only while it renders. An operator that needs one (export, check) therefore
lets Blender render, with the engine set to hand the graph over instead of rendering.
"""

import queue
import threading
import traceback
from collections.abc import Callable
from contextlib import contextmanager
from typing import Any

import bpy

ENGINE = "LIGHTDEPTH"


def unexpected(error: Exception) -> str:
    """What is shown to a person of an unforeseen error."""
    traceback.print_exc()
    return f"The extension failed ({type(error).__name__}: {error}); please report it with the scene"


class EvaluationError(Exception):
    """Blender did not make the dependency graph."""


_Work = Callable[[bpy.types.Depsgraph, Callable[[int, float], None]], Any]
_work: _Work | None = None


def take_over(depsgraph: bpy.types.Depsgraph, engine: bpy.types.RenderEngine) -> bool:
    """Called by the engine: hand the graph to whoever asked for it. Returns whether somebody had."""
    if _work is None:
        return False
    _work(depsgraph, engine.frame_set)
    return True


def with_render_depsgraph(context, function: _Work) -> Any:
    """Call a function with the scene's dependency graph for rendering, and with what evaluates it at another time.

    Returns:
        What the function returns.

    Raises:
        EvaluationError: Blender refuses to render the scene.
        Exception: what the function raises.
    """
    global _work
    outcome: list[tuple[Any, BaseException | None]] = []

    def work(depsgraph, set_frame):
        if outcome:  # further view layers
            return
        try:
            outcome.append((function(depsgraph, set_frame), None))
        except Exception as error:
            outcome.append((None, error))

    _work = work
    try:
        with _as_engine(context.scene), _spare_render_slot():
            bpy.ops.render.render(scene=context.scene.name)
    except RuntimeError as error:  # what the operator reported
        raise EvaluationError(str(error).strip()) from error
    finally:
        _work = None
    if not outcome:
        raise EvaluationError("Blender did not evaluate the scene; is its view layer used for rendering?")
    result, error = outcome[0]
    if error is not None:
        raise error
    return result


@contextmanager
def _as_engine(scene):
    """Make the scene one that Blender renders with this engine and nothing else."""
    render, capture = scene.render, scene.lightdepth.capture
    before = (render.engine, render.use_compositing, render.use_sequencer, scene.camera)
    render.engine, render.use_compositing, render.use_sequencer = ENGINE, False, False
    if scene.camera is None:
        scene.camera = capture  # Blender does not render without one
    try:
        yield
    finally:
        render.engine, render.use_compositing, render.use_sequencer, scene.camera = before


@contextmanager
def _spare_render_slot():
    """Keep the picture that was rendered last: let the empty one go into another slot."""
    image = bpy.data.images.get("Render Result")
    if image is None or len(image.render_slots) < 2:
        yield
        return
    active = image.render_slots.active_index
    image.render_slots.active_index = (active - 1) % len(image.render_slots)
    try:
        yield
    finally:
        image.render_slots.active_index = active


POLL_SECONDS = 0.05


class _Call:
    """A function that a render thread wants called by the main thread, where Blender's data may be changed."""

    def __init__(self, function: Callable[[], Any]):
        self._function = function
        self._turn = threading.Lock()
        self.done = threading.Event()
        self.outcome: tuple[Any, BaseException | None] = (None, None)

    def make(self) -> None:
        """Call the function, unless the render thread has given up."""
        if not self._turn.acquire(blocking=False):
            return
        try:
            self.outcome = (self._function(), None)
        except Exception as error:
            self.outcome = (None, error)
        finally:
            self.done.set()

    def give_up(self) -> bool:
        """Whether the function will not be called any more; false when it is being called."""
        return self._turn.acquire(blocking=False)


_calls: queue.SimpleQueue[_Call] = queue.SimpleQueue()


def on_main_thread(function: Callable[[], Any], cancelled: Callable[[], bool]) -> Any:
    """Call a function on Blender's main thread and wait for what it returns.

    Args:
        function: what to call; what it raises is raised here.
        cancelled: whether to wait no longer for the main thread's attention; ``None`` is returned then.
    """
    if threading.current_thread() is threading.main_thread():
        return function()
    call = _Call(function)
    _calls.put(call)
    while not call.done.wait(POLL_SECONDS):
        if cancelled() and call.give_up():
            return None
    result, error = call.outcome
    if error is not None:
        raise error
    return result


def _serve() -> float:
    while not _calls.empty():
        _calls.get().make()
    return POLL_SECONDS


def register() -> None:
    """Begin to serve the render threads."""
    bpy.app.timers.register(_serve, persistent=True)


def unregister() -> None:
    """Stop serving."""
    if bpy.app.timers.is_registered(_serve):
        bpy.app.timers.unregister(_serve)
