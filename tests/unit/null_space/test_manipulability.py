"""Costs of a frame's Jacobian: exact on every arm, and finite at every singularity.

Each cost is written a second time with NumPy's singular values of Pinocchio's own frame
Jacobian. With L the largest singular value of all rows (what one joint can change of
another's column), the least one, σ, varies over angles of σ/L = 1/κ. That is how
differences choose their step, and the units that errors are stated in: a cost of size
|f| has slopes of size |f| κ and, at speed |v|, rates of slopes of size |f| κ² |v|.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from field_cases import placed
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from oracles import slope
from places import THOROUGH

from hsp_control import Robot
from hsp_control.common.exceptions import (
    FieldError,
    FrameNotFoundError,
    HspControlError,
)
from hsp_control.common.resources import bundled_robots
from hsp_control.declaration.quantities import Positive
from hsp_control.null_space import differences
from hsp_control.null_space.fields import InverseCondition, Manipulability, Transmission
from hsp_control.null_space.fields.jacobian_cost import (
    JacobianCost,
    JacobianTerms,
    Rows,
)

Array = NDArray[np.float64]
WORLD_ALIGNED = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

ARMS = {  # every robot of 6 or 7 freedoms with a fixed base, and its hand
    "panda": "panda_tcp",
    "iiwa14": "iiwa_link_ee",
    "bravo7_no_ee": "end_effector_ball",  # three continuous joints
    "kinova": "j2s6s200_end_effector",  # three continuous joints
    "talos_arm": "gripper_left_motor_single_link",
    "ur3": "tool0",
    "ur3_gripper": "tool0",
    "ur3_limited": "tool0",
    "ur5": "tool0",
    "ur5_gripper": "tool0",
    "ur5_limited": "tool0",
    "ur10": "tool0",
    "ur10_limited": "tool0",
    "xarm7": "link_eef",
    "z1": "gripperMover",
}
OTHERS: dict[str, tuple[str, str, str]] = {  # source, root, frame
    "tiago": ("tiago_no_hand", "fixed", "wrist_ft_tool_link"),  # on a prismatic torso
    "baxter": ("baxter", "fixed", "right_gripper"),  # fingers mimic, elsewhere
    "floating talos_arm": ("talos_arm", "free_flyer", ARMS["talos_arm"]),
    "rolling ur5": ("ur5", "planar", "tool0"),
    "solo12": ("solo12", "free_flyer", "HR_FOOT"),
    "stanford": ("stanford", "fixed", "hand"),
}
EVERY = [*ARMS, *OTHERS]

STANFORD = """<robot name="stanford">{links}
{joints}
</robot>"""
STANFORD_JOINTS = (  # a prismatic joint between revolute ones, on skew axes
    ("revolute", "0 0 0.4", "0 0 0", "0 0 1"),
    ("revolute", "0.1 0 0", "-1.5 0.2 0", "0 0 1"),
    ("prismatic", "0 0.05 0.2", "0.3 1.4 0", "0.6 0 0.8"),
    ("revolute", "0.1 0 0.1", "0 0.4 0.5", "0 1 0"),
    ("prismatic", "0 0.1 0", "0.2 0 1", "1 0 0"),
    ("revolute", "0 0.1 0.2", "1 0.2 0", "1 0 0"),
    ("revolute", "0.1 0 0", "0 0.7 0.1", "0 0 1"),
)


@cache
def stanford() -> str:
    """Return a URDF with prismatic joints after revolute ones."""
    inertial = (
        '<inertial><origin xyz="0.02 0.01 0.03"/><mass value="1"/>'
        '<inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    names = [*(f"link{k}" for k in range(7)), "hand"]
    links = "".join(f'<link name="{name}">{inertial}</link>' for name in names)
    joints = "".join(
        f'<joint name="joint{k}" type="{kind}"><parent link="{names[k]}"/>'
        f'<child link="{names[k + 1]}"/><origin xyz="{xyz}" rpy="{rpy}"/>'
        f'<axis xyz="{axis}"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
        "</joint>"
        for k, (kind, xyz, rpy, axis) in enumerate(STANFORD_JOINTS)
    )
    return STANFORD.format(links=links, joints=joints)


@pytest.fixture(scope="session")
def load(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Robot]:
    """Return how robots are loaded, each once."""
    file = tmp_path_factory.mktemp("arm") / "stanford.urdf"
    file.write_text(stanford())

    @cache
    def loaded(name: str) -> Robot:
        source, root, _ = OTHERS.get(name, (name, None, ""))
        if source == "stanford":
            return Robot.load(file)
        if source not in bundled_robots():
            pytest.importorskip("example_robot_data")
        return Robot.load(source, root=root)  # type: ignore[arg-type]

    return loaded


def hand(name: str) -> str:
    """Return the frame that is watched."""
    return ARMS[name] if name in ARMS else OTHERS[name][2]


# -- what is known without the package -------------------------------------------------


def frame_jacobian(robot: Robot, q: Array, frame: str) -> Array:
    """Return Pinocchio's frame Jacobian in world axes, linear before angular."""
    index = robot.model.getFrameId(frame)
    return pin.computeFrameJacobian(robot.model, data(robot), q, index, WORLD_ALIGNED)


