"""Materials of the new objects, by Blender's glTF exporter; what it cannot carry is said by name."""

from collections.abc import Iterator
from pathlib import Path

import bpy

CARRIED = {
    "BSDF_PRINCIPLED",
    "EMISSION",
    "TEX_IMAGE",
    "NORMAL_MAP",
    "UVMAP",
    "TEX_COORD",
    "MAPPING",
    "SEPARATE_COLOR",
    "OUTPUT_MATERIAL",
    "REROUTE",
    "FRAME",
    "RGB",
    "VALUE",
    "VERTEX_COLOR",
}
"""Shader nodes that the glTF exporter understands where they stand as in its manual."""
LOST_INPUTS = {
    "Subsurface Weight": "subsurface scattering",
    "Sheen Weight": "sheen",
    "Anisotropic": "anisotropy",
    "Diffuse Roughness": "the roughness of its diffuse part",
    "Thin Film Thickness": "thin film",
    "Coat Normal": "the coat's normal map",
}
"""Inputs of the Principled BSDF that the renderer's materials do not have, with what they are."""
KINDS_OF_IMAGES = {"SEQUENCE": "sequence", "MOVIE": "movie", "TILED": "set of tiles"}
SINGLE_SHADERS = {"BSDF_GLASS", "BSDF_REFRACTION", "BSDF_DIFFUSE", "BSDF_GLOSSY"}
"""Shaders that become a Principled BSDF before export, as the glTF exporter knows only that."""


def surface_shader(material):
    """The node at the surface input of the material's output, or ``None``."""
    if not material.use_nodes or material.node_tree is None:
        return None
    output = material.node_tree.get_output_node("ALL")
    links = output.inputs["Surface"].links if output else ()
    return links[0].from_node if links else None


def notes(material) -> list[str]:
    """What of a material cannot be carried, one sentence each, with the material's name."""
    shader = surface_shader(material)
    if shader is None:
        return []
    said = []
    for node in _upstream(shader):
        if node.type not in CARRIED and not (node == shader and node.type in SINGLE_SHADERS):
            said.append(f"Material '{material.name}': node '{node.name}' ({node.bl_label}) is not carried")
        if node.type == "TEX_IMAGE":
            if node.image is None:
                said.append(f"Material '{material.name}': node '{node.name}' has no image")
            elif node.image.source in KINDS_OF_IMAGES:
                said.append(
                    f"Material '{material.name}': image '{node.image.name}' of node '{node.name}' is a "
                    f"{KINDS_OF_IMAGES[node.image.source]}, of which one picture is carried at most"
                )
    if shader.type == "BSDF_PRINCIPLED":
        for name, meaning in LOST_INPUTS.items():
            socket = shader.inputs.get(name)
            if socket is not None and (
                socket.is_linked or (hasattr(socket.default_value, "real") and socket.default_value > 0)
            ):
                said.append(f"Material '{material.name}': {meaning} ('{name}') is not carried")
    output = material.node_tree.get_output_node("ALL")
    for name in ("Volume", "Displacement"):
        if output.inputs[name].is_linked:
            said.append(f"Material '{material.name}': {name.lower()} is not carried")
    return said


def _upstream(node, seen=None) -> Iterator:
    seen = set() if seen is None else seen
    if node.name in seen:
        return
    seen.add(node.name)
    yield node
    for socket in node.inputs:
        for link in socket.links:
            yield from _upstream(link.from_node, seen)


def for_export(material, depsgraph) -> bpy.types.Material:
    """A copy of a material that the glTF exporter understands, as it is at the depsgraph's frame."""
    copy = material.copy()
    if copy.node_tree is not None:
        evaluated = material.evaluated_get(depsgraph)
        copy.node_tree.animation_data_clear()  # the exporter's scene is at frame 1 and would set its values
        for node in copy.node_tree.nodes:
            _copy_values(evaluated.node_tree.nodes[node.name], node)
        shader = surface_shader(copy)
        if shader is not None and shader.type in SINGLE_SHADERS:
            _as_principled(copy.node_tree, shader)
    return copy


def _copy_values(source, target) -> None:
    """Unlinked values of a node's sockets, which animation may have changed."""
    for kind in ("inputs", "outputs"):
        for index, socket in enumerate(getattr(target, kind)):
            if hasattr(socket, "default_value") and socket.type in {"VALUE", "RGBA", "VECTOR"}:
                socket.default_value = getattr(source, kind)[index].default_value


def _as_principled(tree, shader) -> None:
    """Put a Principled BSDF in the place of a single shader."""
    principled = tree.nodes.new("ShaderNodeBsdfPrincipled")
    pairs = {"Color": "Base Color", "Roughness": "Roughness", "Normal": "Normal", "IOR": "IOR"}
    if shader.type == "BSDF_DIFFUSE":
        principled.inputs["Roughness"].default_value = 1.0
        _set(principled, ("Specular IOR Level", "Specular"), 0.0)
        del pairs["Roughness"]  # that of a diffuse surface (Oren and Nayar's) means something else
    elif shader.type == "BSDF_GLOSSY":
        principled.inputs["Metallic"].default_value = 1.0
    else:
        _set(principled, ("Transmission Weight", "Transmission"), 1.0)
    for name, counterpart in pairs.items():
        source = shader.inputs.get(name)
        if source is None:
            continue
        if source.is_linked:
            tree.links.new(source.links[0].from_socket, principled.inputs[counterpart])
        elif name != "Normal":
            principled.inputs[counterpart].default_value = source.default_value
    for link in list(shader.outputs[0].links):
        tree.links.new(principled.outputs[0], link.to_socket)
    tree.nodes.remove(shader)


def _set(node, names, value) -> None:
    """Set the first of the inputs that this version of Blender has."""
    for name in names:
        if name in node.inputs:
            node.inputs[name].default_value = value
            return


GLTF_SETTINGS = {
    "export_format": "GLB",
    "use_active_scene": True,
    "export_yup": True,
    "export_apply": False,
    "export_animations": False,
    "export_skins": False,
    "export_morph": False,
    "export_cameras": False,
    "export_lights": False,
    "export_extras": False,
    "export_materials": "EXPORT",
    "check_existing": False,
}


def write_synthetic(path: Path, mesh: bpy.types.Mesh, depsgraph) -> list[str]:
    """Write a mesh with its materials as binary glTF.

    Args:
        path: the file, ending in ``.glb``.
        mesh: a mesh of Blender's own data (not an evaluated one), modifiers applied; its materials are replaced.
        depsgraph: where animated materials have their values.

    Returns:
        Notes on what cannot be carried.
    """
    originals = [material for material in mesh.materials if material is not None]
    said = [note for material in originals for note in notes(material)]
    copies = {material: for_export(material, depsgraph) for material in originals}
    for index, material in enumerate(list(mesh.materials)):
        if material is not None:
            mesh.materials[index] = copies[material]
    scene = bpy.data.scenes.new("lightdepth export")
    item = bpy.data.objects.new(mesh.name, mesh)
    scene.collection.objects.link(item)
    known = bpy.ops.export_scene.gltf.get_rna_type().properties
    settings = {name: value for name, value in GLTF_SETTINGS.items() if name in known}
    try:
        with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
            bpy.ops.export_scene.gltf(filepath=str(path), **settings)
    finally:
        bpy.data.objects.remove(item)
        bpy.data.scenes.remove(scene)
        for copy in copies.values():
            bpy.data.materials.remove(copy)
    return said
