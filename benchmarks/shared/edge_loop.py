"""A case of `edge.py` in closed loop, and its measurements.

    python -m shared.edge_loop CASES LAW RESULTS    # `edge.py` calls it

Rigid bodies, efforts held for 1 ms and clipped at the limits of the URDF. It needs
NumPy and Pinocchio, and its law's requirements: laws may have different Pythons.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import import_module, metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

PERIOD = 1e-3  # an effort is held [s]
BEGIN = 0.1  # the target rests at the start until then [s]
MESSAGES, STREAMED = 30.0, 1.0  # of a stream: rate [1/s] and length [s]
REST, WATCHED = (
    3.0,
    1.0,
)  # after the target rests: until it is measured, and how long [s]
REST_OF_STREAM = 7.0  # this law's streams move at 0.5 m/s and arrive later [s]
STILL = 1e-3  # change of an effort in 1 ms at rest, as a part of its limit
SETTLED = 5e-3  # [m]
DIVERGED = 100.0  # [rad/s]

LAWS = {
    "jacobian_transpose": ("jacobian_transpose", {}),
    "isaac_lab": ("isaac_lab_osc", {}),
    "robosuite": ("robosuite_osc", {}),
    "pink": ("pink_rnea", {}),
    "tsid": ("tsid_bounded", {}),
    "unbounded": ("this_law_at_the_edge", {"bounded": False}),
    "old": ("this_law_at_the_edge", {}),
    "ours": ("this_law_at_the_edge", {}),
}
"""Module of `controllers` and arguments of its ``make``, by law."""

PACKAGES = {"pink": "pin-pink", "tsid": "tsid"}
"""The package whose version is reported, by law."""

Compute = Callable[[float, Any, Any], Any]


class Sample(NamedTuple):
    """Where the hand should be: x, x' and x'', shapes (3,)."""

    position: Any
    velocity: Any
    acceleration: Any


@dataclass
class Case:
    """A target that the hand may be unable to reach.

    Attributes:
        robot: Name of the robot.
        kind: position, pose, stream, step or circle.
        urdf: Its description.
        joints: Names of the joints that are not rigid.
        frame: Name of the hand's frame.
        rows: 3 for a position, 6 for a pose.
        q0: Configuration at the start, shape (nq,) [rad].
        start: Where the hand starts, shape (3,) [m].
        rotation: How the hand starts, and how it should be held, shape (3, 3).
        goal: Where it should be in the end, shape (3,) [m].
        nearest: The nearest point that it can reach, shape (3,) [m].
        plane: Two unit vectors of the circle's plane, shape (2, 3).
        radius: Of the circle [m].
        rate: Of the circle [rad/s].
    """

    robot: str
    kind: str
    urdf: str
    joints: list[str]
    frame: str
    rows: int
    q0: Any
    start: Any
    rotation: Any
    goal: Any
    nearest: Any
    plane: Any = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    radius: float = 0.0
    rate: float = 0.0

    def __post_init__(self) -> None:
        """Make arrays of JSON's lists."""
        for name in ("q0", "start", "rotation", "goal", "nearest", "plane"):
            setattr(self, name, np.asarray(getattr(self, name), dtype=float))

    @property
    def measured_from(self) -> float:
        """When it is measured: at rest, or after a turn of the circle [s]."""
        if self.kind == "circle":
            return BEGIN + 2.0 * np.pi / self.rate
        if self.kind == "stream":
            return BEGIN + STREAMED + REST_OF_STREAM
        return BEGIN + REST

    @property
    def duration(self) -> float:
        """Length of the run [s]."""
        if self.kind == "circle":
            return 2.0 * self.measured_from - BEGIN
        return self.measured_from + WATCHED

    def desired(self, t: float) -> Sample:
        """Return where the hand should be; of a stream, its newest message."""
        if t < BEGIN:
            return Sample(self.start, np.zeros(3), np.zeros(3))
        if self.kind == "circle":
            x, y = self.radius * self.plane
            c, s = np.cos(self.rate * (t - BEGIN)), np.sin(self.rate * (t - BEGIN))
            return Sample(
                self.start + (c - 1.0) * x + s * y,
                self.rate * (c * y - s * x),
                -(self.rate**2) * (c * x + s * y),
            )
        share = 1.0
        if self.kind == "stream":
            newest = np.floor((t - BEGIN) * MESSAGES + 1e-6) / MESSAGES
            share = min(1.0, newest / STREAMED)
        x = self.start + share * (self.goal - self.start)
        return Sample(x, np.zeros(3), np.zeros(3))

    def model(self) -> Any:
        """Return the model: the URDF, with all other joints rigid."""
        full = pin.buildModelFromUrdf(self.urdf)
        rigid = [
            full.getJointId(name)
            for name in full.names
            if name not in self.joints and name != "universe"
        ]
        return pin.buildReducedModel(full, rigid, pin.neutral(full))

    def as_json(self) -> dict[str, Any]:
        """Return data for JSON, for ``Case(**...)``."""
        return {
            name: each.tolist() if isinstance(each, np.ndarray) else each
            for name, each in asdict(self).items()
        }


