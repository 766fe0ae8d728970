#!/usr/bin/env python3
"""What does `fit` say about real recordings? Each figure is printed; bounds are those of the reference notes.

usage: recordings_test.py BUILD/identikal

Reads the reference recordings beside the repository; without them it is skipped, with CI=true it fails.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

TOOL = str(pathlib.Path(sys.argv.pop(1)).resolve()) if len(sys.argv) > 1 else ""
FOLDER = pathlib.Path(__file__).resolve().parents[4] / "shared" / "recordings"


def car(name, time, parameters, inputs, outputs, *more):
    """A model file of a car."""
    lines = ["identikal: 1", f"name: {name}", "model: single-track", f"time: {{column: {time}}}", "parameters:"]
    lines += ["  " + each for each in parameters]
    return "\n".join([*lines, f"inputs: {{{inputs}}}", f"outputs: {{{outputs}}}", *more]) + "\n"


def body(m, a, b, *others):
    """Mass, lengths and what else is known of a car, in the model file's words."""
    return [f"m: {m} kg", f"a: {a} m", f"b: {b} m", *others]


def unknown(Iz, Cf, Cr):
    return [f"Iz: {{value: {Iz} kg m^2}}", f"Cf: {{value: {Cf} N/rad}}", f"Cr: {{value: {Cr} N/rad}}"]


def steered_by_wheel(steering, steering_unit, vx, vx_unit):
    return f"steering_wheel_angle: {{column: {steering}, unit: {steering_unit}}}, vx: {{column: {vx}, unit: {vx_unit}}}"


def steered_at_road(steering, vx):
    return f"road_wheel_angle: {{column: {steering}, unit: rad}}, vx: {{column: {vx}, unit: m/s}}"


def lateral(r, vy):
    return f"r: {{column: {r}, unit: rad/s}}, vy: {{column: {vy}, unit: m/s}}"


RACE_CAR = car("race car", "t, unit: s",
               body(982, 1.33, 1.07, "steering_offset: {value: 0 rad}", "mounting_angle: {value: 0 rad}") + unknown(1400, 8e4, 8e4),
               steered_at_road("delta", "vx"), lateral("yawRate", "vy"), "tyre: {curve: tanh}")


def by_wire(*more):
    return car("by-wire car", "t, unit: s",
               body(1659, 1.044, 1.424, "Iz: 2447 kg m^2", *unknown(0, 1e5, 1e5)[1:], *more),
               steered_at_road("deltaMeasured_rad", "Ux_mps"), lateral("r_radps", "Uy_mps"), "use_when: vx > 3")


CIRCLES = car("circles", "t, unit: s, runs: restart", body(700, 1, 1, "steering_ratio: 20") + unknown(700, 3e4, 3e4),
              steered_by_wheel("swa_cmd_rad", "rad", "v_ins_mps", "m/s"), "r: {column: yaw_rate_rps, unit: rad/s, scale: -1}",
              "use_when: vx > 1")
CHIRP = car("chirp", "TIME, unit: s", body(1600, 1.029375, 1.715625, "steering_ratio: 20") + unknown(2800, 1e5, 1e5),
            steered_by_wheel("STEER", "deg", "SPEED", "km/h"), "r: {column: YAWVEL, unit: deg/s}")
SLALOM = car("slalom", "INS_time_sec, unit: s", body(1900, 1.4, 1.4, "steering_ratio: 15") + unknown(3000, 1e5, 1e5),
             steered_by_wheel("SW_pos_obd", "deg", "speedo_obd", "km/h"),
             "r: {column: yaw_rate, unit: deg/s}, ay: {column: LatAcc_obd, unit: m/s^2}")
HIGHWAY = car("highway", "t, unit: s", body(1700, 1.2, 1.46, "steering_ratio: 16") + unknown(2900, 1e5, 1e5),
              steered_by_wheel("steering_wheel_deg", "deg", "speed_mps", "m/s"), "r: {column: gyro_down, unit: rad/s, scale: -1}")
