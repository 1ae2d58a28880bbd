"""Noise of measurements, errors of results, and the check for the conic solver."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from granular.grain_scale.inference import InferenceWarning, Packing
from granular.tools.arrays import Array
from granular.tools.extras import imported

T = TypeVar("T")


def with_noise(
    packing: Packing, rng: np.random.Generator, *, bias: float = 0.15, spread: float = 0.1
) -> Packing:
    """Stresses with the noise of eq. 2.16, independent in each component."""
    noise = np.triu(1 + bias + rng.normal(0, spread, packing.stresses.shape))
    return replace(packing, stresses=packing.stresses * (noise + np.triu(noise, 1).swapaxes(1, 2)))


def relative_error(inferred: Array, true: Array) -> float:
    """Error of all forces, eq. 2.15."""
    return float(np.linalg.norm(inferred - true) / np.linalg.norm(true))


def quietly(infer: Callable[..., T], *arguments: Any, **options: Any) -> T:
    """Result of an inference without its warnings, for data that are known to be poor."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InferenceWarning)
        return infer(*arguments, **options)


def needs_solver() -> None:
    """Refuse early, with the command that installs it, if the conic solver is missing."""
    imported("clarabel", "inference")


def standard_error(values: Sequence[float]) -> float:
    """Standard error of the mean of values; nan of a single one."""
    return float(np.std(values, ddof=1) / np.sqrt(len(values))) if len(values) > 1 else np.nan