def close_loop(case: Case, model: Any, law: Compute) -> tuple[Any, Any, Any, str]:
    """Return q, v and tau of all steps, and why the run ended early, or "".

    Runge and Kutta's fourth-order method, one step in a period.
    """
    data, h, limit = model.createData(), PERIOD, model.effortLimit
    q, v, rows = case.q0.copy(), np.zeros(model.nv), []

    def acceleration(q: Any, v: Any) -> Any:
        return pin.aba(model, data, q, v, tau).copy()

    end = ""
    for k in range(round(case.duration / h)):
        try:
            tau = np.clip(law(k * h, q, v), -limit, limit)
        except Exception as fault:  # of any law
            end = f"{type(fault).__name__}: {str(fault)[:80]}"
            break
        rows.append((q, v, tau))
        a1 = acceleration(q, v)
        a2 = acceleration(q + 0.5 * h * v, v + 0.5 * h * a1)
        a3 = acceleration(q + 0.5 * h * v + 0.25 * h * h * a1, v + 0.5 * h * a2)
        a4 = acceleration(q + h * v + 0.5 * h * h * a2, v + h * a3)
        q = q + h * v + h * h / 6.0 * (a1 + a2 + a3)
        v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        if not np.abs(v).max() < DIVERGED:
            end = "diverged"
            break
    return *(np.array(column) for column in zip(*rows, strict=True)), end


def measure(case: Case, model: Any, run: tuple[Any, Any, Any, str]) -> dict[str, Any]:
    """Return the numbers of a run.

    Returns:
        rests: Whether it is at rest three seconds after its target is, after a stream
            seven.
        change: Largest change of an effort in 1 ms, as a part of its limit.
        speed: Largest speed, as a part of its limit.
        beyond: Largest position beyond a limit [rad].
        away: Distance of the hand from the nearest point, at the end [m].
        settling: When it is at the goal to 5 mm for good, after the jump [s]; None:
            never.
        tracking: rms distance from the circle, after a turn [m]; None: it ended early.
        end: Why it ended early.
    """
    q, v, tau, end = run
    data, frame = model.createData(), model.getFrameId(case.frame)
    change = np.abs(np.diff(tau, axis=0)) / model.effortLimit
    late = change[round(case.measured_from / PERIOD) :]
    hand = []
    for each in q[::10]:
        pin.framesForwardKinematics(model, data, each)
        hand.append(data.oMf[frame].translation.copy())
    times = 10 * PERIOD * np.arange(len(hand))
    points = np.array([case.desired(t).position for t in times])
    error = np.linalg.norm(points - hand, axis=1)
    away = np.flatnonzero(error > SETTLED)
    settling = 10 * PERIOD * (float(away[-1]) + 1.0) - BEGIN if away.size else 0.0
    settles = not end and not (away.size and away[-1] + 2 > len(hand))
    turned = error[times >= case.measured_from]
    beyond = np.maximum(q - model.upperPositionLimit, model.lowerPositionLimit - q)
    return {
        "robot": case.robot,
        "kind": case.kind,
        "rests": bool(not end and late.size and late.max() <= STILL),
        "change": float(change.max()) if len(change) else 0.0,
        "speed": float((np.abs(v) / model.velocityLimit).max()),
        "beyond": float(beyond.max()),
        "away": float(np.linalg.norm(hand[-1] - case.nearest)),
        "settling": settling if settles else None,
        "tracking": None if end else float(np.sqrt(np.mean(turned**2))),
        "end": end,
    }


def main() -> None:
    """Run a law in all cases, and write the measurements."""
    cases, law, results = sys.argv[1:]
    module, arguments = LAWS[law]
    make = import_module(f"shared.controllers.{module}").make
    runs = []
    for given in json.loads(Path(cases).read_text(encoding="utf-8")):
        case = Case(**given)
        model = case.model()
        compute = make(case, model, **arguments)
        run = measure(case, model, close_loop(case, model, compute))
        run["unsolved"] = getattr(compute, "unsolved", [0])[0]
        runs.append(run)
        print(json.dumps(run), flush=True)
    version = metadata.version(PACKAGES[law]) if law in PACKAGES else ""
    written = json.dumps({"version": version, "runs": runs})
    Path(results).write_text(written, encoding="utf-8")


if __name__ == "__main__":
    main()
