"""Where the renderer is, and whether it works."""

import bpy

from .asking import Asks
from .process import Question
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


class TestRenderer(Asks, bpy.types.Operator):
    """Ask the renderer how it is installed: lightdepth doctor"""

    bl_idname = "lightdepth.test_renderer"
    bl_label = "Test"

    def arguments(self, context, folder):
        """Those of ``lightdepth doctor``."""
        self._show(context, ["The renderer is tested; a first start takes a while. Esc: give up"])
        return ["doctor"]

    def take(self, context, question: Question):
        """Show what it printed."""
        self._show(context, question.text().splitlines())
        self.report({"INFO"}, "The renderer works")

    def refused(self, context, why):
        """Show the error in the preferences as well, where the person looks."""
        self._show(context, why.splitlines())

    def _show(self, context, lines):
        show_lines(context.preferences.addons[__package__].preferences.answer, lines)


classes = (Preferences, TestRenderer)
