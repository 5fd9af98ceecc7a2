"""The view's layers agree with the run, recomputed independently."""

from time import thread_time
from types import SimpleNamespace
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
from clips import Clip, Recorder, reported

from hsp_control import (
    Controller,
    Experiment,
    FramePosition,
    Hold,
    Obstacle,
    ObstacleClearance,
    Robot,
    Rollout,
    load_experiment,
)
from hsp_control.companions.plots.analysis import (
    null_space_projector,
    terms_of_type,
)
from hsp_control.companions.viewer import ComparedRun, LiveView, Viewer, live
from hsp_control.companions.viewer.arrows import (
    ELLIPSOID_SECONDS,
    SECONDS,
    principal_axes,
)
from hsp_control.companions.viewer.clearances import capsules, influence, zone
from hsp_control.companions.viewer.commands import CAPTION, CLIP, unpack
from hsp_control.companions.viewer.comparison import Comparison
from hsp_control.companions.viewer.motion import RunMotion, motion_of
from hsp_control.companions.viewer.obstacles import _upward, obstacle
from hsp_control.companions.viewer.robot_drawing import RobotDrawing
from hsp_control.companions.viewer.run_drawing import LAYERS
from hsp_control.companions.viewer.targets import growing_paths
from hsp_control.geometry.shapes import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    HeightField,
    PointCloud,
    Shape,
    Sphere,
)
from hsp_control.null_space.fields import Clearance
from hsp_control.null_space.metrics import MetricSample

PLANAR, SPATIAL = "paper/4_moving_obstacle", "panda_obstacle"


@pytest.fixture(scope="module")
def planar() -> tuple[Experiment, Rollout]:
    experiment = load_experiment(PLANAR, "simulation.duration=1.5")
    return experiment, experiment.run()


@pytest.fixture(scope="module")
def spatial() -> tuple[Experiment, Rollout]:
    experiment = load_experiment(SPATIAL, "simulation.duration=0.5")
    return experiment, experiment.run()


def drawn(experiment: Experiment, rollout: Rollout, recorder: Recorder) -> Clip:
    viewer = Viewer(experiment.robot, transport=recorder)
    viewer.play(rollout, controller=experiment.controller)
    return Clip(recorder)


def legend(recorder: Recorder) -> list[dict[str, Any]]:
    caption = recorder.command(CAPTION, "caption")
    assert caption is not None
    return list(caption["legend"])


def names(recorder: Recorder) -> list[str]:
    return [entry["name"] for entry in legend(recorder)]


def bar_of(clip: Clip) -> str:
    """Return the path of the only distance bar; it has a ball at both of its ends."""
    (bar, end, start) = sorted(clip.paths("/distances"))
    parent = bar.rpartition("/")[0]
    assert [bar, end, start] == [f"{parent}/{x}" for x in ("bar", "end", "start")]
    for time in (clip.start, clip.end):
        assert clip.value(start, "visible", time) == clip.value(bar, "visible", time)
        origin = clip.value(bar, "position", time)
        np.testing.assert_allclose(clip.value(start, "position", time), origin)
        there = clip.value(end, "position", time)
        np.testing.assert_allclose(there, tip(clip, bar, time), atol=1e-5)
    return bar


def tip(clip: Clip, path: str, time: float) -> np.ndarray:
    """Return the end of an arrow or a bar."""
    length = clip.value(path, "scale", time)[2]
    return (clip.pose(path, time) @ [0.0, 0.0, length, 1.0])[:3]


# -- self-motion ----------------------------------------------------------------------


