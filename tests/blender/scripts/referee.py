"""Small scenes in a closed room that shines with the panorama: rendered by Cycles twice, and exported.

Usage: ``referee.py FOLDER [NAME ...]``. A scene is a function with the decorator ``scene``, of a few lines.
"""

import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector
from session import add_camera, add_lamp, answer, as_exr, begin, corners, cycles, refused, write_panorama

SCENES = {}
WIDTH, HEIGHT, SAMPLES = 48, 36, 64
MIDDLE = Vector((0.0, 1.5, 1.2))


def scene(missing=None):
    """Add a scene; ``missing`` is part of the note that must name what is not as in Cycles."""

    def add(function):
        SCENES[function.__name__] = (function, missing)
        return function

    return add


# What scenes are made of.


def ball(material=None, location=MIDDLE, radius=0.5, smooth=True, **settings):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=radius, location=location, **settings)
    item = bpy.context.object
    if smooth:
        bpy.ops.object.shade_smooth()
    if material is not None:
        item.data.materials.append(material)
    return item


def board(material=None, location=MIDDLE, size=1.0, turned=(1.2, 0.0, 0.3)):
    bpy.ops.mesh.primitive_plane_add(size=size, location=location, rotation=turned)
    if material is not None:
        bpy.context.object.data.materials.append(material)
    return bpy.context.object


def box(material=None, location=MIDDLE, size=0.7, turned=(0.4, 0.3, 0.6)):
    bpy.ops.mesh.primitive_cube_add(size=size, location=location, rotation=turned)
    if material is not None:
        bpy.context.object.data.materials.append(material)
    return bpy.context.object


def shader(kind, name="material", **inputs):
    """A material with one shader; returns the material and the node."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    made.node_tree.nodes.clear()
    node = made.node_tree.nodes.new(f"ShaderNode{kind}")
    output = made.node_tree.nodes.new("ShaderNodeOutputMaterial")
    made.node_tree.links.new(node.outputs[0], output.inputs["Surface"])
    settle(node, inputs)
    return made, node


def settle(node, inputs):
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value


def principled(**inputs):
    return shader("BsdfPrincipled", **inputs)[0]


def node(material, kind, inputs=(), **settings):
    """Another node of a material's tree."""
    made = material.node_tree.nodes.new(f"ShaderNode{kind}")
    for key, value in settings.items():
        setattr(made, key, value)
    settle(made, dict(inputs))
    return made


def link(material, source, target):
    material.node_tree.links.new(source, target)


