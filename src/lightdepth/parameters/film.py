"""The tuned constants of the film: how samples are taken and shared out, and how errors are estimated."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import (
    CHECKED,
    Count,
    Factor,
    NotNegative,
    Positive,
    PowerOfTwo,
    Share,
    must_be_in_order,
)


@dataclass(frozen=True, config=CHECKED)
class FilmParameters:
    """How an image is sampled.

    Attributes:
        light_list_length: light samples of a presampled light list: it fits the processor's cache, since RIS candidates
            lie far apart in it.
        light_list_paths: camera paths after which a new list is drawn: what the list's own error adds stays unseen.
        training_share: training paths of the radiance cache, relative to the paths that estimate pixels.
        first_training_share: the same in the first pass, from which on the cache is used.
        first_training_paths: largest number of training paths then.
        training_paths_a_lane: training paths that a lane follows one after the other.
        fewest_training_paths: smallest number in a later pass: a launch costs as much as some ten thousand paths.
        light_paths_share: light paths per camera path, where objects are polished.
        light_paths_at_once: largest number of light paths in one block, which bounds the memory.
        paths_at_once: paths of one pass; more gain no speed.
        gpu_lane_paths: paths that a lane of a GPU follows one after the other, at most: it wants many lanes.
        samples_at_once: samples that a pixel gets at most before all others have theirs.
        packet_distance: packets of pixels that want equally many samples are at least so far apart, where there are
            enough, so that no processor core is left with all of the long ones.
        pilot_samples: samples that every pixel gets, at most half of all, before the rest is spent where the error is.
        unchanged_pilot: the same in frames that share their samples, of pixels whose middle and whose neighbours' middles
            show neither support nor anything new.
        quantum: further samples come in multiples of this.
        least_share: no pixel gets less than this share of the average number of samples, however little its error seems.
        most_share: no pixel gets more than this many times the average number of samples.
        contrast: the power of a pixel's brightness that the error is relative to where samples are shared out, as in
            Dammertz et al. 2010; relative to the brightness itself, highlights would get too few.
        neighbourhood: pixels to each side whose mean error decides how many samples the pixel in the middle gets; its own
            would bias it.
        least_round: further samples end where fewer are left for each pixel than this share of ``quantum``: a round costs
            as much as its estimate of the errors.
        least_noise: smallest share of a wanted noise that is left to the pixels' own errors, however large the shared
            ones are.
        dark: errors count relative to a pixel's brightness plus this share of the median: nobody sees noise in the dark.
        seconds_between_errors: shortest time between two estimates of the error for progress reports.
        error_time_share: largest share of the time that these estimates may take.
        single_around: pixels side by side whose mean brightness stands for that of a pixel with a single sample, which is
            as uncertain as the sample.
        worth_shared: errors that all pixels share are estimated once the pixels' own errors are below this: they are far
            smaller.
        shared_again: and again whenever this many times as many samples have been taken.
        compared_lists: light lists that are compared for that; more pixels tell more than more lists.
        fewest_probes: pixels in which they are compared, at least.
        most_probes: the same at most.
        paths_a_light_sample: paths of the rendering per light sample of that estimate, which keeps it to a percent of
            the time.
        cache_probes: pixels in which two radiance caches are compared.
        cache_samples: paths in each of them.
        selection_tile: pixels along the side of the tiles that are sampled or skipped as a whole; each costs five rays.
        layer_subpixels: points along each side of a pixel over which normal and albedo are averaged.
        edge_samples: points in a pixel that shows an object's edge, by which the objects' coverage is measured.
        highlight_samples: of each of two techniques in each pixel of the photograph whose highlights move with the camera.
        draft_highlight_samples: the same in a draft.
        fewest_highlight_samples: at each of several points in a pixel, at least.
        highlight_lights: light samples that all pixels share, for each of these samples: they serve a whole band of rows.
        highlight_blur: pixels across the square in which the noise of a lobe is shared that is wider; narrower ones have
            little, but edges.
        share_subpixels: points along each side of a pixel at which the photographs' shares are looked up.
        most_plate_subpixels: points along each side of a pixel at which the photograph is looked up, at most.
        fewest_lens_points: points of the lens for each pixel of the photograph that it blurs, at least; powers of two,
            in which Sobol's sequence is even.
        most_lens_points: the same at most.
    """

    light_list_length: Count = 1 << 14
    light_list_paths: Count = 1 << 21
    training_share: NotNegative = 0.1
    first_training_share: NotNegative = 0.25
    first_training_paths: Count = 1 << 15
    training_paths_a_lane: Count = 16
    fewest_training_paths: Count = 1 << 14
    light_paths_share: Positive = 0.5
    light_paths_at_once: Count = 1 << 19
    paths_at_once: Count = 1 << 21
    gpu_lane_paths: Count = 16
    samples_at_once: Count = 512
    packet_distance: Annotated[Count, Field(le=256)] = 64
    pilot_samples: Count = 16
    unchanged_pilot: Count = 2
    quantum: Count = 4
    least_share: Share = 0.125
    most_share: Count = 16
    contrast: Share = 0.5
    neighbourhood: Count = 2
    least_round: Share = 1 / 64
    least_noise: Share = 0.5
    dark: NotNegative = 0.1
    seconds_between_errors: NotNegative = 0.5
    error_time_share: Positive = 0.05
    single_around: Count = 9
    worth_shared: NotNegative = 0.05
    shared_again: Factor = 4.0
    compared_lists: Annotated[Count, Field(ge=2)] = 2
    fewest_probes: Count = 12
    most_probes: Count = 64
    paths_a_light_sample: Count = 20
    cache_probes: Count = 512
    cache_samples: Count = 16
    selection_tile: Count = 8
    layer_subpixels: Count = 2
    edge_samples: PowerOfTwo = 32
    highlight_samples: Count = 64
    draft_highlight_samples: Count = 16
    fewest_highlight_samples: Count = 4
    highlight_lights: Count = 1 << 12
    highlight_blur: Count = 3
    share_subpixels: Count = 2
    most_plate_subpixels: Count = 8
    fewest_lens_points: PowerOfTwo = 64
    most_lens_points: PowerOfTwo = 256

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        must_be_in_order(self, ("fewest_probes", "most_probes"), ("fewest_lens_points", "most_lens_points"))
        return self


DEFAULT = FilmParameters()
"""What renderings use."""