def test_self_motion_moves_the_joints_and_not_the_hand(
    planar: tuple[Experiment, Rollout], recorder: Recorder
) -> None:
    experiment, rollout = planar
    clip = drawn(experiment, rollout, recorder)
    arrows = clip.paths("/self_motion")
    assert arrows == {
        f"/self_motion/{kind}/joint{k}"
        for kind in ("velocity", "field")
        for k in (2, 3)
    }
    (seconds,) = [float(n.split()[2]) for n in names(recorder) if "self-motion" in n]
    robot, step = experiment.robot, 1e-6
    for row in (10, 60, 149):
        t, q, v = rollout.t[row], rollout.q[row], rollout.v[row]
        state = robot.state(t, q, v)
        g = experiment.controller.compute(state).field.g
        J = state.frame("tip").jacobian[:2]
        metric = experiment.controller.metric
        W = metric.evaluate(state, MetricSample.allocate(3)).W
        raised = np.linalg.solve(W, J.T)  # W⁻¹Jᵀ
        P = np.eye(3) - raised @ np.linalg.solve(J @ raised, J)
        for kind, motion in (("velocity", P @ v), ("field", P @ g)):
            moved = robot.integrate(q, step * motion)
            there = robot.state(t, moved, v)
            hand = there.position("tip") - state.position("tip")
            assert np.linalg.norm(hand) < 1e-9
            for joint in (2, 3):
                path = f"/self_motion/{kind}/joint{joint}"
                here = state.data.oMi[joint].translation
                rate = (there.data.oMi[joint].translation - here) / step
                np.testing.assert_allclose(
                    clip.value(path, "position", t), here, atol=1e-6
                )
                arrow = tip(clip, path, t) - here
                assert np.linalg.norm(arrow) <= 0.6 * 6.0
                np.testing.assert_allclose(arrow, seconds * rate, atol=1e-4)


def test_arrows_show_the_longest_time_in_which_they_fit(
    planar: tuple[Experiment, Rollout], recorder: Recorder
) -> None:
    """Fast ones, nine in ten rows, are 0.22 of the robot's size at most."""
    experiment, rollout = planar
    clip = drawn(experiment, rollout, recorder)
    (seconds,) = [float(n.split()[2]) for n in names(recorder) if "self-motion" in n]
    paths, times = clip.paths("/self_motion"), map(float, rollout.t)
    longest = [max(clip.value(path, "scale", t)[2] for path in paths) for t in times]
    fast = float(np.quantile(longest, 0.9)) / seconds
    most = 0.22 * motion_of(experiment.robot, rollout).size
    assert seconds == max(each for each in SECONDS if each * fast <= most)
    assert SECONDS[0] < seconds < SECONDS[-1]


def test_the_velocity_slips_into_its_field(
    planar: tuple[Experiment, Rollout], recorder: Recorder
) -> None:
    experiment, rollout = planar
    clip = drawn(experiment, rollout, recorder)
    (seconds,) = [float(n.split()[2]) for n in names(recorder) if "self-motion" in n]
    gaps = []
    for row in (0, 50, 100, 150):
        t = float(rollout.t[row])
        arrows = [
            tip(clip, f"/self_motion/{k}/joint3", t) for k in ("velocity", "field")
        ]
        gaps.append(np.linalg.norm(arrows[1] - arrows[0]))
        e_N = rollout["null_space_error"][row]
        state = experiment.robot.state(t, rollout.q[row], rollout.v[row])
        moved = experiment.robot.integrate(rollout.q[row], 1e-6 * e_N)
        there = experiment.robot.state(t, moved, rollout.v[row])
        rate = there.data.oMi[3].translation - state.data.oMi[3].translation
        assert gaps[-1] == pytest.approx(
            seconds * np.linalg.norm(rate) / 1e-6, abs=1e-4
        )
    assert gaps[-1] < 0.05 * gaps[0]


@pytest.mark.parametrize("name", ["panda_manipulability", "tiago_reach"])
def test_the_projector_is_the_laws_own(name: str) -> None:
    """In any metric P(g - v) is the e_N that the law computed."""
    experiment = load_experiment(name, "tasks.hand.largest_error=none")
    robot, controller = experiment.robot, experiment.controller
    rng = np.random.default_rng(4)
    for _ in range(5):
        q = robot.integrate(experiment.q0, 0.1 * rng.standard_normal(robot.nv))
        state = robot.state(0.3, q, rng.standard_normal(robot.nv))
        output = controller.compute(state)
        P = null_space_projector(controller, state)
        np.testing.assert_allclose(
            P @ (output.field.g - state.v), output.null_space_error, atol=1e-9
        )


# -- distances ------------------------------------------------------------------------


def test_bars_are_as_long_as_the_distances_in_the_log(
    spatial: tuple[Experiment, Rollout], recorder: Recorder
) -> None:
    experiment, rollout = spatial
    clip = drawn(experiment, rollout, recorder)
    path = bar_of(clip)
    assert recorder.command(path, "length label") is not None
    logged = rollout["distance.obstacle_clearance"]
    for row in (0, 20, 50):
        t = float(rollout.t[row])
        assert clip.value(path, "scale", t)[2] == pytest.approx(logged[row], abs=1e-6)
        seen = clip.value(path, "visible", t)
        assert bool(seen) == (logged[row] < 0.4)
        # It ends on the ball.
        end = tip(clip, path, t) - rollout["obstacle.ball"][row]
        assert np.linalg.norm(end) == pytest.approx(0.1, abs=1e-5)


