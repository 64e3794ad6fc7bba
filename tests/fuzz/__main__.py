"""`make fuzz`: ten thousand damaged files."""

import argparse
import tempfile
from collections import Counter
from pathlib import Path

from tests.fuzz.campaign import run
from tests.fuzz.seeds import seeds
from tests.fuzz.worker import content_of

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--mutants", type=int, default=10_000, help="how many (%(default)s)")
parser.add_argument("--first", type=int, default=0, help="number of the first")
parser.add_argument("--kind", action="append", help="what reads them, as mesh or image; may be given again")
parser.add_argument("--only", action="append", help="name of a seed; may be given again")
parser.add_argument("--keep", type=Path, help="write the mutants that were found into this folder")
arguments = parser.parse_args()
chosen = [
    seed
    for seed in seeds()
    if (arguments.only is None or seed.name in arguments.only)
    and (arguments.kind is None or seed.kind in arguments.kind)
]
with tempfile.TemporaryDirectory() as folder:
    result = run(folder, arguments.mutants, arguments.first, [seed.name for seed in chosen])
for finding in result.findings:
    print(f"{finding['seed']} {finding['number']}: {finding['what']}: {finding['message']}")
if arguments.keep is not None:
    arguments.keep.mkdir(parents=True, exist_ok=True)
    for finding in result.findings:
        seed = next(seed for seed in chosen if seed.name == finding["seed"])
        name = f"{finding['number']}-{seed.file}"
        (arguments.keep / name).write_bytes(content_of(seed, finding["number"], seeds()))
counts = dict(Counter(finding["what"] for finding in result.findings))
print(f"{arguments.mutants} mutants of {len(chosen)} seeds, {result.read} read, {result.refused} refused in words")
print(f"findings: {counts or 'none'}")
raise SystemExit(1 if result.findings else 0)
