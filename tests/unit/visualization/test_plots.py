"""Figures: what is drawn is what the log says, and it can be read."""

import itertools
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pinocchio as pin
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle
from matplotlib.text import Text

import hsp_control.visualization.plots as plots
from hsp_control import (
    ConstantMetric,
    Controller,
    FrameOrientation,
    FramePose,
    FramePosition,
    Gains,
    Hold,
    JointPosture,
    MassMatrixMetric,
    Obstacle,
    Pointing,
    Rest,
    Robot,
    Rollout,
    Scene,
    TargetPosture,
    Task,
    load_experiment,
    simulate,
)
from hsp_control.common.exceptions import PlotError
from hsp_control.common.resources import bundled_configs
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
from hsp_control.simulation import log_series
from hsp_control.simulation.decay import predicted_decay
from hsp_control.trajectories import (
    Circle as Round,
)
from hsp_control.trajectories import (
    ComposedPose,
    HoldOrientation,
    Lissajous,
    Spin,
)
from hsp_control.visualization import palette
from hsp_control.visualization.plots import bodies, box, paths, views, world

pytestmark = pytest.mark.filterwarnings("error")
A = np.tril(np.ones((3, 3)))
SHADOW = mpl.colors.to_rgba(palette.SHADOW)
GAINS = Gains(100.0, 20.0)
NAMES = ("uncontrolled", "rest", "obstacle", "space", "pose", "several", "posture")
PAPER = {"uncontrolled": 1, "rest": 2, "equal": 3, "obstacle": 4}
DURATION = {3: 10.0}  # [s]; the others run for 1 s


def planar(number: int) -> Rollout:
    (name,) = (name for name in bundled_configs() if f"paper/{number}_" in name)
    return load_experiment(
        name, f"simulation.duration={DURATION.get(number, 1.0)}"
    ).run()


@dataclass
class Arm:
    """A Panda at home, and what it can be asked to do."""

    robot: Robot = field(default_factory=lambda: Robot.load("panda"))
    tcp: str = "panda_tcp"

    def __post_init__(self) -> None:
        self.q0 = self.robot.home()
        frame = self.robot.state(0.0, self.q0, np.zeros(7)).frame(self.tcp)
        self.position, self.rotation = frame.position.copy(), frame.rotation.copy()

    def circle(self, normal: list[float]) -> Round:
        return Round(self.position, 0.1, 2.0, normal=normal)

    def run(self, *tasks: Task, scene: Scene | None = None, **settings: Any) -> Rollout:
        posture = TargetPosture(self.robot, self.q0 + 0.1)
        controller = Controller(self.robot, tasks, posture, **settings)
        return simulate(controller, self.q0, duration=0.5, scene=scene)


def spatial() -> dict[str, Rollout]:
    arm = Arm()
    robot, tcp = arm.robot, arm.tcp
    tilted = FramePosition(robot, tcp, arm.circle([1.0, 0.0, 1.0]), GAINS)
    center = Lissajous([0.3, -0.3, 0.5], [0.0, 0.1, 0.1], [0, 2, 3], [0, 0, 0])
    spin = Spin(arm.rotation, [0.0, 0.0, 1.0], 0.3)
    pose = FramePose(robot, tcp, ComposedPose(arm.circle([1.0, 0.0, 0.0]), spin), GAINS)
    aside = Spin(arm.rotation @ pin.utils.rotate("x", 0.4), [0, 0, 1], 1.0)
    xz = FramePosition(
        robot, tcp, Hold(arm.position[[0, 2]]), GAINS, axes="xz", name="xz"
    )
    pointing = Pointing(robot, tcp, [0, 0, 1], aside, GAINS)
    joints = ["panda_joint1", "panda_joint2"]
    posture = JointPosture(robot, arm.q0 + 0.1, GAINS, joints=joints)
    turned = FrameOrientation(
        robot, "panda_link5", HoldOrientation(np.eye(3)), GAINS, name="turn"
    )
    return {
        "space": arm.run(
            tilted,
            scene=Scene([Obstacle("ball", Sphere(0.07), center)]),
            null_space_gain=np.linspace(5.0, 15.0, 7),
        ),
        "pose": arm.run(pose, metric=MassMatrixMetric()),
        "several": arm.run(xz, pointing),
        "posture": arm.run(posture, turned),
    }


@pytest.fixture(scope="module")
def logs() -> dict[str, Rollout]:
    return {name: planar(number) for name, number in PAPER.items()} | spatial()


@pytest.fixture(params=NAMES)
def log(logs: dict[str, Rollout], request: pytest.FixtureRequest) -> Rollout:
    return logs[request.param]


SHOWN = ("equal", "obstacle", "space", "several", "posture")


