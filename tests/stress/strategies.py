"""What scenes hypothesis may draw: usual ones, and in every part the values at which renderers break."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from tests.stress.scenes import SHAPES, Lamp, Scene, Shape, Surface, Viewer


def _one_of(*values):
    return st.sampled_from(values)


def _number(low: float, high: float, *special: float):
    usual = st.floats(low, high, allow_nan=False, allow_subnormal=False).map(lambda x: float(np.float32(x)))
    return usual | st.sampled_from(special) if special else usual


def _mostly(usual: st.SearchStrategy, rare: st.SearchStrategy) -> st.SearchStrategy:
    """The rare one once in eight times; what fails is shrunk towards it."""
    return st.integers(0, 7).flatmap(lambda k: usual if k else rare)


COLOR = st.tuples(*[_number(0, 1, 0.0, 1.0)] * 3)
TURN = st.tuples(*[_number(-3.2, 3.2, 0.0, float(np.float32(np.pi / 2)))] * 3)
PLACE = st.tuples(_number(-2, 2, 0.0), _number(-2, 2, 0.0), _number(0, 2, 0.0, 1.0))
SCALE = st.tuples(*[_number(0.1, 2, 1.0)] * 3) | _one_of(
    (0.0, 0.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 1.0), (1e-6, 1e-6, 1e-6), (1e4, 1e4, 1e4)
)
SHAPE = st.builds(
    Shape,
    kind=_one_of(*SHAPES),
    location=PLACE,
    turn=TURN,
    scale=SCALE,
    material=st.integers(0, 3),
    copies=_one_of(1, 1, 1, 2, 30),
    casts_shadow=_one_of(True, True, False),
    seen=_one_of(True, True, True, False),
)
FACTOR = _number(0, 1, 0.0, 1.0)
PRINCIPLED = st.fixed_dictionaries(
    {"Base Color": COLOR.map(lambda c: (*c, 1.0)), "Roughness": FACTOR, "Metallic": FACTOR},
    optional={
        "Alpha": FACTOR,
        "IOR": _number(1.0, 3.0, 1.0, 0.5, 1000.0),
        "Transmission Weight": FACTOR,
        "Coat Weight": FACTOR,
        "Coat Roughness": FACTOR,
        "Sheen Weight": FACTOR,
        "Sheen Roughness": FACTOR,
        "Anisotropic": FACTOR,
        "Diffuse Roughness": FACTOR,
        "Subsurface Weight": FACTOR,
        "Emission Strength": _number(0, 5, 0.0, 1e6),
    },
).map(lambda inputs: Surface("ShaderNodeBsdfPrincipled", tuple(inputs.items())))
PLAIN = st.builds(
    lambda node, color, roughness: Surface(node, (("Color", (*color, 1.0)), ("Roughness", roughness))),
    _one_of(
        "ShaderNodeBsdfDiffuse", "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfGlass", "ShaderNodeBsdfTranslucent",
        "ShaderNodeBsdfTransparent", "ShaderNodeEmission", "ShaderNodeHoldout", "ShaderNodeBsdfSheen",
        "ShaderNodeBsdfRefraction", "ShaderNodeSubsurfaceScattering", "ShaderNodeBsdfToon",
    ),
    COLOR,
    FACTOR,
)  # fmt: skip
LAMP = st.builds(
    Lamp,
    kind=_one_of("POINT", "SPOT", "SUN", "AREA"),
    location=st.tuples(_number(-3, 3, 0.0), _number(-3, 3, 0.0), _number(0, 4, 0.0, 1.0)),
    turn=TURN,
    energy=_number(0, 100, 0.0, 1e-20, 1e12),
    color=COLOR,
    size=_number(0, 1, 0.0, 1e-6, 100.0),
    shape=_one_of("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"),
    cone=_number(0.02, 3.1, 0.0175),
    blend=FACTOR,
    spread=_number(0.01, 3.1, float(np.float32(np.pi))),
    casts_shadow=_one_of(True, True, False),
)
VIEWER = st.builds(
    Viewer,
    location=st.tuples(_number(-5, 5), _number(-5, 5), _number(-1, 5, 0.0)),
    orthographic=_one_of(False, False, True),
    angle=_number(0.02, 2.9, 0.8),
    span=_number(0.1, 20),
)
WORLD = st.none() | st.tuples(
    _number(0, 1, 0.0), _number(0, 1, 0.0), _number(0, 1, 0.0), _number(0, 3, 0.0, 1e-20, 1e9)
)


def scenes(slots: dict[str, list[str]]) -> st.SearchStrategy[Scene]:
    """Scenes whose slots hold Auto or one of the techniques given by slot."""
    chosen = st.fixed_dictionaries({}, optional={slot: st.sampled_from(names) for slot, names in slots.items()})
    return st.builds(
        Scene,
        shapes=_mostly(
            st.lists(SHAPE, min_size=1, max_size=4).map(lambda shapes: (Shape("floor"), *shapes)),
            st.lists(SHAPE, max_size=1).map(tuple),
        ),
        surfaces=st.lists(PRINCIPLED | PLAIN, min_size=1, max_size=3).map(tuple),
        lamps=_mostly(st.lists(LAMP, min_size=1, max_size=4), st.just([])).map(tuple),
        world=WORLD,
        viewer=VIEWER,
        unit=_one_of(1.0, 1.0, 1.0, 1e-3, 1e3),
        transparent=st.booleans(),
        shadows_by=_one_of("COST", "RAYS", "MAPS"),
        slots=chosen.map(lambda names: tuple(sorted(names.items()))),
        bounces=_one_of(0, 1, 3),
        samples=_one_of(2, 1, 4),
    )
