"""The document."""

from granular.papers.figure import Document

PAPER = Document(
    "hurley_thesis",
    "R. C. Hurley, thesis on forces between grains (J. Mech. Phys. Solids 63, 2014; Exp. Mech., "
    "2015), the friction of inertial flows (Granular Matter 17, 287-295, 2015) and dilative "
    "viscoplastic flow by SPH",
)