@pytest.fixture(scope="module")
def drawings(logs: dict[str, Rollout]) -> dict[str, list[Figure]]:
    """Return both figures of every log, drawn."""
    figures = {name: both(logs[name]) for name in SHOWN}
    for figure in itertools.chain(*figures.values()):
        figure.canvas.draw()
    return figures


@pytest.fixture(params=SHOWN)
def shown(
    drawings: dict[str, list[Figure]], request: pytest.FixtureRequest
) -> list[Figure]:
    return drawings[request.param]


def changed(
    log: Rollout, rows: slice = slice(None), columns: Any = None, **meta: Any
) -> Rollout:
    """Return a copy of a log of some rows, with some columns and meta replaced."""
    kept = {name: column[rows].copy() for name, column in log.columns.items()}
    return Rollout(kept | (columns or {}), log.meta | meta)


def drawn(draw: Callable[..., None], *arguments: Any, **options: Any) -> Axes:
    """Return axes that something has been drawn on."""
    with plots.styled():
        axes = plots.new_figure(4.0, 3.0).add_subplot()
        draw(axes, *arguments, **options)
    return axes


def lines(axes: Axes) -> list[tuple[np.ndarray, np.ndarray]]:
    return [(line.get_xdata(), line.get_ydata()) for line in axes.lines]


def named(axes: Axes, label: str) -> np.ndarray:
    """Return x and y of the one line whose label begins so, shape (N, 2)."""
    found = [line for line in axes.lines if str(line.get_label()).startswith(label)]
    assert len(found) == 1, (label, [line.get_label() for line in axes.lines])
    return np.column_stack(found[0].get_data())


def sample_inside(shape: Shape, rng: np.random.Generator) -> np.ndarray:
    """Return points of a shape in its own frame, extreme ones among them."""
    directions = rng.standard_normal((200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    match shape:
        case Sphere():
            return shape.radius * directions
        case Capsule():
            ends = rng.choice([-0.5, 0.5], 200)[:, None] * [0.0, 0.0, shape.length]
            return shape.radius * directions + ends
        case Box():
            return rng.choice([-0.5, 0.5], (200, 3)) * shape.size
        case Cylinder():
            angle = rng.uniform(0.0, 2.0 * np.pi, 200)
            ring = shape.radius * np.stack([np.cos(angle), np.sin(angle)])
            height = rng.choice([-0.5, 0.5], 200) * shape.length
            return np.column_stack([*ring, height])
        case PointCloud():
            return np.asarray(shape.points)
        case HeightField():
            return shape._vertices()
    raise AssertionError(shape)


def legend_texts(axes: Axes) -> list[str]:
    legend = axes.get_legend()
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


def both(log: Rollout) -> list[Figure]:
    return [plots.paper_figure(log), plots.diagnostics_figure(log)]


def visible(figure: Figure) -> list[Axes]:
    return [axes for axes in figure.findobj(Axes) if axes.get_visible()]


# -- what is drawn is what the log says -----------------------------------------------


def test_joints_are_absolute_angles_of_the_planar_arm(logs: dict[str, Rollout]) -> None:
    log = logs["uncontrolled"]
    expected = log["joint_positions"] @ A.T
    for k, (t, y) in enumerate(lines(drawn(plots.draw_joint_positions, log))):
        np.testing.assert_array_equal(t, log.t)
        np.testing.assert_allclose(y, expected[:, k], rtol=1e-14)
    own = lines(drawn(plots.draw_joint_positions, log, absolute=False))
    for k, (_, y) in enumerate(own):
        np.testing.assert_array_equal(y, log["joint_positions"][:, k])
    assert len(own) == 3


def test_curves_over_time_are_columns(log: Rollout) -> None:
    efforts = lines(drawn(plots.draw_efforts, log))
    values = lines(drawn(plots.draw_singular_values, log))
    for found, column in ((efforts, log.tau), (values, log["singular_values"])):
        assert len(found) == column.shape[1]
        for k, (t, y) in enumerate(found):
            np.testing.assert_array_equal(t, log.t)
            np.testing.assert_array_equal(y, column[:, k])
    axes = drawn(plots.draw_field_value, log)
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), log["field.value"])
    axes = drawn(plots.draw_null_space_error, log)
    np.testing.assert_array_equal(named(axes, "actual")[:, 1], log["null_space_norm"])


def test_the_minimum_of_manipulability_is_marked(log: Rollout) -> None:
    axes = drawn(plots.draw_manipulability, log)
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), log["manipulability"])
    t, least = named(axes, "minimum")[0]
    assert least == log["manipulability"].min()
    assert log["manipulability"][log.t == t] == least
    assert axes.get_ylim()[0] == 0.0


