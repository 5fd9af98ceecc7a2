/* Step a frozen controller at states of a file, again and again, send to the inputs that are named,
 * and print what it did besides:
 * allocations and locks are counted, and a system call ends the process, if the kernel lets us ask
 * for that (seccomp). */
#define _GNU_SOURCE
#include <hsp_step.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

static long allocations, locks;
static int counting;

extern void* __libc_malloc(size_t);
extern void* __libc_calloc(size_t, size_t);
extern void* __libc_realloc(void*, size_t);
extern void* __libc_memalign(size_t, size_t);
extern void __libc_free(void*);

void* malloc(size_t size) { return allocations += counting, __libc_malloc(size); }
void* calloc(size_t n, size_t size) { return allocations += counting, __libc_calloc(n, size); }
void* realloc(void* p, size_t size) { return allocations += counting, __libc_realloc(p, size); }
void* memalign(size_t to, size_t size) {
  return allocations += counting, __libc_memalign(to, size);
}
void* aligned_alloc(size_t to, size_t size) { return memalign(to, size); }
int posix_memalign(void** p, size_t to, size_t size) { return !(*p = memalign(to, size)); }
void free(void* p) { allocations += counting && p, __libc_free(p); }

int pthread_mutex_lock(pthread_mutex_t* mutex) {
  (void)mutex; /* this program has one thread */
  return locks += counting, 0;
}
int pthread_mutex_unlock(pthread_mutex_t* mutex) { return (void)mutex, 0; }

/* Set or ramp an input from what it was last to a bit more or less. */
static void send(hsp_controller* controller, const char* name, long k) {
  double values[16];
  const hsp_port* port = hsp_port_of(controller, name);
  if (!port || port->size > 16 || hsp_get(controller, name, values, port->size)) return;
  values[k % (port->size < 3 ? port->size : 3)] += k % 2 ? 0.3 : -0.3;
  if (k % 4 < 2) hsp_set(controller, name, values, port->size);
  else hsp_ramp(controller, name, values, port->size, 0.005); /* refused of a target */
}

int main(int argc, char** argv) {
  hsp_controller* controller = argc >= 5 ? hsp_open(argv[1]) : NULL;
  if (!controller) return 2;
  const size_t nq = hsp_size_q(controller), nv = hsp_size_v(controller), width = 1 + nq + nv;
  const long count = atol(argv[3]), repeats = atol(argv[4]);
  double* states = malloc(count * width * sizeof(double));
  double* tau = malloc(nv * sizeof(double));
  FILE* file = fopen(argv[2], "rb");
  if (!file || fread(states, sizeof(double), count * width, file) != count * width) return 2;
  fclose(file);
  const char* watched = prctl(PR_SET_SECCOMP, 1 /* strict */) ? "" : " without system calls";
  long delivered = 0, others = 0;
  counting = 1;
  for (long k = 0; k < repeats; ++k) {
    hsp_restart(controller);
    for (long i = 0; i < count; ++i) {
      const double* x = states + i * width;
      if (argc > 5 && i % 7 == 3) send(controller, argv[5 + i % (argc - 5)], i);
      hsp_status status = hsp_step(controller, x[0], x + 1, x + 1 + nq, tau);
      delivered += status >= 0;
      others += status > 0;
      if (hsp_get(controller, "tau", tau, nv)) ++delivered;
      if (hsp_step(controller, -1.0, x + 1, x + 1 + nq, tau) >= 0) ++delivered;
      if (!strlen(hsp_last_error(controller))) ++delivered;
    }
    /* Without a time for many periods: the stop goes by what it expects. */
    for (int i = 0; i < 20; ++i)
      if (hsp_step(controller, NAN, states + 1, states + 1 + nq, tau) >= 0) ++delivered;
  }
  counting = 0;
  char text[200];
  const int n =
      snprintf(text, sizeof text, "%ld steps, %ld within limits, %ld allocations, %ld locks%s\n",
               delivered, others, allocations, locks, watched);
  if (write(1, text, n) != n) return 2;
  syscall(SYS_exit, 0); /* the only way out that strict seccomp has */
  return 0;
}
