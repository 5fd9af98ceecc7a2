"""Robots as URDF texts, and their frames' placements."""

import numpy as np
import pinocchio as pin

BUNDLED = ("iiwa14", "panda", "planar3r")

INERTIA = (
    '<inertial><origin xyz="0.2 0.1 0.3"/><mass value="2"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
)


def joint(
    name: str, parent: str, child: str, kind: str = "revolute", inner: str = ""
) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="0.5 0.1 0.2" rpy="0.3 0.2 0.1"/>'
        '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="9"/>'
        f"{inner}</joint>"
    )


def link(name: str, inner: str = INERTIA) -> str:
    return f'<link name="{name}">{inner}</link>'


def robot_xml(*parts: str) -> str:
    return f'<robot name="made_up">{"".join(parts)}</robot>'


ARM = robot_xml(
    link("base", ""),
    link("upper"),
    link("lower"),
    joint("shoulder", "base", "upper"),
    joint("elbow", "upper", "lower"),
)


def gripper(kind: str = "revolute", multiplier: float = -1.5) -> str:
    """Return an arm whose last joint is multiplier · shoulder + 0.3."""
    mimic = f'<mimic joint="shoulder" multiplier="{multiplier}" offset="0.3"/>'
    return robot_xml(
        link("base", ""),
        link("upper"),
        link("lower"),
        link("finger"),
        joint("shoulder", "base", "upper", kind),
        joint("elbow", "upper", "lower"),
        joint("follower", "lower", "finger", kind, mimic),
    )


def placements(model: pin.Model, q: np.ndarray) -> dict[str, np.ndarray]:
    """Return every body frame's placement, by plain Pinocchio."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    bodies = [f for f in model.frames if f.type == pin.FrameType.BODY]
    return {f.name: data.oMf[model.getFrameId(f.name)].homogeneous for f in bodies}


def assert_same_placements(
    first: dict[str, np.ndarray], second: dict[str, np.ndarray]
) -> None:
    """Every body of the first has the placement of the second's, to rounding."""
    assert first
    for name, placement in first.items():
        np.testing.assert_allclose(placement, second[name], rtol=0, atol=1e-14)