# -- the links in distances -----------------------------------------------------------


def test_distances_end_on_the_capsules_that_are_measured(
    spatial: tuple[Experiment, Rollout], recorder: Recorder
) -> None:
    experiment, rollout = spatial
    clip = drawn(experiment, rollout, recorder)
    (term,) = terms_of_type(experiment.controller.field, Clearance)  # type: ignore[type-abstract]
    proximity = term.proximity(experiment.controller.state)
    measured = {i for i, _ in proximity.pairs}
    joints = {proximity.links[i].joint for i in measured}
    model_names = experiment.robot.model.names
    assert clip.paths("/capsules") == {f"/capsules/{model_names[j]}" for j in joints}
    # Initially off, with a row to switch them.
    (entry,) = [e for e in legend(recorder) if "(measured)" in e["name"]]
    assert entry["name"] == "capsules of the links (measured)"
    assert (entry["shown"], entry["paths"]) == (False, ["/capsules"])
    hidden = recorder.command("/capsules", "visible")
    assert hidden is not None
    assert hidden["value"] is False
    # The distance of the nearest drawn capsule to the ball is that in the log.
    for row in (0, 20, 50):
        t = float(rollout.t[row])
        ball = rollout["obstacle.ball"][row]
        gaps = []
        for joint in joints:
            path = f"/capsules/{model_names[joint]}"
            here = np.linalg.inv(clip.pose(path, t)) @ [*ball, 1.0]
            for start, end, radius in drawn_capsules(recorder, path):
                along = end - start
                share = (here[:3] - start) @ along / max(along @ along, 1e-12)
                nearest = start + np.clip(share, 0.0, 1.0) * along
                gaps.append(np.linalg.norm(here[:3] - nearest) - radius - 0.1)
        logged = rollout["distance.obstacle_clearance"][row]
        assert min(gaps) == pytest.approx(logged, abs=1e-5)


