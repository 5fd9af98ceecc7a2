"""Whether the robot can begin at its home posture, and where it can else."""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.exceptions import ConfigurationError
from hsp_control.geometry.good_postures import PostureSearch, Rows
from hsp_control.inspection.finding import Finding
from hsp_control.robot import Robot

REGULAR = 0.03
"""Singular value below which the law is damped by default."""


def check_home(robot: Robot) -> Iterator[Finding]:
    """Yield that home is singular for the end effector, or in collision.

    Robots with a floating base are not checked: they stand on contacts.
    """
    if robot.unactuated:
        return
    search = PostureSearch(robot, tracked_by_hand(robot))
    home = search.judge(robot.home())
    wrong = []
    if home.regularity < REGULAR:
        wrong.append(
            f"singular for {robot.end_effector!r} (smallest singular value "
            f"{home.regularity:.2g})"
        )
    depth, pair = search.overlap(robot.home())
    if depth > 0.0:
        wrong.append(f"in collision ({pair} overlap by {depth:.2g} m)")
    if wrong:
        message = f"it is {' and '.join(wrong)}"
        yield Finding("warning", "home", "home posture", message, _cure(search))


def tracked_by_hand(robot: Robot) -> list[Rows]:
    """Return the rows of the end effector's pose that it can move independently.

    They are all six; or those of its position, as many as the robot can move.
    """
    spread = np.random.default_rng(0).uniform(-1.0, 1.0, robot.nv)
    q = robot.integrate(robot.home(), spread)
    J = robot.state(0.0, q, np.zeros(robot.nv)).frame(robot.end_effector).jacobian
    rows: list[int] = []
    for row in range(6 if np.linalg.matrix_rank(J, tol=1e-6) == 6 else 3):
        if np.linalg.matrix_rank(J[[*rows, row]], tol=1e-6) > len(rows):
            rows.append(row)
    return [(robot.end_effector, tuple(rows))] if rows else []


def _cure(search: PostureSearch) -> str:
    try:
        found = search.find(REGULAR)
    except ConfigurationError as error:
        return str(error)
    return f"start: {search.start_line(found)}, or start: auto"
