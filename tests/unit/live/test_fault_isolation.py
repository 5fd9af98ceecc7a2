"""The wrong source of a joint is isolated by the model, then by other joints."""

import numpy as np
import pytest

from hsp_control.live.fault_isolation import FaultIsolation

CLEAR, DOUBTFUL, UNDECIDED = 0.2, 0.4, 0.8  # ratios of the two surprises
V, Q = (True, False), (False, True)
NEITHER = (False, False)
BOTH = "v.", "q."


def isolated(
    isolation: FaultIsolation,
    *surprises: tuple[float, float],
    wrong: str = "",
    constant: str = "",
    slight: bool = True,
    trusted: str = "",
) -> list[tuple[bool, bool]]:
    """Return the right sources of joints with these surprises of (v, q).

    ``wrong``: "1" for joints with one wrong source; all by default. ``trusted``: "v" or
    "q" for joints of which only that one is trusted so far, "." for both.
    """
    joints = np.array([each == "1" for each in wrong or "1" * len(surprises)])
    still = np.array([each in constant.split() for each in "vq"])[:, None]
    still = np.tile(still, joints.size)
    used = [[each in kind for each in trusted or "." * len(joints)] for kind in BOTH]
    by_v, by_q = isolation.isolate(
        joints,
        np.array(surprises).T,
        still,
        np.full(joints.size, slight),
        np.array(used),
    )
    return list(zip(by_v.tolist(), by_q.tolist(), strict=True))


def test_the_source_that_deviates_less_is_right() -> None:
    assert isolated(FaultIsolation(2), (CLEAR, 1.0), (1.0, CLEAR)) == [V, Q]
    assert isolated(FaultIsolation(1), (DOUBTFUL, 1.0)) == [V]
    assert isolated(FaultIsolation(1), (UNDECIDED, 1.0)) == [NEITHER]


@pytest.mark.parametrize(("trusted", "right"), [("q.", Q), ("v.", V), ("..", V)])
def test_without_evidence_the_lost_kind_of_the_others_is_wrong(
    trusted: str, right: tuple[bool, bool]
) -> None:
    """A velocity that drifts slowly is expected as it comes: 0.003 to 0.007 rad/s."""
    slow = {"wrong": "01", "trusted": trusted}
    found = isolated(FaultIsolation(2), (0.0, 0.0), (0.003, 0.007), **slow)
    assert found[1] == right
    found = isolated(FaultIsolation(2), (0.0, 0.0), (0.03, 0.07), **slow)
    assert found[1] == V


def test_of_joints_in_doubt_one_that_is_undecided_leaves_none_decided() -> None:
    found = isolated(FaultIsolation(3), (1.0, DOUBTFUL), (1.0, UNDECIDED), (1.0, 0.9))
    assert found == [NEITHER] * 3


@pytest.mark.parametrize("wrong", [V, Q])
def test_the_kind_that_is_wrong_elsewhere_is_wrong_in_joints_in_doubt(
    wrong: tuple[bool, bool],
) -> None:
    """For any surprises of their own; also later, but where these are clearer still."""
    right = wrong[::-1]

    def of(ratio: float, source: tuple[bool, bool]) -> tuple[float, float]:
        return (1.0, ratio) if source == V else (ratio, 1.0)

    isolation = FaultIsolation(3)
    doubtful = (DOUBTFUL, 1.0), (1.0, UNDECIDED)
    assert isolated(isolation, of(CLEAR, wrong), *doubtful) == [right] * 3
    assert isolated(isolation, *doubtful, of(CLEAR, right)) == [right] * 3
    found = isolated(isolation, *doubtful, of(0.05, right))
    assert found[2] == wrong  # that source of this joint is right


def test_an_undecided_joint_follows_those_that_were_decided_before() -> None:
    """None of them beyond doubt, as with a wrong model; and only if they agree."""
    isolation = FaultIsolation(2)
    nothing, unclear = (0.0, 0.0), (1.0, UNDECIDED)
    assert isolated(isolation, (1.0, DOUBTFUL), nothing, wrong="10")[0] == Q
    assert isolated(isolation, nothing, unclear, wrong="01")[1] == Q
    isolation = FaultIsolation(3)
    isolated(isolation, (1.0, DOUBTFUL), (DOUBTFUL, 1.0), nothing, wrong="110")
    assert isolated(isolation, nothing, nothing, unclear, wrong="001")[2] == NEITHER


def test_joints_that_are_not_wrong_say_nothing_of_a_kind() -> None:
    isolation = FaultIsolation(2)
    assert isolated(isolation, (1.0, CLEAR), (1.0, 0.9), wrong="01")[1] == NEITHER


def test_where_both_kinds_are_wrong_somewhere_none_decides() -> None:
    isolation = FaultIsolation(3)
    isolated(isolation, (1.0, CLEAR), (CLEAR, 1.0), (0.0, 0.0), wrong="110")
    assert isolated(isolation, (0, 0), (0, 0), (1.0, 0.9), wrong="001")[2] == NEITHER


def test_an_undecided_joint_is_decided_by_others_only() -> None:
    """Its own surprise is no longer evidence: its expectation follows no source."""
    isolation = FaultIsolation(2)
    isolation.undecided = np.array([True, False])
    assert isolated(isolation, (1.0, CLEAR), (0, 0), wrong="00")[0] == NEITHER
    assert isolated(isolation, (1.0, CLEAR), (CLEAR, 1.0), wrong="01")[0] == V


@pytest.mark.parametrize(
    ("constant", "right"), [("q", V), ("v", Q), ("v q", NEITHER), ("", NEITHER)]
)
def test_a_constant_source_is_wrong_if_the_difference_is_slight(
    constant: str, right: tuple[bool, bool]
) -> None:
    """The other one changes; but a clear case is decided by the surprises."""
    doubtful, clear = (0.02, 0.03), (CLEAR, 1.0)
    assert isolated(FaultIsolation(1), doubtful, constant=constant) == [right]
    far = isolated(FaultIsolation(1), doubtful, constant=constant, slight=False)
    assert far == [NEITHER]
    assert isolated(FaultIsolation(1), clear, constant=constant) == [V]