def test_metres_and_radians_of_a_pose_are_apart(logs: dict[str, Rollout]) -> None:
    log = logs["pose"]
    axes = drawn(plots.draw_task_errors, log)
    error = log["task.panda_tcp.error"]
    for label, rows in (
        ("panda_tcp position [m]", slice(3)),
        ("panda_tcp orientation [rad]", slice(3, 6)),
    ):
        norm = np.linalg.norm(error[:, rows], axis=1)
        np.testing.assert_allclose(named(axes, label)[:, 1], norm, rtol=1e-14)
    assert axes.get_ylabel().endswith("[m, rad]")
    assert axes.get_yscale() == "log"


def test_each_type_of_task_has_its_unit(logs: dict[str, Rollout]) -> None:
    units = {
        part.label: part.unit
        for name in ("several", "posture")
        for part in log_series.task_errors(logs[name])
    }
    assert units == {
        "xz": "m",
        "panda_tcp_pointing tan of half the angle": "–",
        "posture": "rad",
        "turn": "rad",
    }
    robot = logs["posture"].meta["robot"] | {"units": ["rad"] * 7}
    told = changed(logs["posture"], robot=robot)
    assert log_series.task_errors(told)[0].unit == "rad"
    assert log_series.effort_unit(told) == "N·m"


def test_paths_are_the_logs_in_the_plane_of_the_robot(logs: dict[str, Rollout]) -> None:
    log = logs["obstacle"]
    axes = drawn(plots.draw_end_effector, log)
    for label, column in (
        ("desired", "task.tip.reference"),
        ("actual", "task.tip.actual"),
    ):
        np.testing.assert_array_equal(named(axes, label), log[column])
    centers = log["obstacle.disk"][:, :2]
    (path,) = (line for line in axes.lines if line.get_color() == palette.OBSTACLE)
    np.testing.assert_array_equal(path.get_xydata(), centers)
    disks = [patch for patch in axes.patches if isinstance(patch, Circle)]
    assert [disk.center for disk in disks] == [tuple(centers[-1]), tuple(centers[0])]
    assert legend_texts(axes)[-1] == "obstacle"
    assert {disk.radius for disk in disks} == {0.2}
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("x [m]", "y [m]")


def test_a_path_in_space_is_seen_from_a_slant(logs: dict[str, Rollout]) -> None:
    log = logs["space"]
    axes = drawn(plots.draw_end_effector, log)
    view = views.slant()
    np.testing.assert_allclose(view.rows @ view.rows.T, np.eye(2), atol=1e-15)
    for label in ("desired", "actual"):
        column = "reference" if label == "desired" else "actual"
        page = np.column_stack(view.project(log[f"task.panda_tcp.{column}"]))
        np.testing.assert_array_equal(named(axes, label), page)
    texts = {text.get_text() for text in axes.texts}
    assert {"x [m]", "y [m]", "z [m]"} <= texts
    front = drawn(plots.draw_end_effector, log, names="yz")
    reference = log["task.panda_tcp.reference"]
    np.testing.assert_array_equal(named(front, "desired"), reference[:, 1:])


def test_tracked_axes_come_from_the_log(logs: dict[str, Rollout]) -> None:
    (path,) = world.task_paths(logs["several"])
    assert path.axes == "xz"
    desired = path.desired[:, [0, 2]]
    np.testing.assert_array_equal(desired, logs["several"]["task.xz.reference"])
    np.testing.assert_array_equal(path.desired[:, 1], path.actual[:, 1])
    assert paths.path_view(logs["several"]).names == "xz"


def test_frames_show_the_skeleton_at_their_time(logs: dict[str, Rollout]) -> None:
    log = logs["obstacle"]
    axes = drawn(plots.draw_frame, log, 70)
    skeleton = log["skeleton"][70, :, :2]
    assert axes.get_title(loc="left") == "t = 0.70 s"
    (disk,) = (patch for patch in axes.patches if isinstance(patch, Circle))
    assert disk.center == tuple(log["obstacle.disk"][70, :2])
    points = [line.get_xydata() for line in axes.lines if line.get_marker() == "o"]
    np.testing.assert_array_equal(np.concatenate(points), skeleton)
    links = np.array([skeleton[[k - 1, k]] for k in (1, 2, 3)])
    found = next(line for line in axes.lines if line.get_color() == palette.LINK)
    np.testing.assert_array_equal(found.get_xydata().reshape(3, 3, 2)[:, :2], links)


