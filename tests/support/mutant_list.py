"""The edits of ``make mutants``, room by room, and the tests that ought to see them."""

from typing import NamedTuple


class Mutant(NamedTuple):
    """One edit that makes the code wrong and keeps it running.

    Attributes:
        name: What is wrong then.
        file: The edited file, from the checkout's folder.
        old: The text that is replaced; it stands in the file once.
        new: What replaces it.
        tests: Arguments of pytest: the tests that should go red.
    """

    name: str
    file: str
    old: str
    new: str
    tests: str


PACKAGE = "hsp_control/"
COMMON, ROBOT, SHAPES = PACKAGE + "common/", PACKAGE + "robot/", PACKAGE + "geometry/"
STREAMS = PACKAGE + "trajectories/streams/"
PATHS, TASKS = PACKAGE + "trajectories/", PACKAGE + "tasks/"
FIELDS = PACKAGE + "null_space/fields/"
METRICS = PACKAGE + "null_space/metrics/"
CONTACTS = PACKAGE + "constraints/contacts/"
LIMITS = PACKAGE + "constraints/limits/"
LAW, CONTROL = PACKAGE + "law/", PACKAGE + "control/"
ACTUATION, COMPENSATION = CONTROL + "actuation/", CONTROL + "compensation/"
SIMULATION, LIVE = PACKAGE + "simulation/", PACKAGE + "live/"
PLANTS = SIMULATION + "plants/"
DECLARATION = PACKAGE + "declaration/"
CONFIG, CLI = PACKAGE + "config/", PACKAGE + "cli/"

MODELS = ROBOT + "description/mujoco/"
IN_MUJOCO = PLANTS + "mujoco/"

UNIT = "tests/unit/"
EVERY_FIELD = UNIT + "null_space/test_every_field.py -k "
EVERY_SHAPE = UNIT + "null_space/test_clearance_rates.py -k "
EVERY_TASK = UNIT + "tasks/test_every_task.py -k "
EVERY_PATH = UNIT + "trajectories/test_trajectories.py -k "
OF_STREAMS = UNIT + "trajectories/test_streams.py -k "
ON_NUMBERS = UNIT + "law/test_law_on_numbers.py -k "
ON_ROBOTS = UNIT + "law/test_law_on_robots.py -k "
OF_LEVELS = UNIT + "law/test_hierarchy.py -k "
OF_CONTACTS = UNIT + "constraints/test_contacts.py -k "
OF_LIMITS = UNIT + "control/test_limits.py -k "
OF_STEPS = UNIT + "control/test_limited_step.py -k "
OF_FADING = UNIT + "control/test_changes_where_limits_bind.py -k "
OF_QP = UNIT + "control/test_dual_active_set.py -k "
OF_COMPENSATION = UNIT + "control/test_compensation.py -k "
OF_STRETCHES = UNIT + "simulation/test_stretch.py -k "
OF_IMPERFECTIONS = UNIT + "simulation/test_imperfections.py -k "

