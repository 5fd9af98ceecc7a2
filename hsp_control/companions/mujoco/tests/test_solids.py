"""Solids in MuJoCo: placement, friction, and refusals."""

from typing import Any

import numpy as np
import pytest
from loaded_robots import panda

from hsp_control.common.errors import SimulationError
from hsp_control.companions.mujoco import ContactShape, Solid
from hsp_control.companions.mujoco.plant import Mujoco, MujocoPlant
from hsp_control.geometry.shapes import Box, HalfSpace, Sphere

mujoco = pytest.importorskip("mujoco")
TIP = "panda_tcp"


def plant(*solids: Solid, **options: Any) -> MujocoPlant:
    contacts = [ContactShape(TIP, Sphere(0.02))]
    return MujocoPlant(
        panda(), Mujoco(**({"contacts": contacts, "solids": solids} | options))
    )


def test_stairs_are_copies() -> None:
    stairs = Solid(
        "stairs",
        Box([0.3, 1.0, 0.1]),
        [0.8, 0.0, 0.05],
        [0.0, 0.0, 0.1],
        copies=3,
        spacing=[0.3, 0.0, 0.1],
    )
    model = plant(stairs).model
    for k in range(3):
        geom = model.geom(f"solid/stairs/{k}")
        np.testing.assert_allclose(geom.pos, [0.8 + 0.3 * k, 0.0, 0.05 + 0.1 * k])
        np.testing.assert_allclose(geom.size, [0.15, 0.5, 0.05])
        np.testing.assert_allclose(geom.quat, [np.cos(0.05), 0, 0, np.sin(0.05)])


def test_free_solids_fall_onto_fixed_ones() -> None:
    """In addition to a robot, whose coordinates are unchanged; with the given mass."""
    table = Solid("table", Box([0.4, 0.4, 0.1]), [2.0, 0.0, 0.5])
    ball = Solid("ball", Sphere(0.05), [2.0, 0.0, 0.7], mass=3.0)
    made = plant(table, ball)
    q0, rest = panda().home(), np.zeros(7)
    tau = panda().state(0.0, q0, rest).nonlinear_effects.copy()
    for _ in range(2):  # a second run begins at the same state
        made.reset(0.0, q0, rest)
        q, v = made.advance(0.0, 0.1, tau)
        np.testing.assert_allclose(q, q0, atol=1e-9)
        log = made.log_channels(0.1, q, v, tau)
        height = log["plant.solid.ball.position"].value
        np.testing.assert_allclose(height, [2.0, 0.0, 0.7 - 9.81 * 0.005], atol=6e-4)
    made.advance(0.1, 0.6, tau)
    assert made.data.body("solid/ball/0").xpos[2] == pytest.approx(0.6, abs=1e-3)
    assert made.model.body("solid/ball/0").mass[0] == pytest.approx(3.0)


def test_a_plant_pushes_off_as_its_slowest_solid_does() -> None:
    """μ b d/(1 - d); the sliding contact is not known in advance."""
    box = Box([1.0, 1.0, 1.0])
    felt = Solid("felt", box, friction=0.8, slip_damping=10.0, impedance=0.5)
    steel = Solid("steel", box, friction=0.2)
    assert felt.push_off == pytest.approx(8.0)
    assert steel.push_off > 100.0
    for solids in ((felt, steel), (steel, felt)):
        assert plant(*solids).declared.push_off == felt.push_off
    assert plant().declared.push_off == 0.0


@pytest.mark.parametrize(("make", "message"), [
    (lambda: plant(Solid("wall", Box([1.0, 1.0, 1.0])), contacts=()),
     "solids: nothing may touch them: declare contacts"),
    (lambda: Solid("steps", Box([1.0, 1.0, 1.0]), copies=3),
     "3 copies have the spacing"),
    (lambda: Solid("floor", HalfSpace()), "shape: plane is not possible here"),
])  # fmt: skip
def test_impossible_solids(make: Any, message: str) -> None:
    with pytest.raises(SimulationError) as raised:
        make()
    assert message in str(raised.value)
