from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from lightdepth.capture.brackets import brackets_in_folder, group_by_exposure
from lightdepth.capture.exposure import Exposure, read_exposures, shutter_time
from lightdepth.capture.shoot import MergeOptions, read_shoot
from lightdepth.errors import InputError, InputWarning
from lightdepth.images.radiance import write_radiance
from lightdepth.parameters import CaptureParameters
from tests.support.dng import write_dng
from tests.support.photography import write_photograph

FAULTS = Path(__file__).parents[1] / "faults"
GREY = np.full((8, 8, 3), 128, np.uint8)


def test_exif_gives_time_aperture_sensitivity_and_the_moment(tmp_path):
    write_photograph(tmp_path / "a.jpg", GREY, 0.25, 61.5, aperture=5.6, iso=400)
    write_photograph(tmp_path / "b.jpg", GREY, 0.25, 63.0, aperture=5.6, iso=400)
    first, second = read_exposures([tmp_path / "a.jpg", tmp_path / "b.jpg"])
    assert (first.time, first.aperture, first.iso) == (0.25, 5.6, 400)
    assert first.amount == pytest.approx(0.25 * 4 / 5.6**2)
    assert second.taken - first.taken == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("printed", "true"),
    [(13, 2 ** (11 / 3)), (6, 2 ** (8 / 3)), (1 / 8000, 2**-13), (1 / 60, 1 / 64), (0.0371, 0.0371)],
)
def test_shutters_keep_powers_of_two_and_say_round_numbers(printed, true):
    assert shutter_time(printed) == pytest.approx(true, rel=1e-9)


def test_real_bracket_has_equal_steps(shared_data):
    files = sorted((shared_data / "brackets/fisheye_office").glob("*.JPG"))
    steps = np.diff(np.log2([exposure.amount for exposure in read_exposures(files)]))
    assert len(files) == 18
    np.testing.assert_allclose(steps[:-1], -1, atol=1e-6)
    assert steps[-1] == pytest.approx(-2 / 3)


def test_table_in_place_of_exif(tmp_path):
    table = tmp_path / "t.csv"
    table.write_text("file,time,aperture,iso\na.png,1/60,8,200\nb.png,2,8,200\n")
    first, second = read_exposures([tmp_path / "a.png", tmp_path / "b.png"], table)
    assert first == Exposure(1 / 60, 8, 200)
    assert second.amount / first.amount == pytest.approx(120)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("file,time\na.png,0\n", "line 2: time is '0'"),
        ("file,time\na.png,fast\n", "line 2: time is 'fast'"),
        ("file,time\nb.png,1\n", "has no row for a.png"),
        ("name,time\na.png,1\n", "needed are the columns file and time"),
    ],
)
def test_wrong_table_is_explained(tmp_path, text, message):
    table = tmp_path / "t.csv"
    table.write_text(text)
    with pytest.raises(InputError, match=r"t\.csv") as error:
        read_exposures([tmp_path / "a.png"], table)
    assert message in str(error.value)


def test_photograph_without_exposure_names_the_way_out(tmp_path):
    from PIL import Image

    Image.fromarray(GREY).save(tmp_path / "plain.jpg")
    with pytest.raises(InputError, match=r"plain\.jpg.*--exposures"):
        read_exposures([tmp_path / "plain.jpg"])


def named(times):
    return [(Path(f"{index}"), Exposure(time)) for index, time in enumerate(times)]


def test_brackets_begin_where_an_exposure_comes_again():
    assert [len(group) for group in group_by_exposure(named([1, 4, 16] * 5))] == [3] * 5
    # One exposure is missing in the middle, and in another bracket at its end.
    assert [len(group) for group in group_by_exposure(named([1, 4, 16, 64, 1, 16, 64, 1, 4, 16, 1, 4, 16, 64]))] == [
        4,
        3,
        3,
        4,
    ]


