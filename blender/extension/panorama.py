"""The panorama around the viewport: on the world while nothing is modelled, projected onto what is modelled.

A point ``p`` of the world shows the panorama's direction ``R^T (p - c)``, with ``c`` and ``R`` the capture point's
position and rotation; a deformed surface shows that of its rest position. Node graphs compute it, and drivers keep
them at the capture point when it is moved.
"""

import math
from pathlib import Path
from typing import ClassVar

import bpy
from bpy_extras.io_utils import ImportHelper

from .meshfolder import MeshFolder

REST = "rest"
"""Name of the vertex attribute with environment texture coordinates: positions in the world, metres."""
CAPTURE_NAME = "Capture point"
WORLD_NAME = "lightdepth panorama"
SURFACE_NAMES = {False: "lightdepth projection", True: "lightdepth projection at rest"}
"""Materials that show the panorama on a surface, by whether it has rest positions."""
SURFACE_FIELDS = {False: "projection", True: "projection_at_rest"}
"""Settings of a scene that keep them: each scene has its own."""
PROJECTION = "lightdepth projection"
"""Custom property that marks such a material."""
EYE_HEIGHT = 1.6


def file_of(image: bpy.types.Image, folder: MeshFolder) -> Path:
    """A photograph's file; one that is packed into the .blend is written into a folder first.

    Raises:
        FileNotFoundError: the file is gone.
        OSError: the packed file cannot be written.
    """
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    if image.packed_file is not None:
        path = folder.path / folder.write(path.stem or "panorama", path.suffix or ".exr", image.packed_file.data)
    elif not path.is_file():
        raise FileNotFoundError(f"The file of image '{image.name}' is gone: {path}")
    return path


def has_capture_point(scene: bpy.types.Scene) -> bool:
    """Whether the capture point is chosen and was not deleted from the scene since."""
    capture = scene.lightdepth.capture
    return capture is not None and capture.name in scene.objects


def shown(settings) -> tuple[bpy.types.Image, bpy.types.Object]:
    """The panorama that the viewport shows and its capture point: the first one, or a further one that is chosen."""
    if 0 < settings.shown <= len(settings.further):
        entry = settings.further[settings.shown - 1]
        if entry.image is not None and entry.capture is not None:
            return entry.image, entry.capture
    return settings.image, settings.capture


def rebuild(scene: bpy.types.Scene) -> None:
    """Make the world and the projecting materials show the scene's panorama from its capture point.

    The world that the scene had is kept, and comes back when there is no panorama any more.
    """
    settings = scene.lightdepth
    if settings.image is None or settings.capture is None:
        if settings.world is not None and scene.world == settings.world:
            scene.world = settings.world_before
        return
    if settings.world is None:
        settings.world = bpy.data.worlds.new(WORLD_NAME)
    if scene.world != settings.world and settings.shown_image != settings.image:
        settings.world_before = scene.world
        scene.world = settings.world  # once for each panorama: who chooses another world afterwards has it
    settings.shown_image = settings.image
    _build(settings.world, "ShaderNodeOutputWorld", "ShaderNodeBackground", settings, at_infinity=True)
    for has_rest, name in SURFACE_NAMES.items():
        field = SURFACE_FIELDS[has_rest]
        if getattr(settings, field) is None:
            setattr(settings, field, bpy.data.materials.new(name))
        material = getattr(settings, field)
        material[PROJECTION] = True
        _build(material, "ShaderNodeOutputMaterial", "ShaderNodeEmission", settings, has_rest=has_rest)
    for item in scene.objects:
        if item.type == "MESH" and item.lightdepth.role != "SYNTHETIC":
            project_onto(item, scene)


def _build(owner, output_type, shader_type, settings, at_infinity=False, has_rest=False) -> None:
    """Make the node graph of a world or a material again."""
    if hasattr(owner, "use_nodes"):  # deprecated since Blender 5.0, which always has nodes
        owner.use_nodes = True
    nodes, links = owner.node_tree.nodes, owner.node_tree.links
    owner.node_tree.animation_data_clear()
    nodes.clear()
    output, shader = nodes.new(output_type), nodes.new(shader_type)
    picture, to_blender, to_light = (
        nodes.new("ShaderNodeTexEnvironment"),
        nodes.new("ShaderNodeMapping"),
        nodes.new("ShaderNodeMapping"),
    )
    picture.image, capture = shown(settings)
    shader.inputs["Strength"].default_value = settings.scale
    # Light space looks along +y at the panorama's centre, Blender's environment texture along +x.
    to_blender.label, to_blender.inputs["Rotation"].default_value = "Light space to texture", (0.0, 0.0, -math.pi / 2)
    to_light.label, to_light.vector_type = "World to light space", "TEXTURE"  # 'TEXTURE' is the inverse transform
    _follow(to_light.inputs["Rotation"], capture, "ROT")
    if at_infinity:
        source = nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    else:
        _follow(to_light.inputs["Location"], capture, "LOC")
        if has_rest:
            attribute = nodes.new("ShaderNodeAttribute")
            attribute.attribute_name = REST
            source = attribute.outputs["Vector"]
        else:
            source = nodes.new("ShaderNodeNewGeometry").outputs["Position"]
    links.new(source, to_light.inputs["Vector"])
    links.new(to_light.outputs["Vector"], to_blender.inputs["Vector"])
    links.new(to_blender.outputs["Vector"], picture.inputs["Vector"])
    links.new(picture.outputs["Color"], shader.inputs["Color"])
    links.new(shader.outputs[0], output.inputs["Surface"])
    for place, node in enumerate((source.node, to_light, to_blender, picture, shader, output)):
        node.location = (240.0 * place, 0.0)


