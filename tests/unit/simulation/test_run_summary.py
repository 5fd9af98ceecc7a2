"""Sentences of a run's table, for given numbers."""

from typing import Any

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.simulation import run_summary
from hsp_control.simulation.measures import ForceKept, measures
from hsp_control.simulation.run_summary import excess_rows, force_rows


class Log:
    """Columns and meta data, as of a `Rollout`."""

    def __init__(self, meta: dict[str, Any], **columns: Any) -> None:
        self.meta, self.columns = meta, columns
        self.t = columns["t"]

    def __getitem__(self, name: str) -> Any:
        return self.columns[name]


def test_the_worst_joint_its_unit_and_its_time_are_reported() -> None:
    t = np.array([0.0, 0.5, 1.0, 1.5])
    position, velocity = np.zeros((2, 4, 3))
    position[1, 2], position[2, 1], velocity[2, 0] = 0.04, 0.02, 0.7
    meta = {"robot": {"dofs": ["a", "b", "c"], "units": ["rad", "rad", "m"]}}
    log: Any = Log(meta, t=t, position_excess=position, velocity_excess=velocity)
    first, second = excess_rows(log)
    assert first.startswith("c is 0.04 m beyond its position limit at 0.5 s (2 rows)")
    assert second.startswith("a is 0.7 rad/s beyond its speed limit at 1 s (1 rows)")


