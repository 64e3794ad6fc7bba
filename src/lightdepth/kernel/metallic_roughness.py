"""The BSDF ``metallicroughness``: glTF's metallic-roughness surface with clearcoat, which keeps energy.

Mitsuba's own ``principled`` reflects up to 1.5 times what arrives (white, rough, at grazing angles) and loses up to
two thirds on rough metal; here a white surface reflects exactly what arrives, whatever its roughness. With ``E`` the
albedo of a GGX lobe toward the viewer, split after Karis (2013) into ``A F0 + B``:

    specular lobe   GGX with Schlick's Fresnel, times  1 + F0 (1 / (A + B) - 1)   (Turquin 2019: light that
                    bounces more than once between facets); of a surface that is metal in part, the mean of both
    diffuse lobe    base colour (1 - metallic) (1 - E_dielectric)                 (what the lobe above let through)
    clearcoat       a GGX lobe with F0 = 4 % on top; all below times  1 - clearcoat E_coat

The module is imported after ``kernel.start``; from then on ``mi.load_dict`` knows the plugin.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from lightdepth.kernel.arrays import aligned

SMALLEST_ALPHA = 1e-3
COAT_F0 = 0.04
_TABLE_SIZE = 64
_TABLE_SAMPLES = 1024


class _Lobe:
    """A GGX reflection lobe seen from ``wi``, without its Fresnel colour.

    Attributes:
        albedo_a: A and
        albedo_b: B of its albedo ``A F0 + B``.
    """

    def __init__(self, wi: mi.Vector3f, roughness: mi.Float) -> None:
        self.wi = wi
        self.facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, dr.maximum(roughness**2, SMALLEST_ALPHA))

    def sample(self, point: mi.Point2f) -> mi.Vector3f:
        """A direction, by the facets that are visible."""
        facet, _ = self.facets.sample(self.wi, point)
        return mi.reflect(self.wi, facet)

    def eval(self, wo: mi.Vector3f) -> tuple[mi.Float, mi.Float, mi.Float]:
        """Value times cosine for a Fresnel factor of 1, the Schlick term ``(1 - cos)^5``, and the density of ``wo``."""
        facet = dr.normalize(self.wi + wo)
        cosine = dr.dot(wo, facet)
        density = self.facets.pdf(self.wi, facet) / (4.0 * dr.maximum(cosine, 1e-12))
        value = density * self.facets.smith_g1(wo, facet)
        return value, (1.0 - dr.clip(cosine, 0.0, 1.0)) ** 5, density


@cache
def _albedo_table() -> mi.Texture2f:
    """A and B over the square root of the viewer's cosine (x) and the roughness (y), by quasi Monte Carlo."""
    ticks, index = np.linspace(0.0, 1.0, _TABLE_SIZE), np.arange(_TABLE_SAMPLES)
    roughness, root = (mi.Float(aligned(grid)) for grid in np.meshgrid(ticks, ticks, indexing="ij"))
    x = mi.Float(aligned((index + 0.5) / _TABLE_SAMPLES))
    y = mi.Float(aligned((index + 0.5) * 0.6180339887498949 % 1.0))
    lane = dr.arange(mi.UInt32, _TABLE_SIZE**2 * _TABLE_SAMPLES)
    entry, sample = lane // _TABLE_SAMPLES, lane % _TABLE_SAMPLES
    roughness, root = dr.gather(mi.Float, roughness, entry), dr.gather(mi.Float, root, entry)
    points = mi.Point2f(dr.gather(mi.Float, x, sample), dr.gather(mi.Float, y, sample))
    cosine = dr.maximum(root**2, 1e-4)
    lobe = _Lobe(mi.Vector3f(dr.sqrt(1.0 - cosine * cosine), 0.0, cosine), roughness)
    wo = lobe.sample(points)
    value, schlick, density = lobe.eval(wo)
    weight = dr.select((wo.z > 0.0) & (density > 0.0), value / density, 0.0)
    parts = [dr.block_sum(part, _TABLE_SAMPLES) / _TABLE_SAMPLES for part in _split(weight, schlick)]
    dr.eval(parts)  # At once: one by one would draw all samples again.
    shares = [part.numpy().reshape(_TABLE_SIZE, _TABLE_SIZE) for part in parts]
    table = mi.TensorXf(mi.Float(aligned(np.stack(shares, axis=-1))), (_TABLE_SIZE, _TABLE_SIZE, 2))
    return mi.Texture2f(table, filter_mode=dr.FilterMode.Linear, wrap_mode=dr.WrapMode.Clamp)


