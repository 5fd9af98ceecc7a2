"""The workspace boundary: the law is exact where tasks can be met, otherwise damped.

    a = a_exact + μ (a_damped - a_exact),      0 ≤ μ ≤ 1

Out of reach an error persists, and with it the feedback's command. Near a singular
posture the exact inverse of that changes faster than a sampled loop can follow, so the
inverse of a_damped is bounded by thresholds that follow the command (`threshold.py`).
But a threshold cannot distinguish an error that persists from a step within reach.
Three conditions can: a singularity, a large error, or an active limit. So μ has three
shares, all 0 in the interior of the workspace:

    near    σ ≥ σ_x: 0;  σ ≤ σ_x/2: 1.    σ_x is a tenth of the robot's size
    far     |e| ≤ 0.85 ℓ: 0;  |e| ≥ ℓ: 1.      ℓ is the largest error that is fed back
    limits  a_t is within all limits: 0;  it is three times the permitted one: 1;
            at most r_f, what errors at rest command of the permitted one

with σ the smallest singular value of the stack J, whatever the metric. The first two
are here, the last is in `limit_share.py`, where limits are known. All are continuous,
so a is.

``docs/edge.md`` has the consequences.
"""

NEAR = 0.1
"""σ_x over the robot's size: the law is exact in every posture that is farther from a
singular one, for any command."""

FAR = 0.85
"""Fraction of ℓ up to which the share of large errors is 0."""
