"""Motion generators: from a client's commands to a desired motion of the joints."""

from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.companions.franka.layouts import PERIOD, Error, MotionGenerator
from hsp_control.companions.franka_box import hand, reference, reflexes
from hsp_control.companions.franka_box.arm import ELBOW_FLIP, ArmLimits
from hsp_control.companions.franka_box.hand import HandMotion
from hsp_control.companions.franka_box.model import Model
from hsp_control.companions.franka_box.reflexes import Reference, Violation

_ELBOW = 2
"""Index of the joint whose position is the elbow's."""
_SINGULAR = 0.03
"""Share of the largest singular value below which joints are not moved."""


class Generator(ABC):
    """Makes a desired motion of the joints, period by period.

    Attributes:
        reference: The desired motion.
        hand: The desired motion of the hand, if the hand is commanded.
    """

    def __init__(self, start: Reference, limits: ArmLimits) -> None:
        """Begin at a posture."""
        self.reference, self.limits = start, limits
        self.hand: HandMotion | None = None
        # after the first command, if it continues from the start
        self._under_way: tuple[Reference, HandMotion | None] | None = None

    def follow(self, command: np.void, *, first: bool) -> list[Violation]:
        """Follow a command, and return its violations.

        The first that arrives is often not the first of its client, which needs longer
        for that: then the motion has been under way since the start. The second one
        decides.
        """
        start = self.reference, self.hand
        found = list(self._follow(command, first=first))
        begun = self.reference, self.hand
        if first:
            self.reference, self.hand = start
            late = not any(self._follow(command, first=False))
            self._under_way = (self.reference, self.hand) if late else None
            self.reference, self.hand = begun
        elif self._under_way is not None:
            if found:
                self.reference, self.hand = self._under_way
                found = list(self._follow(command, first=False))
            self._under_way = None
        return found

    def extrapolate(self) -> None:
        """Continue without a command: the acceleration is kept."""
        self._extrapolate()
        if self._under_way is not None:
            begun = self.reference, self.hand
            self.reference, self.hand = self._under_way
            self._extrapolate()
            self._under_way = self.reference, self.hand
            self.reference, self.hand = begun

    @abstractmethod
    def _follow(self, command: np.void, *, first: bool) -> Iterator[Violation]:
        """Follow a command, and yield its violations."""

    @abstractmethod
    def _extrapolate(self) -> None:
        """Continue without a command."""


class JointPositions(Generator):
    """The client commands positions of the joints."""

    def _follow(self, command: np.void, *, first: bool) -> Iterator[Violation]:
        """Follow ``q_c``; see `Generator.follow`."""
        before, commanded = self.reference, reference.as_commanded(self.reference)
        q = np.array(command["q_c"])
        if first:
            self.reference = reference.at_rest(q)
            yield from reflexes.start_position(q, commanded.q, self.limits)
            return
        self.reference = reference.to_position(q, before)
        new = reference.to_position(q, commanded)
        yield from reflexes.commanded_motion(new, commanded, self.limits)

    def _extrapolate(self) -> None:
        """Keep the acceleration; see `Generator.extrapolate`."""
        self.reference = reference.extrapolated(self.reference)


class JointVelocities(JointPositions):
    """The client commands velocities of the joints."""

    def _follow(self, command: np.void, *, first: bool) -> Iterator[Violation]:
        """Follow ``dq_c``; see `Generator.follow`."""
        before, commanded = self.reference, reference.as_commanded(self.reference)
        dq = np.array(command["dq_c"])
        self.reference = reference.to_velocity(dq, before)
        new = reference.to_velocity(dq, commanded)
        yield from reflexes.commanded_motion(new, commanded, self.limits)


