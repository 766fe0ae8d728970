/* The tracker of tune_tracker.cpp in C: which q and r do these positions ask for? */
#include <stdio.h>
#include <stdlib.h>

#include "identikal.h"

static const char *const model =
    "identikal: 1\n"
    "time: {step: 0.1 s}\n"
    "outputs: {position: {unit: m}}\n"
    "parameters: {q: {value: 1, min: 0}, r: {value: 1, min: 0}}\n"
    "A: [[1, 0.1], [0, 1]]\n"
    "C: [[1, 0]]\n"
    "G: [[0.005], [0.1]]\n"
    "Q: [[q]]\n"
    "R: [[r]]\n"
    "initial: diffuse\n";

int main(void) {
  double positions[500], position = 0.0, speed = 0.0;
  size_t i, rows = sizeof positions / sizeof *positions;
  for (i = 0; i < rows; ++i) { /* accelerations of +-0.3, errors of +-0.5 */
    const double acceleration = rand() < RAND_MAX / 2 ? 0.3 : -0.3;
    positions[i] = position + (rand() < RAND_MAX / 2 ? 0.5 : -0.5);
    position += 0.1 * speed + 0.005 * acceleration;
    speed += 0.1 * acceleration;
  }
  ik_recording recording = {.y = positions, .rows = rows, .ny = 1};
  ik_result *result = NULL;
  int code = ik_run("tune", model, &recording, 1, NULL, 0, NULL, NULL, &result);
  puts(ik_result_message(result));
  if (code == 0) {
    size_t count = 0;
    const double *innovations = ik_result_series(result, "innovations", &count, NULL);
    printf("%zu innovations, the last %.3f m\n", count, innovations[count - 1]);
  }
  ik_result_free(result);
  return code;
}
