"""A session of a play, without a page: messages become motion."""

import math
from asyncio import CancelledError
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clips import Recorder, reported
from places import further
from wording import wording

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ConfigError
from hsp_control.companions.play import Session, play, real_time
from hsp_control.companions.play.knobs import _scaled, knobs_of
from hsp_control.companions.play.other_law import PLAIN, OtherLaw
from hsp_control.companions.play.plain_impedance import PlainImpedance, feedback_of
from hsp_control.companions.play.playable import playable
from hsp_control.companions.viewer import Viewer
from hsp_control.companions.viewer.live_picture import Picture, _off

PANDA = "panda_obstacle"
COARSE = "simulation.control_period=0.002"  # at one of 1 ms the log repeats a drag


@pytest.fixture(scope="module")
def experiment() -> hsp.Experiment:
    return playable(PANDA, "simulation.log_period=0.01")


@pytest.fixture
def session(experiment: hsp.Experiment) -> Session:
    return Session(experiment)


@pytest.fixture
def still() -> Session:
    """A hand that holds its pose, next to a ball at rest."""
    return Session(playable("panda", COARSE))


def go(session: Session, seconds: float) -> None:
    for _ in range(round(seconds / session.row)):
        session.advance()
    assert not session.over


def pose_of(session: Session, name: str = "hand") -> Array:
    return np.array(session.handles.targets[name].where(session.controller.state))


def test_a_dragged_target_is_reached_and_the_log_repeats_it(
    session: Session, tmp_path: Path
) -> None:
    go(session, 0.5)
    wanted = pose_of(session)
    for k in range(20):  # a drag, frame by frame
        wanted[:3] += [0.002, -0.004, 0.005]
        session.receive({"do": "move", "target": "hand", "pose": wanted.tolist()})
        session.receive(
            {"do": "obstacle", "name": "ball", "position": [0.1, 0.3, 0.7 - 0.005 * k]}
        )
        go(session, 0.03)
    session.receive({"do": "release", "target": "hand"})
    session.receive({"do": "set", "id": "null_space_gain", "value": 20.0})
    session.receive({"do": "set", "id": "weight.target_posture", "value": 3.0})
    session.receive({"do": "set", "id": "frequency.hand", "value": 15.0})
    go(session, 1.5)
    assert not session.handles.message
    frame = session.controller.state.frame("panda_tcp")
    np.testing.assert_allclose(frame.position, wanted[:3], atol=1e-4)
    ball = session.controller.scene["ball"].placement(session.t).translation
    np.testing.assert_allclose(ball, [0.1, 0.3, 0.605], atol=1e-9)
    assert session.handles.values["frequency.hand"] == 15.0
    log = session.rollout()
    # The law's error is that of held efforts, for any drag.
    assert np.abs(log["task.hand.error"][log.t > 0.5]).max() < 1e-3
    log.save(tmp_path / "played.npz")
    again = hsp.load_experiment(tmp_path / "played.npz").run()
    np.testing.assert_array_equal(again.q, log.q)
    np.testing.assert_array_equal(again.tau, log.tau)


def test_a_play_begins_at_0_and_so_does_the_repetition_of_its_log(
    tmp_path: Path,
) -> None:
    """Also of a configuration whose simulation begins later."""
    session = Session(playable(PANDA, COARSE, "simulation.start_time=2"))
    go(session, 0.2)
    log = session.rollout()
    again = hsp.load_experiment(log.save(tmp_path / "play.npz")).run()
    assert log.t[0] == again.t[0] == 0.0
    np.testing.assert_array_equal(again.q, log.q)


def test_its_own_path_comes_back(session: Session) -> None:
    untouched = Session(session.experiment)
    go(session, 0.5)
    pose = pose_of(session)
    pose[2] += 0.1
    session.receive({"do": "move", "target": "hand", "pose": pose.tolist()})
    session.receive({"do": "obstacle", "name": "ball", "position": [0.5, 0.5, 0.5]})
    go(session, 0.5)
    assert abs(pose_of(session)[2] - pose[2]) < 1e-3
    session.receive({"do": "resume", "target": "hand"})
    session.handles.obstacles["ball"].resume(session.t)
    go(session, 2.0)
    go(untouched, 3.0)
    np.testing.assert_allclose(pose_of(session), pose_of(untouched), atol=1e-9)
    for each in (session, untouched):
        assert each.controller.scene["ball"].placement(2.0).translation[2] < 0.9
    session.receive(
        {"do": "move", "target": "hand", "pose": pose.tolist()}
    )  # once more
    go(session, 0.8)
    np.testing.assert_allclose(pose_of(session)[:3], pose[:3], atol=1e-3)


