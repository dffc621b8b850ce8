"""Light that Denoise leaves as it is: what photons bring.

Caustics have edges that no surface shows, and little noise. So they have sums of their own beside those of the paths
whose part they are, and Denoise filters

    light - apart,  and adds apart again

Whatever these sums hold, light stays as it is in the mean; the nearer they are to what photons brought, the less of
that is blurred. Of a sample that is shown at several points of the film (film/points.py) they hold that of its own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

from ..film import filter as film_filter
from ..frame.picture import Frame
from ..frame.technique import Technique, Write
from ..gfx import images, passes
from ..scene.media import has_media


def apart_of(path: str) -> str:
    """Name of what is kept apart of a light path; its sum is the image `film.NAME`."""
    return f"{path}_apart"


class KeptApart:
    """Of the paths that one technique brings photons to. `begin` it with each picture."""

    def __init__(self):
        self._paths: tuple[str, ...] = ()

    def begin(self, frame: Frame, paths: Sequence[str]) -> None:
        """`paths`: names of light paths. Where media dim what the film sees, nothing is kept apart."""
        wanted = frame.plan.runs("denoise") and frame.settings.samples > 1 and not has_media(frame.snapshot)
        self._paths = tuple(paths) if wanted else ()
        for path in self._paths:
            frame.held.add(Write(f"film.{apart_of(path)}", "RGBA32F", "Light that Denoise leaves as it is", True))

    @contextmanager
    def drawing(self, frame: Frame, technique: Technique) -> Iterator[None]:
        """What is added to the images of the paths within is theirs."""
        with ExitStack() as stack:
            before = [stack.enter_context(images.borrowed(*frame.size, "RGBA32F")) for _ in self._paths]
            for path, target in zip(self._paths, before):
                passes.copy(frame.images[f"radiance.{path}"], target)
            yield
            names, place = [f"film.{apart_of(path)}" for path in self._paths], frame.film_offset(frame.sample)
            found = [frame.images[f"radiance.{path}"] for path in self._paths]
            for light, share in (([target.colors[0] for target in before], -1.0), (found, 1.0)):
                film_filter.add(frame, dict(zip(names, light)), place, share)
        frame.count(technique, "passes", 2 * bool(self._paths) + len(self._paths))
