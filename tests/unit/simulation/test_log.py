"""The log of a run: its columns, its file, and refused files."""

import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from closed_loops import load, panda_controller, planar_controller, planar_start
from wording import wording

from hsp_control import (
    Controller,
    Gains,
    JointPosture,
    Rollout,
    load_experiment,
    simulate,
)
from hsp_control.cli import main
from hsp_control.common.arrays import Array
from hsp_control.common.errors import LogError, ShapeError
from hsp_control.constraints.limits.limits import own_limits
from hsp_control.null_space.metrics import MassMatrixMetric
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.limit_excess import LimitExcess
from hsp_control.trajectories import Lissajous

# --- the log's columns ---------------------------------------------------------------


def test_columns(planar_run: Rollout) -> None:
    """Every column has a description and the length of t, and agrees with the state."""
    run, controller = planar_run, planar_controller()
    robot = controller.robot
    assert set(run.meta["columns"]) == set(run.columns)
    for name, column in run.columns.items():
        assert len(column) == len(run.t) == 51
        more = {"center_of"} if name == "distance.point_distance" else set()
        assert set(run.meta["columns"][name]) == {"unit", "meaning"} | more
    np.testing.assert_allclose(run.t, 0.01 * np.arange(51), rtol=0, atol=1e-15)
    for i in (0, 13, 50):
        state = robot.state(run.t[i], run.q[i], run.v[i])
        output = controller.compute(state)
        np.testing.assert_array_equal(run.tau[i], output.tau)
        np.testing.assert_array_equal(run["acceleration"][i], output.acceleration)
        np.testing.assert_array_equal(run["field.g"][i], output.field.g)
        np.testing.assert_array_equal(run["task.tip.error"][i], output.task.error)
        np.testing.assert_array_equal(
            run["null_space_error"][i], output.null_space_error
        )
        J = state.frame("tip").jacobian[:2]
        np.testing.assert_allclose(
            run["manipulability"][i], np.linalg.det(J @ J.T), rtol=1e-12
        )
        np.testing.assert_allclose(
            run["singular_values"][i], np.linalg.svd(J)[1], rtol=1e-12
        )
        for point, frame in enumerate(("joint1", "joint2", "joint3", "tip")):
            np.testing.assert_allclose(
                run["skeleton"][i, point], state.position(frame), rtol=0, atol=1e-14
            )
    assert run.meta["robot"]["skeleton_parents"] == [-1, 0, 1, 2]
    assert run.meta["metric"] == "IdentityMetric"
    assert run.meta["null_space_gain"] == (10.0 * np.eye(3)).tolist()


def test_the_norm_is_that_of_the_metric() -> None:
    robot = load("panda")
    controller = Controller(
        robot,
        panda_controller().tasks,
        panda_controller().field,
        metric=MassMatrixMetric(),
    )
    run = simulate(controller, robot.home(), duration=0.02, integrator=Rk4(0.001))
    for i in range(3):
        e_N = run["null_space_error"][i]
        M = robot.state(0.0, run.q[i], run.v[i]).mass_matrix
        expected = np.sqrt(e_N @ M @ e_N)
        np.testing.assert_allclose(run["null_space_norm"][i], expected, rtol=1e-12)


def test_joint_positions_of_continuous_joints_wind_up() -> None:
    """Joints guided to 17 and -34 rad are logged there, not modulo 2 pi."""
    robot = load("planar3r", gravity=False)
    away = Lissajous([20.0, -40.0, 0.1], [0.5, 0.5, 1.0], center=[0.0, 0.0, 0.0])
    task = JointPosture(
        robot.neutral(), gains=Gains(natural_frequency=10.0), displacement=away
    )
    run = simulate(
        Controller(robot, [task]), robot.neutral(), [10.0, -20.0, 0.1], duration=2.0
    )
    expected = np.array([away.sample(t).position for t in run.t])
    assert np.abs(expected[-1]).max() > 30.0
    np.testing.assert_allclose(run["joint_positions"], expected, rtol=0, atol=1e-7)


def test_a_run_can_be_measured_afterwards(planar_run: Rollout) -> None:
    """`measure` returns logged and other quantities at every row."""
    run, robot = planar_run, load("planar3r", gravity=False)
    tip = run.measure(robot, lambda state: state.position("tip"))
    np.testing.assert_array_equal(tip, run["skeleton"][:, -1])
    square = run.measure(robot, lambda state: state.v[0] ** 2)
    np.testing.assert_array_equal(square, [v[0] ** 2 for v in run.v])
    np.testing.assert_array_equal(run.measure(robot, lambda state: state.t), run.t)
    with pytest.raises(ShapeError, match=r"panda needs \(7,\)"):
        run.measure(load("panda"), lambda state: state.t)


