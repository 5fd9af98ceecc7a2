"""A step allocates no memory, with all ready tasks, fields and metrics."""

import gc
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from oracles import slope

from hsp_control import (
    Circle,
    Controller,
    FrameOrientation,
    FramePose,
    FramePosition,
    Gains,
    JointPosture,
    Limits,
    Obstacle,
    Pointing,
    Robot,
    RobotState,
)
from hsp_control.common.errors import ControllerError
from hsp_control.control.actuation import Status
from hsp_control.engine import Call
from hsp_control.engine.inspection import calls, first_nan, listing
from hsp_control.geometry import Proximity, Scene, link_shapes
from hsp_control.geometry.proximity import CoalDistances
from hsp_control.geometry.scene import Start
from hsp_control.geometry.shapes import Box, Capsule, Cylinder, HalfSpace, Shape, Sphere
from hsp_control.null_space.fields import (
    EqualJointAngles,
    FieldSample,
    InverseCondition,
    JointCentering,
    LimitBarrier,
    Manipulability,
    NullSpaceField,
    ObstacleClearance,
    PointDistance,
    Ramp,
    Rest,
    SelfClearance,
    TargetPosture,
)
from hsp_control.null_space.metrics import (
    ConstantMetric,
    IdentityMetric,
    MassMatrixMetric,
    MetricSample,
)
from hsp_control.tasks import Task, TaskSample
from hsp_control.trajectories import (
    Blend,
    BlendOrientation,
    ComposedPose,
    HoldPose,
    Lissajous,
    OrientationPath,
    Spin,
    Spline,
)

HERE = Path(__file__).parent
GAINS = Gains(natural_frequency=8.0)
CIRCLE = Circle(0.1, 2.0, [0.5, 0.0, 0.4], normal=[0.0, 0.6, 0.8])
TURNED = pin.exp3(np.array([0.3, -0.5, 0.4]))
SPIN = Spin([0.0, 0.6, 0.8], 0.7, rotation=TURNED)
SHAPES: dict[str, Shape] = {
    "sphere": Sphere(0.1),
    "capsule": Capsule(0.05, 0.3),
    "box": Box((0.2, 0.3, 0.1)),
    "cylinder": Cylinder(0.1, 0.3),
    "plane": HalfSpace(),
}


def obstacle(shape: Shape) -> Obstacle:
    height = -0.5 if isinstance(shape, HalfSpace) else 0.5
    path = Lissajous([0.1, 0.2, 0.1], [1.0, 2.0, 1.5], center=[0.4, 0.3, height])
    return Obstacle("it", shape, path, SPIN)


def start_of(robot: Robot) -> Start:
    return Start(robot.state(0.0, robot.home(), np.zeros(robot.nv)), Scene())


def tasks(robot: Robot, frame: str) -> dict[str, Task]:
    blended = Blend(CIRCLE, 2.0, start=[0.4, 0.1, 0.5])
    path = OrientationPath([np.eye(3), TURNED], [0.0, 2.0])
    turning = BlendOrientation(SPIN, 2.0, rotation=TURNED)
    motion = Spline(np.eye(3, 7)[:, : len(robot.single_dof_joints)], [0.0, 0.5, 1.0])
    all_joints = motion.dimension == len(robot.single_dof_joints)
    made: dict[str, Task] = {
        "position": FramePosition(frame, blended, gains=GAINS),
        "axes": FramePosition(
            frame, Lissajous([1, 1], [1, 2], center=[0, 0]), gains=GAINS, axes="zx"
        ),
        "orientation": FrameOrientation(frame, path, gains=GAINS),
        "pose": FramePose(frame, ComposedPose(CIRCLE, turning), gains=GAINS),
        "held pose": FramePose(frame, HoldPose([0.4, 0, 0.5], TURNED), gains=GAINS),
        "pointing": Pointing(frame, axis=[0.0, 0.6, 0.8], trajectory=SPIN, gains=GAINS),
        "posture": JointPosture(
            robot.home(), gains=GAINS, displacement=motion if all_joints else None
        ),
    }
    start = start_of(robot)
    return {name: task.placed(start) for name, task in made.items()}


