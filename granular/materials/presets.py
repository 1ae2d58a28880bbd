"""Ready materials, with the sources of their numbers."""

from granular.materials.laws import NGF, HardeningDruckerPrager, MuI

glass_beads = MuI(E=1e9, nu=0.3, mu_s=0.3819, mu_2=0.6435, rho_s=2450.0, rho_c=1500.0, xi=1.1233)
"""Glass beads of Dunatunga & Kamrin 2015, table 1 (after Jop et al. 2006)."""

glass_beads_5mm = MuI(
    E=1e9, nu=0.3, mu_s=0.3819, mu_2=0.6435, rho_s=2450.0, rho_c=1500.0, I0=0.278, d=5e-3
)
"""The same beads with a grain diameter: I0 = 0.278 and d = 5 mm give xi = 1.1233 to all digits."""

silo_grains = NGF(
    E=1e6, nu=0.45, mu_s=0.3819, mu_2=50.0, rho_s=2450.0, rho_c=1500.0, b=1.0, A=1.0, t0=1e-3,
    d=0.14,
)  # fmt: skip
"""Grains of the clogging silos of Dunatunga & Kamrin, "Modeling silo clogging", section 7; d is as
large as the width of their opening."""

couette_beads = NGF(
    E=90 / 31 * 1e6, nu=14 / 31, mu_s=0.3819, mu_2=0.6435, rho_s=2550.0, rho_c=0.645 * 2550.0,
    I0=0.278, A=0.48, t0=1e-4, d=4e-3, rheology="linear_mu_I", elasticity="hencky",
)  # fmt: skip
"""Beads between cylinders of Haeri & Skonieczny 2021, table 1 (S = 1, B = 10 MPa).

They are packed to 64.5 %.
"""

grc_1 = NGF(
    E=15e6, nu=0.3, mu_s=0.70, mu_2=0.96, rho_s=2583.0, rho_c=0.67 * 2583.0,
    I0=0.278, A=0.48, t0=1e-4, d=3e-4, rheology="linear_mu_I", elasticity="hencky",
)  # fmt: skip
"""Soil simulant GRC-1 of Haeri & Skonieczny 2021, table 1 (S = 5.8, B = 12.5 MPa).

It is packed to 67 %.
"""

grc_1_hardening = HardeningDruckerPrager(
    E=grc_1.E, nu=grc_1.nu, rho_s=grc_1.rho_s, rho_c=grc_1.rho_c,
    h0_deg=44.0, h1_deg=9.0, h2=0.2, h3_deg=9.0,
)  # fmt: skip
"""The same soil with the hardening Drucker-Prager law, for the comparison of their section 4.2.

The friction angle is 35 degrees at the start and 44 degrees in the end.
"""
