/* Replay recorded states through a frozen controller, and print the efforts.
 *
 *   cc replay.c $(hsp freeze --flags) -o replay
 *   ./replay panda.hsp < states.txt > efforts.txt
 *
 * A line of states.txt is t, q and v; a line of what is printed is the status and tau. */
#include <hsp_step.h>
#include <stdio.h>
#include <stdlib.h>

static int read_numbers(double* to, size_t count) {
  for (size_t i = 0; i < count; ++i)
    if (scanf("%lf", &to[i]) != 1) return 0;
  return 1;
}

int main(int argc, char** argv) {
  if (argc != 2) {
    fprintf(stderr, "usage: replay CONTROLLER < STATES\n");
    return 2;
  }
  hsp_controller* controller = hsp_open(argv[1]);
  if (!controller) {
    fprintf(stderr, "replay: %s\n", hsp_last_error(NULL));
    return 2;
  }
  const size_t nq = hsp_size_q(controller), nv = hsp_size_v(controller);
  double* state = calloc(1 + nq + nv, sizeof(double));
  double* tau = calloc(nv, sizeof(double));
  if (!state || !tau) return 2;
  while (read_numbers(state, 1 + nq + nv)) {
    const hsp_status status = hsp_step(controller, state[0], state + 1, state + 1 + nq, tau);
    if (status < 0) fprintf(stderr, "t = %g: %s\n", state[0], hsp_last_error(controller));
    printf("%d", (int)status);
    for (size_t i = 0; i < nv; ++i) printf(" %.17g", tau[i]);
    printf("\n");
  }
  free(tau);
  free(state);
  hsp_close(controller);
  return 0;
}
