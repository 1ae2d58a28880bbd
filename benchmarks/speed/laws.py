"""Time per point of the constitutive laws alone, for each instruction set.

The points are as in a flow: elastic strains of about 1e-3 and strain increments of about 1e-4 per
step, or of 0.1, beyond the short series of the finite-strain law. All 4,096 points fit in the
second-level cache. Times are processor times, best of several batches. mu_I is the hypoelastic law,
for comparison. "loose" are stress-free points: their time is the time of the call and its checks,
which the other times contain, too.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from bits_cases import available
from shared import least_time, parser_of, write

import granular as gr
from granular import _core

PARAMETERS = {
    "K": 1e6, "G": 5e5, "mu_s": 0.38, "mu_2": 0.64, "I0": 0.28, "rho_s": 2500.0, "d": 4e-3,
    "t0": 1e-3, "p_averaging": 0.0, "reconnect_fluidity": 1.0,
    "xi": 0.28 / (4e-3 * 50.0), "cohesion": 0.0, "tensile_strength": 0.0,
}  # fmt: skip
FLOWS = ("drucker_prager", "mu_I", "linear_ngf", "ngf")
POINTS, DT = 4096, 1e-4


def state(dim: int, strain: float, p: float = 1000.0) -> dict[str, np.ndarray]:
    """Velocity gradients times dt of the size `strain`, and stresses at the pressure `p` [Pa]."""
    rng = np.random.default_rng(1)
    stress = rng.uniform(-300.0, 300.0, (4 if dim == 2 else 6, POINTS))
    stress[:3] -= 1000.0
    return {
        "gradient": strain * rng.uniform(-1.0, 1.0, (dim * dim, POINTS)),
        "log_density": np.full(POINTS, p / PARAMETERS["K"]),
        "stress": stress,
        "g": rng.uniform(0.1, 10.0, POINTS),
        "shear_rate": rng.uniform(0.0, 1.0, POINTS),
    }


def finite_strain(flow: str, dim: int, strain: float, isa: str) -> Callable[[], None]:
    """One call of the finite-strain law."""
    loose = flow == "loose"
    arrays = state(dim, strain, -1.0 if loose else 1000.0)
    flow = FLOWS[-1] if loose else flow
    return lambda: _core.hencky_update(flow, PARAMETERS, DT, *arrays.values(), isa)


def hypoelastic(dim: int, strain: float, isa: str) -> Callable[[], None]:
    """One call of the hypoelastic mu(I) law."""
    arrays, lanes = state(dim, strain), _core.build_info(isa)["lanes"]
    blocks = arrays["gradient"].reshape(dim * dim, -1, lanes).transpose(1, 0, 2).copy()
    rest = arrays["log_density"], arrays["stress"], arrays["shear_rate"]
    return lambda: _core.law_update("mu_I", dim, PARAMETERS, DT, 1, blocks, *rest, isa)


def best_time(call: Callable[[], None], batches: int) -> float:
    """Nanoseconds per point."""

    def several() -> None:
        for _ in range(20):
            call()

    return least_time(several, batches) / (20 * POINTS) * 1e9


def main(argv: list[str] | None = None) -> None:
    arguments = parser_of(__name__, __doc__, "few batches, to see that it runs").parse_args(argv)
    batches, rows = 2 if arguments.quick else 40, []
    print(f"compiler {gr.show_config()['compiler']}; ns/point")
    print(f"{'law':24s}{'strain':>8s}{'isa':>10s}{'plane':>8s}{'space':>8s}")
    for law, strain in [*((name, 1e-4) for name in ("mu_I", "loose", *FLOWS)), (FLOWS[-1], 0.1)]:
        for isa in available():
            times = []
            for dim in (2, 3):
                call = (
                    hypoelastic(dim, strain, isa)
                    if law == "mu_I"
                    else finite_strain(law, dim, strain, isa)
                )
                times.append(best_time(call, batches))
            print(f"{law:24s}{strain:8.0e}{isa:>10s}{times[0]:8.2f}{times[1]:8.2f}", flush=True)
            rows.append({"law": law, "strain": strain, "isa": isa, "ns": times})
    write(arguments.out, {"rows": rows})
