"""A process that renders one request after the other, for a program that talks to it by lines of JSON.

The worker speaks first: :class:`~lightdepth.session.events.Hello`. Every request is a JSON object on one line:

- ``{"request": "hello", "schema": 1}`` must be the first;
- ``{"request": "render", "id": "1", "scene": "room.toml", "output": "view.exr", "camera": "view", ...}``, with the other
  attributes of :class:`RenderRequest` as keys;
- ``{"request": "cancel", "id": "1"}``, whether it is being prepared, rendered, or still waits;
- ``{"request": "quit"}``, or the end of the input.

Events are answered with the ``id`` of their request; each request ends with one ``done`` or ``failure``. Scenes stay
prepared: a request for a scene whose contents have not changed begins to sample at once.
"""

from __future__ import annotations

import json
import logging
import queue
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from lightdepth.api import load_scene
from lightdepth.errors import InputError, InputWarning, LightdepthError
from lightdepth.kernel.start import Device
from lightdepth.scene.frames import SceneFrames
from lightdepth.sequence.motion_blur import MotionBlur
from lightdepth.sequence.shutter import Shutter, frame_job
from lightdepth.session.displays import Display, ExrDisplay, PngDisplay
from lightdepth.session.events import SCHEMA, Caution, Done, Event, Failure, Hello, Stage
from lightdepth.session.session import Job, Session

LOGGER = logging.getLogger(__name__)


