"""What instances cost: memory and processor seconds to make them ready and to render them, as instances and expanded.

``python -m bench.instances [COUNT...]``: that many bushes of 5,120 triangles on the floor of the demo's room, in place of
its objects; each in a process of its own. Expanded ones of more than ``MOST`` triangles are left out.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[1]
COUNTS = (1_000, 10_000, 100_000)
MOST = 30_000_000
WIDTH, HEIGHT, SAMPLES = 320, 200, 8
ONE = "import json, sys; from bench.instances import measured; print(json.dumps(measured(sys.argv[1])))"
DETAIL = 4
"""Times that an icosahedron is divided."""


def write_scene(folder: Path, count: int, expanded: int) -> Path:
    """The demo's room with bushes instead of its objects."""
    import trimesh

    rng = np.random.default_rng(1)
    bush = trimesh.creation.icosphere(subdivisions=DETAIL, radius=1.0)
    bush.vertices *= 1.0 + 0.3 * rng.standard_normal((len(bush.vertices), 1))
    bush.vertices[:, 2] += 1.0
    bush.export(folder / "bush.ply")
    matrices = np.tile(np.eye(4), (count, 1, 1))
    angle, size = rng.uniform(0.0, 2.0 * np.pi, count), 0.3 / np.sqrt(count) * rng.uniform(0.7, 1.4, count)
    matrices[:, 0, 0], matrices[:, 0, 1] = size * np.cos(angle), -size * np.sin(angle)
    matrices[:, 1, 0], matrices[:, 1, 1], matrices[:, 2, 2] = size * np.sin(angle), size * np.cos(angle), size
    matrices[:, :2, 3] = rng.uniform((-0.5, 0.6), (0.4, 1.4), (count, 2))
    np.save(folder / "places.npy", matrices.astype(np.float32))
    lounge = ROOT / "examples/lounge"
    text = (lounge / "scene.toml").read_text()
    head, *tables = text.split("\n[")
    kept = "\n[".join([head, *(table for table in tables if not table.startswith("[synthetic"))])
    kept = kept.replace('mesh = "room/', f'mesh = "{lounge}/room/').replace('image = "', f'image = "{lounge}/')
    bushes = (
        '\n[[synthetic]]\nname = "bushes"\nmesh = "bush.ply"\ninstances = "places.npy"\n'
        'material = { type = "principled", base_color = [0.1, 0.3, 0.05], roughness = 0.6 }\n'
        f"\n[render.parameters]\ntransport.expanded_triangles = {expanded}\n"
    )
    path = folder / "scene.toml"
    path.write_text(kept + bushes)
    return path


def measured(path: str) -> dict[str, float]:
    """Figures of one scene, in this process."""
    from dataclasses import replace

    import lightdepth
    from bench.memory import forget_peak, peak_memory
    from lightdepth.kernel.start import start

    start("cpu")
    from lightdepth.preparation.objects import prepare_objects

    scene = lightdepth.load_scene(path)
    view = scene.cameras["view"]
    view = replace(view, camera=view.camera.model_copy(update={"width": WIDTH, "height": HEIGHT}))
    scene = replace(scene, cameras={"view": view})
    lightdepth.render(replace(scene, synthetic=()), "view", samples=1, draft=True)  # the place
    forget_peak()
    before, began = peak_memory(), time.process_time()
    objects = prepare_objects(scene)
    ready, began = time.process_time() - began, time.process_time()
    held = peak_memory() - before
    frame = lightdepth.render(scene, "view", samples=SAMPLES)
    first, began = time.process_time() - began, time.process_time()
    again = lightdepth.render(scene, "view", samples=SAMPLES, seed=1)
    second = time.process_time() - began
    assert objects.shapes.numbered
    assert again.beauty.shape == frame.beauty.shape
    return {"ready": ready, "memory": held, "peak": peak_memory() - before, "first": first, "again": second}


def main() -> None:
    """Print the table."""
    counts = [int(count) for count in sys.argv[1:]] or list(COUNTS)
    triangles = 20 * 4**DETAIL
    print("| bushes | triangles | kept as | ready | memory | rendering | again | memory |")
    print("|---|---|---|---|---|---|---|---|")
    for count in counts:
        for kind, limit in (("one mesh", 2_000_000_000), ("instances", 1)):
            if limit > 1 and count * triangles > MOST:
                continue
            with tempfile.TemporaryDirectory() as folder:
                done = subprocess.run(
                    [sys.executable, "-c", ONE, write_scene(Path(folder), count, limit)],
                    capture_output=True,
                    text=True,
                    check=False,
                    cwd=ROOT,
                )
                assert done.returncode == 0, done.stderr
                found = json.loads(done.stdout.splitlines()[-1])
            held, peak = (f"{found[name] / 2**20:.0f} MiB" for name in ("memory", "peak"))
            costs = f"{found['ready']:.2f} s | {held} | {found['first']:.1f} s | {found['again']:.1f} s | {peak}"
            print(f"| {count:,} | {count * triangles:,} | {kind} | {costs} |", flush=True)


if __name__ == "__main__":
    main()
