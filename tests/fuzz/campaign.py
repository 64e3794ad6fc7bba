"""Runs mutants in processes, and goes on where one ended."""

import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Result:
    """What came of a campaign.

    Attributes:
        read: mutants that were read, with or without notes.
        refused: mutants that were refused in words.
        findings: all else; each has the seed, the number, what happened, and a message.
    """

    read: int
    refused: int
    findings: list


def run(folder, mutants, first=0, names=None):
    """Read mutants.

    Args:
        folder: for the files.
        mutants: how many.
        first: number of the first.
        names: of the seeds, all by default.
    """
    folder = Path(folder)
    read = refused = 0
    number, last = first, first + mutants
    while number < last:
        for name in ("at", "tally"):
            (folder / name).unlink(missing_ok=True)
        command = [sys.executable, "-m", "tests.fuzz.worker", str(folder), json.dumps(names), str(number), str(last)]
        ended = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False)
        if (folder / "tally").is_file():
            tally = json.loads((folder / "tally").read_text())
            read, refused = read + tally["read"], refused + tally["refused"]
            break
        if not (folder / "at").is_file():
            raise RuntimeError(f"the worker did not begin: {ended.stderr[-2000:]}")
        at = json.loads((folder / "at").read_text())
        read, refused = read + at.pop("read"), refused + at.pop("refused")
        what = "hang" if ended.returncode == -27 else f"ended with {ended.returncode}"  # 27 is SIGPROF
        with (folder / "findings.jsonl").open("a") as findings:
            findings.write(json.dumps({**at, "what": what, "message": ended.stderr[-300:]}) + "\n")
        number = at["number"] + 1
    found = folder / "findings.jsonl"
    lines = found.read_text().splitlines() if found.is_file() else []
    return Result(read, refused, [json.loads(line) for line in lines])
