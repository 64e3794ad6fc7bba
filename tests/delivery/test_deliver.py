"""What `deliver` writes, as other programs read it: ffprobe, exiftool, FFmpeg's decoders, OpenImageIO."""

import json
import re
import shutil
import subprocess
import warnings
import wave
from dataclasses import replace
from fractions import Fraction

import numpy as np
import OpenImageIO
import pytest
from PIL import Image

from lightdepth.cameras.topology import Flat, Rectangle, Spherical
from lightdepth.delivery.spherical import Sphere, mark_spherical
from lightdepth.delivery.video import CODECS, find_codec
from lightdepth.directions import euler_rotation
from lightdepth.errors import InputError, InputWarning, SetupError
from lightdepth.film.frame import Frame
from lightdepth.film.layers import write_frame
from lightdepth.images.gpano import photo_sphere_xmp, read_photo_sphere
from lightdepth.images.tonemapping import tone_map

COUNT = 4
RATE = Fraction(24000, 1001)
CAMERAS = {
    "pano": {"type": "equirectangular", "width": 128},
    "ods": {"type": "ods", "width": 128, "layout": "top-bottom"},
    "side": {"type": "ods", "width": 256, "layout": "side-by-side"},
    "dome": {"type": "fisheye", "width": 64, "fov": 180.0, "mapping": "equidistant"},
    "master": {"type": "dome_master", "width": 64, "fov": 180.0, "tilt": 15.0},
    "view": {"type": "perspective", "width": 96, "height": 64},
    "odd": {"type": "perspective", "width": 97, "height": 65},
}
SIZES = {
    "pano": (128, 64),
    "ods": (128, 128),
    "side": (256, 64),
    "dome": (64, 64),
    "master": (64, 64),
    "view": (96, 64),
    "odd": (97, 65),
}
ORANGE = np.float32([0.8, 0.2, 0.05])


