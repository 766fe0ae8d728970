"""Many recordings: one row each, though processes die and files are bad."""
import csv
import json
import os
import pathlib
import random
import resource
import signal
import sqlite3
import subprocess
import time
import unittest

from program import LANE_CHANGE, PROGRAM, Folder, run

LEVEL = """identikal: 1
name: level
time: {kind: discrete, step: 1 s}
parameters:
  q: {value: 1, min: 0, role: process-noise}
  r: {value: 1, min: 0, role: measurement-noise}
A: [[1]]
C: [[1]]
Q: [[q]]
R: [[r]]
noise: {process: per-sample}
initial: diffuse
outputs: [{name: level, column: y}]
"""


def walk(rng, rows, q=1.0, r=4.0):
    x, out = 0.0, []
    for _ in range(rows):
        x += rng.gauss(0, q ** 0.5)
        out.append(f"{x + rng.gauss(0, r ** 0.5):.4f}")
    return out


class Fleet(unittest.TestCase):
    recordings = 24
    rows = 120

    def setUp(self):
        self.folder = Folder().__enter__()
        self.here = os.getcwd()
        os.chdir(self.folder.path)
        self.folder.write("level.yaml", LEVEL)
        rng = random.Random(5)
        os.mkdir("drives")
        for k in range(self.recordings):
            self.folder.write(f"drives/{k:04}.csv", "y\n" + "\n".join(walk(rng, self.rows)) + "\n")

    def tearDown(self):
        os.chdir(self.here)
        self.folder.__exit__()

    def tune(self, store, *options, code=0):
        return run("fleet", "tune", "level.yaml", "drives", "-o", store, *options, code=code).stdout

    def table(self, store):
        return run("fleet", "export", store, code=0).stdout


