"""A robot and its scene from MuJoCo: the law moves it in MuJoCo's own loop."""

import mujoco
import numpy as np

import hsp_control as hsp

SCENE = """
<mujoco>
  <option timestep="0.002"/>
  <default><joint armature="0.02"/><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body name="base">
      <geom type="cylinder" size="0.06 0.05" pos="0 0 0.05"/>
      <body name="shoulder" pos="0 0 0.1"><joint name="j1" axis="0 0 1"/>
        <geom type="capsule" size="0.04" fromto="0 0 0 0 0 0.25"/>
        <body name="upper" pos="0 0 0.25"><joint name="j2" axis="0 1 0"/>
          <geom type="capsule" size="0.035" fromto="0 0 0 0 0 0.3"/>
          <body name="fore" pos="0 0 0.3"><joint name="j3" axis="0 1 0"/>
            <geom type="capsule" size="0.03" fromto="0 0 0 0 0 0.25"/>
            <body name="wrist" pos="0 0 0.25"><joint name="j4" axis="0 1 0"/>
              <geom type="capsule" size="0.025" fromto="0 0 0 0 0 0.1"/>
              <site name="tip" pos="0 0 0.12"/>
  </body></body></body></body></body></worldbody>
  <actuator>
    <motor joint="j1"/><motor joint="j2"/><motor joint="j3"/><motor joint="j4"/>
  </actuator>
</mujoco>"""  # or MjModel.from_xml_path("scene.xml")

model = mujoco.MjModel.from_xml_string(SCENE)
data = mujoco.MjData(model)
robot = hsp.Robot.from_mujoco(model, root="base")
data.qpos[:] = [0.3, 0.6, 0.9, 0.5]
hand = hsp.FramePosition("tip", hsp.Circle(radius=0.08, angular_rate=3.0), blend=1.0)
controller = hsp.Controller(robot, [hand], null_space_gain=8.0, start=data.qpos.copy())
coordinates = hsp.mujoco.MujocoCoordinates.of(robot, model)
with hsp.Recorder(controller, "out/mujoco_model.npz") as recorder:
    while data.time < 4.0:
        q, v = coordinates.from_mujoco(data.qpos, data.qvel)
        output = controller.compute(data.time, q, v)
        recorder.record(output)
        data.ctrl[:] = output.tau
        mujoco.mj_step(model, data)
print(recorder.rollout)
print(f"error of the tip at the end: {1e3 * np.linalg.norm(output.task.error):.2f} mm")
