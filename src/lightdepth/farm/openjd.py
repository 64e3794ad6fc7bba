"""Open Job Description: a bundle that AWS Deadline Cloud and other engines take.

Specification ``jobtemplate-2023-09`` with its extension ``TASK_CHUNKING`` (github.com/OpenJobDescription).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from lightdepth.errors import InputError
from lightdepth.farm.shot import Shot
from lightdepth.images.writing import whole_file
from lightdepth.numbered_files import told_frames

MOST_IN_A_CHUNK = 150
"""Frames, by the specification."""


def write_bundle(folder: Path, shot: Shot) -> None:
    """Write ``template.json``, ``parameter_values.json`` and ``asset_references.json``.

    Args:
        folder: where to; it is made.
        shot: what to render.

    Raises:
        InputError: the folder cannot be written, or a chunk has more frames than the specification allows.
    """
    if shot.chunk > MOST_IN_A_CHUNK:
        raise InputError(f"--chunk {shot.chunk}: Open Job Description allows at most {MOST_IN_A_CHUNK} frames")
    values = _values(shot)
    assets = {
        "inputs": {"filenames": [str(shot.scene)], "directories": [str(shot.scene.parent)]},
        "outputs": {"directories": [values["OutputFolder"]]},
        "referencedPaths": [],
    }
    contents: dict[str, Any] = {
        "template.json": _template(shot),
        "parameter_values.json": {
            "parameterValues": [{"name": name, "value": value} for name, value in values.items()]
        },
        "asset_references.json": {"assetReferences": assets},
    }
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created ({error.strerror})") from error
    for name, content in contents.items():
        with whole_file(folder / name) as temporary:
            temporary.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def _values(shot: Shot) -> dict[str, str]:
    pattern = shot.files.pattern
    return {
        "Scene": str(shot.scene),
        "OutputFolder": str(pattern.parent),
        "OutputName": pattern.name,
        "Frames": told_frames(shot.frames),
        "ChunkSize": str(shot.chunk),
        "Lightdepth": "lightdepth",
    }


def _template(shot: Shot) -> dict[str, Any]:
    def parameter(name: str, kind: str, description: str, **more: Any) -> dict[str, Any]:
        return {"name": name, "type": kind, "description": description, **more}

    values = _values(shot)
    arguments = shot.arguments("{{Param.Scene}}", "{{Task.Param.Frame}}", "{{Param.OutputFolder}}/{{Param.OutputName}}")
    consecutive = len(shot.frames) == shot.frames[-1] - shot.frames[0] + 1
    frame = {
        "name": "Frame",
        "type": "CHUNK[INT]",
        "range": "{{Param.Frames}}",
        "chunks": {
            "defaultTaskCount": "{{Param.ChunkSize}}",
            "rangeConstraint": "CONTIGUOUS" if consecutive else "NONCONTIGUOUS",
        },
    }
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "extensions": ["TASK_CHUNKING"],
        "name": f"lightdepth {shot.scene.stem}"[:64],
        "parameterDefinitions": [
            parameter("Scene", "PATH", "The scene file.", objectType="FILE", dataFlow="IN"),
            parameter("OutputFolder", "PATH", "Where frames go.", objectType="DIRECTORY", dataFlow="OUT"),
            parameter("OutputName", "STRING", "Their name, with # for digits.", default=values["OutputName"]),
            parameter("Frames", "STRING", "Which frames.", default=values["Frames"]),
            parameter(
                "ChunkSize", "INT", "Frames at a time.", default=shot.chunk, minValue=1, maxValue=MOST_IN_A_CHUNK
            ),
            parameter("Lightdepth", "STRING", "The command on the workers.", default=values["Lightdepth"]),
        ],
        "steps": [
            {
                "name": "Render",
                "parameterSpace": {"taskParameterDefinitions": [frame]},
                "script": {"actions": {"onRun": {"command": "{{Param.Lightdepth}}", "args": arguments}}},
            }
        ],
    }
