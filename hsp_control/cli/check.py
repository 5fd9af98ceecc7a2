"""``hsp check``: the parts of a configuration, and its numbers at the start."""

import argparse
import json
import sys
from collections.abc import Iterator
from math import isfinite
from typing import Any

import numpy as np
from rich.table import Table

from hsp_control.cli.consoles import out
from hsp_control.cli.loading import load
from hsp_control.common.errors import ConfigurationError
from hsp_control.common.suggestions import listing
from hsp_control.config import Experiment
from hsp_control.control import Controller, ControlOutput, Diagnostics
from hsp_control.control.first_state import warn_of_jump, warn_of_slow_efforts
from hsp_control.edge.shares import FAR, NEAR
from hsp_control.robot import Robot
from hsp_control.robot.description.inertias import impossible_inertias
from hsp_control.robot.description.urdf import read_urdf
from hsp_control.simulation import Rollout
from hsp_control.simulation.demand_check import missed_forces, not_followed, too_weak
from hsp_control.simulation.heavy_plant import heavy_plant
from hsp_control.simulation.initial_state import posture_search
from hsp_control.simulation.model_errors import describe, lines
from hsp_control.tasks import SecondOrderTask

ROUNDING = 1e-9
"""Share of the largest singular value below which one is zero up to rounding."""


def check(options: argparse.Namespace) -> int:
    """Build all objects, evaluate the law once, and print a summary."""
    experiment = load(options)
    output = experiment.controller.compute(0.0, experiment.q0, experiment.v0)
    diagnostics = experiment.controller.diagnose()
    found = _checked(experiment, output, diagnostics)
    least = diagnostics.singular_values.min(initial=np.inf)
    singular = least < experiment.controller.singularity_threshold
    advice = [
        *robot_advice(experiment.robot),
        *start_advice(experiment, damped=output.damped if singular else ""),
    ]
    warn_of_rates(experiment)
    warn_of_reach(experiment)
    controller = experiment.controller
    warn_of_slow_efforts(experiment.robot, experiment.q0, controller.limits)
    if experiment.compensation.start_up_ramp is None:
        warn_of_jump(
            experiment.robot,
            experiment.q0,
            experiment.v0,
            output.tau,
            experiment.controller.state.dynamics,
        )
    if options.json:
        print(json.dumps(found | {"advice": advice}, indent=2, ensure_ascii=False))
        return 0
    table = _check_table(found)
    if (borne := experiment.model_errors) is not None:
        for about, words in lines(borne).items():
            table.add_row(about, words)
    out.print(table)
    for line in advice:
        out.print(line, markup=False)
    out.print(f"{options.config}: OK")
    return 0


def _checked(
    experiment: Experiment, output: ControlOutput, diagnostics: Diagnostics
) -> dict[str, Any]:
    """Return the parts of a configuration, and its numbers at the start."""
    robot, controller = experiment.robot, experiment.controller
    values, efforts = diagnostics.singular_values, np.abs(output.tau)
    borne = experiment.model_errors
    rank = int(np.sum(values > ROUNDING * values.max(initial=0.0)))
    held = controller.active_stack.first_task_row  # rows of contacts, or without motors
    tasks = {}
    for task in controller.tasks:
        rows = controller.task_rows.get(task.name)  # not before its schedule begins
        error = None if rows is None else np.linalg.norm(output.task.error[rows])
        tasks[task.name] = {
            "type": type(task).__name__,
            "rows": task.rows,
            "error": None if error is None else float(error),
            "unit": ", ".join(dict.fromkeys(part.unit for part in task.error_parts)),
        }
    return {
        "robot": {"name": robot.name, "nq": robot.nq, "nv": robot.nv},
        "tasks": tasks,
        "null_space": {
            "degrees_of_freedom": robot.nv - held - rank,
            "field": controller.field.name,
        },
        "plant": experiment.plant.describe()["type"],
        "compensation": list(experiment.compensation.names),
        "momentum_observer": experiment.on_observer,
        "wrong_model": None if borne is None else describe(borne),
        "limits": "none" if controller.limits is None else output.status.name.lower(),
        "exact": _exact(controller),
        "effort_rate": _rates(controller),
        "singular_values": list(map(float, values)),
        "largest_effort": float(efforts.max()),
        "effort_unit": "N" if robot.units[efforts.argmax()] == "m" else "N·m",
    }


