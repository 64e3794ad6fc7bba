"""Sessions: what they report, how they are steered, and that steering does not change the picture."""

import itertools
import threading
from dataclasses import replace

import pytest

from lightdepth.kernel.start import start

start("cpu")

import lightdepth  # noqa: E402
from lightdepth.api import begin_rendering, forget_prepared  # noqa: E402
from lightdepth.errors import InputError  # noqa: E402
from lightdepth.film.layers import read_frame  # noqa: E402
from lightdepth.parameters import FilmParameters, Parameters  # noqa: E402
from lightdepth.session import events  # noqa: E402
from lightdepth.session.displays import ExrDisplay, MemoryDisplay, PngDisplay  # noqa: E402
from lightdepth.session.events import (  # noqa: E402
    KINDS,
    Caution,
    Done,
    Failure,
    FrameState,
    Hello,
    Picture,
    Preparing,
    Progress,
    SequenceProgress,
    Stage,
)
from lightdepth.session.session import Job, Session  # noqa: E402
from tests.transport.places import GREY, ball, lamp_image, room  # noqa: E402

PATIENCE = 120.0
"""Seconds after which a test has failed."""
SMALL_PASSES = Parameters(film=FilmParameters(paths_at_once=1 << 12))


@pytest.fixture(scope="module")
def scene():
    return room(lamp_image(128), [ball(GREY)], parameters=SMALL_PASSES)


class Watched(Session):
    """A session with everything that it reports, and a display in memory."""

    def __init__(self, scene, **options):
        super().__init__(scene, **options)
        self.told, self.shown = [], MemoryDisplay()
        self._news = threading.Condition()
        self.on(self._note)
        self.display(self.shown)

    def _note(self, event):
        with self._news:
            self.told.append(event)
            self._news.notify_all()

    def until(self, kind, count=1):
        """Wait until so many events of a kind have come."""
        with self._news:
            enough = self._news.wait_for(lambda: sum(isinstance(e, kind) for e in self.told) >= count, PATIENCE)
        assert enough, self.told

    def during(self, kind, count, act):
        """Do something in the session's own thread when so many events of a kind have come, however slow this one is."""

        def when(event):
            if isinstance(event, kind) and sum(isinstance(each, kind) for each in self.told) == count:
                act()

        self.on(when)

    def stages(self):
        return [event.stage for event in self.told if isinstance(event, Stage)]


def plain(scene, samples, camera="view"):
    return lightdepth.render(scene, camera, samples).beauty.tobytes()


def test_a_session_reports_its_stages_and_shows_the_picture_of_render(scene, tmp_path):
    session = Watched(scene)
    session.display(ExrDisplay(tmp_path / "made" / "x.exr", ["depth"]))
    session.display(PngDisplay(tmp_path / "made" / "x.png"))
    done = session.run(Job("view", 8, preview_seconds=0.0))
    assert replace(done, exposure=None, error=None) == Done(str(tmp_path / "made" / "x.exr"))
    assert done == session.told[-1]
    assert session.stages() == ["preparing", "rendering", "writing"]
    assert session.told[-2] == Picture(done.file, finished=True)
    assert any(event == Picture(done.file, finished=False) for event in session.told)
    assert [event for event in session.told if isinstance(event, Progress)][-1].fraction == 1.0
    assert session.shown.finished
    assert session.shown.frame.beauty.tobytes() == plain(scene, 8)
    assert sorted(path.name for path in (tmp_path / "made").iterdir()) == ["x.exr", "x.png"]
    assert session.shown.frame.depth is not None  # one of the displays wanted it
    with pytest.raises(InputError, match="lacks the layers"):
        read_frame(tmp_path / "made" / "x.exr")


def test_a_paused_session_waits_and_goes_on_to_the_same_picture(scene):
    session = Watched(scene)
    first = None

    def pause_once(event):
        nonlocal first
        if first is None and isinstance(event, Progress):
            first = event
            session.pause()

    session.on(pause_once)
    session.start(Job("view", 32))
    session.until(Progress)
    assert not session.wait(0.5)
    assert sum(isinstance(event, Progress) for event in session.told) == 1
    session.resume()
    assert session.wait(PATIENCE)
    assert session.shown.frame.beauty.tobytes() == plain(scene, 32)


