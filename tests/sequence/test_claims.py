"""Claims: one holder at a time, free again when the holder is gone."""

import json
import os
import subprocess
import sys
import time

import pytest

from lightdepth.errors import InputError
from lightdepth.sequence.claims import claim_beside, take

HOLD = """
import sys, time
from pathlib import Path
from lightdepth.sequence.claims import take
claim = take(Path(sys.argv[1]))
with claim:
    print("held", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def path(tmp_path):
    return claim_beside(tmp_path / "shot.0001.exr")


@pytest.fixture
def other(path):
    """Another process that holds the claim."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def test_a_claim_excludes_others_until_it_is_given_back(path):
    with take(path):
        assert take(path) is None
        facts = json.loads(path.read_text())
        assert facts["pid"] == os.getpid()
        assert {"host", "time", "expiry"} <= facts.keys()
    assert list(path.parent.iterdir()) == []
    with take(path):
        pass


def test_a_living_process_keeps_its_claim(path, other):
    assert take(path) is None
    other.communicate("")
    with take(path):
        pass


def test_a_killed_process_loses_its_claim_at_once(path, other):
    other.kill()
    other.wait()
    assert path.exists()
    with take(path):
        assert json.loads(path.read_text())["pid"] == os.getpid()
    assert list(path.parent.iterdir()) == []


def test_a_claim_of_another_machine_is_free_when_nobody_touches_it(path, other):
    facts = json.loads(path.read_text())
    path.write_text(json.dumps(facts | {"machine": "elsewhere", "expiry": 1e6}))
    assert take(path) is None
    for age, free in ((0.9e6, False), (1.1e6, True)):
        os.utime(path, (time.time() - age, time.time() - age))
        claim = take(path)
        assert (claim is not None) == free
    with claim:
        pass


def test_a_claim_is_touched_while_it_is_held(path):
    with take(path, expiry=0.3):
        os.utime(path, (0, 0))
        until = time.monotonic() + 30.0
        while path.stat().st_mtime == 0 and time.monotonic() < until:
            time.sleep(0.01)
        assert path.stat().st_mtime > 0


def test_who_lost_a_claim_leaves_that_of_another_alone(path, other):
    facts = path.read_text()
    path.unlink()
    with take(path):
        path.write_text(facts)
    assert path.read_text() == facts


def test_a_half_written_claim_counts_until_it_expires(path):
    path.write_text('{"host": "a')
    assert take(path) is None
    os.utime(path, (0, 0))
    with take(path):
        pass


def test_where_nothing_can_be_written_it_is_said(tmp_path):
    with pytest.raises(InputError, match="cannot be written"):
        take(tmp_path / "missing" / "x.claim")
