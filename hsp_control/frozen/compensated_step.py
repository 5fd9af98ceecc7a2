"""A step with compensators, as one move, like `CompensatedController.effort`.

    measured t, q, v → velocity filter → state → observer → law → start-up ramp
                     → offset of the effort → limits → effort → integral action

The stages have their calls themselves; here they are put into the order of the chain.
"""

from collections.abc import Iterable

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import FreezeError
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation.actuation import Actuation
from hsp_control.control.actuation.delivered import DeliveredAlone
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.compensation.compensation import STAGES, Compensation
from hsp_control.control.compensation.stage import Alone, AloneCalls
from hsp_control.control.controller import Controller
from hsp_control.declaration import within
from hsp_control.engine import Move, Plan
from hsp_control.engine.plans import AnyCall, OnlyIf, PartCall, PartCalls, Step
from hsp_control.frozen.task_sets import TaskSets
from hsp_control.robot import RobotState


class CompensatedStep:
    """The step of a controller with the compensators of one run.

    Attributes:
        stages: Their calls.
    """

    def __init__(
        self,
        own: Controller,
        bound: BoundStep,
        compensation: Compensation,
        delivered: DeliveredAlone,
        period: Array,
        sending: PartCalls,
        damped: Indices,
    ) -> None:
        """Begin the compensators.

        Args:
            own: The controller, whose step is bound.
            bound: Its step.
            compensation: The compensators.
            delivered: The array into which the delivered effort is written.
            period: Time for which an effort is held, shape (1,) [s].
            sending: The call that records the effort as sent.
            damped: Where the first level with a bounded inverse is, shape (1,).

        Raises:
            FreezeError: If a compensator is computed in Python.
        """
        state: RobotState = bound.state
        self._state, self._bound = state, bound
        self._delivered, self._sending = delivered, sending
        nv, limits = own.robot.nv, bound.limits
        caused = np.zeros(nv) if own.limits is None else limits.sent.held.disturbance
        self._measured = np.zeros(1), state.q.copy(), np.zeros(nv)
        self._shared = Alone(
            state=state,
            v=self._measured[2],
            a=np.zeros(nv),
            effort=np.zeros(nv),
            period=period,
            acted=np.zeros(nv),
            disturbance=caused,
            starting=np.zeros(1, dtype=np.int64),
            damped=damped,
            status=delivered.status,
        )
        self.stages: list[AloneCalls] = []
        for name, begin in STAGES.items():
            declared = getattr(compensation, name)
            stage = None if declared is None else begin(declared, own)
            if stage is None:
                continue
            calls = stage.alone(self._shared)
            if calls is None:
                with within("compensation", name):
                    raise FreezeError(
                        "this compensator is computed in Python, which a frozen "
                        "controller runs without"
                    )
            self.stages.append(calls)

    def move(self, sets: TaskSets | None) -> Move:
        """Return the step as one move from the measured state.

        Args:
            sets: The sets of tasks, if some come and go.
        """
        state, bound, shared = self._state, self._bound, self._shared
        time, q, v = self._measured
        moved = [
            _copy(time, state.time),
            _copy(q, state.q),
            _copy(v, state.v),
            PartCall(engine.HasMoved, stamp=state.stamp_array),
        ]
        before = [*_all(each.measure for each in self.stages), *moved]
        observe = [*_all(each.observe for each in self.stages)]
        if sets is None:
            parts = bound.active, bound.actuation, self._delivered
            act = [*bound.active.calls, *self._deliver(*parts)]
        else:
            act = sets.calls(self._delivered, self._deliver)
        finish = [
            *self._sending,
            _copy(self._delivered.tau, shared.acted),
            *_all(each.finish for each in self.stages),
        ]
        after = [OnlyIf(finish, self._delivered.delivered)]
        kinematics = state.bind_move().values
        calls = [
            *state.plan(before).steps(),
            *kinematics["calls"].calls,
            *state.plan(observe).steps(),
            *act,
            *state.plan(after).steps(),
        ]
        own = {"time": time, "q": q, "v": v, "stamp": np.zeros(1, dtype=np.int64)}
        return engine.Move(**kinematics | own | {"calls": Plan(calls)})

    def _deliver(
        self, active: ActiveStack, actuation: Actuation, part: DeliveredAlone
    ) -> list[Step]:
        """Return the calls that deliver the law of a stack, with the stages."""
        shared = self._shared
        calls = [
            _copy(active.law.acceleration, shared.a),
            _copy(np.zeros(len(shared.effort)), shared.effort),
            *_all(each.act for each in self.stages),
            *actuation.calls_with_offset(shared.a, shared.effort, part),
        ]
        return self._state.plan(calls).steps()


def _copy(x: Array, out: Array) -> PartCall:
    return PartCall(engine.Copy, x=x, out=out)


def _all(calls: Iterable[PartCalls]) -> list[AnyCall]:
    return [each for some in calls for each in some]
