"""Directional albedos of GGX, as tables: what the layering of Principled and the multiple-scattering term need.

A microfacet lobe does not reflect all the light that reaches it: single scattering loses what hits a second facet,
and a dielectric layer takes from the layer below exactly what it reflects itself. Both are integrals over the lobe
that depend on few parameters, so they are tabulated once, by deterministic quadrature, and looked up on the GPU.

With alpha = roughness^2, D the GGX distribution, G the height-correlated Smith term, mu = normal . view and the
half vector h drawn from the distribution of visible normals (so that the expectation is a mean over a uniform grid):

    energy(mu, roughness)          = E_h[ G2 / G1 ]                  albedo of a lobe with reflectance 1
    energy_average(roughness)      = 2 * integral of energy(mu) mu dmu
    dielectric(mu, roughness, z)   = E_h[ s(view . h) ]              s = (F - F0) / (1 - F0), F the exact Fresnel term
    schlick(mu, roughness)         = E_h[ (1 - view . h)^5 ]
    glass_reflection(mu, roughness, z) = E_h[ F G2 / G1 ]            what rough glass reflects at once
    glass(mu, roughness, z)        = E_h[ F G2 / G1 + (1 - F) G2' / G1 ]   and what it reflects or lets through
    leaving, leaving_reflection    = the same for rays from inside, which meet the inverse index of refraction

with G2' for the refracted direction, which must lie below the surface.
Directions that leave below the surface count as zero in all of them. The axis z = sqrt(|ior - 1| / (ior + 1)) is
the fourth root of F0, which spaces the usual indices of refraction evenly. These are the quantities that Cycles
tabulates (its closures estimate albedos this way), with the same node positions, so that interpolation errors agree;
from 5.3 on its table of dielectric layers has 32 nodes along each axis, those of mu closer at grazing angles (at their
number's square), and so has ours there.

Sources: Heitz, "Understanding the masking-shadowing function", JCGT 2014; Dupuy & Benyoub, "Sampling visible GGX
normals with spherical caps", HPG 2023; Turquin, "Practical multiple scattering compensation for microfacet models",
2019; Cycles' kernel for the choice of axes.

`python -m addon.materials.energy` writes `energy.npz` beside this file.
"""

from __future__ import annotations

from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from .thin_film import sensitivity

ENERGY_SIZE = 32  # nodes along roughness and along mu
LAYER_SIZE = 16  # nodes along roughness, mu and z
FINE_SIZE = 32  # and of the dielectric layer in Cycles 5.3 and later
TEXTURE_SIZE = 64  # texels along each side of a third of the packed texture: 4 x 4 tiles of LAYER_SIZE

SMALLEST_COSINE = 1e-4  # the node at mu = 0 stands just above the horizon, where the lobe is still defined
SMALLEST_Z, LARGEST_Z = 1e-4, 0.99  # z = 0 has no reflection, z = 1 an infinite index of refraction
GRID = 384  # quadrature points along each of the two dimensions of the half vector

BINS = 1 << 15  # of the square root of the cosine between view and half vector

PATH = Path(__file__).with_name("energy.npz")
SHEEN_SIZE = 32  # nodes along roughness and along mu of the sheen tables
SHEEN_PATH = Path(__file__).with_name("sheen.npz")  # measured, see tools/measure_sheen.py


def visible_half_vectors(mu: float, roughness: float, grid: int = GRID) -> tuple[np.ndarray, np.ndarray]:
    """Half vectors seen from direction (sqrt(1-mu^2), 0, mu), equally likely: (view . h, z of the reflected ray).

    Both arrays have shape (grid^2,). Sampling of spherical caps (Dupuy & Benyoub 2023) on a midpoint grid.
    """
    alpha = max(roughness * roughness, 1e-7)
    steps = (np.arange(grid) + 0.5) / grid
    first, second = np.meshgrid(steps, steps, indexing="ij")
    sine = np.sqrt(max(0.0, 1.0 - mu * mu))
    # The half circle is symmetric about the plane of incidence: one side is enough.
    phi = np.pi * second
    stretched = np.array([sine * alpha, 0.0, mu])
    stretched /= np.linalg.norm(stretched)
    z = 1.0 - first * (1.0 + stretched[2])
    radius = np.sqrt(np.clip(1.0 - z * z, 0.0, 1.0))
    hx, hy, hz = radius * np.cos(phi) + stretched[0], radius * np.sin(phi), z + stretched[2]
    hx, hy = hx * alpha, hy * alpha
    length = np.sqrt(hx * hx + hy * hy + hz * hz)
    length = np.where(length > 0.0, length, 1.0)
    hx, hz = hx / length, hz / length
    cos_half = np.clip(hx * sine + hz * mu, 0.0, 1.0)
    return cos_half.ravel(), (2.0 * cos_half * hz - mu).ravel()


