#!/usr/bin/env python3
"""The same vehicle fit by this project and by scipy's least_squares, in one run, and their ratio.

usage: against_scipy.py BUILD RECORDING.csv    (columns t, delta, vx, yawRate, vy: a race car at 100 Hz)

Nine parameters (Iz, Cf, Cr, both largest forces of a tanh tyre, steering offset, biases of r and vy, mounting angle) of
the output error of r and vy, the integrator of both the classical Runge-Kutta at 0.01 s with the inputs' midpoints.
scipy gets the residual compiled by cc -O3 through ctypes, parameters in units of their typical size, the weights that this
project ends with, its initial states, which are fixed, and scipy's defaults otherwise: trf, two-point differences. This project
estimates weights and initial states along. Both begin at their own start: scipy at a guess, as its users do, this project at its
equation-error start. scipy is run from that start too, and the project's whole search, which tries the guess and others besides,
is timed too.
"""
import ctypes
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np
from scipy.optimize import least_squares

RESIDUAL = r"""
#include <math.h>
typedef struct { double Iz, Cf, Cr, Ff, Fr, offset, bias_r, bias_vy, angle; } P;
static const double m = 982, a = 1.33, b = 1.07;
static void rates(const P *p, double vy, double r, double angle, double vx, double *dvy, double *dr) {
  double front = -p->Ff * tanh(p->Cf * ((vy + a * r) / vx - angle - p->offset) / p->Ff);
  double rear = -p->Fr * tanh(p->Cr * ((vy - b * r) / vx) / p->Fr);
  *dvy = (front + rear) / m - vx * r;
  *dr = (a * front - b * rear) / p->Iz;
}
/* angle and vx hold 2 n - 1 values: samples and midpoints */
void residual(const double *x, int n, double h, const double *angle, const double *vx, const double *r_measured,
              const double *vy_measured, double vy, double r, double sd_r, double sd_vy, double *e) {
  const P *p = (const P *)x;
  double c = cos(p->angle), s = sin(p->angle), v1, v2, v3, v4, w1, w2, w3, w4;
  for (int k = 0; k < n; ++k) {
    e[2 * k] = (r + p->bias_r - r_measured[k]) / sd_r;
    e[2 * k + 1] = (vy * c - vx[2 * k] * s + p->bias_vy - vy_measured[k]) / sd_vy;
    if (k + 1 == n) break;
    const double *d = angle + 2 * k, *u = vx + 2 * k;
    rates(p, vy, r, d[0], u[0], &v1, &w1);
    rates(p, vy + h / 2 * v1, r + h / 2 * w1, d[1], u[1], &v2, &w2);
    rates(p, vy + h / 2 * v2, r + h / 2 * w2, d[1], u[1], &v3, &w3);
    rates(p, vy + h * v3, r + h * w3, d[2], u[2], &v4, &w4);
    vy += h / 6 * (v1 + 2 * (v2 + v3) + v4);
    r += h / 6 * (w1 + 2 * (w2 + w3) + w4);
  }
}
"""

NAMES = ["Iz", "Cf", "Cr", "Ff_max", "Fr_max", "steering_offset", "bias_r", "bias_vy", "mounting_angle"]
SIZE = np.array([982 * 1.33 * 1.07, 4e4, 5e4, 4e3, 5e3, 0.02, 0.02, 0.2, 0.02])
START = np.array([982 * 1.33 * 1.07, 6e4, 1e5, 4.3e3, 5.3e3, 0.0, 0.0, 0.0, 0.0])

