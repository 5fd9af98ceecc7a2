"""The safe stop as calls, for a live loop and for a program without Python."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.constraints.contacts import Contact
from hsp_control.control.actuation.support import Support
from hsp_control.control.evolution import PRESENT
from hsp_control.control.load import LoadEstimate
from hsp_control.control.planned import PlannedContact
from hsp_control.engine.plans import AnyCall, PartCall, PartCalls
from hsp_control.robot import RobotState


class StopGains(NamedTuple):
    """Parameters of braking and of holding; see `hsp_control.live`'s settings."""

    damping: float = 20.0
    """k of the braking effort -k M(q) v [1/s]."""
    natural_frequency: float = 10.0
    """Natural frequency of the hold that follows [rad/s]."""
    rest_speed: float = 0.01
    """Joint speed below which holding begins [rad/s or m/s]."""
    longest_damping: float = 0.5
    """Maximum duration of braking [s]."""


LARGEST = {"damping": 0.5, "natural_frequency": 0.2}
"""Largest products of these with the period h. With one period of delay a rate k is
stable for k h < 1 and a natural frequency ω for ω h < 0.43 (docs/robustness.md); half
of it is the margin for model errors."""

STEEPEST = 0.5
"""Smallest upward part of the normal of a plane that carries weight [-]: one of 60°.
Steeper ones, such as a wall, may only be pushed: the joints that are held do it."""


class BoundStop:
    """The calls of a safe stop at a state, and their memory.

    Damping: tau = g(q) - d - s k M(q) v, with the load d that acts on the joints
    besides their efforts (`LoadEstimate`; 0 where a robot floats, whose feet push it,
    too). Where d is right, the kinetic energy obeys T' = -s k vᵀM v. This is negative
    for any true inertia of the robot, because the model's M is positive definite.
    (Coriolis terms do no work; compensating them with a wrong model would.)
    With an exact model T falls like exp(-2 k t) for heavy and light joints alike, so
    that one gain k is enough. s, in [0, 1], scales the whole vector into the effort
    limits: damping that is clipped joint by joint can accelerate the robot.

    Hold: tau = g(q) - d - s M₀ (ω² (q ⊖ q₀) + 2 ω v) with M₀ at the configuration q₀
    where the robot came to rest: the PD control with gravity compensation of Takegaki
    and Arimoto (1981), stable for any inertia.

    A robot with a floating base stands on its feet meanwhile. A generalized force x is
    then the sum of the forces of joints and feet, x = Sᵀ tau + Jᵀ f. Its rows without
    motors determine the forces f at the feet's points, of minimum norm; then tau =
    S (x - Jᵀ f). While the feet stand still, J v = 0, these efforts do the work of x:
    vᵀ Sᵀ tau = vᵀ x. If none stands, nothing can hold the robot. Then its joints are
    damped only, tau_j = -k M_jj v_j: the robot sinks, and does not thrash.

    Attributes:
        state: Where the robot is.
        feet: The contacts that can carry it; see `STEEPEST`.
        limits: Limits of the efforts, shape (nv,).
        load: The external effort on the joints, shape (nv,).
        damped_for: Duration of the damping so far, shape (1,) [s].
        holding: Whether it holds, shape (1,).
        held_q: Where it holds, q₀, shape (nq,).
        tau: The effort, shape (nv,) [N·m or N].
    """

    def __init__(
        self,
        state: RobotState,
        contacts: Sequence[Contact],
        gains: StopGains,
        period: Array,
    ) -> None:
        """Begin with damping, on all feet.

        Args:
            state: The state of the robot.
            contacts: The contacts of a robot with a floating base.
            gains: The gains of damping and hold.
            period: Time between two evaluations, shape (1,) [s].
        """
        robot, nv = state.robot, state.robot.nv
        self.state, self._gains, self._period = state, gains, period
        self.feet = tuple(each for each in contacts if each.axes[2, 2] >= STEEPEST)
        if not robot.unactuated:
            self.feet = ()
        planned = [PlannedContact(each, PRESENT) for each in self.feet]
        self._support = Support(planned, state, robot.unactuated)
        self._standing = np.ones(self._support.size)
        self.limits = np.full(nv, np.inf)
        self.load = LoadEstimate(nv, period.item())
        self.damped_for = np.zeros(1)
        self.holding: Indices = np.zeros(1, dtype=np.int64)
        self.held_q, self._held_mass = robot.neutral(), np.zeros((nv, nv))
        self.tau = np.zeros(nv)

    def begin(self) -> None:
        """Start with damping."""
        self.damped_for[:] = 0.0
        self.holding[:] = 0

    def stand_on(self, feet: Sequence[Contact]) -> None:
        """Stand on exactly these feet."""
        for each, points in zip(self.feet, self._support.points, strict=True):
            on = any(each is foot for foot in feet)
            self._standing[3 * points.start : 3 * points.stop] = on

    def go_on(self, before: "BoundStop") -> None:
        """Continue from a stop at another state."""
        for mine, its in zip(self._memory, before._memory, strict=True):
            mine[:] = its
        self.load.go_on(before.load)

    @property
    def _memory(self) -> tuple[Array, Indices, Array, Array]:
        return self.damped_for, self.holding, self.held_q, self._held_mass

    def calls(self) -> PartCalls:
        """Return the calls that write `tau`; once a period."""
        state, nv = self.state, self.state.robot.nv
        gravity, force, away, rest = np.zeros((4, nv))
        calls: list[AnyCall] = [
            PartCall(
                engine.Difference,
                dynamics=state.dynamics,
                start=self.held_q,
                end=state.q,
                displacement=away,
            ),
            PartCall(  # with the state's payloads
                engine.InverseDynamics,
                dynamics=state.dynamics,
                q=state.q,
                v=rest,
                acceleration=rest,
                effort=gravity,
            ),
            PartCall(engine.Subtract, x=self.load.load, out=gravity),
            PartCall(
                engine.Brake,
                **self._gains._asdict(),
                period=self._period,
                q=state.q,
                v=state.v,
                away=away,
                M=state.inertia,
                base=self._support.base,
                standing=self._standing,
                damped_for=self.damped_for,
                holding=self.holding,
                held_q=self.held_q,
                held_mass=self._held_mass,
                gravity=gravity,
                force=force,
            ),
        ]
        if self.feet:
            calls += self._support.maps()
            gravity, carried = self._of_joints(gravity)
            force, braked = self._of_joints(force)
            calls += [carried, braked]
        given = {"base": gravity, "direction": force, "limits": self.limits}
        return [*calls, PartCall(engine.ScaleIntoLimits, **given, tau=self.tau)]

    def calls_before(self, acts: Array) -> PartCalls:
        """Return the calls of a period before the stop, whose effort is (nv,).

        They estimate the load. None of a robot whose base floats.
        """
        if self.state.robot.unactuated:
            return []
        return [self.load.call(self.state, acts)]

    def _of_joints(self, force: Array) -> tuple[Array, PartCall]:
        """Return the efforts (nv,) that exert a force (nv,) with the feet's help."""
        tau, size = np.zeros(len(force)), self._support.size
        call = PartCall(
            engine.MinimumNormForces,
            F=self._support.map,
            base=self._support.base,
            inverse_cost=self._standing,
            reference=np.zeros(size),
            wanted=force,
            forces=np.zeros(size),
            tau=tau,
        )
        return tau, call