def test_the_force_s_error_is_its_root_mean_square(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wanted = np.full(4, 10.0)
    actual = np.array([10.0, 10.0, 10.0, 16.0])
    planned = np.array([10.0, 10.0, 7.0, 10.0])
    kept = ForceKept("pad", wanted, planned, actual, 3)
    monkeypatch.setattr(run_summary, "forces_kept", lambda _: [kept])
    log: Any = None
    assert list(force_rows(log)) == [
        ("force pad", "16 of 10 N at the end, missed by 3 N rms"),
        ("", "1 rows: planned up to 3 N off, for a limit or the balance"),
        ("", "3 rows: contact lost"),
    ]


def damped_run() -> hsp.Rollout:
    """Return a run whose hand cannot reach its target, and a task that ends."""
    panda = hsp.Robot.load("panda")
    hand = hsp.FramePosition("panda_tcp", [2.0, 0.0, 0.5], name="hand")
    elbow = hsp.FramePosition("panda_link4", name="elbow")
    barriers = [hsp.limits.SelfDistance(minimum=0.01)]
    limits = hsp.Limits(barriers=barriers)
    controller = hsp.Controller(panda, [hand, elbow], limits=limits)
    controller.at(0.1).ramp(0.05).remove(elbow.name)
    return hsp.simulate(controller, panda.home(), duration=0.4, control_period=0.01)


def test_printing_a_run_shows_the_table_of_hsp_run() -> None:
    run = damped_run()
    text, rows = str(run), [*run_summary.summary_rows(run)]
    assert [line.split("  ")[0] for line in text.splitlines()] == [n for n, _ in rows]
    damped = int((run["damped"] > 0.0).sum())
    assert damped > 10
    assert f"singular {damped} rows: the law was damped there" in " ".join(text.split())
    assert f"completed, damped in {damped} rows" in repr(run)


def test_a_task_that_goes_is_summarised_by_the_rows_in_which_it_was_there() -> None:
    run = damped_run()
    norm = np.linalg.norm(run["task.elbow.error"], axis=1)
    active = norm[np.isfinite(norm)]
    assert 0 < len(active) < len(norm)
    found, text = measures(run), str(run)
    rms = np.sqrt(np.mean(active**2))
    assert found["tracking.elbow.rms"].value == pytest.approx(rms)
    assert found["tracking.elbow.end"].value == active[-1]
    assert f"at the end {active[-1]:.3g} m" in text
    # Determinants of one task and of two are not comparable; singular values are.
    assert np.isnan(found["manipulability.min"].value)
    least = np.nanmin(run["singular_values"])
    assert found["singular_value.min"].value == least
    assert f"smallest singular value {least:.3g}" in text
    assert "det(" not in text
    undefined = {name for name, each in found.items() if np.isnan(each.value)}
    assert undefined == {"manipulability.min"}


def test_a_field_beyond_the_limits_is_named_also_where_the_task_takes_most_of_it() -> (
    None
):
    robot = hsp.Robot.load("panda")
    q = robot.home()
    rows = robot.state(0.0, q, np.zeros(7)).frame("panda_tcp").jacobian
    along = rows[0] / np.linalg.norm(rows[0])
    g = 1e4 * along + 2e3 * np.linalg.svd(rows)[2][-1]  # P g is a fifth of it
    field = hsp.fields.FunctionField(lambda state: g)
    controller = hsp.Controller(robot, [hsp.FramePose(name="hand")], field)
    run = hsp.simulate(controller, q, duration=0.3, control_period=1e-3)
    said = "the field demands more than the limits allow: |g| 1.02e+04 rad/s"
    assert said in run_summary.beyond_limits(run)
    run.columns["field.g"][:] = 0.0  # then it is what the limits leave that moves
    assert run_summary.beyond_limits(run) == ""


def test_distances_of_barriers_are_in_log_output_and_summary() -> None:
    run = damped_run()
    assert run.meta["columns"]["distance.self_distance"]["minimum"] == 0.01
    panda = hsp.Robot.load("panda")
    clearance = hsp.SelfClearance()
    oracle = run.measure(panda, lambda state: clearance.minimum_distance(state))
    assert run["distance.self_distance"] == pytest.approx(oracle, abs=1e-12)
    limits = hsp.Limits(barriers=[hsp.limits.SelfDistance(minimum=0.01)])
    controller = hsp.Controller(panda, [hsp.FramePosition("panda_tcp")], limits=limits)
    first = controller.compute(0.0, run.q[0], run.v[0])
    later = controller.compute(0.01, run.q[20], run.v[20])
    assert first.distances == {"self_distance": pytest.approx(oracle[0], abs=1e-12)}
    assert later.distances == {"self_distance": pytest.approx(oracle[20], abs=1e-12)}
    least = run["distance.self_distance"].min()
    assert f"self distance      minimum {least:.3g} m, to be at least 0.01 m" in str(
        run
    )


def test_a_user_s_barrier_is_logged_by_its_type() -> None:
    class Height(hsp.limits.Barrier):
        """A frame stays above a height."""

        def values(self, state: hsp.RobotState) -> float:
            """Return the height [m]."""
            return float(state.position("panda_tcp")[2])

    panda = hsp.Robot.load("panda")
    limits = hsp.Limits(barriers=[Height(minimum=0.1), Height(minimum=0.2)])
    controller = hsp.Controller(panda, [hsp.FramePosition("panda_tcp")], limits=limits)
    run = hsp.simulate(controller, panda.home(), duration=0.02, control_period=0.01)
    height = run["task.panda_tcp.actual"][:, 2]
    assert run["barrier.Height_0"] == pytest.approx(height, abs=1e-12)
    assert run.meta["columns"]["barrier.Height_1"]["minimum"] == 0.2
    fresh = hsp.Controller(panda, [hsp.FramePosition("panda_tcp")], limits=limits)
    for row in (0, 1):  # the second step is bound: one call of the engine
        output = fresh.compute(run.t[row], run.q[row], run.v[row])
        now = pytest.approx(height[row], abs=1e-12)
        assert output.distances == {"Height_0": now, "Height_1": now}
    assert f"minimum {height.min():.3g}, to be at least 0.2" in str(run)


def test_a_field_that_is_not_known_at_the_end_is_not_beyond_the_limits() -> None:
    run = damped_run()
    run.columns["status"][:] = 2.0
    run.columns["null_space_norm"][:] = np.nan
    assert run_summary.beyond_limits(run) == ""


def test_a_field_demands_more_than_the_limits_allow_where_they_bind_to_the_end() -> (
    None
):
    """In all of the last tenth of the rows; a limit that binds at times prevents
    nothing."""
    run = damped_run()
    last = len(run) // 10
    assert last > 1
    run["field.g"][-1] = 0.0
    run["field.g"][-1, 0] = 2.0
    run["null_space_norm"][-1], run["v"][-1] = 1.5, 0.1
    for status in (2.0, 4.0):  # limited, beyond
        run["status"][:] = 0.0
        run["status"][-last:] = status
        text = run_summary.beyond_limits(run)
        assert "demands more than the limits allow: |g| 2" in text
        run["status"][-last] = 0.0
        assert run_summary.beyond_limits(run) == ""
    run["status"][-last:], run["v"][-1] = 2.0, 1.0  # |v| = 2.6: most is followed
    assert run_summary.beyond_limits(run) == ""
