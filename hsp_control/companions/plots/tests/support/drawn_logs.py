"""Logs of planar and spatial arms for drawing, and artists of drawn axes."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import hsp_control as hsp
import hsp_control.companions.plots as plots
from hsp_control.common.resources import bundled_configs
from hsp_control.geometry import Scene
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.metrics import MassMatrixMetric
from hsp_control.trajectories import Circle as Round
from hsp_control.trajectories import ComposedPose, HoldOrientation, Lissajous, Spin

GAINS = hsp.Gains(100.0, 20.0)
PAPER = {"uncontrolled": 1, "rest": 2, "equal": 3, "obstacle": 4}
DURATION = {3: 10.0}  # [s]; the others run for 1 s


@cache
def planar(number: int) -> hsp.Rollout:
    (name,) = (name for name in bundled_configs() if f"paper/{number}_" in name)
    return hsp.load_experiment(
        name, f"simulation.duration={DURATION.get(number, 1.0)}"
    ).run()


@dataclass
class Arm:
    """A Panda at home, and tasks for it."""

    robot: hsp.Robot = field(default_factory=lambda: hsp.Robot.load("panda"))
    tcp: str = "panda_tcp"

    def __post_init__(self) -> None:
        self.q0 = self.robot.home()
        frame = self.robot.state(0.0, self.q0, np.zeros(7)).frame(self.tcp)
        self.position, self.rotation = frame.position.copy(), frame.rotation.copy()

    def circle(self, normal: list[float]) -> Round:
        return Round(0.1, 2.0, self.position, normal=normal)

    def run(
        self, *tasks: hsp.Task, scene: Scene | None = None, **settings: Any
    ) -> hsp.Rollout:
        posture = hsp.TargetPosture(self.q0 + 0.1)
        controller = hsp.Controller(
            self.robot, tasks, posture, **({"limits": None} | settings)
        )
        return hsp.simulate(controller, self.q0, duration=0.5, scene=scene)


@cache
def spatial() -> dict[str, hsp.Rollout]:
    arm = Arm()
    tcp = arm.tcp
    tilted = hsp.FramePosition(tcp, arm.circle([1.0, 0.0, 1.0]), gains=GAINS)
    center = Lissajous([0.0, 0.1, 0.1], [0, 2, 3], [0, 0, 0], [0.3, -0.3, 0.5])
    spin = Spin([0.0, 0.0, 1.0], 0.3, rotation=arm.rotation)
    pose = hsp.FramePose(
        tcp, ComposedPose(arm.circle([1.0, 0.0, 0.0]), spin), gains=GAINS
    )
    aside = Spin([0, 0, 1], 1.0, rotation=arm.rotation @ pin.utils.rotate("x", 0.4))
    xz = hsp.FramePosition(
        tcp, hsp.Hold(arm.position[[0, 2]]), gains=GAINS, axes="xz", name="xz"
    )
    pointing = hsp.Pointing(tcp, axis=[0, 0, 1], trajectory=aside, gains=GAINS)
    joints = ["panda_joint1", "panda_joint2"]
    posture = hsp.JointPosture(arm.q0 + 0.1, gains=GAINS, joints=joints)
    turned = hsp.FrameOrientation(
        "panda_link5", HoldOrientation(np.eye(3)), gains=GAINS, name="turn"
    )
    return {
        "space": arm.run(
            tilted,
            scene=Scene([hsp.Obstacle("ball", Sphere(0.07), center)]),
            null_space_gain=np.linspace(5.0, 15.0, 7),
        ),
        "pose": arm.run(pose, metric=MassMatrixMetric()),
        "several": arm.run(xz, pointing),
        "posture": arm.run(posture, turned),
    }


def changed(
    log: hsp.Rollout, rows: slice = slice(None), columns: Any = None, **meta: Any
) -> hsp.Rollout:
    """Return a copy of some rows of a log, with some columns and meta replaced."""
    kept = {name: column[rows].copy() for name, column in log.columns.items()}
    return hsp.Rollout(kept | (columns or {}), log.meta | meta)


def drawn(draw: Callable[..., None], *arguments: Any, **options: Any) -> Axes:
    """Return the axes with content."""
    with plots.styled():
        axes = plots.new_figure(4.0, 3.0).add_subplot()
        draw(axes, *arguments, **options)
    return axes


def lines(axes: Axes) -> list[tuple[np.ndarray, np.ndarray]]:
    return [(line.get_xdata(), line.get_ydata()) for line in axes.lines]


def legend_texts(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


def both(log: hsp.Rollout) -> list[Figure]:
    return [plots.paper_figure(log), plots.diagnostics_figure(log)]


def visible(figure: Figure) -> list[Axes]:
    return [axes for axes in figure.findobj(Axes) if axes.get_visible()]
