"""The tuned constants: varied without patching, checked, and part of all that says which picture it is."""

import re
from dataclasses import fields, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from lightdepth.kernel.start import start

start("cpu")

from lightdepth.api import begin_rendering  # noqa: E402
from lightdepth.errors import InputError  # noqa: E402
from lightdepth.film.checkpoint import resume, write_checkpoint  # noqa: E402
from lightdepth.film.sums import Share, merge  # noqa: E402
from lightdepth.lighting.clipped_sources import find_plateaus  # noqa: E402
from lightdepth.lighting.panorama_view import PanoramaView  # noqa: E402
from lightdepth.parameters import (  # noqa: E402
    CalibrationParameters,
    CaptureParameters,
    ChecksParameters,
    DistancesParameters,
    FilmParameters,
    LightingParameters,
    MirrorBallParameters,
    Parameters,
    QuickstartParameters,
    ReconstructionParameters,
    RecoveryParameters,
    TransportParameters,
)
from lightdepth.parameters.reconstruction import BoxParameters, DepthParameters  # noqa: E402
from lightdepth.preparation.place import forget_places, prepare_place  # noqa: E402
from lightdepth.scene.identity import scene_digest  # noqa: E402
from lightdepth.scene.load import load_scene  # noqa: E402
from lightdepth.sequence.fingerprint import fingerprint  # noqa: E402
from lightdepth.session.session import Job  # noqa: E402
from lightdepth.store import Store  # noqa: E402
from tests.transport.places import GREY, ball, lamp_image, room  # noqa: E402

ARGUMENTS = {
    "capture": CaptureParameters(),
    "mirror_ball": MirrorBallParameters(),
    "calibration": CalibrationParameters(),
    "distances": DistancesParameters(),
    **{f"reconstruction.{each.name}": each.default for each in fields(ReconstructionParameters)},
    "quickstart": QuickstartParameters(),
    "checks": ChecksParameters(),
}
NAMES = [(each.name, name.name) for each in fields(Parameters) for name in fields(getattr(Parameters(), each.name))]


@pytest.fixture(scope="module")
def scene():
    return room(lamp_image(64), [ball(GREY)], irradiance_samples=16)


def varied(scene, **rooms):
    return replace(scene, render=replace(scene.render, parameters=Parameters(**rooms)))


def frame(scene, samples=16):
    return begin_rendering(scene, "view", seed=3, cache=False).complete(samples, auxiliary=False)


def other_value(value):
    if isinstance(value, tuple):
        return tuple(map(other_value, value))
    return 2 * value if isinstance(value, int) else 0.95 * value


def test_every_parameter_is_part_of_what_a_picture_is_made_from(scene):
    """Sums, checkpoints, frames of a sequence and prepared scenes go by these digests."""
    view, job, known = scene.cameras["view"], Job("view", seed=1), {scene_digest(scene)}
    prints = {fingerprint(scene, view, job, None, Fraction(24))}
    for place, name in NAMES:
        one = getattr(Parameters(), place)
        other = varied(scene, **{place: replace(one, **{name: other_value(getattr(one, name))})})
        known.add(scene_digest(other))
        prints.add(fingerprint(other, view, job, None, Fraction(24)))
    assert len(known) == len(prints) == len(NAMES) + 1


def test_renderings_of_other_parameters_are_not_taken_for_each_other(scene, tmp_path):
    other = varied(scene, transport=TransportParameters(candidates=4))
    renderings = [begin_rendering(each, "view", share=Share(index, 2)) for index, each in enumerate((scene, other))]
    for rendering in renderings:
        next(rendering.run(4))
    with pytest.raises(InputError, match="another scene"):
        merge([rendering.sums() for rendering in renderings])
    write_checkpoint(tmp_path / "x.checkpoint", renderings[0])
    with pytest.raises(InputError, match="another scene"):
        resume(tmp_path / "x.checkpoint", begin_rendering(other, "view", share=Share(0, 2)))


def test_a_place_in_the_cache_goes_by_the_parameters_that_it_was_recovered_with(scene, tmp_path):
    store, few = Store(tmp_path), RecoveryParameters(most_vertices=100)
    sizes = []
    for each in (scene, varied(scene, recovery=few), varied(scene, film=FilmParameters(pilot_samples=2))):
        forget_places()
        sizes.append(prepare_place(each, store=store).errors.vertices)
    assert sizes[1] < sizes[0] == sizes[2]
    assert len(store.entries()) == 2


def test_the_defaults_given_by_name_make_the_same_picture(scene):
    named = varied(scene, film=FilmParameters(light_list_length=1 << 14), transport=TransportParameters(candidates=8))
    one, other = frame(scene), frame(named)
    for layer in ("change", "synthetic", "variance", "samples"):
        np.testing.assert_array_equal(getattr(one, layer), getattr(other, layer))


