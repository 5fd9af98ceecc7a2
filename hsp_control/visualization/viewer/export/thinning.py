"""Fewer keyframes: as many as keep what is played within a bound at every sample."""

from collections.abc import Callable

import numpy as np

from hsp_control.common.arrays import Array, Indices

Deviation = Callable[[Array, Array], Array]
"""Distance of samples (n, k) from what is played (n, k), over its bound: shape (n,)."""


def thin(
    times: Array,
    samples: Array,
    kept: Array,
    between: Callable[[Array, Array, Array], Array],
    deviation: Deviation,
) -> Indices:
    """Return the rows of the keyframes.

    As Douglas and Peucker (1973) thin a line: a stretch whose worst sample lies beyond
    the bound is cut there. All stretches are cut at once, until none is to be cut.

    Args:
        times: Of the samples [s], ascending, shape (n,).
        samples: What is to be played, shape (n, k).
        kept: What a keyframe at each row would say, shape (n, k): the sample rounded.
        between: Returns what is played between two keyframes at a fraction of the way:
            shapes (n, k), (n, k), (n, 1).
        deviation: Over 1 where the bound is broken.
    """
    last = len(times) - 1
    rows = np.arange(len(times))
    keys = np.unique([0, last])
    while len(keys) < len(times):
        stretch = np.clip(np.searchsorted(keys, rows, side="right") - 1, 0, None)
        left = keys[stretch]
        right = keys[np.minimum(stretch + 1, len(keys) - 1)]
        length = times[right] - times[left]
        fraction = (times - times[left]) / np.where(length > 0.0, length, 1.0)
        played = between(kept[left], kept[right], fraction[:, None])
        beyond = deviation(samples, played)
        beyond[keys] = 0.0  # a keyframe cannot be nearer than its rounding
        worst = np.maximum.reduceat(beyond, keys)
        first = np.flatnonzero((beyond == worst[stretch]) & (beyond > 1.0))
        if not len(first):
            break
        _, one_each = np.unique(stretch[first], return_index=True)
        keys = np.union1d(keys, first[one_each])
    return keys


def on_line(left: Array, right: Array, fraction: Array) -> Array:
    """Return the point on the line from left to right."""
    return left + fraction * (right - left)


def on_sphere(left: Array, right: Array, fraction: Array) -> Array:
    """Return the unit quaternion on the short way from left to right."""
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


def stays(left: Array, right: Array, fraction: Array) -> Array:
    """Return left, up to right: what jumps."""
    return np.where(fraction >= 1.0, right, left)


def distance(bound: float) -> Deviation:
    """Return the deviation that is a distance, over its bound."""
    return lambda samples, played: np.linalg.norm(samples - played, axis=1) / bound


def angle(bound: float) -> Deviation:
    """Return the deviation that is the angle [rad] of a rotation, over its bound."""

    def deviation(samples: Array, played: Array) -> Array:
        # |a - b| = 2 sin(angle / 4): well conditioned near zero, as arccos is not.
        ends = np.stack([samples - played, samples + played])
        chord = np.linalg.norm(ends, axis=2).min(axis=0)
        return np.asarray(4.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0)) / bound)

    return deviation
