"""Install the extension from a repository's address, and update it when that has a newer version."""

import shutil
import sys
from pathlib import Path

import bpy
from session import answer

first, second, served = map(Path, sys.argv[1:])
preferences = bpy.context.preferences
preferences.system.use_online_access = True
shutil.copytree(first, served)
repository = preferences.extensions.repos.new(
    name="lightdepth", module="lightdepth_repository", remote_url=(served / "index.json").as_uri()
)
index = list(preferences.extensions.repos).index(repository)
bpy.ops.extensions.repo_sync(repo_index=index)
bpy.ops.extensions.package_install(repo_index=index, pkg_id="lightdepth")


def version():
    manifest = Path(repository.directory) / "lightdepth/blender_manifest.toml"
    return next(line.split('"')[1] for line in manifest.read_text().splitlines() if line.startswith("version"))


found = {"installed": version(), "enabled": "bl_ext.lightdepth_repository.lightdepth" in preferences.addons}
shutil.rmtree(served)
shutil.copytree(second, served)
bpy.ops.extensions.repo_sync(repo_index=index)
bpy.ops.extensions.package_upgrade_all()
found["updated"] = version()
answer(**found)