class RenderRequest(BaseModel):
    """A request to render; the attributes are those of :class:`~lightdepth.session.session.Job` and ``render``'s options.

    Attributes:
        id: of the request, for its events.
        scene: the scene file.
        frame: of its sequence, which is rendered with the motion blur and the seed that it has there; ``None`` renders the
            scene at its first frame, as it stands.
        output: the EXR file to write.
        picture: also write a PNG beside it.
        layers: names of layers to write; ``None`` for all.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    request: Literal["render"]
    id: str
    scene: Path
    output: Path
    frame: int | None = Field(default=None, ge=0)
    camera: str | None = None
    samples: int | None = Field(default=None, ge=1)
    noise: float | None = Field(default=None, gt=0.0)
    seed: int | None = Field(default=None, ge=0, lt=2**32)
    method: str = "difference"
    denoise: bool = False
    draft: bool = False
    region: tuple[int, int, int, int] | None = None
    preview_seconds: float | None = Field(default=None, gt=0.0)
    picture: bool = False
    exposure: float = 0.0
    layers: list[str] | None = None
    repair: bool = False


@dataclass
class _Running:
    """The request at work.

    Attributes:
        id: its id.
        session: its session; ``None`` while the scene is loaded.
        cancelled: whether it is no longer wanted.
    """

    id: str
    session: Session | MotionBlur | None = None
    cancelled: bool = False


class Worker:
    """Takes requests and answers with events.

    Args:
        answer: is given every line of the answer.
        device: ``auto``, ``cpu`` or ``cuda``.
    """

    def __init__(self, answer: Callable[[str], None], device: Device = "auto") -> None:
        self._answer, self._device = answer, device
        self._lock = threading.Lock()
        self._waiting: queue.SimpleQueue[RenderRequest | None] = queue.SimpleQueue()
        self._running: _Running | None = None
        self._cancelled: set[str] = set()
        self._pending: set[str] = set()

    def serve(self, lines: Iterable[str]) -> None:
        """Answer requests until one is ``quit`` or there are no more.

        Raises:
            InputError: the other side speaks another version of the protocol, or does not say which.
        """
        self._say(Hello(metadata.version("lightdepth")))
        renderer = threading.Thread(target=self._render_all, name="lightdepth worker", daemon=True)
        renderer.start()
        greeted = False
        try:
            for line in lines:
                if not line.strip():
                    continue
                request = _parsed(line)
                kind = request.get("request") if request is not None else None
                if not greeted:
                    _greet(request)
                    greeted = True
                elif kind == "quit":
                    break
                elif kind == "cancel":
                    self._cancel(str(request["id"]) if request is not None and "id" in request else None)
                else:
                    self._enqueue(line, request)
        finally:
            self._cancel(None)
            self._waiting.put(None)
            renderer.join()

    def _enqueue(self, line: str, request: dict[str, Any] | None) -> None:
        name = str(request.get("id", "")) if request is not None else ""
        try:
            if request is None or request.get("request") != "render":
                raise InputError(f"not a request: {line.strip()[:120]}; allowed are render, cancel, quit")
            checked = RenderRequest.model_validate(request)
            with self._lock:
                if name in self._pending:
                    raise InputError(f"request '{name}': this id is already in use")
                self._pending.add(name)
            self._waiting.put(checked)
        except ValidationError as error:
            wrong = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
            self._say(Failure(f"request: {wrong}"), name)
        except InputError as error:
            self._say(Failure(str(error)), name)

    def _cancel(self, name: str | None) -> None:
        """Cancel a request, or all of them."""
        with self._lock:
            if name in self._pending:
                self._cancelled.add(name)
            elif name is None:
                while True:
                    try:
                        waiting = self._waiting.get_nowait()
                    except queue.Empty:
                        break
                    if waiting is not None:
                        self._end(Done(None, interrupted=True), waiting.id)
            running = self._running
            if running is not None and name in (None, running.id):
                running.cancelled = True
                if running.session is not None:
                    running.session.cancel()

    def _say(self, event: Event, name: str | None = None) -> None:
        self._answer(event.to_json() if name is None else event.to_json(id=name))

    def _end(self, event: Done | Failure, name: str) -> None:
        """Say how a request ended. Whoever reads that may use its id again at once."""
        self._cancelled.discard(name)
        self._pending.discard(name)
        self._say(event, name)

    @contextmanager
    def _cautions(self, name: str) -> Iterator[None]:
        """Report what files hold and is not applied, at every request and not only at the first."""
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", InputWarning)
            yield
        messages = dict.fromkeys(str(w.message) for w in caught if issubclass(w.category, InputWarning))
        for message in messages:
            self._say(Caution(message), name)
        for other in caught:
            if not issubclass(other.category, InputWarning):
                warnings.warn_explicit(other.message, other.category, other.filename, other.lineno)

    def _render_all(self) -> None:
        while (request := self._waiting.get()) is not None:
            with self._lock:
                self._running = _Running(request.id, cancelled=request.id in self._cancelled)
                running = self._running
            try:
                self._render(request, running)
            except LightdepthError as error:
                self._end(Failure(str(error)), request.id)
            except Exception as error:
                LOGGER.exception("a request failed")
                self._end(Failure(f"internal error: {type(error).__name__}: {error}"), request.id)
            with self._lock:
                running.session = self._running = (
                    None  # The samples of what is done would fill the memory till the next.
                )

    def _render(self, request: RenderRequest, running: _Running) -> None:
        job = Job(
            camera=request.camera,
            samples=request.samples,
            noise=request.noise,
            method=request.method,
            seed=request.seed,
            draft=request.draft,
            denoise=request.denoise,
            region=request.region,
            preview_seconds=request.preview_seconds,
        )
        work: Session | MotionBlur | None = None
        if not running.cancelled:
            self._say(Stage("loading"), request.id)
            _check_layers(request.layers)
            with self._cautions(request.id):
                work, job = self._work(request, job)
        with self._lock:
            if running.cancelled or work is None:
                self._end(Done(None, interrupted=True), request.id)
                return
            running.session = work
        displays: list[Display] = [ExrDisplay(request.output, request.layers)]
        if request.picture:
            displays.append(PngDisplay(request.output.with_suffix(".png"), request.exposure))

        def report(event: Event) -> None:
            if isinstance(event, Done | Failure):
                self._end(event, request.id)
            else:
                self._say(event, request.id)

        if isinstance(work, MotionBlur):
            work.render(displays, self._device, report)
            return
        work.on(report)
        for display in displays:
            work.display(display)
        work.run(job, lambda: running.cancelled)

    def _work(self, request: RenderRequest, job: Job) -> tuple[Session | MotionBlur, Job]:
        """What renders a request, and its job."""
        if request.frame is None:
            return Session(load_scene(request.scene, request.repair), self._device), job
        frames = SceneFrames(request.scene, request.repair)
        number = request.frame
        first, last = frames.sequence.frames
        if not first <= number <= last:
            raise InputError(f"request: frame: {number} is outside the [sequence], which has frames {first} to {last}")
        scene = frames.scene(number)
        job = frame_job(job, scene, number)
        blurred = Shutter(frames.sequence, job, self._device, lambda _, instant: frames.scene(instant)).blurred(
            number, scene, job
        )
        return (blurred if blurred.moves else Session(scene, self._device)), job


def _parsed(line: str) -> dict[str, Any] | None:
    try:
        request = json.loads(line)
    except ValueError:
        return None
    return request if isinstance(request, dict) else None


def _check_layers(names: list[str] | None) -> None:
    """Refuse unknown layers before any time is spent.

    Raises:
        InputError: there is no layer of a name.
    """
    from lightdepth.film.layers import LAYERS

    unknown = [name for name in names or [] if name not in LAYERS]
    if unknown:
        raise InputError(f"request: layers: '{unknown[0]}' is unknown; allowed are {', '.join(LAYERS)}")


def _greet(request: dict[str, Any] | None) -> None:
    """Check the first request.

    Raises:
        InputError: it is not a greeting, or not one of this version.
    """
    if request is None or request.get("request") != "hello":
        raise InputError(f'the first request must be {{"request": "hello", "schema": {SCHEMA}}}')
    if request.get("schema") != SCHEMA:
        raise InputError(
            f"the client uses version {request.get('schema')} of the protocol, this lightdepth version {SCHEMA}; "
            "use the same version of both"
        )
