"""Files of which there is one for each frame."""

from lightdepth.numbered_files import found_files, numbered


def test_those_that_are_there_are_found_by_their_numbers(tmp_path):
    pattern = tmp_path / "a+b.###.exr"
    wanted = {number: numbered(pattern, number) for number in (0, 7, 12, 1234)}
    others = ("a+b.07.exr", "a+b.0012.exr", "a+b.x12.exr", "aab.012.exr", "a+b.012.png", "a+b.012.exr~", "a+b.٠١٢.exr")
    for name in (*(path.name for path in wanted.values()), *others):
        (tmp_path / name).touch()
    assert found_files(pattern) == wanted
    assert list(found_files(pattern)) == sorted(wanted)
