"""Apply all checks to a robot's description."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ConfigurationError, ModelError
from hsp_control.common.suggestions import listing
from hsp_control.companions.inspection.finding import Finding as Finding
from hsp_control.companions.inspection.finding import Severity
from hsp_control.companions.inspection.plausibility import (
    check_angles,
    check_density,
    check_gyration,
    check_maxima,
    check_mesh_sizes,
    check_size,
)
from hsp_control.companions.inspection.reading import (
    check_continuous,
    check_followers,
    check_friction,
    check_mesh_axes,
    check_planar_axes,
    check_shapes,
    check_soft_limits,
    check_srdf,
    check_transmissions,
    check_unread,
)
from hsp_control.control.interface import largest_cancelled
from hsp_control.geometry import Proximity, link_shapes, self_pairs
from hsp_control.geometry.good_postures import PostureSearch, Rows
from hsp_control.robot import Robot, RobotDescription
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.inertias import impossible_inertias, tensor_of
from hsp_control.robot.description.loading import load_model
from hsp_control.robot.description.mesh_files import (
    find_file,
    find_problem,
    where_to_put,
)
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.description.urdf import parse_urdf, problems
from hsp_control.simulation.demand_check import too_weak

_CURE = "project_inertias: true takes the nearest possible one, --fix writes it"


def check_inertias(xml: Element) -> Iterator[Finding]:
    """Yield the links with an inconsistent inertia, or with one but no mass."""
    for found in impossible_inertias(xml):
        severity: Severity = "error" if found.negative else "warning"
        yield Finding(severity, "inertia", f"link {found.link!r}", found.reason, _CURE)
    for link in xml.findall("link"):
        mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
        if mass is None or inertia is None or float(mass.get("value", 0.0)) > 0.0:
            continue
        if tensor_of(inertia).any():
            yield Finding(
                "warning",
                "inertia",
                f"link {link.get('name', '')!r}",
                "it has an inertia, but its mass is 0",
                "give it a mass",
            )


_WITHOUT = {
    "collision": "distances leave out these links unless they have another shape",
    "visual": "capsules are drawn instead",
}


def check_meshes(xml: Element, source: RobotSource) -> Iterator[Finding]:
    """Yield the meshes that are missing or cannot be read, by use and remedy."""
    for use, without in _WITHOUT.items():
        unusable: dict[tuple[str, str], dict[str, str]] = {}
        for link in xml.findall("link"):
            for mesh in (m for each in link.findall(use) for m in each.iter("mesh")):
                name = mesh.get("filename", "")
                file = find_file(source, name)
                reason = "no such file" if file is None else find_problem(file)
                if reason:
                    cure = where_to_put(name) if file is None else "repair the file"
                    links = unusable.setdefault((reason, cure), {})
                    links.setdefault(link.get("name", ""), name)
        for (reason, cure), names in unusable.items():
            first = next(iter(names.values()))
            meshes = f"{use} mesh{'es' * (len(names) > 1)} of {listing(names)}"
            message = f"{reason}: {first}{', ...' * (len(names) > 1)}; {without}"
            yield Finding("warning", "mesh", meshes, message, cure)


_LIMITED = {"revolute", "prismatic"}
_MOVING = {*_LIMITED, "continuous"}


def check_limits(xml: Element) -> Iterator[Finding]:
    """Yield the joints whose limits are missing, equal or reversed."""
    for joint in xml.findall("joint"):
        kind, name = joint.get("type", ""), f"joint {joint.get('name', '')!r}"
        limit = joint.find("limit")
        if kind not in _MOVING:
            continue
        if limit is None:
            if kind in _LIMITED:
                cure = "give it a <limit>"
                cure += ", or type continuous" if kind == "revolute" else ""
                yield Finding("error", "limit", name, f"{kind} without <limit>", cure)
            else:
                yield _no_maximum(name, ("effort", "velocity"))
            continue
        if kind in _LIMITED:
            yield from _of_position(name, limit)
        yield from _of_maxima(name, limit, follows=joint.find("mimic") is not None)


def _of_position(name: str, limit: Element) -> Iterator[Finding]:
    lower, upper = _number(limit, "lower"), _number(limit, "upper")
    if lower > upper:
        message = f"its lower limit {lower:g} is above its upper limit {upper:g}"
        yield Finding("error", "limit", name, message, "exchange them")
    elif lower == upper:
        message = f"lower and upper limit are both {lower:g}: treated as no limit"
        yield Finding("warning", "limit", name, message, "give lower and upper")


def _of_maxima(name: str, limit: Element, *, follows: bool) -> Iterator[Finding]:
    none = []
    for which in ("effort", "velocity"):
        value = _number(limit, which)
        if limit.get(which) is None:
            message = f"<limit> without {which}, which parsers refuse"
            yield Finding("error", "limit", name, message, f'give {which}="0" or more')
        elif value < 0.0:
            message = f"its {which} limit {value:g} is negative"
            yield Finding("error", "limit", name, message, f'give {which}="0" or more')
        elif value == 0.0 and not follows:
            none.append(which)
    if none:
        yield _no_maximum(name, none)


def _no_maximum(name: str, which: Sequence[str]) -> Finding:
    return Finding(
        "note",
        "limit",
        name,
        f"no {' and no '.join(which)} limit: none is kept"
        + (", except the other joints' top speed" if "velocity" in which else ""),
        "give it in the URDF, or under limits: in the configuration",
    )


def _number(limit: Element, name: str) -> float:
    return float(limit.get(name, 0.0))


_SAMPLES = 64
_NO_ROTORS = 1e3
"""Condition number above which rotors are missing: those of light wrists are at least a
thousandth of the inertia at the first joints."""
_DOUBTFUL = 1e5
"""Condition number above which efforts have few valid digits."""


def worst_condition(robot: Robot) -> tuple[float, str]:
    """Return M's worst condition number, and the dof that moves most there."""
    rng, rest = np.random.default_rng(0), np.zeros(robot.nv)
    worst, which = 0.0, 0
    for sample in range(_SAMPLES + 1):
        q: Array = robot.random_configuration(rng) if sample else robot.home()
        values, vectors = np.linalg.eigh(robot.state(0.0, q, rest).mass_matrix)
        condition = float(values[-1] / values[0]) if values[0] > 0.0 else np.inf
        if condition > worst:
            worst, which = condition, int(np.argmax(np.abs(vectors[:, 0])))
    return worst, robot.dof_names[which]


