"""Check that the palette's colours stay apart for all eyes."""

import itertools

import matplotlib as mpl
import numpy as np
import pytest

from hsp_control.visualization import palette

# Machado, Oliveira, Fernandes (2009), severity 1, on linear RGB.
BLINDNESS = {
    "none": np.eye(3),
    "protan": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
     [-0.003882, -0.048116, 1.051998]],
    "deutan": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
     [-0.011820, 0.042940, 0.968881]],
    "tritan": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
     [0.004733, 0.691367, 0.303900]],
}  # fmt: skip


def lab(color: str, blindness: str) -> np.ndarray:
    """Return CIE L*a*b* of a colour as an eye sees it."""
    srgb = np.array(mpl.colors.to_rgb(color))
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.asarray(BLINDNESS[blindness]) @ linear, 0.0, 1.0)
    xyz = (
        np.array(
            [
                [0.4124564, 0.3575761, 0.1804375],
                [0.2126729, 0.7151522, 0.0721750],
                [0.0193339, 0.1191920, 0.9503041],
            ]
        )
        @ seen
        / [0.95047, 1.0, 1.08883]
    )
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("blindness", BLINDNESS)
@pytest.mark.parametrize(
    "colors",
    [
        palette.SERIES,
        palette.TASKS,
        (palette.ACTUAL, palette.DESIRED, palette.OBSTACLE, palette.LINK,
         palette.JOINT),
        (palette.TASK, palette.WARNING, palette.PAPER),
        (palette.FIELD, palette.INK, palette.WARNING, palette.PAPER),
        (palette.EARLY, palette.LATE, palette.OBSTACLE, palette.DESIRED),
    ],
)  # fmt: skip
def test_colours_stay_apart_for_all_eyes(
    colors: tuple[str, ...], blindness: str
) -> None:
    for one, other in itertools.combinations(colors, 2):
        assert np.linalg.norm(lab(one, blindness) - lab(other, blindness)) > 12.0
