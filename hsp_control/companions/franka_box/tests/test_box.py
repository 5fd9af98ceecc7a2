"""The box without sockets: modes, gravity, lost commands, reflexes, recovery."""

from typing import Any

import numpy as np
import pytest
from franka_boxes import command, home, panda, plant

from hsp_control.companions.franka.layouts import (
    HEADER,
    PERIOD,
    REQUESTS,
    STATE,
    ControllerMode,
    Error,
    FrankaCommand,
    FrankaStatus,
    MotionGenerator,
    MoveStatus,
    RobotMode,
)
from hsp_control.companions.franka_box import ControlBox
from hsp_control.companions.franka_box.requests import Requests
from hsp_control.simulation.plants import Payload

REST = np.zeros(7)
TORQUE = ControllerMode.EXTERNAL, MotionGenerator.NONE


class Talking(ControlBox):
    """A box that keeps its messages."""

    def __init__(self, simulated: Any = None, q: Any = None) -> None:
        self.messages: list[str] = []
        start = home() if q is None else q
        super().__init__(panda(), simulated or plant(), start, self.messages.append)


def state(box: ControlBox) -> Any:
    return np.frombuffer(box.state()[1], STATE)[0]


def answers(box: ControlBox) -> list[tuple[FrankaCommand, int, int]]:
    """Return command, number and status of the responses, and empty the outbox."""
    found = []
    for data in box.outbox:
        kind, number, size = np.frombuffer(data, HEADER, 1)[0].item()
        assert size == len(data)
        found.append((FrankaCommand(kind), number, data[HEADER.itemsize]))
    box.outbox.clear()
    return found


def ask(box: Talking, kind: FrankaCommand, number: int = 5, **fields: Any) -> list[Any]:
    payload = np.zeros(1, REQUESTS[kind]) if REQUESTS[kind].itemsize else b""
    for name, value in fields.items():
        payload[name] = value  # type: ignore[index]
    data = payload if isinstance(payload, bytes) else payload.tobytes()
    Requests(box, box.messages.append).answer(kind, number, data)
    return answers(box)


def test_a_payload_sinks_unless_its_load_is_set() -> None:
    sunk = []
    for mass in (0.0, 2.0):
        box = Talking(
            plant(payload=Payload("panda_link8", 2.0, center=[0.0, 0.0, 0.1]))
        )
        flat = {"F_x_Cload": [0, 0, 0.1], "I_load": np.diag([-1e-9, 0, 0]).ravel()}
        assert ask(box, FrankaCommand.SET_LOAD, m_load=mass, **flat) == [
            (FrankaCommand.SET_LOAD, 5, FrankaStatus.SUCCESS)
        ]
        assert state(box)["m_load"] == mass
        box.begin(1, *TORQUE)
        for _ in range(100):
            box.step(command())
        sunk.append(float(np.abs(box.q - home()).max()))
    assert sunk[0] > 1e-3
    assert sunk[1] < 1e-9


def test_an_effort_acts_for_one_period() -> None:
    """After the first step v = h M⁻¹ tau, with the rotors in M, to first order in h."""
    box, effort = Talking(), np.array([0.9, -0.8, 0.7, -0.6, 0.5, -0.4, 0.3])
    box.begin(1, *TORQUE)
    box.step(command(tau_J_d=effort))
    robot = box.plant.robot
    gravity = box.arm.robot.inverse_dynamics(home(), REST, REST)
    expected = robot.forward_dynamics(home(), REST, effort + gravity)
    np.testing.assert_allclose(box.v, PERIOD * expected, rtol=1e-3)
    reported = state(box)
    np.testing.assert_allclose(reported["tau_J_d"], effort, rtol=1e-6)
    np.testing.assert_allclose(reported["dtau_J"] * PERIOD, effort, atol=1e-3)