def _exact(controller: Controller) -> dict[str, Any] | None:
    """Return where the law is exact, see `edge/shares.py`; None if the base floats."""
    robot, stack = controller.robot, controller.active_stack
    rows = stack.rows.jacobian[stack.first_task_row :]
    if robot.unactuated or not robot.size or not len(rows):
        return None
    errors = {
        f"{task.name} {part.name}": [FAR * longest, part.unit]
        for task in controller.tasks
        if isinstance(task, SecondOrderTask) and isinstance(task.largest_error, tuple)
        for part, longest in zip(task.error_parts, task.largest_error, strict=True)
        if longest is not None
    }
    return {
        "errors": errors,
        "singular_value": max(
            NEAR * robot.size, 2.0 * controller.singularity_threshold
        ),
        "singular_value_at_start": float(np.linalg.svd(rows, compute_uv=False)[-1]),
    }


def _rates(controller: Controller) -> list[float | None]:
    """Return the bound on every effort's rate [N·m/s or N/s]; None without one."""
    if controller.limits is None:
        return [None] * controller.robot.nv
    rates = controller.limits.effort_rate.tolist()
    return [rate if rate < np.inf else None for rate in rates]


def _check_table(found: dict[str, Any]) -> Table:
    table = Table(show_header=False, box=None, pad_edge=False)
    robot, null_space = found["robot"], found["null_space"]
    table.add_row("robot", f"{robot['name']}: nq = {robot['nq']}, nv = {robot['nv']}")
    for name, task in found["tasks"].items():
        error = "not yet active"
        if task["error"] is not None:
            unit = f"({task['unit']})" if "," in task["unit"] else task["unit"]
            error = f"|e| = {task['error']:.3g} {unit}"
        table.add_row(
            f"task {name}", f"{task['type']}, {task['rows']} rows, {error} at the start"
        )
    dofs = f"{null_space['degrees_of_freedom']} degrees of freedom"
    table.add_row("null space", f"{dofs}, {null_space['field']}")
    table.add_row("plant", found["plant"])
    table.add_row("compensation", ", ".join(found["compensation"]) or "none")
    table.add_row("momentum observer", found["momentum_observer"])
    table.add_row("limits", _LIMITS[found["limits"]])
    if (exact := found["exact"]) is not None:
        table.add_row("exact", _where_exact(exact))
    rates = [rate for rate in found["effort_rate"] if rate is not None]
    if rates:
        low, high = (f"{1e-3 * each:.2g}" for each in (min(rates), max(rates)))
        most = high if low == high else f"{low} to {high}"
        table.add_row("change of an effort", f"at most {most} N·m or N in 1 ms")
    if found["singular_values"]:
        values = ", ".join(f"{value:.3g}" for value in found["singular_values"])
        table.add_row("singular values", f"{values} at the start")
    largest = f"{found['largest_effort']:.3g} {found['effort_unit']}"
    table.add_row("largest effort", f"{largest} at the start")
    return table


def _where_exact(exact: dict[str, Any]) -> str:
    """Return in words the range in which the law is exact."""
    errors = ", ".join(
        f"{name} below {np.rad2deg(most):.0f}°" if unit == "rad" else
        f"{name} below {most:.2g} {unit}"
        for name, (most, unit) in exact["errors"].items()
    )  # fmt: skip
    return (
        f"{errors or 'for every error'}; at any speed; while no limit binds, and the "
        f"smallest singular value of J is above {exact['singular_value']:.2g} "
        f"({exact['singular_value_at_start']:.2g} at the start)"
    )


