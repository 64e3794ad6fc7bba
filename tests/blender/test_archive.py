"""The installable zip: what is in it, and what Blender's own validator says of it."""

import runpy
import subprocess
import sys
import tomllib
import zipfile

import pytest

from tests.blender.conftest import ROOT

BUILD = ROOT / "blender/build.py"
validate, write_index = (runpy.run_path(str(BUILD))[name] for name in ("validate", "write_index"))


def test_it_holds_the_extension_and_its_own_licence(archive):
    sources = {path.name for path in (ROOT / "blender/extension").glob("*.py")}
    with zipfile.ZipFile(archive) as contents:
        assert set(contents.namelist()) == sources | {"blender_manifest.toml", "LICENSE"}
        manifest = tomllib.loads(contents.read("blender_manifest.toml").decode())
        licence = contents.read("LICENSE").decode()
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    assert "GNU GENERAL PUBLIC LICENSE" in licence
    assert "Version 3" in licence
    assert manifest["version"] in archive.name


def test_the_same_sources_give_the_same_bytes(archive, tmp_path):
    subprocess.run([sys.executable, BUILD, "--output", tmp_path], capture_output=True, check=True)
    assert (tmp_path / archive.name).read_bytes() == archive.read_bytes()


def test_blenders_validator_accepts_it(blender, archive, capfd):
    validate(archive, str(blender.python))
    assert "Success" in capfd.readouterr().out


def test_blender_installs_and_updates_from_the_repository(blender, archive, tmp_path):
    folders = [tmp_path / "first", tmp_path / "second"]
    for folder in folders:
        subprocess.run(
            [sys.executable, BUILD, "--output", folder, "--repository", "--website", "https://example.org/"],
            capture_output=True,
            check=True,
        )
    _with_version(folders[1] / archive.name, "0.99.0")
    write_index(folders[1])
    resources = {"BLENDER_USER_RESOURCES": str(tmp_path / "resources")}
    found = blender.run("repository", *folders, tmp_path / "served", **resources)
    assert found["installed"] in archive.name
    assert found["enabled"]
    assert found["updated"] == "0.99.0"


def _with_version(path, version):
    """Give an archive another version."""
    with zipfile.ZipFile(path) as old:
        contents = {name: old.read(name).decode() for name in old.namelist()}
    manifest = contents["blender_manifest.toml"]
    assert 'website = "https://example.org/"' in manifest
    before = tomllib.loads(manifest)["version"]
    contents["blender_manifest.toml"] = manifest.replace(f'version = "{before}"', f'version = "{version}"', 1)
    with zipfile.ZipFile(path, "w") as new:
        for name, text in contents.items():
            new.writestr(name, text)


@pytest.mark.parametrize(("old", "new"), [('type = "add-on"\n', ""), ('"4.2.0"', '"four"')])
def test_blenders_validator_would_refuse_a_bad_manifest(blender, archive, tmp_path, old, new):
    changed = tmp_path / archive.name
    with zipfile.ZipFile(archive) as good, zipfile.ZipFile(changed, "w") as bad:
        for name in good.namelist():
            text = good.read(name).decode()
            assert name != "blender_manifest.toml" or old in text
            bad.writestr(name, text.replace(old, new) if name == "blender_manifest.toml" else text)
    with pytest.raises(SystemExit, match="refuses"):
        validate(changed, str(blender.python))
