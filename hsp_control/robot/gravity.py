"""The efforts against gravity at a posture, and their derivatives."""

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.engine import Dynamics
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.robot.kinematics import WorldKinematics, joint_support


class Gravity:
    """The efforts against gravity, their slope, and their drift along the motion.

    Attributes:
        calls: Bring the attributes below up to date, after the state has moved.
        effort: G(q), shape (nv,) [N·m or N].
        slope: ∂G/∂q, shape (nv, nv).
        drift: G'' at constant velocity, shape (nv,).
    """

    def __init__(
        self, model: pin.Model, dynamics: Dynamics, world: WorldKinematics
    ) -> None:
        """Allocate the arrays."""
        nv, joints = model.nv, range(model.njoints)
        columns = [joint for joint in joints for _ in range(_width(model, joint))]
        moves = np.zeros((model.nvExtended, model.njoints), dtype=np.bool_)
        dofs = np.zeros(model.nvExtended, dtype=np.int64)
        for joint in joints:
            support, of_v = joint_support(model, joint)
            moves[support, joint], dofs[support] = True, of_v
        mass, center = np.zeros(model.njoints), np.zeros((model.njoints, 3))
        gravity = np.zeros(3)
        weights = PartCall(
            engine.Weights,
            dynamics=dynamics,
            mass=mass,
            center=center,
            gravity=gravity,
        )
        self.effort: Array = np.zeros(nv)
        self.slope: Array = np.zeros((nv, nv))
        self.drift: Array = np.zeros(nv)
        call = PartCall(
            engine.Gravity,
            jacobian=world.jacobian,
            jacobian_dot=world.jacobian_dot,
            placements=world.placements,
            mass=mass,
            center=center,
            moves=moves,
            joints=np.array(columns, dtype=np.int64),
            dofs=dofs,
            gravity=gravity,
            v=world.v,
            effort=self.effort,
            slope=self.slope,
            drift=self.drift,
        )
        self.calls: PartCalls = [weights, call]


def _width(model: pin.Model, joint: int) -> int:
    return int(model.joints[joint].nvExtended) if joint else 0