def test_frames_are_even_in_time_or_where_they_are_asked_for(
    logs: dict[str, Rollout],
) -> None:
    log = logs["rest"]
    rows = log_series.chosen_rows(log)
    assert len(rows) == 8
    assert (rows[0], rows[-1]) == (0, 100)
    assert np.ptp(np.diff(rows)) <= 1
    assert log_series.chosen_rows(log, times=[0.25, -3.0, 99.0, 0.251]) == [
        0,
        25,
        100,
    ]
    together = drawn(plots.draw_superimposed, log, rows)
    arms = [line for line in together.lines if len(line.get_xdata()) == 9]
    np.testing.assert_array_equal(
        [arm.get_xydata()[-2] for arm in arms], log["skeleton"][rows, -1, :2]
    )
    brightness = [sum(mpl.colors.to_rgb(arm.get_color())) for arm in arms]
    assert sorted(brightness, reverse=True) == brightness


def test_obstacles_are_their_outlines(logs: dict[str, Rollout]) -> None:
    turned = Spin(pin.utils.rotate("x", 0.5), [0.0, 0.0, 1.0], 2.0)
    bumps = [[0.0, 0.1], [0.1, 0.0]]
    scene = Scene(
        [
            Obstacle("ball", Sphere(0.1), Hold([0.5, 0.0, 0.5])),
            Obstacle("rod", Capsule(0.05, 0.3), Hold([0.4, 0.3, 0.5]), turned),
            Obstacle("crate", Box((0.1, 0.2, 0.3)), Hold([0.5, 0.3, 0.2]), turned),
            Obstacle("can", Cylinder(0.05, 0.2), Hold([0.5, -0.3, 0.2])),
            Obstacle("cloud", PointCloud([[0, 0, 0], [0.1, 0, 0]]), Hold([0, 0.4, 1])),
            Obstacle("land", HeightField((0.2, 0.2), bumps), Hold([0.2, 0.0, 0.0])),
            Obstacle("table", Box((9.0, 9.0, 0.1)), Hold([0.0, 0.0, -0.1])),
            Obstacle("floor", HalfSpace(), Hold([0.0, 0.0, 0.0])),
        ]
    )
    arm = Arm()
    task = FramePosition(arm.robot, arm.tcp, arm.circle([1.0, 0.0, 1.0]), GAINS)
    log = arm.run(task, scene=scene)
    found = {body.name: body for body in bodies.bodies(log)}
    assert [name for name, body in found.items() if body.vast] == ["table", "floor"]
    assert [name for name, body in found.items() if body.moves] == ["rod", "crate"]
    rng = np.random.default_rng(5)
    for name, body in found.items():
        if name in ("table", "floor"):
            continue
        shape, row = scene[name].shape, 30
        inside = sample_inside(shape, rng)
        placement = scene[name].placement(log.t[row])
        world_points = inside @ placement.rotation.T + placement.translation
        low, high = body.enclosed().min(axis=0), body.enclosed().max(axis=0)
        assert np.all(world_points >= low - 1e-9)
        assert np.all(world_points <= high + 1e-9)
        for view in (views.slant(), views.plane("xz")):
            corners = body.outline(view, row)  # anticlockwise
            edges = np.roll(corners, -1, axis=0) - corners
            page = np.column_stack(view.project(world_points))
            off = page[:, None] - corners
            left = edges[:, 0] * off[..., 1] - edges[:, 1] * off[..., 0]
            assert np.all(left >= -1e-3 * np.linalg.norm(edges, axis=1))
    everything = world.everything(log)
    assert np.ptp(everything, axis=0).max() < 2.0  # the table does not shrink the arm
    for view in ("xz", "xy"):
        axes = drawn(plots.draw_end_effector, log, names=view)
        floors = [p for p in axes.patches if p.get_facecolor() == SHADOW]
        assert len(floors) == (view == "xz")  # seen edge-on
    for figure in both(log):
        figure.canvas.draw()


def test_a_mesh_is_a_dashed_ball_around_it(logs: dict[str, Rollout]) -> None:
    about = {"shape": "Mesh", "parameters": {"file": "a.stl"}, "radius": 0.3}
    (body,) = bodies.bodies(changed(logs["obstacle"], obstacles={"disk": about}))
    assert (body.radius, body.exact) == (0.3, False)


# -- the prediction of e_N ------------------------------------------------------------


def test_a_scalar_gain_predicts_a_line_and_the_log_lies_on_it(
    logs: dict[str, Rollout],
) -> None:
    log = logs["obstacle"]
    norm = log["null_space_norm"]
    predicted = named(drawn(plots.draw_null_space_error, log), "predicted")
    np.testing.assert_allclose(predicted[:, 1], norm[0] * np.exp(-10.0 * log.t))
    np.testing.assert_allclose(predicted[:, 1], norm, rtol=1e-3)
    late = changed(log, columns={"t": log.t + 5.0})  # the clock need not start at 0
    np.testing.assert_allclose(predicted_decay(late).slow, predicted[:, 1])


