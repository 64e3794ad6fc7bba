"""Where the renderer is, and whether it works."""

import bpy

from .process import RendererError, doctor, find_command
from .properties import Line, show_lines


class Preferences(bpy.types.AddonPreferences):
    """The extension's preferences."""

    bl_idname = __package__

    command: bpy.props.StringProperty(
        name="Renderer",
        description="Path of the command 'lightdepth'; empty: wherever the system finds it",
        subtype="FILE_PATH",
    )
    answer: bpy.props.CollectionProperty(type=Line, options={"SKIP_SAVE"})

    def draw(self, context):
        """The path, the test button, and what the renderer said of itself."""
        row = self.layout.row(align=True)
        row.prop(self, "command")
        row.operator(TestRenderer.bl_idname, icon="CHECKMARK")
        if len(self.answer):
            box = self.layout.box().column(align=True)
            for line in self.answer:
                box.label(text=line.text)


class TestRenderer(bpy.types.Operator):
    """Ask the renderer how it is installed: lightdepth doctor"""

    bl_idname = "lightdepth.test_renderer"
    bl_label = "Test"

    def execute(self, context):
        """Run the command and show what it prints."""
        preferences = context.preferences.addons[__package__].preferences
        try:
            said = doctor(renderer_command())
        except RendererError as error:
            show_lines(preferences.answer, str(error).splitlines())
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        show_lines(preferences.answer, said)
        self.report({"INFO"}, "The renderer answers")
        return {"FINISHED"}


def renderer_command() -> str:
    """The path of the renderer's command.

    Raises:
        RendererError: it was not found.
    """
    return find_command(bpy.context.preferences.addons[__package__].preferences.command.strip())


classes = (Preferences, TestRenderer)