def _split(weight: mi.Float, schlick: mi.Float) -> tuple[mi.Float, mi.Float]:
    """Parts of a weight that belong to A and to B, since ``F = F0 (1 - schlick) + schlick``."""
    return weight * (1.0 - schlick), weight * schlick


class MetallicRoughness(mi.BSDF):
    """See the module; it reflects on the side of its normals only, wrap it in ``twosided``.

    Parameters, each a number or a texture: ``base_color``, ``tint`` (multiplies it, 1 by default), ``metallic``,
    ``roughness``, ``clearcoat``, ``clearcoat_roughness``; and the number ``f0``, the reflection of the dielectric at
    normal incidence, 0.04 by default.
    """

    def __init__(self, props: mi.Properties) -> None:
        mi.BSDF.__init__(self, props)
        self._textures = {
            name: props.get_texture(name, 0.0)
            for name in ("base_color", "metallic", "roughness", "clearcoat", "clearcoat_roughness")
        }
        if "tint" in props:
            self._textures["tint"] = props.get_texture("tint", 1.0)
        self._coated = "clearcoat" in props
        self._f0 = dr.opaque(mi.Float, float(props.get("f0", 0.04)))
        self._table = _albedo_table()
        lobes = [mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection]
        self.m_components = [lobe | mi.BSDFFlags.FrontSide for lobe in lobes]
        self.m_flags = self.m_components[0] | self.m_components[1]

    def traverse(self, callback: Any) -> None:  # noqa: D102
        for name, texture in self._textures.items():
            callback.put(name, texture, mi.ParamFlags.Differentiable)

    def _base_color(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> mi.Color3f:
        color = self._textures["base_color"].eval(si, active)
        return color * self._textures["tint"].eval(si, active) if "tint" in self._textures else color

    def _surface(self, si: mi.SurfaceInteraction3f, active: mi.Bool) -> _Surface:
        textures = self._textures
        metallic = textures["metallic"].eval_1(si, active)
        coat = textures["clearcoat"].eval_1(si, active) if self._coated else None
        coat_roughness = textures["clearcoat_roughness"].eval_1(si, active) if self._coated else None
        roughness = textures["roughness"].eval_1(si, active)
        return _Surface(
            self._table, si.wi, self._base_color(si, active), metallic, roughness, self._f0, coat, coat_roughness
        )

    def sample(self, ctx, si, sample1, sample2, active=True):  # noqa: D102
        active = active & (mi.Frame3f.cos_theta(si.wi) > 0.0)
        surface = self._surface(si, active)
        wo = surface.sample(sample1, sample2)
        value, density = surface.eval(wo)
        active &= (wo.z > 0.0) & (density > 0.0)
        result = dr.zeros(mi.BSDFSample3f)
        result.wo = wo
        result.pdf = dr.select(active, density, 0.0)
        result.eta = 1.0
        result.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        result.sampled_component = mi.UInt32(1)
        return result, dr.select(active, value / density, 0.0)

    def eval(self, ctx, si, wo, active=True):  # noqa: D102
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):  # noqa: D102
        return self.eval_pdf(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx, si, wo, active=True):  # noqa: D102
        active = active & (mi.Frame3f.cos_theta(si.wi) > 0.0) & (mi.Frame3f.cos_theta(wo) > 0.0)
        value, density = self._surface(si, active).eval(wo)
        return dr.select(active, value, 0.0), dr.select(active, density, 0.0)

    def eval_diffuse_reflectance(self, si, active=True):  # noqa: D102
        return self._base_color(si, active)

    def to_string(self) -> str:  # noqa: D102
        return f"MetallicRoughness[{', '.join(f'{name} = {value}' for name, value in self._textures.items())}]"


