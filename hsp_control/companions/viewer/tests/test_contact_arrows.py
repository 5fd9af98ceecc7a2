"""Arrows of contact forces: origin, direction, length, thickness."""

import numpy as np
import pytest
from clips import Clip, Recorder

from hsp_control import Robot, Rollout
from hsp_control.common.arrays import Array
from hsp_control.companions.viewer import Viewer
from hsp_control.companions.viewer.motion import motion_of

TIMES = np.array([0.0, 0.02, 0.04, 0.06])
FORCES = {
    "left": np.array([[0, 0, 80.0], [30.0, -20, 60], [0, 0, 0], [-5.0, 0, 1.0]]),
    "right": np.array([[0, 0, 0.0], [0, 40.0, -9.0], [0.5, 0.4, 0.3], [0, 0, 400.0]]),
}
NONE = [np.nan] * 3
PLACES = {
    "left": np.array([[0.1, 0.2, 0.3], [0.2, 0.2, 0.3], NONE, [0.4, 0.1, 0.0]]),
    "right": np.array([NONE, [0.5, 0.2, 0.1], [0.5, 0.3, 0.1], [0.6, 0.3, 0.1]]),
}
HELD = {
    "left": np.array([*PLACES["left"][:2], PLACES["left"][1], PLACES["left"][3]]),
    "right": np.array([PLACES["right"][1], *PLACES["right"][1:]]),
}
"""An unknown position of a contact is the previous or the next one."""


@pytest.fixture(scope="module")
def drawn() -> tuple[float, Clip]:
    """Return the size of the scene [m], and the drawn objects."""
    robot = Robot.load("panda")
    columns = {
        "t": TIMES,
        "q": np.tile(robot.home(), (len(TIMES), 1)),
        "v": np.zeros((len(TIMES), robot.nv)),
    }
    for name in FORCES:
        columns[f"contact.{name}.position"] = PLACES[name]
        columns[f"contact.{name}.force"] = FORCES[name]
    recorder, run = Recorder(), Rollout(columns, {"status": "completed"})
    Viewer(robot, transport=recorder).play(run)
    return motion_of(robot, run).size, Clip(recorder)


WEIGHT = 9.81 * sum(inertia.mass for inertia in Robot.load("panda").model.inertias)


def vector(clip: Clip, path: str, t: float) -> Array:
    """Return the arrow's vector from its origin to its tip, shape (3,) [m]."""
    length = clip.value(path, "scale", t)[2]
    return np.asarray(clip.pose(path, t)[:3, 2] * length)


@pytest.mark.parametrize("name", FORCES)
def test_they_begin_at_their_contacts(name: str, drawn: tuple[float, Clip]) -> None:
    _, clip = drawn
    for thing in ("force", "point"):
        found = [clip.value(f"/contacts/{name}/{thing}", "position", t) for t in TIMES]
        np.testing.assert_allclose(found, HELD[name], atol=1e-6)


@pytest.mark.parametrize("name", FORCES)
def test_they_are_the_forces(name: str, drawn: tuple[float, Clip]) -> None:
    """An arrow of the robot's weight is half as long as the robot."""
    size, clip = drawn
    path, whole = f"/contacts/{name}/force", 0.5 * size / WEIGHT
    for t, force in zip(TIMES, FORCES[name], strict=True):
        np.testing.assert_allclose(vector(clip, path, t), whole * force, atol=1e-5)


@pytest.mark.parametrize("name", FORCES)
def test_short_ones_are_thinner(name: str, drawn: tuple[float, Clip]) -> None:
    """Arrows longer than 12 radii have their full width; none is wider."""
    size, clip = drawn
    path = f"/contacts/{name}/force"
    for t in TIMES:
        x, y, length = clip.value(path, "scale", t)
        assert x == y
        assert x == pytest.approx(min(length / (12.0 * 0.007 * size), 1.0))


@pytest.mark.parametrize("name", FORCES)
def test_a_contact_without_force_is_not_shown(
    name: str, drawn: tuple[float, Clip]
) -> None:
    _, clip = drawn
    for t, force in zip(TIMES, FORCES[name], strict=True):
        shown = clip.value(f"/contacts/{name}/point", "visible", t)
        assert shown == float(force.any())
