"""A robot's model: its sizes and its dynamics, independent of its source."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError
from hsp_control.engine import Dynamics
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.robot.dynamics import ModelNumbers, model_numbers
from hsp_control.robot.kinematics import Term
from hsp_control.robot.structure import Structure

_ARM_RATE, _LEG_RATE = 11.0, 500.0
"""Maximum rate of an effort in maximum efforts [1/s]: with a fixed base, and of a robot
whose contacts change."""


class RobotModel(Structure):
    """A robot's model: sizes for defaults, and its dynamics."""

    def __init__(
        self, model: pin.Model, name: str, home: Sequence[float] | None = None
    ) -> None:
        """Wrap a Pinocchio model; see `Structure`."""
        super().__init__(model, name, home)

    # -- sizes, for defaults ----------------------------------------------------------

    @cached_property
    def size(self) -> float:
        """Length of the longest chain from the first joint to a frame [m].

        It is the sum of the distances between the origins of consecutive joints, and of
        the ranges of prismatic ones: an arm reaches no farther from its first joint.
        """
        longest = self._lengths.max()
        for frame in self.model.frames:
            if frame.parentJoint > 0:
                away = np.linalg.norm(frame.placement.translation)
                longest = max(longest, self._lengths[frame.parentJoint] + away)
        return float(longest)

    @cached_property
    def _lengths(self) -> Array:
        """Chain lengths from the first joint to the others, shape (njoints,) [m]."""
        model, lengths = self.model, np.zeros(self.model.njoints)
        lower, upper = self.position_limits()
        for joint in range(1, model.njoints):
            parent = model.parents[joint]
            if parent > 0:
                away = np.linalg.norm(model.jointPlacements[joint].translation)
                lengths[joint] = lengths[parent] + away
            moved = model.joints[joint]
            if moved.nv == 1 and self.units[moved.idx_v] == "m":
                slid = (upper - lower)[moved.idx_v]
                lengths[joint] += slid if np.isfinite(slid) else 0.0
        return lengths

    @cached_property
    def largest_gravity(self) -> Array:
        """Largest efforts of the motors against gravity, shape (nv,) [N·m or N].

        An upper bound: as if all links beyond a joint were stretched out horizontally.
        """
        model, most = self.model, np.zeros(self.nv)
        g = float(np.linalg.norm(model.gravity.linear))
        for joint in range(1, model.njoints):
            own = model.joints[joint]
            turns, ratio, follows = self.units[own.idx_v] == "rad", 1.0, own.nv == 0
            if follows:  # its leader supplies it
                turns, ratio = self._followed(joint)
            for body in model.subtrees[joint]:
                inertia = model.inertias[body]
                away = self._lengths[body] - self._lengths[joint]
                lever = away + float(np.linalg.norm(inertia.lever)) if turns else 1.0
                columns = slice(own.idx_v, own.idx_v + (1 if follows else own.nv))
                most[columns] += ratio * g * inertia.mass * lever
        return most

    def _followed(self, joint: int) -> tuple[bool, float]:
        """Return whether a follower rotates, and its speed relative to its leader's."""
        model, data = self.model, self.model.createData()
        v = np.zeros(self.nv)
        v[model.joints[joint].idx_v] = 1.0
        pin.forwardKinematics(model, data, pin.neutral(model), v)
        carried = data.liMi[joint].actInv(data.v[model.parents[joint]])
        own = data.v[joint] - carried
        turns = bool(np.linalg.norm(own.angular) > 0.0)
        return turns, float(np.linalg.norm(own.angular if turns else own.linear))

    @property
    def effort_rate(self) -> Array:
        """Maximum rate of the efforts, shape (nv,) [N·m/s or N/s]; inf for none.

        No URDF has one. It is 11 times the largest maximum effort every second, for all
        joints of the same unit, a little less than a Panda permits at 87 N·m: a light
        wrist has to react to a push as quickly as a shoulder. For robots on legs the
        factor is 500.
        """
        effort = self.largest_efforts()
        rate = np.full(self.nv, np.inf)
        for unit in set(self.units):
            alike = np.isfinite(effort) & (np.array(self.units) == unit)
            rate[alike] = effort[alike].max(initial=0.0)
        return (_LEG_RATE if self.unactuated else _ARM_RATE) * rate

    @property
    def largest_error(self) -> tuple[float, float]:
        """The largest error of a task by default, of a position and an angle [m, rad].

        At ω0 = 10 rad/s the hand of an arm of 1 m then approaches at 1.75 m/s, about as
        fast as its joints can. A base that moves without an arm has no size: any
        position.
        """
        return 0.35 * self.size or np.inf, 1.25

    @cached_property
    def spring_force(self) -> tuple[float, float]:
        """The largest force and moment of springs by default [N, N·m]; inf for none.

        The force is that of the strongest motor at half of `size`, the moment half
        of that motor's effort. Of prismatic joints the force is used directly. Without
        a maximum effort it accelerates the robot's mass as gains of 100 1/s² do at
        0.3 of its size.
        """
        effort, lever = self.largest_efforts(), 0.5 * self.size
        turns = np.array(self.units) == "rad"
        slides = effort[~turns & np.isfinite(effort)]
        turns = effort[turns & np.isfinite(effort)]
        if turns.size and lever > 0.0:
            return float(turns.max()) / lever, 0.5 * float(turns.max())
        if slides.size:
            return float(slides.max()), np.inf
        moves = 30.0 * pin.computeTotalMass(self.model) * self.size
        return moves or np.inf, 0.5 * moves * lever or np.inf

    def largest_efforts(self) -> Array:
        """Return the motors' largest efforts, shape (nv,) [N·m or N]; inf for none.

        A model has none where its limit is 0, or not even a single-precision number.
        """
        effort = np.array(self.model.effortLimit)
        effort[(effort <= 0.0) | (effort >= np.finfo(np.float32).max)] = np.inf
        effort[list(self.unactuated)] = np.inf
        return effort

    @cached_property
    def largest_inertias(self) -> Array:
        """Largest M_ii in any posture, nearly, shape (nv,) [kg·m² or kg].

        It is the largest of home and 64 random postures, which are always the same.
        """
        rng, largest = np.random.default_rng(0), np.zeros(self.nv)
        q = self.home()
        for _ in range(65):
            largest = np.maximum(largest, np.diag(self.mass_matrix(q)))
            turned = rng.uniform(-np.pi, np.pi, self.nv)
            q = pin.integrate(self.model, self.neutral(), turned)
        return largest

    @cached_property
    def typical_inertia(self) -> float:
        """Geometric mean of the joints' largest inertias [kg·m²], nearly."""
        inertias = np.delete(self.largest_inertias, list(self.unactuated))
        inertias = inertias[inertias > 0.0]
        return float(np.exp(np.log(inertias).mean())) if inertias.size else 1.0

    # -- dynamics ---------------------------------------------------------------------

    def dynamics(self) -> Dynamics:
        """Return the dynamics with their own memory, as an argument of calls.

        They are those of the model as it is now: change its masses before states,
        controllers and plants are made of it.
        """
        before, numbers = self._numbers
        if before != self.model:  # which takes a hundredth of reading it
            before, numbers = self.model.copy(), model_numbers(self.model)
            self.__dict__["_numbers"] = before, numbers
        return Dynamics(*numbers)

    @cached_property
    def _numbers(self) -> tuple[pin.Model, ModelNumbers]:
        """A copy of the model, and its numbers."""
        return self.model.copy(), model_numbers(self.model)

    @cached_property
    def _own(self) -> Dynamics:
        return self.dynamics()

    def mass_matrix(self, q: Array, dynamics: Dynamics | None = None) -> Array:
        """Return M(q), shape (nv, nv) (CRBA).

        ``dynamics``: those of a robot that carries something.
        """
        M = np.empty((self.nv, self.nv))
        engine.MassMatrix(dynamics=dynamics or self._own, q=_packed(q), M=M)()
        return M

    def inverse_dynamics(
        self, q: Array, v: Array, a: Array, dynamics: Dynamics | None = None
    ) -> Array:
        """Return the effort M(q) a + N(q, v), shape (nv,) (RNEA).

        ``dynamics``: those with a payload, for example.
        """
        effort = np.empty(self.nv)
        given = {"q": _packed(q), "v": _packed(v), "acceleration": _packed(a)}
        own = dynamics or self._own
        engine.InverseDynamics(dynamics=own, **given, effort=effort)()
        return effort

    def forward_dynamics(
        self, q: Array, v: Array, tau: Array, dynamics: Dynamics | None = None
    ) -> Array:
        """Return the acceleration M(q)⁻¹ (tau - N(q, v)), shape (nv,).

        By RNEA, CRBA and a Cholesky factor of M, which is as sparse as the tree.
        ``dynamics``: those with a payload, for example.

        Raises:
            ModelError: If M is singular, which only mimic joints can make it.
        """
        acceleration = np.empty(self.nv)
        given = {"q": _packed(q), "v": _packed(v), "effort": _packed(tau)}
        call = engine.ForwardDynamics(
            dynamics=dynamics or self._own, **given, acceleration=acceleration
        )
        call()
        # Of NaN it is NaN.
        if self.mimics and all(np.isfinite(each).all() for each in given.values()):
            self._check_acceleration(acceleration)
        return acceleration

    def bind_forward_dynamics(
        self, q: Array, v: Array, tau: Array, dynamics: Dynamics | None = None
    ) -> Term:
        """Return `forward_dynamics` of the present contents of these arrays."""
        acceleration = np.zeros(self.nv)
        call = PartCall(
            engine.ForwardDynamics,
            dynamics=dynamics or self.dynamics(),
            q=q,
            v=v,
            effort=tau,
            acceleration=acceleration,
        )
        calls: PartCalls = [call]
        if self.mimics:
            check = PartCall(self._check_acceleration, acceleration=acceleration)
            calls = [*calls, check]
        return Term(acceleration, calls)

    def _check_acceleration(self, acceleration: Array) -> None:
        if np.isnan(acceleration).any():
            raise ModelError(
                f"{self.name}: the mass matrix is singular at this configuration"
            )


def _packed(array: Array) -> Array:
    """Return an array as a call can read it."""
    return np.ascontiguousarray(array, dtype=np.float64)