def picture(width, height, number):
    """Flat colour with a brighter square that moves; columns of a red wedge tell left from right."""
    plate = np.empty((height, width, 3), np.float32)
    plate[:] = ORANGE
    plate[height // 2 :, :, 2] = np.linspace(0.0, 1.0, width)
    plate[:8, 8 * number : 8 * number + 8] = 20.0
    return plate


@pytest.fixture(scope="module")
def shots(tmp_path_factory):
    """Folder with frames 3 to 6 of each camera."""
    folder = tmp_path_factory.mktemp("shots")
    for name, (width, height) in SIZES.items():
        for number in range(3, 3 + COUNT):
            none = np.zeros((height, width, 3), np.float32)
            flat = np.zeros((height, width), np.float32)
            facts = {"camera": json.dumps(CAMERAS[name]), "exposure": "-0.5", "frame": str(number)}
            world_to_camera = np.eye(4, dtype=np.float32)
            world_to_camera[:3, :3] = euler_rotation([0, 0, -40])[:, [0, 2, 1]]
            whole = Spherical((Rectangle(0, height, 0, width),)) if name == "pano" else Flat(width, height)
            frame = Frame(
                picture(width, height, number), none, none, flat, flat + 1, metadata=facts,
                matrices={"worldToCamera": world_to_camera}, topology=whole,
            )  # fmt: skip
            write_frame(folder / f"{name}.{number:04}.exr", frame, [], RATE)
            if name == "master":
                write_frame(folder / f"silent.{number:04}.exr", frame, [])
    with wave.open(str(folder / "tone.wav"), "wb") as sound:
        sound.setparams((2, 2, 44100, 0, "NONE", ""))
        tone = 8000 * np.sin(np.arange(44100) * 2 * np.pi * 440 / 44100)
        sound.writeframes(np.repeat(tone.astype("<i2"), 2).tobytes())
    return folder


def probed(path):
    if shutil.which("ffprobe") is None:
        pytest.skip("ffprobe is not installed (Debian: apt install ffmpeg)")
    run = subprocess.run(
        ["ffprobe", "-v", "warning", "-show_streams", "-of", "json", str(path)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stderr == ""
    return {stream["codec_type"]: stream for stream in json.loads(run.stdout)["streams"]}


def side_data(stream):
    return {data["side_data_type"]: data for data in stream.get("side_data_list", [])}


def decoded(path):
    """The pictures, R, G, B in [0, 1], as FFmpeg's decoders have them."""
    av = pytest.importorskip("av", reason="PyAV is not installed (extra video)")
    with av.open(str(path)) as file:
        return [_from_bt709(*map(_plane, frame.planes, [frame] * 3)) for frame in file.decode(video=0)]


def _plane(plane, frame):
    """In units of 8 bits, chroma as large as luma."""
    bits = frame.format.components[0].bits
    values = np.frombuffer(bytes(plane), np.uint8 if bits == 8 else np.uint16).reshape(plane.height, -1)
    values = values[:, : plane.width].astype(np.float32) / 2 ** (bits - 8)
    factor = frame.width // plane.width
    return values.repeat(factor, 0).repeat(factor, 1)


def _from_bt709(y, blue, red):
    """R, G, B of limited range Y, Cb, Cr: FFmpeg's own way back is not exact."""
    y, blue, red = (y - 16) / 219, (blue - 128) / 224 * 1.8556, (red - 128) / 224 * 1.5748
    r, b = y + red, y + blue
    return np.stack([r, (y - 0.2126 * r - 0.0722 * b) / 0.7152, b], axis=-1)


def heard(path):
    """The sound's effective value: it lies where the moved index says."""
    import av

    with av.open(str(path)) as file:
        blocks = [frame.to_ndarray() for frame in file.decode(audio=0)]
    return np.sqrt(np.mean(np.concatenate(blocks, axis=1)[:, 2048:6000] ** 2))


def delivered(command, *arguments):
    status, _, errors = command("deliver", *map(str, arguments))
    assert status == 0, errors
    return errors


def expected(width, height, number):
    return tone_map(picture(width, height, number), -0.5).astype(np.float32) / 255


@pytest.fixture
def has_video():
    pytest.importorskip("av", reason="PyAV is not installed (extra video)")


@pytest.mark.parametrize(
    ("codec", "suffix", "found"),
    [
        ("h264", ".mp4", ("h264", "yuv420p", "avc1")),
        ("hevc", ".mp4", ("hevc", "yuv420p10le", "hvc1")),
        ("av1", ".mp4", ("av1", "yuv420p10le", "av01")),
        ("prores", ".mov", ("prores", "yuv444p12le", "ap4h")),
    ],
)
def test_a_spherical_video_of_each_codec(shots, tmp_path, command, has_video, codec, suffix, found):
    target = tmp_path / f"shot{suffix}"
    delivered(
        command, shots / "pano.####.exr", "--as", "360", "-o", target, "--codec", codec, "--audio", shots / "tone.wav"
    )
    assert [path.name for path in tmp_path.iterdir()] == [target.name]
    pictures = decoded(target)
    assert len(pictures) == COUNT
    for number, pixels in enumerate(pictures, 3):
        wanted = expected(128, 64, number)
        assert np.median(np.abs(pixels - wanted)) < 0.01
        flat = np.s_[12:28, 8:120]  # Another matrix than is stated would be 0.03 off.
        np.testing.assert_allclose(pixels[flat].mean((0, 1)), wanted[flat].mean((0, 1)), atol=0.005)
        bright = pixels[2:6].mean(axis=(0, 2))
        assert 8 * number <= np.argmax(bright) < 8 * number + 8
    assert heard(target) == pytest.approx(8000 / 32768 / np.sqrt(2), rel=0.05)
    streams = probed(target)
    video = streams["video"]
    assert (video["codec_name"], video["pix_fmt"], video["codec_tag_string"]) == found
    assert (video["avg_frame_rate"], int(video["nb_frames"])) == ("24000/1001", COUNT)
    assert {video[f"color_{name}"] for name in ("space", "transfer", "primaries")} == {"bt709"}
    assert video["color_range"] == "tv"
    assert side_data(video)["Spherical Mapping"]["projection"] == "equirectangular"
    assert side_data(video)["Stereo 3D"]["type"] == "2D"
    sound = streams["audio"]
    assert (sound["codec_name"], sound["channels"]) == ("aac", 2)
    assert float(sound["duration"]) == pytest.approx(float(COUNT / RATE), abs=0.06)


@pytest.mark.parametrize(
    ("shot", "kind", "size", "stereo", "bounds"),
    [
        ("ods", "360-stereo", (128, 128), "top and bottom", None),
        ("side", "360-stereo", (256, 64), "side by side", None),
        ("ods", "vr180", (128, 64), "side by side", (32, 31)),
        ("side", "vr180", (128, 64), "side by side", (32, 31)),
    ],
)
def test_stereo(shots, tmp_path, command, has_video, shot, kind, size, stereo, bounds):
    target = tmp_path / "shot.mp4"
    delivered(command, shots / f"{shot}.####.exr", "--as", kind, "-o", target)
    video = probed(target)["video"]
    assert (video["width"], video["height"]) == size
    found = side_data(video)
    assert found["Stereo 3D"]["type"] == stereo
    mapping = found["Spherical Mapping"]
    if bounds is None:
        assert mapping["projection"] == "equirectangular"
    else:  # A quarter of the sphere is missing on either side of each eye.
        assert mapping["projection"] == "tiled equirectangular"
        assert mapping["bound_left"] + mapping["bound_right"] == pytest.approx(size[0], abs=2)
        source = expected(*SIZES[shot], 3)
        eye = source[:64, :128]
        other = source[64:] if shot == "ods" else source[:, 128:]
        wanted = np.concatenate((eye[:, 32:96], other[:, 32:96]), axis=1)
        assert np.abs(decoded(target)[0] - wanted)[34:, 4:60].max() < 0.06


def test_marks_in_files_of_other_programs(shots, tmp_path, has_video):
    """The index before the pictures, and the sound's track before theirs; what is no video is refused."""
    import av

    with av.open(str(tmp_path / "a.mp4"), "w", options={"movflags": "faststart"}) as file:
        sound, video = file.add_stream("aac", rate=48000, layout="mono"), file.add_stream("libx264", rate=25)
        video.width, video.height, video.pix_fmt = 64, 32, "yuv420p"
        for number in range(3):
            block = av.AudioFrame.from_ndarray(np.full((1, 1920), 0.1, np.float32), "fltp", "mono")
            block.sample_rate, block.pts = 48000, 1920 * number
            file.mux(sound.encode(block))
            file.mux(video.encode(av.VideoFrame.from_ndarray(np.full((32, 64, 3), 80 * number, np.uint8), "rgb24")))
        file.mux(sound.encode(None))
        file.mux(video.encode(None))
    whole = (tmp_path / "a.mp4").read_bytes()
    assert whole.index(b"moov") < whole.index(b"mdat")
    mark_spherical(tmp_path / "a.mp4", tmp_path / "b.mp4", Sphere("side-by-side"), "x")
    for before, after in zip(decoded(tmp_path / "a.mp4"), decoded(tmp_path / "b.mp4"), strict=True):
        np.testing.assert_array_equal(before, after)
    assert side_data(probed(tmp_path / "b.mp4")["video"])["Stereo 3D"]["type"] == "side by side"
    for damage in (b"", b"no video at all", whole[: len(whole) // 3], whole.replace(b"stsd", b"stsx")):
        (tmp_path / "c.mp4").write_bytes(damage)
        with pytest.raises(InputError, match="c.mp4: "):
            mark_spherical(tmp_path / "c.mp4", tmp_path / "d.mp4", Sphere(), "x")


def test_a_flat_video_has_no_marks(shots, tmp_path, command, has_video):
    delivered(
        command, shots / "view.####.exr", "--as", "video", "-o", tmp_path / "a.mp4", "--frames", "4-6", "--step", 2
    )
    assert side_data(probed(tmp_path / "a.mp4")["video"]) == {}
    assert len(decoded(tmp_path / "a.mp4")) == 2


@pytest.mark.parametrize(("suffix", "bits"), [(".png", 16), (".tif", 16), (".png", 8)])
def test_a_dome_master_is_numbered_and_described(shots, tmp_path, command, suffix, bits):
    arguments = [shots / "dome.####.exr", "--as", "dome-master", "--audio", shots / "tone.wav", "--fps", 29.97]
    with warnings.catch_warnings():
        warnings.simplefilter("always", InputWarning)  # As for users; here, warnings are errors.
        errors = delivered(command, *arguments, "-o", tmp_path / "out" / f"Show{suffix}", "--bits", bits)
    assert "64 x 64 pixels; domes expect 1024" in errors
    assert "its camera looks 0 degrees above the horizon" in errors
    frames = [f"Show_{number:05}{suffix}" for number in range(1, COUNT + 1)]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["Show.txt", "Show.wav", *frames]
    pixels = OpenImageIO.ImageBuf(str(tmp_path / "out" / frames[0]))
    assert pixels.spec().format == f"uint{bits}"
    np.testing.assert_allclose(pixels.get_pixels("float"), expected(64, 64, 3), atol=0.5 / 255 + 1e-5)
    text = (tmp_path / "out" / "Show.txt").read_text()
    for line in (
        "Resolution: 64 x 64",
        "Frames: 4, Show_00001 to Show_00004",
        "Frame rate: 29.97 per second (30000/1001)",
    ):
        assert line + "\n" in text


def test_a_dome_master_camera_needs_no_turn_to_the_zenith(shots, tmp_path, command):
    with warnings.catch_warnings():
        warnings.simplefilter("always", InputWarning)
        errors = delivered(command, shots / "master.####.exr", "--as", "dome-master", "-o", tmp_path / "Show.png")
    assert "above the horizon" not in errors
    assert "Dome tilt: 15 degrees\n" in (tmp_path / "Show.txt").read_text()


def test_a_single_frame_of_a_dome_needs_no_frame_rate(shots, tmp_path, command):
    with warnings.catch_warnings():
        warnings.simplefilter("always", InputWarning)
        delivered(command, shots / "silent.0003.exr", "--as", "dome-master", "-o", tmp_path / "Show.png")
    assert (tmp_path / "Show_00001.png").exists()
    text = (tmp_path / "Show.txt").read_text()
    assert "Frames: 1," in text
    assert "Frame rate" not in text
    status, _, errors = command("deliver", shots / "silent.####.exr", "--as", "dome-master", "-o", tmp_path / "Two.png")
    assert status == 2
    assert "the frames do not state their frame rate; give --fps" in errors


def exif(path):
    if shutil.which("exiftool") is None:
        pytest.skip("exiftool is not installed (Debian: apt install libimage-exiftool-perl)")
    run = subprocess.run(["exiftool", "-j", "-n", "-XMP:all", str(path)], capture_output=True, text=True, check=True)
    return json.loads(run.stdout)[0]


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_stills_say_that_they_are_panoramas(shots, tmp_path, command, suffix):
    delivered(command, shots / "pano.0003.exr", "--as", "stills", "-o", tmp_path / f"still{suffix}")
    found = exif(tmp_path / f"still{suffix}")
    assert (found["ProjectionType"], found["UsePanoramaViewer"]) == ("equirectangular", True)
    assert (found["FullPanoWidthPixels"], found["FullPanoHeightPixels"]) == (128, 64)
    assert (found["CroppedAreaLeftPixels"], found["CroppedAreaImageWidthPixels"]) == (0, 128)
    assert found["PoseHeadingDegrees"] == pytest.approx(40.0, abs=0.01)
    with Image.open(tmp_path / f"still{suffix}") as image:
        pixels = np.asarray(image) / np.float32(255)
    np.testing.assert_allclose(pixels[40:, 8:], expected(128, 64, 3)[40:, 8:], atol=0.03 if suffix == ".jpg" else 1e-6)


def test_stereo_stills_have_the_left_eye_on_top(shots, tmp_path, command):
    delivered(command, shots / "side.####.exr", "--as", "stills", "-o", tmp_path / "s.##.png", "--frames", "3,5")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["s.03.png", "s.05.png"]
    with Image.open(tmp_path / "s.05.png") as image:
        pixels = np.asarray(image) / np.float32(255)
    whole = expected(256, 64, 5)
    np.testing.assert_allclose(pixels, np.concatenate((whole[:, :128], whole[:, 128:])), atol=1e-6)
    assert exif(tmp_path / "s.05.png")["FullPanoHeightPixels"] == 128


@pytest.mark.parametrize("angles", [(0, 0, 0), (10, 0, 200), (0, -20, 0), (-35, 15, 80)])
def test_the_pose_is_read_back(angles):
    pitch, roll, heading = angles
    rotation = euler_rotation([0, 0, -heading]) @ euler_rotation([pitch, 0, 0]) @ euler_rotation([0, roll, 0])
    sphere = read_photo_sphere(photo_sphere_xmp(64, 32, rotation, "a & b"), 64, 32, "x")
    np.testing.assert_allclose(sphere.rotation, rotation, atol=1e-5)
    assert (sphere.full_width, sphere.left) == (64, 0)


def test_a_view_of_opencolorio(shots, tmp_path, command, monkeypatch):
    """The un-tone-mapped view of sRGB is the sRGB curve of the exposed radiance; the ACES view is not."""
    pytest.importorskip("PyOpenColorIO", reason="OpenColorIO is not installed (extra colour)")
    run = [shots / "view.0003.exr", "--as", "stills", "-o"]
    plain = ["--display", "sRGB - Display", "--view", "Un-tone-mapped"]
    delivered(command, *run, tmp_path / "plain.png", "--ocio", "ocio://default", *plain)
    linear = np.clip(picture(96, 64, 3) * 2**-0.5, 0, 1)
    curved = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    with Image.open(tmp_path / "plain.png") as image:
        np.testing.assert_allclose(np.asarray(image) / 255, curved, atol=0.6 / 255)
    monkeypatch.setenv("OCIO", "ocio://default")
    said = delivered(command, *run, tmp_path / "aces.png")
    assert "view 'ACES 2.0 - SDR 100 nits (Rec.709)'" in said
    with Image.open(tmp_path / "aces.png") as image:
        assert np.abs(np.asarray(image)[20, 40] / 255 - curved[20, 40]).max() > 0.05


def test_a_perceptual_quantiser_is_tagged(shots, tmp_path, command, has_video):
    pytest.importorskip("PyOpenColorIO", reason="OpenColorIO is not installed (extra colour)")
    hdr = ["--ocio", "ocio://default", "--display", "Rec.2100-PQ - Display"]
    delivered(command, shots / "view.####.exr", "--as", "video", "-o", tmp_path / "a.mp4", "--codec", "hevc", *hdr)
    video = probed(tmp_path / "a.mp4")["video"]
    assert (video["color_primaries"], video["color_transfer"], video["color_space"]) == (
        "bt2020", "smpte2084", "bt2020nc",
    )  # fmt: skip


def test_an_encoder_that_is_lacking_is_named(has_video, tmp_path, monkeypatch):
    """As in builds of FFmpeg that leave out what is patented."""
    monkeypatch.setitem(CODECS, "hevc", replace(CODECS["hevc"], encoder="libabsent"))
    with pytest.raises(SetupError, match=r"no encoder libabsent for hevc; use another codec \(h264, av1, prores\)"):
        find_codec("hevc", tmp_path / "x.mp4", (64, 64))


BAD = {
    "a missing frame": (["gap.####.exr", "--as", "video", "-o", "x.mp4"], "frames 4 are missing"),
    "another size": (["mixed.####.exr", "--as", "video", "-o", "x.mp4"], "has 97 x 65 pixels, but .* has 96 x 64"),
    "cut off": (["cut.####.exr", "--as", "video", "-o", "x.mp4"], "is incomplete"),
    "no frames": (["none.####.exr", "--as", "video", "-o", "x.mp4"], "no such file"),
    "frames outside": (["view.####.exr", "--as", "video", "-o", "x.mp4", "--frames", "1-4"], "frames 1-2 are missing"),
    "odd size": (["odd.####.exr", "--as", "video", "-o", "x.mp4"], "97 x 65 pixels; the codec h264 needs an even"),
    "unknown codec": (["view.####.exr", "--as", "video", "-o", "x.mp4", "--codec", "divx"], "allowed are h264, hevc"),
    "wrong suffix": (["view.####.exr", "--as", "video", "-o", "x.avi"], "'.avi' is not allowed for the codec h264"),
    "prores in mp4": (["view.####.exr", "--as", "video", "-o", "x.mp4", "--codec", "prores"], "allowed: .mov"),
    "flat as 360": (["view.####.exr", "--as", "360", "-o", "x.mp4"], "'perspective'; --as 360 needs 'equirectangular'"),
    "mono as stereo": (["pano.####.exr", "--as", "360-stereo", "-o", "x.mp4"], "--as 360-stereo needs 'ods'"),
    "dome of a view": (["view.####.exr", "--as", "dome-master", "-o", "x.png"], "needs 'fisheye' or 'dome_master'"),
    "dome as exr": (["dome.####.exr", "--as", "dome-master", "-o", "x.exr"], "'.exr' is not allowed; a dome master"),
    "no sound": (["view.####.exr", "--as", "video", "-o", "x.mp4", "--audio", "no.wav"], "no.wav: no such file"),
    "not sound": (["view.####.exr", "--as", "video", "-o", "x.mp4", "--audio", "view.0003.exr"], "--audio .*view.0003"),
    "rate": (["view.####.exr", "--as", "video", "-o", "x.mp4", "--fps", "fast"], "--fps fast: write it as 24"),
    "look": (["view.####.exr", "--as", "video", "-o", "x.mp4", "--look", "kodak"], "'kodak': allowed are agx-like"),
    "ocio": (["view.####.exr", "--as", "video", "-o", "x.mp4", "--ocio", "no.ocio"], "no.ocio: no such OpenColorIO"),
    "stills of one name": (["view.####.exr", "--as", "stills", "-o", "x.jpg"], "the name must have #"),
    "a folder": (["view.####.exr", "--as", "video", "-o", "tone.wav/x.mp4"], "cannot be written"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_writes_nothing(shots, tmp_path, command, monkeypatch, has_video, case):
    if case == "ocio":
        pytest.importorskip("PyOpenColorIO", reason="OpenColorIO is not installed (extra colour)")
    for file in [*shots.glob("[vodp]*.exr"), shots / "tone.wav"]:
        (tmp_path / file.name).symlink_to(file)
    for number, source in enumerate(("view.0003", "view.0004", "odd.0005"), 3):
        (tmp_path / f"mixed.{number:04}.exr").symlink_to(shots / f"{source}.exr")
    for number in (3, 5):
        (tmp_path / f"gap.{number:04}.exr").symlink_to(shots / f"view.{number:04}.exr")
        whole = (shots / f"view.{number:04}.exr").read_bytes()
        (tmp_path / f"cut.{number - 2:04}.exr").write_bytes(whole[:-100])
    (tmp_path / "cut.0002.exr").symlink_to(shots / "view.0003.exr")
    before = sorted(tmp_path.iterdir())
    monkeypatch.chdir(tmp_path)
    arguments, message = BAD[case]
    status, _, errors = command("deliver", *arguments)
    assert status == 2, errors
    assert "Traceback" not in errors
    assert re.search(message, errors), errors
    assert sorted(tmp_path.iterdir()) == before
