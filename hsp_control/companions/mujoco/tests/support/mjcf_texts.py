"""MJCF texts: random trees of bodies, and a cell with an arm, a gripper and a ball."""

from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
from hypothesis import strategies as st

KINDS = "hinge", "slide", "ball"

CELL = """
<mujoco model="cell">
  <option timestep="0.001" integrator="implicitfast"/>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="base" pos="0 0 .1">
      <geom type="cylinder" size=".06 .05"/>
      <body name="shoulder" pos="0 0 .1">
        <joint name="j1" axis="0 0 1" range="-170 170" armature=".1" damping=".5"/>
        <geom type="capsule" fromto="0 0 0 0 0 .3" size=".05" mass="2"/>
        <body name="upper" pos="0 0 .3">
          <joint name="j2" axis="0 1 0" range="-100 100" armature=".1"/>
          <geom type="capsule" fromto="0 0 0 0 0 .3" size=".045" mass="2"/>
          <body name="lower" pos="0 0 .3">
            <joint name="j3" axis="0 0 1" range="-170 170" armature=".05"/>
            <geom type="capsule" fromto="0 0 0 0 0 .1" size=".04" mass="1"/>
            <body name="hand" pos="0 0 .1">
              <joint name="j4" axis="0 1 0" range="-150 150" armature=".05"/>
              <geom type="capsule" fromto="0 0 0 0 0 .3" size=".04" mass="1"/>
              <site name="tip" pos="0 0 .35"/>
              <body name="finger" pos="0 0 .32">
                <joint name="f" type="slide" axis="1 0 0" range="0 .04"/>
                <geom type="box" size=".01 .01 .03" mass=".05"/>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
    <body name="ball" pos=".3 .3 .03">
      <freejoint name="ball"/>
      <geom size=".03" mass=".1"/>
    </body>
  </worldbody>
  <actuator>
    <motor name="m1" joint="j1" gear="50" ctrllimited="true" ctrlrange="-1 1"/>
    <motor name="m2" joint="j2" gear="100" ctrllimited="true" ctrlrange="-1 1"/>
    <motor name="m3" joint="j3" gear="-20" ctrllimited="true" ctrlrange="-1 1"/>
    <motor name="m4" joint="j4" gear="10" ctrllimited="true" ctrlrange="-1 1"/>
    <position name="grip" joint="f" kp="100"/>
  </actuator>
  <keyframe>
    <key name="home" qpos="0 .5 0 1 .02 .3 .3 .03 1 0 0 0" ctrl="0 0 0 0 .02"/>
  </keyframe>
</mujoco>
"""
"""A scene with more than a robot: the gripper is a servo, the ball is free."""
ARM = ["j1", "j2", "j3", "j4"]


@st.composite
def trees(draw: st.DrawFn) -> str:
    """Draw a scene of one to seven bodies with joints of all kinds.

    Bodies have up to two joints, with anchors, references, armature and damping, and a
    site; some are fixed. The first may be free.
    """
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    root = Element("mujoco")
    SubElement(root, "compiler", angle="radian", autolimits="true")
    SubElement(root, "option", gravity=_numbers(rng.normal(size=3)))
    bodies = [SubElement(root, "worldbody")]
    for k in range(draw(st.integers(1, 7))):
        parent = bodies[draw(st.integers(0, k))]
        body = SubElement(parent, "body", name=f"b{k}")
        body.attrib |= {"pos": _numbers(rng.normal(size=3)), "quat": _turn(rng)}
        if parent is bodies[0] and draw(st.booleans()):
            SubElement(body, "freejoint", name=f"free{k}")
        else:
            kinds = draw(st.lists(st.sampled_from(KINDS), max_size=2))
            if "ball" in kinds:  # MuJoCo permits it alone only
                kinds = ["ball"]
            if k == 0:
                kinds = kinds or ["hinge"]  # one joint at least
            for i, kind in enumerate(kinds):
                _add_joint(body, f"b{k}_{i}", kind, rng)
        geom = SubElement(
            body, "geom", type=draw(st.sampled_from(["box", "ellipsoid"]))
        )
        geom.attrib |= {
            "size": _numbers(rng.uniform(0.1, 0.3, 3)),
            "pos": _numbers(rng.normal(size=3)),
            "quat": _turn(rng),
            "mass": _numbers([rng.uniform(0.5, 2.0)]),
        }
        site = SubElement(body, "site", name=f"s{k}", quat=_turn(rng))
        site.set("pos", _numbers(rng.normal(size=3)))
        bodies.append(body)
    return tostring(root, encoding="unicode")


def _add_joint(body: Element, name: str, kind: str, rng: np.random.Generator) -> None:
    joint = SubElement(body, "joint", name=name, type=kind)
    joint.set("pos", _numbers(rng.normal(size=3)))
    joint.set("armature", _numbers([rng.uniform(0.0, 0.5)]))
    joint.set("damping", _numbers([rng.uniform(0.0, 0.5)]))
    if kind != "ball":
        joint.set("axis", _numbers(rng.normal(size=3)))
        joint.set("ref", _numbers([rng.normal()]))
        joint.set("range", _numbers(np.sort(rng.uniform(-2.0, 2.0, 2))))


def _turn(rng: np.random.Generator) -> str:
    return _numbers(rng.normal(size=4))


def _numbers(values: object) -> str:
    return " ".join(repr(float(x)) for x in np.ravel(np.asarray(values)))