def test_the_elbow_of_the_posture_leads_the_null_space(tmp_path: Path) -> None:
    """The elbow follows as in the theorem, the hand is undisturbed; and it returns."""
    session = Session(playable("panda", COARSE))
    go(session, 0.3)
    start = pose_of(session, "posture")
    wanted, elbow = start.copy(), session.controller.state.data.oMi[3].copy()
    for _ in range(20):
        wanted[1] += 0.005
        session.receive({"do": "move", "target": "posture", "pose": wanted.tolist()})
        go(session, 0.03)
    go(session, 2.0)
    # The elbow stays at its distance from the shoulder: it cannot reach the target
    # exactly.
    np.testing.assert_allclose(pose_of(session, "posture")[1], wanted[1], atol=0.01)
    moved = session.controller.state.data.oMi[3].translation - elbow.translation
    assert moved[1] > 0.05
    log = session.rollout()
    assert np.abs(log["task.hand.error"]).max() < 1e-4
    assert log["null_space_norm"].max() < 0.05  # of a motion of 1 rad/s, held for 1 ms
    session.receive({"do": "resume", "target": "posture"})
    go(session, 2.0)
    np.testing.assert_allclose(pose_of(session, "posture"), start, atol=1e-9)
    log = session.rollout()
    log.save(tmp_path / "led.npz")
    again = hsp.load_experiment(tmp_path / "led.npz").run()
    np.testing.assert_array_equal(again.q, log.q)


def test_a_returned_elbow_is_led_again_as_for_the_first_time(still: Session) -> None:
    """From the field's own posture, not from the one to which it was dragged."""
    grip, led = still.handles.targets["posture"], list[Array]()
    wanted = pose_of(still, "posture")
    wanted[1] += 0.1
    for _ in range(2):
        still.receive({"do": "move", "target": "posture", "pose": wanted.tolist()})
        led.append(grip._target.copy())  # type: ignore[attr-defined]
        go(still, 0.1)
        still.receive({"do": "resume", "target": "posture"})
        go(still, 2.0)
    np.testing.assert_array_equal(*led)


def test_a_return_is_no_jolt(still: Session) -> None:
    """A target and an obstacle dragged far away return at a limited speed."""
    go(still, 0.1)
    targets, obstacles = still.handles.places()
    far = np.add(targets["hand"], [0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0])
    still.receive({"do": "move", "target": "hand", "pose": far.tolist()})
    away = np.add(obstacles["ball"], [0.0, 0.0, 0.5])
    still.receive({"do": "obstacle", "name": "ball", "position": away.tolist()})
    go(still, 2.0)
    first = still.recorder.count
    still.receive({"do": "resume", "target": "hand"})
    still.receive({"do": "resume", "name": "ball"})
    go(still, 2.0)
    np.testing.assert_allclose(still.handles.places()[1]["ball"], obstacles["ball"])
    np.testing.assert_allclose(pose_of(still)[:3], targets["hand"][:3], atol=1e-4)
    rows = still.recorder.rows(first)
    for column in ("task.hand.actual", "obstacle.ball"):
        steps = np.linalg.norm(np.diff(rows[column][:, :3], axis=0), axis=1)
        assert steps.max() < 0.65 * still.row  # 15/8 of half a metre in 1.5 s
    assert not rows["status"].any()


