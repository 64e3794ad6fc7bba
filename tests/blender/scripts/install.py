"""Install the zip as a person does, and switch it off and on again."""

import sys

import bpy
from session import MODULE, answer

bpy.ops.extensions.package_install_files(filepath=sys.argv[1], repo="user_default", enable_on_install=True)
bpy.ops.preferences.addon_disable(module=MODULE)
assert not hasattr(bpy.context.scene, "lightdepth")
bpy.ops.preferences.addon_enable(module=MODULE)
answer(samples=bpy.context.scene.lightdepth.samples)