def check_mass_matrix(condition: float, dof: str) -> Iterator[Finding]:
    """Yield the mass matrix if its `worst_condition` is too large."""
    if condition > _DOUBTFUL:
        yield Finding(
            "warning",
            "mass matrix",
            f"joint {dof!r}",
            f"the condition number of M reaches {condition:.1e}: in some posture "
            "hardly any mass moves with this joint"
            if np.isfinite(condition)
            else "M is not positive definite everywhere",
            "check the inertias beyond it, or lock it",
        )


def check_rotors(robot: Robot, condition: float, dof: str) -> Iterator[Finding]:
    """Yield a mass matrix that no real arm has, because its motors are not in it."""
    if robot.unactuated or robot.model.armature.any() or not condition > _NO_ROTORS:
        return
    rest = np.zeros(robot.nv)
    own = robot.dof_names.index(dof)
    inverse = np.linalg.inv(robot.state(0.0, robot.home(), rest).mass_matrix)
    felt, unit = 1.0 / inverse[own, own], robot.units[own]
    unit = "kg" if unit == "m" else "kg m²"
    yield Finding(
        "note",
        "rotors",
        f"joint {dof!r}",
        f"the condition number of M reaches {condition:.1e}, which no real arm has: "
        f"at home the inertia at this joint is {felt:.1g} {unit}, and a rotor behind "
        "its gear has 0.01 to 1",
        "give the rotors: robot: {motor_inertia: ...}, or transmissions in the URDF",
    )


def check_self_collisions(robot: Robot) -> Iterator[Finding]:
    """Yield the pairs of links whose capsules overlap at the home posture."""
    shapes = link_shapes(robot)
    pairs = self_pairs(robot, shapes)
    if not pairs:
        return
    home = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    proximity = Proximity(robot, shapes, (), pairs)
    distances = proximity.measure(home)
    deepest: dict[tuple[str, str], float] = {}
    for (i, j), distance in zip(proximity.pairs, distances, strict=True):
        links = shapes[i].link, shapes[j].link
        deepest[links] = min(deepest.get(links, 0.0), float(distance))
    for (first, second), distance in deepest.items():
        if distance < 0.0:
            yield Finding(
                "note",
                "self-collision",
                f"{first!r} and {second!r}",
                f"their capsules overlap at home by {-distance:.3g} m: self_clearance "
                "leaves this pair out",
                "if they can collide, bound their joints by limits: position",
            )


