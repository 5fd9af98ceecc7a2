"""The law of Hsu, Hauser and Sastry (1989) over a metric: equations (7) and (13).

    x = g - v                          the self-motion that the field still asks for
    e_N = (I - J#J) x                                            the null-space error
    u = g' + K_N e_N - W⁻¹[ J'ᵀ w - W'(x - e_N/2) ],  w = ΛJx      φ_N = P u is (13)
    a = J#(a_x - J'v) + (I - J#J) u                                               (7)

With W = I, P u is equation (13), since J⁺J'J⁺ + (J⁺)' = P J'ᵀ(JJᵀ)⁻¹: no derivative of
a pseudo-inverse is needed. ``docs/law.md``, Equations (7) and (13) over a metric,
has the proof for every metric.
"""

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import multiply, multiply_transposed
from hsp_control.law.pseudo_inverse import (
    apply_pseudo_inverse,
    apply_pseudo_inverse_transpose,
)
from hsp_control.law.samples import (
    IDENTITY,
    VARYING,
    FieldSample,
    MetricSample,
    TaskSample,
    raise_covector,
)


@kernel
def null_space_command(
    task: TaskSample,
    field: FieldSample,
    metric: MetricSample,
    form: int,
    Q: Array,
    X: Array,
    v: Array,
    K_N: Array,
    scratch: Array,
    e_N: Array,
    u: Array,
) -> None:
    """Write e_N and u, whose projection P u is the paper's φ_N, equation (13).

    Then V = ½ e_Nᵀ W e_N obeys V' = -e_Nᵀ W K_N e_N (Proposition 2).

    Args:
        task: All tasks stacked: J and J' are read, shape (m, nv) each.
        field: g and g', shape (nv,) each.
        metric: W, its Cholesky factor L and W', shape (nv, nv) each.
        form: The metric's form.
        Q: One factor of J# = L⁻ᵀ Qᵀ X, shape (m, nv).
        X: The other, shape (m, m).
        v: Velocity, shape (nv,).
        K_N: Null-space gain [1/s], shape (nv, nv).
        scratch: Shape (6, max(m, nv)).
        e_N: Null-space error, shape (nv,).
        u: Null-space command before projection, shape (nv,).
    """
    J, J_dot, g, g_dot = task.jacobian, task.jacobian_dot, field.g, field.g_dot
    W, L, W_dot = metric.W, metric.L, metric.W_dot
    m, n = Q.shape
    x, lowered, bent = scratch[0, :n], scratch[1, :n], scratch[2, :n]
    Jx, w, part = scratch[3, :m], scratch[4, :m], scratch[5, :m]

    for i in range(n):
        x[i] = g[i] - v[i]
    multiply(J, x, Jx)
    apply_pseudo_inverse(Q, X, L, form, Jx, part, e_N)
    for i in range(n):
        e_N[i] = x[i] - e_N[i]

    if form == IDENTITY:
        apply_pseudo_inverse_transpose(Q, X, L, form, x, part, w)
    else:
        multiply(W, x, lowered)
        apply_pseudo_inverse_transpose(Q, X, L, form, lowered, part, w)

    multiply_transposed(J_dot, w, bent)
    if form == VARYING:
        for i in range(n):
            lowered[i] = x[i] - 0.5 * e_N[i]
        multiply(W_dot, lowered, u)
        for i in range(n):
            bent[i] -= u[i]
    raise_covector(bent, L, form)

    multiply(K_N, e_N, u)
    for i in range(n):
        u[i] += g_dot[i] - bent[i]


@kernel
def acceleration(
    task: TaskSample,
    L: Array,
    form: int,
    Q: Array,
    X: Array,
    v: Array,
    u: Array,
    scratch: Array,
    a: Array,
) -> None:
    """Write a = J#(a_x - J'v) + (I - J#J) u: equation (7) with φ_N = P u.

    Args:
        task: All tasks stacked: J, J' and a_x = x_d'' + Kv e' + Kp e, m rows.
        L: Cholesky factor of the metric, shape (nv, nv).
        form: The metric's form.
        Q: One factor of J# = L⁻ᵀ Qᵀ X, shape (m, nv).
        X: The other, shape (m, m).
        v: Velocity, shape (nv,).
        u: Null-space command, shape (nv,); zero for the paper's first simulation.
        scratch: Shape (6, max(m, nv)).
        a: Acceleration, shape (nv,).
    """
    J, J_dot, a_x = task.jacobian, task.jacobian_dot, task.acceleration
    m, n = Q.shape
    drift, missing, part = scratch[3, :m], scratch[4, :m], scratch[5, :m]
    multiply(J_dot, v, drift)
    multiply(J, u, missing)
    for k in range(m):
        missing[k] = a_x[k] - drift[k] - missing[k]
    apply_pseudo_inverse(Q, X, L, form, missing, part, a)
    for i in range(n):
        a[i] += u[i]
