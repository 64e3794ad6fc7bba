"""The BSDFs of the synthetic surfaces, each called where it is met.

Mitsuba's own calls by pointer (``si.bsdf()``) compile every BSDF that exists, also those that only serve inside others
(below ``twosided``, ``normalmap`` or ``mask``) and those of other scenes, which makes kernels of glTF materials twice as
large. Here only those take part that shapes wear.
"""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi

from lightdepth.kernel.loading import load


class Materials:
    """The BSDFs of the shapes, by their index. Every method takes which lanes are ``active``; others get zeros.

    Args:
        shapes: the synthetic shapes.

    Attributes:
        have_holes: whether some let light pass without scattering it.
    """

    def __init__(self, shapes: Sequence[mi.Shape]) -> None:
        bsdfs: dict[int, mi.BSDF] = {}
        worn: dict[int, int] = {}
        for shape in shapes:
            pointer = registered(mi.BSDFPtr(shape.bsdf()))
            bsdfs.setdefault(pointer, shape.bsdf())
            worn[registered(mi.ShapePtr(shape))] = list(bsdfs).index(pointer)
        # With no shapes, something to call where nothing is met.
        self._bsdfs = list(bsdfs.values()) or [load({"type": "diffuse"})]
        self._of_shape = mi.UInt32([worn.get(shape, 0) for shape in range(max(worn, default=0) + 1)])
        self._flags = mi.UInt32([bsdf.flags() for bsdf in self._bsdfs])
        dr.make_opaque(self._of_shape, self._flags)
        self.have_holes = any(mi.has_flag(bsdf.flags(), mi.BSDFFlags.Null) for bsdf in self._bsdfs)

    def index(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.UInt32:
        """Index of the BSDF at each point."""
        return dr.gather(mi.UInt32, self._of_shape, dr.reinterpret_array(mi.UInt32, si.shape), active)

    def flags(self, index: mi.UInt32, active: mi.Bool) -> mi.UInt32:
        """Mitsuba's ``BSDFFlags``."""
        return dr.gather(mi.UInt32, self._flags, index, active)

    def sample(
        self,
        index: mi.UInt32,
        context: mi.BSDFContext,
        si: mi.SurfaceInteraction3f,
        choice: mi.Float,
        position: mi.Point2f,
        active: mi.Bool,
    ) -> tuple[mi.BSDFSample3f, mi.Color3f]:
        """As ``BSDF.sample``."""
        return dr.switch(index, [bsdf.sample for bsdf in self._bsdfs], context, si, choice, position, active)

    def eval_pdf(
        self,
        index: mi.UInt32,
        context: mi.BSDFContext,
        si: mi.SurfaceInteraction3f,
        outgoing: mi.Vector3f,
        active: mi.Bool,
    ) -> tuple[mi.Color3f, mi.Float]:
        """As ``BSDF.eval_pdf``."""
        return dr.switch(index, [bsdf.eval_pdf for bsdf in self._bsdfs], context, si, outgoing, active)

    def null_transmission(self, index: mi.UInt32, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
        """As ``BSDF.eval_null_transmission``."""
        return dr.switch(index, [bsdf.eval_null_transmission for bsdf in self._bsdfs], si, active)

    def diffuse_reflectance(self, index: mi.UInt32, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
        """As ``BSDF.eval_diffuse_reflectance``."""
        return dr.switch(index, [bsdf.eval_diffuse_reflectance for bsdf in self._bsdfs], si, active)


def registered(pointer: mi.BSDFPtr | mi.ShapePtr) -> int:
    """The index under which Dr.Jit registers an object, from a pointer array of length 1."""
    return int(dr.reinterpret_array(mi.UInt32, pointer)[0])