class Results(Fleet):
    def test_each_row_is_the_single_commands_result(self):
        self.tune("f.store")
        header, *rows = [line.split(",") for line in self.table("f.store").splitlines()]
        self.assertEqual([row[0] for row in rows], [f"drives/{k:04}.csv" for k in range(self.recordings)])
        for row in rows[:4]:
            alone = json.loads(run("tune", "level.yaml", row[0], "--json").stdout)
            of = dict(zip(header, row))
            for p in alone["parameters"]:
                self.assertEqual(float(of[p["name"]]), p["value"])
                self.assertEqual(float(of[p["name"] + "_se"]), p["se"])
                self.assertEqual([float(of[p["name"] + end]) for end in ("_low", "_high")], p["ci95"])
            self.assertEqual(of["status"], alone["status"]["code"])
            self.assertEqual(float(of["log_likelihood"]), alone["objective"]["log_likelihood"])

    def test_a_limit_of_time_keeps_what_is_done(self):
        self.folder.write("long.csv", "y\n" + "\n".join(walk(random.Random(1), 20000)) + "\n")
        os.mkdir("long")
        for k in range(400):
            os.link("long.csv", f"long/{k:03}.csv")
        begin = time.monotonic()
        run("fleet", "check", "level.yaml", "long", "-o", "long.store", "--workers", "1", "--time-limit", "1", code=3)
        self.assertLess(time.monotonic() - begin, 8)
        status = json.loads(run("fleet", "status", "long.store", "--json", code=3).stdout)
        self.assertTrue(0 < status["done"] < 400, status)

    def test_workers_engine_and_order_change_nothing(self):
        self.tune("one.store", "--workers", 1)
        self.tune("three.store", "--workers", 3)
        whole = self.table("one.store")
        self.assertEqual(whole.count("\n"), self.recordings + 1)
        self.assertEqual(self.table("three.store"), whole)
        # Shares, of a store that has only the plan so far.
        run("fleet", "tune", "level.yaml", "drives", "-o", "shares.store", "--engine", "slurm", "--dry-run", code=0)
        for k in (3, 1, 2):
            run("fleet", "resume", "shares.store", "--shard", f"{k}/3", code=0)
        self.assertIn("0 of 24", run("fleet", "status", "shares.store", code=3).stdout)
        run("fleet", "merge", "shares.store", "shares.store.2-of-3", code=3)
        self.assertIn("there is no store", run("fleet", "merge", "shares.store", "absent", code=2).stderr)
        run("fleet", "merge", "shares.store", code=0)
        self.assertEqual(self.table("shares.store"), whole)
        self.assertEqual([p.name for p in pathlib.Path(".").glob("shares.store*")], ["shares.store"])

    def test_parts_of_one_file_are_rows(self):
        rng = random.Random(5)
        lines = ["vehicle,y"]
        for k in range(4):
            lines += [f'"car, {k}",{v}' for v in walk(rng, self.rows)]
        self.folder.write("all.csv", "\n".join(lines) + "\n")
        run("fleet", "tune", "level.yaml", "all.csv", "--by", "vehicle", "-o", "by.store", code=0)
        self.tune("f.store")
        parts, whole = ([*csv.reader(self.table(store).splitlines())][1:] for store in ("by.store", "f.store"))
        self.assertEqual([row[3] for row in parts], [f"car, {k}" for k in range(4)])
        self.assertEqual([row[4:] for row in parts], [row[3:] for row in whole[:4]])

    def test_a_manifest_has_units_options_and_rows(self):
        self.folder.write("fleet.csv", "recording,unit,group,options,where\n"
                          "drives/0000.csv,car 1,A,--set r=4,\ndrives/0001.csv,car 2,A,,y > -1e9\n")
        run("fleet", "tune", "level.yaml", "fleet.csv", "-o", "f.store", "--no-profiles", code=0)
        header, first, second = [line.split(",") for line in self.table("f.store").splitlines()]
        self.assertEqual(header[:5], ["recording", "unit", "group", "options", "where"])
        self.assertEqual(first[1:4], ["car 1", "A", "--set r=4"])
        self.assertEqual(second[4], "y > -1e9")

    def test_sql_reads_it(self):
        self.tune("f.store")
        rows = sqlite3.connect("f.store").execute("SELECT value, se FROM parameter WHERE name = 'q'").fetchall()
        self.assertEqual(len(rows), self.recordings)
        self.assertTrue(all(value > 0 and se > 0 for value, se in rows))

    def test_other_verbs(self):
        run("fleet", "check", "level.yaml", "drives", "-o", "check.store", code=0)
        self.assertIn("nis_p", self.table("check.store").splitlines()[0])
        run("tune", "level.yaml", "drives/0000.csv", "-o", "result", code=0)
        run("fleet", "validate", "result", "drives", "-o", "validate.store", code=0)
        self.assertEqual(len(self.table("validate.store").splitlines()), self.recordings + 1)
        run("fleet", "fit", LANE_CHANGE[0], LANE_CHANGE[1], "-o", "fit.store", code=0)
        self.assertIn("Cf_se", self.table("fit.store").splitlines()[0])