def fields(robot: Robot, frame: str) -> dict[str, NullSpaceField]:
    ball = obstacle(Sphere(0.1))
    middle = robot.joint_names[len(robot.joint_names) // 2]
    made: dict[str, NullSpaceField] = {
        "rest": Rest(),
        "centering": JointCentering(),
        "limits": LimitBarrier(zone=1.0),
        "posture": TargetPosture(robot.home()),
        "equal": EqualJointAngles([robot.joint_names[0], middle]),
        "root": Manipulability(frame, rows="pose", length=0.5),
        "log": Manipulability(frame, form="log", metric=2.0 * np.eye(robot.nv)),
        "condition": InverseCondition(frame),
        "point": PointDistance([frame], ball),
        "sum": JointCentering()
        + Ramp(initial=0.0, final=1.0, start=0.0, duration=2.0) * Manipulability(frame),
    }
    start = start_of(robot)
    return {name: field.placed(start) for name, field in made.items()}


def clearances(robot: Robot) -> dict[str, NullSpaceField]:
    made: dict[str, NullSpaceField] = {
        name: ObstacleClearance([obstacle(shape)], influence=0.8)
        for name, shape in SHAPES.items()
    }
    made["self"] = SelfClearance(influence=0.5)
    start = start_of(robot)
    return {name: field.placed(start) for name, field in made.items()}


METRICS = {
    "identity": IdentityMetric(),
    "constant": ConstantMetric(np.linspace(1.0, 2.0, 7)),
    "mass matrix": MassMatrixMetric(),
}


# -- states and samples ---------------------------------------------------------------


def test_calls_bound_to_a_state_or_sample_are_not_shared() -> None:
    """Alternating, as in finite differences, and with samples created and freed."""
    robot, frame = Robot.load("panda"), "panda_tcp"
    first, second = RobotState(robot), RobotState(robot)
    rng = np.random.default_rng(5)
    first.update(0.1, robot.home(), rng.standard_normal(7))
    second.update(0.7, robot.home() + 0.1, rng.standard_normal(7))
    metric = MetricSample.allocate(7)
    for task in tasks(robot, frame).values():
        kept = [task.evaluate(state) for state in (first, second)]
        out = TaskSample.allocate(task.rows, 7)
        for k in (0, 1, 0):
            sample = task.evaluate((first, second)[k], out)
            assert sample is out
            for one, other in zip(sample, kept[k], strict=True):
                np.testing.assert_array_equal(one, other)
    for field in (fields(robot, frame) | clearances(robot)).values():
        outs = FieldSample.allocate(7), FieldSample.allocate(7)
        for k in (0, 1):
            field.evaluate((first, second)[k], metric, 0, outs[k])
        again = FieldSample.allocate(7)
        for k in (0, 1, 0):
            field.evaluate((first, second)[k], metric, 0, again)
            np.testing.assert_array_equal(again.g, outs[k].g)
            np.testing.assert_array_equal(again.g_dot, outs[k].g_dot)


# -- formulas and Coal -----------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*SHAPES, "self"])
def test_formulas_agree_with_coal_and_with_differences(kind: str) -> None:
    """Distances and gradients with Coal's, rates with differences along the flow.

    Capsules stand for the links before balls, capsules and each other; balls before
    boxes, cylinders and planes.
    """
    robot, rng = Robot.load("panda"), np.random.default_rng(17)
    rounded = kind in ("sphere", "capsule", "self")
    links = link_shapes(robot, "capsules" if rounded else "spheres")
    if kind == "self":
        pairs = [(i, j) for i in range(4) for j in range(6, len(links))]
        proximity = Proximity(robot, links, [], pairs)
    else:
        pairs = [(i, len(links)) for i in range(len(links))]
        proximity = Proximity(robot, links, [obstacle(SHAPES[kind])], pairs)
    assert proximity.coal is None
    assert proximity.closed_form is not None
    count = len(pairs)
    coal = CoalDistances(
        robot, links, proximity.obstacles, np.array(pairs), np.arange(count)
    )
    agreed = 0
    while agreed < 6:
        q, v = robot.random_configuration(rng), 0.5 * rng.standard_normal(7)
        state = robot.state(0.4, q, v)
        weights = rng.uniform(0.5, 1.0, count)
        theirs, distances = np.zeros(count), proximity.measure(state).copy()
        coal.measure(state, theirs)
        apart = distances > 1e-3
        # GJK's tolerance is 1e-10 of squares; formulas on both sides agree better.
        np.testing.assert_allclose(distances[apart], theirs[apart], atol=2e-6)
        weights[~apart] = 0.0
        by_coal = np.zeros(7)
        coal.add_gradient(state, weights, by_coal)
        gradient, rate = proximity.closed_form.differentiate(state, weights, 0.0)
        rate = rate.copy()
        np.testing.assert_allclose(gradient, by_coal, atol=1e-4)

        def along(s: float, q: Any = q, v: Any = v, weights: Any = weights) -> Any:
            here = robot.state(0.4 + s, robot.integrate(q, s * v), v)
            return proximity.gradient(here, weights)

        halves = [slope(along, h) for h in (1e-4, 5e-5)]
        if np.abs(halves[0] - halves[1]).max() > 1e-6:
            continue  # the nearest feature changes between the steps: the rate jumps
        agreed += 1
        np.testing.assert_allclose(rate, halves[1], atol=1e-6)


# -- no memory -------------------------------------------------------------------------

JOINTS = 150


@pytest.fixture(scope="module")
def chain(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """Return a long chain, so that a vector of size nv stands out in memory."""
    axes, ball = (
        ("0 0 1", "0 1 0", "1 0 0"),
        '<geometry><sphere radius="0.01"/></geometry>',
    )
    text = '<robot name="chain"><link name="link0"/>'
    for k in range(1, JOINTS + 1):
        collision = f"<collision>{ball}</collision>" if k % 15 == 0 else ""
        text += (
            f'<joint name="joint{k}" type="revolute"><parent link="link{k - 1}"/>'
            f'<child link="link{k}"/><axis xyz="{axes[k % 3]}"/>'
            '<origin xyz="0 0 0.02"/>'
            '<limit lower="-2" upper="2" effort="1e9" velocity="9"/></joint>'
            f'<link name="link{k}"><inertial><mass value="0.1"/>'
            '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
            f"</inertial>{collision}</link>"
        )
    file = tmp_path_factory.mktemp("robot") / "chain.urdf"
    file.write_text(text + "</robot>")
    return Robot.load(file)


def allocated(step: Callable[[], Any], steps: int) -> tuple[int, int]:
    """Return the most memory [bytes] that steps held at once, and blocks they left."""
    for _ in range(20):
        step()
    gc.collect()
    gc.disable()
    before = sys.getallocatedblocks()
    for _ in range(steps):
        step()
    left = sys.getallocatedblocks() - before
    peaks = []
    for _ in range(3):  # the least: threads of other tests may allocate meanwhile
        tracemalloc.start()
        step()
        tracemalloc.reset_peak()
        held, _ = tracemalloc.get_traced_memory()
        for _ in range(20):
            step()
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        peaks.append(peak - held)
    gc.enable()
    return min(peaks), left


VECTOR = 8 * JOINTS
"""Bytes of the smallest array of size nv; Python objects are smaller."""


@pytest.mark.slow
def test_a_step_allocates_nothing(chain: Robot) -> None:
    """Neither the law nor Pinocchio, called without its Python bindings, allocates."""
    name, q, v = f"link{JOINTS}", chain.home() + 0.1, np.full(JOINTS, 1e-3)
    frame = chain.state(0.1, q, v).frame(name)
    here = HoldPose(frame.position, frame.rotation)
    pose = FramePose(name, here, gains=GAINS)
    clearance = ObstacleClearance([obstacle(Sphere(0.1))], influence=9.0)
    field = JointCentering() + 0.1 * clearance
    controller = Controller(chain, [pose], field, limits=Limits())
    state = controller.state
    out = controller.compute(0.1, q, v)
    assert out.status == Status.EXACT

    peak, left = allocated(lambda: state.update(0.1, q, v), 500)
    assert peak < VECTOR
    assert left < 50

    def compute() -> None:
        state.stamp_array[0] += 1
        controller.compute(state)

    peak, left = allocated(compute, 500)
    # The output, 1.5 kB of small Python objects, and no other vector.
    assert peak < len(out._memory) + out.tau.nbytes + 2 * VECTOR
    assert left < 50


def test_a_step_shows_its_calls_and_steps_through_them() -> None:
    """From the state to the limits, each argument with the call that writes it."""
    robot = Robot.load("panda")
    controller = Controller(robot, [FramePosition("panda_tcp")])
    with pytest.raises(ControllerError, match="compute one"):
        _ = controller.step_plan
    q, v = robot.home(), np.zeros(7)
    tau = controller.compute(0.0, q, v).tau
    plan = controller.step_plan
    names = [each.kind.name for each in calls(plan) if isinstance(each, Call)]
    assert names[0] == "JointJacobians"
    assert names.index("Resolve") < names.index("InverseDynamics")
    assert "carrier.J_world [6 x 7], from 0" in listing(plan)
    for each in calls(plan):
        each(0.0)
    np.testing.assert_array_equal(controller.state.effort, tau)
    assert first_nan(plan) is None