def test_a_matrix_gain_predicts_a_band_and_the_log_lies_in_it(
    logs: dict[str, Rollout],
) -> None:
    robot = Robot.load("planar3r", gravity=(0, 0, 0))
    task = FramePosition(robot, "tip", Round([1, 1], 1, 3), GAINS, axes="xy")
    q0 = robot.integrate(robot.neutral(), np.array([-0.44, 0.9, 0.9]))
    controller = Controller(
        robot,
        [task],
        Rest(robot),
        null_space_gain=[5.0, 10.0, 15.0],
        metric=ConstantMetric.from_coordinates(A),
    )
    run = simulate(controller, q0, [1.0, 0.0, -1.0], duration=1.0)
    for log in (run, logs["space"]):
        decay, norm = predicted_decay(log), log["null_space_norm"]
        assert decay.gains[0] < decay.gains[1]
        assert np.all(norm <= decay.slow * (1.0 + 1e-6))
        assert np.all(norm >= decay.fast * (1.0 - 1e-6))
        texts = legend_texts(drawn(plots.draw_null_space_error, log))
        assert texts[0].startswith("predicted: between exp(−")
    assert predicted_decay(logs["space"]).gains == pytest.approx((5.0, 15.0))
    untold = changed(run, metric_matrix=None)
    (unknown, *_) = legend_texts(drawn(plots.draw_null_space_error, untold))[::-1]
    assert unknown == "no prediction: $K_N$ is a matrix, $W$ not in the log"


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("uncontrolled", "no prediction: self-motion is not controlled"),
        ("rest", "no prediction: starts with $e_N$ = 0"),
    ],
)
def test_no_prediction_where_there_is_none(
    logs: dict[str, Rollout], name: str, why: str
) -> None:
    axes = drawn(plots.draw_null_space_error, logs[name])
    assert legend_texts(axes) == [r"actual $\Vert e_N \Vert_W$", why]
    assert axes.get_ylim()[1] >= 1e-6  # rounding does not fill the axis


def test_a_constant_metric_is_read_from_the_log(logs: dict[str, Rollout]) -> None:
    np.testing.assert_array_equal(log_series.constant_metric(logs["rest"]), A.T @ A)
    varying = changed(logs["rest"], metric="MassMatrixMetric", metric_matrix=None)
    assert log_series.constant_metric(varying) is None


# -- it can be read -------------------------------------------------------------------


def test_axes_have_labels_with_units(shown: list[Figure]) -> None:
    for figure in shown:
        for axes in visible(figure):
            if not axes.axison or axes.get_label() == "<colorbar>":
                continue
            for axis in (axes.xaxis, axes.yaxis):
                shown = any(
                    tick.label1.get_visible() for tick in axis.get_major_ticks()
                )
                text = axis.label.get_text()
                assert not shown or ("[" in text and text.endswith("]")), text


def test_several_lines_have_a_legend(shown: list[Figure]) -> None:
    for figure in shown:
        for axes in visible(figure):
            handles, labels = axes.get_legend_handles_labels()
            assert len(handles) < 2 or legend_texts(axes) == labels
            assert len(set(labels)) == len(labels)


def test_nothing_is_clipped_and_nothing_overlaps(shown: list[Figure]) -> None:
    for figure in shown:
        renderer = figure.canvas.get_renderer()
        paper = figure.bbox.padded(1.0)
        panels = [
            (axes, axes.get_tightbbox(renderer))
            for axes in visible(figure)
            if axes.axison or axes.lines
        ]
        headings = [
            (text, text.get_window_extent(renderer))
            for owner in (figure, *figure.findobj(SubFigure))
            for text in (owner._suptitle, owner._supxlabel)
            if text is not None
        ]
        for what, place in panels + headings:
            inside = paper.contains(place.x0, place.y0), paper.contains(*place.max)
            assert inside == (True, True), what
        for (one, here), (other, there) in itertools.combinations(panels + headings, 2):
            if one in getattr(other, "child_axes", []):
                continue  # the scale of time stands in its panel
            overlap = here.intersection(here, there)
            assert overlap is None or min(overlap.size) < 3.0, (one, other)


def test_legends_hide_nothing(shown: list[Figure]) -> None:
    for figure in shown:
        renderer = figure.canvas.get_renderer()
        for axes in visible(figure):
            if axes.get_legend() is None:
                continue
            legend = axes.get_legend().get_window_extent(renderer)
            around = [text.get_window_extent(renderer) for text in axes.texts]
            if axes.axison:
                around += [axes.bbox, axes.xaxis.get_tightbbox(renderer)]
            assert not any(legend.overlaps(other) for other in around), axes


