"""Synthetic packings of the tests, noise and errors, shared by the figures of the inference."""

from __future__ import annotations

import argparse
import sys
import warnings
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from common import parser_of
from numpy.typing import NDArray

from granular.grain_scale.inference import InferenceWarning, Packing

# The tests contain a small discrete element code, which is not part of the package.
sys.path.append(str(Path(__file__).parents[2] / "tests/shared"))
import grains

__all__ = ["chosen_options", "grains", "quietly", "relative_error", "with_noise"]

Array = NDArray[np.float64]


def chosen_options(doc: str | None, argv: Sequence[str] | None) -> argparse.Namespace:
    """Parse the options --quick and --out."""
    return parser_of(doc).parse_args(argv, argparse.Namespace(note="synthetic data"))


def with_noise(
    packing: Packing, rng: np.random.Generator, *, bias: float = 0.15, spread: float = 0.1
) -> Packing:
    """Stresses with the noise of eq. 2.16, independent in each component."""
    noise = np.triu(1 + bias + rng.normal(0, spread, packing.stresses.shape))
    return replace(packing, stresses=packing.stresses * (noise + np.triu(noise, 1).swapaxes(1, 2)))


def relative_error(found: Array, true: Array) -> float:
    """Error of all forces, eq. 2.15."""
    return float(np.linalg.norm(found - true) / np.linalg.norm(true))


def quietly(infer: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """Result of an inference without its warnings, as the picture shows the flags."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", InferenceWarning)
        return infer(*arguments, **options)
