"""Make the extension's installable zip, or a static repository that Blender installs it from and updates it by.

``python blender/build.py [--output FOLDER] [--repository] [--website URL] [--validate PYTHON_WITH_BPY]``
"""

import argparse
import hashlib
import json
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


def build(folder: Path, website: str | None = None) -> Path:
    """Write the archive.

    Args:
        folder: where to put it; made if it is not there.
        website: address that Blender shows with the extension, for the manifest.

    Returns:
        The archive's path, whose name holds the version.

    Raises:
        SystemExit: the extension's version is not the renderer's.
    """
    text = _manifest(website)
    manifest = tomllib.loads(text)
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
            output.writestr(entry, text if file.suffix == ".toml" else file.read_bytes())
    return archive


def _manifest(website: str | None) -> str:
    """The manifest's text, with the website where there is one."""
    text = (SOURCE / "blender_manifest.toml").read_text(encoding="utf-8")
    return (
        text if website is None else text.replace("\nlicense = ", f"\nwebsite = {json.dumps(website)}\nlicense = ", 1)
    )


def write_index(folder: Path) -> Path:
    """Write the index of a static repository over the archives in a folder, as Blender reads it (version 1).

    Args:
        folder: with the archives; of each extension's versions the newest is listed.

    Returns:
        The index's path.
    """
    newest: dict[str, tuple[tuple[int, ...], dict]] = {}
    for archive in sorted(folder.glob("*.zip")):
        with zipfile.ZipFile(archive) as contents:
            manifest = tomllib.loads(contents.read("blender_manifest.toml").decode("utf-8"))
        version = tuple(int(number) for number in manifest["version"].split("-")[0].split("."))
        entry = {key: value for key, value in manifest.items() if key != "copyright"} | {
            "archive_url": f"./{archive.name}",
            "archive_size": archive.stat().st_size,
            "archive_hash": f"sha256:{hashlib.sha256(archive.read_bytes()).hexdigest()}",
        }
        if manifest["id"] not in newest or version > newest[manifest["id"]][0]:
            newest[manifest["id"]] = (version, entry)
    index = folder / "index.json"
    listing = {"version": "v1", "blocklist": [], "data": [entry for _, entry in newest.values()]}
    index.write_text(json.dumps(listing, indent=2) + "\n", encoding="utf-8")
    return index


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
    parser.add_argument("--repository", action="store_true", help="write the index of a static repository as well")
    parser.add_argument("--website", metavar="URL", help="address that Blender shows with the extension")
    parser.add_argument("--validate", metavar="PYTHON", help="an interpreter with bpy, to run Blender's validator")
    arguments = parser.parse_args()
    archive = build(arguments.output, arguments.website)
    print(archive)
    if arguments.repository:
        print(write_index(arguments.output))
    if arguments.validate:
        validate(archive, arguments.validate)


if __name__ == "__main__":
    main()