def test_lost_commands_hold_the_effort_and_the_twentieth_ends_the_motion() -> None:
    box, effort = Talking(), np.full(7, 0.4)
    box.begin(1, *TORQUE)
    for _ in range(50):
        box.step(None)  # before the first command nothing is lost
    box.step(command(tau_J_d=effort))
    for lost in range(1, 20):
        box.step(None)
        assert box.motion is not None
        assert box.motion.lost == lost
        np.testing.assert_allclose(state(box)["tau_J_d"], effort, rtol=1e-6)
    answers(box)
    box.step(None)
    assert answers(box) == [(FrankaCommand.MOVE, 1, MoveStatus.REFLEX_ABORTED)]
    reported = state(box)
    flags = np.flatnonzero(reported["errors"]).tolist()
    assert flags == np.flatnonzero(reported["reflex_reason"]).tolist()
    assert flags == [Error.COMMUNICATION_CONSTRAINTS_VIOLATION]
    assert reported["robot_mode"] == RobotMode.REFLEX
    assert reported["control_command_success_rate"] == 0.0


def test_a_reflex_brakes_within_the_published_acceleration() -> None:
    box = Talking()
    box.begin(1, *TORQUE)
    effort = 0.0
    while box.v[0] < 0.5:
        effort = min(effort + 0.5, 5.0)
        box.step(command(tau_J_d=effort * np.eye(7)[0]))
    speed, start = box.v[0], box.q[0]
    box.step(command(tau_J_d=[40.0, 0, 0, 0, 0, 0, 0]))
    assert box.motion is None
    box.settle()
    assert np.abs(box.v).max() < 1e-3
    assert box.q[0] - start == pytest.approx(speed**2 / 20.0, rel=0.2)


def test_recovery_answers_when_the_arm_is_back() -> None:
    box, upper = Talking(), panda().limits.upper[3]
    box.begin(1, *TORQUE)
    push = 0.0
    while box.motion is not None:
        push = min(push + 0.2, 4.0)
        box.step(command(tau_J_d=push * np.eye(7)[3] - 5.0 * box.v))
    assert ask(box, FrankaCommand.MOVE, controller=2, motion_generator=4)[-1] == (
        FrankaCommand.MOVE, 5, MoveStatus.COMMAND_NOT_POSSIBLE_REJECTED
    )  # fmt: skip
    assert ask(box, FrankaCommand.AUTOMATIC_ERROR_RECOVERY, 9) == []
    assert state(box)["robot_mode"] == RobotMode.AUTOMATIC_ERROR_RECOVERY
    assert box.q[3] > upper
    box.settle()
    assert answers(box) == [
        (FrankaCommand.AUTOMATIC_ERROR_RECOVERY, 9, FrankaStatus.SUCCESS)
    ]
    assert box.q[3] < upper - 0.005
    reported = state(box)
    assert reported["robot_mode"] == RobotMode.IDLE
    assert not reported["errors"].any()
    assert reported["reflex_reason"].any()  # of the last motion, until the next reflex


def test_an_arm_that_folds_into_itself_stops() -> None:
    """Joints 4 and 6 fold the hand towards the base, within their limits."""
    box = Talking()
    box.begin(1, ControllerMode.JOINT_IMPEDANCE, MotionGenerator.JOINT_VELOCITY)
    ramp = 0.0
    while box.motion is not None and box.periods < 6000:
        ramp = min(ramp + 0.004, 0.5)
        box.step(command(dq_c=[0, -ramp, 0, -ramp * 0.6, 0, -ramp, 0]))
    reported = state(box)
    names = {Error(int(k)) for k in np.flatnonzero(reported["errors"])}
    assert names == {Error.SELF_COLLISION_AVOIDANCE_VIOLATION}, box.messages