MUTANTS = (
    # ---------------------------------------------------------------------- common
    Mutant(
        "kept kernels: a called kernel may change",
        COMMON + "kernel_cache.py",
        "yield from _function(function, seen)",
        "yield function.__name__.encode()",
        UNIT + "common/test_kernel_cache.py -k only_an_edit",
    ),
    # ---------------------------------------------------------------- trajectories
    Mutant(
        "circle's acceleration with the rate once",
        PATHS + "circle.py",
        "acceleration[i] = -rate * rate * radial",
        "acceleration[i] = -rate * radial",
        EVERY_PATH + "test_rates_are_those_of_the_motion",
    ),
    Mutant(
        "blend's velocity without s'",
        PATHS + "blend.py",
        "velocity[i] = v + s_dot * gap + s * gap_dot",
        "velocity[i] = v + s * gap_dot",
        EVERY_PATH + "test_rates_are_those_of_the_motion",
    ),
    Mutant(
        "spline's coefficients without k!",
        PATHS + "spline.py",
        "* widths**k / factorial(k)",
        "* widths**k",
        EVERY_PATH + "spline",
    ),
    # ----------------------------------------------------------------------- robot
    Mutant(
        "centre of mass: momentum for velocity",
        ROBOT + "centroidal.py",
        "velocity[i] += J[i, j] * v[j]",
        "velocity[i] += A[i, j] * v[j]",
        EVERY_TASK + "panda-mass",
    ),
    Mutant(
        "angular momentum: A' about a point at rest",
        ROBOT + "centroidal.py",
        "A_dot[4, j] - (z * px - x * pz)",
        "A_dot[4, j]",
        EVERY_TASK + "angular_momentum",
    ),
    # -------------------------------------------------------------------- geometry
    Mutant(
        "clearance: gradient's moment backwards",
        SHAPES + "closed_form.py",
        "change += J[a, c] * force[a] + J[3 + a, c] * moment[a]",
        "change += J[a, c] * force[a] - J[3 + a, c] * moment[a]",
        EVERY_SHAPE + "panda-sphere",
    ),
    Mutant(
        "clearance: rate without the curvature",
        SHAPES + "closed_form.py",
        "slope * n_dot[a] + curvature * d_dot * n[a]",
        "slope * n_dot[a]",
        EVERY_SHAPE + "panda-sphere",
    ),
    Mutant(
        "clearance: obstacles at rest",
        SHAPES + "closed_form.py",
        "twist[0, a] += own[12 + a]",
        "twist[0, a] += 0.0 * own[12 + a]",
        EVERY_SHAPE + "panda-capsule",
    ),
    # ----------------------------------------------------------------------- tasks
    Mutant(
        "position: e' without the reference's rate",
        TASKS + "axes.py",
        "e_dot[k] = x_d_dot[k] - velocity[i]",
        "e_dot[k] = -velocity[i]",
        EVERY_TASK + "panda-position",
    ),
    Mutant(
        "orientation without its transport term",
        TASKS + "frame_orientation.py",
        "out[i] += w_d_dot[i] - term[i]",
        "out[i] += w_d_dot[i]",
        EVERY_TASK + "panda-orientation",
    ),
    Mutant(
        "pose without the reference's acceleration",
        TASKS + "frame_pose.py",
        "a_x[i] = desired[2, i]",
        "a_x[i] = 0.0",
        EVERY_TASK + "panda-pose",
    ),
    Mutant(
        "pointing: rows' rate without w × c",
        TASKS + "pointing.py",
        "J_dot[k, j] += turn[i] * J_frame[3 + i, j]",
        "J_dot[k, j] += 0.0 * turn[i] * J_frame[3 + i, j]",
        EVERY_TASK + "panda-direction",
    ),
    Mutant(
        "posture: e' without the reference's rate",
        TASKS + "joint_posture.py",
        "e_dot[k] = displacement_dot[k] - v[i]",
        "e_dot[k] = -v[i]",
        EVERY_TASK + "panda-posture",
    ),
    Mutant(
        "relative pose: the reference turns backwards",
        TASKS + "relative_pose.py",
        "lz -= wx * ky - wy * kx",
        "lz += wx * ky - wy * kx",
        EVERY_TASK + "seen",
    ),
    Mutant(
        "angular momentum: the error grows",
        TASKS + "angular_momentum.py",
        "out.error_rate[:] = -(feedback.Kp @ out.error)",
        "out.error_rate[:] = feedback.Kp @ out.error",
        EVERY_TASK + "angular_momentum",
    ),
    Mutant(
        "gains: Kv is not ramped",
        CONTROL + "gains_in_force.py",
        "self.feedback[each.key].numbers[:] = numbers",
        "self.feedback[each.key].numbers[0] = numbers[0]",
        UNIT + "tasks/test_gains.py",
    ),
    Mutant(
        "impedance: a change waits for nothing",
        CONTROL + "stiffening.py",
        "return np.asarray(now + given / needed * step)",
        "return np.asarray(now + step)",
        "tests/integration/test_compliance.py -k adds_no_energy",
    ),
    Mutant(
        "gains: a running loop bears any of them",
        CONTROL + "held_gains.py",
        "if held_radius(Kp, Kv, period) < 1.0 + _ROUNDING:",
        "if held_radius(0.9 * Kp, 0.9 * Kv, period) < 1.0 + _ROUNDING:",
        "tests/integration/test_compliance.py -k period_does_not_bear",
    ),
    Mutant(
        "limits: a push moves no bound",
        LIMITS + "acceleration_bounds.py",
        "bounds.a_lower[i] -= up + max(down, -most)",
        "bounds.a_lower[i] -= max(down, -most)",
        "tests/integration/test_compliance.py -k bound_by_a_push",
    ),
    Mutant(
        "streams: a plan begins a millisecond late",
        STREAMS + "running.py",
        "state = self.chart.rebased(self._segments[-1].state(t))",
        "state = self.chart.rebased(self._segments[-1].state(t + 1e-3))",
        OF_STREAMS + "keep_their_bounds",
    ),
    Mutant(
        "streams: quintics ignore the jerk",
        STREAMS + "bounds.py",
        "for k in (1, 2, 3):",
        "for k in (1, 2):",
        OF_STREAMS + "points_keep_their_bounds",
    ),
    Mutant(
        "streams: an old chunk counts",
        STREAMS + "waypoints.py",
        "newer = replace or message.chunk or alone",
        "newer = replace or alone",
        OF_STREAMS + "chunk_replaces",
    ),
    Mutant(
        "streams: a run hears the last one's",
        STREAMS + "inbox.py",
        "self._number = inbox.taken",
        "self._number = 0",
        OF_STREAMS + "new_run",
    ),
    Mutant(
        "streams: silence is never too long",
        STREAMS + "running.py",
        "if self.age > self._policy.stop_after:",
        "if self.age > 10.0 * self._policy.stop_after:",
        OF_STREAMS + "silence",
    ),
    Mutant(
        "streams: the first message compiles",
        STREAMS + "running.py",
        "self._compile(start)",
        "start",
        UNIT + "live/test_live_streams.py",
    ),
    Mutant(
        "impedance: no rate of the inertia",
        TASKS + "impedance_gains.py",
        "Kv[i, j] -= 0.5 * root[i, j]",
        "Kv[i, j] -= 0.0 * root[i, j]",
        UNIT + "tasks/test_impedance.py -k equation",
    ),
    Mutant(
        "impedance: rotated axes stand still",
        TASKS + "impedance_gains.py",
        "T_dot[i, 0] = -part[i, 0] - (b * w[2] - c * w[1])",
        "T_dot[i, 0] = -part[i, 0]",
        UNIT + "tasks/test_impedance.py -k equation",
    ),
    Mutant(
        "impedance: a bounded spring pulls on",
        TASKS + "impedance_gains.py",
        "return 1.0 / beyond if beyond > 1.0 else 1.0",
        "return 1.0",
        UNIT + "tasks/test_impedance.py -k equation",
    ),
    Mutant(
        "impedance: the mass matrix of another state",
        TASKS + "compliant_task.py",
        "StepPlan(task.follow, (*update, *task.write, write, *task.write))",
        "StepPlan(task.follow, (*task.write, write, *task.write))",
        UNIT + "tasks/test_impedance.py -k all_joints",
    ),
    Mutant(
        "impedance: bounded spring taken for soft",
        TASKS + "compliant_task.py",
        "parts_of(numbers)[3][:] = 0.0",
        "parts_of(numbers)[3][:] *= 1.0",
        UNIT + "tasks/test_impedance.py -k of_the_step",
    ),
    Mutant(
        "observer: it cancels what it is only to see",
        COMPENSATION + "momentum_observer.py",
        "        if not self.cancel:\n            return np.zeros(robot.nv)\n",
        "",
        "tests/integration/test_compliance.py -k observer",
    ),
    # ------------------------------------------------------------------ null space
    Mutant(
        "joint centering: gradient uphill",
        FIELDS + "joint_centering.py",
        "gradient[i] = stiffness[k] * away",
        "gradient[i] = -stiffness[k] * away",
        EVERY_FIELD + "joint_centering",
    ),
    Mutant(
        "joint centering: rate without stiffness",
        FIELDS + "joint_centering.py",
        "rate[i] = stiffness[k] * v[i]",
        "rate[i] = v[i]",
        EVERY_FIELD + "joint_centering",
    ),
    Mutant(
        "limit barrier: the upper limit attracts",
        FIELDS + "limit_barrier.py",
        "(slope_lower - slope_upper) / unit[k]",
        "(slope_lower + slope_upper) / unit[k]",
        EVERY_FIELD + "limit_barrier",
    ),
    Mutant(
        "limit barrier: rate in another unit",
        FIELDS + "limit_barrier.py",
        "/ (unit[k] * unit[k])",
        "/ unit[k]",
        EVERY_FIELD + "limit_barrier",
    ),
    Mutant(
        "target posture: d for sin d",
        FIELDS + "target_posture.py",
        "gradient[i] = weights[i] * sin(d)",
        "gradient[i] = weights[i] * d",
        EVERY_FIELD + "target_posture",
    ),
    Mutant(
        "target posture: rate without cos d",
        FIELDS + "target_posture.py",
        "rate[i] = weights[i] * cos(d) * d_dot",
        "rate[i] = weights[i] * d_dot",
        EVERY_FIELD + "target_posture",
    ),
    Mutant(
        "target posture: its motion has no rate",
        FIELDS + "target_posture.py",
        "d, d_dot = gradient[i] - moved[i], v[i] - moved_rate[i]",
        "d, d_dot = gradient[i] - moved[i], v[i]",
        EVERY_FIELD + "target_posture",
    ),
    Mutant(
        "equal joint angles: only one joint is pushed",
        FIELDS + "equal_joint_angles.py",
        "gradient[j] += slope",
        "gradient[j] += 0.0 * slope",
        EVERY_FIELD + "equal_joint_angles",
    ),
    Mutant(
        "equal joint angles: rate's sign",
        FIELDS + "equal_joint_angles.py",
        "rate[i] -= slope_dot",
        "rate[i] += slope_dot",
        EVERY_FIELD + "equal_joint_angles",
    ),
    Mutant(
        "manipulability: gradient uphill",
        FIELDS + "manipulability.py",
        "slope[i, j] *= outer",
        "slope[i, j] *= -outer",
        EVERY_FIELD + "manipulability",
    ),
    Mutant(
        "manipulability: rate without that of f",
        FIELDS + "manipulability.py",
        "outer * slope_rate[i, j] + outer_rate * slope[i, j]",
        "outer * slope_rate[i, j]",
        EVERY_FIELD + "manipulability",
    ),
    Mutant(
        "inverse condition: gradient's second term",
        FIELDS + "inverse_condition.py",
        "inner = J[i, j] / size - Z[i, j] / stretch",
        "inner = J[i, j] / size + Z[i, j] / stretch",
        EVERY_FIELD + "inverse_condition",
    ),
    Mutant(
        "inverse condition: rate without that of f",
        FIELDS + "inverse_condition.py",
        "2.0 * (phi_dot * inner + phi * inner_dot)",
        "2.0 * phi * inner_dot",
        EVERY_FIELD + "inverse_condition",
    ),
    Mutant(
        "transmission: gradient uphill",
        FIELDS + "transmission.py",
        "slope[i, j] = outer * change",
        "slope[i, j] = -outer * change",
        EVERY_FIELD + "transmission",
    ),
    Mutant(
        "transmission: rate of a direction at rest",
        FIELDS + "transmission.py",
        "(y_dot[i] * z[j] + y[i] * z_dot[j])",
        "(y[i] * z_dot[j])",
        EVERY_FIELD + "transmission",
    ),
    Mutant(
        "point distance: the obstacle attracts",
        FIELDS + "point_distance.py",
        "gradient[i] += scale * J[a, i] * r",
        "gradient[i] -= scale * J[a, i] * r",
        EVERY_FIELD + "point_distance",
    ),
    Mutant(
        "point distance: rate with 2 for 4",
        FIELDS + "point_distance.py",
        "r_dot - 4.0 * nearing / square * r",
        "r_dot - 2.0 * nearing / square * r",
        EVERY_FIELD + "point_distance",
    ),
    Mutant(
        "weight: the ramp's rate without its duration",
        FIELDS + "weight.py",
        "slope = 30.0 * s * s * (1.0 - s) ** 2 / self.duration",
        "slope = 30.0 * s * s * (1.0 - s) ** 2",
        UNIT + "null_space/test_weights.py -k ramp_and_its_rate",
    ),
    Mutant(
        "g' without W'",
        FIELDS + "cost.py",
        "g_dot[i] += W_dot[i, j] * g[j]",
        "g_dot[i] += 0.0 * W_dot[i, j] * g[j]",
        EVERY_FIELD + "target_posture",
    ),
    Mutant(
        "M' without Cᵀ",
        METRICS + "mass_matrix.py",
        "W_dot[i, j] = (C[i, j] + C[j, i]) / unit",
        "W_dot[i, j] = C[i, j] / unit",
        ON_ROBOTS + "applies_the_short_form",
    ),
    Mutant(
        "metric of coordinates: A Aᵀ for AᵀA",
        METRICS + "coordinates.py",
        "return np.asarray(A.T @ A)",
        "return np.asarray(A @ A.T)",
        ON_ROBOTS + "coordinates_metric",
    ),
    # ----------------------------------------------------------------- constraints
    Mutant(
        "contact: its velocity grows",
        CONTACTS + "contact.py",
        "a[k] = -damping * total",
        "a[k] = damping * total",
        OF_CONTACTS + "rows_are_the_velocity",
    ),
    Mutant(
        "floating base: rows at rest",
        CONTACTS + "unactuated.py",
        "(U.T @ M_dot + U_dot.T @ M) / self._mass",
        "(U.T @ M_dot) / self._mass",
        OF_CONTACTS + "unactuated_rows",
    ),
    Mutant(
        "velocity limit ignored",
        LIMITS + "acceleration_bounds.py",
        "rising = _speed_barrier(speed - v[i], bandwidth, jerk[i])",
        "rising = np.inf",
        OF_LIMITS + "bounds_are_the_barriers",
    ),
    Mutant(
        "velocity limit: the effort's rate ignored",
        LIMITS + "acceleration_bounds.py",
        "barrier = min(barrier, np.sqrt(jerk * gap))",
        "pass",
        OF_LIMITS + "bounds_are_the_barriers",
    ),
    Mutant(
        "speed margin: error not covered",
        LIMITS + "acceleration_bounds.py",
        "speed = velocity[i] - _GROWTH * error[i] / (2.0 * bandwidth * _STEEPER)",
        "speed = velocity[i]",
        OF_LIMITS + "margin_of_the_speed",
    ),
    Mutant(
        "position barrier: the drift moves no bound",
        LIMITS + "acceleration_bounds.py",
        "high -= min(max(drift[i], 0.0), most)",
        "high -= 0.0",
        OF_LIMITS + "drives_no_joint_beyond",
    ),
    Mutant(
        "position barrier: damping drives",
        LIMITS + "acceleration_bounds.py",
        "low = -bandwidth * bandwidth * (position - lower[i]) - damping",
        "low = -bandwidth * bandwidth * (position - lower[i]) + damping",
        OF_LIMITS + "position_bounds",
    ),
    Mutant(
        "minimum distance counted from contact",
        LIMITS + "minimum_distance.py",
        "h = d - self.minimum",
        "h = d",
        UNIT + "constraints/test_limits.py -k distance_rows",
    ),
    Mutant(
        "static effort: slope's sign",
        LIMITS + "static_effort.py",
        "return -side[:, None] * slope[i], b",
        "return side[:, None] * slope[i], b",
        UNIT + "control/test_deviation_cost.py -k static_rows",
    ),
    # ------------------------------------------------------------------------- law
    Mutant(
        "law without J'",
        LAW + "law.py",
        "a_x[k] - drift[k] - missing[k]",
        "a_x[k] - missing[k]",
        ON_NUMBERS + "short_form",
    ),
    Mutant(
        "law without g'",
        LAW + "law.py",
        "u[i] += g_dot[i] - bent[i]",
        "u[i] -= bent[i]",
        ON_NUMBERS + "short_form",
    ),
    Mutant(
        "law without J'ᵀ",
        LAW + "law.py",
        "multiply_transposed(J_dot, w, bent)",
        "multiply_transposed(J, w, bent)",
        ON_NUMBERS + "short_form",
    ),
    Mutant(
        "law without W'",
        LAW + "law.py",
        "bent[i] -= u[i]",
        "bent[i] -= 0.0 * u[i]",
        ON_NUMBERS + "short_form",
    ),
    Mutant(
        "e_N of W' not halved",
        LAW + "law.py",
        "lowered[i] = x[i] - 0.5 * e_N[i]",
        "lowered[i] = x[i] - e_N[i]",
        ON_NUMBERS + "short_form",
    ),
    Mutant(
        "K_N transposed",
        LAW + "law.py",
        "multiply(K_N, e_N, u)",
        "multiply_transposed(K_N, e_N, u)",
        ON_NUMBERS + "short_form",
    ),
    Mutant(
        "inverse not bounded in the singularity",
        COMMON + "bounded_inverse.py",
        "inverse = 1.0 / x if x >= floor else (2.0 - x / floor) / floor",
        "inverse = 1.0 / x",
        UNIT + "law/test_pseudo_inverse.py -k bound",
    ),
    Mutant(
        "threshold does not follow the feedback",
        LAW + "threshold.py",
        "max(least, np.sqrt(beyond / steepest))",
        "least",
        UNIT + "law/test_threshold.py",
    ),
    Mutant(
        "feedback of the whole error, however large",
        TASKS + "task.py",
        "if square > largest[part, 2] * largest[part, 2]:",
        "if square < 0.0:",
        UNIT + "tasks/test_largest_error.py",
    ),
    Mutant(
        "levels: a lower one disturbs a higher one",
        LAW + "hierarchy.py",
        "Q[i, j] -= total",
        "Q[i, j] -= 0.5 * total",
        OF_LEVELS + "conflict_leaves_the_upper_level_exact",
    ),
    Mutant(
        "levels: the field without W'",
        LAW + "hierarchy.py",
        "Y[i] += W_dot[i, j] * (x[j] - 0.5 * e_N[j])",
        "Y[i] += 0.0 * W_dot[i, j] * (x[j] - 0.5 * e_N[j])",
        OF_LEVELS + "recursion",
    ),
    # --------------------------------------------------------------------- control
    Mutant(
        "effort limit ignored",
        ACTUATION + "actuation.py",
        "self._tau_upper[:] = self._kept.limits.effort",
        "self._tau_upper[:] = np.inf",
        OF_LIMITS + "contradiction",
    ),
    Mutant(
        "effort rate ignored",
        ACTUATION + "held_effort.py",
        "min(max(sent[i] - rate[i] * period,",
        "min(max(sent[i] - np.inf,",
        OF_LIMITS + "effort_rate_needs",
    ),
    Mutant(
        "distances give way before motion",
        ACTUATION + "limited_step.py",
        '"distances": 30.0',
        '"distances": 0.03',
        OF_STEPS + "distances_are_relaxed_less",
    ),
    Mutant(
        "limits on efforts have no rows",
        ACTUATION + "actuation.py",
        "some = np.isfinite(limits.effort) | np.isfinite(limits.effort_rate)",
        "some = np.isnan(limits.effort)",
        OF_STEPS + "optimum",
    ),
    Mutant(
        "changes: one set of limits is compiled",
        ACTUATION + "actuation.py",
        "for kept, _ in self._all:",
        "for kept, _ in self._all[:1]:",
        OF_FADING + "compiled",
    ),
    Mutant(
        "contact with a schedule ends with a jump",
        CONTROL + "planned_contact.py",
        "x = min(self.weight(t) / HELD, 1.0)",
        "x = min(self.presence.at(t) / HELD, 1.0)",
        OF_FADING + "schedule",
    ),
    Mutant(
        "task begins with a jump at a contact's end",
        CONTROL + "setup.py",
        "if each != now), now)",
        "if each != now and each < 0.0), now)",
        OF_FADING + "plan",
    ),
    Mutant(
        "deviation: null space as dear as the task",
        ACTUATION + "deviation_cost.py",
        "costs[0, last] = exponent",
        "costs[0, last] = 0.0",
        OF_STEPS + "optimum",
    ),
    Mutant(
        "limited step: contacts may move",
        ACTUATION + "step_qp.py",
        "1 if contacts_held else 0",
        "0",
        OF_STEPS + "optimum",
    ),
    Mutant(
        "QP: a multiplier of the wrong sign stays",
        ACTUATION + "dual_active_set.py",
        "if i >= problem.equalities and work.held[i] * shares[c] < least:",
        "if i < problem.equalities and work.held[i] * shares[c] < least:",
        OF_QP + "any_warm_start",
    ),
    Mutant(
        "friction cone with 2μ",
        CONTACTS + "contact.py",
        "return self.friction / float(np.sqrt(2.0))",
        "return 2.0 * self.friction / float(np.sqrt(2.0))",
        OF_CONTACTS + "friction_cone",
    ),
    Mutant(
        "commanded force: nothing balances it",
        ACTUATION + "contact_forces.py",
        "w[i] -= A[i, k] * reference[k]",
        "w[i] -= 0.0 * A[i, k] * reference[k]",
        UNIT + "control/test_commanded_forces.py -k closed_form",
    ),
    Mutant(
        "commanded force: friction along the motion",
        ACTUATION + "commanded_forces.py",
        "out[:2] = -contact.friction",
        "out[:2] = contact.friction",
        UNIT + "control/test_commanded_forces.py -k sliding_point",
    ),
    Mutant(
        "force feedback winds up",
        COMPENSATION + "force_feedback.py",
        "if change * missing > 0.0 and",
        "if change * missing > 1e9 and",
        UNIT + "control/test_force_feedback.py -k gives_way",
    ),
    Mutant(
        "predictor: its lead time dropped",
        COMPENSATION + "command.py",
        "return t + predictor.effort_delay * period, q, v",
        "return t, q, v",
        OF_COMPENSATION + "at_which_its_effort_acts",
    ),
    Mutant(
        "predictor: leads by the sensors' delay too",
        COMPENSATION + "command.py",
        "return t + predictor.effort_delay * period, q, v",
        "return t + predictor.periods * period, q, v",
        OF_COMPENSATION + "at_which_its_effort_acts",
    ),
    Mutant(
        "predictor: one period too short",
        COMPENSATION + "command.py",
        "islice(self._under_way, 1, None)",
        "islice(self._under_way, 2, None)",
        OF_COMPENSATION + "predictor",
    ),
    Mutant(
        "observer adds what it should cancel",
        COMPENSATION + "command.py",
        "offset = offset - self._observer.cancelled",
        "offset = offset + self._observer.cancelled",
        OF_COMPENSATION + "what_is_cancelled",
    ),
    Mutant(
        "velocity filter at half its cut-off",
        COMPENSATION + "velocity_filter.py",
        "pole = exp(-2.0 * pi * self.cutoff * period)",
        "pole = exp(-pi * self.cutoff * period)",
        OF_COMPENSATION + "half_of_the_power",
    ),
    Mutant(
        "friction feed-forward brakes",
        COMPENSATION + "friction_feed_forward.py",
        "return np.asarray(coulomb + friction.viscous * v)",
        "return -np.asarray(coulomb + friction.viscous * v)",
        OF_COMPENSATION + "known_friction",
    ),
    Mutant(
        "integral action winds up",
        COMPENSATION + "integral_action.py",
        "grows = e * integral >= 0.0 if saturated else False",
        "grows = False",
        OF_COMPENSATION + "unwinds",
    ),
    Mutant(
        "rate check: drives without delay",
        COMPENSATION + "linear_loop.py",
        "self._performed(drives[0])",
        "self._performed(drives[-1])",
        UNIT + "control/test_rate_check.py -k limits_of_theory",
    ),
    Mutant(
        "limits: the null space swings",
        CONTROL + "actuation/deviation_cost.py",
        "below = _OF_ERROR * np.sqrt(square) / directions.size",
        "below = 0.0 * np.sqrt(square) / directions.size",
        "tests/integration/test_limit_configurations.py -k swing",
    ),
    Mutant(
        "limits: springs come first",
        ACTUATION + "deviation_cost.py",
        "(standing or not springs)",
        "(standing or not springs or True)",
        "tests/unit/control/test_deviation_cost.py -k springs_yield",
    ),
    Mutant(
        "clearance: the rate on a cylinder's axis",
        "hsp_control/geometry/signed_distance.py",
        "0.0 if on_axis else 1.0 / r",
        "1.0 / max(r, 1e-320)",
        "tests/unit/geometry/test_distances.py -k nothing_is_nan",
    ),
    Mutant(
        "limits: on contacts an error loosens levels",
        ACTUATION + "deviation_cost.py",
        "last, standing = costs.shape[1] - 1, directions.first > 0",
        "last, standing = costs.shape[1] - 1, False",
        OF_STEPS + "optimum",
    ),
    Mutant(
        "limits: no speed is held against a force",
        LIMITS + "acceleration_bounds.py",
        "rising -= min(steady[i], 0.0)",
        "rising -= 0.0 * steady[i]",
        OF_LIMITS + "held_against",
    ),
    Mutant(
        "limits: no level below shares what is lost",
        CONTROL + "actuation/deviation_cost.py",
        "if costs[0, k] > 0.0:",
        "if costs[0, k] < 0.0:",
        UNIT + "control/test_deviation_cost.py -k levels_share",
    ),
    Mutant(
        "limits: rows of a spectrum as directions",
        ACTUATION + "deviation_cost.py",
        "return bool(found)",
        "return True",
        UNIT + "control/test_deviation_cost.py -k levels_share",
    ),
    Mutant(
        "limits: a damped level shares nothing",
        ACTUATION + "deviation_cost.py",
        "own * (free / own) ** (lost * lost)",
        "own",
        UNIT + "control/test_deviation_cost.py -k levels_share",
    ),
    Mutant(
        "free step: a law that is not finite is free",
        CONTROL + "free_step.py",
        "0.0 <= value < CODES * BEYOND_ANY_LEVEL",
        "0.0 <= value",
        UNIT + "control/test_free_step.py -k finite",
    ),
    Mutant(
        "free step: calls in Python are left out",
        CONTROL + "free_step.py",
        " or not are_native(sending)",
        "",
        UNIT + "control/test_free_step.py -k native",
    ),
    # ------------------------------------------------------------------ simulation
    Mutant(
        "RK4: weights of k3 and k4 swapped",
        ROBOT + "integrators.py",
        "A[0, i] + 2.0 * A[1, i] + 2.0 * A[2, i] + A[3, i]",
        "A[0, i] + 2.0 * A[1, i] + A[2, i] + 2.0 * A[3, i]",
        UNIT + "simulation/test_integrators.py -k test_order",
    ),
    Mutant(
        "the effort of the period before is held",
        SIMULATION + "loops.py",
        "q, v = plant.advance(t, stop, tau)",
        "q, v = plant.advance(t, stop, held if t > times[0] else tau)\n"
        "            held = tau",
        UNIT + "simulation/test_closed_loop.py -k sampled_control_holds",
    ),
    Mutant(
        "stretch: the first effort is held throughout",
        SIMULATION + "stretch.py",
        "held[i] = effort[i]",
        "held[i] += 0.0",
        OF_STRETCHES + "last_bit",
    ),
    Mutant(
        "stretch: limits that bind are not noticed",
        SIMULATION + "stretch.py",
        "if not is_free(code):",
        "if code < 0.0:",
        OF_STRETCHES + "limit_binds",
    ),
    Mutant(
        "stretch: held efforts are not observed",
        ACTUATION + "actuation.py",
        "calls = [self._held.expect(state.v, a)]",
        "calls = [self._held.expect(state.v, a)][:0]",
        OF_STRETCHES + "teaches",
    ),
    Mutant(
        "stretch: states between rows are not seen",
        SIMULATION + "stretch.py",
        "moving = table([steps.native, *self._seeing])",
        "moving = table([steps.native])",
        OF_STRETCHES + "between_two_rows",
    ),
    Mutant(
        "stretch: efforts that are held teach nothing",
        SIMULATION + "stretch.py",
        "        run(sending, sending_when, t)\n",
        "",
        OF_STRETCHES + "teaches",
    ),
    Mutant(
        "stretch: steps before a change go on",
        SIMULATION + "stretch.py",
        "if self._loop is None or step is not self._step:",
        "if self._loop is None:",
        OF_STRETCHES + "change_is_made",
    ),
    Mutant(
        "stretch: the controller's time stays behind",
        SIMULATION + "stretch.py",
        'state["t"] = start + (k + made - 1) * span / periods',
        'state["t"] += 0.0',
        OF_STRETCHES + "last_step",
    ),
    Mutant(
        "the row's period for the control period",
        SIMULATION + "loops.py",
        "period = (end - start) / periods",
        "period = end - start",
        OF_COMPENSATION + "third_order",
    ),
    Mutant(
        "drives: delay one period short",
        PLANTS + "drives/effort_delay.py",
        "while len(queue) <= self.periods:",
        "while len(queue) < max(self.periods, 1):",
        OF_IMPERFECTIONS + "a_late_drive",
    ),
    Mutant(
        "payload: inertia of a ball halved",
        PLANTS + "model_changes/payload.py",
        "inertia = 0.4 * self.mass",
        "inertia = 0.2 * self.mass",
        OF_IMPERFECTIONS + "payload",
    ),
    Mutant(
        "friction without sticking",
        PLANTS + "sticking_plant.py",
        "if rest > c[i]:",
        "if rest > 0.0:",
        OF_IMPERFECTIONS + "a_cart_slides",
    ),
    Mutant(
        "log: friction_used without μ",
        SIMULATION + "contact_columns.py",
        "ratios = tangential[loaded] / (contact.friction * local[loaded, 2])",
        "ratios = tangential[loaded] / local[loaded, 2]",
        OF_CONTACTS + "how_much_friction",
    ),
    Mutant(
        "journal: checksum ignored",
        SIMULATION + "journal.py",
        "if len(payload) < length or zlib.crc32(payload, zlib.crc32(kind)) != check:",
        "if len(payload) < length:",
        UNIT + "simulation/test_journal.py -k changed_byte",
    ),
    # ------------------------------------------------------------------------ live
    Mutant(
        "packets: checksum ignored",
        LIVE + "packets.py",
        "!= zlib.crc32(body):",
        "!= zlib.crc32(body) and not body:",
        UNIT + "live/test_live_udp.py -k one_bit",
    ),
    Mutant(
        "watchdog one period early",
        LIVE + "simulated_robot.py",
        "if self._missing > self.watchdog:",
        "if self._missing >= self.watchdog:",
        UNIT + "live/test_safe_stop.py -k watchdog_counts",
    ),
    Mutant(
        "safe stop: damping drives",
        LIVE + "safe_stop.py",
        "braking = -settings.damping * (state.mass_matrix @ v)",
        "braking = settings.damping * (state.mass_matrix @ v)",
        UNIT + "live/test_safe_stop.py -k takes_energy",
    ),
    Mutant(
        "live: an age that is NaN passes",
        LIVE + "valid_measurement.py",
        "    if not isfinite(value):",
        "    if abs(value) > 1e308:",
        UNIT + "live/test_live_faults.py -k each_fault",
    ),
    Mutant(
        "live: a frozen state is believed",
        LIVE + "state_reader.py",
        "untrue = self._frozen.fault(new, applied) or self._monitor.jump(new)",
        "untrue = self._monitor.jump(new)",
        UNIT + "live/test_live_faults.py -k each_fault",
    ),
    Mutant(
        "live: completed while it moves",
        LIVE + "one_run.py",
        "standing = speed <= self.settings.stop.standstill",
        "standing = True",
        UNIT + "live/test_live_faults.py -k completed_means",
    ),
    Mutant(
        "live: the rate counts from what was sent",
        LIVE + "effort_limiter.py",
        "if effort is None or np.array_equal(effort, self.sent):",
        "if effort is None or effort is not None:",
        UNIT + "live/test_live_robot.py -k add_up",
    ),
    Mutant(
        "live: the robot accepts any rate",
        LIVE + "effort_check.py",
        "if step[i] > allowed[i]:",
        "if step[i] > np.inf:",
        UNIT + "live/test_live_robot.py -k beyond_its_limits",
    ),
    Mutant(
        "journal: a frame that Ctrl-C cuts stays",
        SIMULATION + "journal.py",
        "os.ftruncate(self._file, self._size)",
        "os.fsync(self._file)",
        UNIT + "live/test_live_journal.py -k ctrl_c",
    ),
    Mutant(
        "rate check: the load couples nothing",
        COMPENSATION + "loaded_loop.py",
        "np.linalg.inv(one + s * self.difference)",
        "np.diag(np.diag(np.linalg.inv(one + s * self.difference)))",
        UNIT + "control/test_loaded_loop.py -k grows_and_decays",
    ),
    # -------------------------------------------------------------- config and cli
    Mutant(
        "parts: unknown keys accepted",
        DECLARATION + "part.py",
        'extra="forbid"',
        'extra="ignore"',
        UNIT + "config/test_experiment.py -k every_mistake",
    ),
    Mutant(
        "command line: --set ignored",
        CLI + "loading.py",
        "(*options.overrides, *overrides)",
        "overrides",
        UNIT + "cli/test_cli.py -k a_log_that_numpy_alone",
    ),
    Mutant(
        "command line: --strict ignored",
        CLI + "loading.py",
        "        strict=options.strict or bool(options.allow),",
        "        strict=bool(options.allow),",
        "tests/integration/test_trust.py -k refused",
    ),
    Mutant(
        "MuJoCo models: reference of joints ignored",
        MODELS + "dynamics.py",
        "place = place * self._moved(joint, 0.0)",
        "place = place * self._moved(joint, scene.qpos0[scene.jnt_qposadr[joint]])",
        UNIT + "robot/test_mujoco_models.py -k random_scene",
    ),
    Mutant(
        "MuJoCo models: gear of armatures not squared",
        MODELS + "motors.py",
        "return gear**2 *",
        "return gear *",
        UNIT + "robot/test_mujoco_models.py -k armature",
    ),
    Mutant(
        "MuJoCo models: locked elsewhere than told",
        MODELS + "selection.py",
        "configuration[model.jnt_qposadr[inside[name]]] = value",
        "pass",
        UNIT + "robot/test_mujoco_models.py -k home",
    ),
    Mutant(
        "MuJoCo models: strict reading ignored",
        MODELS + "compiling.py",
        "    if access.strict:",
        "    if False:",
        UNIT + "config/test_mjcf_config.py -k strict",
    ),
    Mutant(
        "MuJoCo scene: pushes ignored",
        IN_MUJOCO + "scene_plant.py",
        "        applied += self.pushes.effort(t, q)\n",
        "",
        UNIT + "simulation/test_mujoco_scene.py -k pushes",
    ),
    Mutant(
        "MuJoCo contacts: action without reaction",
        IN_MUJOCO + "engine.py",
        "sign = 1.0 if side == 1 else -1.0",
        "sign = 1.0",
        UNIT + "simulation/test_mujoco_scene.py -k push_each_other",
    ),
    # --------------------------------------------------------- view, command line
    Mutant(
        "view: meshes come before light and title",
        PACKAGE + "visualization/viewer/page_server.py",
        "self._deliver(self.hub.scene.stage())",
        "self._deliver([])",
        "tests/system/test_viewer_server.py -k late",
    ),
    Mutant(
        "check: rows of contacts are null space",
        CLI + "check.py",
        "robot.nv - held - rank",
        "robot.nv - rank",
        UNIT + "cli/test_cli.py -k contacts",
    ),
)
"""All of them, from the lowest room to the highest."""
