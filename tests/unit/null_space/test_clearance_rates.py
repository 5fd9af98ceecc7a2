"""Gradient and rate of the clearance fields on whole robots and in the loop.

The closed loop is decisive: ‖e_N‖ follows exp(-K_N t) only if the field's rate includes
every motion.
"""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clearance_cases import AIR, agree, barrier_at, flowing, turned
from loaded_robots import load
from odd_robots import FACES, OCTAHEDRON, write_stl
from oracles import gradient
from places import covering
from states import moved

from hsp_control import Controller, Cost, FramePosition, Gains, Obstacle, simulate
from hsp_control.common.arrays import Array
from hsp_control.geometry import Proximity, link_shapes, shapes
from hsp_control.null_space.fields import ObstacleClearance
from hsp_control.robot import Dop853
from hsp_control.robot.integrators import Integrator
from hsp_control.trajectories import Hold, HoldOrientation, Lissajous, Spin

# --- gradient and rate on whole robots -----------------------------------------------


LOW = Lissajous([0.1, 0.15, 0.05], [1.0, 2.0, 1.5], center=[0.1, 0.2, -0.15])
TURNING = Spin([0.0, 0.6, 0.8], 0.7, rotation=turned(0.3, 0.4, 0.5))
RIPPLES = (
    0.1
    * np.sin(3.0 * np.linspace(-1.0, 1.0, 9))[None, :]
    * np.cos(2.0 * np.linspace(-1.0, 1.0, 9))[:, None]
)
CLOUD = 0.5 * OCTAHEDRON
OBSTACLES: dict[str, Callable[[Path], Obstacle]] = {
    "sphere": lambda _: Obstacle("it", shapes.Sphere(0.15), AIR, TURNING),
    "point": lambda _: Obstacle("it", shapes.Sphere(0.0), AIR, TURNING),
    "capsule": lambda _: Obstacle("it", shapes.Capsule(0.08, 0.3), AIR, TURNING),
    "cylinder": lambda _: Obstacle("it", shapes.Cylinder(0.1, 0.3), AIR, TURNING),
    "box": lambda _: Obstacle("it", shapes.Box((0.2, 0.3, 0.25)), AIR, TURNING),
    "plane": lambda _: Obstacle(
        "it", shapes.HalfSpace(), LOW, HoldOrientation(turned(0.1, 0.1, 0.0))
    ),
    "mesh": lambda octa: Obstacle("it", shapes.Mesh(octa), AIR, TURNING),
    "hull": lambda octa: Obstacle("it", shapes.Mesh(octa, convex=True), AIR, TURNING),
    "cloud": lambda _: Obstacle(
        "it", shapes.PointCloud(CLOUD.tolist(), 0.02), AIR, TURNING
    ),
    "height field": lambda _: Obstacle(
        "it", shapes.HeightField((2.0, 2.0), RIPPLES.tolist()), LOW
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), covering(OBSTACLES, ["panda", "iiwa14"]))
def test_gradient_and_rate_for_every_shape(
    name: str, kind: str, tmp_path: Path
) -> None:
    """Against differences of the value, and of the gradient along the flow in time.

    Where the nearest feature changes, between caps and side or face and edge, the rate
    jumps, and differences across the jump are wrong: they disagree with those of half
    the step, and the state is skipped. Only few may be, or the test would be void.
    """
    robot = load(name)
    octa = write_stl(tmp_path / "octa.stl", OCTAHEDRON, FACES)
    obstacle = OBSTACLES[kind](octa)
    links = [n for n in (s.link for s in link_shapes(robot)) if n[-1] not in "01"]
    field = ObstacleClearance([obstacle], influence=0.3, links=links)
    rng = np.random.default_rng([11, *kind.encode()])
    agreed = passed_over = 0
    while agreed < 5:
        q, v = robot.random_configuration(rng), 0.5 * rng.normal(size=robot.nv)
        state = robot.state(0.7, q, v)
        if not 0.06 < field.minimum_distance(state) < 0.25:
            continue
        g, g_dot = field.gradient(state), field.gradient_rate(state)

        def value(x: Array, q: Array = q, v: Array = v) -> float:
            return field.value(moved(robot, 0.7, robot.integrate(q, x), v))

        by_value = [gradient(value, robot.nv, h) for h in (1e-3, 5e-4)]
        by_flow = [flowing(field, state, h) for h in (1e-3, 5e-4)]
        if not (agree(*by_value) and agree(*by_flow)):
            passed_over += 1
            continue
        agreed += 1
        # A barrier at d > 0.06 m by steps of 5e-4 rad m: (5e-4/0.06)⁶ · 7!/140 = 1e-11;
        # the field's own rate, of fourth order by 1e-3: (1e-3/0.06)⁴ · 5!/30 = 3e-7 at
        # worst, 1e-9 at larger d and lower speed.
        scale = float(np.abs(g).max())
        np.testing.assert_allclose(g, by_value[1], rtol=0, atol=1e-9 * scale)
        scale = float(np.abs(g_dot).max())
        np.testing.assert_allclose(g_dot, by_flow[1], rtol=0, atol=3e-8 * scale)
        assert scale > 1e-2
    assert passed_over <= 5, f"{passed_over} states near an edge"