def test_a_cancelled_session_shows_what_it_has_and_can_go_on(scene):
    session = Watched(scene)
    session.during(Progress, 3, session.cancel)
    session.start(Job("view", 64))
    assert session.wait(PATIENCE)
    assert replace(session.told[-1], exposure=None, error=None) == Done(None, interrupted=True)
    assert 0 < session.shown.frame.samples.mean() < 64
    session.start(Job("view", 64))
    assert session.wait(PATIENCE)
    assert session.stages().count("preparing") == 1
    assert session.shown.frame.beauty.tobytes() == plain(scene, 64)
    session.start(Job("view", 64, preview_seconds=9.0))  # All is there: it is shown again.
    assert session.wait(PATIENCE)
    assert session.stages().count("preparing") == 1
    assert session.shown.frame.beauty.tobytes() == plain(scene, 64)


def test_more_samples_can_be_asked_for_while_it_renders_and_afterwards(scene):
    session = Watched(scene)
    session.during(Progress, 2, lambda: session.set_samples(16))
    session.start(Job("view", 1_000_000))
    assert session.wait(PATIENCE)
    assert session.shown.frame.samples.mean() == pytest.approx(16, rel=0.3)
    session.set_samples(48)
    assert session.wait(PATIENCE)
    assert session.shown.frame.samples.mean() == pytest.approx(48, rel=0.05)
    assert session.stages().count("preparing") == 1
    with pytest.raises(InputError, match="at least 1"):
        session.set_samples(0)


def test_a_changed_scene_begins_again(scene):
    other = replace(scene, synthetic=(ball(GREY, (-0.5, 1.0, 0.3), 0.3),))
    session = Watched(scene)
    session.during(Progress, 2, session.pause)
    session.start(Job("view", 1_000_000))
    session.until(Progress, 2)
    session.set_samples(8)
    session.reset(other)
    assert session.wait(PATIENCE)
    assert sum(isinstance(event, Done) for event in session.told) == 1
    assert session.shown.frame.beauty.tobytes() == plain(other, 8)


def test_a_killed_process_would_lose_no_more_than_asked_for(scene, tmp_path, monkeypatch):
    """By a clock that passes of nine seconds drive, so that no machine is too slow for it."""

    class Clock:
        now = 0.0

        @classmethod
        def monotonic(cls):
            return cls.now

    checkpoint, states = tmp_path / "x.checkpoint", []
    monkeypatch.setattr("lightdepth.session.session.time", Clock)
    monkeypatch.setattr("lightdepth.session.session.write_checkpoint", lambda *_: states.append(Clock.now))
    session = Watched(scene)

    def tick(event):
        if isinstance(event, Progress):
            Clock.now += 9.0

    session.on(tick)
    session.run(Job("view", 32, checkpoint=checkpoint, checkpoint_seconds=30.0))
    assert len(states) > 3
    assert states[-1] == Clock.now  # Denoising and writing would lose nothing of it.
    assert max(later - first for first, later in itertools.pairwise([0.0, *states])) <= 30.0
    assert min(later - first for first, later in itertools.pairwise(states[:-1])) > 20.0
    monkeypatch.undo()

    def keep(event):
        if event == Stage("writing"):
            checkpoint.rename(tmp_path / "kept.checkpoint")

    again = Watched(scene)
    again.on(keep)
    again.run(Job("view", 8, checkpoint=checkpoint, checkpoint_seconds=0.0))
    last = Watched(scene)
    last.run(Job("view", 8, checkpoint=tmp_path / "kept.checkpoint", resume=True))
    assert [event.fraction for event in last.told if isinstance(event, Progress)] == [1.0]
    assert last.shown.frame.beauty.tobytes() == again.shown.frame.beauty.tobytes()