def drawn_capsules(
    recorder: Recorder, path: str
) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Return ends and radii of the capsules and spheres of a node, in its frame."""
    thing = recorder.command(path, "object")["object"]  # type: ignore[index]
    solids = {geometry["uuid"]: geometry for geometry in thing["geometries"]}
    found = []
    for child in thing["object"]["children"]:
        pose = np.reshape(child["matrix"], (4, 4)).T
        solid = solids[child["geometry"]]
        if solid["type"] == "SphereGeometry":
            ends, radius = [0.0, 0.0], solid["radius"]
        else:
            profile = np.array([[p["x"], p["y"]] for p in solid["points"]])
            radius = profile[:, 0].max()
            low, high = profile[[0, -1], 1]
            ends = [low + radius, high - radius]
        start, end = (pose @ [0.0, y, 0.0, 1.0] for y in ends)
        found.append((start[:3], end[:3], float(radius)))
    return found


def test_minimum_distances_of_limits_are_drawn_and_unmeasured_links_are_not(
    planar: tuple[Experiment, Rollout],
    spatial: tuple[Experiment, Rollout],
    recorder: Recorder,
) -> None:
    experiment, rollout = planar
    assert not drawn(experiment, rollout, recorder).paths("/capsules")
    assert not any("(measured)" in name for name in names(recorder))
    limits = "limits={barriers: [{type: self_distance}]}"
    kept = load_experiment(SPATIAL, limits, "null_space.fields=[{type: rest}]")
    layer = capsules(kept.controller, "/capsules")
    assert kept.controller.limits is not None
    (limit,) = kept.controller.limits.barriers
    shapes = limit.clearance.proximity(kept.controller.state)
    joints = {shapes.links[i].joint for pair in shapes.pairs for i in pair}
    nodes = {f"/capsules/{kept.robot.model.names[joint]}" for joint in joints}
    recorder.send(layer.draw(1.0))
    assert set(recorder.paths("/capsules")) == nodes
    motion = motion_of(kept.robot, spatial[1])
    moved = {track.path for track in layer.tracks(motion)}
    assert moved == nodes - {"/capsules/universe"}  # the base: in distances, but fixed
    assert moved < nodes


# -- influence ------------------------------------------------------------------------


def surface_points(thing: dict[str, Any]) -> np.ndarray:
    """Return points of a drawn solid in its obstacle's frame."""
    (geometry,) = thing["geometries"]
    pose = np.reshape(thing["object"]["children"][0]["matrix"], (4, 4)).T
    kind = geometry["type"]
    if kind == "SphereGeometry":
        directions = np.random.default_rng(0).standard_normal((100, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        points = geometry["radius"] * directions
    elif kind == "LatheGeometry":
        profile = np.array([[p["x"], p["y"]] for p in geometry["points"]])
        angles = np.linspace(0.0, 2.0 * np.pi, 12)[:, None]
        points = np.stack(
            [
                profile[:, 0] * np.cos(angles),
                np.broadcast_to(profile[:, 1], (12, len(profile))),
                -profile[:, 0] * np.sin(angles),
            ],
            axis=-1,
        ).reshape(-1, 3)
    elif kind == "PlaneGeometry":
        points = (
            0.5 * geometry["width"] * np.array([[1, 1, 0], [-1, 1, 0], [1, -1, 0.0]])
        )
    else:
        data = geometry["data"]["attributes"]["position"]["array"].data
        points = np.frombuffer(data, "<f4").reshape(-1, 3).astype(float)
    return points @ pose[:3, :3].T + pose[:3, 3]


ZONES: list[tuple[Shape, float]] = [
    (Sphere(0.1), 1e-9),
    (Capsule(0.1, 0.3), 1e-9),
    (Cylinder(0.1, 0.3), 1e-9),
    (HalfSpace(), 1e-9),
    (Box((0.1, 0.2, 0.3)), 3e-3),
    (PointCloud([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]], 0.01), 0.02),
    (HeightField((1.0, 1.0), [[0.0, 0.1], [0.1, 0.2]]), 0.05),
]


@pytest.mark.parametrize(
    ("shape", "slack"), ZONES, ids=lambda x: type(x).__name__ if x else ""
)
def test_a_zone_lies_at_the_influence_from_its_obstacle(
    shape: Shape, slack: float
) -> None:
    influence = 0.2
    points = surface_points(zone(shape, influence, 0.5))
    point, geometry = coal.Sphere(1e-6), shape.geometry()
    request = coal.DistanceRequest()
    for place in points[:: max(1, len(points) // 60)]:
        distance = coal.distance(
            geometry,
            coal.Transform3s(),
            point,
            coal.Transform3s(np.eye(3), place),
            request,
            coal.DistanceResult(),
        )
        assert distance == pytest.approx(influence, abs=slack + 2e-6)


def test_the_points_of_a_cloud_are_cubes_of_its_resolution() -> None:
    cloud = PointCloud([[0.0, 0, 0], [0.1, 0, 0.4]], 0.02)
    points = surface_points(obstacle(cloud, 1.0, upward=1.0))
    np.testing.assert_allclose(points.min(axis=0), [-0.01] * 3, atol=1e-7)
    np.testing.assert_allclose(points.max(axis=0), [0.11, 0.01, 0.41], atol=1e-7)


@pytest.mark.parametrize("reaches", [(0.3, 0.1), (0.1, 0.3)])
def test_the_zone_of_two_fields_is_that_of_the_farther_one(
    reaches: tuple[float, float],
) -> None:
    robot, shape = Robot.load("panda"), Sphere(0.1)
    ball = Obstacle("ball", shape, Hold([0.6, 0.0, 0.6]))
    first, second = (
        ObstacleClearance(["ball"], influence=reach, name=f"within {reach}")
        for reach in reaches
    )
    hand = FramePosition("panda_tcp", name="hand")
    made = Controller(robot, [hand], first + second, scene=[ball])
    layer = influence(made.field, {"ball": shape}, "/influence")
    (entry,) = layer.legend()
    assert entry.name == "influence zone 0.3 m"
    assert entry.paths == ("/influence/ball",)


def test_a_wall_is_seen_and_a_floor_does_not_glare() -> None:
    """A half-space is a wall where its z axis is nearly horizontal, also in a log."""
    experiment = load_experiment("ur5_position", "simulation.duration=0.02")
    motion = motion_of(experiment.robot, experiment.run())
    assert _upward("board", motion) == pytest.approx(0.0, abs=1e-6)
    shades = [
        obstacle(HalfSpace(), 1.0, upward=upward)["materials"][0]["opacity"]
        for upward in (-1.0, 0.0, 1.0)
    ]
    assert shades[1] > 3.0 * shades[0]
    assert shades[0] == shades[2]


# -- the ellipsoid --------------------------------------------------------------------


def test_the_ellipsoid_is_the_image_of_the_ball_of_joint_speeds(
    spatial: tuple[Experiment, Rollout], recorder: Recorder
) -> None:
    experiment, rollout = spatial
    clip = drawn(experiment, rollout, recorder)
    (path,) = clip.paths("/ellipsoid")
    frame = path.rpartition("/")[2]
    for row in (0, 25, 50):
        t = float(rollout.t[row])
        state = experiment.robot.state(t, rollout.q[row], rollout.v[row])
        J = state.frame(frame).jacobian[:3]
        R, scale = clip.pose(path, t)[:3, :3], clip.value(path, "scale", t)
        shape = R @ np.diag(scale**2) @ R.T / ELLIPSOID_SECONDS**2
        np.testing.assert_allclose(shape, J @ J.T, atol=1e-5)


# -- contacts -------------------------------------------------------------------------


def test_contact_forces_are_arrows_at_their_points(recorder: Recorder) -> None:
    robot = Robot.load("panda")
    mass = sum(inertia.mass for inertia in robot.model.inertias)
    weight = np.array([0.0, 0.0, 9.81 * mass])
    columns = {
        "t": np.array([0.0, 0.02]),
        "q": np.tile(robot.home(), (2, 1)),
        "v": np.zeros((2, robot.nv)),
        # The position of an inactive contact is not in the log.
        "contact.left/foot.position": np.array([[0.1, 0.2, 0.3], [np.nan] * 3]),
        "contact.left/foot.force": np.array([weight, np.zeros(3)]),
        "contact.halved.force": np.zeros((2, 3)),  # without its position: omitted
    }
    viewer = Viewer(robot, transport=recorder)
    viewer.play(Rollout(columns, {"status": "completed"}))
    clip = Clip(recorder)
    assert clip.paths("/contacts") == {
        "/contacts/left_foot/force", "/contacts/left_foot/point",
    }  # fmt: skip
    path = "/contacts/left_foot/force"
    np.testing.assert_allclose(clip.value(path, "position", 0.0), [0.1, 0.2, 0.3])
    arrow = tip(clip, path, 0.0) - [0.1, 0.2, 0.3]
    assert arrow[2] > 0.2
    assert np.abs(arrow[:2]).max() < 1e-6
    assert clip.value(path, "scale", 0.02)[2] == 0.0
    assert clip.value("/contacts/left_foot/point", "visible", 0.0) == 1.0
    assert clip.value("/contacts/left_foot/point", "visible", 0.02) == 0.0
    assert "contact force" in names(recorder)


# -- switches -------------------------------------------------------------------------


def test_each_layer_can_be_switched(
    spatial: tuple[Experiment, Rollout], recorder: Recorder
) -> None:
    experiment, rollout = spatial
    off = dict.fromkeys([*LAYERS, "grid"], False)
    viewer = Viewer(experiment.robot, transport=recorder, show=off)
    viewer.play(rollout, controller=experiment.controller)
    rows = {entry["name"]: entry for entry in legend(recorder)}
    on = {name for name, row in rows.items() if row["shown"]}
    assert on == {"robot", "shadow"}  # these have no setting
    for row in rows.values():
        assert row["paths"]
        for path in row["paths"]:
            command = recorder.command(path, "visible")
            assert row["shown"] == (command is None)
            assert command is None or command["value"] is False
    assert Clip(recorder).paths("/self_motion")  # present, to be switched on


# -- several runs ---------------------------------------------------------------------


def comparison(
    planar: tuple[Experiment, Rollout], recorder: Recorder, **how: Any
) -> tuple[Clip, Rollout]:
    experiment, rollout = planar
    other = load_experiment("paper/2_rest", "simulation.duration=0.5")
    rest = other.run()
    viewer = Viewer(experiment.robot, transport=recorder)
    acts = [
        ComparedRun("with", experiment.robot, rollout, experiment.controller),
        ComparedRun("without", other.robot, rest, other.controller),
    ]
    viewer.compare(acts, **how)
    return Clip(recorder), rest


def shown_seconds(recorder: Recorder) -> list[float]:
    return [float(n.split()[2]) for n in names(recorder) if "self-motion" in n]


def test_the_arrows_of_compared_runs_have_one_scale(
    planar: tuple[Experiment, Rollout],
) -> None:
    """Of the faster run, whose arrows fit in less time."""
    experiment, rollout = planar
    columns = {name: column.copy() for name, column in rollout.columns.items()}
    slow = Rollout(columns, rollout.meta)
    slow["field.g"][:] *= 0.02
    slow.v[:] *= 0.02
    robot, law = experiment.robot, experiment.controller
    runs = [
        ComparedRun("slow", robot, slow, law),
        ComparedRun("as", robot, rollout, law),
    ]
    alone = []
    for run in runs:
        recorder = Recorder()
        drawn(experiment, run.rollout, recorder)
        alone += shown_seconds(recorder)
    assert alone[0] > alone[1]
    for order in (runs, runs[::-1]):
        recorder = Recorder()
        Viewer(robot, transport=recorder).compare(order, beside=True)
        assert set(shown_seconds(recorder)) == {alone[1]}


def test_three_robots_stand_at_equal_distances(
    planar: tuple[Experiment, Rollout], recorder: Recorder
) -> None:
    experiment, rollout = planar
    runs = [ComparedRun(name, experiment.robot, rollout, None) for name in "abc"]
    Viewer(experiment.robot, transport=recorder).compare(runs, beside=True)
    second, third = (recorder.transform(f"/{name}")[:3, 3] for name in "bc")
    assert np.linalg.norm(second) > 1.0
    np.testing.assert_allclose(third, 2.0 * second, rtol=1e-9)


def test_runs_of_one_robot_lie_over_each_other_as_ghosts(
    planar: tuple[Experiment, Rollout], recorder: Recorder
) -> None:
    clip, rest = comparison(planar, recorder)
    assert (clip.start, clip.end) == (0.0, 1.5)
    assert recorder.command("/without/robot", "ghost") is not None
    assert recorder.paths("/without/paths/") == ["/without/paths/tip/actual"]
    np.testing.assert_array_equal(recorder.transform("/without"), np.eye(4))
    robot = planar[0].robot
    for row in (0, 30, 50):
        expected = robot.state(0.0, rest.q[row], rest.v[row]).data.oMi[2].homogeneous
        shown = clip.pose("/without/robot/joint2", float(rest.t[row]))
        np.testing.assert_allclose(shown, expected, atol=1e-6)
    last = clip.pose("/without/robot/joint2", 1.5)  # it waits for the longer run
    np.testing.assert_array_equal(last, clip.pose("/without/robot/joint2", 0.5))
    first, second, *others = legend(recorder)
    assert (first["name"], second["name"]) == ("with", "without")
    assert set(first["paths"]) == {"/paths/tip/actual", "/robot"}
    assert second["paths"] == ["/without"]
    assert "robot" not in {entry["name"] for entry in others}


# -- live -----------------------------------------------------------------------------


class Watched(Recorder):
    """Records sent messages, too."""

    def __init__(self) -> None:
        super().__init__()
        self.sent: list[dict[str, Any]] = []

    def send(self, commands: Any) -> None:
        commands = list(commands)
        super().send(commands)
        self.sent += [unpack(command.packed) for command in commands]


@pytest.mark.slow
@pytest.mark.parametrize("start", [0.0, 100.0])
def test_a_run_is_shown_while_it_is_computed(
    start: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "MIN_PERIOD", 0.0)
    monkeypatch.setattr(live, "MAX_PERIOD", 0.0)
    experiment = load_experiment(
        PLANAR, "simulation.duration=0.5", f"simulation.start_time={start}"
    )
    transport = Watched()
    viewer = Viewer(experiment.robot, transport=transport)
    view = LiveView(viewer, experiment)
    # The whole desired path is present before the first step.
    desired = transport.command("/paths/tip/desired", "object")
    assert desired is not None
    del transport.sent[:]
    rollout = experiment.run(on_row=view.on_row)

    clips = [command for command in transport.sent if command["type"] == "clip"]
    assert [clip["begins"] for clip in clips] == [True] + [False] * (len(clips) - 1)
    assert all(clip["open"] and clip["horizon"] == start + 0.5 for clip in clips[:-1])
    assert {clip["start"] for clip in clips} == {start}
    printed = [c["text"] for c in transport.sent if c["type"] == "status"]
    assert any("× real time" in text for text in printed)
    times = np.concatenate([clip["clocks"][0] for clip in clips])
    # every piece begins at the end of the previous one
    assert (np.diff(times) >= 0.0).all()
    assert (times[0], times[-1]) == (start, start + 0.5)
    joint = np.concatenate(
        [
            np.reshape(track["values"], (-1, 4))
            for clip in clips
            for track in clip["tracks"]
            if (track["path"], track["property"]) == ("/robot/joint1", "quaternion")
        ]
    )
    rows = np.searchsorted(rollout.t, times - 1e-9)
    for row, quaternion in zip(rows, joint, strict=True):
        state = experiment.robot.state(0.0, rollout.q[row], rollout.v[row])
        expected = pin.SE3ToXYZQUAT(state.data.oMi[1])[3:]
        assert abs(quaternion @ expected) == pytest.approx(1.0, abs=1e-6)
    trail = reported(transport, "/paths/tip/actual", "object")["points"]
    assert len(trail) == 3 * len(np.unique(times))

    view.finish(rollout)
    begin = transport.command(CLIP, "begin")
    assert begin is not None
    assert begin["keep"]
    assert not begin["open"]
    # one clip of the whole run is kept
    assert transport.command(CLIP, "more 1") is None
    assert Clip(transport).value("/paths/tip/actual", "length", start + 0.5) == 50


def test_a_view_that_ends_does_not_end_the_run(
    caplog: pytest.LogCaptureFixture,
) -> None:
    experiment = load_experiment(PLANAR, "simulation.duration=0.5")
    with Viewer(experiment.robot) as viewer:
        view = LiveView(viewer, experiment)
        viewer.close()
        rollout = experiment.run(on_row=view.on_row)
    assert rollout.status == "completed"
    assert "the run continues without a view" in caplog.text


def test_the_plots_come_every_second_whatever_the_first_ones_took(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first picture needs imports; afterwards drawing takes a hundredth."""
    now, cpu, drawn = 0.0, 0.0, list[float]()

    def plots(*_: object) -> dict[str, Any]:
        nonlocal cpu
        cpu += 1 / 64 if drawn else 0.25
        drawn.append(now)
        return {}

    def row(recorder: Any) -> None:
        nonlocal now
        now += 0.25
        view.on_row(recorder)

    clock = SimpleNamespace(perf_counter=lambda: now, thread_time=lambda: cpu)
    monkeypatch.setattr(live, "time", clock)
    monkeypatch.setattr(live, "plots_so_far", plots)
    monkeypatch.setattr(Viewer, "has_plots", True)
    experiment = load_experiment(PLANAR, "simulation.duration=0.3")
    viewer = Viewer(experiment.robot, transport=Recorder())
    monkeypatch.setattr(viewer, "show_plots", lambda _: None)
    view = LiveView(viewer, experiment)
    experiment.run(on_row=row)
    first, second, third = drawn[:3]
    assert second - first == 1.0
    assert third - second == 1.75  # 100 / 64 s, and then the next row


def test_the_axes_of_an_ellipsoid_are_a_rotation_that_does_not_jump() -> None:
    """Mirrored axes are no rotation; and the nearest order of the axes is kept."""
    rng, last = np.random.default_rng(0), np.eye(3)
    J = rng.standard_normal((3, 7))
    for size in [0.02] * 100 + [1.0] * 100:
        J = J + size * rng.standard_normal((3, 7))
        axes, lengths = principal_axes(J, last)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        squares = axes @ np.diag(lengths**2) @ axes.T
        np.testing.assert_allclose(squares, J @ J.T, atol=1e-10)
        last = axes


def test_the_frame_axes_are_those_of_the_tasks_frames(
    spatial: tuple[Experiment, Rollout], recorder: Recorder
) -> None:
    experiment, rollout = spatial
    clip = drawn(experiment, rollout, recorder)
    data, model = experiment.robot.model.createData(), experiment.robot.model
    frame = experiment.robot.frame_id("panda_tcp")
    target = rollout["task.hand.reference"]
    for row in (0, len(rollout) - 1):
        pin.forwardKinematics(model, data, rollout.q[row])
        place = pin.updateFramePlacement(model, data, frame).homogeneous
        here = clip.pose("/frames/here/panda_tcp", rollout.t[row])
        np.testing.assert_allclose(here, place, atol=1e-9)
        there = clip.pose("/frames/target/hand", rollout.t[row])
        wanted = pin.XYZQUATToSE3(target[row]).homogeneous
        np.testing.assert_allclose(there, wanted, atol=1e-9)
    (row,) = (entry for entry in legend(recorder) if entry["key"] == "f")
    assert row["name"] == "Frame axes: panda_tcp"
    assert not row["shown"]


def test_obstacles_of_runs_side_by_side_stand_beside_their_robots() -> None:
    """The camera must see those of the second robot, too."""
    experiment = load_experiment(PLANAR, "simulation.duration=0.1")
    robot, run = experiment.robot, experiment.run()
    both = Comparison(
        RobotDrawing(robot), [ComparedRun(name, robot, run) for name in "ab"],
        shown={}, beside=np.array([1.0, 0.0, 0.0]), dark=False,
    )  # fmt: skip
    shifts = []
    for points in (both.points(), both.obstacle_points()):
        first, second = np.split(points, 2)
        shifts.append(second - first)
        assert shifts[-1].min(axis=0)[0] > 1.0
    np.testing.assert_allclose(
        shifts[1], np.broadcast_to(shifts[0][0], shifts[1].shape)
    )


def test_compared_runs_are_shown_from_the_first_start_to_the_last_end() -> None:
    experiment = load_experiment(PLANAR, "simulation.duration=0.1")
    robot, run = experiment.robot, experiment.run()
    late = Rollout({**run.columns, "t": run.t + 2.0}, run.meta)
    for order in ((run, late), (late, run)):
        runs = [ComparedRun(str(k), robot, each) for k, each in enumerate(order)]
        clip = Comparison(
            RobotDrawing(robot), runs, shown={}, beside=None, dark=False
        ).clip()
        assert (clip.start, clip.end) == (0.0, late.t[-1])


def test_a_half_space_that_turns_is_drawn_as_it_is_at_the_start() -> None:
    wall, floor = [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)], [0.0, 0.0, 0.0, 1.0]
    for turns, upward in (([wall, floor], 0.0), ([floor, wall], 1.0)):
        columns = {"t": np.arange(2.0), "obstacle.board.quaternion": np.array(turns)}
        motion = RunMotion(Robot.load("planar3r"), Rollout(columns, {}))
        assert _upward("board", motion) == pytest.approx(upward, abs=1e-12)


def test_a_growing_path_goes_on_from_its_last_point() -> None:
    experiment = load_experiment(PLANAR, "simulation.duration=0.2")
    run, robot = experiment.run(), experiment.robot
    layer, extend = growing_paths(RunMotion(robot, run), "/paths")
    list(layer.draw(1.0))
    for first, last in ((0, 10), (10, 20)):  # each piece begins with a known row
        rows = {name: each[first : last + 1] for name, each in run.columns.items()}
        piece = RunMotion(robot, Rollout(rows, run.meta))
        (track,) = layer.tracks(piece)
        assert track.values.ravel().tolist() == [*range(first, last + 1)]
        list(extend(piece))


def test_the_pace_of_a_run_is_its_time_over_the_wall_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [100.0]
    clock = SimpleNamespace(perf_counter=lambda: now[-1], thread_time=thread_time)
    monkeypatch.setattr(live, "time", clock)
    experiment = load_experiment(PLANAR, "simulation.duration=0.5")
    viewer, said = Viewer(experiment.robot, transport=Recorder()), list[str]()
    monkeypatch.setattr(viewer, "replace_run", lambda *given: said.append(given[-1]))
    view = LiveView(viewer, experiment)
    run = experiment.run(on_row=view.on_row)
    now.append(100.125)
    view.finish(run)
    assert said == ["computed at 4.0 × real time"]


def test_the_pace_of_a_run_that_begins_late_counts_from_its_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = iter(100.0 + 0.01 * np.arange(10_000))  # a hundredth of a second a row
    now = SimpleNamespace(perf_counter=lambda: next(clock), thread_time=thread_time)
    monkeypatch.setattr(live, "time", now)
    for name in ("MIN_PERIOD", "MAX_PERIOD"):
        monkeypatch.setattr(live, name, 0.0)
    experiment = load_experiment(
        PLANAR, "simulation.duration=0.2", "simulation.start_time=50"
    )
    transport = Watched()
    view = LiveView(Viewer(experiment.robot, transport=transport), experiment)
    experiment.run(on_row=view.on_row)
    said = [c["text"] for c in transport.sent if c["type"] == "status"]
    assert said[-1] == "computing at 1.0 × real time"
