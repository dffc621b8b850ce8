"""Volumes: what a material's or world's tree says about light inside, as coefficients per metre.

With c the colour and d the density (Blender manual, "Volume shaders";
Cycles' closures):

    Volume Absorption    absorbs d (1 - c)
    Volume Scatter       scatters d c
    Principled Volume    scatters d c, absorbs d (1 - c) (1 - sqrt(absorption colour)), emits, and glows by temperature
    Volume Coefficients  states all three
    Emission             emits

Mix and Add Shader weigh and add coefficients. Where a texture or attribute drives a socket, the socket's own constant
stands for it and `even` is false; such trees are compiled (volume_program.py) and evaluated on a grid (scene/media.py).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from .graph import Graph, Node
from .spectra import BLACKBODY
from .values import to_kind

STEFAN_BOLTZMANN = 5.670373e-8 * 1e-6 / np.pi  # W / (m2 K4), scaled as Cycles scales the glow of volumes
PHASES = ("HENYEY_GREENSTEIN", "FOURNIER_FORAND", "DRAINE", "RAYLEIGH", "MIE")


@dataclass(frozen=True)
class Medium:
    """A participating medium. Coefficients per metre and radiance per metre, (3,) each."""

    absorption: np.ndarray
    scattering: np.ndarray
    emission: np.ndarray
    anisotropy: float  # of the phase function, mean over what scatters; -1 back to 1 forward
    temperature: float  # kelvin, of the part that glows as a black body
    glow: float  # strength of that glow
    even: bool  # the same everywhere
    tint: tuple[float, ...] = (1.0, 1.0, 1.0)  # of the glow
    phase: str = PHASES[0]  # of the part that scatters most
    phase_values: tuple[float, ...] = (1.33, 0.1, 0.5, 20.0)  # its index, backscatter, alpha, diameter in micrometres

    @property
    def glowing(self) -> np.ndarray:
        """(3,) radiance per metre of the part that glows as a black body."""
        kelvin = max(self.temperature, 0.0)
        strength = STEFAN_BOLTZMANN * (1.0 - self.glow + self.glow * kelvin**4) if self.glow > 0 else 0.0
        place = (1.0 / max(kelvin, 1.0) - BLACKBODY.start) / BLACKBODY.extent * (BLACKBODY.count - 1)
        rows = np.array(BLACKBODY.rows())[:, :3]
        color = [np.interp(place, np.arange(BLACKBODY.count), rows[:, k]) for k in range(3)]
        return strength * np.asarray(color) * np.asarray(self.tint)

    @property
    def key(self) -> tuple:
        """Equal for media that are alike."""
        return tuple(np.ravel(getattr(self, part.name)).tobytes() for part in fields(self))

    def __mul__(self, share: float) -> Medium:
        return Medium(
            self.absorption * share, self.scattering * share, self.emission * share, self.anisotropy,
            self.temperature, self.glow * share, self.even, self.tint, self.phase, self.phase_values,
        )  # fmt: skip

    def __add__(self, other: Medium) -> Medium:
        weights = float(self.scattering.sum()), float(other.scattering.sum())
        total = sum(weights)
        mean = (self.anisotropy * weights[0] + other.anisotropy * weights[1]) / total if total > 0 else 0.0
        hotter = self if self.glow >= other.glow else other
        cloudier = self if weights[0] >= weights[1] else other
        return Medium(
            self.absorption + other.absorption, self.scattering + other.scattering, self.emission + other.emission,
            mean, hotter.temperature, self.glow + other.glow, self.even and other.even, hotter.tint,
            cloudier.phase, cloudier.phase_values,
        )  # fmt: skip


def medium_of(graph: Graph) -> Medium | None:
    """The medium that is linked to the tree's volume output; None without one."""
    if graph.volume is None or graph.volume[0] not in graph.nodes:
        return None
    return _medium(graph, graph.volume[0])


