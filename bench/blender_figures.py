"""What Blender's extension costs: exporting instances beside Cycles' synchronisation, and the frames of an animation.

Runs in the Python of a Blender that has the extension, not in lightdepth's own:

    PYTHONPATH=tests/blender/scripts LIGHTDEPTH_RENDERER=... .venv-bpy53/bin/python bench/blender_figures.py FOLDER

All figures are seconds of CPU time: of Blender's process where scenes are exported or synchronised, and of Blender's and
the renderer's together for frames.
"""

import os
import sys
import time
from pathlib import Path

import bpy
from session import add_camera, as_exr, begin, cycles, module, room

COUNTS = (1_000, 10_000, 20_000, 100_000)
OBJECTS = (1_000, 10_000)
FRAMES = 6
TICKS = os.sysconf("SC_CLK_TCK")
folder = Path(sys.argv[1])


def emptied():
    """A new file with the room; returns its scene."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = begin()
    room(folder)
    return scene


def blade():
    """A grass blade of six triangles."""
    mesh = bpy.data.meshes.new("blade")
    mesh.from_pydata(
        [(-0.01, 0, 0), (0.01, 0, 0), (-0.008, 0, 0.05), (0.008, 0, 0.05), (-0.004, 0.01, 0.1), (0.004, 0.01, 0.1)],
        [],
        [(0, 1, 3, 2), (2, 3, 5, 4)],
    )
    item = bpy.data.objects.new("blade", mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


def places(count):
    """As many places on the floor."""
    side = int(count**0.5) + 1
    return [(-1.8 + 3.6 * (i % side) / side, -1.8 + 4.6 * (i // side) / side, 0.0) for i in range(count)]


def instanced(count):
    """Blades at the vertices of one mesh."""
    mesh = bpy.data.meshes.new("field")
    mesh.from_pydata(places(count), [], [])
    holder = bpy.data.objects.new("field", mesh)
    bpy.context.scene.collection.objects.link(holder)
    blade().parent, holder.instance_type = holder, "VERTS"


def duplicated(count):
    """Blades as objects that share a mesh."""
    first = blade()
    for place in places(count)[1:]:
        item = first.copy()
        item.location = place
        bpy.context.scene.collection.objects.link(item)


def exported(scene):
    """Seconds of the export alone."""
    took = []

    def export(depsgraph, _):
        began = time.process_time()
        module("export").export_scene(depsgraph, folder / "scene.toml")
        took.append(time.process_time() - began)

    module("evaluation").with_render_depsgraph(bpy.context, export)
    return took[0]


def synchronised(scene):
    """Seconds from Cycles' beginning to the end of what it calls synchronising."""
    cycles(scene)
    scene.render.resolution_x = scene.render.resolution_y = 4
    began, ended = [], []

    def look(info):
        now = time.process_time()
        if "Synchronizing" in info:
            began.append(now)
            ended.clear()
        elif began and not ended:
            ended.append(now)

    bpy.app.handlers.render_stats.append(look)
    as_exr(scene, folder / "cycles.exr")
    bpy.ops.render.render()
    bpy.app.handlers.render_stats.remove(look)
    return ended[0] - began[0] if began and ended else float("nan")


def instances():
    """Print the table of instances."""
    print("| | count | export | Cycles |")
    for kind, make, counts in (("instances of one object", instanced, COUNTS), ("objects", duplicated, OBJECTS)):
        for count in counts:
            scene = emptied()
            add_camera(scene)
            make(count)
            bpy.context.view_layer.update()
            ours = exported(scene)
            print(f"| {kind} | {count:,} | {ours:.2f} | {synchronised(scene):.2f} |", flush=True)


def consumed(pid):
    """CPU seconds of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def frames(apart):
    """CPU seconds of each frame, with the process kept, or with one for each frame."""
    scene = emptied()
    bpy.ops.mesh.primitive_monkey_add(size=0.6, location=(-0.4, 1.6, 0.4))
    monkey = bpy.context.object
    for frame, x in ((1, -0.4), (FRAMES, 0.4)):
        monkey.location.x = x
        monkey.keyframe_insert("location", frame=frame)
    add_camera(scene, (320, 180))
    scene.render.engine, scene.lightdepth.samples = "LIGHTDEPTH", 16
    scene.frame_start, scene.frame_end = 1, FRAMES
    as_exr(scene, folder / "frame")
    worker, took = module("worker"), []
    state = {"blender": time.process_time(), "renderer": 0.0}

    def note(*_):
        now, renderer = time.process_time(), consumed(worker._kept.hello["pid"])
        took.append(now - state["blender"] + renderer - state["renderer"])
        state["blender"], state["renderer"] = now, renderer
        if apart:
            module("process").end_all()
            state["renderer"] = 0.0

    bpy.app.handlers.render_post.append(note)
    bpy.ops.render.render(animation=True)
    bpy.app.handlers.render_post.remove(note)
    return took


for apart in (True, False):
    kind = "a process for each frame" if apart else "one process"
    print(f"| {kind} | {' | '.join(f'{seconds:.1f}' for seconds in frames(apart))} |", flush=True)
instances()
os._exit(0)
