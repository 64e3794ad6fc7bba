"""The host's points of Sobol's sequence, against SciPy's."""

import subprocess
import sys

import numpy as np
from scipy.stats.qmc import Sobol

from lightdepth.kernel.sobol import POLYNOMIALS, sobol_points


def test_the_points_are_those_of_scipy_in_another_order():
    dimensions = len(POLYNOMIALS) + 1
    for count in (1, 16, 256):
        found, known = (
            points[np.lexsort(points.T)]
            for points in (sobol_points(count, dimensions), Sobol(dimensions, scramble=False).random(count))
        )
        np.testing.assert_array_equal(found, known)


def test_shifted_points_stay_one_to_a_stratum():
    points = sobol_points(64, 4, seed=3)
    assert (points != sobol_points(64, 4)).all()
    for axis in points.T:
        np.testing.assert_array_equal(np.sort(np.floor(64 * axis)), np.arange(64))
    for x, y in ((0, 1), (1, 0)):
        cells = np.floor(8 * points[:, [x, y]]) @ [8, 1]
        np.testing.assert_array_equal(np.sort(cells), np.arange(64))


def test_a_renderer_starts_without_what_it_does_not_need():
    """These are a quarter of a small picture's time."""
    code = (
        "import sys; from lightdepth.kernel.start import start; start('cpu'); import lightdepth.api, lightdepth.scene\n"
        "import lightdepth.film.rendering\n"
        "print([name for name in ('trimesh', 'scipy.stats', 'scipy.interpolate', 'scipy.optimize') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