def test_calls_that_are_refused_while_the_arm_moves() -> None:
    box = Talking()
    box.begin(1, *TORQUE)
    answers(box)
    assert ask(box, FrankaCommand.SET_LOAD, m_load=1.0) == [
        (FrankaCommand.SET_LOAD, 5, FrankaStatus.COMMAND_NOT_POSSIBLE_REJECTED)
    ]
    assert ask(box, FrankaCommand.MOVE, controller=2, motion_generator=4) == [
        (FrankaCommand.MOVE, 5, MoveStatus.COMMAND_NOT_POSSIBLE_REJECTED)
    ]
    assert ask(box, FrankaCommand.STOP_MOVE, 8) == [
        (FrankaCommand.MOVE, 1, MoveStatus.PREEMPTED),
        (FrankaCommand.STOP_MOVE, 8, FrankaStatus.SUCCESS),
    ]


@pytest.mark.parametrize(("fields", "served"), [
    ({"controller": 2, "motion_generator": 4}, True),
    ({"controller": 2, "motion_generator": 0}, True),
    ({"controller": 0, "motion_generator": 1}, True),
    ({"controller": 0, "motion_generator": 2}, True),
    ({"controller": 1, "motion_generator": 3}, True),
    ({"controller": 1, "motion_generator": 0}, True),
    ({"controller": 1, "motion_generator": 4}, False),
    ({"controller": 0, "motion_generator": 4}, False),
    ({"controller": 0, "motion_generator": 0, "asynchronous": 1}, False),
    ({"controller": 77, "motion_generator": 4}, False),
])  # fmt: skip
def test_which_motions_are_served(fields: dict[str, int], served: bool) -> None:
    (answer,) = ask(Talking(), FrankaCommand.MOVE, **fields)
    status = (
        MoveStatus.MOTION_STARTED
        if served
        else MoveStatus.COMMAND_NOT_POSSIBLE_REJECTED
    )
    assert answer == (FrankaCommand.MOVE, 5, status)


def test_a_hand_does_not_start_in_a_singular_posture() -> None:
    q = home()
    q[[1, 3, 5]] = 0.0, -0.0699, np.pi / 2 - 0.07  # the arm is nearly stretched
    box = Talking(q=q)
    assert ask(box, FrankaCommand.MOVE, controller=0, motion_generator=2) == [
        (FrankaCommand.MOVE, 5, MoveStatus.START_AT_SINGULAR_POSE_REJECTED)
    ]
    (answer,) = ask(box, FrankaCommand.MOVE, controller=0, motion_generator=0)
    assert answer[2] == MoveStatus.MOTION_STARTED


def test_a_command_that_is_not_finite_ends_the_motion() -> None:
    box = Talking()
    box.begin(1, *TORQUE)
    answers(box)
    box.step(command(tau_J_d=[np.nan] * 7))
    assert answers(box) == [(FrankaCommand.MOVE, 1, MoveStatus.INPUT_ERROR_ABORTED)]
    assert np.isfinite(box.q).all()


@pytest.mark.parametrize(("kind", "fields"), [
    (FrankaCommand.SET_LOAD, {"m_load": np.nan}),
    (FrankaCommand.SET_LOAD, {"m_load": 1e300}),
    (FrankaCommand.SET_LOAD, {"m_load": 12.0, "F_x_Cload": [0.3, 0, 0.1]}),
    (FrankaCommand.SET_LOAD, {"m_load": 1.0, "F_x_Cload": [np.nan, 0, 0]}),
    (FrankaCommand.SET_LOAD, {"m_load": 1.0, "I_load": np.diag([1e300] * 3).ravel()}),
    (FrankaCommand.SET_LOAD, {"m_load": 1.0, "I_load": np.diag([-0.1, 1, 1]).ravel()}),
    (FrankaCommand.SET_LOAD, {"m_load": 1.0, "I_load": [1, 2, 3, 4, 5, 6, 7, 8, 9]}),
    (FrankaCommand.SET_EE_TO_K, {"EE_T_K": np.ones(16)}),
    (FrankaCommand.SET_NE_TO_EE, {"NE_T_EE": np.full(16, np.nan)}),
    (FrankaCommand.SET_NE_TO_EE, {"NE_T_EE": [*np.eye(4).ravel()[:12], 1e30, 0, 0, 1]}),
    (FrankaCommand.SET_EE_TO_K, {"EE_T_K": [*np.eye(4).ravel()[:12], 0, -1e30, 0, 1]}),
    (FrankaCommand.SET_LOAD, {"m_load": 0.0, "F_x_Cload": [1e30, 0, 0]}),
    (FrankaCommand.SET_JOINT_IMPEDANCE, {"K_theta": -np.ones(7)}),
    (FrankaCommand.SET_JOINT_IMPEDANCE, {"K_theta": np.full(7, 1e300)}),
    (FrankaCommand.SET_CARTESIAN_IMPEDANCE, {"K_x": np.full(6, np.nan)}),
    (FrankaCommand.SET_COLLISION_BEHAVIOR, {"lower_force_nominal": np.ones(6)}),
    (FrankaCommand.SET_COLLISION_BEHAVIOR, {"upper_torque_nominal": [np.inf] * 7}),
])  # fmt: skip
def test_invalid_arguments_are_refused(
    kind: FrankaCommand, fields: dict[str, Any]
) -> None:
    box = Talking()
    assert ask(box, kind, **fields) == [
        (kind, 5, FrankaStatus.INVALID_ARGUMENT_REJECTED)
    ]
    (line,) = box.messages
    assert line.startswith("refused: set ")


