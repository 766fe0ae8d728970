#!/usr/bin/env python3
"""Are estimates closer to the truth on the next recording when a filter has been tuned?

Cases with true states lie in a folder of their own (cases.json there says which): a model file, a recording to tune on
and one to judge by, and columns true_STATE that no tuning without reference sees. For each case, on the rows to judge by:
root mean square error, share in the 95 % band, NEES, status and seconds of

  default     values as a textbook would have them
  likelihood  tune
  extend      tune --extend
  estimates   tune --for estimates: the true states of the training part are its reference
  simplex     scipy's Nelder-Mead over the filter's squared errors in the training part, as users of filter libraries do;
              each evaluation is one run of the tool's compiled filter
  simplex_ll  the same over the log-likelihood

and beside the excess error that tune predicted without reference, the one found: over 'estimates' of the same model.

  does_tuning_help.py FOLDER [--tool build/identikal] [--cases a,b] [--simplex] [--json FILE]
"""
import argparse
import csv
import io
import json
import math
import pathlib
import resource
import subprocess
import tempfile

import numpy as np


def seconds_of_children():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class Tool:
    def __init__(self, program):
        self.program = str(pathlib.Path(program).resolve())

    def __call__(self, *arguments):
        before = seconds_of_children()
        done = subprocess.run([self.program, *map(str, arguments)], capture_output=True, text=True)
        return done, seconds_of_children() - before


def table(text):
    rows = csv.reader(io.StringIO(text))
    head = [cell.split(" [")[0] for cell in next(rows)]
    return head, np.array([[float(cell) if cell not in ("", "nan") else math.nan for cell in row] for row in rows])


class Case:
    def __init__(self, folder, tool, name, about):
        self.folder, self.tool, self.name = folder, tool, name
        self.__dict__.update(about)
        self.test_range = about.get("test_range", [0, 1e9])
        self.train_range = about.get("train_range", [0, 1e9])

    def file(self, name):
        return self.folder / name

    def states(self, model, recording, values):
        """One row of the filter's estimates for each of the recording, which may have rows that the filter leaves out."""
        settings = [part for key, value in values.items() for part in ("--set", f"{key}={value:.10g}")]
        done, _ = self.tool("filter", model, recording, "--quiet", *settings)
        if done.returncode not in (0, 1):
            raise RuntimeError(done.stderr.strip()[:200])
        return table(done.stdout)

    def errors(self, model, recording, span, values):
        head, filtered = self.states(model, self.file(recording), values)
        true_head, truth = table(self.file(recording).read_text())
        stamps = truth[:, true_head.index("t")]
        if len(filtered) != len(truth):
            at = np.clip(np.searchsorted(filtered[:, 0], stamps), 0, len(filtered) - 1)
            filtered = np.where((np.abs(filtered[at, 0] - stamps) < 1e-6)[:, None], filtered[at], math.nan)
        inside = (stamps >= span[0]) & (stamps < span[1])
        out = []
        for state in self.score:
            e = filtered[:, head.index(state)] - truth[:, true_head.index("true_" + state)]
            sd = filtered[:, head.index(state + "_sd")]
            use = inside & np.isfinite(e) & (sd > 0)
            e, sd = e[use], sd[use]
            out.append((math.sqrt(np.mean(e**2)), np.mean(np.abs(e) < 1.96 * sd), np.mean((e / sd) ** 2)))
        rmse, covered, nees = np.array(out).T
        return math.sqrt(np.sum(rmse**2)), float(np.mean(covered)), float(np.mean(nees))

    def judged(self, model, values):
        rmse, covered, nees = self.errors(model, self.test, self.test_range, values)
        return {"rmse": rmse, "coverage": covered, "nees": nees}

    def tune(self, model, *more, output=None):
        where = ["-o", output] if output else []
        span = ["--range", self.tune_range] if "tune_range" in self.__dict__ else []
        done, seconds = self.tool("tune", model, self.file(self.train), "--json", "--quiet", *span, *more, *where)
        text = done.stdout if done.stdout.strip() else (pathlib.Path(output) / "result.json").read_text() if output else ""
        if not text.strip():
            return None, {"status": "error: " + done.stderr.strip()[:160], "seconds": seconds}
        result = json.loads(text)
        values = {p["name"]: max(p["value"], 0.0) if p["value"] is not None else 0.0 for p in result["parameters"]
                  if "(" not in p["name"] and not p["fixed"]}
        about = {"status": result["status"]["code"], "seconds": seconds, "values": values}
        derived = {each["name"]: each["value"] for each in result["derived"]}
        if "expected NEES" in derived:
            about["expected"] = [100 * derived["excess error of the states"],
                                 100 * derived["excess error of the states, at most"], derived["expected NEES"]]
        return values, about

    def with_reference(self, model, folder):
        """The model file, its states' references the true columns, less than 1 % of what is found is their own error."""
        text = pathlib.Path(model).read_text()
        names = ", ".join(f"{state}: {{column: true_{state}{self.unit_of(text, state)}}}" for state in self.score)
        out = pathlib.Path(folder) / "with_reference.yaml"
        out.write_text(text + f"\nreference: {{{names}}}\n")
        return out

    def unit_of(self, text, state):
        line = next((row for row in text.split("\n") if row.startswith("states: {")), "")
        for pair in line[len("states: {"):].rstrip("}").split(","):
            key, _, unit = pair.partition(":")
            if key.strip() == state:
                return ", unit: " + unit.strip()
        return ""