def _medium(graph: Graph, key: str) -> Medium:
    node = graph.nodes[key]
    if node.type in ("ShaderNodeAddShader", "ShaderNodeMixShader"):
        share, even = (_number(node, "Fac", 0.5), _constant(node, "Fac")) if "Mix" in node.type else (0.5, True)
        weights = (1.0 - share, share) if "Mix" in node.type else (1.0, 1.0)
        total = _empty(even)
        for name, weight in zip(("Shader", "Shader_001"), weights):
            socket = node.inputs.get(name)
            if socket is not None and socket.link is not None and socket.link[0] in graph.nodes:
                total += _medium(graph, socket.link[0]) * weight
        return total
    return _LEAVES[node.type](node) if node.type in _LEAVES else _empty(True)


def _empty(even: bool) -> Medium:
    return Medium(np.zeros(3), np.zeros(3), np.zeros(3), 0.0, 0.0, 0.0, even)


def _constant(node: Node, *names: str) -> bool:
    return all(name not in node.inputs or node.inputs[name].link is None for name in names)


def _value(node: Node, name: str, kind: str, default):
    socket = node.inputs.get(name)
    value = default if socket is None or socket.value is None else to_kind(socket.value, socket.kind, kind)
    return np.asarray(value, float)[:3] if kind != "FLOAT" else float(value)


def _number(node: Node, name: str, default: float) -> float:
    return _value(node, name, "FLOAT", default)


def _color(node: Node, name: str, default: float) -> np.ndarray:
    return np.maximum(_value(node, name, "COLOR", (default,) * 3), 0.0)


def _density(node: Node) -> float:
    return max(_number(node, "Density", 1.0), 0.0)


def _absorption(node: Node) -> Medium:
    lost = np.maximum(1.0 - _color(node, "Color", 0.8), 0.0) * _density(node)
    return Medium(lost, np.zeros(3), np.zeros(3), 0.0, 0.0, 0.0, _constant(node, "Color", "Density"))


def _scatter(node: Node) -> Medium:
    scattered = _color(node, "Color", 0.8) * _density(node)
    even = _constant(node, "Color", "Density", "Anisotropy")
    return Medium(np.zeros(3), scattered, np.zeros(3), _number(node, "Anisotropy", 0.0), 0.0, 0.0, even, **_phase(node))


def _phase(node: Node) -> dict:
    kind = str(node.properties.get("phase", PHASES[0]))
    names = (("IOR", 1.33), ("Backscatter", 0.1), ("Alpha", 0.5), ("Diameter", 20.0))
    return {
        "phase": kind if kind in PHASES else PHASES[0],
        "phase_values": tuple(_number(node, name, default) for name, default in names),
    }


def _principled(node: Node) -> Medium:
    color, density = _color(node, "Color", 0.5), _density(node)
    dark = np.maximum(1.0 - np.sqrt(_color(node, "Absorption Color", 0.0)), 0.0)
    emission = _color(node, "Emission Color", 1.0) * _number(node, "Emission Strength", 0.0)
    # An attribute that is named multiplies density, so nothing is the same everywhere.
    even = all(socket.link is None for socket in node.inputs.values())
    glow = _number(node, "Blackbody Intensity", 0.0)
    return Medium(
        density * np.maximum(1.0 - color, 0.0) * dark, density * color, emission, _number(node, "Anisotropy", 0.0),
        _number(node, "Temperature", 1000.0), glow, even, tuple(_color(node, "Blackbody Tint", 1.0)),
    )  # fmt: skip


def _coefficients(node: Node) -> Medium:
    absorbed, scattered, emitted = (
        np.maximum(_value(node, f"{name} Coefficients", "VECTOR", (0.0, 0.0, 0.0)), 0.0)
        for name in ("Absorption", "Scatter", "Emission")
    )
    even = all(socket.link is None for socket in node.inputs.values())
    return Medium(absorbed, scattered, emitted, _number(node, "Anisotropy", 0.0), 0.0, 0.0, even, **_phase(node))


def _emission(node: Node) -> Medium:
    emitted = _color(node, "Color", 1.0) * _number(node, "Strength", 1.0)
    return Medium(np.zeros(3), np.zeros(3), emitted, 0.0, 0.0, 0.0, _constant(node, "Color", "Strength"))


_LEAVES = {
    "ShaderNodeVolumeAbsorption": _absorption,
    "ShaderNodeVolumeScatter": _scatter,
    "ShaderNodeVolumePrincipled": _principled,
    "ShaderNodeVolumeCoefficients": _coefficients,
    "ShaderNodeEmission": _emission,
}
