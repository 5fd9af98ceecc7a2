// The functions of `hsp_step.h`. No exception leaves them.
#include <hsp_step.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>

#include "../src/build.hpp"
#include "frozen_plan.hpp"

namespace {

using hsp::Index;
using hsp::frozen::FrozenPlan;
using hsp::frozen::Port;
using hsp::frozen::SentTo;

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double most_periods = 100.0;  // from one step to the next
constexpr int most_repeated = 5;        // periods in a row with the last effort
thread_local char opening[1024] = "";   // why `hsp_open` returned null

void write(char* to, std::size_t size, const char* text) { std::snprintf(to, size, "%s", text); }

}  // namespace

struct hsp_controller {
  explicit hsp_controller(const char* file)
      : plan(file),
        tau(plan.array<double>("tau", plan.move().v.size())),
        status(plan.array<std::int64_t>("status", 1)),
        delivered(plan.array<std::int64_t>("delivered", 1)),
        period(plan.array<double>("period", 1)),
        origin(plan.array<double>("origin", 1)),
        stops(&plan.stop() != &plan.move()),
        expected_q(plan.move().q),
        expected_v(plan.move().v) {
    if (stops) {
      stop_tau = plan.array<double>("stop.tau", plan.move().v.size());
      holding = plan.array<std::int64_t>("stop.holding", 1);
      damping = plan.array<double>("stop.damping", 1);
    }
    for (const Port& each : plan.ports())
      ports.push_back({each.name.c_str(), each.unit.c_str(), each.meaning.c_str(),
                       static_cast<std::size_t>(each.size), each.is_input()});
  }

  FrozenPlan plan;
  std::vector<hsp_port> ports;
  double* tau;
  const std::int64_t *status, *delivered;
  const double* period;
  double* origin;              // the clock's reading at time 0 [s]
  std::optional<double> last;  // time of the last step [s]
  const bool stops;            // whether hsp_stop brakes
  const double* stop_tau = nullptr;
  std::int64_t* holding = nullptr;
  const double* damping = nullptr;  // [1/s]
  bool stopping = false;
  int refused = 0;                     // periods in a row without a new effort
  hsp::Vector expected_q, expected_v;  // the last accepted state, and the state predicted from it
  bool blind = false;                  // whether hsp_stop uses the predicted state
  std::atomic<hsp_status> error = HSP_OK;     // of the last request
  std::atomic<const char*> reason = nullptr;  // why a value was refused, if that is known
  char failure[512] = "";                     // an exception's message
  std::atomic_flag busy = ATOMIC_FLAG_INIT;
};

