"""Populations within the likelihood beside R's lme4 (the same approximation, Laplace's) and nlme, on data that R brings along: reaction
times without sleep, a straight line with correlated effects, and two curves.

    python3 tests/bench/population_against_r.py build/identikal

Theophylline's log-likelihood is also computed by dense algebra, at both ends: what a program says of its own end is not compared.
It needs numpy, and Rscript with lme4 and nlme (on Debian r-cran-lme4, r-cran-nlme).
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

PROGRAM = str(pathlib.Path(sys.argv[1]).resolve())
ORANGE = """identikal: 1
model: static
parameters:
  Asym: {value: 200, per: recording, spread: 30}
  xmid: {value: 725}
  scal: {value: 350}
  s: {value: 8, min: 0}
inputs: {age: {column: age}}
outputs: {circumference: {column: circumference, equals: Asym/(1 + exp(-(age - xmid)/scal))}}
noise: {measurement: {sd: {circumference: s}}}
"""
THEOPHYLLINE = """identikal: 1
model: static
parameters:
  ke: {value: 0.08, min: 0}
  ka: {value: 1.6, min: 0, per: recording, spread: 0.3}
  Cl: {value: 0.04, min: 0, per: recording, spread: 0.3}
  s: {value: 0.8, min: 0}
inputs: {dose: {column: Dose}, hours: {column: Time}}
outputs: {conc: {column: conc, equals: dose*ke*ka/Cl*(exp(-ke*hours) - exp(-ka*hours))/(ka - ke)}}
noise: {measurement: {sd: {conc: s}}}
"""
SLEEP = """identikal: 1
model: static
parameters:
  a: {value: 250, per: recording, spread: 20}
  b: {value: 10, per: recording, spread: 5}
  s: {value: 25, min: 0}
spreads: correlated
inputs: {Days: {column: Days}}
outputs: {Reaction: {column: Reaction, equals: a + b*Days}}
noise: {measurement: {sd: {Reaction: s}}}
"""
R = """
suppressMessages({library(lme4); library(nlme)})
o <- as.data.frame(Orange); o$Tree <- as.character(o$Tree); write.csv(o, "orange.csv", row.names=FALSE, quote=FALSE)
t <- as.data.frame(Theoph); t$Subject <- as.character(t$Subject); write.csv(t, "theophylline.csv", row.names=FALSE, quote=FALSE)
out <- function(name, m, begin) cat(name, format(c(as.numeric(logLik(m)), fixef(m), if (inherits(m, "merMod")) c(sapply(VarCorr(m), function(v) attr(v, "stddev")), sigma(m))), digits=10), as.numeric(proc.time()["elapsed"]) - begin, "\\n")
now <- function() as.numeric(proc.time()["elapsed"])
tight <- nlmerControl(tolPwrss=1e-12)
b <- now(); out("orange_lme4", suppressWarnings(nlmer(circumference ~ SSlogis(age, Asym, xmid, scal) ~ Asym|Tree, o, start=c(Asym=200, xmid=725, scal=350), control=tight)), b)
b <- now(); out("orange_nlme", nlme(circumference ~ SSlogis(age, Asym, xmid, scal), data=groupedData(circumference ~ age | Tree, o), fixed=Asym+xmid+scal~1, random=Asym~1, start=c(200, 725, 350)), b)
data(sleepstudy); write.csv(sleepstudy, "sleep.csv", row.names=FALSE, quote=FALSE)
b <- now(); m <- lmer(Reaction ~ Days + (Days|Subject), sleepstudy, REML=FALSE); cat("sleep_lme4", format(c(as.numeric(logLik(m)), fixef(m), attr(VarCorr(m)[[1]], "stddev"), sigma(m)), digits=10), now() - b, "\\n")
f <- deriv(~ Dose*exp(lKe+lKa-lCl)*(exp(-exp(lKe)*Time)-exp(-exp(lKa)*Time))/(exp(lKa)-exp(lKe)), c("lKe","lKa","lCl"), function(Dose, Time, lKe, lKa, lCl) NULL)
b <- now(); out("theophylline_lme4", suppressWarnings(nlmer(conc ~ f(Dose, Time, lKe, lKa, lCl) ~ (lKa|Subject)+(lCl|Subject), t, start=c(lKe=-2.5, lKa=0.5, lCl=-3.2), control=tight)), b)
b <- now(); out("theophylline_nlme", nlme(conc ~ SSfol(Dose, Time, lKe, lKa, lCl), data=Theoph, fixed=lKe+lKa+lCl~1, random=pdDiag(lKa+lCl~1), start=c(-2.5, 0.5, -3.2), method="ML"), b)
"""

def by_dense_algebra(theta):
    """Laplace's approximation for theophylline: each subject's most probable effects, and the curvature there by J'J."""
    lke, mu, sd, s = theta[0], np.array(theta[1:3]), np.array(theta[3:5]), theta[5]
    rows = np.genfromtxt("theophylline.csv", delimiter=",", names=True)
    out = 0.0
    for subject in np.unique(rows["Subject"]):
        d = rows[rows["Subject"] == subject]

        def curve(z):
            ke, (ka, cl) = np.exp(lke), np.exp(mu + sd * z)
            return d["Dose"] * ke * ka / cl * (np.exp(-ke * d["Time"]) - np.exp(-ka * d["Time"])) / (ka - ke)

        z = np.zeros(2)
        for _ in range(200):
            h = 1e-4
            J = np.column_stack([(8 * (curve(z + h * e) - curve(z - h * e)) - curve(z + 2 * h * e) + curve(z - 2 * h * e)) / (12 * h) for e in np.eye(2)])
            r, H = d["conc"] - curve(z), J.T @ J / s ** 2 + np.eye(2)
            z = z + 0.7 * np.linalg.solve(H, J.T @ r / s ** 2 - z)
        out += -0.5 * r @ r / s ** 2 - 0.5 * z @ z - 0.5 * len(d) * np.log(2 * np.pi * s ** 2) - 0.5 * np.linalg.slogdet(H)[1]
    return out


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    pathlib.Path("all.R").write_text(R)
    done = subprocess.run(["Rscript", "all.R"], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(done.stderr)
    for line in done.stdout.splitlines():
        name, value, *rest = line.split()
        if name == "theophylline_lme4":
            print(f"  by dense algebra at lme4's end {by_dense_algebra([float(x) for x in rest[:-1]]):.7f}")
        print(f"{name:20} log-likelihood {float(value):.7f}, fixed {' '.join(rest[:-1])}, {float(rest[-1]):.2f} s")
    for name, model, by in (("sleep", SLEEP, "Subject"), ("orange", ORANGE, "Tree"), ("theophylline", THEOPHYLLINE, "Subject")):
        pathlib.Path("model.yaml").write_text(model)
        begin = time.monotonic()
        done = subprocess.run([PROGRAM, "fleet", "joint", "model.yaml", f"{name}.csv", "--by", by, "--workers", "1", "--json"], capture_output=True, text=True)
        seconds = time.monotonic() - begin
        found = json.loads(done.stdout)
        values = {p["name"]: p["value"] for p in found["parameters"] if "_" not in p["name"] or p["name"].startswith("sd_")}
        print(f"{name:20} log-likelihood {found['objective']['log_likelihood']:.7f}, {values}, {seconds:.2f} s, status {found['status']['code']}")
        if name == "theophylline":
            at = [np.log(values["ke"]), np.log(values["ka"]), np.log(values["Cl"]), values["sd_ka"], values["sd_Cl"], values["s"]]
            print(f"  by dense algebra at this end {by_dense_algebra(at):.7f}")