_LIMITS = {
    "none": "none",
    "exact": "none binds at the start",
    "redistributed": "shift contact forces at the start",
    "limited": "bind at the start: the law is not exact there",
    "relaxed": "contradict each other at the start",
    "beyond": "are violated at the start: a joint is beyond its range or its speed",
}
"""The state of the limits in words, by the step's status."""


def warn_of_reach(experiment: Experiment) -> None:
    """Print the loads that the plant's motors cannot move, and infeasible targets."""
    robot, law = experiment.robot, experiment.controller
    for message in heavy_plant(experiment.scenario.plant, robot, experiment.q0):
        print(f"hsp: {message}", file=sys.stderr)
    if robot.unactuated and experiment.scenario.plan is not None:
        return  # a plan moves contacts and references
    settings = experiment.scenario.simulation
    # also for a run that starts before t = 0
    end = max(settings.end_time, settings.duration)
    asked = experiment.q0, end, law.contacts, law.limits
    messages = [each.message for each in not_followed(robot, law.tasks, *asked)]
    push_off = experiment.scenario.plant.push_off
    messages += missed_forces(law, experiment.q0, end, push_off)
    for message in messages:
        print(f"hsp: {message}", file=sys.stderr)


def warn_of_rates(experiment: Experiment) -> None:
    """Print the gains that are high for the control period."""
    for finding in experiment.rate_findings:
        place = ".".join(finding.path)
        print(f"hsp: {place}: {finding.message}", file=sys.stderr)


def robot_advice(robot: Robot) -> Iterator[str]:
    """Yield lines about links with physically inconsistent inertias."""
    description = robot.description
    if description is None or description.project_inertias:
        return
    for part in robot.parts:
        placed = (description.parts or {}).get(part.prefix.removesuffix("_"))
        if placed is not None and placed.project_inertias:
            continue
        if part.source.shapes is not None:  # no URDF: MuJoCo has checked its inertias
            continue
        links = [found.link for found in impossible_inertias(read_urdf(part.source))]
        if links:
            yield (
                f"{part.prefix}{part.source.name}: no body can have the inertias of "
                f"{listing(links, limit=6)}; project_inertias: true takes the nearest "
                "possible ones (see hsp inspect)."
            )


def advice_of_run(experiment: Experiment, rollout: Rollout) -> Iterator[str]:
    """Yield the advice of `hsp check` if a run began at a singularity."""
    controller = experiment.controller
    least = rollout["singular_values"][0].min(initial=np.inf)
    if not least < controller.singularity_threshold:
        return
    first = controller.preview().compute(0.0, experiment.q0, experiment.v0)
    if first.damped:
        yield from start_advice(experiment, first.damped)


def start_advice(experiment: Experiment, damped: str = "") -> Iterator[str]:
    """Yield lines about a start that is singular, in collision or cannot be held."""
    # If it is singular or in collision, a better one follows.
    robot, null_space = experiment.robot, experiment.scenario.null_space
    if damped:
        yield (
            f"The tasks {damped} are singular at the start: the law is damped there, "
            "not exact."
        )
    if robot.unactuated:
        return
    limits = experiment.controller.limits
    if limits is not None:
        for joint, why in too_weak(robot, experiment.q0, limits.effort):
            yield f"At the start {joint} cannot hold the robot: {why}."
    tasks = experiment.scenario.tasks.values()
    search = posture_search(robot, tasks, experiment.scene)
    start = search.judge(experiment.q0)
    depth, pair = search.overlap(experiment.q0)
    if depth > 0.0:
        yield f"The start is in collision: {pair} overlap by {depth:.3g} m."
    elif not (damped and isfinite(start.regularity)):  # it searches for poses only
        return
    try:
        found = search.rounded(search.find(null_space.singularity_threshold))
    except ConfigurationError as error:
        yield f"No better start was found: {error}."
        return
    singular = (
        " (smallest singular value of the tasks "
        f"{found.regularity:.3g} instead of {start.regularity:.3g})"
    )
    yield f"A better start{singular if isfinite(start.regularity) else ''}:"
    yield f"    start: {search.start_line(found)}"
    yield "or start: auto, which finds it."
