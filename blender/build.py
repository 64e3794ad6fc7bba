"""Make the extension's installable zip: ``python blender/build.py [--validate PYTHON_WITH_BPY]``."""

import argparse
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
SOURCE = HERE / "extension"
TIMESTAMP = (2026, 1, 1, 0, 0, 0)
"""Of every file in the archive, so that the same sources give the same bytes."""
VALIDATE = """
import sys, bpy, runpy
from pathlib import Path
tool = Path(bpy.utils.system_resource("SCRIPTS")) / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py"
sys.argv = [str(tool), "validate", {archive!r}]
sys.path.insert(0, str(tool.parent))
runpy.run_path(str(tool), run_name="__main__")
"""


def build(folder: Path) -> Path:
    """Write the archive.

    Args:
        folder: where to put it; made if it is not there.

    Returns:
        The archive's path, whose name holds the version.

    Raises:
        SystemExit: the extension's version is not the renderer's.
    """
    manifest = tomllib.loads((SOURCE / "blender_manifest.toml").read_text(encoding="utf-8"))
    project = tomllib.loads((HERE.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    if manifest["version"] != project["version"]:
        sys.exit(f"blender_manifest.toml has version {manifest['version']}, pyproject.toml {project['version']}")
    folder.mkdir(parents=True, exist_ok=True)
    archive = folder / f"{manifest['id']}-blender-{manifest['version']}.zip"
    files = [*SOURCE.glob("*.py"), SOURCE / "blender_manifest.toml", SOURCE / "LICENSE"]
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as output:
        for file in sorted(files, key=lambda file: file.name):
            entry = zipfile.ZipInfo(file.name, TIMESTAMP)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            output.writestr(entry, file.read_bytes())
    return archive


def validate(archive: Path, python: str) -> None:
    """Let Blender's own validator look at the archive.

    Args:
        archive: the archive.
        python: an interpreter that has the package ``bpy``.

    Raises:
        SystemExit: the validator found something.
    """
    done = subprocess.run([python, "-c", VALIDATE.format(archive=str(archive))], check=False)
    if done.returncode != 0:
        sys.exit(f"{archive}: Blender's validator refuses it")


def main() -> None:
    """Build, and validate where asked to."""
    parser = argparse.ArgumentParser(description="Make the Blender extension's installable zip.")
    parser.add_argument("--output", type=Path, default=HERE.parent / "dist", help="folder to put it into")
    parser.add_argument("--validate", metavar="PYTHON", help="an interpreter with bpy, to run Blender's validator")
    arguments = parser.parse_args()
    archive = build(arguments.output)
    print(archive)
    if arguments.validate:
        validate(archive, arguments.validate)


if __name__ == "__main__":
    main()
