"""Frames whose views are files of their own: a frame is there when all of them are."""

import numpy as np

from lightdepth.film.frame import Frame
from lightdepth.film.layers import write_frame, write_picture
from lightdepth.scene.frames import SceneFrames
from lightdepth.sequence.fingerprint import FINGERPRINT, State
from lightdepth.sequence.numbering import FrameFiles
from lightdepth.sequence.rendering import SequenceJob, SequenceRendering
from lightdepth.session.session import Job
from tests.cli.room_folder import edit, make_room


def test_a_frame_without_one_of_its_views_is_missing(tmp_path):
    scene = make_room(tmp_path)
    edit(scene, "[panorama]", "[sequence]\nframes = [1, 1]\n\n[panorama]")
    with scene.open("a") as file:
        file.write('\n[camera.dome]\ntype = "dome_stereo"\nwidth = 8\n')
    frames = SceneFrames(scene)
    job = SequenceJob([1], FrameFiles(tmp_path / "shot.####.exr"), Job(camera="dome"))
    rendering = SequenceRendering(frames, job, "cpu", lambda event: None)
    black, bare = np.zeros((16, 8, 3), np.float32), np.zeros((16, 8), np.float32)
    topology = frames.scene(1).cameras["dome"].topology
    facts = {FINGERPRINT: rendering._print(1)}
    frame = Frame(black + 1, black, black, bare, bare + 1, metadata=facts, topology=topology)
    write_picture(tmp_path / "shot.0001.png", frame)
    write_frame(tmp_path / "shot.0001.exr", frame)
    assert rendering.states() == {1: State.CURRENT}
    (tmp_path / "shot.right.0001.exr").unlink()
    assert rendering.states() == {1: State.MISSING}
