"""The tuned constants of the denoiser: what the network is shown, and what is kept from it."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, Positive, Share


@dataclass(frozen=True, config=CHECKED)
class DenoisingParameters:
    """How a frame is denoised.

    Attributes:
        tile: pixels along the side of the tiles that decide what is filtered how.
        largest_box: pixels of the largest box that is filtered at once; it bounds the memory.
        margin: pixels that the network is shown around a box where little is there: what is farther away changes a pixel by
            less than half a percent.
        wide_margin: the same where the layer goes on beyond the box.
        box_cost: pixels that are filtered in the time that a box takes in itself: the network is built for its size.
        faint: largest mean in a tile of the change, as a share of the photograph, that a blur denoises; above, it is seen.
        faint_noise: largest root mean square there; more noise would be left as spots.
        faint_step: largest difference between the means of neighbouring tiles there; a blur would wash out more.
        smooth_bend: largest deviation of neighbouring tiles' means from a straight line, as a share of the photograph,
            where a blur denoises a change that is not faint, for it keeps what is straight; nor may it exceed the noise.
        smooth_noise: largest standard deviation in a tile there.
        smooth_step: largest difference between the means of neighbouring tiles there.
        faint_blur: standard deviation of this blur, pixels.
        hole: pixels across the largest hole in the change that counts as changed as well: few samples leave some.
        ramp: pixels over which the network's result goes over into the blurred one.
        minor: largest share of a change that is so small a part of it that the fast network denoises it as well.
        most_errors: standard errors by which the network may change a pixel: it blurs edges that the samples show sharply.
        fewest_samples: samples of a pixel from which on their spread is an estimate of its error.
        dark: share of the photograph's median that is added where the change is divided by the photograph.
        rim_around: pixels across the square whose largest share of the layer a pixel of its rim is compared with,
        rim_share: and share of it from which on the pixel shows the layer reliably.
        rim_blur: pixels across the square whose mean goes on beyond the rim: a single pixel's noise would become a streak.
        rim_alone: share of a pixel that the layer fills from which on the guides show it alone.
        few: an excess that fewer samples than this carry is a firefly.
        outlier_contrast: a pixel exceeds its surroundings where it is above this many times their median,
        outlier_errors: plus this many of their standard errors.
        glint: radiance, where middle grey is 0.18, above which a denoiser no longer keeps light.
        beside: share of its brightness up to which what many samples agree on beside an outlier does not make it part of a
            feature.
        crowd: outliers among three by three pixels, at most: more are a thin bright line, or noise that the denoiser knows.
        visible: share of the brightness around up to which a firefly's spread light makes no visible spot;
        visible_dark: that brightness is at least this share of the layer's mean.
        spread: standard deviation of the smallest Gaussian that a firefly's light is spread by, pixels.
        spreads: of which each is twice as wide as the one before; the smallest that makes no visible spot is used, and what
            would be one even so is left out.
        spread_filled: a Gaussian's share that the layer fills counts as at least this: a sliver takes up no more light.
    """

    tile: Count = 16
    largest_box: Count = 1 << 21
    margin: Count = 32
    wide_margin: Count = 64
    box_cost: Count = 5000
    faint: Share = 0.03
    faint_noise: Share = 0.05
    faint_step: Share = 0.008
    smooth_bend: Share = 0.05
    smooth_noise: Share = 0.15
    smooth_step: Share = 0.2
    faint_blur: Positive = 6.0
    hole: Count = 9
    ramp: Count = 8
    minor: Share = 0.25
    most_errors: Positive = 3.0
    fewest_samples: Count = 4
    dark: Positive = 0.02
    rim_around: Count = 5
    rim_share: Share = 0.5
    rim_blur: Count = 9
    rim_alone: Share = 0.99
    few: Count = 8
    outlier_contrast: Positive = 1.3
    outlier_errors: Positive = 4.0
    glint: Positive = 6.0
    beside: Share = 0.1
    crowd: Count = 2
    visible: Share = 0.1
    visible_dark: Share = 0.05
    spread: Positive = 4.0
    spreads: Count = 4
    spread_filled: Positive = 0.05


DEFAULT = DenoisingParameters()
"""What frames are denoised with."""