class HandPoses(Generator):
    """The client commands poses of the end effector.

    The joints follow by J⁺, one step of Newton's method a period. With an elbow, joint
    3 is one more row of J; without one, the posture moves as little as it can.
    """

    def __init__(self, start: Reference, limits: ArmLimits, model: Model) -> None:
        """Begin at a posture, with the end effector that is set."""
        super().__init__(start, limits)
        self._model = model
        self.hand: HandMotion = hand.at_rest(model.hand_at(start.q)[0])

    def _follow(self, command: np.void, *, first: bool) -> Iterator[Violation]:
        """Follow ``O_T_EE_c``; see `Generator.follow`."""
        pose = hand.placement(command["O_T_EE_c"])
        if pose is None:
            yield Violation(
                Error.CARTESIAN_POSITION_MOTION_GENERATOR_INVALID_FRAME_FLAG,
                "the commanded pose is not a homogeneous transform",
            )
            return
        commanded = hand.as_commanded(self.hand)
        if first:
            self.hand = hand.at_rest(pose)
            yield from reflexes.start_pose(hand.to_pose(pose, commanded))
        else:
            self.hand = hand.to_pose(pose, self.hand)
            yield from reflexes.commanded_hand(hand.to_pose(pose, commanded), commanded)
        yield from self._move_joints(command, first=first)

    def _extrapolate(self) -> None:
        """Keep the hand's acceleration; see `Generator.extrapolate`."""
        self.hand = hand.extrapolated(self.hand)
        q = self._posture(self.hand.pose, None)
        self.reference = reference.to_position(q, self.reference)

    def _move_joints(self, command: np.void, *, first: bool) -> Iterator[Violation]:
        """Follow the hand with the joints, and yield their violations."""
        elbow, before = None, reference.as_commanded(self.reference)
        if command["valid_elbow"]:
            elbow, side = (float(x) for x in command["elbow_c"])
            q_elbow, q_flip = before.q[_ELBOW], before.q[_ELBOW + 1]
            speed = (elbow - q_elbow) / PERIOD
            yield from reflexes.commanded_elbow(
                speed, side, float(np.sign(q_flip - ELBOW_FLIP)), first=first
            )
        q = self._posture(self.hand.pose, elbow)
        if first:
            self.reference = reference.at_rest(q)
            return
        self.reference = reference.to_position(q, self.reference)
        new = reference.to_position(q, before)
        yield from reflexes.commanded_motion(
            new, before, self.limits, reflexes.AFTER_INVERSE_KINEMATICS
        )

    def _posture(self, pose: pin.SE3, elbow: float | None) -> Array:
        q = self.reference.q
        at, J = self._model.hand_at(q)
        way = hand.displacement(pose, at)
        if elbow is not None:
            J = np.vstack([J, np.eye(len(q))[_ELBOW]])
            way = np.append(way, elbow - q[_ELBOW])
        return np.asarray(q + np.linalg.pinv(J, rcond=_SINGULAR) @ way)


class HandTwists(HandPoses):
    """The client commands velocities of the end effector."""

    def _follow(self, command: np.void, *, first: bool) -> Iterator[Violation]:
        """Follow ``O_dP_EE_c``; see `Generator.follow`."""
        twist = np.array(command["O_dP_EE_c"])
        commanded = hand.as_commanded(self.hand)
        self.hand = hand.to_twist(twist, self.hand)
        yield from reflexes.commanded_hand(hand.to_twist(twist, commanded), commanded)
        yield from self._move_joints(command, first=False)


def generator(
    kind: MotionGenerator, start: Reference, limits: ArmLimits, model: Model
) -> Generator | None:
    """Return the motion generator of a kind, or None for none."""
    if kind is MotionGenerator.JOINT_POSITION:
        return JointPositions(start, limits)
    if kind is MotionGenerator.JOINT_VELOCITY:
        return JointVelocities(start, limits)
    if kind is MotionGenerator.CARTESIAN_POSITION:
        return HandPoses(start, limits, model)
    if kind is MotionGenerator.CARTESIAN_VELOCITY:
        return HandTwists(start, limits, model)
    return None
