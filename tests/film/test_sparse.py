"""Memory of large layers."""

from pathlib import Path

import numpy as np
import pytest

from lightdepth.film.sparse import LARGE, sparse_zeros

STATUS = Path("/proc/self/statm")


@pytest.mark.skipif(not STATUS.is_file(), reason="only Linux says here how much memory is resident")
def test_zeros_take_memory_only_where_something_is():
    def resident():
        return int(STATUS.read_text().split()[1]) * 4096

    before = resident()
    image = sparse_zeros((4 * LARGE // 4096, 4096), np.uint8)
    image[::64, 7] = 3  # A page of each 256 kilobytes.
    assert image[:, 7].sum(dtype=int) == 3 * len(image[::64])
    assert image.sum(dtype=int) == 3 * len(image[::64])
    assert resident() - before < LARGE


def test_small_ones_are_ordinary():
    assert sparse_zeros((2, 3), np.float16).tolist() == [[0.0] * 3] * 2