def test_several_threads_may_steer_it(scene):
    session = Watched(scene)
    together = []

    def count(_):
        together.append(sum(thread is session._thread or thread in begun for thread in threading.enumerate()))
        begun.add(threading.current_thread())

    begun = set()
    session.on(count)
    session.start(Job("view", 1))
    assert session.wait(PATIENCE)

    def steer(number):
        for turn in range(6):
            [lambda: session.start(Job("view", 2)), lambda: session.set_samples(3), lambda: session.reset(scene)][
                (number + turn) % 3
            ]()

    threads = [threading.Thread(target=steer, args=(number,)) for number in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert session.wait(PATIENCE)
    assert set(together) == {1}
    assert isinstance(session.told[-1], Done)


def test_a_listener_that_would_wait_for_itself_is_refused_and_may_steer_otherwise(scene):
    session = Watched(scene)
    refused = []

    def steer():
        for act in (lambda: session.start(Job("view", 4)), lambda: session.reset(scene), session.wait):
            with pytest.raises(InputError, match="cannot wait for its own end"):
                act()
            refused.append(act)
        session.set_samples(6)

    session.during(Progress, 1, steer)
    session.start(Job("view", 4))
    assert session.wait(PATIENCE)
    assert len(refused) == 3
    assert session.shown.frame.beauty.tobytes() == plain(scene, 6)


def test_it_can_be_cancelled_while_it_prepares(scene):
    forget_prepared()
    slow = replace(scene, render=replace(scene.render, irradiance_samples=1 << 16))
    session = Watched(slow)
    session.during(Preparing, 1, session.cancel)
    session.start(Job("view", 8))
    assert session.wait(PATIENCE)
    assert replace(session.told[-1], exposure=None, error=None) == Done(None, interrupted=True)
    assert session.stages() == ["preparing"]
    assert session.shown.frame is None


def test_what_is_cancelled_before_the_first_pass_takes_none(scene):
    """With the place prepared, nothing asks on the way there."""
    begin_rendering(scene, "view")
    session = Watched(scene)
    session.during(Stage, 1, session.cancel)
    session.start(Job("view", 8))
    assert session.wait(PATIENCE)
    reported = [event for event in session.told if not isinstance(event, Caution)]
    assert reported == [Stage("preparing"), Done(None, interrupted=True)]
    assert session.shown.frame is None


def test_a_region_comes_first(scene):
    session = Watched(scene)
    samples = []

    class Keep(MemoryDisplay):
        def show(self, frame, finished):
            samples.append(frame.samples)

    session.display(Keep())
    session.run(Job("view", 32, region=(8, 4, 24, 20), preview_seconds=0.0))
    outside = samples[0].copy()
    outside[4:20, 8:24] = 0
    assert samples[0].any()
    assert not outside.any()
    assert samples[-1].mean() == pytest.approx(32, rel=0.05)


def test_what_goes_wrong_in_a_thread_is_reported(scene):
    session = Watched(scene)
    session.start(Job("veiw", 8))
    assert session.wait(PATIENCE)
    assert Stage("preparing") not in session.told
    assert session.told[-1] == Failure(
        f"scene: no camera 'veiw'; did you mean 'view'? allowed: {', '.join(scene.cameras)}"
    )


@pytest.mark.parametrize(
    "event",
    [
        Hello("1.0"),
        Stage("preparing"),
        Preparing(0.25),
        Progress(0.5, 4.0, 0.1, 3.0),
        Picture("x.exr", True),
        Caution("careful"),
        Failure("no"),
        Done("x.exr", True),
        SequenceProgress(3, 10, 2, 1, 0.25, None),
        FrameState(3, "x.0003.exr", "current"),
    ],
    ids=lambda event: event.kind,
)
def test_events_travel_as_json(event):
    assert KINDS[event.kind] is type(event)
    assert events.from_json(event.to_json(id="7")) == event
    assert "\n" not in event.to_json()


def test_events_of_other_versions_are_ignored_and_nonsense_is_not():
    assert events.from_json('{"event": "invented later"}') is None
    assert events.from_json('{"event": "stage", "stage": "writing", "more": 1}') == Stage("writing")
    for line in ("hello", "[]", '{"event": "stage"}', "{}"):
        with pytest.raises(InputError, match="not an event"):
            events.from_json(line)
