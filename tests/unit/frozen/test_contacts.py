"""A frozen controller stands: contacts that are the same at all times."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from frozen_library import FAILED, OK, Opened
from frozen_runs import EXAMPLE, compiled, computed, random_states, replayed

import hsp_control as hsp
from hsp_control.common.exceptions import FreezeError

SEED = 61


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return compiled(EXAMPLE / "replay.c", tmp_path_factory.mktemp("replay"))


@pytest.mark.smoke
@pytest.mark.parametrize(
    ("name", "statuses"),
    [
        ("whole_body/solo12_trunk", {0, 1, 2}),  # forces are redistributed, too
        ("whole_body/talos_weak_arm", {0, 1, 2, 3, 4}),  # and static efforts
    ],
)
def test_the_same_bits_on_feet(
    name: str, statuses: set[int], replay: Path, tmp_path: Path
) -> None:
    experiment = hsp.load_experiment(name)
    controller = experiment.controller
    frozen = hsp.freeze(controller, tmp_path / "frozen.hsp")
    met: set[float] = set()
    for away, speed in ((0.02, 0.05), (0.2, 0.3), (0.5, 0.5)):
        given = controller.robot, experiment.q0, 50, SEED
        states = random_states(*given, away=away, speed=speed)
        expected = computed(controller, states)
        met |= {*expected[:, 0]}
        np.testing.assert_array_equal(replayed(replay, frozen, states), expected)
    assert met == statuses


def test_nothing_brakes_a_robot_on_feet(tmp_path: Path) -> None:
    experiment = hsp.load_experiment("whole_body/solo12_trunk")
    opened = Opened(hsp.freeze(experiment.controller, tmp_path / "frozen.hsp"))
    q, v = experiment.q0, np.zeros(18)
    assert opened.step(0.0, q, v) >= OK
    last = opened.tau.copy()
    assert opened.stop(0.001, q, v) == FAILED
    assert "on feet" in opened.error
    np.testing.assert_array_equal(opened.tau, last)
    assert "solo12.payload" not in opened.ports


def solo(**changes: Any) -> hsp.Controller:
    """Return a standing robot, with parts of its configuration changed."""
    own = hsp.load_experiment("whole_body/solo12_trunk").controller
    given = {"contacts": own.contacts, "start": own.setup.start.state.q} | changes
    return hsp.Controller(own.robot, [hsp.CenterOfMass()], **given)


@pytest.mark.parametrize(
    ("kept", "key"),
    [(2, "contacts"), (0, "base")],
)
def test_contacts_that_leave_the_base_free_are_refused(
    kept: int, key: str, tmp_path: Path
) -> None:
    own = hsp.load_experiment("whole_body/solo12_trunk").controller
    changes = {"contacts": own.contacts[:kept]}
    if not kept:
        changes["base"] = "flying"  # type: ignore[assignment]
    with pytest.raises(FreezeError, match=rf"^{key}: .*hold all of the base"):
        hsp.freeze(solo(**changes), tmp_path / "frozen.hsp")


def test_a_contact_that_comes_or_is_pressed_is_refused(tmp_path: Path) -> None:
    own = hsp.load_experiment("walking/solo12_trot").controller
    controller = solo(contacts=own.contacts)
    with pytest.raises(FreezeError, match=r"^contacts\.front_left\.schedule: "):
        hsp.freeze(controller, tmp_path / "frozen.hsp")
    wiper = hsp.load_experiment("forces/panda_wipe").controller
    pressing = hsp.Controller(wiper.robot, wiper.tasks, contacts=wiper.contacts)
    with pytest.raises(FreezeError, match=r"^contacts\.wiper\.force: "):
        hsp.freeze(pressing, tmp_path / "frozen.hsp")
