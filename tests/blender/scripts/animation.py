"""An animation of several frames by the renderer that stays: killed and another version in between."""

import json
import os
import signal
import sys
from pathlib import Path

import bpy
from session import MODULE, add_camera, answer, as_exr, begin, module, refused, room, write_program

folder, kind, frames = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
scene = begin()
room(folder)
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4, location=(0.0, 1.6, 0.4))
ball = bpy.context.object
ball.keyframe_insert("location", frame=1)
ball.location.x = 0.5
ball.keyframe_insert("location", frame=frames)
add_camera(scene, (48, 32))
scene.render.engine = "LIGHTDEPTH"
scene.lightdepth.samples, scene.lightdepth.max_bounces = 2, 3
scene.frame_start, scene.frame_end = 1, frames
as_exr(scene, folder / kind, multilayer=True)
worker = module("worker")
pids, files = [], []


def note(*_):
    """Which process rendered the frame, and from which files."""
    pids.append(worker._kept.hello["pid"])
    meshes = module("meshfolder").of_session().path
    files.append({path.name: path.stat().st_ino for path in meshes.iterdir()})


def finish():
    """Answer, and end without the sound thread of bpy 4.5, which hangs now and then when Python ends."""
    answer(**found)
    os._exit(0)


bpy.app.handlers.render_post.append(note)
if kind == "apart":
    bpy.app.handlers.render_post.append(lambda *_: module("process").end_all())
bpy.ops.render.render(animation=True)
found = {"pids": list(pids), "files": list(files), "frames": sorted(path.name for path in folder.glob(f"{kind}0*.exr"))}
if kind == "apart":
    finish()

# Killed between two pictures.
os.kill(pids[-1], signal.SIGKILL)
scene.frame_set(2)
as_exr(scene, folder / "after kill", multilayer=True)
bpy.ops.render.render(write_still=True)
found["after kill"] = pids[-1]

# Another version.
hello = json.dumps({"event": "hello", "version": "9.8.7", "schema": worker.SCHEMA})
preferences = bpy.context.preferences.addons[MODULE].preferences
preferences.command = write_program(folder / "other", f"echo '{hello}'; sleep 600")
found["other version"] = refused(bpy.ops.render.render)

# Switched off, nothing is left.
preferences.command = os.environ["LIGHTDEPTH_RENDERER"]
bpy.ops.render.render()
left, scenes = pids[-1], module("meshfolder").of_session().path.parent
assert scenes.is_dir()
bpy.ops.preferences.addon_disable(module=MODULE)
found["left"] = Path(f"/proc/{left}").exists() or scenes.exists()
finish()
