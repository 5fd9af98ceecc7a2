"""Reduces samples to keyframes whose interpolation stays within an error bound."""

from collections.abc import Callable

import numpy as np

from hsp_control.common.arrays import Array, Indices

RelativeError = Callable[[Array, Array], Array]
"""Error between samples (n, k) and played values (n, k), over its bound: shape (n,)."""


def keyframe_rows(
    times: Array,
    samples: Array,
    rounded: Array,
    interpolate: Callable[[Array, Array, Array], Array],
    error: RelativeError,
) -> Indices:
    """Return the rows of the keyframes, by the algorithm of Douglas and Peucker (1973).

    All segments whose worst sample exceeds the bound are split there, at once.
    ``times`` (n,), ``samples`` and ``rounded`` (n, k).
    """
    last = len(times) - 1
    rows = np.arange(len(times))
    keys = np.unique([0, last])
    while len(keys) < len(times):
        segment = np.clip(np.searchsorted(keys, rows, side="right") - 1, 0, None)
        left = keys[segment]
        right = keys[np.minimum(segment + 1, len(keys) - 1)]
        length = times[right] - times[left]
        fraction = (times - times[left]) / np.where(length > 0.0, length, 1.0)
        played = interpolate(rounded[left], rounded[right], fraction[:, None])
        errors = error(samples, played)
        errors[keys] = 0.0  # at a keyframe, only the rounding error is left
        worst = np.maximum.reduceat(errors, keys)
        first = np.flatnonzero((errors == worst[segment]) & (errors > 1.0))
        if not len(first):
            break
        _, first_of_each = np.unique(segment[first], return_index=True)
        keys = np.union1d(keys, first[first_of_each])
    return keys


def linear(left: Array, right: Array, fraction: Array) -> Array:
    """Interpolate linearly from left to right."""
    return left + fraction * (right - left)


def slerp(left: Array, right: Array, fraction: Array) -> Array:
    """Interpolate unit quaternions spherically, the short way from left to right."""
    cosine = np.sum(left * right, axis=1, keepdims=True)
    right = np.where(cosine < 0.0, -right, right)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6
    sine = np.where(near, 1.0, sine)
    a = np.where(near, 1.0 - fraction, np.sin((1.0 - fraction) * angle) / sine)
    b = np.where(near, fraction, np.sin(fraction * angle) / sine)
    mixed = a * left + b * right
    return np.asarray(mixed / np.linalg.norm(mixed, axis=1, keepdims=True))


def hold(left: Array, right: Array, fraction: Array) -> Array:
    """Hold the left value until the right keyframe is reached."""
    return np.where(fraction >= 1.0, right, left)


def distance_error(bound: float) -> RelativeError:
    """Return the error function: Euclidean distance over a bound."""
    return lambda samples, played: np.linalg.norm(samples - played, axis=1) / bound


def angle_error(bound: float) -> RelativeError:
    """Return the error function: angle between quaternions over a bound [rad]."""

    def error(samples: Array, played: Array) -> Array:
        # |a - b| = 2 sin(angle / 4): well conditioned near zero, as arccos is not.
        ends = np.stack([samples - played, samples + played])
        chord = np.linalg.norm(ends, axis=2).min(axis=0)
        return np.asarray(4.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0)) / bound)

    return error
