"""Commanded forces in an independent physics engine: the configurations."""

import re

import numpy as np
import pytest
import yaml
from places import ROOT

import hsp_control as hsp
from hsp_control import Rollout, load_experiment
from hsp_control.common.resources import bundled_configs

mujoco = pytest.importorskip("mujoco")
WIPER = "panda_tcp"
COARSE = "simulation.control_period=0.002"  # at its own period a panda wipes below


def felt(log: Rollout, frame: str, normal: list[float]) -> np.ndarray:
    return np.asarray(log[f"plant.contact.{frame}.force"] @ np.array(normal))


def test_a_panda_wipes_without_losing_contact() -> None:
    """20 N and 0.1 m/s on μ = 0.3: force, path and null space, with an estimate."""
    log = load_experiment(
        "forces/panda_wipe",
        "simulation.duration=1.6",
        "compensation.force_feedback.force=estimated",
        "compensation.momentum_observer={bandwidth: 50, cancel: false}",
    ).run()
    force = felt(log, WIPER, [0.0, 0.0, 1.0])
    settled = log.t > 1.0
    assert (force[log.t > 0.2] > 0.0).all()
    np.testing.assert_allclose(force[settled], 20.0, atol=0.3)
    estimated = log["contact.wiper.estimated"][settled]
    np.testing.assert_allclose(estimated, force[settled], atol=0.3)
    slip = log["plant.contact.panda_tcp.force"][settled, :2]
    np.testing.assert_allclose(np.linalg.norm(slip, axis=1), 6.0, atol=0.4)
    assert np.linalg.norm(log["task.path.error"][settled], axis=1).max() < 5e-4
    assert log["null_space_norm"][settled].max() < 0.03
    assert not log["status"].any()


@pytest.mark.parametrize(("share", "lost"), [(0.7, False), (1.6, True)])
@pytest.mark.parametrize("impedance", [0.5, 0.8])
def test_the_bound_on_the_damping_of_a_slip(
    share: float, lost: bool, impedance: float
) -> None:
    """A ball without a controller touches if b < (1 - d)/d f_n / (m μ ‖u‖)."""
    bound = (1.0 - impedance) / impedance * 20.0 / (3.0 * 0.3 * 0.1)
    model = mujoco.MjModel.from_xml_string(f"""
    <mujoco><option timestep="0.001" cone="elliptic" impratio="10" gravity="0 0 0"/>
    <worldbody><geom name="plane" type="plane" size="9 9 1"/>
    <body pos="0 0 0.0199"><joint type="slide" axis="1 0 0" damping="3000"/>
    <joint type="slide" axis="0 0 1"/>
    <geom name="ball" type="sphere" size="0.02" mass="3"/></body></worldbody>
    <contact><pair geom1="plane" geom2="ball" condim="3" friction="0.3 0.3 0 0 0"
    solimp="{impedance} {impedance} 0.001 0.5 2"
    solreffriction="-1 {-share * bound * impedance}"/></contact></mujoco>""")
    data = mujoco.MjData(model)
    data.qvel[0] = 0.1
    data.qfrc_applied[:] = [300.0, -20.0]
    touching = []
    for _ in range(1000):
        mujoco.mj_step(model, data)
        touching.append(data.ncon > 0)
    assert all(touching[500:]) != lost


def test_talos_presses_against_a_wall() -> None:
    """40 N balanced by the soles, on compliant contacts; no step is limited."""
    pytest.importorskip("example_robot_data")
    log = load_experiment("forces/talos_wall", "simulation.duration=1.8", COARSE).run()
    assert log.meta["status"] == "completed"
    force = felt(log, "gripper_right_base_link", [-1.0, 0.0, 0.0])
    np.testing.assert_allclose(force[log.t > 1.5], 40.0, atol=0.5)
    soles = sum(
        log[f"plant.contact.{side}_sole_link.force"] for side in ("left", "right")
    )
    inert = np.abs(np.asarray(soles)[:, 0] - force)[log.t > 1.5]
    assert inert.max() < 10.0  # the rest accelerates the swaying body
    assert np.linalg.norm(log["task.center_of_mass.error"], axis=1).max() < 1e-3
    assert log["status"].max() <= 1


def test_talos_leans_while_it_is_heavier_than_its_model() -> None:
    """On the ramp to 120 N, 10 % too heavy: it stands, and presses as commanded."""
    pytest.importorskip("example_robot_data")
    log = load_experiment("forces/talos_lean", "simulation.duration=2.2", COARSE).run()
    assert log.meta["status"] == "completed"
    force = felt(log, "gripper_right_base_link", [-1.0, 0.0, 0.0])
    commanded = -log["contact.hand.commanded"][:, 0] - log["contact.hand.integral"]
    late = log.t > 1.5
    assert commanded[-1] > 55.0
    np.testing.assert_allclose(force[late], commanded[late], atol=4.0)
    assert log.q[-1, 2] > 0.95


def test_two_pandas_lift_a_box() -> None:
    """60 N between the palms, half of the weight on each: friction alone holds the
    box."""
    log = load_experiment("forces/pandas_box", "simulation.duration=1.7", COARSE).run()
    late = log.t > 1.3
    for side, sign in (("left", 1.0), ("right", -1.0)):
        force = log[f"plant.contact.{side}_panda_tcp.force"][late]
        np.testing.assert_allclose(force[:, 1], 60.0 * sign, atol=0.2)
        np.testing.assert_allclose(force[:, 2], -24.5, atol=3.0)
    box = log["plant.solid.box.position"]
    assert box[-1, 2] > 0.46  # it lay at 0.4
    hand = log["task.left.actual"][:, 1]
    np.testing.assert_allclose((box[:, 2] - hand)[late], box[0, 2] - hand[0], atol=2e-3)
    assert np.abs(box[:, 1]).max() < 1e-3
    assert not log["status"].any()


def test_the_page_about_forces_is_true() -> None:
    text = (ROOT / "docs" / "forces.md").read_text(encoding="utf-8")
    (snippet,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    space: dict[str, object] = {}
    exec(compile(snippet, "forces.md", "exec"), space)
    controller = space["controller"]
    assert isinstance(controller, hsp.Controller)
    out = controller.compute(0.0, controller.robot.home(), [0.0] * 7)
    assert out.forces[2] == 20.0
    first, box = re.findall(r"^```yaml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    talos = yaml.safe_load(
        bundled_configs()["forces/talos_wall"].read_text(encoding="utf-8")
    )
    talos["contacts"] |= yaml.safe_load(first)["contacts"]
    talos["changes"] = yaml.safe_load(first)["changes"]
    talos["plant"]["solids"] = yaml.safe_load(first)["plant"]["solids"]
    load_experiment(talos)
    pandas = yaml.safe_load(
        bundled_configs()["forces/pandas_box"].read_text(encoding="utf-8")
    )
    pandas["contacts"] = yaml.safe_load(box)["contacts"]
    load_experiment(pandas)
