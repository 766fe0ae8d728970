"""Each mistake is one clear line, and leaves nothing behind."""
import json
import os
import pathlib
import random
import re
import resource
import subprocess
import unittest

from program import LANE_CHANGE, NILE, PROGRAM, Folder, result, run, table


class BadInput(unittest.TestCase):
    """Each mistake: exit 2 (5 for the output folder), one line on stderr that holds the given words, nothing on stdout, no file made."""

    def refused(self, words, *arguments, code=2):
        before = sorted(os.listdir(self.folder.path))
        done = run(*arguments)
        self.assertEqual(done.returncode, code, f"{arguments}\n{done.stdout}{done.stderr}")
        self.assertEqual(done.stdout, "")
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        self.assertLess(len(done.stderr), 600, done.stderr)
        for word in words:
            self.assertIn(word, done.stderr)
        self.assertEqual(sorted(os.listdir(self.folder.path)), before)

    def setUp(self):
        self.folder = Folder().__enter__()
        self.out = ("-o", self.folder.path / "out")

    def tearDown(self):
        self.folder.__exit__()

    def test_reports(self):
        out = self.folder.path / "result"
        run("tune", *NILE, "-o", out, code=0)
        result_text, data_text = ((out / name).read_text() for name in ("result.json", "report_data.json"))
        cases = [
            ("result.json", result_text[:1000], ["result.json", "no whole JSON", "byte"]),
            ("result.json", "[1, 2]", ["no result of this program"]),
            ("result.json", result_text.replace('"schema_version": 2', '"schema_version": 3'), ["schema_version 3", "expected 1 or 2"]),
            ("result.json", result_text.replace("1469", "1470"), ["report_data.json", "belongs to another result"]),
            ("report_data.json", data_text[:-100], ["report_data.json", "no whole JSON"]),
            ("report_data.json", data_text.replace('"schema_version":2', '"schema_version":9'), ["report_data.json", "schema_version 9"]),
            ("report_data.json", None, ["report_data.json", "cannot be read"]),
            ("report_data.json", data_text.replace('"channels":[{"name":"level"', '"chanels":[{"name":"level"'), ["report_data.json", "has been changed"]),
            ("report_data.json", re.sub('"time":\\[[^]]*\\]', '"time":"abc"', data_text), ["report_data.json", "has been changed"]),
            ("report_data.json", re.sub('"result_sha256":"[0-9a-f]*"', '"result_sha256":5', data_text), ["'result_sha256' is no text"]),
            ("report_data.json", data_text.replace('"rows":100', '"rows":1e999'), ["report_data.json", "too large"]),
            ("result.json", None, ["result.json", "cannot be read"]),
        ]
        for name, text, words in cases:
            (out / "result.json").write_text(result_text)
            (out / "report_data.json").write_text(data_text)
            if text is None:
                (out / name).unlink()
            else:
                self.assertNotEqual(text, data_text)
                self.assertNotEqual(text, result_text)
                (out / name).write_text(text)
            self.refused(words, "report", out)
            self.assertFalse((out / "report.html").exists())
        self.refused(["nowhere", "cannot be read"], "report", self.folder.path / "nowhere")
        self.refused(["--report"], "tune", *NILE, "--report", "/proc/none/page.html", code=5)
        self.refused(["--report"], "tune", *NILE, "--report", "")
        self.refused(["unknown option '--report' of 'compare'", "'report'"], "compare", NILE[0], *NILE, "--report", self.folder.path / "page.html")

    def test_results_that_no_program_wrote(self):
        out, other = self.folder.path / "result", self.folder.path / "other"
        for folder in (out, other):
            run("tune", *NILE, "-o", folder, code=0)
        text = (out / "result.json").read_text()
        (self.folder.path / "loop").symlink_to("loop")
        long = self.folder.path / ("x" * 5000)
        for spoilt, words in ((re.sub('"log_likelihood": [-0-9.]+', '"log_likelihood": 1e999', text), ["result.json", "too large"]),
                              ('{"schema_version":' + 200_000 * "[" + 200_000 * "]" + "}", ["result.json", "in more than"]),
                              ('{"schema_version":' + 200_000 * '{"a":' + "1" + 200_000 * "}" + "}", ["result.json", "in more than"]),
                              ('{"schema_version":"' + 5000 * "1" + '"}', ["schema_version"]),
                              (text.replace('"code": "ok"', '"code": "o\\nk' + 5000 * "k" + '"'), ["status.code"]),
                              (re.sub('"rows": 100', '"rows": 1e300', text), ["'inputs[0].rows' is no whole number"])):
            self.assertNotEqual(spoilt, text)
            (out / "result.json").write_text(spoilt)
            for job in (("report", out), ("export", out, "--to", "c"), ("validate", out, NILE[1]), ("compare", other, out),
                        ("filter", *NILE, "--from", out)):
                # What does not belong to report_data.json any more is refused for that.
                edited = "inputs" in spoilt and "1e999" not in spoilt and job[0] in ("report", "export")
                with self.subTest(spoilt=spoilt[:60], job=job[0]):
                    self.refused(["belongs to another result"] if edited else words, *job)
        for path in (self.folder.path / "loop", long):
            for job in (("report", path), ("export", path, "--to", "c"), ("validate", path, NILE[1]), ("compare", other, path),
                        ("filter", *NILE, "--from", path)):
                done = run(*job, code=2)
                self.assertEqual(("", 1), (done.stdout, done.stderr.count("\n")))
                self.assertIn("cannot be read", done.stderr)
        # A folder whose name is too long to be made is no internal error either.
        self.refused(["x" * 300], "report", other, "--report", self.folder.path / ("x" * 300 + ".html"), code=5)

    def test_exports_of_nothing(self):
        out = self.folder.path / "result"
        run("tune", *NILE, "-o", out, code=0)
        (out / "report_data.json").unlink()
        result = json.loads((out / "result.json").read_text())
        for name, null in (("A", [[None]]), ("A", None), ("P", [[None]])):
            filter_ = {**result["filter"], name: null}
            (out / "result.json").write_text(json.dumps({**result, "filter": filter_}))
            for language in ("cpp", "c", "matlab", "python", "json"):
                self.refused([f"a number of '{name}' is missing"], "export", out, "--to", language)

    def test_exports(self):
        out = self.folder.path / "result"
        run("tune", *NILE, "-o", out, code=0)
        text = (out / "result.json").read_text()
        self.refused(["--to 'pyton'", "did you mean 'python'"], "export", out, "--to", "pyton")
        self.refused(["--to"], "export", out)
        self.refused(["nowhere", "cannot be read"], "export", self.folder.path / "nowhere", "--to", "c")
        self.refused(["-o"], "export", out, "--to", "c", "-o", "/proc/none/filter.h", code=5)
        for spoilt, words in ((text[:1000], ["no whole JSON", "byte"]), ("[1, 2]", ["no result of this program"]),
                              (text.replace('"schema_version": 2', '"schema_version": 3'), ["schema_version 3", "expected 1 or 2"]),
                              (text.replace("1469", "1470"), ["report_data.json", "belongs to another result"])):
            (out / "result.json").write_text(spoilt)
            self.refused(words, "export", out, "--to", "python")
        (out / "report_data.json").unlink()
        (out / "result.json").write_text(text.replace('"parameters"', '"parametres"'))
        self.refused(["'parameters' is missing"], "export", out, "--to", "python")
        (out / "result.json").unlink()
        self.refused(["result.json", "cannot be read"], "export", out, "--to", "python")

    def test_data(self):
        write = self.folder.write
        rng = random.Random(2)
        cases = [
            (write("empty.csv", ""), ["empty.csv"]),
            (write("header.csv", "year,volume\n"), ["header.csv"]),
            (write("column.csv", "year,volum\n1,2\n2,3\n"), ["nile.yaml:", "volume", "volum"]),
            (write("text.csv", "year,volume\n1,2\n2,abc\n3,4\n"), ["text.csv:3:3", "abc"]),
            (write("ragged.csv", "year,volume\n1,2\n2\n3,4\n"), ["ragged.csv:3"]),
            (write("wide.csv", ",".join(f"c{i}" for i in range(100000)) + "\n" + ",".join("1" for _ in range(100000)) + "\n"), ["wide.csv:1"]),
            (write("junk.csv", bytes(rng.randrange(256) for _ in range(5000))), ["junk.csv"]),
            (write("constant.csv", "year,volume\n" + "".join(f"{i},5\n" for i in range(50))), ["never changes"]),
            (write("short.csv", "year,volume\n1,2\n2,3\n"), ["2 samples for 2 unknowns"]),
            (str(self.folder.path / "missing.csv"), ["missing.csv"]),
            (str(self.folder.path), [str(self.folder.path)]),
        ]
        for path, words in cases:
            with self.subTest(path=path):
                self.refused(words, "tune", NILE[0], path, *self.out)

    def test_joins(self):
        self.refused(["'+' without a file"], "info", NILE[1] + "+")
        self.refused(["missing.csv", "cannot open"], "info", NILE[1] + "+missing.csv")
        self.refused(["no time column"], "tune", NILE[0], NILE[1] + "+" + NILE[1])
        self.refused(["is in two files"], "fit", LANE_CHANGE[0], LANE_CHANGE[1] + "+" + LANE_CHANGE[1])

    def test_channel_keys(self):
        text = pathlib.Path(LANE_CHANGE[0]).read_text()
        for keys, words in (("scale: 0", "scale is 0"), ("scale: x", "scale is 'x'"), ("offset: 2 m", "offset"),
                            ("delay: 3 m", "delay"), ("delay: 99 s", "shorter than the recording"),
                            ("dely: 1 s", "did you mean 'delay'")):
            model = self.folder.write("m.yaml", text.replace("column: yaw_rate", "column: yaw_rate, " + keys))
            self.refused([words, "m.yaml:"], "fit", model, LANE_CHANGE[1])

    def test_vehicle_survey(self):
        self.refused(["--vehicle with a linear model"], "info", "--vehicle", *NILE)
        self.refused(["--json without --vehicle"], "info", "--json", NILE[1])
        for text in ("t,r\n0,1\n", "t,yaw_rate,vx,swa\n0,1,2,3\n", "a,b\n1,2\n2,3\n", "t,vx,r\n0,,\n1,,\n2,3,4\n",
                     "t,vx,r,swa\n" + "".join(f"{i / 10},0,0,0\n" for i in range(50))):
            data = self.folder.write("odd.csv", text)
            done = run("info", "--vehicle", data)
            self.assertEqual(0, done.returncode, done.stderr)
            self.assertIn("SERIOUS", done.stdout)

    def test_survey_of_runs(self):
        """What the survey advises for a file of several runs, it takes itself."""
        lines = pathlib.Path(LANE_CHANGE[1]).read_text().splitlines()
        rows = [line for line in lines if line[0].isdigit() or line[0] == "-"]
        head = [line for line in lines if line not in rows]
        data = self.folder.write("runs.csv", "\n".join([*head, *rows, *rows]) + "\n")
        self.assertIn("several_runs", run("info", "--vehicle", data, code=0).stdout)
        model = self.folder.write("runs.yaml", pathlib.Path(LANE_CHANGE[0]).read_text().replace("unit: s}", "unit: s, runs: restart}", 1))
        self.assertIn("no faults found", run("info", "--vehicle", model, data, code=0).stdout)
        data = self.folder.write("runs.csv", "\n".join([*head, *rows, rows[0]]) + "\n")
        self.refused(["a run of this row alone", "is a stamp written twice"], "fit", model, data)

    def test_time(self):
        header = "t,swa,speed,yaw_rate,vy\n"
        rows = [f"{i / 10},{i % 7},60,{i % 5},0.1\n" for i in range(70)]
        duplicate, backward = rows[:], rows[:]
        duplicate[30] = duplicate[29]
        backward[30] = "0.5" + backward[30][backward[30].index(","):]
        for name, lines, words in (("duplicate.csv", duplicate, ["duplicate.csv:32"]), ("backward.csv", backward, ["backward.csv:32"])):
            with self.subTest(name):
                self.refused(words, "fit", LANE_CHANGE[0], self.folder.write(name, header + "".join(lines)), *self.out)

    def test_model(self):
        nile = pathlib.Path(NILE[0]).read_text()
        cases = [
            ("unknown_key.yaml", nile.replace("initial:", "inital:"), ["unknown_key.yaml:", "inital", "initial"]),
            ("duplicate.yaml", nile + "A: [[1]]\n", ["duplicate.yaml:", "A"]),
            ("size.yaml", nile.replace("C: [[1]]", "C: [[1, 0]]"), ["size.yaml:", "C"]),
            ("negative.yaml", nile.replace("r: {value: 1000, min: 0", "r: {value: -1000, min: -1e6"), ["negative.yaml:"]),
            ("nan.yaml", nile.replace("A: [[1]]", "A: [[.nan]]"), ["nan.yaml:"]),
            ("unit.yaml", nile.replace("step: 1 s", "step: 1 sce"), ["unit.yaml:", "sce"]),
            ("empty.yaml", "", ["empty.yaml"]),
            ("junk.yaml", bytes(random.Random(3).randrange(256) for _ in range(3000)), ["junk.yaml"]),
        ]
        for name, content, words in cases:
            with self.subTest(name):
                self.assertNotEqual(content, nile)
                self.refused(words, "tune", self.folder.write(name, content), NILE[1], *self.out)
        self.refused(["nowhere.yaml"], "tune", self.folder.path / "nowhere.yaml", NILE[1], *self.out)

    def test_command_line(self):
        self.refused(["tune"], "tuen", *NILE)
        self.refused(["unknown option '--jsno' of 'tune'; did you mean '--json'?"], "tune", *NILE, "--jsno")
        self.refused(["unknown option '--jsno' of 'tune'"], "tune", "--jsno=3")
        self.refused(["unknown option '--bootstrap' of 'tune'; 'fit' has it"], "tune", *NILE, "--bootstrap", 100)
        self.refused(["unknown option '--nonsense' of 'check'; 'identikal check --help'"], "check", *NILE, "--nonsense")
        self.refused(["DATA"], "tune", NILE[0])
        self.refused(["unknown option '--x'"], "--x", "tune", "\r-ran", "tune", "\r-ran")
        self.refused(["'p'"], "tune", *NILE, "--set", "p=1")
        self.refused(["range"], "tune", *NILE, "--range", "1to5")
        self.refused(["-n"], "simulate", NILE[0])
        self.refused(["unknown manoeuvre", "did you mean 'step-steer'"], "simulate", LANE_CHANGE[0], "--manoeuvre", "step-ster")
        self.refused(["unknown setting", "'width'"], "simulate", LANE_CHANGE[0], "--manoeuvre", "obstacle-avoidance", "--with", "widht=2 m")
        self.refused(["--with rise '2 kg'"], "simulate", LANE_CHANGE[0], "--manoeuvre", "step-steer", "--with", "rise=2 kg")
        self.refused(["--with 'rise' has no '='"], "simulate", LANE_CHANGE[0], "--manoeuvre", "step-steer", "--with", "rise")
        self.refused(["does not apply with a recording"], "simulate", *LANE_CHANGE, "--manoeuvre", "step-steer")
        self.refused(["--snr"], "simulate", NILE[0], "-n", 9, "--snr", "30dB")
        self.refused(["--snr '30 dezibel'"], "simulate", LANE_CHANGE[0], "--snr", "30 dezibel")
        self.refused(["-n"], "bound", NILE[0])
        self.refused(["--accuracy"], "bound", NILE[0], "-n", 100, "--accuracy", "-1")
        self.refused(["--accuracy '-5%' is not above 0; expected above 0%, e.g. 10%"], "bound", NILE[0], "-n", 100, "--accuracy", "-5%")
        self.refused(["--accuracy '0' is not above 0"], "bound", NILE[0], "-n", 100, "--accuracy", "0")
        self.refused(["--snr 'x' is not a ratio; expected decibels, e.g. 30dB"], "simulate", LANE_CHANGE[0], "--snr", "x")
        self.refused(["--lags"], "tune", *NILE, "--lags", 5)
        self.refused(["matisko-table-3"], "study", "matisko-table-33")
        self.refused(["--runs", "nothing in it is repeated"], "study", "matisko-figure-6", "--runs", 3)
        self.refused(["--threads"], "study", "matisko-table-3", "--threads", 0)

    def test_values_of_options(self):
        """What the parser refuses is said in the words of this program."""
        for words, arguments in (("--starts 'x'; expected a whole number from 1 to 1000", ("--starts", "x")),
                                 ("--starts '0'; expected a whole number from 1 to 1000", ("--starts", 0)),
                                 ("--starts '1e99'", ("--starts", "1e99")), ("--seed '-1'", ("--seed=-1",)),
                                 ("-o is given twice; expected once", ("-o", "a", "-o", "b")),
                                 ("--starts is given twice; expected once", ("--starts", 1, "--starts", 2)),
                                 ("--starts has no value", ("--starts",)), ("--json takes no value", ("--json=3",)),
                                 ("--method 'alls'; expected one of ml, als, als-weighted, auto, bayes; did you mean 'als'?", ("--method", "alls")),
                                 ("--report 'x/' names no file; expected a file", ("--report", "x/"))):
            self.refused([words], "tune", *NILE, *arguments)
        self.refused(["unknown option '--jsno' of 'tune'"], "tune", *NILE, "--starts", "x", "--jsno")
        self.refused(["DATA is missing; expected 'identikal tune MODEL DATA...'; 'identikal tune --help'"], "tune", NILE[0])
        self.refused(["--to is missing"], "export", self.folder.path)
        self.refused(["unexpected argument 'more' of 'init'; expected 'identikal init [TEMPLATE]'"], "init", "pendulum", "more")
        # 010 is ten, not eight.
        self.assertIn("10 of 10 starts", run("tune", *NILE, "--starts", "010").stdout)

    def test_empty_values(self):
        for name, arguments in (("--hold-out", ("tune", *NILE, "--hold-out", "")), ("--range", ("tune", *NILE, "--range", "")),
                                ("--fit", ("validate", self.folder.path, NILE[1], "--fit", "")), ("--accuracy", ("bound", NILE[0], "-n", 9, "--accuracy", "")),
                                ("--snr", ("simulate", LANE_CHANGE[0], "--snr", "")), ("--manoeuvre", ("simulate", LANE_CHANGE[0], "--manoeuvre", "")),
                                ("TEMPLATE", ("init", "")), ("MODEL", ("tune", "", NILE[1])), ("DATA", ("tune", NILE[0], "")),
                                ("--set", ("tune", *NILE, "--set", "")), ("--report", ("tune", *NILE, "--report", "")), ("--output", ("tune", *NILE, "-o", ""))):
            self.refused([f"{name} is empty; expected a"], *arguments)

    def test_options_without_effect(self):
        for option, arguments in (("--speed", ("simulate", NILE[0], "-n", 10, "--speed", 10)), ("--rate", ("simulate", NILE[0], "-n", 10, "--rate", 10)),
                                  ("--duration", ("simulate", NILE[0], "-n", 10, "--duration", 10)), ("--speed", ("simulate", *LANE_CHANGE, "--speed", 10)),
                                  ("--range", ("simulate", NILE[0], "-n", 10, "--range", "0:3")), ("--range", ("bound", NILE[0], "-n", 10, "--range", "0:3")),
                                  ("--range", ("info", "--range", "5:1", NILE[1])), ("--draws", ("tune", *NILE, "--draws", 20)),
                                  ("--starts", ("tune", *NILE, "--method", "als", "--starts", 3)), ("--evaluation", ("tune", *NILE, "--method", "bayes", "--evaluation", "steady-state"))):
            self.refused([f"{option} does not apply"], *arguments)
        pendulum = self.folder.write("pendulum.yaml", run("init", "pendulum", code=0).stdout)
        for name, arguments in (("q", ("tune", *NILE, "--set", "q=1", "--set", "q =2")), ("torque", ("simulate", pendulum, "-n", 9, "--input", "torque=1", "--input", "torque=2")),
                                ("ay", ("simulate", LANE_CHANGE[0], "--manoeuvre", "step-steer", "--with", "ay=3", "--with", "ay=4"))):
            self.refused([f"'{name}' is set twice", "expected once"], *arguments)

    def test_hints_are_near(self):
        data = self.folder.write("five.csv", "a,b,c,d,e\n" + 60 * "1,2,3,4,5\n")
        model = self.folder.write("five.yaml", pathlib.Path(NILE[0]).read_text().replace("column: volume", "column: 7"))
        self.refused(["no column '7'", "expected a name or 1 to 5"], "tune", model, data)
        done = run("tune", *NILE, "--set", "zz=1", code=2)
        self.assertNotIn("did you mean", done.stderr)
        self.assertIn("did you mean 'q'", run("tune", *NILE, "--set", "Q=1", code=2).stderr)

    def test_a_vehicle_is_no_filter(self):
        for verb, more in (("filter", ()), ("check", ()), ("tune", ())):
            self.refused([f"'{verb}' takes the model of a filter, this is a vehicle; expected a model with A, C, Q, R, or formulas; use 'fit'"], verb, *LANE_CHANGE, *more)
        self.refused(["'bound' takes the model of a filter"], "bound", LANE_CHANGE[0], "-n", 10)

    def test_results_among_models(self):
        out = self.folder.path / "result"
        run("tune", *NILE, "-o", out, code=0)
        for result_ in (out, out / "result.json"):
            self.refused(["no recording on the command line; expected identikal compare A.yaml B.yaml DATA"], "compare", result_, NILE[0])

    def test_old_names_are_understood_and_named(self):
        for old, new in ((("tune", *NILE, "--path", "direct"), "--evaluation time-varying"),
                         (("tune", *NILE, "--robust"), "--reject-outliers"),
                         (("tune", *NILE, "--method", "als", "--regain"), "--iterate"),
                         (("tune", *NILE, "--method", "als", "--sources"), "--min-rank"),
                         (("track", *NILE, "--draws", "20"), "--particles"),
                         (("bound", NILE[0], "--samples", "100"), "--rows"),
                         (("fit", *NILE, "--robust"), "--reject-outliers"),
                         (("check", "--compare", NILE[0], *NILE), "the verb 'compare'")):
            done = run(*old)
            self.assertIn(done.returncode, (0, 1, 3), done.stderr)
            self.assertEqual(1, done.stderr.count("\n"), done.stderr)
            self.assertIn(f"is called {new} now", done.stderr)

    def test_help(self):
        text = run("--help", code=0).stdout
        self.assertIn("Usage: identikal [OPTIONS] SUBCOMMAND", text)
        verbs = re.findall(r"^  ([a-z]+)  ", text.split("Subcommands:")[1], re.M)
        self.assertGreaterEqual(len(verbs), 15)
        for verb in verbs:
            text = run(verb, "--help", code=0).stdout
            self.assertIn(f"Usage: identikal {verb} ", text)
            self.assertNotIn("\n\n\n", text)
            self.assertFalse(text.endswith("\n\n"), verb)
            for name in ("--regain", "--sources", "--samples", "--compare", "--path"):
                self.assertNotIn(name, text)
            options = text.split("Options:")[1].split("Manoeuvres")[0]
            for option in re.findall(r"^  -.*?(?=^  -|\Z)", options, re.M | re.S):
                self.assertRegex(option.split("  ")[-1].strip().split("\n")[0], r"^([a-z-]+: )?[A-Z].*", verb)
        lines = run("--version", code=0).stdout.splitlines()
        self.assertRegex(lines[0], r"^identikal \d+\.\d+\.\d+$")
        self.assertRegex(lines[1], r"^Eigen [\d.]+, Ceres [\d.]+, \w+ [\d.]+$")

    def test_joined_recordings(self):
        rows = pathlib.Path(LANE_CHANGE[1]).read_text().splitlines()
        start = next(i for i, row in enumerate(rows) if row[:1].isdigit())
        twice = self.folder.write("twice.csv", "\n".join(rows + rows[start:]) + "\n")
        self.refused(["time goes back", "'runs: restart' under 'time' in the model file"], "fit", LANE_CHANGE[0], twice)
        model = self.folder.write("runs.yaml", pathlib.Path(LANE_CHANGE[0]).read_text().replace("unit: s}", "unit: s, runs: restart}", 1))
        self.assertEqual(140, result("fit", model, twice)["inputs"][0]["used"])

    @unittest.skipUnless(os.path.exists("/dev/full"), "no /dev/full here")
    def test_a_full_disk(self):
        out = self.folder.path / "out"
        run("tune", *NILE, "-o", out, code=0)
        for arguments in (("--help",), ("--version",), ("tune", "--help"), ("init",), ("init", "pendulum"), ("info", NILE[1]), ("report", out),
                          ("info", "--vehicle", LANE_CHANGE[1]), ("simulate", NILE[0], "-n", "9"), ("filter", *NILE), ("compare", out, out)):
            with self.subTest(arguments), open("/dev/full", "w", encoding="ascii") as full:
                done = subprocess.run([PROGRAM, *map(str, arguments)], stdout=full, stderr=subprocess.PIPE, text=True, timeout=300)
                self.assertEqual((5, "identikal: standard output: cannot write\n"), (done.returncode, done.stderr))

    def test_a_unit_nobody_knows(self):
        text = pathlib.Path(LANE_CHANGE[1]).read_text()
        header = next(line for line in text.splitlines() if "yaw_rate" in line)
        self.assertIn("yaw_rate [deg/s]", header)
        data = self.folder.write("odd.csv", text.replace("yaw_rate [deg/s]", "yaw_rate [grad/sec]"))
        out = result("fit", LANE_CHANGE[0], data)
        said = [w for w in out["warnings"] if w["code"] == "unknown_unit"]
        self.assertEqual(1, len(said))
        self.assertEqual("warning", said[0]["severity"])
        self.assertIn("odd.csv: unknown unit 'grad/sec' of column 'yaw_rate'; taken as 'deg/s', as the model file says", said[0]["text"])
        run("fit", LANE_CHANGE[0], data, "--strict", code=4)
        self.assertEqual([], [w for w in result("fit", *LANE_CHANGE)["warnings"] if w["code"] == "unknown_unit"])

    def test_a_number_alone_is_in_the_unit_listed(self):
        one, other = (run("simulate", LANE_CHANGE[0], "--manoeuvre", "step-steer", "--with", ay, code=0).stdout for ay in ("ay=3", "ay=3 m/s^2"))
        self.assertEqual(one, other)
        self.assertIn("ay = 3 m/s^2", one)
        self.assertIn("a number alone is in the unit listed below", " ".join(run("simulate", "--help", code=0).stdout.split()))

    def test_output_folder(self):
        blocked = self.folder.write("file", "not a folder")
        self.refused(["file"], "tune", *NILE, "-o", blocked, code=5)
        self.refused(["file"], "tune", *NILE, "-o", blocked + "/below", code=5)
        # Folders that were made go again.
        self.refused(["is a folder"], "tune", *NILE, "-o", self.folder.path / "new/below", "--report", self.folder.path, code=5)
        self.refused(["cannot make the folder"], "tune", *NILE, "--report", self.folder.path / "new/page.html", "-o", blocked + "/below", code=5)

    def test_a_limit_of_file_size(self):
        limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
        out = self.folder.path / "new/below"
        done = subprocess.run([PROGRAM, "tune", *NILE, "-o", out], capture_output=True, text=True, timeout=300, preexec_fn=limit)
        self.assertEqual((5, ""), (done.returncode, done.stdout))
        self.assertIn("cannot write: File too large; give another place with -o", done.stderr)
        self.assertEqual([], os.listdir(self.folder.path))


if __name__ == "__main__":
    unittest.main(verbosity=2)
