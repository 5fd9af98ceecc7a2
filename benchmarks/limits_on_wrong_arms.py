"""How far does an arm that is not quite its model leave its limits? Random cases.

    .venv/bin/python benchmarks/limits_on_wrong_arms.py [--seeds N] [ROBOT ...]

Masses ±20 %, centres ±10 mm, friction, a load of 1 kg that nobody declared, efforts
2 ms late and then with a lag of 3 ms, a velocity with noise of 0.01 rad/s, at 1 kHz.
Each case drives joints against their ranges: a pose, a posture, or a field that pushes.
Without compensation, and with a momentum observer. Prints how far the true position
leaves its range, the speed its limit, and what share of it the status told.
"""

import argparse
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from edge_cases import Arm

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError
from hsp_control.control.actuation import Status
from hsp_control.control.compensation import Compensation, MomentumObserver
from hsp_control.simulation import plants
from hsp_control.simulation.plants.drives import Drive, Driving
from hsp_control.simulation.plants.model_changes import MotorInertia, changed
from hsp_control.trajectories import ComposedPose, HoldOrientation

ROBOTS = ("panda", "iiwa14", "xarm7", "ur5")
PERIOD, DURATION, BEGIN = 1e-3, 3.0, 0.2  # [s]
NEAR, FAR = (0.05, 1.0), 2.0  # of a start, from the end of a joint's range [rad]
BEYOND = 0.3  # of a target, behind it [rad]
DELAY, LAG, NOISE, LOAD = 2, 0.003, 0.01, 1.0  # [periods, s, rad/s, kg]
COULOMB, VISCOUS = 0.005, 0.002  # of a joint's largest effort, at 1 rad/s
KINDS = ("pose", "posture", "field")
EASY = ("held", "circle")  # away from the ends
OBSERVER = Compensation(momentum_observer=MomentumObserver(30.0))


class Lag(Drive, type="lag_of_first_order"):
    """Efforts follow with a lag of first order."""

    time: float
    """Its time constant [s]."""

    def begin(self, robot: hsp.Robot, random: np.random.Generator) -> Driving:
        """Return the filter, which begins with the first effort."""
        share, now = 1.0 - np.exp(-PERIOD / self.time), None

        def drive(tau: Array) -> tuple[Array, float]:
            nonlocal now
            now = tau.copy() if now is None else now + share * (tau - now)
            return now, 0.0

        return drive


def plant(arm: Arm, seed: int) -> plants.RigidBody:
    """Return an arm that differs from its model."""
    most = np.asarray(arm.robot.model.effortLimit)
    center = tuple(np.random.default_rng([seed, 1]).uniform(-0.05, 0.05, 3))
    return plants.RigidBody(
        inertias=plants.Inertias(random_mass=0.2, random_com=0.01),
        payload=plants.Payload(arm.frame, LOAD, center=center, radius=0.03),
        friction=plants.Friction(COULOMB * most, VISCOUS * most),
        sensors=[plants.VelocityNoise(NOISE)],
        drives=[plants.EffortDelay(DELAY), Lag(LAG)],
        seed=seed,
    )


def start_of(arm: Arm, rng: np.random.Generator) -> Array:
    """Return displacements from neutral to start from: some joints near their ends."""
    x, nv = arm.start(rng), arm.robot.nv
    away = rng.uniform(*NEAR, nv)
    end = np.where(rng.random(nv) < 0.5, arm.lower + away, arm.upper - away)
    near = np.where(rng.random(nv) < 0.4, end, x)
    return np.clip(near, arm.lower + 0.02, arm.upper - 0.02)


def beyond(arm: Arm, start: Array, rng: np.random.Generator) -> Array:
    """Return a posture whose joints are partly behind the nearer end of their range."""
    low, high = np.maximum(arm.lower, start - 1.0), np.minimum(arm.upper, start + 1.0)
    posture = rng.uniform(low, high)
    end = np.where(
        start < 0.5 * (arm.lower + arm.upper), arm.lower - BEYOND, arm.upper + BEYOND
    )
    out = (np.abs(end - start) < FAR) & (rng.random(arm.robot.nv) < 0.7)
    return np.where(out, end, posture)