@cache
def data(robot: Robot) -> pin.Data:
    """Return memory for Pinocchio."""
    return robot.model.createData()


def coupling(nv: int) -> Array:
    """Return a metric that couples all joints."""
    A = np.eye(nv) + 0.2 * np.random.default_rng(nv).normal(size=(nv, nv))
    return A.T @ A


class Spectrum:
    """Singular values and left singular vectors of some rows, lengths and metric."""

    def __init__(self, J: Array, rows: str, length: float, metric: bool) -> None:
        scaled = J * np.repeat([1.0, length], 3)[:, None]
        if metric:
            scaled = scaled @ np.linalg.inv(np.linalg.cholesky(coupling(J.shape[1]))).T
        self.U, s, _ = np.linalg.svd(scaled[["xyzrpq".index(row) for row in rows]])
        self.sharpness = float(np.linalg.norm(scaled, 2) / s[-1])
        self.s2 = s**2 + 1e-12  # the documented floor under every singular value


@dataclass(frozen=True)
class Member:
    """A cost, and the same from singular values."""

    build: Callable[[Robot, str], JacobianCost]
    oracle: Callable[[Spectrum], float]
    rows: str = "xyz"
    length: float = 1.0
    metric: bool = False
    size: float | None = None
    """|f|, where f itself has no scale of its own (a logarithm)."""

    def spectrum(self, robot: Robot, q: Array, frame: str) -> Spectrum:
        """Return the spectrum that the cost is a function of."""
        J = frame_jacobian(robot, q, frame)
        return Spectrum(J, self.rows, self.length, self.metric)

    def value(self, robot: Robot, q: Array, frame: str) -> float:
        """Return f."""
        return self.oracle(self.spectrum(robot, q, frame))


def manipulability(form: str, rows: str, **options: Any) -> Member:
    """Return a manipulability, and minus the determinant, its root or logarithm."""
    powers = {
        "determinant": lambda s: -float(np.prod(s.s2)),
        "root": lambda s: -float(np.sqrt(np.prod(s.s2))),
        "log": lambda s: -0.5 * float(np.log(s.s2).sum()),
    }
    axes = "".join(row for row in rows if row in "xyz")
    kind = "position" if "r" not in rows else ("pose" if axes else "orientation")
    length, metric = options.get("length", 1.0), options.get("metric", False)

    def build(robot: Robot, frame: str) -> JacobianCost:
        return Manipulability(
            frame,
            form=form,  # type: ignore[arg-type]
            rows=kind,  # type: ignore[arg-type]
            axes=axes or "xyz",
            length=length,
            metric=coupling(robot.nv) if metric else None,
        )

    size = 1.0 if form == "log" else None
    return Member(build, powers[form], rows, length, metric, size)


def inverse_condition(rows: str, length: float = 1.0) -> Member:
    """Return the isotropy cost, and k²/(Σ σ² Σ σ⁻²)."""
    axes = "".join(row for row in rows if row in "xyz")
    kind = "position" if "r" not in rows else "pose"
    return Member(
        lambda robot, frame: InverseCondition(
            frame,
            rows=kind,  # type: ignore[arg-type]
            axes=axes,
            length=length,
        ),
        lambda s: -float(len(s.s2) ** 2 / s.s2.sum() / (1.0 / s.s2).sum()),
        rows,
        length,
    )


def transmission(kind: str, direction: list[float], axes: str = "xyz") -> Member:
    """Return the ratio along u, and (Σ (uᵢ/σᵢ)²)^(-1/2) or (Σ (uᵢσᵢ)²)^(-1/2).

    The floor belongs to G for velocity; for force to the square of the radius itself.
    """
    u = np.array(direction) / np.linalg.norm(direction)

    def oracle(s: Spectrum) -> float:
        along = (s.U.T @ u) ** 2
        if kind == "velocity":
            return -float((along / s.s2).sum() ** -0.5)
        return -float(((along * (s.s2 - 1e-12)).sum() + 1e-12) ** -0.5)

    def build(robot: Robot, frame: str) -> JacobianCost:
        return Transmission(frame, direction=direction, kind=kind, axes=axes)  # type: ignore[arg-type]

    return Member(build, oracle, axes)