MODEL = """identikal: 1
model: single-track
time: {{column: t, unit: s}}
parameters:
  m: 982 kg
  a: 1.33 m
  b: 1.07 m
  Iz: {{value: {0} kg m^2}}
  Cf: {{value: {1} N/rad}}
  Cr: {{value: {2} N/rad}}
  Ff_max: {{value: {3} N}}
  Fr_max: {{value: {4} N}}
  steering_offset: {{value: {5} rad}}
  bias_r: {{value: {6} rad/s}}
  bias_vy: {{value: {7} m/s}}
  mounting_angle: {{value: {8} rad}}
tyre: {{curve: tanh}}
inputs: {{road_wheel_angle: {{column: delta, unit: rad}}, vx: {{column: vx, unit: m/s}}}}
outputs: {{r: {{column: yawRate, unit: rad/s}}, vy: {{column: vy, unit: m/s}}}}
"""


def with_midpoints(x):
    out = np.empty(2 * len(x) - 1)
    out[::2], out[1::2] = x, (x[1:] + x[:-1]) / 2
    return out


def compiled(folder):
    source, library = folder / "residual.c", folder / "residual.so"
    source.write_text(RESIDUAL)
    subprocess.run(["cc", "-O3", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
    function = ctypes.CDLL(str(library)).residual
    vector = np.ctypeslib.ndpointer(np.float64, flags="C")
    function.argtypes = [vector, ctypes.c_int, ctypes.c_double] + [vector] * 4 + [ctypes.c_double] * 4 + [vector]
    function.restype = None
    return function


def main(build, recording):
    with open(recording) as file:
        header = file.readline().strip().split(",")
    table = np.genfromtxt(recording, delimiter=",", skip_header=1)
    t, angle, vx, r, vy = (np.ascontiguousarray(table[:, header.index(c)]) for c in ("t", "delta", "vx", "yawRate", "vy"))
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        model = folder / "model.yaml"
        model.write_text(MODEL.format(*START))
        bench = json.loads(subprocess.run([f"{build}/tests/vehicle_bench", model, recording], check=True,
                                          capture_output=True, text=True).stdout)
        residual = compiled(folder)
        inputs, evaluations = (with_midpoints(angle), with_midpoints(vx)), 0
        e = np.empty(2 * len(t))

        def error(z):
            nonlocal evaluations
            evaluations += 1
            residual(z * SIZE, len(t), 0.01, *inputs, r, vy, bench["vy0"], bench["r0"], bench["sd"][0], bench["sd"][1], e)
            return e.copy()

        def timed(start):
            nonlocal evaluations
            evaluations = 0
            begin = time.perf_counter()
            found = least_squares(error, start / SIZE)
            return found.x * SIZE, time.perf_counter() - begin, evaluations

        begin = time.perf_counter()
        error(START / SIZE)
        once = time.perf_counter() - begin
        guessed, theirs, guess_evaluations = timed(START)
        # A straight axle is no start for scipy's parameters; one of ten times the usual force is next to it.
        _, from_ours, our_evaluations = timed(np.minimum(bench["start"], 10 * SIZE))
    print(f"{'':18}{'this project':>14}{'scipy':>14}")
    for i, each in enumerate(NAMES):
        print(f"{each:18}{bench['value'][i]:14.6g}{guessed[i]:14.6g}")
    ours = bench["fit_s"]
    print(f"{'fit [s]':18}{ours:14.3f}{theirs:14.3f}   {theirs / ours:.1f} times faster")
    print(f"{'evaluations':18}{bench['evaluations']:14d}{guess_evaluations:14d}")
    print(f"{'from our start [s]':18}{ours:14.3f}{from_ours:14.3f}   {from_ours / ours:.1f} times faster, {our_evaluations} evaluations")
    print(f"{'whole search [s]':18}{bench['search_s']:14.3f}")
    print(f"{'simulation [ms]':18}{1e3 * bench['simulation_s']:14.2f}{1e3 * once:14.2f}")
    print(f"gradient of nine parameters {bench['gradient_s'] / bench['simulation_s']:.2f} simulations")
    print("samples, seconds of a fit, evaluations, microseconds per sample and evaluation:")
    for n, s, k in bench["growth"]:
        print(f"  {n:6d} {s:.3f} {k:3d} {1e6 * s / n / k:.3f}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
