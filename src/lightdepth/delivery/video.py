"""Encoding frames as a video by FFmpeg's encoders, which PyAV brings."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, SetupError
from lightdepth.packages import optional_package

EXTRA = "video"


@dataclass(frozen=True)
class Codec:
    """An encoder and how it is set.

    Attributes:
        encoder: FFmpeg's name.
        pixels: format of the pixels it gets.
        files: suffixes of the files that may hold it.
        quality: its constant quality, lower is better; ``None`` where it has none.
        options: further settings.
        tag: its name in the file, where players know it by another than FFmpeg's.
        even: width and height must be even.
    """

    encoder: str
    pixels: str
    files: tuple[str, ...]
    quality: int | None
    options: dict[str, str]
    tag: str | None = None
    even: bool = True


CODECS = {
    "h264": Codec("libx264", "yuv420p", (".mp4", ".mov"), 16, {"preset": "medium"}),
    "hevc": Codec("libx265", "yuv420p10le", (".mp4", ".mov"), 18, {"preset": "medium", "x265-params": ""}, "hvc1"),
    "av1": Codec("libsvtav1", "yuv420p10le", (".mp4",), 24, {"preset": "6"}),
    "prores": Codec("prores_ks", "yuv444p10le", (".mov",), None, {"profile": "4444", "vendor": "apl0"}, even=False),
}
"""The codecs by name; all but ``h264`` have 10 bits a channel."""


@dataclass(frozen=True)
class ColourTags:
    """How a video's numbers are meant, by the numbers of ITU-T H.273.

    Attributes:
        primaries: of red, green and blue.
        transfer: from light to numbers.
        matrix: from R, G, B to luma and chroma.
    """

    primaries: int
    transfer: int
    matrix: int


REC709 = ColourTags(1, 1, 1)
REC2100_PQ = ColourTags(9, 16, 9)
_SWSCALE_MATRICES = {1: 1, 9: 9}
"""FFmpeg's scaler has its own numbers for the matrices."""

_LAYOUTS = {1: "mono", 2: "stereo", 6: "5.1", 8: "7.1"}
"""What sound files may hold, by the number of their channels."""


def find_codec(name: str, file: Path, size: tuple[int, int]) -> Codec:
    """The codec of this name, after looking whether it can do what is asked for.

    Args:
        name: out of ``CODECS``.
        file: the video that is to be written.
        size: width and height in pixels.

    Raises:
        InputError: there is no such codec, the kind of file cannot hold it, or it cannot have that size.
        SetupError: PyAV is not installed, or was built without the encoder.
    """
    if name not in CODECS:
        raise InputError(f"--codec '{name}': allowed are {', '.join(CODECS)}")
    codec = CODECS[name]
    if file.suffix.lower() not in codec.files:
        raise InputError(
            f"-o {file}: '{file.suffix}' is not allowed for the codec {name}; allowed: {', '.join(codec.files)}"
        )
    if codec.even and (size[0] % 2 or size[1] % 2):
        raise InputError(
            f"the frames have {size[0]} x {size[1]} pixels; the codec {name} needs an even width and height: render "
            "another size, or use prores"
        )
    av = optional_package("av", EXTRA)
    try:
        av.codec.Codec(codec.encoder, "w")
    except (ValueError, av.error.FFmpegError) as error:
        others = ", ".join(other for other in CODECS if other != name)
        raise SetupError(
            f"the installed PyAV {av.__version__} has no encoder {codec.encoder} for {name}; use another codec "
            f"({others}), or install PyAV from PyPI: pip install 'lightdepth[{EXTRA}]'"
        ) from error
    return codec


def encode(
    target: Path,
    pictures: Iterable[NDArray[np.uint16]],
    size: tuple[int, int],
    rate: Fraction,
    codec: Codec,
    quality: int | None = None,
    tags: ColourTags = REC709,
    audio: Path | None = None,
    progress: Callable[[], None] = lambda: None,
    name: Path | None = None,
) -> None:
    """Write a video.

    Args:
        target: the file; it is overwritten, and unfinished where this raises.
        pictures: display values R, G, B, shape (height, width, 3), uint16.
        size: their width and height in pixels.
        rate: frames per second.
        codec: by :func:`find_codec`.
        quality: constant quality instead of the codec's own; lower is better.
        tags: what the display values are.
        audio: a sound file; it is cut where the pictures end.
        progress: called after each picture.
        name: of the file in messages, where ``target`` is a temporary one.

    Raises:
        InputError: a setting is not accepted, or the sound cannot be read.
    """
    av = optional_package("av", EXTRA)
    options = dict(codec.options)
    if codec.quality is not None:
        options["crf"] = str(codec.quality if quality is None else quality)
    if "x265-params" in options:  # It would report on standard error.
        options["x265-params"] = "log-level=error"
    if codec.encoder == "prores_ks":
        options["color_range"] = "tv"
    try:
        with _quiet(av), _opened(av, target, "w") as output:
            stream = output.add_stream(codec.encoder, rate=rate, options=options)
            stream.width, stream.height = size
            stream.pix_fmt = codec.pixels
            stream.time_base = 1 / rate
            context = stream.codec_context
            context.color_primaries, context.color_trc = tags.primaries, tags.transfer
            context.colorspace, context.color_range = tags.matrix, 1
            if codec.tag is not None:
                context.codec_tag = codec.tag
            sound = None if audio is None else _Sound(av, audio, output)
            for count, picture in enumerate(pictures):
                frame = _frame(av, picture, codec, tags)
                frame.pts, frame.time_base = count, 1 / rate
                output.mux(stream.encode(frame))
                if sound is not None:
                    sound.until((count + 1) / rate)
                progress()
            output.mux(stream.encode(None))
            if sound is not None:
                sound.finish()
    except av.error.FFmpegError as error:
        raise InputError(f"{name or target}: cannot be encoded ({_reason(error)})") from error