namespace {

// A request of one handle: refused while another thread makes one.
template <class Request> hsp_status made(hsp_controller* controller, Request request) noexcept {
  if (!controller) return HSP_WRONG_VALUE;
  if (controller->busy.test_and_set(std::memory_order_acquire)) return HSP_BUSY;
  hsp_status status = HSP_FAILED;
  controller->reason = nullptr;
  try {
    status = request(*controller);
  } catch (const std::exception& error) {
    write(controller->failure, sizeof controller->failure, error.what());
  } catch (...) {
    write(controller->failure, sizeof controller->failure, "an unknown exception");
  }
  controller->error = status < 0 ? status : HSP_OK;
  controller->busy.clear(std::memory_order_release);
  return status;
}

void accept(hsp_controller& of, double t, const hsp::Move& move) {
  of.last = t;
  of.expected_q = move.q;
  of.expected_v = move.v;
}

// Make a step; its effort, or the last one, is then `of.tau`.
hsp_status moved(hsp_controller& of, double t, const double* q, const double* v) {
  hsp::Move& move = of.plan.move();
  const Eigen::Map<const hsp::Vector> q_in(q, move.q.size()), v_in(v, move.v.size());
  if (!std::isfinite(t)) return HSP_WRONG_STATE;
  if (!of.last) *of.origin = t;  // times are relative to the first step
  else if (t < *of.last || t > *of.last + most_periods * *of.period) return HSP_WRONG_CLOCK;
  if (!move.to(t, q_in, v_in)) return HSP_WRONG_STATE;
  accept(of, t, move);
  return *of.delivered ? static_cast<hsp_status>(*of.status) : HSP_NOT_FINITE;
}

// Brake, or hold, at the state to which the stop was moved.
hsp_status braked(hsp_controller& of) {
  const Eigen::Map<const hsp::Vector> found(of.stop_tau, of.plan.stop().v.size());
  if (!found.allFinite()) return HSP_NOT_FINITE;
  Eigen::Map<hsp::Vector>(of.tau, found.size()) = found;
  return *of.holding ? HSP_HOLDING : HSP_BRAKING;
}

// A period with an unknown state: the prediction moves at constant speed while the last effort is
// repeated, and then decelerates like a robot braked by -k M v.
void expect(hsp_controller& of) {
  hsp::Vector &q = of.expected_q, &v = of.expected_v;
  if (q.size() == v.size()) q += *of.period * v;  // joints with linear coordinates
  if (of.refused >= most_repeated && of.stops) v *= std::max(1.0 - *of.damping * *of.period, 0.0);
}

// Brake, or hold: the effort, or the last one, is then `of.tau`. The time is not checked here.
hsp_status stopped(hsp_controller& of, double t, const double* q, const double* v) {
  if (!of.stops)
    throw std::runtime_error("no contact carries this robot's base: it cannot be stopped here");
  hsp::Move& stop = of.plan.stop();
  const Eigen::Map<const hsp::Vector> q_in(q, stop.q.size()), v_in(v, stop.v.size());
  of.stopping = true;
  if (stop.is_valid(t, q_in, v_in)) {
    if (!of.last) *of.origin = t;
    if (of.blind) *of.holding = 0;  // it may not be at rest where that was predicted
    of.blind = false;
    stop.to(t, q_in, v_in);
    accept(of, t, stop);
    return braked(of);
  }
  if (of.refused >= most_repeated && of.last) {
    of.blind = true;
    if (stop.to(*of.last, of.expected_q, of.expected_v)) braked(of);
  }
  return HSP_WRONG_STATE;
}

hsp_status step(hsp_controller& of, double t, const double* q, const double* v, double* tau,
                bool stops) {
  hsp_status status = HSP_STOPPED;
  if (!stops && !of.stopping) status = moved(of, t, q, v);
  // A single invalid state is tolerated. An effort that is repeated for long drives the robot.
  const bool lasts = status < 0 && of.refused >= most_repeated && of.last && of.stops;
  if (stops || of.stopping || lasts) {
    const hsp_status stop = stopped(of, t, q, v);
    status = stops || stop < 0 ? stop : HSP_STOPPED;
    if (stop >= 0) of.refused = 0;
  } else if (status >= 0) of.refused = 0;
  if (status == HSP_WRONG_STATE || status == HSP_WRONG_CLOCK) expect(of);
  if (status < 0 && status != HSP_STOPPED) of.refused = std::min(of.refused + 1, most_repeated);
  for (Index i = 0; i < of.plan.move().v.size(); ++i) tau[i] = of.tau[i];
  return status;
}

// Refuse a value, with a sentence.
hsp_status refused(hsp_controller& of, const char* reason) {
  of.reason = reason;
  return HSP_WRONG_VALUE;
}

constexpr const char* null_state = "q, v or tau is a null pointer";

// The values that a port accepts.
const char* accepted(const Port& port) {
  if (port.payloads)
    return "a payload needs a mass of 0 or more, and the inertia of a body, in finite numbers; "
           "without a mass all 0";
  if (port.impedance)
    return "a stiffness or damping needs to be finite, symmetric and without an eigenvalue below "
           "0, and with the other one damped and stable at this period";
  if (port.input)
    return port.input->definite ? "a gain needs to be finite and positive definite, with entries "
                                  "below the largest that is stable at this period"
           : port.input->cone.rows()
               ? "a force needs to be finite, to push, and to stay within the "
                 "friction pyramid at each point"
               : "a value is not finite or beyond the input's bounds, or 0 "
                 "where it has to be positive";
  if (port.part == SentTo::TIME) return "the time of a target needs to be finite, 1e12 s at most";
  return "a target or velocity needs finite numbers, 1e6 at most, and a quaternion norm 1";
}

// Send a part of a message to a stream; return whether it is valid.
template <class Values> bool sent(hsp::Stream& stream, SentTo part, const Values& wanted) {
  switch (part) {
    case SentTo::TARGET:
      return stream.send_target(wanted);
    case SentTo::VELOCITY:
      return stream.send_velocity(wanted);
    case SentTo::RATE:
      return stream.send_rate(wanted);
    case SentTo::TIME:
      return stream.send_time(wanted[0]);
  }
  return false;
}

// Change an input to values from now on.
hsp_status change(hsp_controller& of, const char* name, const double* values, std::size_t size,
                  double duration) {
  const Port* port = name ? of.plan.port(name) : nullptr;
  if (!port || !port->is_input()) return HSP_WRONG_NAME;
  if (static_cast<std::size_t>(port->size) != size) return HSP_WRONG_SIZE;
  if (!values) return refused(of, "the pointer to the values is null");
  if (!(duration >= 0.0 && duration < infinite))
    return refused(of, "the duration of a ramp needs to be 0 s or more, and finite");
  const Eigen::Map<const hsp::Vector> wanted(values, port->size);
  // Before the first step they apply from the beginning.
  const double now = of.last ? of.plan.move().time[0] : -infinite;
  const double ramp = of.last ? duration : 0.0;
  if (port->payloads) {
    if (!port->payloads->permits(wanted)) return refused(of, accepted(*port));
    return port->payloads->then(port->frame, now, ramp, wanted) ? HSP_OK : HSP_TOO_MANY;
  }
  if (port->impedance) {
    if (!port->impedance->permits(port->first, port->count, wanted))
      return refused(of, accepted(*port));
    return port->impedance->then(now, ramp) ? HSP_OK : HSP_TOO_MANY;
  }
  // A target's motion is bounded already: no ramp.
  if (!port->input && duration > 0.0)
    return refused(of, "the target of a stream has no ramp: set it; its motion is bounded");
  if (port->stream)
    return sent(*port->stream, port->part, wanted) ? HSP_OK : refused(of, accepted(*port));
  if (!port->input->permits(wanted)) return refused(of, accepted(*port));
  return port->input->then(now, ramp, wanted) ? HSP_OK : HSP_TOO_MANY;
}

const char* sentence(hsp_status status) {
  switch (status) {
    case HSP_OK:
      return "the law's own effort";
    case HSP_REDISTRIBUTED:
      return "the law's own acceleration, with other contact forces";
    case HSP_LIMITED:
      return "the nearest effort within the limits";
    case HSP_RELAXED:
      return "the limits contradict each other, and are violated as little as "
             "possible";
    case HSP_BEYOND:
      return "a joint is beyond its range, or faster than its limit";
    case HSP_BRAKING:
      return "the robot is braked";
    case HSP_HOLDING:
      return "the robot is held where it came to rest";
    case HSP_STOPPED:
      return "the robot is being stopped, as by hsp_stop; hsp_restart begins a new run";
    case HSP_WRONG_STATE:
      return "t, q or v is not finite, or a quaternion or (cos, sin) pair in q is not of norm 1";
    case HSP_WRONG_CLOCK:
      return "the time went back, or on by more than 100 periods, since the last step: times are "
             "seconds, and increase by the period; hsp_restart begins a new run";
    case HSP_NOT_FINITE:
      return "the effort is not finite at this state";
    case HSP_BUSY:
      return "another thread uses this handle: open one for each thread";
    case HSP_WRONG_NAME:
      return "there is no such input or output; hsp_port_at lists them, and which are inputs";
    case HSP_WRONG_SIZE:
      return "the input or output has another number of values, see hsp_port_of";
    case HSP_WRONG_VALUE:
      return "a pointer is null, or the input does not accept this value or ramp; see "
             "hsp_last_error";
    case HSP_TOO_MANY:
      return "the input still follows 8 ramps, which is the most";
    case HSP_FAILED:
      return "a call failed; see hsp_last_error";
  }
  return "not a status of hsp_step.h";
}

}  // namespace

