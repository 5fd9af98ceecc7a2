/* A step of a controller without Python: what `hsp freeze` wrote is opened and run here.
 *
 *   hsp_controller* arm = hsp_open("panda.hsp");
 *   if (!arm) fail(hsp_last_error(NULL));
 *   while (running) {                                 // at the control period
 *     hsp_status status = stopping ? hsp_stop(arm, t, q, v, tau) : hsp_step(arm, t, q, v, tau);
 *     if (status < 0) warn(hsp_last_error(arm));      // tau is still one that may be sent
 *     stopping |= status < 0;                         // brake from the next state on
 *     send(tau);
 *   }
 *   hsp_close(arm);
 *
 * The effort is that of the controller in Python, to the last bit. `hsp_step`, `hsp_stop`,
 * `hsp_set`, `hsp_ramp`, `hsp_get` and `hsp_restart` allocate nothing, take no lock and make no
 * system call. A handle belongs to one thread at a time; different handles are independent.
 *
 * Units are SI, axes those of the world, linear rows before angular rows. */
#ifndef HSP_STEP_H
#define HSP_STEP_H

#include <stddef.h>

#if defined(__GNUC__)
#define HSP_API __attribute__((visibility("default")))
#else
#define HSP_API
#endif

#ifdef __cplusplus
extern "C" {
#define HSP_NOEXCEPT noexcept
#else
#define HSP_NOEXCEPT
#endif

/* The outcome of a step, or of a request. If it is 0 or more, the request succeeded, and tau is a
 * new effort; below 0 it was refused. After a refused step or stop, tau is the last delivered
 * effort, or 0 if there was none yet, for at most 5 periods in a row: an effort that is repeated
 * for long drives the robot. From the sixth on the robot is stopped permanently, as by hsp_stop.
 * The stop uses t, q and v if they are finite. Otherwise it uses the last finite ones, and predicts
 * their change under its own braking: the effort fades to that which carries the robot. This motion
 * is not measured: let the robot's own brakes take over. */
typedef enum hsp_status {
  HSP_OK = 0,            /* the law's own effort */
  HSP_REDISTRIBUTED = 1, /* with contact forces chosen by a QP */
  HSP_LIMITED = 2,       /* the nearest within the limits */
  HSP_RELAXED = 3,       /* the limits contradict each other; they are violated least */
  HSP_BEYOND = 4,        /* a joint is beyond its range, or faster than its limit */
  HSP_BRAKING = 5,       /* of hsp_stop: it brakes */
  HSP_HOLDING = 6,       /* of hsp_stop: it holds the robot where it came to rest */
  HSP_WRONG_STATE = -1,  /* t, q or v is not finite, or a quaternion in q has not norm 1 */
  HSP_WRONG_CLOCK = -2,  /* t went back, or on by more than 100 periods, since the last step */
  HSP_NOT_FINITE = -3,   /* the effort would not be finite */
  HSP_BUSY = -4,         /* another thread uses this handle; tau is left as it is */
  HSP_WRONG_NAME = -5,   /* there is no such input or output */
  HSP_WRONG_SIZE = -6,   /* an input or output has another number of values */
  HSP_WRONG_VALUE = -7,  /* the input does not accept a value: see hsp_last_error */
  HSP_TOO_MANY = -8,     /* more than 8 ramps of one input at a time */
  HSP_FAILED = -9,       /* something else, which `hsp_last_error` names */
  HSP_STOPPED = -10      /* of hsp_step: the stop has begun, tau is its effort; see hsp_restart */
} hsp_status;

typedef struct hsp_controller hsp_controller;

/* An input that `hsp_set` sets, or an output that `hsp_get` returns. */
typedef struct hsp_port {
  const char* name;    /* "tau", "hand.error" */
  const char* unit;    /* "N*m or N" */
  const char* meaning; /* a line of text */
  size_t size;         /* how many numbers */
  int is_input;        /* whether it can be set */
} hsp_port;

/* Open a frozen controller; NULL if the file is not one, was truncated or changed, or is for
 * another version or processor: `hsp_last_error(NULL)` has the reason. */
HSP_API hsp_controller* hsp_open(const char* file) HSP_NOEXCEPT;
HSP_API void hsp_close(hsp_controller* controller) HSP_NOEXCEPT;

/* Sizes of q, and of v and tau; the period for which an effort is held [s]. */
HSP_API size_t hsp_size_q(const hsp_controller* controller) HSP_NOEXCEPT;
HSP_API size_t hsp_size_v(const hsp_controller* controller) HSP_NOEXCEPT;
HSP_API double hsp_period(const hsp_controller* controller) HSP_NOEXCEPT;

/* Compute the effort tau at a time t [s], a configuration q and a velocity v, which is sent now and
 * held for a period. The clock may begin anywhere: times are relative to the first step. */
HSP_API hsp_status hsp_step(hsp_controller* controller, double t, const double* q, const double* v,
                            double* tau) HSP_NOEXCEPT;

/* Stop the robot: call it each period instead of hsp_step, once a step is refused or the run is to
 * end. It brakes all joints alike, tau = g(q) - s k M(q) v, until they are slow, and then holds
 * them, as `hsp live` does, with the same code; the law, its limits and its clock are not
 * evaluated. Efforts keep their limits, but not those on their rate. Payloads are included. A robot
 * on feet stands on its contacts meanwhile, except on those steeper than 60°: they carry it and the
 * braking of its base. Whether they do is not measured: after a fall, switch the motors off.
 * From then on hsp_step does the same instead of a step, and returns HSP_STOPPED. */
HSP_API hsp_status hsp_stop(hsp_controller* controller, double t, const double* q, const double* v,
                            double* tau) HSP_NOEXCEPT;

/* Restart: all memory is as in the file, including inputs. */
HSP_API hsp_status hsp_restart(hsp_controller* controller) HSP_NOEXCEPT;

/* Inputs and outputs, by number or by name; NULL where there is none. */
HSP_API const hsp_port* hsp_port_at(const hsp_controller* controller, size_t number) HSP_NOEXCEPT;
HSP_API const hsp_port* hsp_port_of(const hsp_controller* controller,
                                    const char* name) HSP_NOEXCEPT;

/* Let an input have other values from the next step on: at once, or by a smooth ramp of a duration
 * [s], as `controller.at(t).ramp(duration)` does in Python. A ramp goes on from what is then in
 * force, and may begin while another is under way; one of a spring waits where it would add energy.
 * Before the first step both are at once. */
HSP_API hsp_status hsp_set(hsp_controller* controller, const char* name, const double* values,
                           size_t size) HSP_NOEXCEPT;
HSP_API hsp_status hsp_ramp(hsp_controller* controller, const char* name, const double* values,
                            size_t size, double duration) HSP_NOEXCEPT;

/* Read an output, or the present value of an input. */
HSP_API hsp_status hsp_get(hsp_controller* controller, const char* name, double* values,
                           size_t size) HSP_NOEXCEPT;

/* Why the last request of a handle was refused; of `hsp_open` in this thread for NULL. It is never
 * NULL, and stays valid until the next request. */
HSP_API const char* hsp_last_error(const hsp_controller* controller) HSP_NOEXCEPT;

/* A status in words. */
HSP_API const char* hsp_status_text(hsp_status status) HSP_NOEXCEPT;

/* The version of this library, and the processor for which it was built. */
HSP_API const char* hsp_build(void) HSP_NOEXCEPT;

#ifdef __cplusplus
}
#endif
#endif
