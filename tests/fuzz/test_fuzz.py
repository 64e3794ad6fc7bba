"""A short run of `make fuzz`."""

from tests.fuzz.campaign import run
from tests.fuzz.seeds import seeds

KINDS = ("mesh", "material", "texture", "scene", "document", "image", "depth", "points")
MUTANTS = 600


def test_damaged_files_are_read_or_refused_in_words(tmp_path):
    chosen = [seed.name for seed in seeds() if seed.kind in KINDS]
    result = run(tmp_path, MUTANTS, names=chosen)
    assert result.findings == []
    assert result.read + result.refused == MUTANTS
    assert min(result.read, result.refused) > MUTANTS / 20  # Neither all broken nor hardly damaged.