# --- the log's file ------------------------------------------------------------------


def same(a: Rollout, b: Rollout) -> bool:
    return (
        list(a.columns) == list(b.columns)
        and all(np.array_equal(a[name], b[name]) for name in a.columns)
        and a.meta == b.meta
    )


def test_round_trip(planar_run: Rollout, tmp_path: Path) -> None:
    path = planar_run.save(tmp_path / "logs" / "run.npz")  # makes the folder
    assert path == tmp_path / "logs" / "run.npz"
    assert [file.name for file in path.parent.iterdir()] == ["run.npz"]
    loaded = Rollout.load(str(path))
    assert same(loaded, planar_run)
    assert all(loaded[n].dtype == planar_run[n].dtype for n in loaded.columns)
    assert repr(loaded) == "Rollout(planar3r: tip; 51 rows, 0 to 0.5 s, completed)"


def test_a_column_that_is_not_there(planar_run: Rollout) -> None:
    assert "task.tip.error" in planar_run
    assert "task.tip.eror" not in planar_run
    reported = "the log ... 'task.tip.eror' ... 'task.tip.error' ... t, q, v, tau"
    with pytest.raises(LogError, match=wording(reported)):
        planar_run["task.tip.eror"]


@pytest.fixture
def short_log(tmp_path: Path) -> tuple[Rollout, bytes, Path]:
    """Return a log of three rows, the bytes of its file, and a path for variants."""
    run = simulate(planar_controller(), planar_start(), duration=0.02)
    data = run.save(tmp_path / "whole.npz").read_bytes()
    return run, data, tmp_path / "other.npz"


def test_a_log_with_a_wrong_byte_is_refused_or_whole(
    short_log: tuple[Rollout, bytes, Path],
) -> None:
    """Changing a byte has no effect (dates), or the file is refused."""
    run, data, path = short_log
    refused = 0
    places = range(3, len(data), 50)
    for place in places:
        broken = bytearray(data)
        broken[place] ^= 0xFF
        path.write_bytes(broken)
        try:
            loaded = Rollout.load(path)
        except LogError:
            refused += 1
        else:
            assert same(loaded, run), place
    assert refused > 0.7 * len(places)


def test_an_archive_marked_as_encrypted_is_refused(
    short_log: tuple[Rollout, bytes, Path],
) -> None:
    """One bit of its directory says so."""
    _, data, path = short_log
    broken = bytearray(data)
    end = broken.rfind(b"PK\x05\x06")
    broken[int.from_bytes(broken[end + 16 : end + 20], "little") + 8] ^= 1
    path.write_bytes(broken)
    with pytest.raises(LogError, match=r"not a complete .npz log .*encrypted"):
        Rollout.load(path)


def npz(**arrays: Any) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def meta(**changes: Any) -> Any:
    return np.array(json.dumps({"format": "hsp_control rollout 1", **changes}))