def test_a_return_while_time_stands_still_is_shown_at_once(still: Session) -> None:
    """A handle is where its own path is, not where it was dragged in that instant."""
    go(still, 0.1)
    targets, obstacles = still.handles.places()
    far = np.add(targets["hand"], [0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0]).tolist()
    away = np.add(obstacles["ball"], [0.0, 0.0, 0.5]).tolist()
    still.receive({"do": "move", "target": "hand", "pose": far})
    still.receive({"do": "obstacle", "name": "ball", "position": away})
    dragged = still.handles.places()
    assert (dragged[0]["hand"], dragged[1]["ball"]) == (far, away)
    still.receive({"do": "resume", "target": "hand"})
    still.receive({"do": "resume", "name": "ball"})
    returned = still.handles.places()
    np.testing.assert_allclose(returned[0]["hand"], targets["hand"], atol=1e-9)
    np.testing.assert_allclose(returned[1]["ball"], obstacles["ball"], atol=1e-9)


LINK = "/robot/panda_joint4"
BAD: list[dict[str, Any]] = [
    {"do": "move", "target": "foot", "pose": [0.0] * 7},
    {"do": "move", "target": "hand", "pose": [0.4, 0.0, 0.4]},
    {"do": "move", "target": "hand", "pose": [0.4, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0]},
    {"do": "move", "target": "hand", "pose": [1e9, 0.0, 0.4, 0.0, 0.0, 0.0, 1.0]},
    {"do": "move", "target": "hand", "pose": ["a"] * 7},
    {"do": "move", "target": "hand"},
    {"do": "obstacle", "name": "ball", "position": [10**400, 0, 0]},
    {"do": "pull", "path": "/robot/nothing", "point": [0, 0, 0], "to": [0, 0, 0]},
    {"do": "pull", "path": "/obstacles/ball", "point": [0, 0, 0], "to": [0, 0, 0]},
    {"do": "pull", "path": LINK, "point": [0, 0, 0], "to": [1e6, 0, 0]},
    {"do": "set", "id": "null_space_gain", "value": math.nan},
    {"do": "set", "id": "null_space_gain", "value": True},
    {"do": "set", "id": "field", "value": 1.0},
    {"do": "set", "id": "nothing", "value": 1.0},
    {"do": "resume", "target": "ball"},
    {"do": "resume", "name": "hand"},
    {"do": "dance"},
    {},
]


@pytest.mark.parametrize("message", BAD, ids=repr)
def test_nonsense_is_answered_and_moves_nothing(
    session: Session, message: dict[str, Any]
) -> None:
    session.receive(message)
    assert session.handles.message
    assert session.handles.warning
    assert not session.controller.changes
    assert session.pull() is None
    go(session, 0.05)


class Told:
    """Records the gains and the weights set by a knob."""

    def __init__(self) -> None:
        self.weights: list[tuple[str, float]] = []

    def gains(self, name: str, gains: hsp.Gains) -> None:
        self.made = gains.matrices(6)

    def weight(self, name: str, weight: float) -> None:
        self.weights.append((name, weight))


def test_knobs_keep_damping_ratios() -> None:
    own = "tasks.hand.gains={natural_frequency: 5, damping_ratio: 0.7}"
    controller, reported = hsp.load_experiment(PANDA, own).controller, Told()
    knob = knobs_of(controller, 0.001)["frequency.hand"]
    knob.turn(reported, 20.0)  # type: ignore[arg-type]
    np.testing.assert_allclose(reported.made[0], 20.0**2 * np.eye(6))
    np.testing.assert_allclose(reported.made[1], 2.0 * 0.7 * 20.0 * np.eye(6))
    softer = _scaled(hsp.Impedance(100.0, damping=30.0), 0.25)
    assert (softer.stiffness, softer.damping) == (25.0, 15.0)
    # Up to ten times the gain, or a fifth per period; at least its present value.
    for period, high in ((0.001, 50.0), (0.02, 10.0), (1.0, 5.0)):
        knob = knobs_of(controller, period)["frequency.hand"]
        assert (knob.low, knob.high) == pytest.approx((0.5, high))


