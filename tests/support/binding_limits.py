"""A hand with a distant target and active limits, and jumps of its efforts."""

from itertools import pairwise
from typing import Any

import numpy as np
from hypothesis import assume
from loaded_robots import load

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.actuation import Status
from hsp_control.trajectories import HoldOrientation

START, RAMP = 0.2, 0.3
EVENTS = (START, START + 0.1, START + RAMP - 0.1, START + RAMP)
"""Begin and end times of the changes below [s]."""
FINEST = 1e-9
"""Interval to which the largest change is bisected [s]."""
JUMP = 1e-6
"""The largest change of an effort that is no jump [N·m]."""


class Case:
    """A hand with a distant target, and motors that can hardly hold the arm."""

    def __init__(self, name: str, seed: int) -> None:
        self.rng = rng = np.random.default_rng(seed)
        self.robot = load(name)
        self.q = self.robot.random_configuration(rng)
        self.v = 0.5 * rng.standard_normal(self.robot.nv)
        self.state = self.robot.state(0.0, self.q, self.v)
        self.binds = False
        self.axes = "xz" if self.robot.nv == 3 else "xyz"

    def limits(self, **more: Any) -> hsp.Limits:
        """Return limits of which some are active: efforts near those of gravity."""
        held = np.abs(self.state.nonlinear_effects)
        effort = (0.3 + self.rng.uniform(0.0, 1.0, self.robot.nv)) * held + 1.0
        speed = np.abs(self.v) * self.rng.uniform(0.9, 3.0, self.robot.nv) + 0.1
        return hsp.Limits(effort=effort, velocity=speed, position="none", **more)

    def hand(self, **options: Any) -> hsp.FramePosition:
        here = self.state.position(self.robot.end_effector)
        away = 0.3 * self.rng.standard_normal(3)
        point = (here + away)[[0, 2]] if self.axes == "xz" else here + away
        return hsp.FramePosition(
            self.robot.end_effector,
            hsp.Hold(point),
            axes=self.axes,
            name="hand",
            **options,
        )

    def other(self, **options: Any) -> hsp.Task:
        """Return a task to which the hand leaves some freedom, or none."""
        options = {"name": "other", "priority": int(self.rng.integers(1, 3)), **options}
        if self.robot.nv > 3 and self.rng.uniform() < 0.5:
            turned = HoldOrientation(self.rng.standard_normal(3))
            frame = self.robot.end_effector
            return hsp.FrameOrientation(frame, turned, **options)
        joint = str(self.rng.choice(list(self.robot.joints)))
        return hsp.JointPosture(
            self.robot.random_configuration(self.rng), joints=[joint], **options
        )

    def controller(self, *tasks: hsp.Task, **options: Any) -> hsp.Controller:
        tasks = tasks or (self.hand(),)
        options = {"limits": self.limits(), "start": self.q, **options}
        return hsp.Controller(self.robot, tasks, hsp.TargetPosture("home"), **options)

    def effort(self, controller: hsp.Controller, t: float) -> Array:
        output = controller.compute(self.robot.state(t, self.q, self.v))
        self.binds = self.binds or output.status >= Status.LIMITED
        return output.tau

    def largest_jump(
        self, controller: hsp.Controller, times: Array
    ) -> tuple[float, float]:
        """Return the largest change of an effort within 1e-9 s [N·m], and its time [s].

        Changes that a rate explains are excluded: the largest in the 1e-9 s before and
        after. The slope of a growing force near the efforts' limits is large, 1e5
        N·m/s.
        """
        tau = {t: self.effort(controller, t) for t in times}

        def change(a: float, b: float) -> float:
            for t in (a, b):
                if t not in tau:
                    tau[t] = self.effort(controller, t)
            return float(np.abs(tau[b] - tau[a]).max())

        worst = 0.0, times[0]
        for a, b in pairwise(times):
            # Within 1e-5 s, a change below the size of a jump cannot hide one.
            while b - a > FINEST and (b - a > 1e-5 or change(a, b) >= JUMP):
                middle = 0.5 * (a + b)
                first = change(a, middle) >= change(middle, b)
                a, b = (a, middle) if first else (middle, b)
            smooth = max(change(a - FINEST, a), change(b, b + FINEST))
            worst = max(worst, (change(a, b) - 1.1 * smooth, a))
        return worst

    def assert_continuous(self, controller: hsp.Controller, end: float = 0.6) -> None:
        """Efforts are continuous from 0.1 s to the end."""
        # A short interval around begin and end, with little other change.
        near = [t + d for t in EVENTS for d in (-1e-5, 0.0, 1e-5)]
        times = np.unique(np.r_[np.linspace(0.1, end, 26), near])
        jump, t = self.largest_jump(controller, times)
        assume(self.binds)
        assert jump < JUMP, f"{jump} N·m at {t} s"
