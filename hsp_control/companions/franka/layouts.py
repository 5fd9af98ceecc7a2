"""The research interface, version 10, as packed little-endian layouts.

Transcribed from libfranka-common (Apache-2.0, Franka Robotics), the headers
``research_interface/robot/{rbk_types,service_types,error}.h``. Requests and responses
go over TCP, each with a header; states and commands go over UDP, one per millisecond.
"""

from enum import IntEnum
from functools import partial

import numpy as np

VERSION = 10
"""The version of libfranka 0.18 to 0.21."""
PORT = 1337
"""The TCP port that libfranka connects to; it has no option for another one."""
PERIOD = 1e-3
"""Time between two states [s]."""
JOINTS = 7


class FrankaCommand(IntEnum):
    """The kinds of requests."""

    CONNECT = 0
    MOVE = 1
    STOP_MOVE = 2
    SET_COLLISION_BEHAVIOR = 3
    SET_JOINT_IMPEDANCE = 4
    SET_CARTESIAN_IMPEDANCE = 5
    SET_GUIDING_MODE = 6
    SET_EE_TO_K = 7
    SET_NE_TO_EE = 8
    SET_LOAD = 9
    AUTOMATIC_ERROR_RECOVERY = 10
    GET_ROBOT_MODEL = 11


class MoveStatus(IntEnum):
    """Answers to `FrankaCommand.MOVE`: one when it starts, one when it ends."""

    SUCCESS = 0
    MOTION_STARTED = 1
    PREEMPTED = 2
    PREEMPTED_DUE_TO_SAFETY_FUNCTIONS = 3
    REJECTED_DUE_TO_SAFETY_FUNCTIONS = 4
    COMMAND_NOT_POSSIBLE_REJECTED = 5
    START_AT_SINGULAR_POSE_REJECTED = 6
    INVALID_ARGUMENT_REJECTED = 7
    REFLEX_ABORTED = 8
    EMERGENCY_ABORTED = 9
    INPUT_ERROR_ABORTED = 10
    ABORTED = 11


class FrankaStatus(IntEnum):
    """Answers to all other requests, as far as the box sends them."""

    SUCCESS = 0
    COMMAND_NOT_POSSIBLE_REJECTED = 1
    INVALID_ARGUMENT_REJECTED = 2  # of setters
    MANUAL_ERROR_RECOVERY_REQUIRED_REJECTED = 3  # of automatic error recovery


INCOMPATIBLE_VERSION = 1
"""The status of a `FrankaCommand.CONNECT` that is refused."""


class MotionGenerator(IntEnum):
    """The source of the desired motion; a request's number is one less."""

    IDLE = 0
    JOINT_POSITION = 1
    JOINT_VELOCITY = 2
    CARTESIAN_POSITION = 3
    CARTESIAN_VELOCITY = 4
    NONE = 5


class ControllerMode(IntEnum):
    """The source of the efforts."""

    JOINT_IMPEDANCE = 0
    CARTESIAN_IMPEDANCE = 1
    EXTERNAL = 2
    OTHER = 3


class RobotMode(IntEnum):
    """The robot's mode."""

    OTHER = 0
    IDLE = 1
    MOVE = 2
    GUIDING = 3
    REFLEX = 4
    USER_STOPPED = 5
    AUTOMATIC_ERROR_RECOVERY = 6