MEMBERS = {
    "root": manipulability("root", "xyz"),
    "root, two axes": manipulability("root", "xz"),
    "root, pose": manipulability("root", "xyzrpq", length=0.4),
    "root, metric": manipulability("root", "xyz", metric=True),
    "determinant, orientation": manipulability("determinant", "rpq"),
    "determinant, pose, metric": manipulability(
        "determinant", "xyzrpq", length=0.3, metric=True
    ),
    "log": manipulability("log", "xyz"),
    "log, pose": manipulability("log", "xyzrpq", length=0.4),
    "log, plane and turns, metric": manipulability("log", "xyrpq", metric=True),
    "inverse condition": inverse_condition("xyz"),
    "inverse condition, pose": inverse_condition("xyzrpq", 0.4),
    "transmission, velocity": transmission("velocity", [3.0, -1.0, 2.0]),
    "transmission, force": transmission("force", [3.0, -1.0, 2.0]),
    "transmission, two axes": transmission("velocity", [1.0, -2.0], "zx"),
}


def states(robot: Robot, number: int, seed: int) -> list[tuple[Array, Array]]:
    """Return random configurations and velocities."""
    rng = np.random.default_rng([seed, *robot.name.encode()])
    return [
        (robot.random_configuration(rng), rng.normal(size=robot.nv))
        for _ in range(number)
    ]


def close(actual: Array, expected: Array, atol: float, label: str = "") -> None:
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol, err_msg=label)


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_value_gradient_and_rate_at_random_states(
    name: str, load: Callable[[str], Robot]
) -> None:
    """On every arm, near singularities as well as away from them.

    G = J Jᵀ loses κ² of the digits, singular values only κ. Differences of sixth order
    over steps of 0.01/κ err by at most 7! · 0.01⁶/140 of the scale, seen 1e-13, and
    lift rounding by 1e2.
    """
    robot, frame = load(name), hand(name)
    for which, member in MEMBERS.items():
        field = member.build(robot, frame)
        turned = 0.0
        for q, v in states(robot, 8 if THOROUGH else 2, seed=1):
            state = robot.state(0.0, q, v)
            kappa = member.spectrum(robot, q, frame).sharpness
            f = member.value(robot, q, frame)
            size = member.size or abs(f)
            label = f"{name}, {which}, κ = {kappa:.3g}"
            assert abs(field.value(state) - f) <= 1e-13 * kappa**2 * size, label

            expected = np.zeros(robot.nv)
            for i, e in enumerate(np.eye(robot.nv)):
                expected[i] = slope(
                    lambda s, e=e, q=q, member=member: member.value(
                        robot, robot.integrate(q, s * e), frame
                    ),
                    0.01 / kappa,
                )
            tolerance = (2e-12 + 1e-13 * kappa) * size * kappa
            close(field.gradient(state), expected, tolerance, label)

            speed = float(np.linalg.norm(v))
            rate = slope(
                lambda s, q=q, v=v, field=field: field.gradient(
                    robot.state(s, robot.integrate(q, s * v), v)
                ),
                0.01 / kappa / speed,
            )
            unit = size * kappa**2 * speed
            tolerance = (2e-12 + 1e-14 * kappa**2) * unit
            close(field.gradient_rate(state), rate, tolerance, label)
            turned = max(turned, float(np.abs(rate).max()) / unit)
        if (name, which) != ("solo12", "determinant, orientation"):
            # (A leg's axes, one across and two along, look the same in every posture.)
            assert turned > 1e-5, f"{name}, {which}: nothing was tested"


# -- Pinocchio's kinematic Hessian, which needs no differences -------------------------


# -- what the costs say ----------------------------------------------------------------


