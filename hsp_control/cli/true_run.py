"""The log of a simulated robot, with what the loop's controller says of its states."""

from contextlib import suppress

import numpy as np

from hsp_control.common.errors import HspControlError, LiveError
from hsp_control.config import Experiment
from hsp_control.control.output import ControlOutput
from hsp_control.robot import RobotState
from hsp_control.simulation.limit_excess import POSITION, VELOCITY
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.simulation.rollout import Rollout


def with_tasks(truth: Rollout, loop: Rollout, repeated: Experiment) -> Rollout:
    """Return a robot's log with the columns of tasks, obstacles, fields and the law.

    Args:
        truth: The log of the robot, which knows no controller.
        loop: The log of the loop.
        repeated: The loop's run, repeated from its log: with the messages that its
            streams received, and the changes that were made meanwhile.

    Raises:
        LiveError: If the loop followed a plan, whose parts are not in the log.
    """
    if repeated.scenario.plan is not None:
        raise LiveError("what the plan made is in the loop's log")
    controller, state = repeated.controller, RobotState(repeated.robot)
    config = {"config": truth.meta.get("config")}
    writer = LogWriter(controller, repeated.scene, len(truth), meta=config)
    limits, constant = controller.limits, True
    for t, q, v, tau in zip(truth.t, truth.q, truth.v, truth.tau, strict=True):
        state.update(t, q, v)
        output: ControlOutput | None = None
        with suppress(HspControlError):  # then the columns of the row are empty
            output = controller.compute(state)
        constant &= controller.limits is limits
        writer.record(state, output, tau, {})
    run = writer.rollout(truth.status, truth.meta["message"])
    columns = {**truth.columns, **run.columns}
    if limits is not None and constant:
        # Only the robot knows the largest excess between two rows, over these limits.
        columns |= {name: truth[name] for name in (POSITION, VELOCITY)}
    # The loop begins the safe stop, and the robot its own when the loop has ended.
    latest = np.searchsorted(loop.t, truth.t, side="right") - 1
    phases = loop["live.phase"][latest.clip(0)]
    columns["live.phase"] = np.maximum(truth["live.phase"], phases)
    meta = truth.meta | run.meta
    meta["columns"] = truth.meta["columns"] | run.meta["columns"]
    return Rollout(columns, meta)