def test_gradient_by_hulls_is_as_good_as_gjk() -> None:
    """The Panda's cylinders and a cylinder: 1e-4, with Coal's own tolerance 1e-2."""
    robot = load("panda")
    obstacle = Obstacle("it", shapes.Cylinder(0.1, 0.3), AIR, TURNING)
    field = ObstacleClearance([obstacle], influence=0.4, proxy="hulls")
    rng = np.random.default_rng(16)
    agreed = 0
    while agreed < 8:
        q = robot.random_configuration(rng)
        state = robot.state(0.7, q, np.zeros(7))
        if not 0.06 < field.minimum_distance(state) < 0.3:
            continue
        agreed += 1

        def value(x: Array, q: Array = q) -> float:
            return field.value(robot.state(0.7, q + x, np.zeros(7)))

        expected = gradient(value, 7, 1e-3)
        scale = float(np.abs(expected).max())
        np.testing.assert_allclose(
            field.gradient(state), expected, rtol=0, atol=2e-4 * scale
        )


def test_a_floor_has_no_edge_where_links_lie_level() -> None:
    """A capsule parallel to the floor switches its lower end; a row of balls does not.

    The forearm rotates through the horizontal, where with capsules the gradient jumps
    by a third within a step.
    """
    robot = load("panda")
    floor = Obstacle("floor", shapes.HalfSpace(), Hold([0.0, 0.0, 0.0]))
    field = ObstacleClearance([floor], influence=0.9, links=["panda_link5"])
    links = [s for s in link_shapes(robot) if s.link == "panda_link5"]
    capsules = Proximity(
        robot, links, [floor], [(k, len(links)) for k in range(len(links))]
    )

    def jump(of: Callable[[Any], Array]) -> float:
        gradients = [
            of(robot.state(0.0, np.array([0, 0.3, 0, a, 0, 1, 0]), np.zeros(7))).copy()
            for a in np.linspace(-1.3, -1.2, 201)
        ]
        steps = [float(np.abs(b - a).max()) for a, b in pairwise(gradients)]
        return max(steps) / float(np.abs(gradients).max())

    def by_capsules(state: Any) -> Array:
        slopes = np.array(
            [barrier_at(float(d), 0.9)[1] for d in capsules.measure(state)]
        )
        return capsules.gradient(state, slopes)

    assert jump(by_capsules) > 0.2
    assert jump(field.gradient) < 0.01


# --- the loop closed -----------------------------------------------------------------


PASSING = Lissajous([0.1, 0.1, 0.2], [2.0, 3.0, 2.5], center=[0.1, 0.45, 0.7])
LOOPS = {
    "ball": Obstacle("ball", shapes.Sphere(0.1), PASSING),
    "box": Obstacle("box", shapes.Box((0.2, 0.15, 0.25)), PASSING,
     Spin([0.0, 0.6, 0.8], 1.0, rotation=np.eye(3))),
    "floor": Obstacle("floor", shapes.HalfSpace(),
     Lissajous([0.0, 0.0, 0.05], [0.0, 0.0, 3.0], center=[0.0, 0.0, 0.15]),
     HoldOrientation(turned(0.2, -0.1, 0.0))),
}  # fmt: skip
GAIN = 5.0


def run(
    field: Cost, duration: float, integrator: Integrator
) -> tuple[Array, Array, Any]:
    """Return ‖e_N‖ and its prediction while the hand is held, from rest."""
    robot = load("panda")
    hand = "panda_tcp"
    hold = FramePosition(hand, Hold(), gains=Gains(100, 20))
    rollout = simulate(
        Controller(robot, [hold], field, null_space_gain=GAIN),
        robot.home(),
        duration=duration,
        log_period=0.02,
        integrator=integrator,
    )
    norm = rollout["null_space_norm"]
    return norm, norm[0] * np.exp(-GAIN * rollout.t), rollout


@pytest.mark.slow
@pytest.mark.parametrize("which", LOOPS)
def test_the_null_space_error_is_exponential_beside_a_moving(which: str) -> None:
    """‖e_N‖ = ‖e_N(0)‖ exp(-K_N t), to 1e-6 of its start, while the obstacle passes.

    The rate jumps where the nearest point moves from a capsule's side to its end, and
    where the links' balls roll over the edges of a rotating box; the exponential does
    not, as an integrator with shorter steps there shows: 3e-7.
    """
    robot = load("panda")
    # Without the shoulder, which is in the floor permanently.
    links = [s.link for s in link_shapes(robot) if s.joint > 2]
    field = ObstacleClearance([LOOPS[which]], influence=0.3, links=links)
    norm, expected, rollout = run(field, 1.2, Dop853(1e-9, 1e-9))
    assert norm[0] > 0.1
    np.testing.assert_allclose(norm, expected, rtol=0, atol=1e-6 * norm[0])
    # the field was active throughout
    assert np.abs(rollout["field.g"][30:]).max() > 0.5
    assert rollout["distance.obstacle_clearance"].min() > 0.05
    assert np.abs(rollout["task.panda_tcp.error"]).max() < 1e-8
