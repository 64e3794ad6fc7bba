"""The extensions of glTF: which are applied, which are left out with a note, and which mean nothing here."""

from __future__ import annotations

from collections.abc import Iterable

APPLIED = frozenset(
    {
        "EXT_mesh_gpu_instancing", "EXT_meshopt_compression", "EXT_texture_avif", "EXT_texture_webp",
        "KHR_draco_mesh_compression", "KHR_materials_clearcoat", "KHR_materials_emissive_strength",
        "KHR_materials_ior", "KHR_materials_pbrSpecularGlossiness", "KHR_materials_specular",
        "KHR_materials_transmission", "KHR_materials_unlit", "KHR_materials_volume", "KHR_mesh_quantization",
        "KHR_meshopt_compression", "KHR_node_visibility", "KHR_texture_basisu", "KHR_texture_transform",
        "MSFT_texture_dds",
    }
)  # fmt: skip
LEFT_OUT = {
    "EXT_lights_ies": "lights",
    "EXT_lights_image_based": "lights",
    "KHR_lights_punctual": "lights",
    "KHR_materials_anisotropy": "anisotropy",
    "KHR_materials_diffuse_transmission": "diffuse transmission",
    "KHR_materials_dispersion": "dispersion",
    "KHR_materials_iridescence": "iridescence",
    "KHR_materials_sheen": "sheen",
    "KHR_materials_variants": "variants of materials",
    "KHR_materials_volume_scatter": "scattering in volumes",
}
"""Extensions without which a picture is still of the same thing."""
MEANINGLESS = frozenset(
    {
        "AGI_articulations", "EXT_mesh_features", "EXT_structural_metadata", "FB_ngon_encoding",
        "KHR_animation_pointer", "KHR_audio_emitter", "KHR_interactivity",
        "KHR_node_hoverability", "KHR_node_selectability", "KHR_physics_rigid_bodies", "KHR_implicit_shapes",
        "KHR_xmp", "KHR_xmp_json_ld", "MSFT_lod", "MSFT_packing_normalRoughnessMetallic",
        "MSFT_packing_occlusionRoughnessMetallic", "VRM", "VRMC_vrm", "VRMC_springBone",
    }
)  # fmt: skip
"""Extensions that change nothing in a picture of the scene at rest."""


def unsupported_extensions(required: Iterable[str]) -> list[str]:
    """Of the extensions that a file requires, those without which it cannot be shown rightly."""
    return [name for name in required if name not in APPLIED and name not in LEFT_OUT and name not in MEANINGLESS]


def left_out_extensions(used: Iterable[str]) -> list[str]:
    """Notes on what is left out of the extensions that a file uses."""
    notes = []
    for name in used:
        if name in LEFT_OUT:
            notes.append(f"{name} is left out ({LEFT_OUT[name]})")
        elif name not in APPLIED and name not in MEANINGLESS:
            notes.append(f"the extension {name[:60]} is not known and is left out")
    return notes
