"""`lightdepth serve --stdio` as a program uses it."""

import json
import subprocess
import sys
import threading
import time

import pytest

from lightdepth.film.frame import EXPOSURE
from lightdepth.film.layers import read_frame
from lightdepth.serve.worker import Worker
from lightdepth.session.events import SCHEMA
from tests.cli.room_folder import edit, make_room

PROGRAM = [sys.executable, "-c", "from lightdepth.cli.app import main; main()", "serve", "--stdio"]
HELLO = {"request": "hello", "schema": SCHEMA}


class Client:
    """The other side of a worker."""

    def __init__(self):
        self._process = subprocess.Popen(
            PROGRAM, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    @property
    def pid(self):
        return self._process.pid

    def ask(self, **request):
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()

    def event(self):
        return json.loads(self._process.stdout.readline())

    def until(self, *kinds, name=None):
        """Events up to the first of these kinds, of one request."""
        told = []
        while True:
            event = self.event()
            if name in (None, event.get("id")):
                told.append(event)
                if event["event"] in kinds:
                    return told

    def end(self):
        """Exit status and standard error."""
        _, errors = self._process.communicate(timeout=60)
        return self._process.returncode, errors

    def kill(self):
        self._process.kill()
        self._process.communicate()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("room")
    scene = make_room(folder)
    edit(scene, "width = 16\nheight = 9", "width = 64\nheight = 36\nposition = [0, 0, 1.3]\nlook_at = [0.5, 1, 0.3]")
    with scene.open("a") as file:
        file.write("\n[render]\nsamples = 4\nirradiance_samples = 16\n")
    return folder


@pytest.fixture
def client():
    client = Client()
    yield client
    client.kill()


def test_a_worker_renders_one_request_after_the_other(folder, client):
    hello = client.event()
    assert (hello["event"], hello["pid"]) == ("hello", client.pid)
    client.ask(**HELLO)
    scene, first, second = str(folder / "scene.toml"), str(folder / "1.exr"), str(folder / "2.exr")
    client.ask(request="render", id="a", scene=scene, output=first, layers=["samples"], picture=True)
    client.ask(request="render", id="b", scene=scene, output=second, samples=100_000_000)
    client.ask(request="render", id="c", scene=scene, output=str(folder / "3.exr"))
    client.ask(request="cancel", id="c")
    told = client.until("done", "failure", name="a")
    assert [event["stage"] for event in told if event["event"] == "stage"] == [
        "loading",
        "preparing",
        "rendering",
        "writing",
    ]
    exposure = told[-1].pop("exposure")
    assert 0.0 < told[-1].pop("error") < 1.0
    assert told[-1] == {"event": "done", "file": first, "interrupted": False, "denoised": False, "id": "a"}
    assert (folder / "1.png").is_file()
    client.until("progress", name="b")
    client.ask(request="cancel", id="b")
    assert client.until("done", "failure", name="b")[-1]["interrupted"]
    assert exposure == pytest.approx(
        float(read_frame(folder / "2.exr").metadata[EXPOSURE]), abs=1e-3
    )  # of the panorama
    assert 0 < read_frame(folder / "2.exr").samples.max() < 100_000_000
    ended = {"event": "done", "file": None, "interrupted": True, "denoised": False, "id": "c"}
    ended |= {"exposure": None, "error": None}
    assert client.until("done", name="c") == [ended]
    assert not (folder / "3.exr").exists()
    # What is wrong with one request is no reason to stop.
    for request, message in (
        ({"request": "render", "id": "d", "scene": "nowhere.toml", "output": first}, "nowhere.toml: no such file"),
        ({"request": "render", "id": "e", "scene": scene, "output": first, "samples": 0}, "samples: "),
        ({"request": "render", "id": "f", "scene": scene, "output": first, "sample": 1}, "sample: "),
        (
            {"request": "render", "id": "h", "scene": scene, "output": first, "layers": ["plates"]},
            "'plates' is unknown",
        ),
        ({"request": "paint", "id": "g"}, "allowed are render, cancel, quit"),
    ):
        client.ask(**request)
        failure = client.until("failure", "done", name=request["id"])[-1]
        assert failure["event"] == "failure"
        assert message in failure["message"]
    client.ask(request="quit")
    status, errors = client.end()
    assert status == 0
    assert errors == ""


def test_what_a_file_says_and_is_not_applied_is_reported_for_every_request(folder, client):
    (folder / "room.hdr").write_bytes((folder / "room.exr").read_bytes())
    (folder / "misnamed.toml").write_text((folder / "scene.toml").read_text().replace("room.exr", "room.hdr"))
    client.ask(**HELLO)
    for name in "ab":
        client.ask(
            request="render", id=name, scene=str(folder / "misnamed.toml"), output=str(folder / "5.exr"), draft=True
        )
        told = client.until("done", "failure", name=name)
        assert told[-1]["event"] == "done"
        assert any("room.hdr" in event["message"] for event in told if event["event"] == "warning")
    client.ask(request="quit")
    assert client.end() == (0, "")


def test_a_worker_ends_with_its_input_whatever_it_is_doing(folder, client):
    client.ask(**HELLO)
    client.ask(
        request="render", id="a", scene=str(folder / "scene.toml"), output=str(folder / "4.exr"), samples=100_000_000
    )
    client.until("progress", name="a")
    status, _ = client.end()
    assert status == 0


def test_an_id_is_free_as_soon_as_the_end_of_its_request_is_told():
    told, ended, asked = [], threading.Event(), threading.Event()

    def answer(line):
        told.append(json.loads(line))
        if told[-1]["event"] == "failure" and not ended.is_set():
            ended.set()
            assert asked.wait(60)  # The other side is faster than this one.

    def lines():
        request = {"request": "render", "id": "a", "scene": "nowhere.toml", "output": "x.exr"}
        yield json.dumps(HELLO)
        yield json.dumps(request)
        assert ended.wait(60)
        yield json.dumps(request)
        asked.set()
        while sum(event["event"] == "failure" for event in told) < 2:
            time.sleep(0.01)

    Worker(answer).serve(lines())
    failures = [event["message"] for event in told if event["event"] == "failure"]
    assert len(failures) == 2
    assert all("nowhere.toml: no such file" in message for message in failures)


@pytest.mark.parametrize(
    ("greeting", "message"),
    [
        ({"request": "hello", "schema": SCHEMA + 1}, f"uses version {SCHEMA + 1} of the protocol"),
        ({"request": "render"}, "the first request must be"),
    ],
)
def test_another_version_is_reported_before_anything_is_rendered(client, greeting, message):
    assert client.event()["schema"] == SCHEMA
    client.ask(**greeting)
    failure = client.event()
    assert failure["event"] == "failure"
    assert message in failure["message"]
    status, errors = client.end()
    assert status == 2
    assert "Traceback" not in errors