def test_a_field_that_is_switched_on_again_has_the_weights_of_the_sliders() -> None:
    """Also one that was moved while the field was off, which had no effect then."""
    controller, reported = hsp.load_experiment(PANDA).controller, Told()
    knobs = knobs_of(controller, 0.001)
    sliders = [name for name in knobs if name.startswith("weight.")]
    assert len(sliders) > 1
    terms = {name.removeprefix("weight."): knobs[name].value for name in sliders}
    first, second, *_ = terms
    knobs[f"weight.{first}"].turn(reported, 3.0)  # type: ignore[arg-type]
    knobs["field"].turn(reported, False)  # type: ignore[arg-type]
    knobs[f"weight.{second}"].turn(reported, 5.0)  # type: ignore[arg-type]
    knobs["field"].turn(reported, True)  # type: ignore[arg-type]
    off, on = dict.fromkeys(terms, 0.0), terms | {first: 3.0, second: 5.0}
    assert reported.weights == [(first, 3.0), *off.items(), *on.items()]


def test_a_slider_that_is_dragged_makes_few_changes(session: Session) -> None:
    for k in range(100):
        session.receive({"do": "set", "id": "null_space_gain", "value": 10.0 + 0.1 * k})
        session.advance()
    go(session, 0.2)
    assert session.handles.values["null_space_gain"] == pytest.approx(19.9)
    assert len(session.controller.changes) <= 12


def test_the_hand_continues_during_a_pull_at_the_elbow(
    session: Session, tmp_path: Path
) -> None:
    go(session, 0.2)
    q = session.controller.state.q.copy()
    place = session.controller.state.data.oMi[4]
    on_link = np.array([0.02, -0.03, 0.05])
    point = np.array(place.act(on_link))
    path = "/robot/panda_joint4/panda_link4"
    hand = point + np.array([0.0, 0.15, 0.0])
    message = {"do": "pull", "path": path, "point": point.tolist()}
    for _ in range(100):
        session.receive(message | {"to": hand.tolist()})
        session.advance()
    pull = session.pull()
    assert pull is not None
    at, hand, newtons = pull
    assert newtons == pytest.approx(300.0 * np.linalg.norm(hand - at))
    assert 1.0 < newtons < 45.0
    moved = session.controller.state.data.oMi[4].act(on_link)
    np.testing.assert_allclose(at, moved, atol=1e-9)
    assert moved[1] - point[1] > 0.01
    assert np.abs(session.controller.state.q - q).max() > 0.05
    session.receive({"do": "let_go"})
    assert session.pull() is None
    go(session, 0.5)
    log = session.rollout().save(tmp_path / "pulled.npz")
    with pytest.raises(ConfigError, match="a link was pulled"):
        hsp.load_experiment(log)


def test_a_pull_follows_the_hand_up_to_its_largest_force(session: Session) -> None:
    go(session, 0.1)
    point = np.array(session.controller.state.data.oMi[4].translation)
    pull = {"do": "pull", "path": "/robot/panda_joint4", "point": point.tolist()}
    for away, newtons in ((0.1, 30.0), (0.2, 60.0), (0.9, 100.0)):
        hand = point + np.array([0.0, away, 0.0])
        session.receive(pull | {"to": hand.tolist()})
        found = session.pull()
        assert found is not None
        np.testing.assert_allclose(found[1], hand)
        assert found[2] == pytest.approx(newtons)


@pytest.mark.parametrize("message", ["let_go", "left", "reset"])
def test_who_lets_go_leaves_or_begins_anew_pulls_no_more(
    message: str, session: Session
) -> None:
    """A closed page is ``left``: otherwise its last pull would never end."""
    go(session, 0.1)
    point = list(map(float, session.controller.state.data.oMi[4].translation))
    session.receive(
        {"do": "pull", "path": "/robot/panda_joint4", "point": point, "to": [0, 0, 9]}
    )
    assert session.pull() is not None
    if message == "reset":
        session.reset()
    else:
        session.receive({"do": message})
    assert session.pull() is None


def test_it_begins_anew(session: Session) -> None:
    go(session, 0.3)
    first = session.rollout().q
    session.receive({"do": "set", "id": "null_space_gain", "value": 30.0})
    session.receive({"do": "obstacle", "name": "ball", "position": [0.4, 0.4, 0.4]})
    go(session, 0.3)
    pull = {"do": "pull", "path": LINK, "point": [0.3, 0.0, 0.5], "to": [0.3, 0.0, 0.6]}
    session.receive(pull)
    go(session, 0.1)
    assert session.rollout().meta["changes_lost"] == "a link was pulled"
    session.reset()
    assert "changes_lost" not in session.rollout().meta  # it can be repeated
    assert session.handles.values["null_space_gain"] == 10.0
    assert not session.controller.changes
    go(session, 0.3)
    np.testing.assert_array_equal(session.rollout().q, first)
    session.rehearse()
    go(session, 0.3)
    np.testing.assert_array_equal(session.rollout().q, first)