class GoingOn(Fleet):
    def test_what_holds_is_not_done_again(self):
        self.tune("f.store")
        self.assertIn("0 done now", self.tune("f.store"))
        self.assertIn("24 had been done and hold", run("fleet", "resume", "f.store", code=0).stdout)
        pathlib.Path("drives/0003.csv").touch()  # another time, the same bytes
        self.assertIn("0 done now", self.tune("f.store"))
        self.folder.write("drives/0003.csv", "y\n" + "\n".join(walk(random.Random(1), 99)) + "\n")
        self.assertIn("1 done now", self.tune("f.store"))
        self.folder.write("drives/0100.csv", "y\n" + "\n".join(walk(random.Random(2), 99)) + "\n")
        os.remove("drives/0007.csv")
        self.assertIn("24 recordings, 1 done now", self.tune("f.store"))
        self.assertIn("24 done now", self.tune("f.store", "--starts", 1))
        self.folder.write("level.yaml", LEVEL.replace("value: 1,", "value: 2,"))
        done = run("fleet", "resume", "f.store", code=0)
        self.assertIn("has changed", done.stderr)
        self.assertIn("24 done now", done.stdout)

    def test_bad_recordings_are_rows(self):
        self.folder.write("drives/0001.csv", "y\nabc\n")
        self.folder.write("drives/0002.csv", "")
        self.folder.write("drives/0004.csv", "z\n1\n2\n")
        self.folder.write("drives/0005.csv", b"y\n1\n2\x00\n")
        self.folder.write("list.csv", "recording\nabsent.csv\ndrives/0006.csv\n")
        os.remove("drives/0003.csv")
        os.mkdir("drives/0003.csv")
        out = run("fleet", "tune", "level.yaml", "drives", "list.csv", "drives/0003.csv", "-o", "f.store", code=2)
        self.assertIn("no file *.csv", out.stderr)
        self.assertIn("stand twice", run("fleet", "tune", "level.yaml", "drives", "list.csv", "-o", "f.store", code=2).stderr)
        self.folder.write("list.csv", "recording\nabsent.csv\n")
        out = run("fleet", "tune", "level.yaml", "drives", "list.csv", "-o", "f.store", code=0).stdout
        self.assertRegex(out, r"failed +5\n")
        rows = self.table("f.store").splitlines()
        self.assertEqual(sum(",failed,2," in row for row in rows), 5)
        self.assertIn("cannot open", rows[-1])
        self.folder.write("absent.csv", "y\n" + "\n".join(walk(random.Random(1), 99)) + "\n")
        self.assertIn("1 done now", run("fleet", "resume", "f.store", code=0).stdout)

    def test_a_timeout_is_a_row(self):
        os.mkfifo("drives/fifo.csv")
        begin = time.monotonic()
        self.assertIn("took longer", self.tune("f.store", "--timeout", 1, code=3))  # 3: it may be done yet
        self.assertLess(time.monotonic() - begin, 20)
        self.assertIn("took longer than 1 s", self.table("f.store"))
        self.assertEqual(self.table("f.store").count("\n"), self.recordings + 2)

    def test_an_interrupt_leaves_what_was_done(self):
        os.mkfifo("drives/zz.csv")  # waits for ever
        work = subprocess.Popen([PROGRAM, "fleet", "tune", "level.yaml", "drives", "-o", "f.store"], stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, text=True)
        wait_for(lambda: counts("f.store") >= self.recordings - 1)
        work.send_signal(signal.SIGINT)
        out, _ = work.communicate(timeout=20)
        self.assertEqual(work.returncode, 130)
        self.assertIn("stopped before the rest", out)
        os.remove("drives/zz.csv")
        self.folder.write("drives/zz.csv", "y\n" + "\n".join(walk(random.Random(1), 99)) + "\n")
        self.assertIn("25 of 25", run("fleet", "resume", "f.store", code=0).stdout + run("fleet", "status", "f.store", code=0).stdout)
        self.assertFalse(os.path.exists("f.store.lock"))

    def test_a_full_disk_leaves_what_was_committed(self):
        self.tune("whole.store")
        size = os.path.getsize("whole.store")
        planned = os.path.getsize("whole.store") * 6 // 10

        def limit():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (planned, planned))
        self.assertGreater(size, planned)
        done = subprocess.run([PROGRAM, "fleet", "tune", "level.yaml", "drives", "-o", "f.store"], preexec_fn=limit,
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 5, done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1)
        self.assertIn("f.store", done.stderr)
        self.assertNotEqual(run("fleet", "status", "f.store").returncode, 5)
        self.tune("f.store")
        self.assertEqual(self.table("f.store"), self.table("whole.store"))


