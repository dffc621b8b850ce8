"""The registry: every technique of Candela, in the order in which they run when nothing else decides."""

from __future__ import annotations

from ..frame.technique import Technique
from .accumulated_maps import AccumulatedMaps
from .airlight import Airlight
from .ambient_occlusion import AmbientOcclusion
from .caustics_mapping import CausticsMapping
from .clustered_visibility import ClusteredVisibility
from .cryptomatte import Cryptomatte
from .cssm import ConvolutionSoftShadows
from .denoise import Denoise
from .depth_complexity import DepthComplexity
from .direct_light import DirectLight
from .directional_occlusion import DirectionalOcclusion
from .edit_heat import EditHeat
from .emissive_light import EmissiveLight
from .environment_area_lights import EnvironmentAreaLights
from .environment_light import EnvironmentLight
from .eye import EyeModel
from .film import Film
from .grass import Grass
from .history import History
from .image_space_subsurface import ImageSpaceSubsurface
from .imperfect_shadow_maps import ImperfectShadowMaps
from .implicit_visibility import ImplicitVisibility
from .instant_radiosity import InstantRadiosity
from .light_probes import LightProbes
from .media import MediaAttenuation
from .micro_rendering import MicroRendering
from .multires_radiosity import MultiresRadiosity
from .penumbra_wedges import PenumbraWedges
from .reflection_editing import ReflectionEditing
from .relief import Relief
from .screen_space_photons import ScreenSpacePhotons
from .shaded_reflections import ShadedReflections
from .shader_aovs import ShaderAovs
from .shadows_by_light import ShadowsByLight
from .ssdo import ScreenSpaceBounce
from .surfaces import Surfaces
from .temporal_glare import TemporalGlare
from .traced_glossy import TracedGlossy
from .traced_refraction import TracedRefraction
from .volume_caustics import VolumeCaustics
from .vssm import VarianceSoftShadows

REGISTRY: tuple[type[Technique], ...] = (
    MediaAttenuation,
    Grass,
    Relief,
    Surfaces,
    ReflectionEditing,
    LightProbes,
    AccumulatedMaps,
    VarianceSoftShadows,
    ConvolutionSoftShadows,
    DepthComplexity,
    PenumbraWedges,
    ShadowsByLight,
    DirectLight,
    EmissiveLight,
    EnvironmentLight,
    EnvironmentAreaLights,
    DirectionalOcclusion,
    TracedGlossy,
    TracedRefraction,
    Airlight,
    VolumeCaustics,
    InstantRadiosity,
    MultiresRadiosity,
    ClusteredVisibility,
    ImperfectShadowMaps,
    MicroRendering,
    ImplicitVisibility,
    ScreenSpaceBounce,
    CausticsMapping,
    ScreenSpacePhotons,
    ShadedReflections,
    ImageSpaceSubsurface,
    ShaderAovs,
    Cryptomatte,
    AmbientOcclusion,
    History,
    Film,
    Denoise,
    TemporalGlare,
    EyeModel,
    EditHeat,
)


def make_registry() -> tuple[Technique, ...]:
    """Fresh instances of all techniques, for one renderer."""
    return tuple(technique() for technique in REGISTRY)
