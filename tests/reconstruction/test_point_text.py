"""Point clouds as text of many makes."""

import numpy as np
import pytest

from lightdepth.errors import InputError, InputWarning
from lightdepth.reconstruction.point_cloud import read_points
from lightdepth.reconstruction.point_text import read_text_cloud

POINTS = np.round(np.random.default_rng(5).uniform(-4.0, 4.0, (150, 3)), 4)


def rows(separator=" ", comma=False, before="", after=""):
    lines = [before + separator.join(f"{value:.4f}" for value in point) + after for point in POINTS]
    return [line.replace(".", ",") for line in lines] if comma else lines


PLAIN = {
    "spaces": rows(),
    "tabs and a tail": rows("\t", after="\t128\t7\t9"),
    "semicolons": rows(";"),
    "semicolons and decimal commas": rows(";", comma=True),
    "spaces and decimal commas": rows("  ", comma=True),
    "commas": rows(", "),
    "a title": ["Scan of the hall, 2024", *rows()],
    "a header": ["X;Y;Z", *rows(";")],
    "units in the header": ["Easting [m];Northing [m];Height [m];Code", *rows(";", after=";7")],
    "a header with identifiers": ["Point,Code,X,Y,Z", *(f"P{i},7,{line}" for i, line in enumerate(rows(",")))],
    "columns in another order": ["z y x", *(" ".join(reversed(line.split())) for line in rows())],
    "a commented header": ["//Y X Z", *(" ".join(np.array(line.split())[[1, 0, 2]]) for line in rows())],
    "comments": ["# made with care", *rows()[:70], "# and more", *rows()[70:], ""],
    "a count": ["150", *rows(after=" 1 2 3")],
    "several clouds": ["70", *rows()[:70], "80", *rows()[70:]],
    "ParaView": ["Intensity,Points:0,Points:1,Points:2", *(f"0.5,{line}" for line in rows(","))],
    "units in the names": ["id,x_m,y_m,z_m", *(f"{i},{line}" for i, line in enumerate(rows(",")))],
    "German": ["Punkt;Rechtswert;Hochwert;H\u00f6he", *(f"{i};{line}" for i, line in enumerate(rows(";")))],
    "quotes": [f'"{line}"' for line in rows()],
}


@pytest.mark.parametrize("name", PLAIN)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_every_layout_is_read(tmp_path, name, encoding):
    (tmp_path / "x.pts").write_bytes("\r\n".join(PLAIN[name]).encode(encoding))
    np.testing.assert_array_equal(read_text_cloud(tmp_path / "x.pts")[0], POINTS)


@pytest.mark.parametrize("start", ["P0001", "1001", "shuffled", "scan"])
@pytest.mark.parametrize("separator", [" ", ";", ","])
def test_identifiers_in_the_first_column_are_left_out(tmp_path, start, separator):
    name = {"P": "P{:04d}", "1": "1{:03d}"}
    names = [name[start[0]].format(i) if start[0] in name else str(i * 7919 % 151) for i in range(len(POINTS))]
    if start == "scan":
        names = [str(i // 60) for i in range(len(POINTS))]
    lines = [f"{name}{separator}{line}" for name, line in zip(names, rows(separator), strict=True)]
    (tmp_path / "x.txt").write_text("\n".join(lines))
    with pytest.warns(InputWarning, match="first column is taken for identifiers"):
        np.testing.assert_array_equal(read_text_cloud(tmp_path / "x.txt")[0], POINTS)


def test_whole_numbers_are_coordinates(tmp_path):
    """A grid of whole metres whose x counts up is no column of identifiers."""
    grid = np.array([[i, i // 7, 3, 9] for i in range(120)])
    np.savetxt(tmp_path / "x.xyz", grid, fmt="%d")
    np.testing.assert_array_equal(read_text_cloud(tmp_path / "x.xyz")[0], grid[:, :3])


def test_points_that_are_not_finite_are_counted(tmp_path):
    lines = rows(",")
    lines[3], lines[7], lines[9] = "nan,nan,nan", "1.0,,2.0", "inf,0,0"
    (tmp_path / "x.csv").write_text("\n".join(lines))
    with pytest.warns(InputWarning, match="x.csv: 3 of 150 points have no finite coordinates; they are left out"):
        cloud = read_points(tmp_path / "x.csv")
    np.testing.assert_array_equal(cloud.points, np.delete(POINTS, [3, 7, 9], axis=0))


@pytest.mark.parametrize("mark", ["NULL", "1.#QNAN", "n/a", "-nan(ind)", "-9999", "-99999.0"])
def test_marks_for_what_was_not_measured_are_known(tmp_path, mark):
    (tmp_path / "x.xyz").write_text("\n".join([*rows(), f"{mark} {mark} {mark}"]))
    with pytest.warns(InputWarning, match="1 of 151 points have no finite coordinates"):
        np.testing.assert_array_equal(read_points(tmp_path / "x.xyz").points, POINTS)


def test_rays_that_met_nothing_are_left_out(tmp_path):
    (tmp_path / "x.xyz").write_text("\n".join([*rows(), *(["0 0 0"] * 20)]))
    with pytest.warns(InputWarning, match="20 points lie at 0, 0, 0"):
        np.testing.assert_array_equal(read_points(tmp_path / "x.xyz").points, POINTS)


def test_what_a_header_says_is_heeded(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("\n".join(["x_mm,y_mm,z_mm", *rows(",")]))
    with pytest.warns(InputWarning, match=r"its unit is 0.001 m, .*--scale 0.001"):
        read_points(path)
    np.testing.assert_allclose(read_points(path, scale=0.001).points, POINTS / 1000.0)
    path.write_text("\n".join(["lat,lon,alt", *rows(",")]))
    with pytest.raises(InputError, match="degrees of latitude and longitude"):
        read_points(path)
    path.write_text("\n".join(["links,vor,hoch", *rows(",")]))
    with pytest.warns(
        InputWarning, match=r"names of its columns are not known \('links,vor,hoch'\); links, vor, hoch are"
    ):
        np.testing.assert_array_equal(read_points(path).points, POINTS)


def test_a_ptx_file_under_another_name_is_named(tmp_path):
    (tmp_path / "x.pts").write_text("\n".join(["10", "15", "0 0 0", "1 0 0", *rows(after=" 0.5")]))
    with pytest.raises(InputError, match="as columns and rows of a PTX file"):
        read_points(tmp_path / "x.pts")


def test_a_file_that_is_cut_off_is_named(tmp_path):
    (tmp_path / "x.pts").write_text("\n".join(["70", *rows()[:70], "90", *rows()[70:]]))
    with pytest.warns(InputWarning, match="line 72 states 90 points, and 80 follow"):
        assert len(read_text_cloud(tmp_path / "x.pts")[0]) == 150


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("1.0 2.0", r"line 12 is '1.0 2.0'; numbers in its columns 1, 2, 3 are needed"),
        ("1.0 two 3.0", r"line 12 is '1.0 two 3.0'"),
        ("<html>", r"line 12 is '<html>'"),
    ],
)
def test_a_line_that_is_no_point_is_named(tmp_path, line, message):
    lines = rows()
    lines[11] = line
    (tmp_path / "x.xyz").write_text("\n".join(lines))
    with pytest.raises(InputError, match=message):
        read_text_cloud(tmp_path / "x.xyz")


def test_a_file_without_points_is_named(tmp_path):
    for content in ("", "3\n", "hello\n", "a b c\n"):
        (tmp_path / "x.xyz").write_text(content)
        with pytest.raises(InputError, match=r"x.xyz: "):
            read_points(tmp_path / "x.xyz")
