"""The tuned constants of checking a scene: what is reported, and how closely it is looked at."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, NotNegative, Positive, Probability, Share, must_be_in_order


@dataclass(frozen=True, config=CHECKED)
class ChecksParameters:
    """What ``lightdepth check``, and every rendering before it begins, reports of a scene.

    Attributes:
        rows: of the grid of directions from each capture point: about 0.7 degrees, fine enough for any hole that matters.
        enclosure_rays: from a point, by which it is found how much surrounds it.
        surface_points: on each real surface, at which it is looked whether a capture point sees it.
        seen_depth: relative difference of distances up to which a point lies on the surface that is seen,
        seen_distance: and metres that are added to it.
        plateau_level: share of the panorama's largest radiance from which on pixels have the same value: clipped lights do.
        plateau_pixels: of such a plateau, at least: a small lamp may be flat by itself,
        plateau_share: and share of the sphere: about four sun disks.
        smallest_hole: share of all directions, two degrees by two. What is connected and smaller is a seam between meshes,
            not a hole, and not worth a word where all of it together is smaller.
        unseen_support: share of a support's area that no capture point sees, from which on it is reported.
        much_unseen_support: from this share on it is a warning: support behind furniture is usual, but here more is unseen
            than seen.
        most_unseen_support: share above which it is an error. Of a closed box, the capture point sees one side of six at
            least, so that 83 % are unseen; of what is unseen to a larger part, the photograph shows next to nothing.
        nearest_surface: metres from a capture point: no lens comes as near.
        thinnest_place: metres between opposite surfaces: no camera stands in less.
        thickest_wall: metres: between opposite faces that both look away, one stands inside something solid.
        closed: share of directions that meet something from which on a point is in a closed room.
        outside: share up to which a capture point may be outside of the room.
        smallest_room: metres along each axis: anything smaller that is closed is a thing, not a room.
        mostly_closed: share of directions that meet a real surface from which on the capture point is in a room, with a
            hole perhaps.
        same_room: what is enclosed by less than this part of what encloses the capture point is not in the same room.
        object_points: on each object that are looked at.
        beyond: metres by which objects may reach beyond all real surfaces: models of places are rough.
        beyond_share: share of an object's surface that may be beyond them.
        contact: metres: smaller gaps and overlaps of an object and what it stands on are no mistake.
        contact_share: share of the object's height up to which overlaps are none.
        deliberate_gap: metres: what hangs higher above everything is meant to hang.
        coplanar: metres between faces that compete for being in front.
        coplanar_cosine: between their normals, at least.
        smallest_object: metres of the longest side: below, the unit of the file is another than metres more often than not.
        largest_object: the same above.
        around: share of directions that meet an object from which on a point is inside it.
        soft: times the photograph's pixels per degree from which on it is visibly soft beside sharp objects.
        unseen_view: share of a camera's view that no capture point sees from which a word is due.
        far: a camera so far from the capture point, relative to the usual distance of surfaces, shows every error of their
            model.
        camera_rays: over all directions, of which those in a camera's view are looked at.
        film_columns: of the grid of points on a camera's film, by which it is found what it sees of what is removed.
        sun_near: degrees around the brightest place of the sky that hold a sun, its glow and a pixel's blur.
        sun_around: degrees in which the sky around it is.
        sun_stands_out: times the panorama's mean that a sun has at least, as every pixel that shows one.
        same_sun: share of a declared sun's irradiance from which on what the sky shows may be that sun: no cloud and no
            glow gives as much.
        sun_step: every such row and column of the grid of directions is looked at for a sun's light.
        least_lobe: share of a gloss's lobe that is used, below which it is a warning that not all is.
        photographs_differ: share of what a photograph has in common with others that disagrees, from which on it is
            reported.
        photographs_differ_much: the same for a warning.
        plate_differs: share of what a plate has in common with the panoramas that disagrees, from which on it is reported.
        plate_differs_much: the same for a warning.
        gains_flicker: relative range of the gains of a sequence's frames from which on objects would be seen to change.
        visible_error: relative error of a picture's samples above which its noise is visible,
        visible_error_denoised: and where it is denoised.
        frames: of a sequence that are looked at between its keys, at most.
    """

    rows: Count = 256
    enclosure_rays: Count = 2000
    surface_points: Count = 4000
    seen_depth: Share = 0.005
    seen_distance: NotNegative = 1e-3
    plateau_level: Share = 0.995
    plateau_pixels: Count = 16
    plateau_share: Share = 2e-5
    smallest_hole: Share = 1e-4
    unseen_support: Share = 0.001
    much_unseen_support: Share = 0.5
    most_unseen_support: Share = 0.9
    nearest_surface: NotNegative = 0.02
    thinnest_place: NotNegative = 0.1
    thickest_wall: NotNegative = 0.6
    closed: Share = 0.9
    outside: Share = 0.75
    smallest_room: NotNegative = 1.5
    mostly_closed: Share = 2 / 3
    same_room: Share = 0.75
    object_points: Count = 400
    beyond: NotNegative = 0.01
    beyond_share: Share = 0.1
    contact: NotNegative = 0.002
    contact_share: Share = 0.01
    deliberate_gap: NotNegative = 0.3
    coplanar: NotNegative = 0.0005
    coplanar_cosine: Probability = 0.999
    smallest_object: Positive = 0.01
    largest_object: Positive = 20.0
    around: Share = 0.75
    soft: Positive = 3.0
    unseen_view: Share = 0.15
    far: Positive = 0.5
    camera_rays: Count = 4000
    film_columns: Count = 160
    sun_near: Positive = 1.5
    sun_around: Positive = 4.0
    sun_stands_out: Positive = 30.0
    same_sun: Share = 0.1
    sun_step: Count = 4
    least_lobe: Share = 0.5
    photographs_differ: Share = 0.005
    photographs_differ_much: Share = 0.02
    plate_differs: Share = 0.2
    plate_differs_much: Share = 0.4
    gains_flicker: Positive = 0.005
    visible_error: Positive = 0.03
    visible_error_denoised: Positive = 0.06
    frames: Count = 48

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        must_be_in_order(
            self,
            ("unseen_support", "much_unseen_support"),
            ("much_unseen_support", "most_unseen_support"),
            ("nearest_surface", "thinnest_place"),
            ("thinnest_place", "thickest_wall"),
            ("contact", "deliberate_gap"),
            ("smallest_object", "largest_object"),
            ("sun_near", "sun_around"),
            ("photographs_differ", "photographs_differ_much"),
            ("plate_differs", "plate_differs_much"),
            ("visible_error", "visible_error_denoised"),
        )
        return self


DEFAULT = ChecksParameters()
"""What scenes are checked with."""
