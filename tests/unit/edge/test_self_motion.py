"""The null-space part that limits see is the whole effect of a field on the law."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_robots import load

import hsp_control as hsp
from hsp_control.engine.plans import planned

FAR = hsp.Hold([2.0, 0.5, 0.5])


@pytest.mark.parametrize("levels", [1, 2])
@pytest.mark.parametrize("metric", ["identity", "mass"])
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_it_is_the_effect_of_a_field_on_the_law(
    metric: str, levels: int, seed: int
) -> None:
    """For the damped law, whose P is no projector; the law is linear in φ_N."""
    robot, rng = load("panda"), np.random.default_rng(seed)
    q = robot.home() + 0.3 * rng.standard_normal(7)
    v, g = 0.3 * rng.standard_normal(7), 300.0 * rng.standard_normal(7)
    tasks: list[hsp.Task] = [hsp.FramePosition("panda_tcp", FAR)]
    if levels == 2:
        tasks.append(hsp.FrameOrientation("panda_tcp", priority=2))
    weighted = metric == "mass"
    made = hsp.Controller(
        robot,
        tasks,
        hsp.fields.FunctionField(lambda state: g),
        metric=hsp.metrics.MassMatrixMetric() if weighted else None,
        start=robot.home(),
    )
    made.compute(0.0, q, v)
    law = made._active.law
    assert law.edge_level[0] > 0  # damped, and beyond limits
    _, (self_motions, _) = law.self_motions(v)
    whole, self_motion = law.edge.damped.copy(), self_motions[1].copy()
    law.problem.field.g[:], law.problem.field.g_dot[:] = v, 0.0  # u = 0
    planned([law.call(v, beside=True)]).run(0.0)
    by_tasks = law.edge.damped.copy()
    scale = np.abs(whole).max()
    np.testing.assert_allclose(self_motion, whole - by_tasks, atol=1e-9 * scale)
    assert np.abs(self_motion).max() > 0.1 * scale
