"""The arm that carries a hand in a compiled MuJoCo scene."""

from collections.abc import Iterator, Sequence
from typing import Any

from numpy.typing import ArrayLike

from hsp_control.common.errors import FrameNotFoundError, ModelError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.mujoco.scene import Names
from hsp_control.robot import Robot


def arm_of(
    model: Any, qpos: ArrayLike, frame: str, joints: Sequence[str] | None = None
) -> Robot:
    """Return the arm from the world to a frame, with MuJoCo's parameters.

    Its joints are those that carry the frame. All others are locked: fingers, other
    arms, objects.

    Args:
        model: The scene, a ``mujoco.MjModel``.
        qpos: Its configuration, shape (model.nq,), where the other joints are locked.
        frame: A body or a site: the hand.
        joints: The names of the joints, if they are known, to be checked.

    Raises:
        FrameNotFoundError: If there is no such body or site.
        ModelError: If no joint carries the frame, or one does that is not in
        ``joints``: the arm's base moves.
    """
    names = Names(model)
    chain = list(_chain(model, _body_of(model, names, frame)))
    carrying = [
        names.joints[joint]
        for joint in range(model.njnt)
        if int(model.jnt_bodyid[joint]) in chain
    ]
    if not carrying:
        raise ModelError(f"no joint moves {frame!r}")
    others = [name for name in carrying if name not in (joints or carrying)]
    if others:
        raise ModelError(
            f"{frame!r} is also moved by {listing(others)}, which the arm does not "
            "contain; its base must stand still"
        )
    return Robot.from_mujoco(model, names.bodies[chain[-1]], carrying, qpos=qpos)


def _chain(model: Any, body: int) -> Iterator[int]:
    """Yield a body and those that carry it, without the world."""
    while body:
        yield body
        body = int(model.body_parentid[body])


def _body_of(model: Any, names: Names, frame: str) -> int:
    if frame in names.bodies:
        return names.bodies.index(frame)
    if frame in names.sites:
        return int(model.site_bodyid[names.sites.index(frame)])
    known = (*names.bodies, *names.sites)
    raise FrameNotFoundError(
        f"no body or site {frame!r}{did_you_mean(frame, known)} "
        f"(the scene has {listing(known)})"
    )
