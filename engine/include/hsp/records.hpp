// Arrays that belong together, as one argument: `TaskSample<In>` reads what `TaskSample<Out>`
// writes. In Python each is a record of the same names.
#pragma once
#include <hsp/kind.hpp>

namespace hsp {

// J a + J'v = a_x: the rows of a task; e is the reference minus the actual value.
template <template <int...> class As, int m = 'm'> struct TaskSample {
  As<m, 'n'> jacobian, jacobian_dot;
  As<m> error, error_rate, acceleration;
};

// A field and its rate along the motion.
template <template <int...> class As> struct FieldSample {
  As<'n'> g, g_dot;
};

// W = L Lᵀ and its rate along the motion.
template <template <int...> class As> struct MetricSample {
  As<'n', 'n'> W, L, W_dot;
};

enum Form { IDENTITY, CONSTANT, VARYING };  // W = I; W' = 0; any W

// x, x' and x''.
template <template <int...> class As, int d = 'd'> struct TrajectorySample {
  As<d> position, velocity, acceleration;
};

// R, ω and ω', in world axes.
template <template <int...> class As> struct OrientationSample {
  As<3, 3> rotation;
  As<3> angular_velocity, angular_acceleration;
};

// A body's origin and its rotation.
template <template <int...> class As> struct PoseSample {
  TrajectorySample<As, 3> position;
  OrientationSample<As> orientation;
};

// A frame in the axes of the frame that it is relative to, linear rows before angular rows.
template <template <int...> class As> struct FrameMotion {
  As<6, 'n'> jacobian, jacobian_dot;
  As<3, 3> rotation;
  As<3> position;
  As<6> velocity;  // of the origin, and angular
  // The velocity in excess of J v, and its rate: the acceleration beyond J a + J'v. Zero except for
  // a frame that moves in its joint, as during a tool change.
  As<6> own_velocity, own_acceleration;
};

// A point: the translational part of a frame's motion.
template <template <int...> class As> struct PointMotion {
  As<3, 'n'> jacobian, jacobian_dot;
  As<3> position, velocity;
  As<3> own_acceleration;  // see FrameMotion
};

}  // namespace hsp
