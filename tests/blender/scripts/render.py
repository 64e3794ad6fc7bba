"""Render two frames with Ctrl-F12, export both; then renderers that are missing, crash or talk nonsense."""

import os
import sys
from pathlib import Path

import bpy
from session import MODULE, add_camera, answer, as_exr, begin, module, refused, room, write_program

folder = Path(sys.argv[1])
scene = begin()
room(folder)
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.4, location=(0.0, 1.6, 0.4))
ball = bpy.context.object
ball.keyframe_insert("location", frame=1)
ball.location.x = 0.5
ball.keyframe_insert("location", frame=2)


def is_running(pid):
    """Whether there is such a process, and not only its exit status."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def principled(item):
    """The item's new material's Principled BSDF."""
    made = bpy.data.materials.new(item.name)
    made.use_nodes = True
    item.data.materials.append(made)
    return made.node_tree.nodes["Principled BSDF"]


colour = principled(ball).inputs["Base Color"]
bpy.ops.mesh.primitive_plane_add(size=0.4, location=(-0.6, 1.6, 0.9), rotation=(1.5708, 0.0, 0.0))
shader = principled(bpy.context.object)
shader.inputs["Sheen Weight"].default_value = 0.5  # not supported
shader.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
shader.inputs["Emission Color"].default_value = (1.0, 1.0, 1.0, 1.0)
glow = shader.inputs["Emission Strength"]
for frame, red, blue, strength in ((1, 0.8, 0.1, 2.0), (2, 0.1, 0.8, 6.0)):
    colour.default_value, glow.default_value = (red, 0.2, blue, 1.0), strength
    for socket in (colour, glow):
        socket.keyframe_insert("default_value", frame=frame)
add_camera(scene, (48, 32))
scene.render.engine = "LIGHTDEPTH"
scene.lightdepth.samples, scene.lightdepth.max_bounces = 2, 3
scene.frame_start, scene.frame_end = 1, 2
as_exr(scene, folder / "frame", multilayer=True)
bpy.ops.render.render(animation=True)
notes = [line.text for line in scene.lightdepth.export_notes]
for frame in (1, 2):
    scene.frame_set(frame)
    bpy.ops.lightdepth.export_scene(filepath=str(folder / f"scene{frame}.toml"))
found = {"frames": sorted(path.name for path in folder.glob("frame*.exr"))}
found["notes"] = notes
bpy.ops.lightdepth.check()
found["coverage"] = scene.lightdepth.coverage

preferences = bpy.context.preferences.addons[MODULE].preferences
PROGRAMS = {
    "crashing": "echo 'error: the lamp is broken' >&2; exit 2",
    "killed": "kill -KILL $$",
    "traceback": "printf 'Traceback (most recent call last):\\n  File x\\nValueError: odd number\\n' >&2; exit 1",
    "garbage": "echo 'Hello, I am a web browser'; sleep 60",
    "silent": "exit 0",
}
for name, text in PROGRAMS.items():
    preferences.command = write_program(folder / name, text)
    found[name] = refused(bpy.ops.render.render)
questions = (bpy.ops.lightdepth.test_renderer, bpy.ops.lightdepth.check, bpy.ops.lightdepth.calibrate)
for place in ((0.1, 0.7), (0.2, 0.7), (0.2, 0.8), (0.1, 0.8)):
    corner = scene.lightdepth.corners.add()
    corner.u, corner.v = place
preferences.command = write_program(folder / "stranger", "echo 'Hello, I am a calculator'")
found["stranger"] = [refused(question) for question in questions]
# It hangs with a child, and neither listens to the polite signals.
preferences.command = write_program(folder / "hanging", "trap '' INT TERM; sleep 600 & echo $! >> $0.pids; wait; wait")
patience, module("process").PATIENCE = module("process").PATIENCE, 1.0
found["hanging"] = [refused(question) for question in questions]
module("process").PATIENCE = patience
found["hanging told"] = [line.text for line in preferences.answer]
preferences.command = str(folder / "not there")
found["missing"] = refused(bpy.ops.render.render)
found["missing for the test"] = refused(bpy.ops.lightdepth.test_renderer)
preferences.command = str(folder / "garbage.txt")
(folder / "garbage.txt").write_text("no program")
found["no program"] = refused(bpy.ops.render.render)
preferences.command = os.environ["LIGHTDEPTH_RENDERER"]
bpy.ops.lightdepth.test_renderer()
found["doctor"] = [line.text for line in preferences.answer]
found["left hanging"] = [pid for pid in (folder / "hanging.pids").read_text().split() if is_running(pid)]
answer(**found)