def test_numbers_on_axes_do_not_collide(shown: list[Figure]) -> None:
    for figure in shown:
        for axes in visible(figure):
            if not axes.axison:
                continue
            for axis in (axes.xaxis, axes.yaxis):
                low, high = sorted(axis.get_view_interval())
                labels = [
                    tick.label1.get_window_extent()
                    for tick in axis.get_major_ticks()
                    if low <= tick.get_loc() <= high and tick.label1.get_visible()
                ]
                for one, other in itertools.combinations(labels, 2):
                    assert not one.overlaps(other), axis.label.get_text()


def test_of_many_joints_the_busiest_are_named(logs: dict[str, Rollout]) -> None:
    n = 30
    names = [f"leg_{k}_joint" for k in range(n)]
    waves = np.sin(logs["rest"].t)[:, None] * np.arange(n)
    robot = logs["rest"].meta["robot"] | {"freedoms": names, "nq": n, "nv": n}
    log = changed(logs["rest"], columns={"tau": waves}, robot=robot)
    axes = drawn(plots.draw_efforts, log)
    busiest = [f"{k}_joint" for k in range(23, 30)]
    shown = [text.removeprefix("leg_") for text in legend_texts(axes)]
    assert shown == [*busiest, "23 others (grey)"]
    found = {tuple(y) for _, y in lines(axes) if len(y)}
    assert found == {tuple(waves[:, k]) for k in range(n)}


def test_a_bounded_law_is_marked(logs: dict[str, Rollout]) -> None:
    damped = np.zeros(101)
    damped[20:31] = damped[90:] = 1.0
    log = changed(logs["rest"], columns={"damped": damped})
    for draw in (
        plots.draw_manipulability,
        plots.draw_singular_values,
        plots.draw_task_errors,
        plots.draw_null_space_error,
    ):
        axes = drawn(draw, log)
        spans = [(patch.get_x(), patch.get_width()) for patch in axes.patches]
        np.testing.assert_allclose(spans, [(0.2, 0.1), (0.9, 0.1)], atol=1e-12)
        assert "law bounded near a singularity" in legend_texts(axes)


def test_names_are_shown_as_they_are(logs: dict[str, Rollout]) -> None:
    robot = logs["rest"].meta["robot"] | {"freedoms": ["_a", "b$x$", "$c_"]}
    log = changed(
        logs["rest"], robot=robot, field="$g$", config={"title": "costs $5 and $6"}
    )
    assert legend_texts(drawn(plots.draw_efforts, log)) == [" _a", r"b\$x\$", r"\$c_"]
    figure = plots.diagnostics_figure(log)
    assert figure.get_suptitle() == r"costs \$5 and \$6"
    figure.canvas.draw()


def test_joints_lose_what_all_names_begin_with(logs: dict[str, Rollout]) -> None:
    assert log_series.joint_names(logs["pose"]) == [f"joint{k}" for k in range(1, 8)]
    for names, short in (
        (["lbr_a_1", "lbr_a_2"], ["a_1", "a_2"]),
        (["j1", "j2"], ["j1", "j2"]),
        (["only_one"], ["one"]),
    ):
        robot = {"freedoms": names}
        found = log_series.joint_names(changed(logs["rest"], robot=robot))
        assert found in (short, names)
        assert all(name[0].isalpha() for name in found)


def test_the_title_is_the_configurations(logs: dict[str, Rollout]) -> None:
    title = "Simulation 2: rest, and its drift"
    log = logs["rest"]
    for figure in both(changed(log, config={"title": title})):
        assert figure.get_suptitle() == title
    bare = changed(log, config=None, title="", name=None)
    assert plots.paper_figure(bare).get_suptitle() == "planar3r, field: rest"


# -- the palette ----------------------------------------------------------------------

# Machado, Oliveira, Fernandes (2009), severity 1, on linear RGB.
BLINDNESS = {
    "none": np.eye(3),
    "protan": [
        [0.152286, 1.052583, -0.204868],
        [0.114503, 0.786281, 0.099216],
        [-0.003882, -0.048116, 1.051998],
    ],
    "deutan": [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ],
    "tritan": [
        [1.255528, -0.076749, -0.178779],
        [-0.078411, 0.930809, 0.147602],
        [0.004733, 0.691367, 0.303900],
    ],
}