AUTONOMOUS = car("autonomous race car", "time, unit: s", body(790, 1.72, 1.25) + unknown(1000, 1e5, 1e5),
                 steered_at_road("delta", "vx"), lateral("omega", "vy"), "use_when: vx > 5")


@unittest.skipUnless(FOLDER.exists() or os.environ.get("CI") == "true", "no recordings beside the repository")
class Recordings(unittest.TestCase):
    def fit(self, model, data, *options):
        """Exit code and result of `fit`."""
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "model.yaml"
            path.write_text(model)
            ran = subprocess.run([TOOL, "fit", path, data, "--json", *options], capture_output=True, text=True)
        self.assertEqual(ran.stderr, "")
        result = json.loads(ran.stdout)
        return ran.returncode, result, {p["name"]: p for p in result["parameters"]}

    def warning(self, result, code):
        for each in result["warnings"]:
            if each["code"] == code:
                return each
        self.fail(f"no warning {code} among {[w['code'] for w in result['warnings']]}")

    def test_race_car(self):
        data = FOLDER / "revs_250lm_first_half.csv"
        code, whole, p = self.fit(RACE_CAR, data)
        fits = whole["fit"]["simulation"]
        print(f"\nrace car, all of it: Cf {p['Cf']['value']:.0f} +- {p['Cf']['se']:.0f}, Cr {p['Cr']['value']:.0f} +- "
              f"{p['Cr']['se']:.0f}, fit r {fits['r']['fit_percent']:.1f}, vy {fits['vy']['fit_percent']:.1f} %")
        # A delay, and tyres that lag, ask for another inertia (883 with a delay of 35 ms); the stiffnesses stay.
        self.assertEqual(code, 1)
        self.assertEqual(["Iz"], self.warning(whole, "structure_dependent")["about"])
        self.assertEqual(["ok", "ok", "poorly_determined"], [p[n]["verdict"] for n in ("Cf", "Cr", "Iz")])
        self.assertTrue(60e3 < p["Cf"]["value"] < 75e3)
        self.assertTrue(95e3 < p["Cr"]["value"] < 120e3)
        self.assertGreaterEqual(fits["vy"]["fit_percent"], 70)

        code, half, p = self.fit(RACE_CAR, data, "--hold-out", "50%", "--bootstrap", "500")
        own, held = half["fit"]["simulation"], half["fit"]["hold_out"]
        print(f"race car, trained on the first half: Cf {p['Cf']['value']:.0f} +- {p['Cf']['se']:.0f}, Cr "
              f"{p['Cr']['value']:.0f} +- {p['Cr']['se']:.0f}, fit r {own['r']['fit_percent']:.1f} (held out "
              f"{held['r']['fit_percent']:.1f}), vy {own['vy']['fit_percent']:.1f} ({held['vy']['fit_percent']:.1f}) %")
        self.assertGreaterEqual(held["r"]["fit_percent"], 87)
        self.assertTrue(60e3 < p["Cf"]["value"] < 75e3)
        # Block to block the stiffnesses scatter by 3.2 and 7.3 kN/rad.
        for name, scatter in (("Cf", 3.2e3), ("Cr", 7.3e3)):
            low, high = p[name]["ci95"]
            self.assertGreater((high - low) / 2, scatter)
        # The steepness at no slip depends on the curve: the magic formula's bend begins later.
        code, half, p = self.fit(RACE_CAR.replace("tanh", "magic-formula"), data, "--hold-out", "50%", "--bootstrap", "500")
        held = half["fit"]["hold_out"]
        print(f"magic formula, trained on the first half: Cf {p['Cf']['value']:.0f} +- {p['Cf']['se']:.0f}, Cr "
              f"{p['Cr']['value']:.0f} +- {p['Cr']['se']:.0f}, held out r {held['r']['fit_percent']:.1f}, vy "
              f"{held['vy']['fit_percent']:.1f} %")
        self.assertTrue(60e3 < p["Cf"]["value"] < 75e3)
        self.assertTrue(95e3 < p["Cr"]["value"] < 120e3)
        self.assertGreaterEqual(held["r"]["fit_percent"], 87)

    def test_wrong_steering_ratio(self):
        data = FOLDER / "stanford_me227_ab.csv"
        code, free, p = self.fit(by_wire("steering_gain: {value: 1}", "steering_offset: {value: 0 rad}"), data)
        gain = p["steering_gain"]
        print(f"\nby-wire car: steering gain {gain['value']:.3f} +- {gain['se']:.4f}, fit of r "
              f"{free['fit']['simulation']['r']['fit_percent']:.1f} %")
        self.assertAlmostEqual(gain["value"], 1.12, delta=0.02)
        self.assertIn("the given steering ratio is wrong", self.warning(free, "steering_ratio")["text"])
        code, trusted, _ = self.fit(by_wire(), data)
        print(self.warning(trusted, "steering_gain")["text"])
        self.assertEqual(code, 1)

    def test_steady_circles(self):
        data = FOLDER / "polaris_circle_timeseries.csv"
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "circles.csv"
            lines = data.read_text().splitlines()
            path.write_text("\n".join([lines[0]] + [line for line in lines if "90deg" in line]) + "\n")
            code, result, p = self.fit(CIRCLES, path)
        derived = {d["name"]: d for d in result["derived"]}
        print(f"\ncircles: i L {derived['i L']['value']:.2f} +- {derived['i L']['se']:.2f} m, i K "
              f"{derived['i K']['value']:.4f} +- {derived['i K']['se']:.4f} rad/(m/s^2)")
        self.assertEqual(code, 1)
        self.assertAlmostEqual(derived["i L"]["value"], 40.0, delta=0.7)
        self.assertAlmostEqual(derived["i K"]["value"], 0.108, delta=0.01)
        self.assertEqual({p[name]["verdict"] for name in ("Cf", "Cr", "Iz")}, {"unexcited"})

    def test_chirp(self):
        code, result, _ = self.fit(CHIRP, FOLDER / "cobb_sim_marc2.txt")
        derived = {d["name"]: d["value"] for d in result["derived"]}
        K, wn, zeta = derived["K per g"], derived["wn at 100 km/h"], derived["zeta at 100 km/h"]
        print(f"\nchirp: K {K:.3f} deg/g, wn {wn:.3f} rad/s, zeta {zeta:.3f}")
        self.assertEqual(code, 0)
        self.assertAlmostEqual(K, 2.00, delta=0.02)
        self.assertAlmostEqual(wn, 7.37, delta=0.02 * 7.37)
        self.assertAlmostEqual(zeta, 0.73, delta=0.02 * 0.73)

    def test_flipped_acceleration(self):
        code, result, _ = self.fit(SLALOM, FOLDER / "revsted_obd_sample.csv")
        self.assertEqual(code, 1)
        print("\nslalom:", self.warning(result, "sign_ay")["text"])
        self.warning(result, "held_samples")

    def test_highway(self):
        data = "+".join(str(FOLDER / f"comma2k19_rav4_{part}.csv") for part in ("imu", "speed", "steer"))
        code, result, _ = self.fit(HIGHWAY, data)
        self.assertEqual(code, 1)
        print("\nhighway:", self.warning(result, "weak_direction")["text"])

    def test_autonomous(self):
        code, result, p = self.fit(AUTONOMOUS, FOLDER / "iac_av21_Putnam_park2023_run4_2.csv")
        self.assertEqual(code, 1)
        # An inertia 19 times that of any car; lags and roll would take it anywhere.
        self.assertNotEqual("ok", p["Iz"]["verdict"])
        print("\nautonomous:", self.warning(result, "structure_dependent")["text"], "; Iz", p["Iz"]["verdict"])


if __name__ == "__main__":
    unittest.main()
