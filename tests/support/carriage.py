"""A carriage on a rail, which is a linear mode, and the check of its loop."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import hsp_control as hsp
from hsp_control.control.compensation.linear_loop import LinearLoop

MASS = 2.0
URDF = f"""<robot name="carriage"><link name="rail"/><link name="carriage">
<inertial><mass value="{MASS}"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="slide" type="prismatic"><parent link="rail"/>
<child link="carriage"/><axis xyz="1 0 0"/>
<limit lower="-10" upper="10" effort="1000" velocity="100"/></joint></robot>"""


def carriage(folder: Path) -> hsp.Robot:
    file = folder / "carriage.urdf"
    file.write_text(URDF)
    return hsp.Robot.load(str(file))


def check_that_it_is_the_loop(
    x: NDArray[np.float64], loop: LinearLoop, other: LinearLoop, rounding: float = 1e-12
) -> None:
    """By Cayley and Hamilton positions obey the polynomial of the transition matrix.

    This holds once the motion from before the run has passed; other polynomials fail.
    """
    worst = []
    for each in (loop, other):
        coefficients = np.poly(each.transition())[::-1]
        n = len(coefficients)
        worst.append(
            max(abs(coefficients @ x[k : k + n]) for k in range(8, len(x) - n))
        )
    assert worst[0] < rounding * max(1.0, np.abs(x).max())
    assert worst[1] > 1e3 * worst[0]