def test_contacts_and_collisions_follow_the_thresholds() -> None:
    box = Talking(plant(payload=Payload("panda_tcp", 3.0)))
    ask(
        box,
        FrankaCommand.SET_COLLISION_BEHAVIOR,
        lower_torque_nominal=np.full(7, 3.0),
        upper_torque_nominal=np.full(7, 9.0),
        upper_force_nominal=np.full(6, 100.0),
    )
    box.begin(1, ControllerMode.JOINT_IMPEDANCE, MotionGenerator.JOINT_POSITION)
    while box.motion is not None and box.periods < 1000:
        box.step(command(q_c=box.motion.reference.q))  # type: ignore[union-attr]
    reported = state(box)
    names = {Error(int(k)) for k in np.flatnonzero(reported["errors"])}
    assert names == {Error.JOINT_REFLEX}
    over = np.abs(reported["tau_ext_hat_filtered"])
    np.testing.assert_array_equal(reported["joint_contact"], over > 3.0)
    assert reported["joint_collision"].any()


@pytest.mark.parametrize(("controller", "kind", "stiffness"), [
    (ControllerMode.JOINT_IMPEDANCE, FrankaCommand.SET_JOINT_IMPEDANCE, [200.0] * 7),
    (ControllerMode.CARTESIAN_IMPEDANCE,
     FrankaCommand.SET_CARTESIAN_IMPEDANCE,
     [500.0, 500.0, 500.0, 300.0, 300.0, 300.0]),
])  # fmt: skip
def test_an_unknown_payload_stretches_the_springs_that_are_set(
    controller: ControllerMode, kind: FrankaCommand, stiffness: list[float]
) -> None:
    """At rest the joints deflect by tau / K, or the hand by its weight over K."""
    box = Talking(plant(payload=Payload("panda_tcp", 1.0)))
    field = "K_theta" if kind is FrankaCommand.SET_JOINT_IMPEDANCE else "K_x"
    assert ask(box, kind, **{field: stiffness})[0][2] == FrankaStatus.SUCCESS
    before = box.model.O_T_EE
    box.begin(1, controller, MotionGenerator.JOINT_POSITION)
    for _ in range(2500):
        box.step(command(q_c=home()))
    assert np.abs(box.v).max() < 5e-3
    if field == "K_theta":
        weight = box.plant.robot.inverse_dynamics(box.q, REST, REST)
        yielded = (weight - box.model.gravity) / stiffness
        np.testing.assert_allclose(home() - box.q, yielded, rtol=0.1, atol=1e-3)
    else:
        sunk = before.translation[2] - box.model.O_T_EE.translation[2]
        assert sunk == pytest.approx(9.81 / 500.0, rel=0.1)
