"""An 8192 x 4096 panorama in and out: memory and time of the whole command. Slow: about three minutes."""

import json
import subprocess
import sys

import pytest

from tests.film.large_place import write_large_place

MOST_MEBIBYTES = 4096
RUN = """
import resource, sys, time
from lightdepth.cli.app import main
begun = time.monotonic()
sys.argv = ["lightdepth", *sys.argv[1:]]
try:
    main()
except SystemExit as stopped:
    if stopped.code:
        raise
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print('{"event": "end", "peak": %.0f, "seconds": %.1f}' % (peak, time.monotonic() - begun))
"""


@pytest.mark.truth
@pytest.mark.parametrize("samples", [1, 4])
def test_memory_and_time(tmp_path, samples):
    """Every pixel is support and is sampled, which is the most that there can be; all layers are written."""
    scene = write_large_place(tmp_path, 8192)
    arguments = ["render", scene, "-o", tmp_path / "out.exr", "--samples", samples, "--progress", "json"]
    run = subprocess.run(
        [sys.executable, "-c", RUN, *map(str, arguments)], stdout=subprocess.PIPE, text=True, check=True
    )
    end = json.loads(run.stdout.splitlines()[-1])
    print(f"{samples} samples: peak {end['peak']:.0f} MiB, {end['seconds']:.0f} s in all")
    assert end["peak"] <= MOST_MEBIBYTES
    assert (tmp_path / "out.exr").stat().st_size > 2**28
