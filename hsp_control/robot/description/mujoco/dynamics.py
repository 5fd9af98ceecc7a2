"""The Pinocchio model of a robot in a compiled MuJoCo model.

It is made of the numbers that MuJoCo computes with, so that nothing depends on how the
MJCF was written: defaults, included files, inertias from geoms are all resolved.

A body's joints follow one another in the body's frame (MuJoCo's documentation,
"Computation", kinematic tree), each about its anchor ``jnt_pos``:

    body in parent = (body_pos, body_quat) Π anchor · motion(qpos - qpos0) · anchor⁻¹

So the bodies' poses at q = qpos are MuJoCo's, and q is qpos but for the order of a
quaternion's numbers.
"""

from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ModelError
from hsp_control.robot.description.mujoco import motors
from hsp_control.robot.description.mujoco.constants import constants
from hsp_control.robot.description.mujoco.selection import Selection

_AXES = np.eye(3)
_HINGES = pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ
_SLIDES = pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ


def pose(position: Array, wxyz: Array) -> pin.SE3:
    """Return a pose from MuJoCo's position [m] and quaternion (w, x, y, z)."""
    w, x, y, z = (float(number) for number in wxyz)
    rotation = pin.Quaternion(w, x, y, z).normalized().toRotationMatrix()
    return pin.SE3(rotation, np.array(position, dtype=float))


def build_model(selection: Selection) -> pin.Model:
    """Return the Pinocchio model, with a frame for each body, joint and site."""
    return _Builder(selection).model


def dofs_of(model: Any, joint: int) -> slice:
    """Return the indices of a joint's degrees of freedom in qvel."""
    kinds = constants("mjtJoint")
    sizes = {kinds.mjJNT_FREE: 6, kinds.mjJNT_BALL: 3}
    first = int(model.jnt_dofadr[joint])
    return slice(first, first + sizes.get(int(model.jnt_type[joint]), 1))


