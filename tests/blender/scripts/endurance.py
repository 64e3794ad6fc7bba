"""Ten times undo and redo, each with a picture; a rendering cancelled, and its renderer killed, in each stage."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import bpy
from session import add_camera, answer, as_exr, begin, module, refused, room

STAGES = ("exporting", "loading", "preparing", "progress", "writing")
STEPS = 10
folder = Path(sys.argv[1])
scene = begin()
room(folder)
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4, location=(-0.5, 1.6, 0.4))
add_camera(scene, (24, 16))
scene.render.engine = "LIGHTDEPTH"
scene.lightdepth.samples, scene.lightdepth.max_bounces = 1, 2
engine, worker = module("engine"), module("worker")
export_scene, render = engine.export_scene, worker.render
stops = []


class Stop(engine._Stop):
    """Remembers who can stop the rendering."""

    def __init__(self, test):
        super().__init__(test)
        stops.append(self)


engine._Stop = Stop


def picture(name):
    """F12, written."""
    as_exr(bpy.context.scene, folder / name)
    bpy.ops.render.render(write_still=True)


def data():
    """Names of all that the file has, and the world that the scene has."""
    kinds = (bpy.data.objects, bpy.data.meshes, bpy.data.materials, bpy.data.worlds, bpy.data.images, bpy.data.scenes)
    return [sorted(each.name for each in kind) for kind in kinds] + [bpy.context.scene.world.name]


def pid():
    return worker._kept.hello["pid"]


# Undo and redo: Blender replaces all of its data each time.
for step in range(STEPS + 1):
    bpy.data.objects["Sphere"].location.x = -0.5 + 0.1 * step
    bpy.ops.ed.undo_push(message=f"step {step}")
    picture(f"step {step}")
first, before = pid(), data()
for step in reversed(range(STEPS)):
    bpy.ops.ed.undo()
    picture(f"undone {step}")
for step in range(1, STEPS + 1):
    bpy.ops.ed.redo()
    picture(f"redone {step}")
found = {"steps": STEPS, "one process": pid() == first, "data kept": data() == before}


# Cancelled as by Escape, and killed, at the begin of every stage, when the place has to be prepared.
def at(stage, act):
    """Let something be done once when a stage of the next rendering begins."""
    done = []

    def once():
        if not done:
            done.append(act())

    def exporting(*arguments, **settings):
        if stage == "exporting":
            once()
        return export_scene(*arguments, **settings)

    def rendering(*arguments):
        for event in render(*arguments):
            if stage in (event["event"], event.get("stage")):
                once()
            yield event

    engine.export_scene, engine.render = exporting, rendering
    return done


def cancel():
    stops[-1].asked = True
    return True


def kill():
    os.kill(pid(), signal.SIGKILL)
    return True


def tried(kind, act):
    """What Blender says when something happens in each stage, which files there are, and the picture after it."""
    said = {}
    capture = bpy.context.scene.lightdepth.capture
    for number, stage in enumerate(STAGES):
        capture.location.x = 0.01 * (number + 1)  # another place
        happened = at(stage, act)
        as_exr(bpy.context.scene, folder / f"{kind} while {stage}")
        told = refused(bpy.ops.render.render, write_still=act is kill)
        said[stage] = [bool(happened), told]
    engine.export_scene, engine.render = export_scene, render
    capture.location.x = 0.0
    picture(f"after being {kind}")
    return said


found["cancelled"] = tried("cancelled", cancel)
found["after cancelling"] = pid() == first
found["killed"] = tried("killed", kill)
found["data kept"] &= data() == before
found["written"] = sorted(path.name for path in folder.glob("killed while*"))
listed = subprocess.run(["ps", "-o", "stat=,args=", "--ppid", str(os.getpid())], capture_output=True, text=True)
children = [line for line in listed.stdout.splitlines() if "ps -o" not in line]
found["zombies"] = [line for line in children if line.startswith("Z")]
found["children"] = len(children)
answer(**found)
os._exit(0)  # without the sound thread of bpy 4.5, which hangs now and then when Python ends