def smith_lambda(cosine: np.ndarray | float, alpha: float) -> np.ndarray:
    """Smith's auxiliary function of GGX: G1 = 1 / (1 + lambda)."""
    cosine_squared = np.maximum(np.square(cosine), 1e-16)
    return 0.5 * (np.sqrt(1.0 + alpha * alpha * (1.0 - cosine_squared) / cosine_squared) - 1.0)


def fresnel_dielectric(cosine: np.ndarray, ior: float) -> np.ndarray:
    """Unpolarised reflectance of a smooth dielectric; `ior` is inside over outside, total reflection gives 1."""
    squared = ior * ior - 1.0 + cosine * cosine
    g = np.sqrt(np.maximum(squared, 0.0))
    a = (g - cosine) / (g + cosine + 1e-300)
    b = ((g + cosine) * cosine - 1.0) / ((g - cosine) * cosine + 1.0)
    return np.where(squared > 0.0, 0.5 * a * a * (1.0 + b * b), 1.0)


@cache
def pane_passing(ior: float) -> tuple[float, float]:
    """What a face of glass lets pass of light that goes straight on: on its way from lamps, and from all sides.

    From most lamps it comes at some 45 degrees. Rays to them see both faces of a pane, each of which mirrors R, and
    what is mirrored to and fro between them passes, too: (1 - R) / (1 + R) in all; a face is taken for half of a pane,
    as most things of glass have two. Rays of paths are mirrored themselves where a face stops them: it passes 1 - R.
    """
    ior = max(ior, 1.0 / max(ior, 1e-5))
    face = float(fresnel_dielectric(np.float64(np.sqrt(0.5)), ior))
    cosines = np.sqrt((np.arange(256) + 0.5) / 256)
    return float(np.sqrt((1.0 - face) / (1.0 + face))), float(1.0 - fresnel_dielectric(cosines, ior).mean())


def thin_wall_passing(base: np.ndarray, ior: float) -> np.ndarray:
    """(...) what a thin wall (`shader_thin_wall` of shaders/material/shader.glsl) lets pass of light from all sides, by
    its base colours `base` (...), 0..1."""
    cosines = np.sqrt((np.arange(256) + 0.5) / 256)
    face = fresnel_dielectric(cosines, ior)
    cosines_inside = np.sqrt(np.maximum(1.0 - (1.0 - cosines**2) / ior**2, 1e-4))
    absorbed = np.asarray(base, float)[..., None] ** (1.0 / cosines_inside)
    return ((1.0 - face) ** 2 * absorbed / np.maximum(1.0 - (face * absorbed) ** 2, 1e-6)).mean(axis=-1)


def ior_from_f0(f0: float) -> float:
    """Index of refraction whose reflectance at normal incidence is `f0`."""
    root = np.sqrt(min(f0, 0.99))
    return (1.0 + root) / (1.0 - root)


def ggx_energy(mu: float, roughness: float, grid: int = GRID) -> float:
    """Albedo of the single-scattering GGX lobe with reflectance 1."""
    alpha = max(roughness * roughness, 1e-7)
    _, cos_out = visible_half_vectors(mu, roughness, grid)
    lit = cos_out > 0.0
    lambda_in = smith_lambda(mu, alpha)
    lambda_out = smith_lambda(np.maximum(cos_out, 1e-8), alpha)
    return float(np.mean(np.where(lit, (1.0 + lambda_in) / (1.0 + lambda_in + lambda_out), 0.0)))