def _frame(av: Any, picture: NDArray[np.uint16], codec: Codec, tags: ColourTags) -> Any:
    frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb48le")
    # Without these words the scaler takes the matrix of standard definition, which shifts every colour.
    frame = frame.reformat(
        format=codec.pixels,
        dst_colorspace=_SWSCALE_MATRICES[tags.matrix],
        src_color_range="JPEG",
        dst_color_range="MPEG",
    )
    frame.colorspace, frame.color_range = tags.matrix, 1
    with suppress(AttributeError):
        frame.color_primaries, frame.color_trc = tags.primaries, tags.transfer
    return frame


class _Sound:
    """A sound file, encoded as AAC beside the pictures."""

    def __init__(self, av: Any, path: Path, output: Any) -> None:
        self._av, self._path, self._output = av, path, output
        self._input = _opened(av, path, "r")
        if not self._input.streams.audio:
            self._input.close()
            raise InputError(f"--audio {path}: holds no sound")
        source = self._input.streams.audio[0]
        layout, rate = _LAYOUTS.get(source.codec_context.channels), 48000
        if layout is None:
            self._input.close()
            raise InputError(
                f"--audio {path}: has {source.codec_context.channels} channels; allowed are "
                f"{', '.join(f'{count} ({name})' for count, name in _LAYOUTS.items())}"
            )
        self._stream = output.add_stream("aac", rate=rate, layout=layout)
        self._stream.bit_rate = 128_000 * max(source.codec_context.channels, 2)
        self._resampler = av.AudioResampler(format="fltp", layout=layout, rate=rate)
        self._frames = self._input.decode(source)
        self._rate, self._position, self._ended = rate, 0, False

    def until(self, second: Fraction) -> None:
        """Encode what is heard before this time."""
        while not self._ended and self._position < second * self._rate:
            try:
                decoded = next(self._frames)
            except (StopIteration, self._av.error.EOFError):
                self._ended = True
                break
            except self._av.error.FFmpegError as error:
                raise InputError(f"--audio {self._path}: cannot be read ({_reason(error)})") from error
            decoded.pts = None
            for frame in self._resampler.resample(decoded):
                self._put(frame)

    def _put(self, frame: Any) -> None:
        frame.pts, frame.time_base = self._position, Fraction(1, self._rate)
        self._position += frame.samples
        self._output.mux(self._stream.encode(frame))

    def finish(self) -> None:
        """Encode what is left in the encoder."""
        self._output.mux(self._stream.encode(None))
        self._input.close()


def _opened(av: Any, path: Path, mode: str) -> Any:
    if mode == "r" and not path.is_file():
        raise InputError(f"--audio {path}: no such file")
    try:
        return av.open(str(path), mode)
    except av.error.FFmpegError as error:
        what = f"--audio {path}: not a readable sound file" if mode == "r" else f"{path}: cannot be written"
        raise InputError(f"{what} ({_reason(error)})") from error


class _quiet:  # noqa: N801 - a context manager
    """Keep the encoders from writing their reports to standard error."""

    def __init__(self, av: Any) -> None:
        self._logging = av.logging

    def __enter__(self) -> None:
        os.environ.setdefault("SVT_LOG", "1")  # Errors only; it has no other switch.
        self._before = self._logging.get_level()
        self._logging.set_level(self._logging.PANIC)

    def __exit__(self, *_: object) -> None:
        self._logging.set_level(self._before)


def _reason(error: Any) -> str:
    """What FFmpeg says of an error: its last words are more exact than its number."""
    log = getattr(error, "log", None)
    return str(log[2]).strip() if log else str(error.strerror or error)
