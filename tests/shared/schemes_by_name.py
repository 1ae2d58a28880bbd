"""Schemes made from the names of their parts."""

import granular as gr
from granular.mpm.schemes import DENSITIES


def scheme_of(basis, transfer, density, **numbers):
    """A scheme; numbers of the density by their names beside those of the scheme.

    Numbers that this density does not have are left out, None for the default density.
    """
    if density is None:
        return gr.Scheme(basis=basis, transfer=transfer, **numbers)
    kind = DENSITIES[density]
    own = {name: numbers.pop(name) for name in kind.units if name in numbers}
    foreign = {name for other in DENSITIES.values() for name in other.units}
    rest = {name: value for name, value in numbers.items() if name not in foreign}
    return gr.Scheme(basis=basis, transfer=transfer, density=kind(**own), **rest)
