"""The role of a mesh: what it stands for, and how that is seen in the viewport."""

from typing import ClassVar

import bpy

from . import panorama

ENVIRONMENT, SUPPORT, SYNTHETIC = "ENVIRONMENT", "SUPPORT", "SYNTHETIC"
REAL = (ENVIRONMENT, SUPPORT)
ITEMS = (
    (SYNTHETIC, "Synthetic", "A new object, rendered with its own materials", "MESH_MONKEY", 0),
    (
        SUPPORT,
        "Support",
        "A real surface that receives shadows, reflections and light from the new objects",
        "CHECKMARK",
        1,
    ),
    (ENVIRONMENT, "Environment", "A real surface that is only seen, mirrored, and gives its light", "WORLD", 2),
)
COLOURS = {
    SYNTHETIC: (0.90, 0.62, 0.22, 1.0),
    SUPPORT: (0.25, 0.70, 0.35, 1.0),
    ENVIRONMENT: (0.30, 0.50, 0.85, 1.0),
}
"""Object colours, shown by the viewport's solid shading with colour 'Object'."""

WITHOUT_SURFACE = {"EMPTY", "CAMERA", "LIGHT", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}


def show_role(item: bpy.types.Object) -> None:
    """Give an object its role's colour; a real surface shows the photograph, a synthetic one its own materials."""
    role = item.lightdepth.role
    item.color = COLOURS[role]
    if item.type == "MESH":
        if role in REAL:
            panorama.project_onto(item)
        else:
            panorama.stop_projecting_onto(item)


class SetRole(bpy.types.Operator):
    """Give all selected objects this role"""

    bl_idname = "lightdepth.set_role"
    bl_label = "Set Role"
    bl_options: ClassVar = {"REGISTER", "UNDO"}

    role: bpy.props.EnumProperty(name="Role", items=ITEMS)

    @classmethod
    def poll(cls, context):
        """Something is selected."""
        return bool(context.selected_objects)

    @classmethod
    def description(cls, context, properties):
        """The role's own description."""
        return next(item[2] for item in ITEMS if item[0] == properties.role) + " (all selected objects)"

    def execute(self, context):
        """Set the role of every selected object that has surfaces."""
        for item in context.selected_objects:
            if item.type not in WITHOUT_SURFACE:
                item.lightdepth.role = self.role
        return {"FINISHED"}


class ShowRoles(bpy.types.Operator):
    """Colour the viewport by role, or show the photograph again"""

    bl_idname = "lightdepth.show_roles"
    bl_label = "Colours of Roles"

    @classmethod
    def poll(cls, context):
        """The operator is used in a 3D viewport."""
        return context.space_data is not None and context.space_data.type == "VIEW_3D"

    def execute(self, context):
        """Switch between solid shading with object colours and material preview."""
        shading = context.space_data.shading
        if shading.type == "SOLID" and shading.color_type == "OBJECT":
            panorama.show_in(context.space_data)
        else:
            for item in context.scene.objects:  # new objects have no role's colour yet
                if item.type not in WITHOUT_SURFACE:
                    item.color = COLOURS[item.lightdepth.role]
            shading.type, shading.color_type = "SOLID", "OBJECT"
            shading.show_backface_culling = True  # walls look inside: from outside one looks into the room
        return {"FINISHED"}


classes = (SetRole, ShowRoles)
