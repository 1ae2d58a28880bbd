"""Materials: constitutive laws with their parameters, ready materials, and user-defined laws."""

from granular.materials.base import Material as Material
from granular.materials.dilatant import DilatantMuI as DilatantMuI
from granular.materials.laws import NGF as NGF
from granular.materials.laws import DruckerPrager as DruckerPrager
from granular.materials.laws import Elastic as Elastic
from granular.materials.laws import HardeningDruckerPrager as HardeningDruckerPrager
from granular.materials.laws import MuI as MuI
from granular.materials.own import OwnLaw as OwnLaw
from granular.materials.own import code_of as code_of
from granular.materials.own import from_function as from_function
from granular.materials.own import trust_code as trust_code
from granular.materials.presets import couette_beads as couette_beads
from granular.materials.presets import glass_beads as glass_beads
from granular.materials.presets import glass_beads_5mm as glass_beads_5mm
from granular.materials.presets import grc_1 as grc_1
from granular.materials.presets import grc_1_hardening as grc_1_hardening
from granular.materials.presets import silo_grains as silo_grains
from granular.materials.regularised import RegularisedMuI as RegularisedMuI