def controller(arm: Arm, kind: str, q0: Array, rng: np.random.Generator) -> Any:
    """Return a controller that drives joints against their ranges."""
    start = arm.robot.joint_positions(q0)
    goal = beyond(arm, start, rng)
    if kind in EASY:
        x: Any = hsp.Circle(0.08, 2.0) if kind == "circle" else hsp.Hold()
        task: Any = hsp.FramePose(arm.frame, ComposedPose(x), blend=1.0)
        return hsp.Controller(arm.robot, [task], hsp.JointCentering(), start=q0)
    if kind == "posture":
        task = hsp.JointPosture(goal)
        return hsp.Controller(arm.robot, [task], start=q0)
    if kind == "field":
        pose, _ = arm.at(start)  # the same, held
        held = ComposedPose(hsp.Hold(pose.translation), HoldOrientation(pose.rotation))
        push = hsp.fields.FunctionField(lambda state: goal * 3.0)
        task = hsp.FramePose(arm.frame, held)
        return hsp.Controller(arm.robot, [task], push, start=q0)
    pose, _ = arm.at(goal)
    there = ComposedPose(hsp.Hold(pose.translation), HoldOrientation(pose.rotation))
    task = hsp.FramePose(arm.frame, there, blend=0.3)
    return hsp.Controller(arm.robot, [task], hsp.JointCentering(), start=q0)


def measure(
    arm: Arm, seed: int, compensation: Any, kinds: Sequence[str]
) -> dict[str, Any]:
    """Return the numbers of one run."""
    rng = np.random.default_rng([seed, 0])
    kind = kinds[seed % len(kinds)]
    near = kind not in EASY
    q0 = arm.configuration(start_of(arm, rng) if near else arm.start(rng))
    made = controller(arm, kind, q0, rng)
    found: dict[str, Any] = {"kind": kind}
    try:
        run = hsp.simulate(
            made, q0, duration=DURATION, control_period=PERIOD, log_period=PERIOD,
            plant=plant(arm, seed), compensation=compensation, check_rate=False,
        )  # fmt: skip
    except HspControlError as error:
        return {**found, "error": str(error)[:200]}
    out = run["position_excess"].max(axis=1)
    fast = (run["velocity_excess"] / made.limits.velocity).max(axis=1)
    told = run["status"] > Status.RELAXED
    late = run.t > DURATION - 0.3
    return {
        **found, "out": out.max(), "fast": fast.max(),
        "joint": int(run["position_excess"].max(axis=0).argmax()),
        "at": run.t[out.argmax()], "late": out[late].max(),
        "told": int(told.sum()), "needed": int((out > 1.1e-3).sum()),
        "missed": int(((out > 1.1e-3) & ~told).sum()),
        "false": int((told & (out < 1e-4) & (fast < 1e-4)).sum()),
        "relaxed": int((run["status"] == Status.RELAXED).sum()),
        "moving": float(np.abs(run.v[late]).max()),
    }  # fmt: skip


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("robots", nargs="*", default=ROBOTS)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", choices=("without", "observer"))
    parser.add_argument("--rotors", type=float, default=0.0)
    parser.add_argument("--kinds", nargs="*", default=KINDS)
    parser.add_argument("--verbose", action="store_true")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    for name in asked.robots:
        arm = Arm(name)
        if asked.rotors:  # of the model and the arm
            arm.robot = changed(arm.robot, [MotorInertia(asked.rotors)])
        for words, own in (("without", None), ("observer", OBSERVER)):
            if asked.only not in (None, words):
                continue
            rows = []
            for seed in range(asked.first, asked.first + asked.seeds):
                rows.append({"seed": seed, **measure(arm, seed, own, asked.kinds)})
                if asked.verbose:
                    each = {k: round(float(x), 4) if isinstance(x, float) else x
                            for k, x in rows[-1].items()}  # fmt: skip
                    print(" ", each, flush=True)
            good = [row for row in rows if "error" not in row]
            for row in rows:
                if "error" in row:
                    print("  failed", row)
            out = 1e3 * np.array([row["out"] for row in good])
            fast = np.array([row["fast"] for row in good])
            print(
                f"{name} {words}: beyond a range median {np.median(out):.2f} worst "
                f"{out.max():.1f} mrad, {(out > 5.0).sum()} of {len(out)} by more than "
                f"5; at the end {1e3 * max(row['late'] for row in good):.1f}; "
                f"above a speed by {100 * fast.max():.1f} %; rows told "
                f"{sum(row['told'] for row in good)}, missed "
                f"{sum(row['missed'] for row in good)}, "
                f"false {sum(row['false'] for row in good)}",
                flush=True,
            )


if __name__ == "__main__":
    main()
