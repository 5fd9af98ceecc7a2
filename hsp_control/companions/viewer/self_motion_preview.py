"""A preview of self-motion: the curve of the elbow while the hand is at rest.

From the present configuration the curve J(q) q' = 0 is followed both ways, along the
direction of the null space that moves the elbow most, until a joint reaches its limit,
the elbow stops, or the curve closes. Each step is corrected by Newton's method, so that
the errors of the tasks stay constant.
"""

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from time import monotonic
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, matrix_view
from hsp_control.companions.plots.palette import FIELD
from hsp_control.companions.viewer import threejs
from hsp_control.companions.viewer.commands import (
    PageCommand,
    delete,
    set_object,
    set_trail,
    set_transform,
)
from hsp_control.companions.viewer.ghosts import Ghosts
from hsp_control.control.interface import Controller
from hsp_control.robot import Robot

_STEP = 0.1  # length of a step, as a norm of joint angles [rad]
_STEPS = 36  # maximum number of steps in each direction
_CORRECTIONS = 2  # Newton's steps after every step
_RANK = 1e-4  # smallest singular value of J, over the largest, that adds to its rank
_STILL = 0.02  # smallest velocity of the elbow over that of the joints [m/rad]
_GHOSTS = 5
_OPACITY = 0.16
_PERIOD = 0.5  # time between the beginnings of two previews [s]


class SelfMotion(NamedTuple):
    """The motion that tasks leave free, as a curve of configurations."""

    configurations: Array  # shape (n, nq)
    elbow: Array  # positions of the joint that moves most [m], shape (n, 3)
    values: Array  # the field's cost, shape (n,)


class SelfMotionPreview:
    """Follows the self-motion of a controller's robot from the present posture."""

    def __init__(self, controller: Controller) -> None:
        """Copy the controller: only the copy is moved."""
        self._controller = controller._ahead()
        self._robot: Robot = controller.robot
        self._data = self._robot.model.createData()
        self._rest = np.zeros(self._robot.nv)

    def curve(self, t: float, q: Array) -> SelfMotion | None:
        """Return the self-motion through a configuration; None if there is none."""
        if self._robot.unactuated:  # contacts would have to be included
            return None
        e, N, _ = self._look(t, q)
        elbow = self._elbow(q, N)
        if elbow is None:
            return None
        before = list(self._follow(t, q, e, elbow, -1.0))
        after = list(self._follow(t, q, e, elbow, 1.0))
        found = np.array([*before[::-1], q, *after])
        values = np.array([self._look(t, each)[2] for each in found])
        points = np.array([self._place(each, elbow)[0] for each in found])
        return SelfMotion(found, points, values)

    def _look(self, t: float, q: Array) -> tuple[Array, Array, float]:
        """Return the tasks' errors, a basis of the null space, and the field's cost."""
        self._controller.compute(t, q, self._rest)
        stack = self._controller.active_stack
        _, sizes, rows = np.linalg.svd(stack.rows.jacobian)
        rank = int(np.sum(sizes > _RANK * sizes.max(initial=0.0)))
        return stack.rows.error.copy(), rows[rank:].T, stack.field_value()

    def _error_jacobian(self, t: float, q: Array) -> Array:
        """Return ∂e/∂q, shape (m, nv): each column is e' of one joint's motion."""
        columns = []
        for v in np.vstack([self._rest, np.eye(self._robot.nv)]):
            self._controller.compute(t, q, v)
            columns.append(self._controller.active_stack.rows.error_rate.copy())
        return np.asarray(np.array(columns[1:]) - columns[0]).T

    def _place(self, q: Array, joint: int) -> tuple[Array, Array]:
        """Return a joint's position [m], shape (3,), and its Jacobian, (3, nv)."""
        model, data = self._robot.model, self._data
        pin.computeJointJacobians(model, data, q)
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        J = matrix_view(pin.getJointJacobian(model, data, joint, world))[:3]
        return data.oMi[joint].translation.copy(), J

    def _elbow(self, q: Array, N: Array) -> int | None:
        """Return the joint that moves most in the null space; None if none does."""
        speeds = [
            float(np.linalg.norm(self._place(q, joint)[1] @ N, 2)) if N.size else 0.0
            for joint in range(1, self._robot.model.njoints)
        ]
        most = int(np.argmax(speeds))
        return most + 1 if speeds[most] > _STILL else None

    def _follow(
        self, t: float, q: Array, e: Array, elbow: int, way: float
    ) -> Iterator[Array]:
        """Yield the configurations in one direction, errors staying at e."""
        start, last = q, None
        for step in range(_STEPS):
            _, N, _ = self._look(t, q)
            _, speeds, directions = np.linalg.svd(self._place(q, elbow)[1] @ N)
            if not speeds.size or speeds[0] < _STILL:
                return
            along = N @ directions[0]
            if last is None:  # the sign of a singular vector is arbitrary
                along *= way * np.sign(along[np.argmax(np.abs(along))])
            elif last @ along < 0.0:
                along = -along
            q, last = self._robot.integrate(q, _STEP * along), along
            inverse = np.linalg.pinv(self._error_jacobian(t, q), _RANK)
            for _ in range(_CORRECTIONS):
                q = self._robot.integrate(q, inverse @ (e - self._look(t, q)[0]))
            if not self._within_limits(q):
                return
            yield q
            closed = np.linalg.norm(self._robot.difference(start, q)) < 0.6 * _STEP
            if step > 2 and closed:
                return

    def _within_limits(self, q: Array) -> bool:
        model = self._robot.model
        if model.nq != model.nv:
            return True
        low, high = model.lowerPositionLimit, model.upperPositionLimit
        return bool(((q >= low) & (q <= high)).all())


