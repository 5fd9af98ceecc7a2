"""The handlers of requests: a table from the command to its function."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.companions.franka.layouts import (
    REQUESTS,
    ControllerMode,
    FrankaCommand,
    FrankaStatus,
    MotionGenerator,
    MoveStatus,
    RobotMode,
    message,
)
from hsp_control.companions.franka_box.box import ControlBox
from hsp_control.companions.franka_box.hand import placement
from hsp_control.companions.franka_box.motion import OF_THE_HAND, SERVED
from hsp_control.companions.franka_box.reflexes import ReflexThresholds
from hsp_control.robot.description.inertias import is_possible

Say = Callable[[str], object]
_TOLERANCE = 1e-5
"""Tolerance of negative moments of inertia, for rounding [kg·m²]."""
_NEAR = 1.0
"""Maximum distance of a load or a frame from the flange along an axis [m]."""
_NO_FRAME = f"not a homogeneous transform, or further than {_NEAR:g} m"
_HEAVIEST = 1e4
"""Mass at which larger masses are clipped: no arm can carry it [kg]."""
_STIFFEST = {"K_theta": np.full(7, 14250.0), "K_x": np.repeat([3000.0, 300.0], 3)}
"""Maximum stiffness of joints and hand (libfranka, ``robot.h``) [N·m/rad, N/m]."""


class Requests:
    """Answers the requests of a client, except the first, which connects it."""

    def __init__(self, box: ControlBox, say: Say) -> None:
        """Set the box, and the receiver of refusals."""
        self._box, self._say = box, say
        self._handlers: dict[FrankaCommand, Callable[[int, np.void], int | None]] = {
            FrankaCommand.MOVE: self._move,
            FrankaCommand.STOP_MOVE: self._stop_move,
            FrankaCommand.SET_COLLISION_BEHAVIOR: self._set_collision_behavior,
            FrankaCommand.SET_JOINT_IMPEDANCE: self._set_joint_impedance,
            FrankaCommand.SET_CARTESIAN_IMPEDANCE: self._set_cartesian_impedance,
            FrankaCommand.SET_GUIDING_MODE: self._set_guiding_mode,
            FrankaCommand.SET_EE_TO_K: self._set_ee_to_k,
            FrankaCommand.SET_NE_TO_EE: self._set_ne_to_ee,
            FrankaCommand.SET_LOAD: self._set_load,
            FrankaCommand.AUTOMATIC_ERROR_RECOVERY: self._recover,
        }

    def answer(self, command: FrankaCommand, number: int, payload: bytes) -> None:
        """Answer a request, into the box's outbox."""
        outbox = self._box.outbox
        if command is FrankaCommand.GET_ROBOT_MODEL:
            urdf = self._box.arm.urdf.encode()
            outbox.append(
                message(command, number, bytes([FrankaStatus.SUCCESS]) + urdf)
            )
            return
        kind = REQUESTS[command]
        body = np.frombuffer(payload, kind)[0] if kind.itemsize else np.void(b"")
        setter = command.name.startswith("SET_")
        if setter and self._box.mode is RobotMode.MOVE:
            status: int | None = self._impossible(command, "the arm moves")
        else:
            status = self._handlers[command](number, body)
        if status is not None:
            outbox.append(message(command, number, bytes([status])))

    def _impossible(self, command: FrankaCommand, why: str) -> int:
        self._say(f"refused: {_spelled(command)}: {why}")
        return FrankaStatus.COMMAND_NOT_POSSIBLE_REJECTED

    def _invalid(self, command: FrankaCommand, what: str) -> int:
        self._say(f"refused: {_spelled(command)}: {what}")
        return FrankaStatus.INVALID_ARGUMENT_REJECTED

    def _move(self, number: int, body: np.void) -> int | None:
        box = self._box
        try:
            by = ControllerMode(int(body["controller"]))
            generator = MotionGenerator(int(body["motion_generator"]) + 1)
        except ValueError:
            self._say(
                f"refused: move: controller {body['controller']} or motion generator "
                f"{body['motion_generator']} does not exist"
            )
            return MoveStatus.COMMAND_NOT_POSSIBLE_REJECTED
        if box.mode is not RobotMode.IDLE:
            self._say(f"refused: move: the mode is {box.mode.name.lower()}, not idle")
        elif (by, generator) not in SERVED or body["asynchronous"]:
            kind = "asynchronous " if body["asynchronous"] else ""
            self._say(
                f"refused: move: {kind}{_spelled(generator)} with {_spelled(by)} is "
                "not served"
            )
        elif generator in OF_THE_HAND and box.model.is_singular:
            self._say("refused: move: the arm is in a singular posture")
            return MoveStatus.START_AT_SINGULAR_POSE_REJECTED
        else:
            box.begin(number, by, generator)
            return None
        return MoveStatus.COMMAND_NOT_POSSIBLE_REJECTED

    def _stop_move(self, number: int, body: np.void) -> int:
        self._box.end(MoveStatus.PREEMPTED, "stopped by the client")
        return FrankaStatus.SUCCESS

    def _set_collision_behavior(self, number: int, body: np.void) -> int:
        """Set thresholds: the larger of those for acceleration and for constant speed.

        An effort alone does not decide which of the two applies.
        """
        limits = {}
        for bound in ("lower", "upper"):
            for kind in ("torque", "force"):
                pair = [body[f"{bound}_{kind}_{at}"] for at in _PHASES]
                limits[bound, kind] = np.maximum(*pair)
        command = FrankaCommand.SET_COLLISION_BEHAVIOR
        for kind in ("torque", "force"):
            low, high = limits["lower", kind], limits["upper", kind]
            if not (np.isfinite([low, high]).all() and (low >= 0.0).all()):
                return self._invalid(command, "a threshold is negative or not finite")
            if (low > high).any():
                return self._invalid(command, "a lower threshold is above the upper")
        self._box.thresholds = ReflexThresholds(
            limits["lower", "torque"],
            limits["upper", "torque"],
            limits["lower", "force"],
            limits["upper", "force"],
        )
        return FrankaStatus.SUCCESS

    def _set_joint_impedance(self, number: int, body: np.void) -> int:
        stiffness = np.array(body["K_theta"])
        if not _is_stiffness(stiffness, "K_theta"):
            return self._invalid(
                FrankaCommand.SET_JOINT_IMPEDANCE, f"{stiffness} N·m/rad"
            )
        self._box.joint_stiffness = stiffness
        return FrankaStatus.SUCCESS

    def _set_cartesian_impedance(self, number: int, body: np.void) -> int:
        stiffness = np.array(body["K_x"])
        if not _is_stiffness(stiffness, "K_x"):
            return self._invalid(FrankaCommand.SET_CARTESIAN_IMPEDANCE, f"{stiffness}")
        self._box.cartesian_stiffness = stiffness
        return FrankaStatus.SUCCESS

    def _set_guiding_mode(self, number: int, body: np.void) -> int:
        return self._impossible(
            FrankaCommand.SET_GUIDING_MODE, "hand guiding is not simulated"
        )

    def _set_ee_to_k(self, number: int, body: np.void) -> int:
        frame = _near(placement(body["EE_T_K"]))
        if frame is None:
            return self._invalid(FrankaCommand.SET_EE_TO_K, _NO_FRAME)
        self._box.model.EE_T_K = frame
        self._box.readings.set_end_effector(self._box.model)
        return FrankaStatus.SUCCESS

    def _set_ne_to_ee(self, number: int, body: np.void) -> int:
        frame = _near(placement(body["NE_T_EE"]))
        if frame is None:
            return self._invalid(FrankaCommand.SET_NE_TO_EE, _NO_FRAME)
        self._box.model.NE_T_EE = frame
        self._box.readings.set_end_effector(self._box.model)
        return FrankaStatus.SUCCESS

    def _set_load(self, number: int, body: np.void) -> int:
        mass, com = float(body["m_load"]), np.array(body["F_x_Cload"])
        inertia = np.array(body["I_load"]).reshape(3, 3).T
        command = FrankaCommand.SET_LOAD
        where = f"{mass:g} kg at {com.tolist()} m"
        if not (mass >= 0.0 and np.isfinite(mass) and np.abs(com).max() <= _NEAR):
            return self._invalid(command, where)
        load = pin.Inertia(min(mass, _HEAVIEST), com, np.zeros((3, 3)))
        held = np.abs(self._box.gravity_with(load))
        worst = int(np.argmax(held - (limit := self._box.arm.limits.effort)))
        if held[worst] > limit[worst]:
            why = f"joint {worst + 1} cannot hold it here with {limit[worst]:g} N·m"
            return self._invalid(command, f"{where}: {why}")
        symmetric = np.isfinite(inertia).all() and np.allclose(inertia, inertia.T)
        small = np.abs(inertia).max(initial=0.0) <= mass * _NEAR**2 + _TOLERANCE
        if not (symmetric and small and is_possible(inertia, _TOLERANCE)):
            return self._invalid(
                command, "the inertia is not that of a body of this mass"
            )
        load.inertia = inertia  # the constructor refuses values below 0 due to rounding
        self._box.carry(load)
        self._box.readings.set_end_effector(self._box.model)
        return FrankaStatus.SUCCESS

    def _recover(self, number: int, body: np.void) -> None:
        self._box.recover(number)


_PHASES = ("acceleration", "nominal")


def _near(frame: pin.SE3 | None) -> pin.SE3 | None:
    """Return a frame if it is possible for an end effector, else None."""
    if frame is None or np.abs(frame.translation).max() > _NEAR:
        return None
    return frame


def _is_stiffness(values: Array, of: str) -> bool:
    return bool(((values >= 0.0) & (values <= _STIFFEST[of])).all())


def _spelled(item: FrankaCommand | ControllerMode | MotionGenerator) -> str:
    return item.name.lower().replace("_", " ")