ROW: Any = {name: np.zeros((2, 1)) for name in ("q", "v", "tau")}
NOT_OURS = r"not a log of hsp_control: it has no text entry 'meta'"
TWO: Any = {"t": np.zeros(2), **ROW}
FOREIGN: dict[str, tuple[Callable[[], bytes], str]] = {
    "empty": (lambda: b"", r"not a complete .npz log"),
    "zip": (lambda: b"PK\x03\x04" + bytes(100), r"not a complete .npz log"),
    "npy": (lambda: npy(np.zeros(3)), r"not a complete .npz log"),
    "pickle": (lambda: npz(meta=meta(), t=np.array([{}], dtype=object)),
               r"not a complete .npz log .*pickle"),
    "no meta": (lambda: npz(**TWO), NOT_OURS + r" .* \(it has t, q, v"),
    "meta of numbers": (lambda: npz(meta=np.zeros(3), **TWO), NOT_OURS),
    "meta not JSON": (lambda: npz(meta=np.array("{"), **TWO), NOT_OURS),
    "meta a list": (lambda: npz(meta=np.array("[1, 2]"), **TWO),
                    NOT_OURS + " with a JSON object"),
    "another format": (lambda: npz(meta=meta(format="hsp_control rollout 2"), **TWO),
                       r"its format is 'hsp_control rollout 2'; this version reads"),
    "column": (lambda: npz(meta=meta(), **ROW), r"the log lacks the column 't'"),
    "a number for a column": (lambda: npz(meta=meta(), **{**TWO, "e": np.array(1.0)}),
                              r"the column 'e' has shape \(\); needs \d+ rows"),
    "a short column": (lambda: npz(meta=meta(), **{**TWO, "v": TWO["v"][:1]}),
                       r"the column 'v' has shape .*; needs"),
    "complex": (lambda: npz(meta=meta(), **{**TWO, "v": 1j * TWO["v"]}),
                r"the column 'v' is of complex128; needs numbers"),
    "dates": (lambda: npz(meta=meta(), **{**TWO, "t": np.zeros(2, "datetime64[s]")}),
              r"the column 't' is of datetime64\[s\]; needs numbers"),
    "words": (lambda: npz(meta=meta(), **{**TWO, "v": np.full((2, 1), "1.0")}),
              r"the column 'v' is of <U3; needs numbers"),
    "times of NaN": (lambda: npz(meta=meta(), **{**TWO, "t": np.full(2, np.nan)}),
                     r"the column 't' is not finite in row 0"),
    "positions of NaN": (lambda: npz(meta=meta(), **{**TWO, "q": np.nan * TWO["q"]}),
                         r"the column 'q' is not finite in row 0"),
    "times that run back": (lambda: npz(meta=meta(), **{**TWO, "t": np.eye(2)[0]}),
                            r"the time runs back from 1 to 0 s in row 1"),
    "51 TiB": (lambda: declared((7_000_000_000_000,)), r".* declares 5.6e\+13 bytes"),
    "nested": (lambda: npz(meta=np.array("[" * 200_000 + "]" * 200_000), **TWO),
               NOT_OURS),
    "another robot": (lambda: npz(meta=meta(robot={"nq": 9, "nv": 9}), **TWO),
                      r"the column 'q' has shape .*; needs \(2, 9\)"),
    "no column": (lambda: npz(meta=meta()), r"the log has no rows: its run ended"),
    "columns a number": (lambda: npz(meta=meta(columns=3), **TWO),
                         "columns is 3; needs a mapping"),
    "an obstacle a number": (lambda: npz(meta=meta(obstacles={"a": 5}), **TWO),
                             "obstacles: a is 5; needs a mapping"),
    "versions a text": (lambda: npz(meta=meta(versions="x"), **TWO),
                        "versions is 'x'; needs a mapping"),
    "limits of another robot": (
        lambda: npz(meta=meta(robot={"nv": 1}, limits={"lower": [1, 2]}), **TWO),
        r"limits: lower is \[1, 2\]; needs 1 numbers or nulls"),
    "dofs of another robot": (
        lambda: npz(meta=meta(robot={"nv": 1, "dofs": ["a", "b"]}), **TWO),
        r"robot: dofs is \['a', 'b'\]; needs 1 texts"),
    "a skeleton without a point": (
        lambda: npz(meta=meta(robot={"nv": 1, "skeleton_parents": [4]}), **TWO),
        r"robot: skeleton_parents is \[4\]; needs numbers of points, -1 to 0"),
    "a gain of text": (
        lambda: npz(meta=meta(robot={"nv": 1}, null_space_gain="x"), **TWO),
        "null_space_gain is 'x'; needs 1 x 1 numbers"),
    "an unknown robot": (
        lambda: npz(meta=meta(status="", robot={"name": "a"}), **TWO),
        r"the log's robot has no 'nq' \(it has name\)"),
    "no robot": (lambda: npz(meta=meta(status="", columns={}), **TWO),
                 r"the log has no 'robot' \(it has format, status, columns\)"),
    "described column": (lambda: npz(meta=meta(columns={"e": {}}), **TWO),
                         r"the log lacks the column 'e'"),
}  # fmt: skip


def declared(shape: tuple[int, ...]) -> bytes:
    """Return a log whose column t declares a shape but has no data."""
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"descr": "<f8", "fortran_order": False, "shape": shape}
    )
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("t.npy", head.getvalue())
    return file.getvalue()


def npy(array: Array) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


@pytest.mark.parametrize("which", FOREIGN)
def test_foreign_files(which: str, tmp_path: Path) -> None:
    make, message = FOREIGN[which]
    path = tmp_path / "foreign.npz"
    path.write_bytes(make())
    with pytest.raises(LogError, match=rf"foreign.npz: {message}"):
        Rollout.load(path)


@pytest.mark.parametrize(("name", "cut", "needed"), [
    ("task.tip.reference", np.s_[:, 0], r"\(3, n\) with n of 2 or more"),
    ("task.tip.actual", np.s_[:, :1], r"\(3, n\) with n of 2 or more"),
    ("task.tip.bounded", np.s_[:, None], r"\(3,\)"),
    ("singular_values", np.s_[:, 0], r"\(3, n\)"),
    ("position_excess", np.s_[:, 0], r"\(3, 3\)"),
])  # fmt: skip
def test_columns_of_another_shape(
    name: str, cut: Any, needed: str, short_log: tuple[Rollout, bytes, Path]
) -> None:
    run, _, path = short_log
    columns = {"position_excess": np.zeros((3, 3)), **run.columns}
    Rollout(columns, run.meta).save(path)
    assert len(Rollout.load(path)) == 3
    Rollout({**columns, name: columns[name][cut]}, run.meta).save(path)
    with pytest.raises(LogError, match=f"{name}' has shape .*; needs {needed}$"):
        Rollout.load(path)