def test_the_planar_arm_in_closed_form(load: Callable[[str], Robot]) -> None:
    """With its last link folded away, √det(J Jᵀ) of joints 1 and 2 is |sin q2|.

    Rows (-s1 - s12, c1 + c12) and (-s12, c12) of two links of 1 m.
    """
    robot = load("planar3r")
    field = Manipulability("link3", axes="xy")
    for q1, q2 in np.random.default_rng(5).uniform(0.3, 2.8, (10, 2)):
        q = robot.integrate(robot.neutral(), np.array([q1, q2, 0.4]))
        state = robot.state(0.0, q, np.array([0.3, -0.7, 0.2]))
        # The floor of 1e-12 in G stands beside σ² of 0.02 and more.
        assert field.value(state) == pytest.approx(-np.sin(q2), abs=1e-10)
        close(field.gradient(state), [0.0, -np.cos(q2), 0.0], 1e-9)
        close(field.gradient_rate(state), [0.0, -0.7 * np.sin(q2), 0.0], 1e-8)


# -- singularities ---------------------------------------------------------------------


def singular_members(robot: Robot, frame: str, axes: str) -> dict[str, JacobianCost]:
    """Return every cost, with metrics of large and of small numbers."""
    members: dict[str, JacobianCost] = {}
    every: tuple[Any, ...] = ("position", "orientation", "pose")[: 2 * len(axes) - 3]
    for rows in every:
        for form in ("determinant", "root", "log"):
            for unit in (1.0, 1e-8, 1e4):
                options: Any = {"form": form, "metric": unit * coupling(robot.nv)}
                members[f"{form} {rows} {unit}"] = Manipulability(
                    frame, rows=rows, axes=axes, **options
                )
        members[f"condition {rows}"] = InverseCondition(frame, rows=rows, axes=axes)
    for kind in ("velocity", "force"):
        for u in np.eye(len(axes)):
            members[f"{kind} {u}"] = Transmission(
                frame, direction=u, kind=kind, axes=axes
            )
    return members


@pytest.mark.slow
@pytest.mark.parametrize("name", ["planar3r", "panda", "iiwa14", "ur5", "kinova"])
def test_finite_at_every_singularity(name: str, load: Callable[[str], Robot]) -> None:
    """Joints at multiples of 45°: stretched, folded, wrist aligned, all at once."""
    robot = load(name)
    planar = name == "planar3r"
    frame, axes = ("tip", "xy") if planar else (hand(name), "xyz")
    members = singular_members(robot, frame, axes)
    worst = np.inf

    @settings(max_examples=60)
    @given(
        joints=st.lists(
            st.sampled_from([0.0, 0.25, -0.25, 0.5, -0.5, 1.0]),
            min_size=robot.nv,
            max_size=robot.nv,
        ),
        turn=st.floats(-3.0, 3.0),
        seed=st.integers(0, 99),
    )
    def finite(joints: list[float], turn: float, seed: int) -> None:
        nonlocal worst
        angles = np.pi * np.array(joints)
        angles[0] = turn  # off the world's axes, where rounding does not help
        q = robot.integrate(robot.neutral(), angles)
        v = np.random.default_rng(seed).normal(size=robot.nv)
        state = robot.state(0.0, q, v)
        J = state.frame(frame).jacobian
        worst = min(worst, np.linalg.svd(J[:2] if planar else J)[1][-1])
        for which, field in members.items():
            assert np.isfinite(field.value(state)), which
            assert np.isfinite(field.gradient(state)).all(), which
            assert np.isfinite(field.gradient_rate(state)).all(), which

    finite()
    assert worst < 1e-12  # some of them were as singular as can be


# -- what cannot be --------------------------------------------------------------------

