"""The truth of scenes of `bench reflections`: two pictures by Cycles, of as many samples as their light needs.

A path tracer finds a lamp by way of glass or a mirror by chance alone: with the chance p that a ray of the floor's lobe
meets the lamp's image, the squared error of n samples is 1 / (p n) of the light's square, and no sample brings more
than the lamp's own radiance. So its mean converges, but by tens of thousands of samples where p is a hundredth:
LEAST. Light tracing agrees where it was made (`bench caustics`, `bench prism`).

Of glass that disperses each channel is a scene of its own (glass_scenes.CHANNELS).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

LEAST = {  # samples of each picture
    "facing mirrors": 1024, "gloss below glass": 16384, "metal below glass": 4096, "prism": 1024,
    "softboxes of the world": 1024, "stained slab": 8192, "two mirrors": 1024,
}  # fmt: skip


def reference(name: str, samples: int, size: tuple[int, int]):
    """`addon.compare.cache.Reference` of the scene of that name, from the cache where it was made before. Leaves the
    scene open that Candela is to show."""
    from addon.compare.reference import reference as by_cycles

    from . import glass_scenes, reflection_scenes

    samples = max(samples, LEAST.get(name, 0))

    def made(scene):
        return by_cycles(scene, samples, size=size, extra=bounces(scene))

    channels = [made(reflection_scenes.begun(name, fill)) for fill in glass_scenes.CHANNELS.get(name, ())]
    scene = reflection_scenes.make(name)
    return joined(channels) if channels else made(scene)


def joined(channels):
    """Of three references the red of the first, the green of the second and the blue of the third."""
    first = channels[0]
    images, halves = (
        {
            key: np.stack([getattr(one, kind)[key][..., k] for k, one in enumerate(channels)], axis=-1)
            for key, pixels in getattr(first, kind).items()
            if pixels.shape[-1] >= len(channels)
        }
        for kind in ("images", "half")
    )
    return replace(first, images=images, half=halves, seconds=sum(one.seconds for one in channels))


def bounces(scene) -> list[tuple]:
    """Settings of Cycles for a scene whose mirrors are to show as many of each other as Candela's do."""
    return [(scene.cycles, "glossy_bounces", scene["glossy_bounces"])] if "glossy_bounces" in scene else []
