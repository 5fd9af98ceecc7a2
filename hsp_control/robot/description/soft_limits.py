"""The soft limits of a URDF's ``<safety_controller>``, written as a joint's limits.

Pinocchio does not read them. A robot's own controller enforces them, so that no
position beyond them can be commanded.
"""

from xml.etree.ElementTree import Element

from hsp_control.common.errors import ModelError


def write_soft_limits(robot: Element) -> None:
    """Narrow the position limits of a URDF's joints to their soft ones, in place.

    Two soft limits that are equal are none, as two limits are.

    Raises:
        ModelError: If no position of a joint is within both.
    """
    for joint in robot.findall("joint"):
        limit, safety = joint.find("limit"), joint.find("safety_controller")
        if limit is None or safety is None or joint.get("type") == "continuous":
            continue
        hard = _ends(limit, "lower", "upper")
        soft = _ends(safety, "soft_lower_limit", "soft_upper_limit")
        if soft[0] == soft[1]:
            continue
        lower, upper = soft
        if hard[0] != hard[1]:
            lower, upper = max(hard[0], lower), min(hard[1], upper)
        if lower >= upper:
            raise ModelError(
                f"joint {joint.get('name')!r}: <safety_controller>: the soft limits "
                f"{soft[0]:g} to {soft[1]:g} leave nothing of its limits {hard[0]:g} "
                f"to {hard[1]:g}"
            )
        limit.set("lower", repr(lower))
        limit.set("upper", repr(upper))


def _ends(element: Element, lower: str, upper: str) -> tuple[float, float]:
    return float(element.get(lower, 0.0)), float(element.get(upper, 0.0))
