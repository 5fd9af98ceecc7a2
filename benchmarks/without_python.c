/* How long each step of a frozen controller takes: without_python CONTROLLER STATES COUNT REPEATS
 * writes the times as integers of 8 bytes [ns]. */
#include <hsp_step.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static long long now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return 1000000000ll * t.tv_sec + t.tv_nsec;
}

int main(int argc, char** argv) {
  hsp_controller* controller = argc == 5 ? hsp_open(argv[1]) : NULL;
  if (!controller) return 2;
  const size_t nq = hsp_size_q(controller), nv = hsp_size_v(controller), width = 1 + nq + nv;
  const size_t count = strtoul(argv[3], NULL, 10), repeats = strtoul(argv[4], NULL, 10);
  double* states = malloc(count * width * sizeof(double));
  double* tau = malloc(nv * sizeof(double));
  long long* times = malloc(count * repeats * sizeof(long long));
  FILE* file = fopen(argv[2], "rb");
  if (!states || !tau || !times || !file) return 2;
  if (fread(states, sizeof(double), count * width, file) != count * width) return 2;
  for (size_t k = 0; k < repeats; ++k) {
    nanosleep(&(struct timespec){.tv_nsec = 20000000}, NULL); /* see without_python.py */
    hsp_restart(controller);
    for (size_t i = 0; i < count; ++i) {
      const double* x = states + i * width;
      const long long begin = now();
      if (hsp_step(controller, x[0], x + 1, x + 1 + nq, tau) < 0) return 2;
      times[k * count + i] = now() - begin;
    }
  }
  fwrite(times, sizeof(long long), count * repeats, stdout);
  return 0;
}