def test_an_error_ends_the_run_and_not_the_session(
    experiment: hsp.Experiment,
) -> None:
    push = "{type: rigid_body, pushes: [{frame: panda_tcp, force: [1.0e9, 0, 0]}]}"
    wild = playable(PANDA, f"plant={push}")
    session = Session(wild)
    for _ in range(50):
        session.advance()
    assert "diverged" in session.over or "finite" in session.over
    rows = len(session.rollout())
    session.advance()
    assert len(session.rollout()) == rows
    session.reset()
    assert not session.over


@pytest.mark.parametrize("law", ["operational-space law", *further("no field")])
def test_another_law_goes_beside_it(law: str) -> None:
    """From the same state, with the same hand; without an effect on the play."""
    both = [Session(playable(PANDA, COARSE)) for _ in range(2)]
    for session in both:
        go(session, 0.5)
        wanted = pose_of(session)
        wanted[2] += 0.03
        session.receive({"do": "move", "target": "hand", "pose": wanted.tolist()})
        go(session, 0.1)
    session, alone = both
    assert session.laws == ["no field", "operational-space law", PLAIN]
    session.receive({"do": "compare", "law": law})
    other = session.other
    assert other is not None
    np.testing.assert_array_equal(other.q, session.controller.state.q)
    wanted[1] += 0.05
    for session in both:
        session.receive({"do": "move", "target": "hand", "pose": wanted.tolist()})
        session.receive({"do": "obstacle", "name": "ball", "position": [0.1, 0.3, 0.6]})
        go(session, 1.5)
    session, alone = both
    assert session.other is other
    log, same = session.rollout(), alone.rollout()
    np.testing.assert_array_equal(log.q, same.q)
    assert other.controller.state.t == session.t
    hand = [each.state.frame("panda_tcp") for each in (other.controller,
                                                       session.controller)]  # fmt: skip
    np.testing.assert_allclose(hand[0].position, hand[1].position, atol=1e-4)
    assert np.abs(other.q - session.controller.state.q).max() > 0.02  # the elbow
    session.receive({"do": "compare", "law": ""})
    assert session.other is None
    session.receive({"do": "compare", "law": "another"})
    assert session.handles.message == "there is no 'another' to compare with"
    session.receive({"do": "compare", "law": law})
    session.reset()
    assert session.other is None


def test_a_plain_impedance_goes_beside_it() -> None:
    """Equal at the start; then its stiffness is constant, and its hand lags."""
    session = Session(playable(PANDA, COARSE, "null_space.fields.0.weight=0"))
    go(session, 2.0)  # on the circle
    state, active = session.controller.state, session.controller.active_stack
    feedback = feedback_of(state, active)
    np.testing.assert_allclose(
        active.rows.jacobian @ PlainImpedance()(state, active), feedback, rtol=1e-6
    )
    session.receive({"do": "compare", "law": PLAIN})
    other = session.other
    assert other is not None
    go(session, 1.0)
    feed_forward = active.rows.acceleration[:3] - feedback_of(state, active)[:3]
    left = other.controller.active_stack.rows.error[:3]
    # Kp⁻¹ x_d'', up to the change of inertia since the start
    np.testing.assert_allclose(left, feed_forward / 10.0**2, atol=6e-4)
    assert np.linalg.norm(left) > 1e-3
    with_spring = Session(playable("panda", "tasks.hand.impedance={stiffness: 300}"))
    assert with_spring.laws == ["no field", "operational-space law"]


