"""Meanings and remedies of a Franka's errors by name: for messages and the manual."""

import re

from hsp_control.common.suggestions import listing

_MOTION = (
    "a check of the robot's own motion generators failed",
    "torque control does not use them: another program moved the robot",
)
_DESK = (
    "a motion started from Desk failed",
    "end it in Desk, then connect again",
)

REFLEXES: dict[str, tuple[str, str]] = {
    "joint_position_limits_violation": (
        "a joint is at its position limit",
        "guide it back by hand; keep limits on, and start farther from it",
    ),
    "cartesian_position_limits_violation": (
        "the hand left the workspace that Desk allows",
        "move the task, or the virtual walls in Desk",
    ),
    "self_collision_avoidance_violation": (
        "the arm came too close to itself",
        "choose another path or posture",
    ),
    "joint_velocity_violation": (
        "a joint exceeded its speed limit",
        "keep limits on; slow the task down, or lower natural_frequency and gain",
    ),
    "cartesian_velocity_violation": (
        "the hand exceeded its speed limit",
        "slow the task down, or give it a longer blend",
    ),
    "force_control_safety_violation": (
        "a force exceeded the limit of force control",
        "look for a contact, and for a load that is not declared",
    ),
    "joint_reflex": (
        "the external torque of a joint exceeded collision_torque",
        "look for a contact; then for a load that the robot does not know; only then "
        "raise collision_torque",
    ),
    "cartesian_reflex": (
        "the external force at the hand exceeded collision_force",
        "look for a contact; then for a load that the robot does not know; only then "
        "raise collision_force",
    ),
    "controller_torque_discontinuity": (
        "the effort changed by more than 1000 N·m/s",
        "the loop keeps this rate: look for lost packets, and lower the gains",
    ),
    "communication_constraints_violation": (
        "too many efforts arrived late, or none arrived for 20 ms",
        "use a real-time kernel, --priority 80 and a separate cable; docs/latency.md "
        "measures the computer",
    ),
    "power_limit_violation": (
        "the motors exceeded their power limit",
        "slow the task down, or lower natural_frequency",
    ),
    "tau_j_range_violation": (
        "a measured joint torque was outside its sensor's range",
        "look for a contact or an overload; lower the gains",
    ),
    "instability_detected": (
        "the robot detected unstable motion",
        "lower natural_frequency and gain; compare the model (hsp franka-model)",
    ),
    "joint_move_in_wrong_direction": (
        "a joint at its position limit was guided further out",
        "guide it back by hand",
    ),
    "base_acceleration_initialization_timeout": (
        "the direction of gravity could not be measured",
        "keep the base still, then restart the control box",
    ),
    "base_acceleration_invalid_reading": (
        "the sensor of the base's acceleration gave no valid value",
        "keep the base still, then restart the control box",
    ),
    "force_controller_desired_force_tolerance_violation": _DESK,
    "max_goal_pose_deviation_violation": _MOTION,
    "max_path_pose_deviation_violation": _MOTION,
    "cartesian_velocity_profile_safety_violation": _MOTION,
    "joint_position_motion_generator_start_pose_invalid": _MOTION,
    "joint_motion_generator_position_limits_violation": _MOTION,
    "joint_motion_generator_velocity_limits_violation": _MOTION,
    "joint_motion_generator_velocity_discontinuity": _MOTION,
    "joint_motion_generator_acceleration_discontinuity": _MOTION,
    "cartesian_position_motion_generator_start_pose_invalid": _MOTION,
    "cartesian_position_motion_generator_invalid_frame": _MOTION,
    "cartesian_motion_generator_elbow_limit_violation": _MOTION,
    "cartesian_motion_generator_velocity_limits_violation": _MOTION,
    "cartesian_motion_generator_velocity_discontinuity": _MOTION,
    "cartesian_motion_generator_acceleration_discontinuity": _MOTION,
    "cartesian_motion_generator_elbow_sign_inconsistent": _MOTION,
    "cartesian_motion_generator_start_elbow_invalid": _MOTION,
    "cartesian_motion_generator_joint_position_limits_violation": _MOTION,
    "cartesian_motion_generator_joint_velocity_limits_violation": _MOTION,
    "cartesian_motion_generator_joint_velocity_discontinuity": _MOTION,
    "cartesian_motion_generator_joint_acceleration_discontinuity": _MOTION,
    "cartesian_spline_motion_generator_violation": _MOTION,
    "start_elbow_sign_inconsistent": _DESK,
    "joint_p2p_insufficient_torque_for_planning": _DESK,
    "joint_via_motion_generator_planning_joint_limit_violation": _DESK,
}
"""Errors by their names in libfranka: the event, and the remedy."""