def test_parameters_do_what_they_say(scene):
    """Of the transport, the number of candidates; of the film, the pilot's samples, and what the rest comes in."""
    usual, single = frame(scene), frame(varied(scene, transport=TransportParameters(candidates=1)))
    assert single.variance.mean() > 1.5 * usual.variance.mean()
    film = begin_rendering(varied(scene, film=FilmParameters(pilot_samples=2, quantum=2)), "view")
    steps = film.run(32)
    assert next(steps).samples == 2
    list(steps)
    taken = film.frame(auxiliary=False).samples
    assert (taken % 2 == 0).all()
    assert (taken % 4 != 0).any()


def test_light_is_recovered_with_the_scene_s_parameters(scene):
    other = varied(scene, lighting=LightingParameters(largest_width=32, plateau_fewest_pixels=1 << 20))
    assert (PanoramaView(scene).width, PanoramaView(other).width) == (64, 32)
    everywhere_sky = np.full(scene.panorama.radiance.shape[:2], np.inf, np.float32)
    assert find_plateaus(scene, everywhere_sky)
    assert not find_plateaus(other, everywhere_sky)


@pytest.mark.parametrize(
    ("kind", "wrong"),
    [
        (TransportParameters, {"candidates": 0}),
        (TransportParameters, {"largest_survival": 1.0}),
        (FilmParameters, {"pilot_samples": 2.5}),
        (FilmParameters, {"dark": float("nan")}),
        (FilmParameters, {"pilot": 2}),
        (FilmParameters, {"edge_samples": 48}),
        (FilmParameters, {"most_lens_points": 32}),
        (FilmParameters, {"packet_distance": 512}),
        (TransportParameters, {"smallest_cell": 5.0}),
        (RecoveryParameters, {"unseen_share": -0.1}),
        (LightingParameters, {"search_darkest": 0.5}),
        (QuickstartParameters, {"smallest_fov": 90.0}),
        (LightingParameters, {"sun_good_error": 0.2}),
        (LightingParameters, {"edge_reaches": ()}),
        (ChecksParameters, {"sun_near": 5.0}),
        (CaptureParameters, {"black": 0.99}),
        (MirrorBallParameters, {"rim_starts": (4, 1)}),
        (CalibrationParameters, {"view_fovs": (40.0, 180.0)}),
        (BoxParameters, {"farthest_wall": 12.0}),
        (DepthParameters, {"filter_width": 8}),
    ],
)
def test_what_is_out_of_range_is_refused(kind, wrong):
    (name,) = wrong
    with pytest.raises((ValidationError, TypeError), match=name):
        kind(**wrong)
    with pytest.raises((ValidationError, TypeError), match=name):
        replace(kind(), **wrong)


def test_a_scene_file_may_vary_them(tmp_path):
    file = tmp_path / "scene.toml"
    np.savetxt(
        tmp_path / "floor.obj", [[-2, -2, 0], [2, -2, 0], [0, 2, 0]], fmt="v %g %g %g", footer="f 1 2 3", comments=""
    )
    (tmp_path / "room.hdr").write_bytes(
        b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 4 +X 8\n" + bytes([99, 99, 99, 129]) * 32
    )
    text = '[panorama]\nimage = "room.hdr"\nposition = [0, 0, 1.5]\n'
    text += '[[real]]\nname = "floor"\nmesh = "floor.obj"\nrole = "support"\n'
    file.write_text(text + "[render.parameters.film]\npilot_samples = 8\n")
    assert load_scene(file).render.parameters == Parameters(film=FilmParameters(pilot_samples=8))
    for line, found in (("pilot_samples = 0", "pilot_samples"), ("pilot = 8", "pilot"), ("dark = inf", "dark")):
        file.write_text(f"{text}[render.parameters.film]\n{line}\n")
        with pytest.raises(InputError, match=found) as error:
            load_scene(file)
        assert "[render]: parameters: film" in str(error.value)


def test_the_documentation_has_them_all():
    text = (Path(__file__).parents[1] / "docs" / "parameters.md").read_text()
    rows = re.findall(r"^##+ `([\w.]+)`|^\| `(\w+)` \| ([^|]+) \|", text, re.MULTILINE)
    place, found = "", []
    for header, name, value in rows:
        place = header or place
        found += [] if header else [(place, name, value)]
    rooms = {each.name: getattr(Parameters(), each.name) for each in fields(Parameters)} | ARGUMENTS
    assert found == [
        (place, each.name, repr(getattr(room, each.name))) for place, room in rooms.items() for each in fields(room)
    ]