@pytest.mark.parametrize(
    ("times", "size"),
    [
        ([4, 1, 2, 4, 8, 16, 32] * 6, 7),  # The metered exposure comes first and again in its place.
        ([1, 2, 4, 4, 8, 16] * 6, 6),
        ([4, 1, 16] * 5, 3),
        ([4, 4, 1, 16] * 3 + [4, 4], 4),  # The last one was not finished.
    ],
)
def test_exposures_may_repeat_within_a_bracket(times, size):
    sizes = [len(group) for group in group_by_exposure(named(times))]
    assert sizes == [size] * (len(times) // size) + ([len(times) % size] if len(times) % size else [])


def test_brackets_that_repeat_are_found_in_a_folder(tmp_path):
    """The aperture is what changes, and f/8 comes twice."""
    for index in range(18):
        aperture = (16, 11.3, 8, 8, 5.7, 4)[index % 6]
        write_photograph(tmp_path / f"IMG_{index:04d}.jpg", GREY, 1 / 60, index, aperture=aperture)
    assert [len(group) for group in brackets_in_folder(tmp_path)] == [6, 6, 6]


@pytest.mark.parametrize(
    ("times", "sizes"),
    [
        ([1, 4, 16, 1.3, 5.2, 20.8, 0.8, 3.2, 12.8], [3, 3, 3]),
        ([4, 1, 16, 5, 1.25, 20, 3, 0.75, 12, 6, 1.5], [3, 3, 3, 2]),
        ([1, 2, 4, 8, 16, 32], [6]),  # One bracket in equal steps.
        ([8, 4, 16, 2, 32, 1, 64, 0.5], [8]),
    ],
)
def test_brackets_that_are_metered_one_by_one(times, sizes):
    assert [len(group) for group in group_by_exposure(named(times))] == sizes


def test_orientations_that_look_like_one_bracket_are_asked_about(tmp_path):
    for index, time in enumerate((1 / 60, 1 / 100, 1 / 30, 1 / 80)):
        write_photograph(tmp_path / f"{index}.jpg", GREY, time, index)
    with pytest.raises(
        InputError, match=r"4 photographs from 0.jpg to 3.jpg look like one bracket.*--bracket \(1 where"
    ):
        read_shoot([tmp_path], MergeOptions(several=True))


def test_folders_as_they_come_from_a_card(tmp_path):
    for index in (2, 10, 1, 11):
        write_photograph(tmp_path / f"IMG_{index}.jpg", GREY, 1 / 60, 0)
        (tmp_path / f"._IMG_{index}.jpg").write_bytes(b"\0\5\26\7")
    names = [path.name for group in brackets_in_folder(tmp_path) for path, _ in group]
    assert names == ["IMG_1.jpg", "IMG_2.jpg", "IMG_10.jpg", "IMG_11.jpg"]
    (tmp_path / "a.heic").touch()
    with pytest.warns(InputWarning, match="1 pictures of other kinds are left out, such as a.heic"):
        brackets_in_folder(tmp_path)
    write_radiance(tmp_path / "pano.hdr", np.ones((4, 8, 3), np.float32))
    with pytest.raises(InputError, match=r"holds HDR images, such as pano.hdr, and photographs, such as IMG_1.jpg"):
        read_shoot([tmp_path], MergeOptions())
    (tmp_path / "a.heic").unlink()
    (tmp_path / "pano.hdr").unlink()
    (tmp_path / "small").mkdir()
    write_photograph(tmp_path / "small/IMG_1.jpg", GREY, 1 / 60, 0)
    with pytest.raises(InputError, match=r"holds photographs, such as IMG_1.jpg, and folders of them, such as small"):
        brackets_in_folder(tmp_path)


@pytest.mark.parametrize(("tag", "iso"), [(0x8833, 800), (0x8832, 800), (0x8831, 800)])
def test_sensitivity_under_its_other_names(tmp_path, tag, iso):
    exif = Image.Exif()
    exif[0x0110] = "Test camera"
    exif.get_ifd(0x8769).update({0x829A: IFDRational(1, 2), tag: iso})
    Image.fromarray(GREY).save(tmp_path / "a.jpg", exif=exif)
    assert read_exposures([tmp_path / "a.jpg"])[0].iso == iso


def test_equal_exposures_are_no_bracket():
    assert [len(group) for group in group_by_exposure(named([4] * 6))] == [1] * 6
    assert [len(group) for group in group_by_exposure(named([4, 5] * 3))] == [2] * 3
    coarse = CaptureParameters(bracket_same=0.5)
    assert [len(group) for group in group_by_exposure(named([4, 5] * 3), coarse)] == [1] * 6


@pytest.mark.parametrize("name", ["iso65535_0", "iso65535_2"])
def test_an_impossible_sensitivity_is_refused(name):
    with pytest.raises(
        InputError, match=rf"{name}.jpg: .* ISO 65535, .*recommended exposure index is \d+.*--exposures"
    ):
        read_exposures([FAULTS / f"24-exif/{name}.jpg"])


def test_what_some_photographs_state_all_must(tmp_path):
    write_photograph(tmp_path / "a.jpg", GREY, 1, 0, aperture=8)
    write_photograph(tmp_path / "b.jpg", GREY, 1, 0, aperture=0)
    assert read_exposures([tmp_path / "b.jpg"])[0].aperture == 1.0
    with pytest.raises(InputError, match=r"b.jpg: the EXIF data hold no f-number, though those of a.jpg do"):
        read_exposures([tmp_path / "a.jpg", tmp_path / "b.jpg"])


def test_powers_of_two_stand_for_times_and_f_numbers(tmp_path):
    from PIL import Image
    from PIL.TiffImagePlugin import IFDRational

    exif = Image.Exif()
    tags = exif.get_ifd(0x8769)
    tags[0x9201], tags[0x9202], tags[0x8827] = IFDRational(-3, 1), IFDRational(5, 1), 200
    Image.fromarray(GREY).save(tmp_path / "x.jpg", exif=exif)
    exposure = read_exposures([tmp_path / "x.jpg"])[0]
    assert (exposure.time, exposure.iso) == (8.0, 200.0)
    assert exposure.aperture == pytest.approx(5.657, abs=1e-3)


def test_what_a_table_says_beside_or_twice_is_named(tmp_path):
    table = tmp_path / "t.csv"
    table.write_text("file,time,f-number\na.jpg,1,4\n")
    with pytest.warns(InputWarning, match="the columns f-number are not read"):
        read_exposures([Path("a.jpg")], table)
    table.write_text("file,time\none/a.jpg,1\ntwo/a.jpg,2\n")
    with pytest.raises(InputError, match=r"t.csv: line 3 gives a.jpg another exposure"):
        read_exposures([Path("a.jpg")], table)


def test_tables_of_other_makes(tmp_path):
    table = tmp_path / "t.csv"
    table.write_bytes("File;Time;ISO\r\na.png;1/60;200\r\n\r\n;\r\n"[:-5].encode("utf-8-sig"))
    assert read_exposures([tmp_path / "a.png"], table) == [Exposure(1 / 60, 1.0, 200.0)]
    table.write_bytes("file,time\nä.png,1\n".encode("utf-16"))
    with pytest.raises(InputError, match="not a text file in UTF-8"):
        read_exposures([tmp_path / "a.png"], table)


def test_what_only_libraw_knows_is_asked_of_it(tmp_path):
    """A file with its exposure where makers put it and EXIF data do not."""
    write_dng(tmp_path / "x.dng", np.full((48, 64), 900), [0], 16383, time=(1, 64))
    assert read_exposures([tmp_path / "x.dng"])[0].time == pytest.approx(1 / 64)


def test_photographs_with_automatic_exposure_are_no_brackets():
    times = [1 / 250, 1 / 160, 1 / 200, 1 / 250, 1 / 800, 1 / 160, 1 / 1000, 1 / 640, 1 / 80, 1 / 100, 1 / 80]
    with pytest.warns(InputWarning, match="the exposures of the 11 photographs follow no pattern.* --bracket"):
        assert [len(group) for group in group_by_exposure(named(times))] == [1] * len(times)


def test_folder_is_sorted_by_time_of_taking_not_by_name(tmp_path):
    for name, when, time in [("z.jpg", 0, 1), ("y.jpg", 1, 4), ("b.jpg", 20, 1), ("a.jpg", 21, 4)]:
        write_photograph(tmp_path / name, GREY, time, when)
    groups = brackets_in_folder(tmp_path)
    assert [[path.name for path, _ in group] for group in groups] == [["z.jpg", "y.jpg"], ["b.jpg", "a.jpg"]]
    with pytest.raises(InputError, match="not a multiple of --bracket 3"):
        brackets_in_folder(tmp_path, size=3)


def test_empty_folder_is_explained(tmp_path):
    with pytest.raises(InputError, match="holds no photographs"):
        brackets_in_folder(tmp_path)
