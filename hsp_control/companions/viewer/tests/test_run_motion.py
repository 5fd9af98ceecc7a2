"""Between two rows of a coarse log everything moves along geodesics."""

import numpy as np
import pinocchio as pin

from hsp_control import Robot, Rollout
from hsp_control.common.arrays import Array
from hsp_control.companions.viewer.motion import drawn_times, motion_of


def turn(quaternion: Array) -> Array:
    x, y, z, w = quaternion
    return np.asarray(pin.Quaternion(w, x, y, z).normalized().matrix())


def test_frames_between_rows_are_on_the_geodesic(
    arm: Robot,
) -> None:
    """Joints rotate, positions move straight, orientations rotate about one axis."""
    rng = np.random.default_rng(4)
    q = np.array([arm.integrate(arm.neutral(), v) for v in rng.normal(size=(3, 3))])
    quaternions = rng.normal(size=(3, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    pose = np.hstack([rng.normal(size=(3, 3)), quaternions])
    half = np.array([1.0, np.nan, 3.0])
    t = np.array([0.0, 0.25, 0.4])
    columns = {
        "t": t, "q": q, "v": np.zeros((3, 3)), "half": half,
        "task.hand.reference": pose, "task.hand.actual": pose[::-1],
        "object.box.quaternion": quaternions,
    }  # fmt: skip
    meta = {"tasks": {"hand": {"drawn": ["position", "orientation"], "axes": None}}}
    rows = motion_of(arm, Rollout(columns, meta)).rows
    assert np.isin(t, rows.t).all()
    assert len(rows) > 12
    for k, now in enumerate(rows.t):
        row = min(int(np.searchsorted(t, now, side="right")) - 1, 1)
        share = (now - t[row]) / (t[row + 1] - t[row])
        step = share * arm.difference(q[row], q[row + 1])
        np.testing.assert_allclose(rows.q[k], arm.integrate(q[row], step), atol=1e-12)
        for name, logged, drawn in (
            ("task.hand.reference", pose, rows["task.hand.reference"][k]),
            ("task.hand.actual", pose[::-1], rows["task.hand.actual"][k]),
        ):
            there = logged[row] + share * (logged[row + 1] - logged[row])
            np.testing.assert_allclose(drawn[:3], there[:3], atol=1e-12, err_msg=name)
            begin, end = turn(logged[row, 3:]), turn(logged[row + 1, 3:])
            wanted = begin @ pin.exp3(share * pin.log3(begin.T @ end))
            np.testing.assert_allclose(turn(drawn[3:]), wanted, atol=1e-9)
        begin, end = turn(quaternions[row]), turn(quaternions[row + 1])
        wanted = begin @ pin.exp3(share * pin.log3(begin.T @ end))
        found = turn(rows["object.box.quaternion"][k])
        np.testing.assert_allclose(found, wanted, atol=1e-9)
    # A value known on a row stays known there, next to a row without one.
    on_rows = np.isin(rows.t, t)
    np.testing.assert_array_equal(rows["half"][on_rows], half)
    assert np.isnan(rows["half"][~on_rows]).all()


def test_the_end_replaces_a_row_that_is_too_close_before_it() -> None:
    """First and last row are always drawn, and none within a finest step."""
    for given, drawn in (
        ([0.0, 0.004, 0.01, 0.02, 0.025], [0.0, 0.01, 0.025]),
        ([0.0, 0.01, 0.02, 0.03], [0.0, 0.01, 0.02, 0.03]),
        ([0.0, 0.003], [0.0, 0.003]),
    ):
        found = drawn_times(np.array(given), finest=0.01, coarsest=1.0)
        assert found.tolist() == drawn
