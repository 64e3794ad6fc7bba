"""A second panorama and a plate: loaded, solved from clicked points, exported, imported into another scene, rendered."""

import json
import sys
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np
from mathutils import Euler, Matrix
from session import add_camera, answer, begin, corners, module, refused, rendered

folder = Path(sys.argv[1])
truth = json.loads((folder / "truth.json").read_text())
scene = begin()
settings = scene.lightdepth
matching, photographs = module("matching"), module("photographs")
found = {}


def text(name):
    return str(folder / name)


def pose(item):
    bpy.context.view_layer.update()
    return [list(row) for row in item.matrix_world]


found["before a panorama"] = refused(bpy.ops.lightdepth.add_panorama, filepath=text("second.exr"))
bpy.ops.lightdepth.load_panorama(filepath=text("first.exr"))
first = truth["first"]
settings.capture.matrix_world = Matrix.LocRotScale(
    first["position"], Euler(np.radians(first["rotation"]).tolist(), "XYZ"), None
)
bpy.ops.lightdepth.add_room(corners=corners(*truth["floor"]), height=truth["height"])

# The second panorama: refused before clicks and where it is none, solved from points.
found["no panorama"] = refused(bpy.ops.lightdepth.add_panorama, filepath=text("plate.exr"))
bpy.ops.lightdepth.add_panorama(filepath=text("second.exr"))
entry = settings.further[0]
found["shown"] = [settings.shown, settings.projection.node_tree.nodes["Environment Texture"].image.name]
found["before clicks"] = refused(bpy.ops.lightdepth.relate_panorama, index=0)
finish = matching.ClickSharedPoints.finish
clicked = [point for pair in zip(truth["in first"], truth["in second"]) for point in pair]
finish(SimpleNamespace(index=0), bpy.context, clicked + [(0.5, 0.5)])  # of the last one the partner was not clicked
bpy.ops.lightdepth.relate_panorama(index=0)
found["second"] = pose(entry.capture)
found["report"] = entry.report
asking = SimpleNamespace(
    index=0, by_features=False, points=lambda *_: ["--match", "1,1 = 2,2"], scene_file=lambda *_: "scene.toml"
)
found["asked to snap"] = []
for entry.snap in (False, True):
    found["asked to snap"].append("--snap" in matching.RelatePanorama.arguments(asking, bpy.context, folder))

# A click counts on the picture that is asked for.
area = next(area for area in bpy.data.screens["Rendering"].areas if area.type == "IMAGE_EDITOR")
region = next(region for region in area.regions if region.type == "WINDOW")
event = SimpleNamespace(mouse_x=region.x + region.width // 2, mouse_y=region.y + region.height // 2)
context = SimpleNamespace(window=SimpleNamespace(screen=bpy.data.screens["Rendering"]))
area.spaces.active.image = entry.image
asks = matching.ClickSharedPoints
found["clicks"] = []
for count in (0, 1):
    tool = SimpleNamespace(index=0, _scene=scene, _points=[None] * count)
    tool.asked = lambda number, tool=tool: asks.asked(tool, number)
    found["clicks"].append(asks.point_at(tool, context, event))

# The plate: points that the first panorama shows too, and edges.
camera = add_camera(scene)
bpy.ops.lightdepth.load_plate(filepath=text("plate.exr"))
plate = camera.data.lightdepth.plate
found["resolution"] = [scene.render.resolution_x, scene.render.resolution_y]
found["nothing clicked"] = refused(bpy.ops.lightdepth.solve_plate)
clicked = [point for pair in zip(truth["in first"], truth["in plate"]) for point in pair]
finish(SimpleNamespace(index=matching.PLATE), bpy.context, clicked)
for axis, start, end in truth["edges"]:
    matching.ClickAxisLine.finish(SimpleNamespace(axis=axis), bpy.context, (start, end))
plate.solve_distortion = True
bpy.ops.lightdepth.solve_plate()
found["camera"] = pose(camera)
found["plate report"] = plate.report

# Every property and operator that the panels name is there: a background has no panels that draw.


class Layout:
    """Takes what a panel draws."""

    def __init__(self):
        self.named = set()

    def __getattr__(self, name):
        return self.prop if name == "template_ID" else lambda *_, **__: self

    def prop(self, owner, name, **_):
        self.named.add(owner.bl_rna.properties[name].identifier)

    def operator(self, name, **_):
        group, operator = name.split(".")
        rna = getattr(getattr(bpy.ops, group), operator).get_rna_type()
        self.named.add(name)
        return _Properties(rna)


class _Properties:
    def __init__(self, rna):
        self.__dict__["_rna"] = rna

    def __setattr__(self, name, value):
        assert name in self._rna.properties, (self._rna.identifier, name)


drawn = SimpleNamespace(
    scene=scene,
    space_data=SimpleNamespace(type="IMAGE_EDITOR"),
    region=SimpleNamespace(width=300),
    preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
)
layout = Layout()
module("photographpanels").draw_panoramas(layout, drawn)
module("photographpanels").draw_plate(layout, drawn)
found["drawn"] = sorted(layout.named)

# To a scene file and back, into a scene that has only the room.
bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=truth["ball"])
plate.use_gain, plate.gain = True, (0.9, 1.0, 1.1)
entry.versions.use_gain, entry.versions.gain = True, (1.0, 1.0, 1.0)
entry.versions.mask = bpy.data.images.load(text("mask.png"))
settings.versions.retouched = bpy.data.images.load(text("first.exr"))
other = add_camera(scene, found["resolution"])
photographs.show_plate(other, camera.data.background_images[0].image)
scene.camera = camera
bpy.ops.lightdepth.export_scene(filepath=text("once.toml"))
found["notes"] = [line.text for line in settings.export_notes]
for item in [camera, other, settings.capture, entry.capture]:
    bpy.data.objects.remove(item)
settings.further.clear()
settings.image = settings.versions.retouched = None
bpy.ops.lightdepth.import_photographs(filepath=text("once.toml"))
bpy.ops.lightdepth.import_photographs(filepath=text("once.toml"))
found["empties"] = sorted(item.name for item in scene.objects if item.type == "EMPTY")
bpy.ops.lightdepth.export_scene(filepath=text("twice.toml"))

# F12: the plate's own pixels where nothing changes, whole and in a region; another size is refused.
scene.render.engine = "LIGHTDEPTH"
settings.draft = True
scene.view_settings.view_transform = "Standard"
np.save(folder / "whole.npy", rendered(scene, folder / "whole.exr"))
scene.render.use_border = scene.render.use_crop_to_border = True
scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.75
scene.render.border_min_y, scene.render.border_max_y = 0.5, 1.0
np.save(folder / "part.npy", rendered(scene, folder / "part.exr"))
scene.render.resolution_x *= 2
found["another size"] = refused(bpy.ops.lightdepth.export_scene, filepath=text("never.toml"))
found["refused"] = [
    refused(bpy.ops.lightdepth.import_photographs, filepath=text(name))
    for name in ("missing.toml", "numbered.toml", "none.toml")
]
bpy.ops.lightdepth.remove_panorama(index=0)
found["left"] = sorted(item.name for item in scene.objects if item.type == "EMPTY")
answer(**found)
