"""A chrome ball in a path-traced room: the panorama from one and two photographs against the true one at its centre."""

import json
from dataclasses import replace

import numpy as np
import pytest
from bench.places.objects import Matte, ball
from typer.testing import CliRunner

from lightdepth.cameras import Perspective
from lightdepth.cli.app import app
from lightdepth.directions import look_at_rotation, pixel_directions, rotation_to_euler
from lightdepth.film.rendering import render
from lightdepth.images.beauty import read_beauty
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.scene.model import CameraView, Panorama, RenderSettings, Scene
from tests.support import mirror_ball as support
from tests.support import textured_room as room

pytestmark = pytest.mark.truth
WIDTH, FOV, PANORAMA = 800, 8.0, 512
"""The ball has a radius of 240 pixels."""
