"""Put a robot on the ground."""

from collections.abc import Iterable

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError
from hsp_control.constraints.contacts import Contact
from hsp_control.declaration import within
from hsp_control.robot import Robot


def put_on_ground(
    height: float, contacts: Iterable[Contact], robot: Robot, q: Array
) -> Array:
    """Return q with the root moved vertically: the lowest contact is then at a height.

    Args:
        height: The height [m].
        contacts: The contacts.
        robot: The robot.
        q: Configuration, shape (nq,).

    Raises:
        ContactError: If the robot has no free-flyer root, or no contact.
        FrameNotFoundError: If the frame of a contact does not exist.
    """
    contacts = list(contacts)
    if not (robot.unactuated and contacts):
        lacks = "contact" if robot.unactuated else "free-flyer root"
        with within("start", "ground"):
            raise ContactError(f"{robot.name} has no {lacks} to put on the ground")
    state = robot.state(0.0, q, np.zeros(robot.nv))
    lowest = np.inf
    for contact in contacts:
        with within("contacts", contact.name, "frame"):
            frame = state.frame(contact.frame)
        heights = (frame.position + contact.arms(frame))[:, 2]
        lowest = min(lowest, float(heights.min()))
    # The displacement of a root is expressed in its own axes.
    root = next(iter(robot.joints.values()))
    lift = np.zeros(robot.nv)
    up = state.data.oMi[1].rotation.T @ np.array([0.0, 0.0, height - lowest])
    lift[root.idx_v : root.idx_v + 3] = up
    return robot.integrate(q, lift)
