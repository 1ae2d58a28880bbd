"""Wrong arrays and numbers for calls of the core."""

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

from granular import _core
from granular.mpm import engine as core

DOCUMENTED = (TypeError, ValueError, OverflowError, RuntimeError, MemoryError)
QUICK = settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)


class Wrapped(np.ndarray):
    """Subclass that the core must not accept as an array."""


def spoiled(array, how):
    """Return an array that is wrong in one way, or an object that is not an array."""
    with np.errstate(all="ignore"):
        return {
            "float32": lambda: array.astype(np.float32),
            "int32": lambda: array.astype(np.int32),
            "object": lambda: array.astype(object),
            "swapped": lambda: array.astype(array.dtype.newbyteorder()),
            "fortran": lambda: np.asfortranarray(np.stack([array, array])),
            "strided": lambda: np.repeat(array, 2, axis=-1)[..., ::2],
            "backwards": lambda: array[..., ::-1],
            "read-only": lambda: np.frombuffer(array.tobytes(), array.dtype).reshape(array.shape),
            "empty": lambda: array[..., :0],
            "short": lambda: array[..., :-1].copy(),
            "long": lambda: np.concatenate([array, array], axis=-1),
            "flat": lambda: array.ravel()[:-1].copy(),
            "deep": lambda: array[None].copy(),
            "scalar": lambda: np.array(1.0),
            "subclass": lambda: array.view(Wrapped),
            "unaligned": lambda: np.frombuffer(
                bytearray(array.nbytes + 1), np.uint8, array.nbytes, 1
            ).view(array.dtype).reshape(array.shape),
            "list": array.tolist,
            "none": lambda: None,
            "number": lambda: 3.5,
            "text": lambda: "array",
        }[how]()  # fmt: skip


WAYS = (
    "float32", "int32", "object", "swapped", "fortran", "strided", "backwards", "read-only",
    "empty", "short", "long", "flat", "deep", "scalar", "subclass", "unaligned", "list", "none",
    "number", "text",
)  # fmt: skip

numbers = st.one_of(
    st.floats(),
    st.integers(-(2**70), 2**70),
    st.sampled_from([None, "1", (), 1j, True, np.float64("nan"), 2**63, -(2**31) - 1]),
)


def arguments(scene, mean_mass=1.0):
    """Keyword arguments with which the engine of this scene is built."""
    caught = {}

    class Catcher:
        def __init__(self, **keywords):
            caught.update(keywords)

    before, _core.Engine = _core.Engine, Catcher
    try:
        core.build(scene, mean_mass)
    finally:
        _core.Engine = before
    return caught