def glass_energy(mu: float, roughness: float, ior: float, grid: int = GRID // 2) -> tuple[float, float]:
    """Albedos of a rough dielectric that scatters once: (all, what is reflected)."""
    alpha = max(roughness * roughness, 1e-7)
    cos_half, cos_out = visible_half_vectors(mu, roughness, grid)
    fresnel = fresnel_dielectric(cos_half, ior)
    lambda_in = smith_lambda(mu, alpha)

    def masking(cosine: np.ndarray) -> np.ndarray:
        lambda_out = smith_lambda(np.maximum(cosine, 1e-8), alpha)
        return np.where(cosine > 0.0, (1.0 + lambda_in) / (1.0 + lambda_in + lambda_out), 0.0)

    # Snell: the refracted ray is -view / ior + (cos / ior - cos') half; how far it goes down is what follows.
    half_z = np.divide(cos_out + mu, 2.0 * cos_half, out=np.ones_like(cos_half), where=cos_half > 1e-12)
    cos_inside = np.sqrt(np.maximum(1.0 - (1.0 - cos_half * cos_half) / (ior * ior), 0.0))
    below = mu / ior - (cos_half / ior - cos_inside) * half_z
    reflected = fresnel * masking(cos_out)
    return float(np.mean(reflected + (1.0 - fresnel) * masking(below))), float(np.mean(reflected))


def dielectric_layer(size: int, power: int = 1) -> np.ndarray:
    """The table `dielectric` with `size` nodes along each axis: [roughness, mu, z]; mu is the axis to that power.

    Fresnel's term depends on view . half alone, so a histogram of that stands for the half vectors.
    """
    axis = np.linspace(0.0, 1.0, size)
    cosines = np.square((np.arange(BINS) + 0.5) / BINS)  # finer where the term is steep
    shapes = np.zeros((BINS, size))
    for k, z in enumerate(np.clip(axis, SMALLEST_Z, LARGEST_Z)):
        ior = ior_from_f0(z**4)
        f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
        shapes[:, k] = np.clip((fresnel_dielectric(cosines, ior) - f0) / (1.0 - f0), 0.0, 1.0)
    table = np.zeros((size,) * 3)
    for i, roughness in enumerate(axis):
        for j, mu in enumerate(axis**power):
            cos_half, cos_out = visible_half_vectors(max(mu, SMALLEST_COSINE), roughness)
            lit = cos_half[cos_out > 0.0]
            counts = np.bincount(np.minimum((np.sqrt(lit) * BINS).astype(int), BINS - 1), minlength=BINS)
            table[i, j] = counts @ shapes / len(cos_half)
    return table


def make_tables() -> dict[str, np.ndarray]:
    """All tables: energy (32, 32) [roughness, mu], energy_average (32,), dielectric (16, 16, 16) [roughness, mu, z] and
    the same as dielectric_fine (32, 32, 32) [roughness, sqrt(mu), z], schlick (16, 16) [roughness, mu], glass and
    glass_reflection like dielectric, glass_average (16, 16) [roughness, z], and these three as leaving… for rays from
    inside; float32."""
    axis = np.linspace(0.0, 1.0, ENERGY_SIZE)
    energy = np.array([[ggx_energy(max(mu, SMALLEST_COSINE), r) for mu in axis] for r in axis])
    nodes, weights = np.polynomial.legendre.leggauss(24)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    average = np.array([sum(2.0 * w * m * ggx_energy(m, r) for m, w in zip(nodes, weights)) for r in axis])

    layer_axis = np.linspace(0.0, 1.0, LAYER_SIZE)
    schlick = np.zeros((LAYER_SIZE,) * 2)
    glass, glass_reflection, leaving, leaving_reflection = np.zeros((4, *(LAYER_SIZE,) * 3))
    glass_average, leaving_average = np.zeros((2, *(LAYER_SIZE,) * 2))
    for i, roughness in enumerate(layer_axis):
        for j, mu in enumerate(layer_axis):
            cos_half, cos_out = visible_half_vectors(max(mu, SMALLEST_COSINE), roughness)
            lit = cos_out > 0.0
            schlick[i, j] = np.mean(np.where(lit, (1.0 - cos_half) ** 5, 0.0))
            for k, z in enumerate(np.clip(layer_axis, SMALLEST_Z, LARGEST_Z)):
                ior = ior_from_f0(z**4)
                cosine = max(mu, SMALLEST_COSINE)
                glass[i, j, k], glass_reflection[i, j, k] = glass_energy(cosine, roughness, ior)
                leaving[i, j, k], leaving_reflection[i, j, k] = glass_energy(cosine, roughness, 1.0 / ior)
        for k, z in enumerate(np.clip(layer_axis, SMALLEST_Z, LARGEST_Z)):
            ior = ior_from_f0(z**4)
            for filled, inside in ((glass_average, ior), (leaving_average, 1.0 / ior)):
                means = (2.0 * w * m * glass_energy(m, roughness, inside, 96)[0] for m, w in zip(nodes, weights))
                filled[i, k] = sum(means)
    tables = {
        "energy": energy, "energy_average": average, "schlick": schlick,
        "dielectric": dielectric_layer(LAYER_SIZE), "dielectric_fine": dielectric_layer(FINE_SIZE, 2),
        "glass": glass, "glass_reflection": glass_reflection, "glass_average": glass_average,
        "leaving": leaving, "leaving_reflection": leaving_reflection, "leaving_average": leaving_average,
    }  # fmt: skip
    return {name: table.astype(np.float32) for name, table in tables.items()}


@lru_cache(maxsize=1)
def tables() -> dict[str, np.ndarray]:
    """The stored tables, see `make_tables`."""
    with np.load(PATH) as stored:
        return {name: stored[name] for name in stored.files}


@lru_cache(maxsize=1)
def sheen_tables() -> dict[str, np.ndarray]:
    """a, b and albedo of Cycles' microfiber sheen, each (32, 32) float32 [roughness, mu]; tools/measure_sheen.py."""
    with np.load(SHEEN_PATH) as stored:
        return {name: stored[name] for name in stored.files}


def energy_texture(fine: bool) -> np.ndarray:
    """The tables packed for the GPU: (64, 256, 4) float32, row first, to be bound as `energy_table`; if `fine`,
    (160, 256, 4), which tells shaders to do as Cycles 5.3.

    R: dielectric[i, j, k] at column i + 16 (k mod 4), row j + 16 (k div 4); G: the same for k + 1, so that one fetch
    gives both ends of the interpolation along z. From column 64 on the same way, R and G: glass; B and A:
    glass_reflection; from column 128 on, leaving and leaving_reflection. Up to column 63, B: energy[i, j] at column i,
    row j; energy_average[i] at column i, row 32; schlick[i, j] at column 32 + i, row j; glass_average[i, k] at column
    32 + i, row 32 + k, leaving_average beside it from column 48 on. A: the sheen's a[i, j] at column i, row j; its b at
    column 32 + i, row j; its albedo at column i, row 32 + j. From row 64 on, for k < 16, R and G: the table
    dielectric_fine[i, j, k] and that of k + 1 at column i + 32 (k mod 6), row 64 + j + 32 (k div 6); B and A: the same
    of k + 16. `shaders/lib/energy.glsl` reads exactly this. From column 192 on, row by row: what colours see of thin
    films (thin_film.py), its real and its imaginary part beside each other.
    """
    stored = tables()
    texture = np.zeros((TEXTURE_SIZE + (3 * FINE_SIZE if fine else 0), 4 * TEXTURE_SIZE, 4), np.float32)
    for name, first, channel in (
        ("dielectric", 0, 0), ("glass", TEXTURE_SIZE, 0), ("glass_reflection", TEXTURE_SIZE, 2),
        ("leaving", 2 * TEXTURE_SIZE, 0), ("leaving_reflection", 2 * TEXTURE_SIZE, 2),
    ):  # fmt: skip
        for k in range(LAYER_SIZE):
            column, row = first + LAYER_SIZE * (k % 4), LAYER_SIZE * (k // 4)
            tile = texture[row : row + LAYER_SIZE, column : column + LAYER_SIZE]
            tile[..., channel] = stored[name][:, :, k].T
            tile[..., channel + 1] = stored[name][:, :, min(k + 1, LAYER_SIZE - 1)].T
    texture[:ENERGY_SIZE, :ENERGY_SIZE, 2] = stored["energy"].T
    texture[ENERGY_SIZE, :ENERGY_SIZE, 2] = stored["energy_average"]
    texture[:LAYER_SIZE, ENERGY_SIZE : ENERGY_SIZE + LAYER_SIZE, 2] = stored["schlick"].T
    texture[ENERGY_SIZE : ENERGY_SIZE + LAYER_SIZE, ENERGY_SIZE : ENERGY_SIZE + LAYER_SIZE, 2] = stored[
        "glass_average"
    ].T
    texture[ENERGY_SIZE : ENERGY_SIZE + LAYER_SIZE, 48 : 48 + LAYER_SIZE, 2] = stored["leaving_average"].T
    for k in range(FINE_SIZE if fine else 0):
        column, row = FINE_SIZE * (k % 16 % 6), TEXTURE_SIZE + FINE_SIZE * (k % 16 // 6)
        tile = texture[row : row + FINE_SIZE, column : column + FINE_SIZE]
        tile[..., 2 * (k // 16)] = stored["dielectric_fine"][:, :, k].T
        tile[..., 2 * (k // 16) + 1] = stored["dielectric_fine"][:, :, min(k + 1, FINE_SIZE - 1)].T
    film = sensitivity().reshape(-1, TEXTURE_SIZE, 3)
    texture[: len(film), 3 * TEXTURE_SIZE :, :3] = film
    sheen = sheen_tables()
    texture[:SHEEN_SIZE, :SHEEN_SIZE, 3] = sheen["a"].T
    texture[:SHEEN_SIZE, SHEEN_SIZE : 2 * SHEEN_SIZE, 3] = sheen["b"].T
    texture[SHEEN_SIZE : 2 * SHEEN_SIZE, :SHEEN_SIZE, 3] = sheen["albedo"].T
    return texture


if __name__ == "__main__":
    np.savez_compressed(PATH, **make_tables())
    print(f"Wrote {PATH.name}: {', '.join(f'{name} {table.shape}' for name, table in tables().items())}.")