class Error(IntEnum):
    """Errors, the index into ``errors`` and ``reflex_reason`` of a state."""

    JOINT_POSITION_LIMITS_VIOLATION = 0
    CARTESIAN_POSITION_LIMITS_VIOLATION = 1
    SELF_COLLISION_AVOIDANCE_VIOLATION = 2
    JOINT_VELOCITY_VIOLATION = 3
    CARTESIAN_VELOCITY_VIOLATION = 4
    FORCE_CONTROL_SAFETY_VIOLATION = 5
    JOINT_REFLEX = 6
    CARTESIAN_REFLEX = 7
    MAX_GOAL_POSE_DEVIATION_VIOLATION = 8
    MAX_PATH_POSE_DEVIATION_VIOLATION = 9
    CARTESIAN_VELOCITY_PROFILE_SAFETY_VIOLATION = 10
    JOINT_POSITION_MOTION_GENERATOR_START_POSE_INVALID = 11
    JOINT_MOTION_GENERATOR_POSITION_LIMITS_VIOLATION = 12
    JOINT_MOTION_GENERATOR_VELOCITY_LIMITS_VIOLATION = 13
    JOINT_MOTION_GENERATOR_VELOCITY_DISCONTINUITY = 14
    JOINT_MOTION_GENERATOR_ACCELERATION_DISCONTINUITY = 15
    CARTESIAN_POSITION_MOTION_GENERATOR_START_POSE_INVALID = 16
    CARTESIAN_MOTION_GENERATOR_ELBOW_LIMIT_VIOLATION = 17
    CARTESIAN_MOTION_GENERATOR_VELOCITY_LIMITS_VIOLATION = 18
    CARTESIAN_MOTION_GENERATOR_VELOCITY_DISCONTINUITY = 19
    CARTESIAN_MOTION_GENERATOR_ACCELERATION_DISCONTINUITY = 20
    CARTESIAN_MOTION_GENERATOR_ELBOW_SIGN_INCONSISTENT = 21
    CARTESIAN_MOTION_GENERATOR_START_ELBOW_INVALID = 22
    FORCE_CONTROLLER_DESIRED_FORCE_TOLERANCE_VIOLATION = 23
    START_ELBOW_SIGN_INCONSISTENT = 24
    COMMUNICATION_CONSTRAINTS_VIOLATION = 25
    POWER_LIMIT_VIOLATION = 26
    CARTESIAN_MOTION_GENERATOR_JOINT_POSITION_LIMITS_VIOLATION = 27
    CARTESIAN_MOTION_GENERATOR_JOINT_VELOCITY_LIMITS_VIOLATION = 28
    CARTESIAN_MOTION_GENERATOR_JOINT_VELOCITY_DISCONTINUITY = 29
    CARTESIAN_MOTION_GENERATOR_JOINT_ACCELERATION_DISCONTINUITY = 30
    CARTESIAN_POSITION_MOTION_GENERATOR_INVALID_FRAME_FLAG = 31
    CONTROLLER_TORQUE_DISCONTINUITY = 32
    JOINT_P2P_INSUFFICIENT_TORQUE_FOR_PLANNING = 33
    TAU_J_RANGE_VIOLATION = 34
    INSTABILITY_DETECTED = 35
    JOINT_MOVE_IN_WRONG_DIRECTION = 36
    CARTESIAN_SPLINE_MOTION_GENERATOR_VIOLATION = 37
    JOINT_VIA_MOTION_GENERATOR_PLANNING_JOINT_LIMIT_VIOLATION = 38
    BASE_ACCELERATION_INITIALIZATION_TIMEOUT = 39
    BASE_ACCELERATION_INVALID_READING = 40

    @property
    def spelling(self) -> str:
        """Libfranka's name for it."""
        return self.name.lower().replace("tau_j_", "tau_J_")


Fields = list[tuple[str, str, tuple[int, ...]]]


def _fields(kind: str, **sizes: int) -> Fields:
    return [(name, kind, (size,) if size > 1 else ()) for name, size in sizes.items()]


_count = partial(_fields, "<u8")
_floats = partial(_fields, "<f4")
_doubles = partial(_fields, "<f8")
_bytes = partial(_fields, "u1")


HEADER = np.dtype([("command", "<u4"), ("id", "<u4"), ("size", "<u4")])
"""Header of a request and of a response; the size includes it."""