class _Surface:
    """The lobes at one point, seen from ``wi``, with the shares in which they are sampled."""

    def __init__(
        self,
        table: mi.Texture2f,
        wi: mi.Vector3f,
        base_color: mi.Color3f,
        metallic: mi.Float,
        roughness: mi.Float,
        f0: mi.Float,
        coat: mi.Float | None,
        coat_roughness: mi.Float | None,
    ) -> None:
        self._lobe = _Lobe(wi, roughness)
        self._f0 = dr.lerp(mi.Color3f(f0), base_color, metallic)
        a, b = _albedo(table, wi, roughness)
        reflected = _reflected(f0, a, b)
        # Of a surface that is metal in part, each part keeps its own energy: Turquin's factor is not linear in F0.
        self._gain = dr.lerp(reflected, _reflected(base_color, a, b), metallic) / dr.maximum(self._f0 * a + b, 1e-9)
        below: Any = 1.0
        self._coat = None
        if coat is not None and coat_roughness is not None:
            self._coat = _Lobe(wi, coat_roughness)
            coat_a, coat_b = _albedo(table, wi, coat_roughness)
            self._coat_gain = coat * (1.0 + COAT_F0 * (1.0 / (coat_a + coat_b) - 1.0))
            covered = (COAT_F0 * coat_a + coat_b) * self._coat_gain
            below = 1.0 - covered
        self._gain *= below
        self._diffuse = base_color * ((1.0 - metallic) * (1.0 - reflected) * below)
        specular_share = mi.luminance((self._f0 * a + b) * self._gain)
        diffuse_share = mi.luminance(self._diffuse)
        coat_share = 0.0 if self._coat is None else covered
        total = dr.maximum(specular_share + diffuse_share + coat_share, 1e-12)
        self._specular_share, self._diffuse_share = specular_share / total, diffuse_share / total
        self._coat_share = coat_share / total

    def sample(self, choice: mi.Float, point: mi.Point2f) -> mi.Vector3f:
        """A direction from one of the lobes."""
        wo = dr.select(
            choice < self._specular_share,
            self._lobe.sample(point),
            mi.warp.square_to_cosine_hemisphere(point),
        )
        if self._coat is not None:
            wo = dr.select(choice > 1.0 - self._coat_share, self._coat.sample(point), wo)
        return wo

    def eval(self, wo: mi.Vector3f) -> tuple[mi.Color3f, mi.Float]:
        """Value times cosine of all lobes, and the density with which :meth:`sample` finds ``wo``."""
        cosine_density = dr.maximum(wo.z, 0.0) * dr.inv_pi
        value, schlick, lobe_density = self._lobe.eval(wo)
        result = self._diffuse * cosine_density + self._gain * value * dr.lerp(self._f0, 1.0, schlick)
        density = self._diffuse_share * cosine_density + self._specular_share * lobe_density
        if self._coat is not None:
            value, schlick, lobe_density = self._coat.eval(wo)
            result += self._coat_gain * value * dr.lerp(COAT_F0, 1.0, schlick)
            density += self._coat_share * lobe_density
        return result, density


def _reflected(f0: Any, a: mi.Float, b: mi.Float) -> Any:
    """Albedo of the specular lobe with its compensation, per channel where ``f0`` is."""
    return (f0 * a + b) * (1.0 + f0 * (1.0 / (a + b) - 1.0))


def _albedo(table: mi.Texture2f, wi: mi.Vector3f, roughness: mi.Float) -> tuple[mi.Float, mi.Float]:
    """A and B of the lobe's albedo toward ``wi``."""
    nodes = mi.Point2f(dr.sqrt(dr.clip(wi.z, 0.0, 1.0)), roughness) * (_TABLE_SIZE - 1)
    a, b = table.eval((nodes + 0.5) / _TABLE_SIZE)
    return a, b


mi.register_bsdf("metallicroughness", MetallicRoughness)