class Population(Fleet):
    recordings = 12

    def test_units_trends_and_strangers(self):
        """A unit with ten times the spread, and a level of noise that grows with mileage."""
        rng = random.Random(9)
        rows = ["recording,unit,mileage,day"]
        for k in range(30):
            q = 40.0 if k == 7 else 1.0
            self.folder.write(f"p{k}.csv", "y\n" + "\n".join(walk(rng, 400, q, 2.0 + 0.1 * k)) + "\n")
            rows.append(f"p{k}.csv,car {k},{1000 * k},Mon")
        self.folder.write("fleet.csv", "\n".join(rows) + "\n")
        run("fleet", "tune", "level.yaml", "fleet.csv", "-o", "p.store", code=0)
        q, r = json.loads(run("fleet", "population", "p.store", "--json", code=0).stdout)["parameters"]
        self.assertEqual([unit["unit"] for unit in q["units"] if not unit["belongs"]], ["car 7"])
        self.assertLess(r["trends"][0]["p"], 1e-4)
        self.assertEqual(r["trends"][0]["covariate"], "mileage")
        self.assertGreater(r["trends"][0]["slope"], 0)
        self.assertIn("car 7", run("fleet", "population", "p.store", code=0).stdout)
        run("fleet", "report", "p.store", "-o", "page.html", code=0)
        page = pathlib.Path("page.html").read_text()
        self.assertEqual(page.count("<figure>"), 6)
        self.assertNotIn("nan", page)

    def test_two_recordings_of_a_unit_count_once(self):
        self.folder.write("fleet.csv", "recording,unit\n" + "".join(f"drives/{k:04}.csv,car {k // 2}\n" for k in range(12)))
        run("fleet", "tune", "level.yaml", "fleet.csv", "-o", "p.store", code=0)
        self.assertEqual(len(json.loads(run("fleet", "population", "p.store", "--json").stdout)["parameters"][0]["units"]), 6)

    def test_groups_are_told_apart_where_they_differ(self):
        """The level of noise is three times as large in one group; q is the same."""
        rng = random.Random(13)
        rows = ["recording,unit,group"]
        for k in range(24):
            self.folder.write(f"g{k}.csv", "y\n" + "\n".join(walk(rng, 300, 1.0, 9.0 if k % 2 else 3.0)) + "\n")
            rows.append(f"g{k}.csv,car {k},{'old' if k % 2 else 'new'}")
        self.folder.write("groups.csv", "\n".join(rows) + "\n")
        run("fleet", "tune", "level.yaml", "groups.csv", "-o", "g.store", code=0)
        q, r = json.loads(run("fleet", "population", "g.store", "--json", code=0).stdout)["parameters"]
        self.assertEqual([g["group"] for g in r["groups"]], ["new", "old"])
        self.assertTrue(all(g["units"] >= 10 for g in r["groups"]), r["groups"])  # of those with status ok
        self.assertLess(r["groups_p"], 1e-6)
        self.assertGreater(q["groups_p"], 0.01)
        self.assertAlmostEqual(r["groups"][1]["mean"] - r["groups"][0]["mean"], 1.0986, delta=0.2)
        self.assertIn("groups differ", run("fleet", "population", "g.store", code=0).stdout)

    def test_too_few_are_told(self):
        run("fleet", "tune", "level.yaml", "drives/0000.csv", "-o", "p.store", code=0)
        self.assertIn("fewer units", run("fleet", "population", "p.store", code=0).stdout)


class Simulated(Fleet):
    recordings = 1

    def test_intervals_of_simulations_hold_the_truth(self):
        """200 recordings of 300 rows: of 95 % intervals fewer than 178 or more than 199 hold the truth with a chance of 1 %."""
        run("fleet", "tune", "level.yaml", "simulate:1-200 -n 300 --set r=4", "-o", "mc.store", "--workers", "2", code=0)
        found = json.loads(run("fleet", "coverage", "mc.store", "--json", code=0).stdout)
        self.assertEqual(found["rows"], 200)
        self.assertGreater(found["ok"], 170)
        for p, truth in zip(found["parameters"], (1, 4)):
            self.assertEqual(p["truth"], truth)
            self.assertTrue(178 / 200 <= p["inside"] / p["rows"] <= 199 / 200, p)
            self.assertAlmostEqual(p["mean_se"] / p["sd"], 1, delta=0.2)
            self.assertAlmostEqual(p["mean"], truth, delta=4 * p["sd"] / p["rows"] ** 0.5 + 0.02 * truth)
        self.assertIn("intervals hold the truth in", run("fleet", "coverage", "mc.store", code=0).stdout)
        # One of them is what 'simulate' and 'tune' make of that seed.
        run("simulate", "level.yaml", "-n", "300", "--seed", "7", "--set", "r=4", "-o", "s", code=0)
        alone = json.loads(run("tune", "level.yaml", "s/simulated.csv", "--json", code=0).stdout)
        with open("t.csv", "w") as out:
            out.write(run("fleet", "export", "mc.store", code=0).stdout)
        with open("t.csv") as rows:
            row = list(csv.DictReader(rows))[6]
        self.assertEqual(row["recording"], "simulate:7 -n 300 --set r=4")
        self.assertAlmostEqual(float(row["log_likelihood"]), alone["objective"]["log_likelihood"], delta=1e-6)
        # What is done is not done again, and more seeds go on.
        self.assertIn("200 had been done and hold", run("fleet", "tune", "level.yaml", "simulate:1-210 -n 300 --set r=4", "-o", "mc.store", code=0).stdout)

    def test_mistakes_of_simulations(self):
        for recipe, said in (("simulate:x -n 3", "simulate:SEED"), ("simulate:5-1 -n 3", "no seeds"), ("simulate:1- -n 3", "simulate:SEED"), ("simulate:0-99999999999 -n 3", "up to")):
            self.assertIn(said, run("fleet", "tune", "level.yaml", recipe, "-o", "x.store", code=2).stderr)
        run("fleet", "tune", "level.yaml", "simulate:1-2 --nonsense 3", "-o", "y.store")
        self.assertIn("unknown option '--nonsense'", run("fleet", "export", "y.store").stdout)
        run("fleet", "tune", "level.yaml", "drives", "-o", "z.store", code=0)
        self.assertIn("is not simulated", run("fleet", "coverage", "z.store", code=2).stderr)


