"""Materials: constitutive laws with their parameters, ready materials, and user-defined laws."""

from granular.materials.base import Material
from granular.materials.laws import (
    NGF,
    DruckerPrager,
    Elastic,
    HardeningDruckerPrager,
    MuI,
)
from granular.materials.own import OwnLaw, code_of, from_function, trust_code
from granular.materials.presets import (
    couette_beads,
    glass_beads,
    glass_beads_5mm,
    grc_1,
    grc_1_hardening,
    silo_grains,
)
from granular.materials.regularised import RegularisedMuI

__all__ = [
    "NGF",
    "DruckerPrager",
    "Elastic",
    "HardeningDruckerPrager",
    "Material",
    "MuI",
    "OwnLaw",
    "RegularisedMuI",
    "code_of",
    "couette_beads",
    "from_function",
    "glass_beads",
    "glass_beads_5mm",
    "grc_1",
    "grc_1_hardening",
    "silo_grains",
    "trust_code",
]
