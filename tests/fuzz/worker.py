"""Reads mutants in a process of its own, which a hang or a crash may end."""

import json
import os
import random
import resource
import signal
import sys
import warnings
from pathlib import Path

from lightdepth.errors import InputWarning, LightdepthError
from tests.fuzz.mutation import mutant
from tests.fuzz.readers import READERS, raw_words
from tests.fuzz.seeds import seeds

SECONDS = 5.0
"""Of processor time for one mutant."""
MEMORY = 1 << 30
"""Bytes for one mutant."""


def main(folder, names, first, last):
    """Read mutants number `first` to `last` (exclusive) of some seeds; findings go to `findings.jsonl` in the folder.

    Mutants of each number are shared out among the seeds: number n is of seed n modulo their count.
    """
    folder = Path(folder)
    sound = list(seeds())
    chosen = [seed for seed in sound if names is None or seed.name in names]
    for seed in chosen:  # All modules are loaded before memory is counted.
        _prepare(folder, seed)
        what, message = _read(folder, seed, seed.content)
        if what is not None:
            raise RuntimeError(f"{seed.name} is not sound: {message}")
    printed = os.open(folder / "printed", os.O_CREAT | os.O_RDWR | os.O_TRUNC)
    real = os.dup(2)
    os.dup2(printed, 1)
    os.dup2(printed, 2)
    with Path("/proc/self/statm").open() as file:
        size = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + 2 * MEMORY, resource.RLIM_INFINITY))
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    tally = {"read": 0, "refused": 0}
    with (folder / "findings.jsonl").open("a") as findings:
        for number in range(first, last):
            seed = chosen[number % len(chosen)]
            content = content_of(seed, number, sound)
            _prepare(folder, seed)
            (folder / "at").write_text(json.dumps({"number": number, "seed": seed.name, **tally}))
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            what, message = _read(folder, seed, content)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            sys.stdout.flush()
            if os.lseek(printed, 0, os.SEEK_CUR) or os.fstat(printed).st_size:
                text = (folder / "printed").read_text(errors="replace")[:300]
                what, message = what or "printed", message or text
                os.ftruncate(printed, 0)
                os.lseek(printed, 0, os.SEEK_SET)
            peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
            if peak - most > MEMORY:
                what, message = "memory", f"{(peak - most) / 2**20:.0f} MiB"
            most = max(most, peak)
            tally["refused" if what == "refused" else "read"] += 1
            if what not in (None, "refused"):
                findings.write(
                    json.dumps({"number": number, "seed": seed.name, "what": what, "message": message}) + "\n"
                )
                findings.flush()
    (folder / "tally").write_text(json.dumps(tally))
    os.dup2(real, 2)


def content_of(seed, number, sound):
    """The bytes of a mutant; pieces may come from any of the sound files of its kind."""
    others = [other.content for other in sound if other.kind == seed.kind]
    return mutant(seed.content, others, random.Random(f"{seed.name} {number}"))


def _prepare(folder, seed):
    """The files beside a mutant."""
    place = folder / "files"
    if place.is_dir():
        for old in place.iterdir():
            old.unlink()
    place.mkdir(exist_ok=True)
    for name, content in seed.beside.items():
        (place / name).write_bytes(content)


def _read(folder, seed, content):
    """What happens: nothing, or one of `refused`, `exception`, `memory`, `raw`, with a message."""
    path = folder / "files" / seed.file
    path.write_bytes(content)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("error")  # Others would be printed past us.
            warnings.simplefilter("always", InputWarning)
            READERS[seed.kind](path)
    except LightdepthError as error:
        raw = raw_words(str(error), content)
        return ("raw", f"{raw}: {str(error)[:400]}") if raw else ("refused", str(error)[:400])
    except MemoryError as error:
        return "memory", str(error)[:200]
    except BaseException as error:
        return "exception", f"{type(error).__name__}: {str(error)[:300]}"
    for message in (str(warning.message) for warning in caught):
        if raw := raw_words(message, content):
            return "raw", f"{raw}: {message[:400]}"
    return None, ""


if __name__ == "__main__":
    main(sys.argv[1], json.loads(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))
