"""A controller with random changes along a given motion."""

import numpy as np

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.changes import Change

SPAN = 3.0
"""The interval in which changes begin [s]."""


class Line:
    """A controller with random changes along a given motion."""

    def __init__(self, name: str, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self.robot = hsp.Robot.load(name)
        away = 0.2 * np.ones(self.robot.nv)
        self.center = self.robot.integrate(self.robot.home(), away)
        self.swing = 0.1 * self.rng.standard_normal(self.robot.nv)
        self.frame = self.robot.end_effector
        self.there = ["hand"]
        self.terms = ["joint_centering"]
        self.made = 0

    def controller(self, changes: tuple[Change, ...] = ()) -> hsp.Controller:
        axes = "xz" if self.robot.nv == 3 else "xyz"
        hand = hsp.FramePosition(self.frame, axes=axes, name="hand")
        field = hsp.TargetPosture("home", name="joint_centering")
        start = self.center
        return hsp.Controller(
            self.robot, [hand], field, start=start, changes=changes, limits=None
        )

    def motion(self, t: float) -> tuple[Array, Array]:
        q = self.robot.integrate(self.center, self.swing * np.sin(3.0 * t))
        return q, 3.0 * self.swing * np.cos(3.0 * t)

    def state(self, t: float) -> hsp.RobotState:
        return self.robot.state(t, *self.motion(t))

    def efforts(self, controller: hsp.Controller, times: Array) -> Array:
        return np.array([controller.compute(self.state(t)).tau for t in times])

    def draw(self, number: int) -> tuple[Change, ...]:
        """Return changes in order of time, all of them valid."""
        times = np.sort(self.rng.uniform(0.0, SPAN, number))
        return tuple(self._change(float(t)) for t in times)

    def _change(self, t: float) -> Change:
        rng, when = self.rng, {"at": t, "ramp": float(self.rng.uniform(0.1, 0.5))}
        kinds = ["gains", "weight", "field", "exchange", "gain", "add"]
        if len(self.there) > 1:
            kinds += ["remove", "remove"]
        match rng.choice(kinds):
            case "gains":
                gains = hsp.Gains(natural_frequency=float(rng.uniform(2.0, 15.0)))
                name = str(rng.choice(self.there))
                return hsp.changes.ChangeGains(name, gains, **when)
            case "weight":
                name = str(rng.choice(self.terms))
                weight = float(rng.uniform(0.0, 3.0))
                return hsp.changes.ChangeWeight(name, weight, **when)
            case "field":
                self.made += 1
                self.terms = [f"first_{self.made}", f"second_{self.made}"]
                posture = 0.3 * rng.standard_normal(self.robot.nv)
                fields = [
                    hsp.TargetPosture(posture, name=self.terms[0]),
                    hsp.TargetPosture("home", name=self.terms[1], weight=0.5),
                ]
                return hsp.changes.ChangeField(fields, **when)
            case "exchange":
                name = str(rng.choice(self.terms))
                nv = self.robot.nv
                sway = hsp.trajectories.Lissajous(
                    0.1 * rng.standard_normal(nv), np.ones(nv), None, np.zeros(nv)
                )
                other = hsp.TargetPosture("home", name=name, displacement=sway)
                return hsp.changes.ExchangeField(name, other, **when)
            case "gain":
                gain = float(rng.uniform(2.0, 20.0))
                return hsp.changes.ChangeNullSpaceGain(gain, **when)
            case "remove":
                name = str(rng.choice(self.there[1:]))
                self.there.remove(name)
                return hsp.changes.RemoveTask(name, **when)
            case _:
                joint = str(rng.choice(list(self.robot.joints)))
                self.made += 1
                # Some names are used again.
                name = f"joint_{self.made % 3}"
                if name in self.there:
                    return self._change(t)
                self.there.append(name)
                task = hsp.JointPosture(
                    "home", joints=[joint], priority=2 + self.made % 2, name=name
                )
                return hsp.changes.AddTask(task, **when)
