"""A short run of `make fuzz`."""

from tests.fuzz.campaign import run

MUTANTS = 600


def test_damaged_files_are_read_or_refused_in_words(tmp_path):
    result = run(tmp_path, MUTANTS)
    assert result.findings == []
    assert result.read + result.refused == MUTANTS
    assert min(result.read, result.refused) > MUTANTS / 20  # Neither all broken nor hardly damaged.