hsp_controller* hsp_open(const char* file) noexcept {
  opening[0] = 0;
  if (!file) {
    write(opening, sizeof opening, "hsp_open received no file");
    return nullptr;
  }
  try {
    return new hsp_controller(file);
  } catch (const std::exception& error) {
    std::snprintf(opening, sizeof opening, "%s: %s", file, error.what());
  } catch (...) {
    std::snprintf(opening, sizeof opening, "%s: it cannot be opened", file);
  }
  return nullptr;
}

void hsp_close(hsp_controller* controller) noexcept { delete controller; }

size_t hsp_size_q(const hsp_controller* controller) noexcept {
  return controller ? controller->plan.move().q.size() : 0;
}

size_t hsp_size_v(const hsp_controller* controller) noexcept {
  return controller ? controller->plan.move().v.size() : 0;
}

double hsp_period(const hsp_controller* controller) noexcept {
  return controller ? *controller->period : 0.0;
}

hsp_status hsp_step(hsp_controller* controller, double t, const double* q, const double* v,
                    double* tau) noexcept {
  return made(controller, [&](hsp_controller& of) {
    return q && v && tau ? step(of, t, q, v, tau, false) : refused(of, null_state);
  });
}

hsp_status hsp_stop(hsp_controller* controller, double t, const double* q, const double* v,
                    double* tau) noexcept {
  return made(controller, [&](hsp_controller& of) {
    return q && v && tau ? step(of, t, q, v, tau, true) : refused(of, null_state);
  });
}