class Digests(Fleet):
    recordings = 3
    rows = 4000

    def test_tune_of_digests_is_that_of_recordings(self):
        names = [f"drives/{k:04}.csv" for k in range(3)]
        for k, name in enumerate(names):
            run("digest", "level.yaml", name, "-o", f"{k}.digest", code=0)
        os.mkdir("all")
        run("digest", "level.yaml", "0.digest", "1.digest", "2.digest", "-o", "all/all.digest", code=0)
        whole = json.loads(run("tune", "level.yaml", *names, "--json", code=0).stdout)
        for files in (["0.digest", "1.digest", "2.digest"], ["all/all.digest"]):
            small = json.loads(run("tune", "level.yaml", *files, "--json", code=0).stdout)
            for a, b in zip(whole["parameters"], small["parameters"]):
                for key in ("value", "se"):
                    self.assertAlmostEqual(b[key] / a[key], 1, delta=1e-9)
            self.assertAlmostEqual(small["objective"]["log_likelihood"] / whole["objective"]["log_likelihood"], 1, delta=1e-12)
            self.assertIn("insufficient_power", [w["code"] for w in small["warnings"]])
        run("digest", "level.yaml", "all", "-o", "again.digest", code=0)
        self.assertEqual(pathlib.Path("again.digest").read_bytes(), pathlib.Path("all/all.digest").read_bytes())

    def test_check_and_bound_of_digests_are_those_of_recordings(self):
        """The score of each entry, its p-value, the gain of better noise, the excess error; the bound with as many samples."""
        self.folder.write("stable.yaml", LEVEL.replace("A: [[1]]", "A: [[0.9]]").replace("initial: diffuse", "initial: stationary"))
        for model in ("level.yaml", "stable.yaml"):
            run("digest", model, "drives/0000.csv", "-o", "0.digest", code=0)
            for noise in ("q=1", "q=3"):
                whole = json.loads(run("check", model, "drives/0000.csv", "--set", noise, "--set", "r=4", "--json").stdout)
                small = json.loads(run("check", model, "0.digest", "--set", noise, "--set", "r=4", "--json").stdout)
                scores = {(t["id"], t["channel"]): t for t in whole["tests"] if t["id"].startswith("score")}
                self.assertEqual(len(small["tests"]), 3)
                for test in small["tests"]:
                    self.assertAlmostEqual(test["value"], scores[test["id"], test["channel"]]["value"], delta=1e-9 * max(1, abs(test["value"])))
                    self.assertAlmostEqual(test["p"], scores[test["id"], test["channel"]]["p"], delta=1e-9)
                self.assertAlmostEqual(small["objective"]["log_likelihood"] / whole["objective"]["log_likelihood"], 1, delta=1e-9)
                self.assertAlmostEqual(small["derived"][0]["value"] / whole["derived"][0]["value"], 1, delta=1e-6)
                if noise == "q=3":
                    self.assertEqual(small["status"]["code"], "rejected")
                    steps = [[n for n in found["notes"] if "scoring steps" in n] for found in (whole, small)]
                    self.assertEqual(*steps)
            of_rows = json.loads(run("bound", model, "-n", str(self.rows), "--json", code=0).stdout)
            of_digest = json.loads(run("bound", model, "0.digest", "--json", code=0).stdout)
            for a, b in zip(of_rows["parameters"], of_digest["parameters"]):
                self.assertAlmostEqual(b["crb_se"] / a["crb_se"], 1, delta=1e-9)

    def test_mistakes(self):
        run("digest", "level.yaml", "drives/0000.csv", "-o", "0.digest", code=0)
        self.folder.write("other.yaml", LEVEL.replace("name: level, column", "name: height, column"))
        self.folder.write("gap.csv", "y\n1\n2\n\n" + "\n".join(walk(random.Random(1), 500)) + "\n")
        damaged = pathlib.Path("0.digest").read_bytes()[:-1] + b"?"
        self.folder.write("damaged.digest", damaged)
        for arguments, word in [
                (("tune", "level.yaml", "0.digest", "drives/0001.csv"), "a recording beside digests"),
                (("tune", "level.yaml", "0.digest", "0.digest"), "in another digest too"),
                (("tune", "level.yaml", "0.digest", "--hold-out", "30%"), "--hold-out does not apply to digests"),
                (("tune", "level.yaml", "damaged.digest"), "a damaged digest"),
                (("tune", "other.yaml", "0.digest"), "outputs height"),
                (("filter", "level.yaml", "0.digest"), "digest"),
                (("check", "level.yaml", "0.digest", "--range", "0:50"), "--range does not apply to digests"),
                (("bound", "level.yaml", "0.digest", "-n", "50"), "-n does not apply to digests"),
                (("digest", "level.yaml", "gap.csv", "-o", "x.digest"), "a sample is missing"),
                (("digest", "level.yaml", "drives/0000.csv", "-o", "x.txt"), ".digest"),
                (("digest", "level.yaml", "drives/0000.csv", "--range", "0:50", "-o", "x.digest"), "a long recording")]:
            done = run(*arguments, code=2)
            self.assertIn(word, done.stderr, arguments)
            self.assertEqual(done.stderr.count("\n"), 1)