_CAUSES: dict[str, str] = {
    "user stop pressed": "the stop button was pressed: release it",
    "refused": "switch FCI on in Desk (menu Activate FCI), and unlock the joints",
    "timeout": "the cable, the address, or the control box is off; or it stopped "
    "sending",
    "realtime capabilities": "boot a PREEMPT_RT kernel; ?realtime=ignore for a trial",
    "realtime scheduling": "allow it: rtprio 99 in /etc/security/limits.conf "
    "(hsp_control/companions/franka/page.md), or ?realtime=ignore for a trial",
    "thread priority": "allow it: rtprio 99 in /etc/security/limits.conf "
    "(hsp_control/companions/franka/page.md), or ?realtime=ignore for a trial",
    "incompatible library version": "libfranka and the robot's system software are "
    "incompatible: "
    "hsp_control/companions/franka/page.md names the versions",
    "safety function": "a safety function of Desk is active: end it there",
    "not possible in the current mode": "unlock the joints in Desk, and leave guiding",
    "closed connection": "the control box ended the connection",
}
"""Parts of libfranka's other messages, and the remedy."""

MODES: dict[str, str] = {
    "Other": "its joints are locked, or it starts: unlock the joints in Desk",
    "Move": "another program moves it: end that one",
    "Guiding": "it is guided by hand: release the enabling button",
    "Reflex": "a reflex stopped it: look at the arm, then connect with ?recover=true",
    "UserStopped": "its stop button is pressed: release it",
    "AutomaticErrorRecovery": "it resets an error: wait, then connect again",
}
"""Modes of the robot in which no motion can start, and the remedy."""


def explained(kind: str, text: str) -> str:
    """Return the message of an exception of libfranka, with its meaning."""
    first, *rest = (line.strip() for line in text.strip().splitlines() or [""])
    plain = first.removeprefix("libfranka: ").removeprefix("libfranka robot: ")
    # Messages spell two of them differently: tau_J_..., and ..._invalid_frame_flag.
    words = [w.lower().removesuffix("_flag") for w in re.findall(r"\w+", first)]
    names = [word for word in words if word in REFLEXES]
    if names:
        return "; ".join([about(names), *filter(None, rest)])
    for part, advice in _CAUSES.items():
        if part in text.casefold():
            return f"{kind}: {plain.rstrip('!. ')} ({advice})"
    return f"{kind}: {'; '.join(filter(None, [plain, *rest]))}"


def about(names: list[str]) -> str:
    """Return errors by name, with meaning and advice."""
    found = []
    for name in names:
        what, advice = REFLEXES.get(
            name, ("an error that this version does not know", "")
        )
        found.append(f"{name}: {what}" + (f" ({advice})" if advice else ""))
    return listing(found, 3) if found else "no error is named"


def table() -> str:
    """Return the errors as a Markdown table, for the manual."""
    lines = ["| the robot reports | cause | remedy |", "|---|---|---|"]
    rows: dict[tuple[str, str], list[str]] = {}
    for name, about_it in REFLEXES.items():
        rows.setdefault(about_it, []).append(f"`{name}`")
    for (what, advice), names in rows.items():
        lines.append(f"| {', '.join(names)} | {what} | {advice} |")
    return "\n".join(lines)