hsp_status hsp_restart(hsp_controller* controller) noexcept {
  return made(controller, [](hsp_controller& of) {
    of.plan.restart();
    of.last.reset();
    of.stopping = of.blind = false;
    of.refused = 0;
    return HSP_OK;
  });
}

const hsp_port* hsp_port_at(const hsp_controller* controller, size_t number) noexcept {
  if (!controller || number >= controller->ports.size()) return nullptr;
  return &controller->ports[number];
}

const hsp_port* hsp_port_of(const hsp_controller* controller, const char* name) noexcept {
  const Port* found = controller && name ? controller->plan.port(name) : nullptr;
  return found ? &controller->ports[found - controller->plan.ports().data()] : nullptr;
}

hsp_status hsp_set(hsp_controller* controller, const char* name, const double* values,
                   size_t size) noexcept {
  return made(controller, [&](hsp_controller& of) { return change(of, name, values, size, 0.0); });
}

hsp_status hsp_ramp(hsp_controller* controller, const char* name, const double* values, size_t size,
                    double duration) noexcept {
  return made(controller,
              [&](hsp_controller& of) { return change(of, name, values, size, duration); });
}

hsp_status hsp_get(hsp_controller* controller, const char* name, double* values,
                   size_t size) noexcept {
  return made(controller, [&](hsp_controller& of) {
    const Port* port = name ? of.plan.port(name) : nullptr;
    if (!port) return HSP_WRONG_NAME;
    if (static_cast<std::size_t>(port->size) != size) return HSP_WRONG_SIZE;
    if (!values) return refused(of, "the pointer to the values is null");
    for (std::size_t i = 0; i < size; ++i)
      values[i] = port->entry == 'd'
                      ? static_cast<const double*>(port->data)[i]
                      : static_cast<double>(static_cast<const std::int64_t*>(port->data)[i]);
    return HSP_OK;
  });
}

const char* hsp_last_error(const hsp_controller* controller) noexcept {
  if (!controller) return opening;
  const hsp_status error = controller->error;
  const char* reason = controller->reason;
  if (error == HSP_WRONG_VALUE && reason) return reason;
  return error == HSP_FAILED ? controller->failure : error < 0 ? sentence(error) : "";
}

const char* hsp_status_text(hsp_status status) noexcept { return sentence(status); }

const char* hsp_build(void) noexcept { return hsp::build_text(); }
