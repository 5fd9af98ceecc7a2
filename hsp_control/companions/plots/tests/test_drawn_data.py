"""Figures show the log's numbers, and predictions of e_N."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import pinocchio as pin
import pytest
from drawn_logs import (
    GAINS,
    PAPER,
    Arm,
    both,
    changed,
    drawn,
    legend_texts,
    lines,
    planar,
)
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import hsp_control.companions.plots as plots
from hsp_control import (
    Controller,
    FramePosition,
    Hold,
    Obstacle,
    Rest,
    Robot,
    Rollout,
    simulate,
)
from hsp_control.companions.plots import figures, log_series, palette, paths, world
from hsp_control.companions.plots.curves import draw_lines
from hsp_control.companions.plots.frames import draw_frame
from hsp_control.companions.plots.log_series import decay_power, predicted_decay
from hsp_control.companions.viewer.targets import read_targets
from hsp_control.geometry import Scene, shapes
from hsp_control.geometry.shapes import shape_to_log
from hsp_control.null_space.metrics import CoordinatesMetric
from hsp_control.simulation import measures
from hsp_control.tasks.feedback import ErrorPart
from hsp_control.trajectories import Circle as Round
from hsp_control.trajectories import Spin

A = np.tril(np.ones((3, 3)))
SHADOW = mpl.colors.to_rgba(palette.SHADOW)
NAMES = ("uncontrolled", "rest", "obstacle", "space", "pose", "several", "posture")


@pytest.fixture(params=NAMES)
def log(logs: dict[str, Rollout], request: pytest.FixtureRequest) -> Rollout:
    return logs[request.param]


def named(axes: Axes, label: str) -> np.ndarray:
    """Return x and y of the only line whose label begins so, shape (N, 2)."""
    found = [line for line in axes.lines if str(line.get_label()).startswith(label)]
    assert len(found) == 1, (label, [line.get_label() for line in axes.lines])
    return np.column_stack(found[0].get_data())


def sample_inside(shape: shapes.Shape, rng: np.random.Generator) -> np.ndarray:
    """Return points of a shape in its own frame, extreme ones among them."""
    directions = rng.standard_normal((200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    match shape:
        case shapes.Sphere():
            return shape.radius * directions
        case shapes.Capsule():
            ends = rng.choice([-0.5, 0.5], 200)[:, None] * [0.0, 0.0, shape.length]
            return shape.radius * directions + ends
        case shapes.Box():
            return rng.choice([-0.5, 0.5], (200, 3)) * shape.size
        case shapes.Cylinder():
            angle = rng.uniform(0.0, 2.0 * np.pi, 200)
            ring = shape.radius * np.stack([np.cos(angle), np.sin(angle)])
            height = rng.choice([-0.5, 0.5], 200) * shape.length
            return np.column_stack([*ring, height])
        case shapes.PointCloud():
            return np.asarray(shape.points)
        case shapes.HeightField():
            return shape._vertices()
    raise AssertionError(shape)


# --- curves are the log's numbers ----------------------------------------------------


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_user_s_task_determines_its_figure() -> None:
    class Tool(FramePosition):
        @property
        def error_parts(self) -> tuple[ErrorPart, ...]:
            return (
                ErrorPart("x and z", "mm", "mm/s", 2),
                ErrorPart("y", "m", "m/s", 1),
            )

    arm = Arm()
    tool = Tool(arm.tcp, arm.circle([1.0, 0.0, 0.0]), axes="xzy", gains=GAINS)
    log = arm.run(tool)
    parts = measures.task_errors(log)
    assert [(part.label, part.unit) for part in parts] == [
        ("panda_tcp x and z", "mm"),
        ("panda_tcp y", "m"),
    ]
    np.testing.assert_array_equal(
        parts[1].norm, np.abs(log["task.panda_tcp.error"][:, 2])
    )
    (path,) = world.task_paths(log)
    desired = log["task.panda_tcp.reference"]
    np.testing.assert_array_equal(path.desired[:, [0, 2, 1]], desired)
    (target,) = read_targets(log)
    np.testing.assert_array_equal(target.desired, path.desired)


@pytest.mark.slow
@pytest.mark.parametrize("rows", [slice(4, 5), slice(None)])
def test_rows_without_a_reference_are_left_out(
    rows: slice, logs: dict[str, Rollout]
) -> None:
    """The rest of a damaged log is drawn."""
    run = logs["space"]
    for what in ("reference", "actual"):
        name = f"task.{measures.task_names(run)[0]}.{what}"
        damaged = run[name].copy()
        damaged[rows] = np.nan
        figure = plots.paper_figure(Rollout({**run.columns, name: damaged}, run.meta))
        limits = [(*axes.get_xlim(), *axes.get_ylim()) for axes in figure.axes]
        assert np.isfinite(limits).all()


@pytest.mark.slow
def test_frames_are_equidistant_in_time_or_at_given_times(
    logs: dict[str, Rollout],
) -> None:
    log = logs["rest"]
    rows = log_series.chosen_rows(log)
    assert len(rows) == 8
    assert (rows[0], rows[-1]) == (0, 100)
    assert np.ptp(np.diff(rows)) <= 1
    assert log_series.chosen_rows(log, times=[0.25, -3.0, 99.0, 0.251]) == [0, 25, 100]
    together = drawn(plots.draw_superimposed, log, rows)
    arms = [line for line in together.lines if len(line.get_xdata()) == 9]
    np.testing.assert_array_equal(
        [arm.get_xydata()[-2] for arm in arms], log["skeleton"][rows, -1, :2]
    )
    brightness = [sum(mpl.colors.to_rgb(arm.get_color())) for arm in arms]
    assert sorted(brightness, reverse=True) == brightness


@pytest.mark.slow
def test_obstacles_are_their_outlines(logs: dict[str, Rollout]) -> None:
    turned = Spin([0.0, 0.0, 1.0], 2.0, rotation=pin.utils.rotate("x", 0.5))
    bumps = [[0.0, 0.1], [0.1, 0.0]]
    scene = Scene(
        [
            Obstacle("ball", shapes.Sphere(0.1), Hold([0.5, 0.0, 0.5])),
            Obstacle("rod", shapes.Capsule(0.05, 0.3), Hold([0.4, 0.3, 0.5]), turned),
            Obstacle(
                "crate", shapes.Box((0.1, 0.2, 0.3)), Hold([0.5, 0.3, 0.2]), turned
            ),
            Obstacle("can", shapes.Cylinder(0.05, 0.2), Hold([0.5, -0.3, 0.2])),
            Obstacle(
                "cloud", shapes.PointCloud([[0, 0, 0], [0.1, 0, 0]]), Hold([0, 0.4, 1])
            ),
            Obstacle(
                "land", shapes.HeightField((0.2, 0.2), bumps), Hold([0.2, 0.0, 0.0])
            ),
            Obstacle("table", shapes.Box((9.0, 9.0, 0.1)), Hold([0.0, 0.0, -0.1])),
            Obstacle("floor", shapes.HalfSpace(), Hold([0.0, 0.0, 0.0])),
        ]
    )
    arm = Arm()
    task = FramePosition(arm.tcp, arm.circle([1.0, 0.0, 1.0]), gains=GAINS)
    log = arm.run(task, scene=scene)
    found = {body.name: body for body in world.logged_obstacles(log)}
    assert [name for name, body in found.items() if body.oversized] == [
        "table",
        "floor",
    ]
    assert [name for name, body in found.items() if body.moves] == ["rod", "crate"]
    rng = np.random.default_rng(5)
    for name, body in found.items():
        if name in ("table", "floor"):
            continue
        shape, row = scene[name].shape, 30
        inside = sample_inside(shape, rng)
        placement = scene[name].placement(log.t[row])
        world_points = inside @ placement.rotation.T + placement.translation
        low, high = (
            body.enclosing_points().min(axis=0),
            body.enclosing_points().max(axis=0),
        )
        assert np.all(world_points >= low - 1e-9)
        assert np.all(world_points <= high + 1e-9)
        for view in (world.oblique(), world.plane("xz")):
            corners = body.outline(view, row)  # anticlockwise
            edges = np.roll(corners, -1, axis=0) - corners
            page = np.column_stack(view.project(world_points))
            off = page[:, None] - corners
            left = edges[:, 0] * off[..., 1] - edges[:, 1] * off[..., 0]
            assert np.all(left >= -1e-3 * np.linalg.norm(edges, axis=1))
    everything = world.enclosing_points(log)
    # the table does not change the arm's scale
    assert np.ptp(everything, axis=0).max() < 2.0
    for view in ("xz", "xy"):
        axes = drawn(plots.draw_end_effector, log, names=view)
        floors = [p for p in axes.patches if p.get_facecolor() == SHADOW]
        assert len(floors) == (view == "xz")  # seen edge-on
    for figure in both(log):
        figure.canvas.draw()


@pytest.mark.parametrize(("shape", "low", "high"), [
    (shapes.Sphere(0.1), [-0.1] * 3, [0.1] * 3),
    (shapes.Capsule(0.05, 0.3), [-0.05, -0.05, -0.2], [0.05, 0.05, 0.2]),
    (shapes.Cylinder(0.05, 0.2), [-0.05, -0.05, -0.1], [0.05, 0.05, 0.1]),
    (shapes.Box((0.1, 0.2, 0.3)), [-0.05, -0.1, -0.15], [0.05, 0.1, 0.15]),
    (
        shapes.PointCloud([[0.0, 0, 0], [0.1, 0, 0]], 0.02),
        [-0.01] * 3,
        [0.11, 0.01, 0.01],
    ),
    (
        shapes.HeightField((0.2, 0.4), [[0.0, 0.1], [0.1, 0.3]]),
        [-0.1, -0.2, 0.0],
        [0.1, 0.2, 0.3],
    ),
    (
        shapes.HeightField((0.2, 0.4), [[0.1, 0.2], [0.2, 0.3]]),
        [-0.1, -0.2, 0.1],
        [0.1, 0.2, 0.3],
    ),
])  # fmt: skip
def test_an_obstacle_is_drawn_as_large_as_it_is(
    shape: shapes.Shape, low: list[float], high: list[float]
) -> None:
    """Outlines that are too large contain all of its points, too."""
    points, radius = world._POINTS_OF_SHAPE[type(shape).__name__](shape_to_log(shape))
    np.testing.assert_allclose(points.min(axis=0) - radius, low, atol=1e-12)
    np.testing.assert_allclose(points.max(axis=0) + radius, high, atol=1e-12)


@pytest.mark.parametrize("length", [0.19, 0.2, 0.7, 3.0])
def test_the_axes_of_a_frame_are_as_long_as_their_label_says(length: float) -> None:
    """The largest of 1, 2 and 5 times a power of ten that fits."""
    axes = drawn(world.draw_axis_directions, world.oblique(), np.zeros(3), length)
    size = {0.19: 0.1, 0.2: 0.2, 0.7: 0.5, 3.0: 2.0}[length]
    assert [text.get_text() for text in axes.texts] == ["x", "y", f"z  ({size:g} m)"]
    for line, axis in zip(axes.lines, np.eye(3), strict=True):
        ends = np.column_stack(world.oblique().project(np.array([0.0 * axis, axis])))
        np.testing.assert_allclose(line.get_xydata(), size * ends, atol=1e-12)


@pytest.mark.parametrize(("value", "edges"), [
    (-1.39, [-1.0]), (-1.41, []), (-2.59, []), (-2.61, [-3.0]),
])  # fmt: skip
def test_a_limit_is_drawn_within_a_fifth_of_the_joint_s_range(
    value: float, edges: list[float]
) -> None:
    """Of -3 to -1 rad, as of an elbow: the range is 2 rad."""
    values = np.array([[-2.0], [value], [-2.0]])
    limits = np.array([-3.0]), np.array([-1.0])
    axes = drawn(draw_lines, np.arange(3.0), values, ["elbow"], ["rad"], limits)
    _, *limit_lines = axes.lines
    assert [float(line.get_ydata()[0]) for line in limit_lines] == edges


@pytest.mark.parametrize(("axes", "view", "label"), [
    ("xyz", world.oblique(), "desired"),
    ("xz", world.oblique(), "desired (xz)"),
    ("xz", world.plane("xz"), "desired"),
    ("x", world.plane("xy"), "desired (x)"),
    ("xyz", world.plane("xy"), "desired"),
])  # fmt: skip
def test_a_desired_path_names_its_axes_where_others_are_shown(
    axes: str, view: world.View, label: str
) -> None:
    assert paths._desired_label(axes, view) == label


# --- the prediction of e_N -----------------------------------------------------------


@pytest.mark.slow
def test_a_scalar_gain_predicts_a_line_and_the_log_lies_on_it(
    logs: dict[str, Rollout],
) -> None:
    log = logs["obstacle"]
    norm = log["null_space_norm"]
    predicted = named(drawn(plots.draw_null_space_error, log), "predicted")
    np.testing.assert_allclose(predicted[:, 1], norm[0] * np.exp(-10.0 * log.t))
    np.testing.assert_allclose(predicted[:, 1], norm, rtol=1e-3)
    power = decay_power(log)  # of V = ‖e_N‖²/2
    assert power is not None
    np.testing.assert_allclose(power, 10.0 * norm**2, rtol=1e-12)
    late = changed(log, columns={"t": log.t + 5.0})  # the clock need not start at 0
    np.testing.assert_allclose(predicted_decay(late).slow, predicted[:, 1])
    g = log["field.g"].copy()
    g[-1] = np.nan  # a safe stop without the law is no start with e_N = 0
    stopped = changed(log, columns={"field.g": g})
    np.testing.assert_array_equal(predicted_decay(stopped).slow, predicted[:, 1])


@pytest.mark.slow
def test_a_matrix_gain_predicts_a_band_and_the_log_lies_in_it(
    logs: dict[str, Rollout],
) -> None:
    robot = Robot.load("planar3r", gravity=(0, 0, 0))
    task = FramePosition("tip", Round(1, 3, [1, 1]), gains=GAINS, axes="xy")
    q0 = robot.integrate(robot.neutral(), np.array([-0.44, 0.9, 0.9]))
    controller = Controller(
        robot,
        [task],
        Rest(),
        null_space_gain=[5.0, 10.0, 15.0],
        metric=CoordinatesMetric(A),
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


def test_of_many_curves_those_that_vary_most_have_a_name() -> None:
    """Seven of more than fourteen, in their order."""
    spreads = np.random.default_rng(1).permutation(15).astype(float)
    values = 100.0 - np.outer([0.0, 1.0, 0.5], spreads)
    found = log_series.lively(values)
    assert found == np.flatnonzero(spreads >= 8.0).tolist()
    assert len(found) == log_series.SELECTED
    assert log_series.lively(values[:, :14]) == [*range(14)]


def test_a_gap_does_not_make_a_curve_vary() -> None:
    """Such as a distance to an obstacle that comes later."""
    values = np.outer([0.0, 1.0, 0.5], np.linspace(0.01, 0.02, 15))
    expected = [*range(8, 15)]
    assert log_series.lively(values) == expected
    values[:, 0] = [np.nan, 5.0, 5.0]
    values[:, 1] = np.nan
    values[:, 2] = [5.0, -np.inf, 5.0]
    assert log_series.lively(values) == expected


def test_the_power_of_a_matrix_gain_is_the_fall_of_V_in_the_metric() -> None:
    robot = Robot.load("planar3r", gravity=(0, 0, 0))
    task = FramePosition("tip", Round(1, 3, [1, 1]), gains=GAINS, axes="xy")
    q0 = robot.integrate(robot.neutral(), np.array([-0.44, 0.9, 0.9]))
    controller = Controller(
        robot, [task], Rest(), null_space_gain=[5.0, 10.0, 15.0],
        metric=CoordinatesMetric(A),
    )  # fmt: skip
    run = simulate(controller, q0, [1.0, 0.0, -1.0], duration=0.3)
    V, power = 0.5 * run["null_space_norm"] ** 2, decay_power(run)
    assert power is not None
    fall = -V * np.gradient(np.log(V), run.t)
    np.testing.assert_allclose(power[1:-1], fall[1:-1], rtol=0.01)


@pytest.mark.parametrize(
    ("status", "color"),
    [("completed", palette.MUTED), ("interrupted", palette.WARNING)],
)
def test_the_foot_of_an_incomplete_run_is_a_warning(status: str, color: str) -> None:
    log = changed(planar(PAPER["rest"]), slice(20), status=status, message="why")
    figure = plots.diagnostics_figure(log, panels=["efforts"])
    (foot,) = [
        text for text in figure.texts if text.get_text() == figure.get_supxlabel()
    ]
    assert foot.get_color() == color


def test_saved_frames_are_at_the_times_that_are_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    saved = dict[str, Figure]()

    def save(figure: Figure, stem: Path, _: object) -> list[Path]:
        saved[stem.name] = figure
        return [stem]

    monkeypatch.setattr(figures, "save_figure", save)
    plots.save_figures(planar(PAPER["rest"]), tmp_path, "run", times=[0.2, 0.5])
    titles = [axes.get_title("left") for axes in saved["run-paper"].findobj(Axes)]
    times = [each.partition("t = ")[2] for each in titles if "t = " in each]
    assert times == ["0.20 s", "0.50 s"]


def test_a_frame_has_the_time_of_its_row() -> None:
    log = planar(PAPER["rest"])
    late = changed(log, columns={"t": log.t + 5.0})  # the clock need not start at 0
    assert drawn(draw_frame, late, 20).get_title("left") == "t = 5.20 s"


def test_an_obstacle_larger_than_the_robot_is_known_as_such() -> None:
    task = FramePosition("panda_tcp", Hold())
    scene = Scene([
        Obstacle(name, shapes.Box([size, size, 0.1]), [0.0, 0.0, -1.0])
        for name, size in (("table", 0.5), ("floor", 3.0))
    ])  # fmt: skip
    table, floor = world.logged_obstacles(Arm().run(task, scene=scene))
    assert not table.oversized
    assert floor.oversized