STATE = np.dtype(
    _count(message_id=1)
    + _floats(O_T_EE=16, O_T_EE_d=16, F_T_EE=16, EE_T_K=16, F_T_NE=16, NE_T_EE=16)
    + _floats(m_ee=1, I_ee=9, F_x_Cee=3, m_load=1, I_load=9, F_x_Cload=3)
    + _floats(elbow=2, elbow_d=2, tau_J=7, tau_J_d=7, dtau_J=7)
    + _floats(q=7, q_d=7, dq=7, dq_d=7, ddq_d=7, joint_contact=7, cartesian_contact=6)
    + _floats(joint_collision=7, cartesian_collision=6, tau_ext_hat_filtered=7)
    + _floats(O_F_ext_hat_K=6, K_F_ext_hat_K=6, O_dP_EE_d=6, O_ddP_O=3)
    + _floats(elbow_c=2, delbow_c=2, ddelbow_c=2)
    + _floats(O_T_EE_c=16, O_dP_EE_c=6, O_ddP_EE_c=6, theta=7, dtheta=7)
    + _floats(accelerometer_top=18, accelerometer_bottom=18)
    + _bytes(motion_generator_mode=1, controller_mode=1)
    + _bytes(errors=len(Error), reflex_reason=len(Error), robot_mode=1)
    + _floats(control_command_success_rate=1)
)
"""A robot state; matrices are stored by columns."""

COMMAND = np.dtype(
    _count(message_id=1)
    + _doubles(q_c=7, dq_c=7, O_T_EE_c=16, O_dP_EE_c=6, elbow_c=2)
    + _bytes(valid_elbow=1, motion_generation_finished=1)
    + _doubles(tau_J_d=7)
    + _bytes(torque_command_finished=1)
)
"""A robot command: the answer to the state with the same ``message_id``."""

_NOTHING = np.dtype([])
REQUESTS = {
    FrankaCommand.CONNECT: np.dtype(_fields("<u2", version=1, udp_port=1)),
    FrankaCommand.MOVE: np.dtype(
        _fields("<u4", controller=1, motion_generator=1)
        + _doubles(path_deviation=3, goal_deviation=3)
        + _bytes(asynchronous=1)
        + _doubles(maximum_velocity=7)
    ),
    FrankaCommand.STOP_MOVE: _NOTHING,
    FrankaCommand.SET_COLLISION_BEHAVIOR: np.dtype(
        _doubles(
            lower_torque_acceleration=7,
            upper_torque_acceleration=7,
            lower_torque_nominal=7,
            upper_torque_nominal=7,
            lower_force_acceleration=6,
            upper_force_acceleration=6,
            lower_force_nominal=6,
            upper_force_nominal=6,
        )
    ),
    FrankaCommand.SET_JOINT_IMPEDANCE: np.dtype(_doubles(K_theta=7)),
    FrankaCommand.SET_CARTESIAN_IMPEDANCE: np.dtype(_doubles(K_x=6)),
    FrankaCommand.SET_GUIDING_MODE: np.dtype(_bytes(axes=6, null_space=1)),
    FrankaCommand.SET_EE_TO_K: np.dtype(_doubles(EE_T_K=16)),
    FrankaCommand.SET_NE_TO_EE: np.dtype(_doubles(NE_T_EE=16)),
    FrankaCommand.SET_LOAD: np.dtype(_doubles(m_load=1, F_x_Cload=3, I_load=9)),
    FrankaCommand.AUTOMATIC_ERROR_RECOVERY: _NOTHING,
    FrankaCommand.GET_ROBOT_MODEL: _NOTHING,
}
"""Payloads of requests."""

CONNECTED = np.dtype(_bytes(status=1) + _fields("<u2", version=1))
"""The answer to `FrankaCommand.CONNECT`, with the version of the box."""


def message(command: int, number: int, payload: bytes) -> bytes:
    """Return a request with a command and number, or the response to it."""
    header = np.array((command, number, HEADER.itemsize + len(payload)), HEADER)
    return header.tobytes() + payload