class _Builder:
    """Adds the bodies of a scene to a model, from the world outwards."""

    def __init__(self, selection: Selection) -> None:
        self._selection, self._scene = selection, selection.model
        self._inside, self._moving = set(selection.bodies), set(selection.moving)
        self._kinds = constants("mjtJoint")
        self.model = pin.Model()
        self.model.name = selection.names.bodies[selection.root]
        off = self._scene.opt.disableflags & constants("mjtDisableBit").mjDSBL_GRAVITY
        gravity = np.array(self._scene.opt.gravity)
        self.model.gravity.linear = np.zeros(3) if off else gravity
        # For each body: the joint that it is fixed to, and its pose in it.
        self._places: list[tuple[int, pin.SE3]] = []
        for body in range(self._scene.nbody):
            self._places.append(self._placed(body))
            if body in self._inside:
                self._fill(body)
        self._add_sites()

    def _placed(self, body: int) -> tuple[int, pin.SE3]:
        """Return where a body is, after its joints were added."""
        scene = self._scene
        if body == 0:
            return 0, pin.SE3.Identity()
        parent, place = self._places[scene.body_parentid[body]]
        place = place * pose(scene.body_pos[body], scene.body_quat[body])
        first = int(scene.body_jntadr[body])
        for joint in range(first, first + int(scene.body_jntnum[body])):
            if scene.jnt_type[joint] == self._kinds.mjJNT_FREE:
                place = pin.SE3.Identity()  # its coordinates are the body's pose
            anchor = pin.SE3(np.eye(3), np.array(scene.jnt_pos[joint]))
            if joint in self._moving:
                parent = self._add_joint(parent, place * anchor, joint)
                place = anchor.inverse()
            else:
                place = place * anchor * self._locked(joint) * anchor.inverse()
        return parent, place

    def _locked(self, joint: int) -> pin.SE3:
        """Return the motion of a joint that is locked."""
        scene, kinds = self._scene, self._kinds
        at = int(scene.jnt_qposadr[joint])
        qpos, kind = self._selection.qpos, scene.jnt_type[joint]
        if kind == kinds.mjJNT_FREE:
            return pose(qpos[at : at + 3], qpos[at + 3 : at + 7])
        if kind == kinds.mjJNT_BALL:
            return pose(np.zeros(3), qpos[at : at + 4])
        return self._moved(joint, float(qpos[at]))

    def _moved(self, joint: int, qpos: float) -> pin.SE3:
        """Return the motion of a hinge or a slide from the reference to a value."""
        scene = self._scene
        way = qpos - float(scene.qpos0[scene.jnt_qposadr[joint]])
        vector = way * np.array(scene.jnt_axis[joint])
        if scene.jnt_type[joint] == self._kinds.mjJNT_HINGE:
            return pin.SE3(pin.exp3(vector), np.zeros(3))
        return pin.SE3(np.eye(3), vector)

    def _add_joint(self, parent: int, place: pin.SE3, joint: int) -> int:
        scene, kind = self._scene, self._scene.jnt_type[joint]
        name = self._selection.names.joints[joint]
        dofs = dofs_of(scene, joint)
        if self.model.existJointName(name):
            raise ModelError(f"joint {name!r}: the model has this name already")
        if kind == self._kinds.mjJNT_FREE:
            index = self.model.addJoint(parent, pin.JointModelFreeFlyer(), place, name)
        elif kind == self._kinds.mjJNT_BALL:
            index = self.model.addJoint(parent, pin.JointModelSpherical(), place, name)
        else:
            place = place * self._moved(joint, 0.0)  # so that q is qpos, not qpos - ref
            turns = kind == self._kinds.mjJNT_HINGE
            made = _scalar_joint(np.array(scene.jnt_axis[joint]), turns=turns)
            limits = self._limits(joint)
            index = self.model.addJoint(parent, made, place, name, *limits)
        at = self.model.idx_vs[index]
        own = slice(at, at + dofs.stop - dofs.start)
        self.model.armature[own] = motors.armature(scene, joint, dofs)
        self.model.damping[own] = motors.damping(scene, joint, dofs)
        self.model.upperDryFrictionLimit[own] = scene.dof_frictionloss[dofs]
        self.model.lowerDryFrictionLimit[own] = -scene.dof_frictionloss[dofs]
        self.model.addJointFrame(index)
        return int(index)

    def _limits(self, joint: int) -> tuple[Array, Array, Array, Array]:
        """Return effort, velocity, lower and upper limit of a hinge or a slide."""
        scene = self._scene
        low, high = -np.inf, np.inf
        if scene.jnt_limited[joint]:
            low, high = map(float, scene.jnt_range[joint])
        weakest, strongest = motors.effort_range(scene, joint)
        effort = max(0.0, min(-weakest, strongest))
        return tuple(np.array([x]) for x in (effort, np.inf, low, high))  # type: ignore[return-value]

    def _fill(self, body: int) -> None:
        """Add a body's inertia and its frame."""
        joint, place = self._places[body]
        scene = self._scene
        moments = np.array(scene.body_inertia[body], dtype=float)
        mass = float(scene.body_mass[body])
        if joint and (mass > 0.0 or moments.any()):
            center = self._inertial_frame(body)
            inertia = pin.Inertia(mass, np.zeros(3), np.diag(moments))
            self.model.appendBodyToJoint(joint, center.act(inertia), place)
        name = self._selection.names.bodies[body]
        self.model.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.BODY))

    def _inertial_frame(self, body: int) -> pin.SE3:
        """Return the frame of a body's inertia; where MuJoCo rounds it, as it does."""
        scene, same = self._scene, constants("mjtSameFrame")
        center = pose(scene.body_ipos[body], scene.body_iquat[body])
        if scene.body_sameframe[body] == same.mjSAMEFRAME_BODY:
            return pin.SE3.Identity()
        if scene.body_sameframe[body] == same.mjSAMEFRAME_BODYROT:
            center.rotation = np.eye(3)
        return center

    def _add_sites(self) -> None:
        scene, names = self._scene, self._selection.names.sites
        for site in range(scene.nsite):
            body = int(scene.site_bodyid[site])
            if body in self._inside:
                joint, place = self._places[body]
                own = pose(scene.site_pos[site], scene.site_quat[site])
                kind = pin.FrameType.OP_FRAME
                self.model.addFrame(pin.Frame(names[site], joint, 0, place * own, kind))


def _scalar_joint(axis: Array, *, turns: bool) -> Any:
    """Return Pinocchio's joint for an axis; the aligned ones are faster."""
    for k in range(3):
        if np.array_equal(axis, _AXES[k]):
            return (_HINGES if turns else _SLIDES)[k]()
    if turns:
        return pin.JointModelRevoluteUnaligned(axis)
    return pin.JointModelPrismaticUnaligned(axis)