def test_a_failure_beside_a_play_ends_alone(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    go(session, 0.1)
    session.receive({"do": "compare", "law": "no field"})

    def fail(_: object) -> None:
        raise RuntimeError("an error in a field")

    monkeypatch.setattr(OtherLaw, "advance", fail)
    go(session, 0.1)
    assert session.other is None
    assert "no field: RuntimeError: an error in a field" in session.handles.message


def test_the_log_has_an_end(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsp_control.companions.play.session.LONGEST", 0.1)
    session.reset()
    for _ in range(20):
        session.advance()
    assert session.over == "the log is full at t = 0 s; reset to go on"
    assert len(session.rollout()) == 11


def test_another_law_goes_beside_it_up_to_the_last_row_of_the_log(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hsp_control.companions.play.session.LONGEST", 0.1)
    session.reset()
    go(session, 0.04)
    session.receive({"do": "compare", "law": "no field"})
    assert session.other is not None
    while not session.over:
        session.advance()
    assert session.t == pytest.approx(0.1)
    assert session.other.controller.state.t == session.t


# --- the picture and the loop --------------------------------------------------------


def test_the_picture_follows_the_dragged_object(session: Session) -> None:
    viewer = Viewer(session.experiment.robot, transport=Recorder())
    picture = Picture(session, viewer)
    recorder = viewer.transport
    assert isinstance(recorder, Recorder)
    setup = reported(recorder, "/play", "setup")
    assert [each["name"] for each in setup["targets"]] == ["hand", "posture"]
    assert [each["name"] for each in setup["obstacles"]] == ["ball"]
    assert [each["title"] for each in setup["plots"]] == [
        "Null-space error ‖e_N‖", "Clearance", "Efforts τ", "Speeds v", "Forces",
        "Task error", "Task error",
    ]  # fmt: skip
    effort = setup["plots"][2]
    assert effort["note"] == "Joint efforts; limits ±12, ±87."
    lines = [(each["value"], each["name"], each["curves"]) for each in effort["lines"]]
    assert lines == [
        (87.0, "limit of joint1 … joint4", [0, 1, 2, 3]),
        (-87.0, "limit of joint1 … joint4", [0, 1, 2, 3]),
        (12.0, "limit of joint5 … joint7", [4, 5, 6]),
        (-12.0, "limit of joint5 … joint7", [4, 5, 6]),
    ]
    edges = {line["name"]: line["value"] for line in setup["plots"][1]["lines"]}
    assert edges == {"contact": 0.0}
    assert {each["id"] for each in setup["controls"]} == set(session.handles.knobs)
    session.receive({"do": "obstacle", "name": "ball", "position": [0.2, 0.4, 0.5]})
    go(session, 1.5)
    picture.draw(running=True, rate=1.0)
    pose = reported(recorder, "/play", "pose")
    shown = {(t["path"], t["property"]): t["values"] for t in pose["tracks"]}
    for path in ("/obstacles/ball", "/influence/ball"):
        np.testing.assert_allclose(shown[path, "position"], [0.2, 0.4, 0.5], atol=1e-6)
    elbow = session.controller.state.data.oMi[4].translation
    np.testing.assert_allclose(
        shown["/robot/panda_joint4", "position"], elbow, atol=1e-6
    )
    targets = reported(recorder, "/play", "targets")
    np.testing.assert_allclose(targets["poses"]["hand"], pose_of(session))
    # In a pause the target is drawn where it is commanded; the hand moves there
    # afterwards.
    session.receive({"do": "obstacle", "name": "ball", "position": [0.2, 0.5, 0.5]})
    assert session.handles.places()[1]["ball"] == [0.2, 0.5, 0.5]
    session.advance()
    assert session.handles.places()[1]["ball"][1] < 0.41
    samples = reported(recorder, "/play", "samples 2")
    assert len(samples["times"]) == 150
    session.receive({"do": "set", "id": "field", "value": False})
    go(session, 0.25)  # past the ramp: its zone is no longer one
    picture.draw(running=True, rate=1.0)
    assert not recorder.paths("/influence")
    session.receive({"do": "set", "id": "field", "value": True})
    go(session, 0.25)
    picture.draw(running=True, rate=1.0)
    assert recorder.paths("/influence")


def test_a_target_out_of_reach_is_reported_with_its_distance(still: Session) -> None:
    """Half a metre too high; within reach again the message is gone."""
    recorder = Recorder()
    picture = Picture(still, Viewer(still.experiment.robot, transport=recorder))

    def said() -> str:
        picture.draw(running=True, rate=1.0)
        return str(reported(recorder, "/play", "targets")["away"].get("hand", ""))

    wanted = pose_of(still)
    assert said() == ""
    wanted[2] += 1.0
    still.receive({"do": "move", "target": "hand", "pose": wanted.tolist()})
    received = []
    for _ in range(130):
        go(still, 0.03)
        received.append(said())
    away = np.linalg.norm(still.rollout()["task.hand.error"][-1, :3])
    first, then, *last = dict.fromkeys(received)
    assert (first, then) == ("", "target far away")
    assert all(each.startswith("target out of reach") for each in last)
    assert received[-1] == f"target out of reach, {away:.2f} m"
    still.receive({"do": "resume", "target": "hand"})
    go(still, 3.0)
    assert said() == ""


def test_the_loop_follows_the_page_s_time_controls(session: Session) -> None:
    viewer = Viewer(session.experiment.robot, transport=Recorder())
    said: list[list[dict[str, Any]]] = [
        [{"do": "pause"}],
        [],
        [{"do": "step"}],
        [{"do": "step"}, {"do": "step"}],
        [{"do": "save"}],
        [{"do": "go"}],
    ]
    times: list[float] = []
    saved: list[float] = []

    def messages() -> list[dict[str, Any]]:
        times.append(session.t)
        return said.pop(0) if said else []

    def save() -> str:
        saved.append(session.t)
        return "saved"

    play(session, Picture(session, viewer), messages, save,
         end=lambda: session.t > 0.05)  # fmt: skip
    assert times[:6] == pytest.approx([0.0, 0.0, 0.0, 0.01, 0.03, 0.03])
    assert saved == pytest.approx([0.03])
    assert session.t > 0.05


# --- sources of a play ---------------------------------------------------------------


def test_a_hand_that_a_pull_holds_away_is_labelled_until_it_is_back() -> None:
    """By the last of the rows since the picture before."""
    away, back = [0.3, 0.4, 0.0], [0.0, 0.003, 0.004]
    for rows, label in (([back, away], True), ([away, back], False)):
        assert _off({"task.hand.error": np.array(rows)}, "hand") == label
    assert not _off({}, "hand")


def test_any_fixed_robot_is_a_playground() -> None:
    experiment = playable("ur5", "null_space.gain=4")
    assert experiment.controller.null_space_gain[0, 0] == 4.0
    assert experiment.scenario.simulation.control_period == 0.001
    session = Session(experiment)
    assert list(session.handles.targets) == ["hand", "posture"]
    assert list(session.handles.obstacles) == ["ball"]


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("talos", "talos ... free-flyer ... contacts ... forces/"),
        ("pandaa", "no configuration 'pandaa'"),
    ],
)  # fmt: skip
def test_unplayable_sources_are_reported(source: str, message: str) -> None:
    with pytest.raises(ConfigError, match=wording(message)):
        playable(source)


def test_the_operational_space_law_keeps_the_tasks_and_not_the_field(
    experiment: hsp.Experiment,
) -> None:
    """Both laws fulfil the tasks; only the exact one follows the moving field."""
    logs = []
    for operational in (False, True):
        session = Session(experiment)
        session.receive({"do": "set", "id": "operational", "value": operational})
        go(session, 3.0)
        logs.append(session.rollout())
    exact, compared = logs
    for log in logs:
        assert np.abs(log["task.hand.error"]).max() < 2e-3
    late = exact.t > 1.5
    # The exact one deviates since efforts are held for a millisecond.
    assert exact["null_space_norm"][late].max() < 0.02
    assert compared["null_space_norm"][late].max() > 0.3
    assert "operational" in compared.meta["changes_lost"]
    assert "changes_lost" not in exact.meta


def test_a_robot_that_walks_can_be_pulled_but_not_led(tmp_path: Path) -> None:
    """Feet and trunk are controlled by the plan; the run equals that of `simulate`."""
    session = Session(playable("walking/talos_walk"))
    assert [*session.handles.targets] == ["posture"]
    plan = session.recorder.plan  # whose streams are recorded
    assert plan is not None
    assert plan.plan is session.experiment.scenario.plan
    go(session, 0.5)
    log = session.rollout()
    assert log["plan.phase"][-1] >= 1.0
    log.save(tmp_path / "walked.npz")
    again = hsp.load_experiment(tmp_path / "walked.npz").run()
    np.testing.assert_array_equal(again.q, log.q)


@pytest.mark.parametrize(
    "error", [ValueError("mine"), CancelledError(), GeneratorExit(), MemoryError()]
)
def test_any_exception_of_a_field_ends_the_run_and_not_the_session(
    error: BaseException, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    go(session, 0.05)

    def fail(*_: object, **__: object) -> None:
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(type(session.compensated), "effort", fail)
        session.advance()
    assert session.over.startswith(type(error).__name__)
    assert len(session.rollout()) >= 5
    session.reset()
    go(session, 0.05)
    assert not session.over


@pytest.mark.parametrize(
    "error", [RuntimeError("mine"), CancelledError(), GeneratorExit(), MemoryError()]
)
def test_any_exception_of_a_page_s_change_ends_the_run_and_not_the_session(
    error: BaseException, session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(type(session.handles), "receive", fail)
        session.receive({"do": "anything"})
    assert session.over.startswith(type(error).__name__)
    session.reset()
    go(session, 0.05)
    assert not session.over


def test_a_start_out_of_reach_is_reported_after_each_reset() -> None:
    """0.3 s after it: a picture forgets when errors of the run before moved last."""
    tip = {"type": "frame_position", "axes": "xy",
           "trajectory": {"type": "hold", "point": [4.0, 0.0]}}  # fmt: skip
    session = Session(playable({
        "robot": {"name": "planar3r"}, "tasks": {"tip": tip},
        "start": {"joints": dict.fromkeys(("joint1", "joint2", "joint3"), 0.0)},
    }))  # fmt: skip
    recorder = Recorder()
    picture = Picture(session, Viewer(session.robot, transport=recorder))

    def said(seconds: float) -> str:
        for _ in range(round(seconds / session.row)):
            session.advance()
            picture.draw(running=True, rate=1.0)
        return str(reported(recorder, "/play", "targets")["away"].get("tip", ""))

    assert said(0.5).startswith("target out of reach")
    session.receive(
        {"do": "move", "target": "tip", "pose": [2.0, 1.0, 0.0, 0, 0, 0, 1]}
    )
    said(1.5)
    session.reset()
    picture.begin()
    assert said(0.5).startswith("target out of reach")


def test_joints_are_shown_as_shares_of_their_own_limits(session: Session) -> None:
    recorder = Recorder()
    picture = Picture(session, Viewer(session.robot, transport=recorder))
    for _ in range(20):
        session.advance()
    picture.draw(running=True, rate=1.0)
    shown, limits = reported(recorder, "/play", "joints"), session.controller.limits
    q, v, tau = (
        session.rollout()[name][-1] for name in ("joint_positions", "v", "tau")
    )
    assert limits is not None
    inside = (q - limits.lower) / (limits.upper - limits.lower)
    shares = {"q": inside, "v": v / limits.velocity, "tau": tau / limits.effort}
    for name, expected in shares.items():
        np.testing.assert_allclose(shown[name], expected, atol=1e-4)


class Clocked:
    """A session and its picture, whose time is the clock's; it records the rate."""

    t, row, over = 0.0, 0.01, ""
    rate = 0.0

    def advance(self) -> None:
        self.t += self.row

    def draw(self, *, running: bool, rate: float) -> None:
        self.rate = rate


def test_the_rate_that_is_shown_is_that_of_the_last_second(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock: list[float] = [5.0]
    monkeypatch.setattr(real_time, "monotonic", lambda: clock[-1])
    monkeypatch.setattr(real_time, "sleep", lambda s: clock.append(clock[-1] + s))
    both: Any = Clocked()
    for end in (2.5, 5.5):
        play(both, both, list, str, end=lambda end=end: both.t > end)
        assert both.rate == pytest.approx(1.0, abs=0.05)