class Killed(Fleet):
    recordings = int(os.environ.get("FLEET_RECORDINGS", 60))
    rows = int(os.environ.get("FLEET_ROWS", 3000))
    kills = int(os.environ.get("FLEET_KILLS", 12))

    def test_the_table_is_the_undisturbed_one(self):
        """kill -9 of workers and of the whole, at any time: after `fleet resume` the same table, byte for byte."""
        self.tune("whole.store")
        rng = random.Random(3)
        killed = whole = 0
        work = None
        while killed < self.kills:
            if work is None or work.poll() is not None:
                if work is not None and work.returncode == 0:
                    for name in ("f.store", "f.store-journal"):
                        pathlib.Path(name).unlink(missing_ok=True)
                work = subprocess.Popen([PROGRAM, "fleet", "tune", "level.yaml", "drives", "-o", "f.store"],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(rng.uniform(0, 0.06))
            victims = children(work.pid)
            if rng.random() < 0.3:
                victims = [work.pid]
            if not victims or work.poll() is not None:
                continue
            try:
                os.kill(rng.choice(victims), signal.SIGKILL)
            except ProcessLookupError:
                continue
            killed += 1
            whole += victims == [work.pid]
        work.wait()
        if not os.path.exists("f.store"):
            self.tune("f.store")
        if run("fleet", "status", "f.store").returncode == 2:  # it was killed before the plan was there
            self.tune("f.store")
        run("fleet", "resume", "f.store", code=0)
        self.assertEqual(self.table("f.store"), self.table("whole.store"))
        print(f"{killed} processes killed, {whole} of them the whole: the same table")

    def test_one_that_always_dies_is_a_row(self):
        """The process of one recording is killed whenever it comes to it: a row, and the others are done."""
        os.mkfifo("drives/0010b.csv")
        work = subprocess.Popen([PROGRAM, "fleet", "tune", "level.yaml", "drives", "-o", "f.store", "--retries", "2"],
                                stdout=subprocess.PIPE, text=True)
        self.addCleanup(work.stdout.close)
        deaths = 0
        end = time.monotonic() + 60
        while work.poll() is None:
            if time.monotonic() > end:
                work.kill()
                self.skipTest("this system does not tell what a process waits for")
            for child in children(work.pid):
                if opens(child, "0010b.csv"):
                    os.kill(child, signal.SIGKILL)
                    deaths += 1
                    wait_for(lambda: child not in children(work.pid))
            time.sleep(0.01)
        self.assertLessEqual(deaths, 4)
        self.assertIn("its process ended 3 times (signal 9)", self.table("f.store"))
        self.assertEqual(self.table("f.store").count(",failed,"), 1)
        os.remove("drives/0010b.csv")
        self.folder.write("drives/0010b.csv", "y\n" + "\n".join(walk(random.Random(1), 99)) + "\n")
        self.assertIn("1 done now", run("fleet", "resume", "f.store", code=0).stdout)


class Refused(Fleet):
    recordings = 2

    def refused(self, words, *arguments, code=2):
        done = run("fleet", *arguments, code=code)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)

    def test_mistakes(self):
        m, o = "level.yaml", ("-o", "f.store")
        self.refused(["unknown verb 'fleet tun'", "did you mean 'tune'"], "tun", m, "drives", *o)
        self.refused(["unknown option '--start' of 'fleet tune'", "--starts"], "tune", m, "drives", *o, "--start", 1)
        self.refused(["--starts"], "tune", m, "drives", *o, "--starts", "x")
        self.refused(["--json", "unknown option"], "tune", m, "drives", *o, "--json")
        self.refused(["-o is missing"], "tune", m, "drives")
        self.refused(["MANIFEST is missing"], "tune", m, *o)
        self.refused(["absent.yaml"], "tune", "absent.yaml", "drives", *o)
        self.refused(["no file matches"], "tune", m, "x*.csv", *o)
        self.refused(["--shards", "--engine slurm"], "tune", m, "drives", *o, "--shards", 2)
        self.refused(["there is no store"], "resume", "absent.store")
        self.refused(["this is no store"], "status", m)
        self.folder.write("fleet.csv", "recording,options\ndrives/0000.csv,--start 1\n")
        self.refused(["options '--start 1'", "did you mean"], "tune", m, "fleet.csv", *o)
        self.folder.write("fleet.csv", "recording,options\ndrives/0000.csv,--json\n")
        self.refused(["--json"], "tune", m, "fleet.csv", *o)
        self.assertFalse(os.path.exists("f.store"))
        self.tune("f.store")
        self.refused(["--shard '4/3'"], "resume", "f.store", "--shard", "4/3")
        os.mkdir("below")
        os.chdir("below")
        self.refused(["cd '"], "resume", "../f.store")
        os.chdir("..")

    def test_two_at_once(self):
        os.mkfifo("drives/zz.csv")
        work = subprocess.Popen([PROGRAM, "fleet", "tune", "level.yaml", "drives", "-o", "f.store"], stdout=subprocess.DEVNULL)
        wait_for(lambda: counts("f.store") >= 1)
        self.refused(["another process is at work"], "resume", "f.store")
        self.assertIn("of 3 recordings done", run("fleet", "status", "f.store", code=3).stdout)
        work.kill()
        work.wait()


def children(process):
    try:
        return [int(p) for p in pathlib.Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    except OSError:
        return []


def opens(process, name):
    """Whether it waits in open() of the pipe: nobody writes to it."""
    try:
        return pathlib.Path(f"/proc/{process}/wchan").read_text() in ("wait_for_partner", "fifo_open", "pipe_wait_readable", "pipe_open")
    except OSError:
        return False


def counts(store):
    try:
        return sqlite3.connect(f"file:{store}?mode=ro", uri=True).execute("SELECT count(*) FROM result").fetchone()[0]
    except sqlite3.Error:
        return 0


def wait_for(condition, seconds=20):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            raise AssertionError("it did not come to pass")
        time.sleep(0.01)


if __name__ == "__main__":
    unittest.main()