class PreviewDrawing:
    """Draws previews: the elbow's curve, ghosts, and the minimum of the field's cost.

    A thread computes them, as each takes some 50 ms; a picture never waits for one.
    """

    def __init__(self, robot: Robot) -> None:
        """Draw nothing yet."""
        self._ghosts = Ghosts("self-motion", robot, FIELD, _OPACITY)
        self._radius = 0.004 * robot.size
        self._worker = ThreadPoolExecutor(1, "self-motion")
        self._preview: SelfMotionPreview | None = None
        self._coming: Future[SelfMotion | None] | None = None
        self._shown, self._due = False, 0.0

    def begin(self) -> None:
        """Begin anew with the next picture, with the controller as it is then."""
        self._preview = self._coming = None
        self._due = 0.0

    def draw(self, controller: Controller | None, on: bool) -> Iterator[PageCommand]:
        """Yield the commands for changes since the last picture."""
        if not on or controller is None:
            self.begin()
            yield from self._show(None, controls=False)
            return
        if self._preview is None:
            self._preview = SelfMotionPreview(controller)
        if self._coming is not None and self._coming.done():
            motion, self._coming = self._coming.result(), None
            yield from self._show(motion, controls=controller.field.controls)
        if self._coming is None and monotonic() >= self._due:
            self._due = monotonic() + _PERIOD
            state = controller.state
            about = state.t, state.q.copy()
            self._coming = self._worker.submit(self._preview.curve, *about)

    def _show(
        self, motion: SelfMotion | None, *, controls: bool
    ) -> Iterator[PageCommand]:
        """Yield the commands that show a preview; None: none."""
        if motion is None or len(motion.elbow) < 2:
            if self._shown:
                yield delete("/preview")
                yield self._ghosts.show([])
            self._shown = False
            return
        self._shown = True
        color = threejs.color_number(FIELD)
        yield set_trail("/preview/curve", motion.elbow, self._radius, color)
        if controls:
            ball = threejs.sphere(3.0 * self._radius)
            surface = threejs.always_visible(threejs.material(FIELD, glow=0.6))
            place = threejs.pose_at(motion.elbow[int(np.argmin(motion.values))])
            yield set_object("/preview/best", threejs.mesh_group(ball, surface))
            yield set_transform("/preview/best", place)
        rows = np.linspace(0, len(motion.elbow) - 1, _GHOSTS).round().astype(int)
        yield self._ghosts.show(list(motion.configurations[rows]), "self-motion")