def lab(color: str, blindness: str) -> np.ndarray:
    """Return CIE L*a*b* of a colour as an eye sees it."""
    srgb = np.array(mpl.colors.to_rgb(color))
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.asarray(BLINDNESS[blindness]) @ linear, 0.0, 1.0)
    xyz = (
        np.array(
            [
                [0.4124564, 0.3575761, 0.1804375],
                [0.2126729, 0.7151522, 0.0721750],
                [0.0193339, 0.1191920, 0.9503041],
            ]
        )
        @ seen
        / [0.95047, 1.0, 1.08883]
    )
    f = np.where(xyz > 216 / 24389, np.cbrt(xyz), (24389 / 27 * xyz + 16) / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("blindness", BLINDNESS)
@pytest.mark.parametrize(
    "colors",
    [
        palette.SERIES,
        palette.TASKS,
        (
            palette.ACTUAL,
            palette.DESIRED,
            palette.OBSTACLE,
            palette.LINK,
            palette.JOINT,
        ),
        (palette.TASK, palette.WARNING, palette.PAPER),
        (palette.FIELD, palette.INK, palette.WARNING, palette.PAPER),
        (palette.EARLY, palette.LATE, palette.OBSTACLE, palette.DESIRED),
    ],
)
def test_colours_stay_apart_for_all_eyes(
    colors: tuple[str, ...], blindness: str
) -> None:
    for one, other in itertools.combinations(colors, 2):
        assert np.linalg.norm(lab(one, blindness) - lab(other, blindness)) > 12.0


def test_colours_blend_and_come_again() -> None:
    assert palette.blend("#000000", "#FF8000", 0.0) == "#000000"
    assert palette.blend("#000000", "#FF8000", 1.0) == "#FF8000"
    assert palette.blend("#000000", "#FF8000", 0.5) == "#804000"
    assert palette.series(0) == palette.series(len(palette.SERIES))
    assert palette.task(0) == palette.ACTUAL


# -- logs at the edge -----------------------------------------------------------------


@pytest.mark.parametrize("name", ["obstacle", "several", "posture"])
def test_one_row_is_drawn(logs: dict[str, Rollout], name: str) -> None:
    short = changed(logs[name], slice(1), status="interrupted", message="by the user")
    for figure in both(short):
        figure.canvas.draw()
        assert figure.get_supxlabel().startswith("interrupted: by the user")


def test_two_rows_are_drawn(logs: dict[str, Rollout]) -> None:
    for figure in both(changed(logs["space"], slice(2), status="diverged")):
        figure.canvas.draw()


def test_a_log_without_rows_says_so(logs: dict[str, Rollout]) -> None:
    empty = changed(logs["rest"], slice(0), status="diverged")
    for draw in (plots.paper_figure, plots.diagnostics_figure):
        with pytest.raises(PlotError, match=r"no rows to draw \(diverged\)"):
            draw(empty)
    with pytest.raises(PlotError, match="needs at least 1"):
        plots.paper_figure(logs["rest"], times=[])


def test_a_robot_that_stands_still_is_drawn(logs: dict[str, Rollout]) -> None:
    for name in ("rest", "posture"):
        rows = np.zeros(30, dtype=int)
        still = {
            k: column[rows] for k, column in logs[name].columns.items() if k != "t"
        }
        log = changed(logs[name], slice(30), still)
        for figure in both(log):
            figure.canvas.draw()
        axes = drawn(plots.draw_end_effector, log)
        assert np.ptp(axes.get_xlim()) > 0.01  # rounding is not magnified


@pytest.mark.parametrize("count", [1, 3, 8, 13])
def test_any_number_of_frames_fits(logs: dict[str, Rollout], count: int) -> None:
    figure = plots.paper_figure(logs["obstacle"], frames=count)
    titles = [axes.get_title(loc="left") for axes in visible(figure)]
    assert sum(title.startswith("t = ") for title in titles) == count


def test_a_box_has_two_numbers_on_every_edge() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        lower = rng.uniform(-1.0, 1.0, 3)
        upper = lower + rng.uniform(0.05, 1.0, 3)
        axes = drawn(box.draw_box, views.slant(), lower, upper)
        numbers = [text for text in axes.texts if "[" not in text.get_text()]
        assert len(numbers) >= 6
        assert box.corners(lower, upper).shape == (8, 3)


# -- files, and what drawing leaves behind --------------------------------------------


def test_figures_are_written_in_every_format(
    logs: dict[str, Rollout], tmp_path: Path
) -> None:
    log, folder = changed(logs["rest"], slice(20)), tmp_path / "new" / "folder"
    files = plots.save_figures(log, folder, "run", ("pdf", "svg"))
    kinds = itertools.product(("paper", "diagnostics"), ("pdf", "svg"))
    assert files == [folder / f"run-{name}.{suffix}" for name, suffix in kinds]
    assert all(5_000 < file.stat().st_size < 500_000 for file in files)


def test_what_cannot_be_written_says_why(
    logs: dict[str, Rollout], tmp_path: Path
) -> None:
    with pytest.raises(PlotError, match="no picture format 'pgn'; did you mean 'png'"):
        plots.save_figures(logs["rest"], tmp_path, "run", ("pgn",))
    (tmp_path / "file").touch()
    with pytest.raises(PlotError, match=r"run-paper\.png: cannot write the picture"):
        plots.save_figures(logs["rest"], tmp_path / "file", "run")


def test_parameters_of_matplotlib_are_left_alone(logs: dict[str, Rollout]) -> None:
    before = dict(mpl.rcParams)
    figure = plots.diagnostics_figure(changed(logs["space"], slice(3)))
    assert isinstance(figure.canvas, FigureCanvasAgg)
    figure.canvas.draw()
    assert dict(mpl.rcParams) == before


def test_a_figure_keeps_its_style_wherever_it_is_saved(tmp_path: Path) -> None:
    with plots.styled():
        figure = plots.new_figure(2.0, 2.0)
        axes = figure.add_subplot()
        axes.plot([0.0, 1.0], [0.0, 1.0])
    figure.savefig(tmp_path / "plain.png")  # outside the style
    label = axes.xaxis.get_major_ticks()[0].label1
    assert label.get_fontsize() == 8.0
    assert label.get_color() == palette.INK


def test_matplotlib_comes_late_and_no_display_is_needed(tmp_path: Path) -> None:
    program = """
import sys
import hsp_control
assert not [name for name in sys.modules if name.startswith("matplotlib")]
from hsp_control.visualization.plots import new_figure, styled
with styled():
    new_figure(1.0, 1.0).add_subplot()
assert "matplotlib.pyplot" not in sys.modules
"""
    environment = {"MPLBACKEND": "TkAgg", "HOME": str(tmp_path), "PATH": ""}
    subprocess.run([sys.executable, "-c", program], check=True, env=environment)


def test_letters_and_headings(drawings: dict[str, list[Figure]]) -> None:
    paper, diagnostics = drawings["obstacle"]
    texts = {text.get_text() for text in paper.findobj(Text)}
    for heading in (
        "(a)  End effector",
        "(b)  Joints",
        "(c)  Manipulability",
        "(d)  Selected frames",
        "(e)  Frames together",
    ):
        assert heading in texts
    titles = [axes.get_title(loc="left")[:3] for axes in visible(diagnostics)]
    assert titles == [f"({letter})" for letter in "abcdefgh"]


def test_frames_bear_one_number_in_every_panel(logs: dict[str, Rollout]) -> None:
    """A frame is found again by its number: in the strip, together, and over time."""
    log, times = logs["obstacle"], [0.2, 0.5, 0.9]
    figure = plots.paper_figure(log, times=times, title="With $ in it")
    assert figure.get_suptitle() == r"With \$ in it"
    figure.canvas.draw()
    strip = [a for a in figure.axes if a.get_title(loc="left").startswith("t = ")]
    assert [axes.get_title(loc="right") for axes in strip] == ["1", "2", "3"]
    (together,) = (a for a in figure.axes if len(a.texts) == len(times))
    for number, (text, time) in enumerate(zip(together.texts, times, strict=True), 1):
        assert text.get_text() == str(number)
        row = int(np.abs(log.t - time).argmin())
        assert text.xy == pytest.approx(log["skeleton"][row, -1, :2])
    for panel in ("(b)", "(c)"):
        (axes,) = (a for a in figure.axes if a.get_title(loc="left").startswith(panel))
        (upper,) = axes.child_axes
        np.testing.assert_allclose(upper.get_xticks(), times)
        assert [t.get_text() for t in upper.get_xticklabels()] == ["1", "2", "3"]


def test_many_frames_are_marked_but_not_named(logs: dict[str, Rollout]) -> None:
    axes = drawn(plots.draw_manipulability, logs["rest"])
    plots.lines.mark_frames(axes, np.linspace(0.0, 1.0, 15))
    labels = [t.get_text() for t in axes.child_axes[0].get_xticklabels()]
    assert labels == [""] * 15


def test_a_frame_at_its_parent_is_numbered_above_it(logs: dict[str, Rollout]) -> None:
    """A hand whose frame lies on the last joint has no link to go on along."""
    skeleton = logs["rest"]["skeleton"].copy()
    skeleton[:, -1] = skeleton[:, -2]
    log = changed(logs["rest"], columns={"skeleton": skeleton})
    axes = drawn(plots.draw_superimposed, log, [0])
    assert axes.texts[0].xyann == pytest.approx((0.0, 8.0))


def test_a_figure_shows_itself_in_a_notebook(logs: dict[str, Rollout]) -> None:
    picture = plots.paper_figure(logs["rest"])._repr_png_()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) < 300_000


def test_the_style_can_be_had_for_good() -> None:
    with mpl.rc_context():
        plots.use_style()
        assert mpl.rcParams["axes.titleweight"] == "bold"
        assert mpl.rcParams["axes.prop_cycle"].by_key()["color"] == list(palette.SERIES)
    assert mpl.rcParams["axes.titleweight"] != "bold"