def test_places_where_nothing_can_be_written(
    short_log: tuple[Rollout, bytes, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder that is a file, a file that is a folder, a full disk."""
    run, data, path = short_log
    path.write_bytes(b"a file")
    with pytest.raises(
        LogError, match=r"run.npz: cannot write the log: (File ex|Not a)"
    ):
        run.save(path / "run.npz")
    with pytest.raises(
        LogError, match=r"run.npz: cannot write the log: (Not a|File ex)"
    ):
        run.save(path / "deeper" / "run.npz")
    folder = path.with_name("folder.npz")
    folder.mkdir()
    with pytest.raises(
        LogError, match=r"folder.npz: cannot write the log: Is a direct"
    ):
        run.save(folder)
    assert sorted(file.name for file in path.parent.iterdir()) == [
        "folder.npz",
        "other.npz",
        "whole.npz",
    ]

    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    whole = path.with_name("whole.npz")
    with pytest.raises(
        LogError, match=r"whole.npz: cannot write the log: No space left"
    ):
        run.save(whole)
    assert whole.read_bytes() == data  # only the previous file remains
    assert not list(path.parent.glob(".*.part"))


def test_the_log_has_the_excess_over_limits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With an unmodelled push; without it no limit is exceeded."""
    push = {"frame": "panda_hand", "force": [0, 0, 700], "start": 0.05, "duration": 0.1}
    config = {
        "robot": {"name": "panda"},
        "tasks": {"hand": {"type": "frame_position", "trajectory": {"type": "hold"}}},
        "limits": {"effort": "none"},
        "simulation": {"duration": 0.2, "control_period": 0.002},
    }
    quiet = load_experiment(config).run()
    assert not quiet["position_excess"].any()
    assert not quiet["velocity_excess"].any()
    file = tmp_path / "pushed.yaml"
    plant = {"type": "rigid_body", "pushes": [push]}
    file.write_text(json.dumps({**config, "plant": plant}))
    assert main(["run", str(file), "--out", str(tmp_path)]) == 0
    rollout = Rollout.load(tmp_path / "pushed.npz")
    limits = load_experiment(config).controller.limits
    assert limits is not None
    # A row has the maximum over all control periods since the previous row.
    every = load_experiment(tmp_path / "pushed.yaml", "simulation.log_period=0.002")
    fast = np.maximum(np.abs(every.run().v) - limits.velocity, 0.0)
    rows = [fast[:1], *(fast[k - 4 : k + 1] for k in range(5, 101, 5))]
    beyond = np.array([each.max(axis=0) for each in rows])
    np.testing.assert_allclose(rollout["velocity_excess"], beyond, atol=1e-9)
    assert (beyond > np.maximum(np.abs(rollout.v) - limits.velocity, 0.0) + 0.01).any()
    assert beyond.max() > 0.1
    row, dof = np.unravel_index(beyond.argmax(), beyond.shape)
    printed = " ".join(capsys.readouterr().out.split())
    assert (
        f"panda_joint{dof + 1} is {beyond.max():.3g} rad/s beyond its speed" in printed
    )
    assert f"at {rollout.t[row]:g} s" in printed


def test_the_most_beyond_a_limit_is_kept_until_it_is_collected() -> None:
    robot = load("panda")
    limits, excess = own_limits(robot), LimitExcess(robot)
    middle, rest = 0.5 * (limits.lower + limits.upper), np.zeros(robot.nv)
    for beyond in (0.1, 0.3, 0.2):  # of joint 2 below, of joint 4 above, of a speed
        q, v = middle.copy(), rest.copy()
        q[1], q[3] = limits.lower[1] - beyond, limits.upper[3] + 2.0 * beyond
        v[5] = -limits.velocity[5] - 3.0 * beyond
        excess.record(limits, q, v)
    most = [0.0, 0.3, 0.0, 0.6, 0.0, 0.0, 0.0]
    for position, velocity in ((most, [0.0] * 5 + [0.9, 0.0]), ([0.0] * 7, [0.0] * 7)):
        found = excess.collect(limits)
        assert found["position_excess"].value == pytest.approx(position, abs=1e-14)
        assert found["velocity_excess"].value == pytest.approx(velocity, abs=1e-14)
        excess.record(limits, middle, rest)