def _follow(socket, target, channel) -> None:
    """Drive a vector socket by a channel of an object's transform in the world."""
    for index, axis in enumerate("XYZ"):
        driver = socket.driver_add("default_value", index).driver
        driver.type = "SUM"  # of one variable: works where scripts may not run
        variable = driver.variables.new()
        variable.type = "TRANSFORMS"
        variable.targets[0].id = target
        variable.targets[0].transform_type = f"{channel}_{axis}"
        variable.targets[0].transform_space = "WORLD_SPACE"
        variable.targets[0].rotation_mode = "XYZ"


def is_projection(material: bpy.types.Material | None) -> bool:
    """Whether a material is one that shows a panorama."""
    return material is not None and PROJECTION in material


def project_onto(item: bpy.types.Object, scene: bpy.types.Scene | None = None) -> None:
    """Let a mesh show the panorama, once there is one; its own materials are kept for later.

    Args:
        item: the mesh object.
        scene: whose panorama; by default that of the first scene that has the object.
    """
    scene = scene or next((each for each in bpy.data.scenes if item.name in each.objects), None)
    material = None if scene is None else getattr(scene.lightdepth, SURFACE_FIELDS[REST in item.data.attributes])
    if material is None:
        return
    if not item.material_slots:
        item.data.materials.append(None)
    kept = item.lightdepth.own_slots
    if not any(is_projection(slot.material) for slot in item.material_slots):
        kept.clear()
        for slot in item.material_slots:
            own = kept.add()
            own.by_object, own.material = slot.link == "OBJECT", slot.material if slot.link == "OBJECT" else None
    for slot in item.material_slots:
        slot.link = "OBJECT"
        slot.material = material


def stop_projecting_onto(item: bpy.types.Object) -> None:
    """Take the panorama off a mesh; its own materials show again."""
    kept = item.lightdepth.own_slots
    for index, slot in enumerate(item.material_slots):
        if slot.link == "OBJECT" and is_projection(slot.material):
            own = kept[index] if index < len(kept) else None
            slot.material = own.material if own is not None and own.by_object else None
            slot.link = "OBJECT" if own is not None and own.by_object else "DATA"
    kept.clear()


def show_in(space: bpy.types.SpaceView3D) -> None:
    """Switch a viewport to the shading that shows the panorama."""
    space.shading.type = "MATERIAL"
    space.shading.use_scene_world = True
    space.shading.use_scene_lights = True


class LoadPanorama(bpy.types.Operator, ImportHelper):
    """Load an equirectangular HDR panorama and stand in it"""

    bl_idname = "lightdepth.load_panorama"
    bl_label = "Load Panorama"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    filter_glob: bpy.props.StringProperty(default="*.exr;*.hdr", options={"HIDDEN"})

    def execute(self, context):
        """Load the file, add the capture point where there is none, and show the picture in all viewports."""
        try:
            image = bpy.data.images.load(self.filepath, check_existing=True)
        except RuntimeError as error:
            self.report({"ERROR"}, str(error).strip())
            return {"CANCELLED"}
        width, height = image.size
        if width != 2 * height or width == 0:
            self.report(
                {"ERROR"},
                f"{Path(self.filepath).name} has {width} x {height} pixels; a panorama is twice as wide as high",
            )
            if image.users == 0:
                bpy.data.images.remove(image)
            return {"CANCELLED"}
        settings = context.scene.lightdepth
        if not has_capture_point(context.scene):
            settings.capture = new_capture_point(context)
        settings.image = image
        context.view_layer.update()  # so that what follows in a script finds the capture point where it is
        for window in context.window_manager.windows:
            for area in window.screen.areas:
                if area.type == "VIEW_3D":
                    show_in(area.spaces.active)
        return {"FINISHED"}


def new_capture_point(context, name: str = CAPTURE_NAME) -> bpy.types.Object:
    """Add a capture point to the scene, at the height of a person's eyes over the origin."""
    capture = bpy.data.objects.new(name, None)
    capture.empty_display_type = "ARROWS"
    capture.empty_display_size = 0.3
    capture.location = (0.0, 0.0, EYE_HEIGHT)
    context.scene.collection.objects.link(capture)
    return capture


class ViewFromCapture(bpy.types.Operator):
    """Look around from the capture point, where the photograph and the model must coincide"""

    bl_idname = "lightdepth.view_from_capture"
    bl_label = "View from Capture Point"

    @classmethod
    def poll(cls, context):
        """There is a capture point, and the operator is used in a 3D viewport."""
        return (
            context.scene.lightdepth.capture is not None
            and context.space_data is not None
            and context.space_data.type == "VIEW_3D"
        )

    def execute(self, context):
        """Move the viewport's eye to the capture point and keep where it looks."""
        from mathutils import Vector

        view = context.space_data.region_3d
        view.view_perspective = "PERSP"
        view.view_distance = 0.05  # the viewport turns about a point this far before the eye
        eye = shown(context.scene.lightdepth)[1].matrix_world.translation
        view.view_location = eye + view.view_rotation @ Vector((0.0, 0.0, -view.view_distance))
        context.space_data.clip_start = 0.01
        return {"FINISHED"}


classes = (LoadPanorama, ViewFromCapture)
