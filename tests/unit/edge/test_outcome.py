"""The law's outcome where an exact law stands beside the damped one."""

import numpy as np
import pytest
from loaded_robots import load

import hsp_control as hsp
from hsp_control.engine.plans import planned
from hsp_control.law.outcome import DAMPED, EXACT, NOT_FINITE, LawOutcome


@pytest.mark.parametrize(("away", "damped"), [(0.0, ""), (0.2, ""), (2.0, "panda_tcp")])
def test_in_the_interior_only_the_exact_law_acts(away: float, damped: str) -> None:
    """The threshold, and with it the damped law, depends on the error."""
    robot = load("panda")
    q = robot.home() + np.array([0.08, -0.3, 0.4, -0.1, -0.3, 0.2, 0.5])
    here = robot.state(0.0, q, np.zeros(7)).position("panda_tcp")
    goal = away * np.array([0.6, 0.0, 1.0])
    task = hsp.FramePosition("panda_tcp", hsp.Hold(here + goal))
    made = hsp.Controller(robot, [task], start=q, limits=None)
    output = made.compute(0.0, q, np.zeros(7))
    law = made._active.law
    assert output.damped == damped
    assert law.outcome.outcome is (DAMPED if damped else EXACT)

    # Where a limit may be near the damped law, that is written, too; a is unchanged.
    assert law.edge_level[0] == (away > 1.0)
    a, e_N = law.acceleration.copy(), law.null_space_error.copy()
    planned([law.damped_beside(np.zeros(7))]).run(0.0)
    assert law.edge_level[0] == (away > 0.0)
    assert law.outcome.outcome is (DAMPED if damped else EXACT)
    np.testing.assert_array_equal(law.acceleration, a)
    np.testing.assert_array_equal(law.null_space_error, e_N)
    differs = np.abs(law.edge.damped - a).max() > 1e-3 * np.abs(a).max()
    assert differs == (away == 0.2)


def test_a_law_that_was_not_resolved_is_not_finite() -> None:
    outcome = LawOutcome.allocate()
    assert outcome.outcome is NOT_FINITE
    outcome.finite[0] = 1
    assert outcome.outcome is EXACT