REGULAR = 0.03
"""Singular value below which the law is damped by default."""


def check_home(robot: Robot) -> Iterator[Finding]:
    """Yield that home is singular for the end effector, or in collision."""
    if robot.unactuated:
        return
    search = PostureSearch(robot, tracked_by_hand(robot))
    home = search.judge(robot.home())
    wrong = []
    if home.regularity < REGULAR:
        wrong.append(
            f"singular for {robot.end_effector!r} (smallest singular value "
            f"{home.regularity:.2g})"
        )
    depth, pair = search.overlap(robot.home())
    if depth > 0.0:
        wrong.append(f"in collision ({pair} overlap by {depth:.2g} m)")
    if wrong:
        message = f"it is {' and '.join(wrong)}"
        yield Finding("warning", "home", "home posture", message, _cure(search))


def tracked_by_hand(robot: Robot) -> list[Rows]:
    """Return the rows of the end effector's pose that it can move independently."""
    spread = np.random.default_rng(0).uniform(-1.0, 1.0, robot.nv)
    q = robot.integrate(robot.home(), spread)
    J = robot.state(0.0, q, np.zeros(robot.nv)).frame(robot.end_effector).jacobian
    rows: list[int] = []
    for row in range(6 if np.linalg.matrix_rank(J, tol=1e-6) == 6 else 3):
        if np.linalg.matrix_rank(J[[*rows, row]], tol=1e-6) > len(rows):
            rows.append(row)
    return [(robot.end_effector, tuple(rows))] if rows else []


def _cure(search: PostureSearch) -> str:
    try:
        found = search.find(REGULAR)
    except ConfigurationError as error:
        return str(error)
    return f"start: {search.start_line(found)}, or start: auto"


def check_strength(robot: Robot) -> Iterator[Finding]:
    """Yield the joints whose limits are too low to hold the robot at home."""
    if robot.unactuated:
        return
    own = np.array(robot.model.effortLimit)
    limits = np.where(own > 0.0, own, np.inf)
    for joint, why in too_weak(robot, robot.home(), limits):
        cure = "begin elsewhere, or set its limit: limits: {effort: {joints: ...}}"
        yield Finding("warning", "effort", joint, f"at home {why}", cure)


@dataclass(frozen=True)
class Inspection:
    """The result of an inspection."""

    source: RobotSource  # the robot's source
    findings: tuple[Finding, ...]  # findings, errors first
    facts: Mapping[str, str]  # general facts about it: names and texts

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


def inspect(description: RobotDescription, access: Access = ANYWHERE) -> Inspection:
    """Return the findings about a robot.

    Checks of a URDF come first. If it has no errors, or only inertias that projection
    repairs, the robot is loaded and checked.

    Args:
        description: The robot's source, and how it is loaded.
        access: Which files may be read.

    Raises:
        RobotNotFoundError: If its file cannot be read.
        ModelError: If its file is not XML, no URDF or MJCF, or too large; or if an MJCF
            is no robot.
    """
    findings: list[Finding] = []
    facts: dict[str, str] = {}
    if description.mjcf is not None:
        robot = Robot.load(description, access=access)
        source = robot.source
        for sentence in source.omitted:
            findings.append(Finding("note", "left out", source.name, sentence))
        found, facts = _of_robot(robot)
        findings += found
    else:
        source = description.find(access)
        xml = parse_urdf(source)
        # Errors of its elements, with which the robot does not load.
        findings += [Finding("error", "element", *each) for each in problems(xml)]
        if not findings:
            findings += [*check_inertias(xml), *check_limits(xml), *check_angles(xml)]
            findings += [*check_soft_limits(xml), *check_followers(xml)]
            findings += [*check_continuous(xml), *check_friction(xml)]
            findings += [*check_maxima(xml), *check_mesh_sizes(xml, source)]
            findings += [*check_planar_axes(xml), *check_unread(xml)]
            findings += check_transmissions(xml)
            findings += [*check_meshes(xml, source), *check_mesh_axes(xml, source)]
            findings += [*check_shapes(xml), *check_srdf(xml, source)]
        errors = [f for f in findings if f.severity == "error"]
        if all(error.check == "inertia" for error in errors):
            if errors:
                description = replace(description, project_inertias=True)
            try:
                model = load_model(source, description, description.gravity)
                robot = Robot(model, source, description=description)
                found, facts = _of_robot(robot)
                findings += found
                findings += check_gyration(xml, robot, _points_of_shapes(robot))
                findings += check_density(xml, robot)
            except ModelError as error:
                reason = _reason(error, source)
                findings.append(Finding("error", "robot", source.name, reason))
    order = ("error", "warning", "note")
    findings.sort(key=lambda finding: order.index(finding.severity))
    return Inspection(source, tuple(findings), {"file": str(source.urdf)} | facts)