PANDA = {"frame": "panda_tcp"}
UP = {"direction": [0.0, 0.0, 1.0]}
MISTAKES: list[tuple[type, dict[str, Any], type[HspControlError], str]] = [
    (Manipulability, {"frame": "panda_tpc"}, FrameNotFoundError,
     "frame: no frame 'panda_tpc'; did you mean 'panda_tcp'? (the model has "),
    (Manipulability, {"form": "rot"}, FieldError,
     "Manipulability: form: unknown value 'rot'; did you mean 'root'?"),
    (Manipulability, {"rows": "positions"}, FieldError,
     "Manipulability: rows: unknown value 'positions'; did you mean 'position'?"),
    (InverseCondition, {"axes": "xw"}, FieldError, "axes: 'xw' must be distinct"),
    (Manipulability, {"length": 0.0}, FieldError, "length: 0.0 is too small; must be"),
    (Transmission, UP | {"length": 1.0}, FieldError, "length: unknown argument 'len"),
    (Manipulability, {"metric": np.ones((6, 7))}, FieldError,
     "Manipulability: metric has shape (6, 7); needs (nv, nv), symmetric"),
    (Manipulability, {"metric": np.ones((7, 7))}, FieldError,
     "Manipulability: metric is not positive definite"),
    (Manipulability, {"metric": np.eye(6)}, FieldError,
     "metric: metric has shape (6, 6); needs (7, 7)"),
    (Manipulability, {"frame": "panda_link2"}, FieldError,
     "3 rows of frame 'panda_link2', which only 2 degrees of freedom move; these rows "
     "are singular everywhere"),
    (InverseCondition, {"frame": "panda_link5", "rows": "pose"}, FieldError,
     "6 rows of frame 'panda_link5', which only 5 degrees"),
    (Transmission, {"direction": [0, 0, 0]}, FieldError,
     "Transmission: direction [0.0, 0.0, 0.0] needs 3 numbers, one for each of the "
     "axes 'xyz', of a length that is not 0 or infinite"),
    (Transmission, {}, FieldError, "Transmission: missing argument 'direction'"),
    (Transmission, {"direction": [1, 0, 0], "axes": "xy"}, FieldError,
     "needs 2 numbers, one for each of the axes 'xy'"),
    (Transmission, {"direction": [1, np.nan, 0]}, FieldError,
     "Transmission: direction.1: .nan is not a finite number"),
    (Transmission, UP | {"kind": "speed"}, FieldError,
     "Transmission: kind: unknown value 'speed' (allowed: velocity, force)"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "options", "error", "message"), MISTAKES, ids=lambda x: str(x)[:30]
)
def test_every_mistake_is_named(
    kind: type,
    options: dict[str, Any],
    error: type[HspControlError],
    message: str,
    load: Callable[[str], Robot],
) -> None:
    robot = load("panda")
    with pytest.raises(error) as caught:
        placed(
            kind(**(PANDA | options)),
            robot.state(0.0, robot.home(), np.zeros(robot.nv)),
        )
    assert message in str(caught.value)


class Reach(JacobianCost):
    """What a user writes: minus half the square of the pose rows' Frobenius norm."""

    rows: Rows = "pose"
    length: Positive = 0.5

    def terms(self, J: Array, J_dot: Array) -> JacobianTerms:
        return JacobianTerms(-0.5 * float((J * J).sum()), -J, -J_dot)


@pytest.mark.parametrize("rows", ["position", "orientation", "pose"])
def test_a_user_s_own_cost_of_the_jacobian(
    rows: Rows, load: Callable[[str], Robot]
) -> None:
    """Its terms are all that it needs: value, gradient and rate follow."""
    robot, frame = load("panda"), hand("panda")
    ((q, v),) = states(robot, 1, seed=10)
    state = robot.state(0.0, q, v)
    field = placed(Reach(rows=rows), state)
    assert field.frame == robot.end_effector == frame
    kept = {"position": [0, 1, 2], "orientation": [3, 4, 5], "pose": [*range(6)]}[rows]
    scale = np.array([1.0 if k < 3 or rows != "pose" else 0.5 for k in kept])[:, None]
    J = scale * frame_jacobian(robot, q, frame)[kept]
    assert field.value(state) == pytest.approx(-0.5 * (J * J).sum(), rel=1e-14)
    close(field.gradient(state), differences.gradient(field.value, state), 1e-10)
    rate = differences.rate_along_flow(field.gradient, state)
    close(field.gradient_rate(state), rate, 1e-9)


def test_frames_beyond_a_joint_that_mimics(load: Callable[[str], Robot]) -> None:
    """The running sums know no freedom twice; frames before it, or elsewhere, serve."""
    robot = Robot.load("panda", locked={})
    assert robot.mimics
    at_home = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    with pytest.raises(FieldError) as caught:
        placed(Manipulability("panda_rightfinger"), at_home)
    assert str(caught.value) == (
        "frame: frame 'panda_rightfinger' is moved by 'panda_finger_joint2', which "
        "mimics another joint; choose a frame before it, or load with mimic: false"
    )
    free = Robot.load("panda", locked={}, mimic=False)
    q = free.random_configuration(np.random.default_rng(9))
    state = free.state(0.0, q, np.ones(9))
    beyond = Manipulability("panda_rightfinger", rows="pose")
    close(beyond.gradient(state), differences.gradient(beyond.value, state), 1e-9)
    # The finger that leads is an ordinary prismatic joint, also where it is followed.
    leading = Manipulability("panda_leftfinger")
    state = robot.state(0.0, q[:8], np.ones(8))
    other = free.state(0.0, q, np.ones(9))
    close(leading.gradient(state), leading.gradient(other)[:8], 1e-13)