def pattern(alpha=False, scale=1.0):
    """Red and green ramps with a blue checker, sRGB or radiance; shape (64, 64, 4)."""
    ticks = np.arange(64)
    v, u = np.meshgrid(ticks / 63, ticks / 63, indexing="ij")
    checker = ((ticks[:, None] // 16 + ticks[None, :] // 16) % 2).astype(float)
    covered = checker if alpha else np.ones_like(u)
    return np.stack([0.1 + 0.8 * u, 0.1 + 0.8 * v, 0.2 + 0.6 * checker, covered], -1) * (scale, scale, scale, 1.0)


def image(pixels, space="sRGB", is_float=False, name="pattern"):
    height, width = pixels.shape[:2]
    made = bpy.data.images.new(name, width, height, alpha=True, float_buffer=is_float)
    made.colorspace_settings.name = space
    made.pixels.foreach_set(np.ascontiguousarray(pixels[::-1], np.float32).ravel())
    made.update()
    made.pack()
    return made


def textured(kind="BsdfPrincipled", target="Base Color", picture=None, coordinates=None, mapping=None, **settings):
    """A material with an image texture; returns the material, its shader and its image node."""
    made, node_ = shader(kind)
    texture = node(made, "TexImage", **settings)
    texture.image = image(pattern()) if picture is None else picture
    link(made, texture.outputs["Color"], node_.inputs[target])
    if coordinates is not None:
        source = node(made, "TexCoord").outputs[coordinates]
        if mapping is not None:
            kind_, values = mapping
            between = node(made, "Mapping", values, vector_type=kind_)
            link(made, source, between.inputs["Vector"])
            source = between.outputs[0]
        link(made, source, texture.inputs["Vector"])
    return made, node_, texture


def grouped(material, inner):
    """Put a shader of a kind into a group inside the material's tree; returns the group's node."""
    tree = bpy.data.node_groups.new("group", "ShaderNodeTree")
    tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    tree.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
    shading = tree.nodes.new(f"ShaderNode{inner}")
    inside, outside = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    tree.links.new(inside.outputs[0], shading.inputs[0])
    tree.links.new(shading.outputs[0], outside.inputs[0])
    group = material.node_tree.nodes.new("ShaderNodeGroup")
    group.node_tree = tree
    output = next(each for each in material.node_tree.nodes if each.type == "OUTPUT_MATERIAL")
    link(material, group.outputs[0], output.inputs["Surface"])
    return group


def mixed(first, second, share):
    """A material that mixes two shaders; kinds with their inputs. Returns the material and the mix node."""
    made, one = shader(first[0], **first[1])
    two = node(made, second[0], second[1])
    mix = node(made, "MixShader")
    output = next(each for each in made.node_tree.nodes if each.type == "OUTPUT_MATERIAL")
    mix.inputs[0].default_value = share
    link(made, one.outputs[0], mix.inputs[1])
    link(made, two.outputs[0], mix.inputs[2])
    link(made, mix.outputs[0], output.inputs["Surface"])
    return made, mix


INNER = ("POINT", {"Scale": (0.9, 0.9, 0.9), "Location": (0.05, 0.05, 0.05)})
"""Off the edges of the image, where Cycles mixes the first and the last texel as codes and not as light."""
SMALLER = ("POINT", {"Scale": (2, 2, 1), "Location": (-0.5, -0.5, 0)})
RED, GREEN, WHITE, GREY = (0.8, 0.1, 0.05, 1.0), (0.1, 0.6, 0.2, 1.0), (1.0, 1.0, 1.0, 1.0), (0.5, 0.5, 0.5, 1.0)

# Shaders.


@scene()
def no_material(s):
    ball()


@scene()
def empty_slot(s):
    ball().data.materials.append(None)


@scene()
def diffuse(s):
    ball(shader("BsdfDiffuse", Color=RED)[0])


@scene()
def rough_plastic(s):
    ball(principled(Base_Color=RED, Roughness=0.6))


@scene()
def smooth_plastic(s):
    ball(principled(Base_Color=RED, Roughness=0.15))


@scene()
def strong_reflection(s):
    ball(principled(Base_Color=GREEN, Roughness=0.3, IOR=2.0))


@scene()
def specular_level(s):
    ball(principled(Base_Color=GREEN, Roughness=0.3, Specular_IOR_Level=1.0))


@scene()
def no_reflection(s):
    ball(principled(Base_Color=GREEN, Roughness=0.3, Specular_IOR_Level=0.0))


@scene()
def rough_metal(s):
    ball(principled(Base_Color=(0.9, 0.6, 0.3, 1), Metallic=1.0, Roughness=0.4))


@scene()
def mirror(s):
    ball(principled(Base_Color=(0.9, 0.9, 0.9, 1), Metallic=1.0, Roughness=0.0))


@scene()
def glossy(s):
    ball(shader("BsdfAnisotropic", Color=(0.7, 0.7, 0.8, 1), Roughness=0.3)[0])


@scene()
def clear_glass(s):
    ball(principled(Base_Color=WHITE, Transmission_Weight=1.0, Roughness=0.0, IOR=1.45))


@scene()
def coloured_glass(s):
    ball(principled(Base_Color=(0.3, 0.8, 0.5, 1), Transmission_Weight=1.0, Roughness=0.0, IOR=1.45))


@scene()
def rough_glass(s):
    ball(principled(Base_Color=WHITE, Transmission_Weight=1.0, Roughness=0.3, IOR=1.45))


@scene()
def glass_shader(s):
    ball(shader("BsdfGlass", Color=WHITE, Roughness=0.0, IOR=1.45)[0])


@scene()
def coloured_glass_shader(s):
    ball(shader("BsdfGlass", Color=(0.6, 0.9, 0.75, 1), Roughness=0.0, IOR=1.45)[0])


@scene()
def glass_box(s):
    box(shader("BsdfGlass", Color=WHITE, Roughness=0.0, IOR=1.3)[0])


@scene()
def emission(s):
    ball(shader("Emission", Color=RED, Strength=2.0)[0])


@scene()
def glowing_plastic(s):
    ball(principled(Base_Color=GREEN, Emission_Color=RED, Emission_Strength=0.5))


@scene()
def coat(s):
    ball(principled(Base_Color=RED, Roughness=0.6, Coat_Weight=1.0, Coat_Roughness=0.05))


@scene(missing="sheen")
def sheen(s):
    ball(principled(Base_Color=RED, Sheen_Weight=1.0))


@scene(missing="subsurface")
def subsurface(s):
    ball(principled(Base_Color=RED, Subsurface_Weight=1.0))


@scene()
def half_transparent(s):
    board(principled(Base_Color=RED, Alpha=0.5))


@scene()
def transparent_mix(s):
    board(mixed(("BsdfDiffuse", {"Color": RED}), ("BsdfTransparent", {}), 0.4)[0])


@scene()
def invisible(s):
    board(shader("BsdfTransparent")[0])
    ball(principled(Base_Color=RED), location=MIDDLE + Vector((0.4, 0.3, 0)), radius=0.25)


@scene()
def two_diffuse_mix(s):
    board(mixed(("BsdfDiffuse", {"Color": RED}), ("BsdfDiffuse", {"Color": GREEN}), 0.3)[0])


@scene()
def diffuse_and_emission_mix(s):
    board(mixed(("BsdfDiffuse", {"Color": RED}), ("Emission", {"Color": GREEN, "Strength": 1.5}), 0.4)[0])


@scene()
def plastic_by_fresnel(s):
    made, mix = mixed(("BsdfDiffuse", {"Color": RED}), ("BsdfAnisotropic", {"Color": WHITE, "Roughness": 0.2}), 0.5)
    link(made, node(made, "Fresnel", {"IOR": 1.5}).outputs[0], mix.inputs[0])
    ball(made)


@scene()
def added_emission(s):
    made, one = shader("BsdfDiffuse", Color=RED)
    add = node(made, "AddShader")
    output = next(each for each in made.node_tree.nodes if each.type == "OUTPUT_MATERIAL")
    link(made, one.outputs[0], add.inputs[0])
    link(made, node(made, "Emission", {"Color": GREEN, "Strength": 0.5}).outputs[0], add.inputs[1])
    link(made, add.outputs[0], output.inputs["Surface"])
    ball(made)


@scene()
def node_group(s):
    made, _ = shader("BsdfDiffuse")
    grouped(made, "BsdfPrincipled").inputs[0].default_value = GREEN
    ball(made)


@scene()
def image_into_group(s):
    made, _, texture = textured()
    group = grouped(made, "BsdfDiffuse")
    link(made, texture.outputs[0], group.inputs[0])
    board(made)


@scene(missing="volume is not supported")
def volume_only(s):
    made, one = shader("BsdfDiffuse")
    made.node_tree.nodes.remove(one)
    output = next(each for each in made.node_tree.nodes if each.type == "OUTPUT_MATERIAL")
    link(made, node(made, "VolumeAbsorption", {"Density": 1.0}).outputs[0], output.inputs["Volume"])
    ball(made)


@scene()
def no_surface(s):
    made, one = shader("BsdfDiffuse")
    made.node_tree.nodes.remove(one)
    ball(made)


@scene(missing="Bump")
def bump(s):
    made, one, texture = textured()
    made.node_tree.links.remove(one.inputs["Base Color"].links[0])
    bumped = node(made, "Bump")
    link(made, texture.outputs[0], bumped.inputs["Height"])
    link(made, bumped.outputs[0], one.inputs["Normal"])
    board(made)


@scene(missing="Noise Texture")
def noise(s):
    made, one = shader("BsdfDiffuse")
    link(made, node(made, "TexNoise").outputs[0], one.inputs["Color"])
    ball(made)


@scene()
def normal_map(s):
    slanted = np.tile(np.array([0.8, 0.6, 0.9, 1.0]), (4, 4, 1))
    made, one = shader("BsdfPrincipled", Roughness=0.4)
    texture, mapped = node(made, "TexImage"), node(made, "NormalMap")
    texture.image = image(slanted, "Non-Color")
    link(made, texture.outputs[0], mapped.inputs["Color"])
    link(made, mapped.outputs[0], one.inputs["Normal"])
    board(made)


# Textures.


@scene()
def image_by_uv(s):
    board(textured()[0])


@scene()
def hard_texels(s):
    board(textured(interpolation="Closest")[0])


@scene()
def data_as_colour(s):
    board(textured(picture=image(pattern(), "Non-Color"))[0])


@scene()
def linear_bytes(s):
    board(textured(picture=image(pattern(), "Linear Rec.709"))[0])


@scene()
def float_image(s):
    board(textured(picture=image(pattern(), "Linear Rec.709", is_float=True))[0])


@scene()
def emission_of_high_range(s):
    board(textured("Emission", "Color", image(pattern(scale=8.0), "Linear Rec.709", is_float=True))[0])


@scene()
def roughness_image(s):
    made, one, texture = textured(target="Roughness", picture=image(pattern(), "Non-Color"))
    one.inputs["Metallic"].default_value = 1.0
    ball(made)


@scene()
def alpha_image(s):
    made, one, texture = textured(picture=image(pattern(alpha=True)))
    link(made, texture.outputs["Alpha"], one.inputs["Alpha"])
    board(made)


@scene()
def alpha_not_used(s):
    board(textured(picture=image(pattern(alpha=True)))[0])


@scene()
def leaf_card(s):
    made, mix = mixed(("BsdfTransparent", {}), ("BsdfDiffuse", {"Color": GREEN}), 0.5)
    texture = node(made, "TexImage")
    texture.image = image(pattern(alpha=True))
    link(made, texture.outputs["Alpha"], mix.inputs[0])
    board(made)


@scene()
def generated_coordinates(s):
    box(textured(coordinates="Generated", mapping=INNER)[0])


@scene()
def object_coordinates(s):
    box(textured(coordinates="Object")[0])


@scene()
def box_projection(s):
    box(textured(projection="BOX", coordinates="Generated", mapping=INNER)[0])


@scene()
def clipped_image(s):
    board(textured(extension="CLIP", coordinates="UV", mapping=SMALLER)[0])


@scene()
def extended_image(s):
    board(textured(extension="EXTEND", coordinates="UV", mapping=SMALLER)[0])


@scene()
def mirrored_image(s):
    board(textured(extension="MIRROR", coordinates="UV", mapping=("POINT", {"Scale": (3, 3, 1)}))[0])


@scene()
def turned_image(s):
    turn = {"Scale": (2, 3, 1), "Rotation": (0, 0, 0.5), "Location": (0.2, 0.1, 0)}
    board(textured(coordinates="UV", mapping=("POINT", turn))[0])


@scene()
def texture_mapping(s):
    board(textured(coordinates="UV", mapping=("TEXTURE", {"Scale": (0.5, 0.25, 1), "Rotation": (0, 0, 0.5)}))[0])


@scene(missing="missing")
def missing_file(s):
    made, _, texture = textured()
    texture.image = bpy.data.images.new("gone", 8, 8)
    texture.image.source = "FILE"
    texture.image.filepath = "//gone.png"
    board(made)


@scene(missing="has no image")
def no_image(s):
    made, _, texture = textured()
    texture.image = None
    board(made)


@scene()
def second_uv_map(s):
    made, _, texture = textured()
    item = board(made)
    layer = item.data.uv_layers.new(name="other")
    for corner, place in zip(layer.uv, ((0, 0), (0.5, 0), (0.5, 0.5), (0, 0.5))):
        corner.vector = place
    link(made, node(made, "UVMap", uv_map="other").outputs[0], texture.inputs["Vector"])


@scene()
def vertex_colours(s):
    made, one = shader("BsdfDiffuse")
    item = ball(made)
    colours = item.data.color_attributes.new("paint", "FLOAT_COLOR", "POINT")
    for index, vertex in enumerate(item.data.vertices):
        colours.data[index].color = (*(vertex.co * 0.9 + Vector((0.5, 0.5, 0.5))), 1.0)
    link(made, node(made, "VertexColor", layer_name="paint").outputs[0], one.inputs["Color"])


def between(kind, output=0, target="Color", inputs=(), **settings):
    """An image through one node into a diffuse shader."""
    made, one, texture = textured("BsdfDiffuse", "Color")
    middle = node(made, kind, inputs, **settings)
    link(made, texture.outputs[0], middle.inputs[target])
    link(made, middle.outputs[output], one.inputs["Color"])
    board(made)
    return middle


@scene()
def colour_ramp(s):
    middle = between("ValToRGB", target="Fac")
    middle.color_ramp.elements[0].color, middle.color_ramp.elements[1].color = RED, GREEN


@scene()
def hue_and_saturation(s):
    between("HueSaturation", inputs={"Hue": 0.7, "Saturation": 0.8, "Value": 0.9})


@scene()
def inverted(s):
    between("Invert")


@scene()
def gamma(s):
    between("Gamma", inputs={"Gamma": 2.0})


@scene()
def brightness_and_contrast(s):
    middle = between("BrightContrast")
    middle.inputs[1].default_value, middle.inputs[2].default_value = 0.1, 0.3


@scene()
def grey_of_colour(s):
    between("RGBToBW")


@scene()
def curves(s):
    middle = between("RGBCurve")
    middle.mapping.curves[3].points[0].location = (0.0, 0.3)
    middle.mapping.curves[0].points[1].location = (1.0, 0.5)
    middle.mapping.update()


@scene()
def multiplied_colours(s):
    middle = between("MixRGB", target="Color1", blend_type="MULTIPLY")
    middle.inputs[0].default_value, middle.inputs[2].default_value = 0.8, RED


@scene()
def muted_node(s):
    between("Gamma", inputs={"Gamma": 3.0}).mute = True


@scene()
def arithmetic(s):
    made, one, texture = textured("BsdfDiffuse", "Color")
    times = node(made, "Math", operation="MULTIPLY")
    times.inputs[1].default_value = 0.5
    link(made, texture.outputs[0], times.inputs[0])
    link(made, times.outputs[0], one.inputs["Color"])
    board(made)


# Objects.


@scene()
def flat_shading(s):
    ball(principled(Base_Color=RED), smooth=False)


@scene()
def object_linked_slot(s):
    item = ball(principled(Base_Color=RED))
    item.material_slots[0].link = "OBJECT"
    item.material_slots[0].material = principled(Base_Color=GREEN)


@scene()
def two_materials(s):
    item = ball(principled(Base_Color=RED))
    item.data.materials.append(principled(Base_Color=GREEN))
    for polygon in item.data.polygons:
        polygon.material_index = polygon.index % 2


@scene()
def names_alike(s):
    for x, name, material in ((-0.4, "a b", principled(Base_Color=RED)), (0.4, "a/b", principled(Base_Color=GREEN))):
        ball(material, MIDDLE + Vector((x, 0, 0)), 0.3).name = name


@scene()
def longest_name(s):
    ball(principled(Base_Color=RED)).name = "ä" * 31 if bpy.app.version < (5, 0, 0) else "n" * 250


@scene()
def mirrored(s):
    ball(principled(Base_Color=RED)).scale = (-1.0, 0.6, 1.0)


@scene()
def sheared(s):
    item = box(principled(Base_Color=RED))
    item.matrix_world = Matrix(((1, 0.5, 0, 0), (0, 1, 0.2, 1.5), (0, 0, 1, 1.2), (0, 0, 0, 1)))


@scene()
def text(s):
    bpy.ops.object.text_add(location=MIDDLE - Vector((0.5, 0, 0.2)), rotation=(1.4, 0, 0))
    bpy.context.object.data.extrude = 0.05
    bpy.context.object.data.materials.append(principled(Base_Color=RED))


@scene()
def subdivided(s):
    item = box(principled(Base_Color=RED))
    item.modifiers.new("smooth", "SUBSURF").render_levels = 2


def move_to(item, collection):
    for each in item.users_collection:
        each.objects.unlink(item)
    collection.objects.link(item)


@scene()
def collection_instance(s):
    group = bpy.data.collections.new("group")
    piece = ball(principled(Base_Color=GREEN), (0, 0, 0), 0.2)
    move_to(piece, group)
    for x in (-0.4, 0.0, 0.4):
        holder = bpy.data.objects.new("holder", None)
        holder.instance_type, holder.instance_collection = "COLLECTION", group
        holder.location, holder.scale = MIDDLE + Vector((x, x, 0)), (1, 1, 1.5 + x)
        s.collection.objects.link(holder)


@scene()
def many_instances(s):
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=7, y_subdivisions=7, size=1.4, location=MIDDLE - Vector((0, 0, 0.4)))
    carrier = bpy.context.object
    piece = box(textured(coordinates="Generated", mapping=INNER)[0], (0, 0, 0), 0.12)
    piece.parent = carrier
    carrier.instance_type = "FACES"
    carrier.show_instancer_for_render = False


@scene()
def scattered_by_nodes(s):
    """Hundreds of heavy meshes, turned, unevenly scaled and some of them mirrored."""
    piece = ball(textured(coordinates="Generated", mapping=INNER)[0], (0, 0, -20), 0.06, smooth=False)
    piece.modifiers.new("finer", "SUBSURF").render_levels = 1
    cloud = bpy.data.meshes.new("cloud")
    spread = np.random.default_rng(3).uniform((-0.8, 1.0, 0.6), (0.8, 2.2, 1.8), (300, 3))
    cloud.from_pydata(spread.tolist(), [], [])
    carrier = bpy.data.objects.new("cloud", cloud)
    s.collection.objects.link(carrier)
    tree = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    given, made = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    placed, source = tree.nodes.new("GeometryNodeInstanceOnPoints"), tree.nodes.new("GeometryNodeObjectInfo")
    source.inputs["Object"].default_value, source.inputs["As Instance"].default_value = piece, True
    tree.links.new(given.outputs[0], placed.inputs["Points"])
    tree.links.new(source.outputs["Geometry"], placed.inputs["Instance"])
    for target, low, high in (("Rotation", (0, 0, 0), (6, 6, 6)), ("Scale", (-1.5, 0.7, 0.4), (1.5, 1.5, 1.5))):
        chance = tree.nodes.new("FunctionNodeRandomValue")
        chance.data_type = "FLOAT_VECTOR"
        chance.inputs[0].default_value, chance.inputs[1].default_value = low, high
        tree.links.new(chance.outputs[0], placed.inputs[target])
    tree.links.new(placed.outputs[0], made.inputs[0])
    carrier.modifiers.new("scatter", "NODES").node_group = tree


@scene()
def instances_with_slots_of_their_own(s):
    """A collection of two objects that share a mesh, each with the material in its slot, placed as often as is gathered."""
    group = bpy.data.collections.new("group")
    first = ball(principled(), (-0.15, 0, 0), 0.12)
    second = first.copy()
    second.location.x = 0.15
    move_to(first, group)
    group.objects.link(second)
    for piece, colour in ((first, RED), (second, GREEN)):
        piece.material_slots[0].link = "OBJECT"
        piece.material_slots[0].material = principled(Base_Color=colour)
    holder = bpy.data.meshes.new("holder")
    ticks = np.linspace(-0.5, 0.5, 3)
    holder.from_pydata([tuple(MIDDLE + Vector((1.4 * x, 0.5 * z, z))) for x in ticks for z in ticks], [], [])
    carrier = bpy.data.objects.new("holder", holder)
    s.collection.objects.link(carrier)
    each = bpy.data.objects.new("each", None)
    s.collection.objects.link(each)
    each.instance_type, each.instance_collection = "COLLECTION", group
    each.parent, carrier.instance_type = carrier, "VERTS"


@scene()
def hidden_object(s):
    ball(principled(Base_Color=RED), MIDDLE + Vector((0.3, 0, 0)), 0.3)
    ball(principled(Base_Color=GREEN), MIDDLE - Vector((0.3, 0, 0)), 0.3).hide_render = True


@scene(missing="outside the place")
def parked_object(s):
    ball(principled(Base_Color=RED))
    ball(principled(Base_Color=GREEN), (0, 0, -20))


@scene(missing="holdout")
def holdout(s):
    ball(principled(Base_Color=RED)).is_holdout = True


@scene(missing="ray visibility")
def unseen_by_camera(s):
    ball(principled(Base_Color=RED)).visible_camera = False


@scene(missing="indirect only")
def indirect_only(s):
    group = bpy.data.collections.new("indirect")
    s.collection.children.link(group)
    item = ball(principled(Base_Color=RED))
    move_to(item, group)
    bpy.context.view_layer.layer_collection.children["indirect"].indirect_only = True


@scene(missing="clip start")
def cut_by_the_camera(s):
    ball(principled(Base_Color=RED), MIDDLE + Vector((0.2, 0, 0)))
    board(principled(Base_Color=GREEN), s.camera.matrix_world @ Vector((0, 0, -0.15)), 0.05)
    s.camera.data.clip_start = 0.5


# Lamps, on a matte board and a ball.


def lit(s, kind, location=(0.6, 0.6, 1.9), towards=MIDDLE, **settings):
    board(shader("BsdfDiffuse", Color=GREY)[0], MIDDLE - Vector((0, 0, 0.35)), 2.0, (0, 0, 0))
    ball(principled(Base_Color=RED), MIDDLE, 0.25)
    lamp = add_lamp(s, kind, "Lamp", location, **settings)
    lamp.rotation_euler = (Vector(towards) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    return lamp


@scene()
def point_lamp(s):
    lit(s, "POINT", (-0.5, 0.5, 2.2), energy=60.0, shadow_soft_size=0.1)


@scene()
def area_lamp(s):
    lit(s, "AREA", (0.5, 0.5, 2.3), energy=60.0, size=0.4)


@scene()
def area_lamp_from_behind(s):
    lit(s, "AREA", (0.25, 0.2, 1.5), energy=30.0, size=0.3)


@scene()
def lamp_in_the_picture(s):
    """Between camera and ball, and mirrored by it; cameras do not see lamps unless they are told to."""
    lit(s, "POINT", (0.1, 0.8, 1.25), energy=8.0, shadow_soft_size=0.1)
    ball(principled(Metallic=1.0, Roughness=0.2), MIDDLE + Vector((-0.5, 0.1, 0)), 0.25)


@scene()
def lamp_that_cameras_see(s):
    lamp_in_the_picture(s)
    bpy.data.objects["Lamp"].visible_camera = True


@scene()
def hard_spot(s):
    lit(s, "SPOT", (0.5, 0.5, 2.4), energy=200.0, shadow_soft_size=0.03, spot_size=0.8, spot_blend=0.0)


@scene()
def soft_spot(s):
    lit(s, "SPOT", (0.5, 0.5, 2.4), energy=200.0, shadow_soft_size=0.03, spot_size=0.8, spot_blend=1.0)


@scene()
def lamp_with_emission_node(s):
    lamp = lit(s, "AREA", (0.5, 0.5, 2.3), energy=30.0, size=0.4)
    lamp.data.use_nodes = True
    settle(next(each for each in lamp.data.node_tree.nodes if each.type == "EMISSION"), {"Color": RED, "Strength": 2.0})


@scene()
def portal(s):
    lit(s, "AREA", (0.5, 0.5, 2.3), energy=60.0, size=0.4).data.cycles.is_portal = True


@scene(missing="spread")
def narrow_area_lamp(s):
    lit(s, "AREA", (0.5, 0.5, 2.3), energy=60.0, size=0.4, spread=0.6)


# Cameras.


@scene()
def shifted_lens(s):
    ball(principled(Base_Color=RED))
    s.camera.data.shift_x, s.camera.data.shift_y = 0.1, -0.05


@scene()
def odd_percentage(s):
    ball(principled(Base_Color=RED))
    s.render.resolution_x, s.render.resolution_y, s.render.resolution_percentage = 100, 75, 29


@scene()
def region(s):
    ball(principled(Base_Color=RED))
    s.render.use_border = s.render.use_crop_to_border = True
    s.render.border_min_x, s.render.border_max_x, s.render.border_min_y, s.render.border_max_y = 0.3, 0.8, 0.2, 0.7


@scene()
def far_from_the_origin(s):
    """Everything three kilometres away, where single precision is a quarter of a millimetre."""
    lit(s, "POINT", (-0.5, 0.5, 2.2), energy=60.0, shadow_soft_size=0.1)
    for item in s.objects:
        if item.parent is None:
            item.matrix_world = Matrix.Translation((3000.0, -2000.0, 0.0)) @ item.matrix_world


# The harness.


# Motion blur.


def open_shutter(s, length=0.5, position="CENTER"):
    """Motion blur around frame 10."""
    s.render.use_motion_blur, s.render.motion_blur_shutter, s.render.motion_blur_position = True, length, position
    s.frame_set(10)


def keyed(owner, path, *values, frames=(9, 11)):
    """Keys of an attribute, straight from one to the next."""
    for frame, value in zip(frames, values, strict=True):
        setattr(owner, path, value)
        owner.keyframe_insert(path, frame=frame)
    data = owner.id_data.animation_data
    curves = data.action.layers[0].strips[0].channelbag(data.action_slot).fcurves if data.action_slot else []
    for curve in curves:
        for point in curve.keyframe_points:
            point.interpolation = "LINEAR"


@scene()
def moving_ball(s):
    keyed(ball(principled(Base_Color=RED, Roughness=0.6), radius=0.3), "location", (-0.7, 1.5, 1.2), (0.7, 1.5, 1.3))
    open_shutter(s)


@scene()
def shutter_that_closes_at_the_frame(s):
    keyed(box(principled(Base_Color=GREEN)), "location", (-0.7, 1.5, 1.2), (0.7, 1.5, 1.2))
    open_shutter(s, 1.6, "END")


@scene()
def turning_box(s):
    item = box(textured()[0])
    item.cycles.motion_steps = 3
    keyed(item, "rotation_euler", (0.0, 0.0, -1.2), (0.4, 0.0, 1.2))
    open_shutter(s, 1.0)


@scene()
def moving_camera(s):
    ball(principled(Base_Color=RED), radius=0.3)
    keyed(s.camera, "location", (-0.3, -0.3, 1.3), (0.3, -0.3, 1.3))
    open_shutter(s, 1.0)


@scene()
def zooming_lens(s):
    ball(principled(Base_Color=RED), radius=0.3)
    keyed(s.camera.data, "lens", 25.0, 55.0)
    open_shutter(s, 1.0)


@scene()
def ball_without_motion_blur(s):
    item = ball(principled(Base_Color=RED), radius=0.3)
    keyed(item, "location", (-0.7, 1.5, 1.2), (0.7, 1.5, 1.3))
    item.cycles.use_motion_blur = False
    open_shutter(s)


@scene()
def growing_ball(s):
    item = ball(principled(Base_Color=GREEN, Roughness=0.6), radius=0.3)
    item.shape_key_add(name="Basis")
    grown = item.shape_key_add(name="Grown")
    for point in grown.data:
        point.co.x *= 2.5
    keyed(grown, "value", 0.0, 1.0)
    open_shutter(s, 1.0)


@scene()
def moving_instances(s):
    """Forty balls of one instancer that goes sideways."""
    instanced = ball(principled(Base_Color=RED), radius=0.07, location=(0.0, 0.0, 0.0))
    cloud = bpy.data.meshes.new("cloud")
    cloud.from_pydata([(0.2 * (i % 8) - 0.7, 0.0, 0.2 * (i // 8) - 0.4) for i in range(40)], [], [])
    holder = bpy.data.objects.new("cloud", cloud)
    s.collection.objects.link(holder)
    instanced.parent, holder.instance_type = holder, "VERTS"
    keyed(holder, "location", (-0.2, 1.5, 1.2), (0.2, 1.5, 1.2))
    open_shutter(s, 1.0)


@scene("Rolling shutter")
def rolling_shutter(s):
    moving_ball(s)
    s.cycles.rolling_shutter_type = "TOP"


def reset(s, room):
    """Back to the empty room, and to the settings of the first scene."""
    for item in [item for item in bpy.data.objects if item.name not in room]:
        bpy.data.objects.remove(item)
    for name, matrix in room.items():
        bpy.data.objects[name].matrix_world = matrix
    for collection in [each for each in bpy.data.collections if not any(item.name in room for item in each.objects)]:
        bpy.data.collections.remove(collection)
    bpy.data.orphans_purge(do_recursive=True)
    s.render.use_border = s.render.use_crop_to_border = s.render.use_motion_blur = False
    s.cycles.rolling_shutter_type = "NONE"
    s.render.border_min_x, s.render.border_max_x, s.render.border_min_y, s.render.border_max_y = 0.0, 1.0, 0.0, 1.0
    add_camera(s, (WIDTH, HEIGHT), (0.0, -0.3, 1.3), (math.pi / 2, 0.0, 0.0)).data.lens = 40.0
    bpy.context.view_layer.update()


def referee(s, path):
    """Cycles' picture with one seed, as a file that the test reads."""
    cycles(s, SAMPLES)
    s.cycles.filter_width, s.cycles.max_bounces = 1.0, 8
    for name in ("diffuse_bounces", "glossy_bounces", "transmission_bounces", "transparent_max_bounces"):
        setattr(s.cycles, name, 8)
    s.cycles.sample_clamp_indirect = s.cycles.blur_glossy = 0.0
    s.cycles.caustics_reflective = s.cycles.caustics_refractive = True
    as_exr(s, path)
    bpy.ops.render.render(write_still=True)


def main():
    folder, wanted = Path(sys.argv[1]), sys.argv[2:] or list(SCENES)
    s = begin()
    height = 64
    u, v = np.meshgrid((np.arange(2 * height) + 0.5) / (2 * height), (np.arange(height) + 0.5) / height)
    around = 2.0 * np.pi * u
    smooth = np.stack([0.4 + 0.3 * np.sin(around), 0.4 + 0.2 * np.cos(around), 0.5 - 0.2 * v, np.ones_like(u)], -1)
    window = (np.abs(u - 0.25) < 0.05) & (np.abs(v - 0.4) < 0.08)
    smooth[window, :3] = 6.0
    write_panorama(folder / "panorama.exr", height, smooth.astype(np.float32))
    bpy.ops.lightdepth.load_panorama(filepath=str(folder / "panorama.exr"))
    bpy.ops.lightdepth.add_room(corners=corners((-2, -2), (2, -2), (2, 3), (-2, 3)), height=2.6)
    bpy.data.objects["Floor"].lightdepth.role = "ENVIRONMENT"
    room = {item.name: item.matrix_world.copy() for item in s.objects}
    s.lightdepth.max_bounces = 9  # Cycles counts bounces, we count scatterings
    found = {}
    for name in wanted:
        function, missing = SCENES[name]
        reset(s, room)
        function(s)
        bpy.context.view_layer.update()
        for seed in (0, 1):
            s.cycles.seed = seed
            referee(s, folder / f"{name}.{seed}.exr")
        failed = refused(bpy.ops.lightdepth.export_scene, filepath=str(folder / f"{name}.toml"))
        notes = [line.text for line in s.lightdepth.export_notes]
        found[name] = {"missing": missing, "notes": notes, "failed": failed}
    answer(scenes=found)


if __name__ == "__main__":
    main()