def _of_robot(robot: Robot) -> tuple[list[Finding], dict[str, str]]:
    """Return the findings and the facts about a loaded robot."""
    condition, dof = worst_condition(robot)
    findings = [*check_size(robot), *check_mass_matrix(condition, dof)]
    findings += check_rotors(robot, condition, dof)
    try:
        findings += check_self_collisions(robot)
    except ModelError as error:
        reason = _reason(error, robot.source).partition(";")[0]
        message = f"not checked: {reason}"
        findings.append(Finding("warning", "self-collision", "all links", message))
    findings += [*check_home(robot), *check_strength(robot)]
    root = "floating base" if robot.unactuated else "fixed base"
    home = ", ".join(f"{x:.3g}" for x in robot.joint_positions(robot.home()) + 0.0)
    far, turned = robot.largest_error
    return findings, {
        "robot": f"{robot.name}: nq = {robot.nq}, nv = {robot.nv}, {root}",
        "end effector": f"{robot.end_effector} (by default): {robot.hand.why}",
        "reach": f"{robot.size:.3g} m from the first joint at most: the longest chain",
        "bounds": f"an error is bounded at {far:.3g} m and {turned:.3g} rad by default",
        "effort rate": _rates(robot),
        "springs": _springs(robot),
        "mass": f"{pin.computeTotalMass(robot.model):.4g} kg move",
        "mass matrix": f"condition number up to {condition:.2g}, by {dof}",
        "rotors": _rotors(robot),
        "observer": _observer(robot),
        "home": f"[{home}]",
    }


def _points_of_shapes(robot: Robot) -> dict[str, Array]:
    """Return points at the ends of the links' capsules, in their frames, by link."""
    try:
        shapes = link_shapes(robot)
    except ModelError:  # reported where they are checked
        return {}
    points: dict[str, list[Array]] = {}
    for shape in shapes:
        if shape.link not in robot.frame_names:
            continue  # a substitute for missing shapes
        frame = robot.model.frames[robot.frame_id(shape.link)]
        place, capsule = frame.placement.actInv(shape.placement), shape.geometry
        reach = capsule.radius + getattr(capsule, "halfLength", 0.0)
        ends = reach * np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
        points.setdefault(shape.link, []).extend(place.act(end) for end in ends)
    return {link: np.array(found) for link, found in points.items()}


def _rotors(robot: Robot) -> str:
    own = robot.model.armature[robot.model.armature > 0.0]
    if not own.size:
        return "none in the model; robot: motor_inertia adds them"
    low, high = (f"{each:.3g}" for each in (own.min(), own.max()))
    each = low if low == high else f"{low} to {high}"
    return f"{each} kg m² (or kg) on {own.size} of {robot.nv} degrees of freedom"


def _observer(robot: Robot) -> str:
    if robot.unactuated:
        return "none by default: the base floats"
    limits = largest_cancelled(robot)
    limits = limits[np.isfinite(limits)]
    most = "any effort"
    if limits.size:
        low, high = (f"{each:.3g}" for each in (limits.min(), limits.max()))
        most = f"at most {low if low == high else f'{low} to {high}'} N·m or N"
    return (
        f"a momentum observer is on by default where nothing is to yield; it cancels "
        f"{most}"
    )


def _rates(robot: Robot) -> str:
    rates = robot.effort_rate[np.isfinite(robot.effort_rate)]
    if not rates.size:
        return "no effort limits, so none"
    low, high = (f"{each:.3g}" for each in (rates.min(), rates.max()))
    most = high if low == high else f"{low} to {high}"
    return f"no effort changes by more than {most} N·m/s or N/s by default"


def _springs(robot: Robot) -> str:
    force, moment = robot.spring_force
    if not np.isfinite(force):
        return "no effort limits, so they pull with any force"
    turned = f" and {moment:.3g} N·m" if np.isfinite(moment) else ""
    return f"a hand's pull with at most {force:.3g} N{turned} by default"


def _reason(error: ModelError, source: RobotSource) -> str:
    return str(error).removeprefix(f"{source.urdf}: ")
