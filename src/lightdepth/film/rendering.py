"""Rendering a camera's image in passes that can be watched, stopped, saved and shared."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from itertools import islice
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.errors import InputError
from lightdepth.film.accumulation import Accumulator
from lightdepth.film.allocation import Allocation, Sharing
from lightdepth.film.auxiliary import render_auxiliary
from lightdepth.film.cryptomatte import shape_names
from lightdepth.film.frame import CAMERA, EXPOSURE, PLATE_GAIN, Frame
from lightdepth.film.header import view_matrices
from lightdepth.film.light_image import LightImage
from lightdepth.film.picture_error import PictureError
from lightdepth.film.pixel_list import PixelList
from lightdepth.film.plate import kept_plate, render_shares
from lightdepth.film.sampling import Sampling
from lightdepth.film.schedule import Region, Round, Target, passes, pilot_samples
from lightdepth.film.selection import influenced_pixels, shown_in_the_middle
from lightdepth.film.shared_errors import ListUse, SharedErrors
from lightdepth.film.sums import Origin, PixelSums, Share
from lightdepth.images.tonemapping import auto_exposure
from lightdepth.kernel.start import DEVICE_LOCK
from lightdepth.preparation import Prepared
from lightdepth.scene.identity import scene_digest, view_digest
from lightdepth.scene.model import Scene


@dataclass(frozen=True)
class Progress:
    """Progress of a rendering.

    Attributes:
        fraction: share of the work that is done, in [0, 1].
        samples: samples per pixel so far, on average over the pixels that are sampled.
        error: estimated relative error of these pixels, root mean square.
        seconds_left: estimated.
    """

    fraction: float
    samples: float
    error: float
    seconds_left: float


class Rendering:
    """The rendering of one camera's image.

    It can be stopped after any pass and continued, saved in between, and share its work with others: what it computes
    depends on its arguments, its targets and its samples so far alone. Several in several threads take turns.

    Args:
        scene: what to render.
        prepared: the same scene made ready for a method.
        view: the camera.
        method: its name, for the image's header.
        seed: of the random numbers; the same seed gives the same image.
        share: the part of the work to do; see :meth:`sums`.
        sharing: frames that will share the samples of matte support, which so needs fewer of them;
            see :mod:`lightdepth.sequence.temporal_reuse`. ``None`` is a picture of its own.

    Attributes:
        share: as given.
        plate: the photograph as the camera sees it, shape (height, width, 3), float32; in the unit of the image, which
            for the camera of a ``[plate]`` is the plate's, and for all others that of the panorama.
        alpha: where there is one, shape (height, width), float32.
        pixels: that are sampled, row-major indices, ascending, shape (n,), uint32.
        errors: estimates how far these are off.
    """

    def __init__(
        self,
        scene: Scene,
        prepared: Prepared,
        view: Viewpoint,
        method: str,
        seed: int,
        share: Share = Share(),  # noqa: B008 - it is immutable
        sharing: int | None = None,
    ) -> None:
        self._scene, self._prepared, self._view, self._method, self._seed = scene, prepared, view, method, seed
        self.share, self._parameters = share, scene.render.parameters.film
        with DEVICE_LOCK:
            # What is sampled is in the unit of the panoramas; the image of the plate's camera, in that of the plate.
            own = prepared.place.plate
            self._own = own if own is not None and view.same_pixels(own.view) else None
            if self._own is None:
                self.plate, self.alpha = kept_plate(
                    view, scene.panoramas, prepared, scene.render.draft, self._parameters
                )
            else:
                self.plate, self.alpha = self._own.radiance.copy(), np.ones(self._own.radiance.shape[:2], np.float32)
            self.pixels = influenced_pixels(view, prepared, self._parameters.selection_tile)
            self._list = PixelList(view, self.pixels)
            plate = (self.plate if self._own is None else self._own.scaled).reshape(-1, 3)
            light_tracer = prepared.integrator.light_tracer
            self._light = None
            if light_tracer is not None:
                self._light = LightImage(light_tracer, view, self.pixels, seed, share, self._parameters)
            self._accumulator = Accumulator(plate, self.pixels, self._light)
            self._sampling = Sampling(
                prepared, view, self.pixels, self._accumulator, self._light, seed, share, self._parameters
            )
            some = plate[self.pixels[:: max(1, len(self.pixels) >> 16)]]
            self.errors = PictureError(prepared, self._sampling, self._accumulator, some, seed, self._parameters)
            # What the preparation used is worth more to what follows than to Dr.Jit's own cache.
            dr.flush_malloc_cache()
        self._support, shared = None, None
        if sharing is not None:
            with DEVICE_LOCK:
                self._support, unchanged = shown_in_the_middle(view, prepared)
            frames = np.where(self._support.reshape(-1)[self.pixels], np.int32(sharing), np.int32(1))
            shared = Sharing(frames, unchanged.reshape(-1)[self.pixels])
        self._allocation = Allocation(self._list, self._accumulator, self.errors, self._parameters, shared)
        self._round: Round | None = None
        self._digests: tuple[str, str] | None = None

    def run(self, samples: int, noise: float | None = None, region: Region | None = None) -> Iterator[Progress]:
        """Take samples, yielding after every pass; to stop early, stop iterating.

        Called again with the same arguments it continues where it was stopped, to the same image as without the stop. With
        more ``samples`` than before it adds the missing ones.

        Args:
            samples: per pixel that is sampled, on average.
            noise: relative error at which a pixel is done; ``samples`` is then the largest number for any pixel.
            region: sample only pixels in these columns and rows, (left, top, right, bottom), the last two beyond.

        Raises:
            InputError: the arguments are out of range, or a share is to follow a ``noise``.
        """
        target = Target(samples, noise, region)
        if noise is not None and self.share.count > 1:
            raise InputError(
                f"share {self.share}: the samples that `noise` takes depend on all shares; give samples alone"
            )
        return self._run(target)

    def _run(self, target: Target) -> Iterator[Progress]:
        start, spent = time.monotonic(), self._spent()
        if self._round is None or self._round.target != target:
            self._round = self._allocation.pilot_round(target)
        while True:
            this = self._round
            for slots, counts in islice(passes(this.wanted, self._parameters), this.begun, None):
                self._sampling.take(slots, counts, everywhere=this.pilot)
                self.errors.outdate()
                this.begun += 1
                done, elapsed = self._spent(), time.monotonic() - start
                fraction = min(done / self._work(this), 1.0)
                left = elapsed * (1 - fraction) * done / max(fraction * (done - spent), 1e-30)
                yield Progress(fraction, done / len(self.pixels), self.errors.watched(), left)
            self.errors.estimate_shared(self.share)
            following = self._allocation.next_round(this)
            if following is None:
                break
            self._round = following
        yield Progress(1.0, self._spent() / max(len(self.pixels), 1), self.errors.overall(), 0.0)

    def _spent(self) -> int:
        return int(self._accumulator.taken.sum(dtype=np.int64))

    def _work(self, this: Round) -> float:
        """Samples that this process will have taken when all is done."""
        if self.share.count == 1:
            return max(this.total, 1)
        pilot = pilot_samples(this.target.samples, self._parameters) * len(self.pixels)
        return max(pilot + (this.total - pilot) / self.share.count, 1)

    def complete(
        self,
        samples: int | None = None,
        noise: float | None = None,
        progress: Callable[[Progress], bool | None] | None = None,
        auxiliary: bool = True,
    ) -> Frame:
        """Take all samples and return the image, which takes over the rendering's memory; it cannot continue.

        Args:
            samples: as for :meth:`run`; the scene's own setting by default.
            noise: as for :meth:`run`; the scene's own setting by default.
            progress: called after every pass; where it returns true, the image is that of the samples so far.
            auxiliary: with object ids, depth, normals and albedo as well.

        Raises:
            InputError: as for :meth:`run`.
        """
        for step in self.run(*self.target(samples, noise)):
            if progress is not None and progress(step):
                break
        return self.frame(auxiliary, finish=True)

    def target(self, samples: int | None = None, noise: float | None = None) -> tuple[int, float | None]:
        """The first two arguments for :meth:`run`, with the scene's own settings in place of ``None``."""
        settings = self._scene.render
        return settings.samples if samples is None else samples, settings.noise if noise is None else noise

    def frame(self, auxiliary: bool = True, finish: bool = False) -> Frame:
        """The image so far.

        Args:
            auxiliary: with object ids, depth, normals and albedo as well.
            finish: the image takes over the rendering's memory, which cannot continue.
        """
        with DEVICE_LOCK:
            return self._frame(auxiliary, finish)

    def _frame(self, auxiliary: bool, finish: bool) -> Frame:
        facts = self._facts()
        if finish:
            self._round = None  # Of a large image, what was wanted of each pixel counts.
        taken = self._accumulator.taken if finish else self._accumulator.taken.copy()
        means = dict(vars(self._accumulator.estimates(finish)))
        for name in list(means):  # One by one, so that a large image is never there twice as a whole.
            means[name] = self._list.scattered(means.pop(name))
            if self._own is not None and name != "coverage":
                means[name] *= self._own.gain**2 if name == "variance" else self._own.gain
            if finish:
                dr.flush_malloc_cache()
        frame = Frame(
            plate=self.plate,
            alpha=self.alpha,
            **means,
            samples=self._list.scattered(taken),
            metadata=facts,
            matrices=view_matrices(self._view, self._scene.panorama.viewpoint),
            object_names=tuple(thing.name for thing in self._scene.synthetic),
            topology=self._view.topology,
            support=self._support,
        )
        if auxiliary:
            names = shape_names(self._scene.synthetic)
            picture = None if self._own is None else self._own.scaled
            seen = render_auxiliary(self._view, self._prepared, names, frame.coverage, self._parameters, picture)
            frame.mattes, frame.depth, frame.normal, frame.albedo = seen.mattes, seen.depth, seen.normal, seen.albedo
            frame.photograph = (
                None if self._own is not None else render_shares(self._view, self._prepared.place, self._parameters)
            )
            owners = [index for index, _ in self._prepared.shapes]
            frame.object_id = seen.mattes.dominant(frame.coverage.size, owners).reshape(frame.coverage.shape)
        if finish:
            dr.flush_malloc_cache()  # To write a large image takes memory as well.
        return frame

    def origin(self, samples: int) -> Origin:
        """Which picture this is, for ``samples`` samples a pixel."""
        if self._digests is None:
            self._digests = scene_digest(self._scene), view_digest(self._view)
        scene, view = self._digests
        path = "" if self._scene.path is None else str(self._scene.path)
        size, version = self._view.resolution, metadata.version("lightdepth")
        camera = next((name for name, each in self._scene.cameras.items() if each is self._view), "")
        draft = self._scene.render.draft
        return Origin(scene, view, self._method, self._seed, size, samples, version, path, camera, draft)

    def sums(self) -> PixelSums:
        """The sums so far of this share's pixels, and of its light paths for all pixels.

        Where a region alone was sampled, they are of this region.
        """
        named, light_count = self._all_sums()
        named = {name: values.copy() for name, values in named.items()}
        taken, mine = self._accumulator.taken.copy(), self.share.owns(np.arange(len(self.pixels)))
        for name in ("change", "synthetic", "squares", "covered"):
            named[name][~mine] = 0.0
        taken[~mine] = 0
        samples = 0 if self._round is None else self._round.target.samples
        share = self.share
        named |= {"pixels": self.pixels.copy(), "taken": taken}
        sums = PixelSums(
            self.origin(samples),
            (share.index,),
            share.count,
            **named,
            light_count=light_count,
            light_list_error=self.errors.light_list(),
            cache_error=self.errors.shared.cache,
            regions=(),
        )
        region = None if self._round is None else self._round.target.region
        if region is not None:
            part = sums.within(region)
            if part.taken.sum(dtype=np.int64) == taken.sum(dtype=np.int64):
                return part
        return sums

    def adopt(self, sums: PixelSums) -> None:
        """Replace the sums, by merged ones for example.

        Raises:
            InputError: they are of another picture.
        """
        self._must_be_this(sums.origin.difference(self.origin(sums.origin.samples)))
        if not np.array_equal(sums.pixels, self.pixels):
            self._must_be_this("other pixels")
        with DEVICE_LOCK:
            self._accumulator.restore(sums.taken, sums.arrays())
            if self._light is not None:
                self._light.restore(sums.arrays(), sums.light_count, sums.light_count, 0)
        self._sampling.list_use = ListUse()
        known = sums.light_list_error > 0.0 or sums.cache_error > 0.0
        self.errors.shared = SharedErrors(sums.light_list_error, sums.cache_error, self._spent() if known else 0)
        self.errors.outdate()

    def _all_sums(self) -> tuple[dict[str, NDArray[Any]], int]:
        """The sums of all pixels by their name in :class:`PixelSums`, and how many light paths they are of."""
        with DEVICE_LOCK:
            named: dict[str, NDArray[Any]] = dict(self._accumulator.sums())
            if self._light is not None:
                light, count = self._light.sums()
                return named | light, count
        count = len(self.pixels)
        none = {"light_change": (count, 3), "light_synthetic": (count, 3), "light_squares": (count,)}
        return named | {name: np.zeros(shape, np.float32) for name, shape in none.items()}, 0

    def _must_be_this(self, difference: str | None) -> None:
        if difference is not None:
            raise InputError(f"the samples so far are of another picture: {difference}")

    def state(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Everything that the rest of this rendering depends on: plain values, and arrays by name. See :meth:`restore`.

        The arrays are views of its memory, to be used before it continues.
        """
        named, light_count = self._all_sums()
        named |= {"pixels": self.pixels, "taken": self._accumulator.taken}
        this = self._round
        sampling, sampled = self._sampling.state()
        header: dict[str, Any] = {
            "origin": vars(self.origin(0 if this is None else this.target.samples)),
            "share": [self.share.index, self.share.count],
            "light_count": light_count,
            "light_begun": 0 if self._light is None else self._light.begun,
            "light_blocks": 0 if self._light is None else self._light.blocks,
            "shared": list(vars(self.errors.shared).values()),
            "round": None if this is None else [vars(this.target), this.total, this.begun, this.pilot],
            **sampling,
        }
        if this is not None:
            named["wanted"] = this.wanted
        return header, named | sampled

    def restore(self, header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
        """Continue from a :meth:`state`, which may be another process's: the image becomes the same, bit for bit.

        Large arrays are taken out of ``arrays`` one by one.

        Raises:
            InputError: it is the state of another picture.
            KeyError, TypeError, ValueError: it is damaged.
        """
        origin = Origin(**{**header["origin"], "size": tuple(header["origin"]["size"])})
        self._must_be_this(origin.difference(self.origin(origin.samples)))
        if header["share"] != [self.share.index, self.share.count]:
            self._must_be_this("another share")
        if not np.array_equal(arrays["pixels"], self.pixels):
            self._must_be_this("other pixels")
        with DEVICE_LOCK:
            self._accumulator.restore(arrays["taken"], arrays)
            if self._light is not None:
                self._light.restore(arrays, *(int(header[f"light_{name}"]) for name in ("count", "begun", "blocks")))
        self._sampling.restore(header, arrays)
        self.errors.outdate()
        self.errors.shared = SharedErrors(*header["shared"])
        self._round = None
        if header["round"] is not None:
            target, total, begun, pilot = header["round"]
            region = None if target["region"] is None else tuple(target["region"])
            target = Target(target["samples"], target["noise"], region)
            self._round = Round(target, arrays["wanted"], int(total), int(begun), bool(pilot))

    def error(self) -> float:
        """Estimated relative error of the sampled pixels, root mean square: their noise and the shared errors."""
        return self.errors.overall()

    def _facts(self) -> dict[str, str]:
        """For the file's header: how the image was made, and what was simplified."""
        report = self._prepared.irradiance
        facts = {
            CAMERA: _settings(self._view),
            "method": self._method,
            "seed": str(self._seed),
            "samples": f"{self._accumulator.taken.mean():.1f}" if len(self.pixels) else "0",
            "error": f"{self.errors.overall():.5f}",
            "irradiance_error": f"{report.mean_error:.5f}",
            EXPOSURE: f"{auto_exposure(self._scene.panorama.radiance):.3f}",
        }
        if self._own is not None:
            facts[PLATE_GAIN] = " ".join(f"{value:.5g}" for value in self._own.gain)
            facts[EXPOSURE] = f"{float(facts[EXPOSURE]) - np.log2(self._own.gain.mean()):.3f}"
        if self.errors.shared.spent:
            facts |= {
                "light_list_error": f"{self.errors.light_list():.5f}",
                "radiance_cache_error": f"{self.errors.shared.cache:.5f}",
            }
        if self._scene.render.clamp_indirect is not None:
            facts["clamp_indirect"] = str(self._scene.render.clamp_indirect)
        return facts


def _settings(view: Viewpoint) -> str:
    """A camera's settings without its pose, as JSON."""
    pose = {"position", "rotation", "look_at"}
    return json.dumps(view.camera.model_dump(exclude=pose, exclude_none=True))