def found_excess(case, model, likeliest, folder):
    reference = case.with_reference(model, folder)
    _, about = case.tune(reference, "--for", "estimates", "--starts", 4)
    if "values" not in about:
        return about
    about.update(case.judged(model, about["values"]))
    about["found"] = likeliest["rmse"] / about["rmse"] - 1
    return about


def simplex(case, by_likelihood):
    from scipy.optimize import minimize
    model, names = case.file(case.model), list(case.free)
    start = np.log([case.default[name] for name in names])
    span = case.train_range

    def cost(x):
        values = dict(zip(names, np.exp(np.clip(x, -40, 25))))
        try:
            if by_likelihood:
                settings = [part for key, value in values.items() for part in ("--set", f"{key}={value:.10g}")]
                ranged = ["--range", case.tune_range] if "tune_range" in case.__dict__ else []
                done, _ = case.tool("filter", model, case.file(case.train), "--json", "--quiet", *settings, *ranged)
                return -json.loads(done.stdout)["objective"]["log_likelihood"]
            return case.errors(model, case.train, span, values)[0]
        except (RuntimeError, ValueError, KeyError, TypeError):
            return 1e9

    before = seconds_of_children()
    vertices = np.vstack([start, start + np.eye(len(start))])
    end = minimize(cost, start, method="Nelder-Mead",
                   options={"initial_simplex": vertices, "maxfev": 40 + 35 * len(names), "fatol": 1e-5, "xatol": 1e-3})
    seconds = seconds_of_children() - before
    values = dict(zip(names, np.exp(end.x)))
    return {"seconds": seconds, "evaluations": end.nfev, **case.judged(model, values)}


def measured(case, with_simplex):
    model = case.file(case.model)
    out = {"default": case.judged(model, case.default)}
    with tempfile.TemporaryDirectory() as folder:
        values, about = case.tune(model)
        out["likelihood"] = about
        if values:
            about.update(case.judged(model, values))
            out["estimates"] = found_excess(case, model, about, folder)
        extended = pathlib.Path(folder) / "extended"
        values, about = case.tune(model, "--extend", output=extended)
        out["extend"] = about
        if values:
            larger = extended / "extended.yaml"
            about["adopted"] = larger.exists()
            tuned = larger if larger.exists() else model
            about.update(case.judged(tuned, values))
            if larger.exists():
                out["estimates_extended"] = found_excess(case, tuned, about, folder)
            elif "estimates" in out and "rmse" in out["estimates"]:
                about["found"] = about["rmse"] / out["estimates"]["rmse"] - 1
    if with_simplex:
        out["simplex"] = simplex(case, False)
        out["simplex_ll"] = simplex(case, True)
    return out


def show(name, of):
    print(f"{name}")
    for method, about in of.items():
        if "rmse" not in about:
            print(f"  {method:19s} {about.get('status', '')}")
            continue
        line = f"  {method:19s} rmse {about['rmse']:8.4g}  in band {about['coverage']:4.2f}  NEES {about['nees']:6.3g}"
        line += f"  {about.get('seconds', 0):6.2f} s  {about.get('status', '')}"
        if "expected" in about:
            line += "  expected {:.1f} % (up to {:.1f} %), NEES {:.2g}".format(*about["expected"])
        print(line + (f"  found {100 * about['found']:.1f} %" if "found" in about else ""), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--tool", default="build/identikal")
    parser.add_argument("--cases", default="")
    parser.add_argument("--about", type=pathlib.Path, help="cases.json, where it is not in the folder")
    parser.add_argument("--simplex", action="store_true")
    parser.add_argument("--json", type=pathlib.Path)
    given = parser.parse_args()
    about = json.loads((given.about or given.folder / "cases.json").read_text())
    tool, out = Tool(given.tool), {}
    for name in given.cases.split(",") if given.cases else about:
        out[name] = measured(Case(given.folder.resolve(), tool, name, about[name]), given.simplex)
        show(name, out[name])
        if given.json:
            given.json.write_text(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
