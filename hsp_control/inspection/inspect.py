"""Look at a robot's description with all checks."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from hsp_control.common.exceptions import ModelError
from hsp_control.inspection.checks import (
    Finding,
    check_elements,
    check_home,
    check_inertias,
    check_limits,
    check_mass_matrix,
    check_meshes,
    check_self_collisions,
    check_strength,
    worst_condition,
)
from hsp_control.robot import Robot, RobotDescription
from hsp_control.robot.description.loading import load_model
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.description.urdf_checks import parse_urdf


@dataclass(frozen=True)
class Inspection:
    """What was found about a robot."""

    source: RobotSource  # where the robot comes from
    findings: tuple[Finding, ...]  # what is odd, errors first
    facts: Mapping[str, str]  # what can be said about it in general: names and texts

    @property
    def loads(self) -> bool:
        """Whether the robot loads as it was described."""
        return all(finding.severity != "error" for finding in self.findings)

    def groups(self) -> dict[tuple[str, str, str], list[Finding]]:
        """Return the findings by severity, check and cure."""
        groups: dict[tuple[str, str, str], list[Finding]] = {}
        for finding in self.findings:
            key = finding.severity, finding.check, finding.cure
            groups.setdefault(key, []).append(finding)
        return groups

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "facts": dict(self.facts),
            "findings": [finding.to_dict() for finding in self.findings],
        }


def inspect(source: RobotSource, description: RobotDescription) -> Inspection:
    """Return what is odd about a robot.

    Checks of the file come first. If it has no errors, or only inertias that projection
    repairs, the robot is loaded and looked at.

    Args:
        source: Where it comes from, see `RobotDescription.find`.
        description: How it is loaded.

    Raises:
        RobotNotFoundError: If its file cannot be read.
        ModelError: If its file is not XML, not a URDF, or too large.
    """
    xml = parse_urdf(source)
    findings = list(check_elements(xml))
    if not findings:
        findings = list(_of_file(xml, source))
    facts = {"file": str(source.urdf)}
    errors = [f for f in findings if f.severity == "error"]
    if all(error.check == "inertia" for error in errors):
        if errors:
            description = replace(description, project_inertias=True)
        try:
            model = load_model(source, description, description.gravity)
            robot = Robot(model, source, description=description)
            worst = worst_condition(robot)
            facts |= _facts(robot, *worst)
            findings += [*check_mass_matrix(*worst), *_of_robot(robot)]
        except ModelError as error:
            findings.append(
                Finding("error", "robot", source.name, _reason(error, source))
            )
    order = ("error", "warning", "note")
    findings.sort(key=lambda finding: order.index(finding.severity))
    return Inspection(source, tuple(findings), facts)


def _facts(robot: Robot, condition: float, dof: str) -> dict[str, str]:
    root = "floating base" if robot.unactuated else "fixed base"
    home = ", ".join(f"{x:.3g}" for x in robot.joint_positions(robot.home()) + 0.0)
    return {
        "robot": f"{robot.name}: nq = {robot.nq}, nv = {robot.nv}, {root}",
        "end effector": f"{robot.end_effector} (by default)",
        "size": f"{robot.size:.3g} m, the longest chain from the first joint",
        "effort rate": _rates(robot),
        "springs": _springs(robot),
        "mass": f"{pin.computeTotalMass(robot.model):.4g} kg move",
        "mass matrix": f"condition number up to {condition:.2g}, by {dof}",
        "home": f"[{home}]",
    }


def _rates(robot: Robot) -> str:
    rates = robot.effort_rate[np.isfinite(robot.effort_rate)]
    if not rates.size:
        return "no effort limits, so none"
    low, high = (f"{1e-3 * each:.2g}" for each in (rates.min(), rates.max()))
    most = high if low == high else f"{low} to {high}"
    return f"no effort changes by more than {most} N·m or N in 1 ms"


def _springs(robot: Robot) -> str:
    force, moment = robot.spring_force
    if not np.isfinite(force):
        return "no effort limits, so they pull with any force"
    turned = f" and {moment:.3g} N·m" if np.isfinite(moment) else ""
    return f"a hand's pull with at most {force:.3g} N{turned} by default"


def _of_file(xml: Element, source: RobotSource) -> Iterator[Finding]:
    yield from check_inertias(xml)
    yield from check_limits(xml)
    yield from check_meshes(xml, source)


def _of_robot(robot: Robot) -> Iterator[Finding]:
    try:
        yield from check_self_collisions(robot)
    except ModelError as error:
        reason = _reason(error, robot.source).partition(";")[0]
        message = f"not checked: {reason}"
        yield Finding("warning", "self-collision", "all links", message)
    yield from check_home(robot)
    yield from check_strength(robot)


def _reason(error: ModelError, source: RobotSource) -> str:
    return str(error).removeprefix(f"{source.urdf}: ")
