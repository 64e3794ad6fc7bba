"""Kernels hold no numbers of pixels, samples or paths: passes of another size compile none."""

import numpy as np

from lightdepth.api import begin_rendering
from lightdepth.kernel.start import start
from lightdepth.scene.materials import Metal, MitsubaBsdf
from tests.transport.places import ball, room

start("cpu")

import drjit as dr  # noqa: E402 - where LLVM is was settled by start()


def test_passes_of_another_size_compile_nothing():
    """With holes, polished metal, light tracing and the radiance cache."""
    lamp = np.full((16, 32, 3), 0.05, np.float32)
    lamp[3:7, 5:11] = 9.0
    leaf = MitsubaBsdf(type="mitsuba", mitsuba={"type": "mask", "opacity": 0.5, "bsdf": {"type": "diffuse"}})
    polished = Metal(type="metal", name="Ag", roughness=0.3)
    scene = room(lamp, [ball(polished), ball(leaf, (-0.2, 0.8, 0.9), 0.3)], irradiance_samples=16)

    def kernels(region):
        """Size and number of operations by the hash of the programs that computed the first pass."""
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            next(begin_rendering(scene, "view").run(4, region=region))
            found = [kernel for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]
            dr.kernel_history_clear()
        return {kernel["hash"]: (kernel["size"], kernel["operation_count"]) for kernel in found}

    known = kernels((0, 0, 48, 32))
    assert {name: value for name, value in kernels((3, 2, 44, 31)).items() if name not in known} == {}
