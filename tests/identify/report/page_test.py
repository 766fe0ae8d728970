"""The report page in a browser: everything drawn, nothing asked of the network, no complaint, readable on a telephone.

Drives headless Chromium through chromedriver (Debian: chromium, chromium-driver). With --screenshots FOLDER it also
writes pictures of the pages, light and dark, wide and narrow, for a person to look at; with --pictures docs/pictures
it tests nothing and writes the pictures of README and docs."""
import base64
import json
import os
import pathlib
import random
import re
import resource
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.request

PROGRAM = pathlib.Path(sys.argv.pop(1)).resolve()


def folder_after(option):
    """The folder that an option names, made if need be; None without the option."""
    if option not in sys.argv:
        return None
    at = sys.argv.index(option)
    folder = pathlib.Path(sys.argv[at + 1])
    folder.mkdir(parents=True, exist_ok=True)
    del sys.argv[at:at + 2]
    return folder


SCREENSHOTS, PICTURES = folder_after("--screenshots"), folder_after("--pictures")
ROOT = pathlib.Path(__file__).resolve().parents[3]
MEGABYTE = 1_000_000


class Browser:
    """Just enough of the WebDriver protocol."""

    def __init__(self):
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.base = f"http://127.0.0.1:{port}"
        self.driver = subprocess.Popen(["chromedriver", f"--port={port}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for _ in range(100):
            try:
                if self.call("GET", "/status")["ready"]:
                    break
            except OSError:
                time.sleep(0.1)
        flags = ["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars", "--window-size=1200,900"]
        self.session = "/session/" + self.call("POST", "/session", {"capabilities": {"alwaysMatch": {
            "browserName": "chrome", "goog:chromeOptions": {"args": flags, "binary": shutil.which("chromium")},
            "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"}}}})["sessionId"]

    def call(self, method, path, body=None):
        request = urllib.request.Request(self.base + path, method=method, headers={"Content-Type": "application/json"},
                                         data=None if body is None else json.dumps(body).encode())
        with urllib.request.urlopen(request, timeout=120) as answer:
            return json.load(answer)["value"]

    def post(self, path, **body):
        return self.call("POST", self.session + path, body)

    def run(self, script, *arguments):
        return self.post("/execute/sync", script=script, args=list(arguments))

    def devtools(self, command, **parameters):
        return self.post("/goog/cdp/execute", cmd=command, params=parameters)

    def log(self, kind):
        return self.post("/se/log", type=kind)

    def open(self, path):
        self.log("browser"), self.log("performance")
        self.post("/url", url=path.as_uri())

    def screen(self, width, height, scheme="light"):
        self.devtools("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self.devtools("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])

    def picture(self, clip=None):
        """PNG of the window, or of {x, y, width, height} of the page."""
        if clip is None:
            return base64.b64decode(self.call("GET", self.session + "/screenshot"))
        return base64.b64decode(self.devtools("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip={**clip, "scale": 1})["data"])

    def close(self):
        try:
            self.call("DELETE", self.session)
        finally:
            self.driver.terminate()
            self.driver.wait()


# A drawing counts when something other than its axes is on it and nothing was computed from nothing.
DRAWN = """
return [...document.querySelectorAll(".plot")].map((plot) => {
  const marks = [...plot.querySelectorAll("svg path[d], svg circle, svg rect:not(.frame), svg line.accent")].filter((mark) => !mark.closest("clipPath"));
  const spoilt = marks.some((mark) => /NaN|Infinity|undefined|null/.test(mark.outerHTML));
  return [plot.textContent.slice(0, 40), spoilt ? 0 : marks.length];
});
"""
# What all plots over time draw of their signals; what their legends say.
LINES = "return [...document.querySelectorAll('.time-plot')].map((p) => [...p.querySelectorAll('path')].map((e) => e.getAttribute('d')).join())"
LEGENDS = "return [...document.querySelectorAll('.time-plot + .key')].map((k) => [...k.querySelectorAll('b')].map((b) => b.textContent))"


class Page(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        if not shutil.which("chromedriver") or not shutil.which("chromium"):
            if os.environ.get("CI") == "true":
                raise AssertionError("chromium or chromium-driver is missing, and CI=true")
            raise unittest.SkipTest("no chromium and chromium-driver here")
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        cls.browser = Browser()

    @classmethod
    def tearDownClass(cls):
        cls.browser.close()
        cls.folder.cleanup()

    def made(self, name, *arguments, code=0):
        page = self.path / f"{name}.html"
        done = subprocess.run([PROGRAM, *arguments, "--report", page], cwd=ROOT, capture_output=True, text=True, timeout=300)
        self.assertEqual(code, done.returncode, done.stdout + done.stderr)
        self.assertLess(page.stat().st_size, MEGABYTE)
        # Only links that a person would have to follow, as text, and the namespace of SVG.
        links = set(re.findall(r"(?:src|href)\s*=\s*[\"'](?!#|data:)[^\"']*", page.read_text()))
        self.assertEqual(set(), links)
        return page

    def looked_at(self, name, page, least):
        browser = self.browser
        browser.screen(1200, 900)
        browser.open(page)
        self.assertTrue(browser.run("return 'ready' in document.documentElement.dataset"), browser.log("browser"))
        drawn = browser.run(DRAWN)
        self.assertGreaterEqual(len(drawn), least)
        self.assertEqual([], [title for title, marks in drawn if marks < 1])
        for scheme in ("light", "dark"):
            for width in (360, 1200):
                browser.screen(width, 900, scheme)
                time.sleep(0.3)
                overflow = browser.run("return document.documentElement.scrollWidth - innerWidth")
                self.assertLessEqual(overflow, 0, f"{name} at {width} px")
                if SCREENSHOTS:
                    height = browser.run("return Math.ceil(document.documentElement.scrollHeight)")
                    browser.screen(width, min(height, 9000), scheme)
                    time.sleep(0.5)
                    (SCREENSHOTS / f"{name}-{scheme}-{width}.png").write_bytes(browser.picture())
        if SCREENSHOTS:
            pdf = browser.call("POST", browser.session + "/print", {"background": True})
            (SCREENSHOTS / f"{name}.pdf").write_bytes(base64.b64decode(pdf))
        self.assertEqual([], [entry["message"] for entry in browser.log("browser")])
        events = [json.loads(entry["message"])["message"] for entry in browser.log("performance")]
        asked = [event["params"]["request"]["url"] for event in events if event["method"] == "Network.requestWillBeSent"]
        self.assertEqual([], [url for url in asked if url != page.as_uri() and not url.startswith("data:")])
        print(f"{name}: {len(drawn)} plots, {page.stat().st_size / 1000:.0f} kB")

    def test_nile(self):
        self.looked_at("nile", self.made("nile", "tune", "examples/nile.yaml", "data/nile.csv"), 12)

    def test_lane_change(self):
        self.looked_at("lane_change", self.made("lane_change", "fit", "examples/severe_lane_change.yaml", "data/severe_lane_change.csv"), 12)

    def test_handling(self):
        """The sheet of a model and a log: a response of three outputs, gain and phase."""
        log = self.path / "sweep"
        subprocess.run([PROGRAM, "simulate", "examples/severe_lane_change.yaml", "--manoeuvre", "sweep", "-o", log], cwd=ROOT, check=True, capture_output=True)
        page = self.made("handling", "handling", "examples/severe_lane_change.yaml", log / "simulated.csv")
        self.looked_at("handling", page, 6)

    def test_held_out(self):
        data = self.path / ("a_long_name_" * 8) / "recording.csv"
        data.parent.mkdir()
        shutil.copy(ROOT / "data/severe_lane_change.csv", data)
        page = self.made("held_out", "fit", "examples/severe_lane_change.yaml", data, "--hold-out", "30%")
        self.looked_at("held_out", page, 12)

    def drawn_by(self, page):
        return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page.read_text(), re.S)[1])

    def laid_end_to_end(self, data, recordings):
        self.assertTrue(all(a < b for a, b in zip(data["time"], data["time"][1:])), "time goes back")
        self.assertEqual(2 * recordings - 1, len(data["joints"]))
        self.assertEqual(data["held_from"], data["joints"][recordings - 1])

    def test_held_out_rows_have_all_that_the_others_have(self):
        page = self.made("driven", "fit", "examples/severe_lane_change.yaml", "data/severe_lane_change.csv", "--hold-out", "30%")
        data = self.drawn_by(page)
        lines = [u["line"] for u in data["inputs"]] + [c["after"] for c in data["channels"]]
        self.assertEqual(4, len(lines))
        for line in lines:
            self.assertNotIn(None, line["y"])
        recording = [line.split(",") for line in (ROOT / "data/severe_lane_change.csv").read_text().splitlines() if line[0].isdigit()]
        for row, angle in zip(recording, lines[0]["y"]):
            self.assertAlmostEqual(float(row[1]), angle, delta=0.02)
        self.assertEqual([(49, False), (21, True)], [(r["rows"], r["held"]) for r in data["recordings"]])
        for c in data["channels"]:  # the scale of the fitted rows: the noise is the same
            squares = [e * e for e in c["after"]["y"][49:]]
            self.assertTrue(0.5 < (sum(squares) / len(squares)) ** 0.5 < 2.0)
        self.browser.open(page)
        self.assertEqual([["fitted", "49"], ["held out", "21"]], self.browser.run(
            "return [...document.querySelectorAll('#data table')[0].querySelectorAll('tbody tr')].map((r) => [r.cells[1].textContent, r.cells[2].textContent])"))
        page = self.made("niles_end", "tune", "examples/nile.yaml", "data/nile.csv", "--hold-out", "30%")
        self.assertTrue(all(e is not None for e in self.drawn_by(page)["channels"][0]["after"]["y"][70:]))

    def test_several_recordings_are_held_out(self):
        severe = (ROOT / "data/severe_lane_change.csv").read_text()
        model = (ROOT / "examples/severe_lane_change.yaml").read_text()
        files = [self.path / f"drive{i}.csv" for i in (1, 2)]
        for file in files:
            file.write_text(severe)
        page = self.made("two", "fit", "examples/severe_lane_change.yaml", *files, "--hold-out", "30%")
        self.laid_end_to_end(self.drawn_by(page), 2)
        one_file, restarting = self.path / "runs.csv", self.path / "runs.yaml"
        one_file.write_text(severe + "".join(row for row in severe.splitlines(True) if row[0].isdigit()))
        restarting.write_text(model.replace("unit: s}", "unit: s, runs: restart}"))
        page = self.made("two_runs", "fit", restarting, one_file, "--hold-out", "30%")
        self.laid_end_to_end(self.drawn_by(page), 2)
        years = ROOT / "data/nile.csv"
        page = self.made("two_niles", "tune", "examples/nile.yaml", years, years, "--hold-out", "30%", code=1)
        self.laid_end_to_end(self.drawn_by(page), 2)

    def test_searches_are_shown_from_their_starts(self):
        page = self.made("searches", "fit", "examples/severe_lane_change.yaml", "data/severe_lane_change.csv")
        searches = self.drawn_by(page)["searches"]
        result = json.loads(re.search(r'<script type="application/json" id="result">(.*?)</script>', page.read_text(), re.S)[1])
        self.assertEqual(result["objective"]["iterations"], sum(len(path) - 1 for path in searches))
        # The file's own values are among the starts here.
        self.assertTrue(any(abs(path[0] - result["objective"]["log_likelihood_start"]) < 1e-6 for path in searches))
        for path in searches:
            self.assertTrue(all(a <= b for a, b in zip(path, path[1:])))
        self.browser.open(page)
        self.assertIn(f"{len(searches)} local searches", self.browser.run("return document.querySelector('#likelihood').textContent"))

    def test_spectra_keep_what_is_small(self):
        model, noise = self.path / "off.yaml", ("--set", "r=0.1")
        model.write_text((ROOT / "examples/nile.yaml").read_text().replace("column: volume", "column: level"))
        subprocess.run([PROGRAM, "simulate", model, "-n", "3000", "-o", self.path / "off", "--seed", "3", *noise], check=True, capture_output=True)
        # A filter that holds the level for constant: what it leaves wanders as the level does.
        page = self.made("spectrum", "tune", model, self.path / "off/simulated.csv", *noise, "--set", "q=1e-6", "--starts", "1")
        level = self.drawn_by(page)["channels"][0]["innovations_before"]["level"]
        self.assertGreater(max(level), 1e4 * min(level))
        self.assertGreater(len(set(level)), 400)  # of 511

    def test_nothing_is_cut_on_paper(self):
        page = self.made("paper", "fit", "examples/severe_lane_change.yaml", "data/severe_lane_change.csv")
        browser = self.browser
        browser.screen(700, 900)
        browser.open(page)
        browser.run("for (const d of document.querySelectorAll('details')) d.open = true")
        browser.devtools("Emulation.setEmulatedMedia", media="print")
        try:
            self.assertEqual([], browser.run("""return [...document.querySelectorAll(".code pre, .code, .scroll, code")]
                .filter((e) => e.clientWidth > 0 && e.scrollWidth > e.clientWidth).map((e) => e.textContent.slice(0, 60))"""))
            self.assertEqual(["11px"], browser.run("""const sizes = ["p.note", "table td", ".code pre", "footer", "body"].map((s) =>
                getComputedStyle(document.querySelector(s)).fontSize); return [...new Set(sizes)]"""))
        finally:
            browser.devtools("Emulation.setEmulatedMedia", media="")

    def test_check(self):
        page = self.made("check", "check", "examples/nile.yaml", "data/nile.csv", "--set", "r=1000", code=1)
        self.looked_at("check", page, 6)
        self.assertTrue(self.drawn_by(page)["forecasts"])
        self.assertIn("Shaded: simulation", self.browser.run("return document.querySelector('main').textContent"))
        self.assertNotIn("the fit did see", self.browser.run("return document.querySelector('main').textContent"))

    def test_estimates_over_time(self):
        page = self.made("track", "track", "examples/nile.yaml", "data/nile.csv")
        history = self.drawn_by(page)["time_history"]
        self.assertGreater(len(history), 0)
        self.looked_at("track", page, len(history))
        titles = self.browser.run("return [...document.querySelectorAll('#course .title')].map((t) => t.firstChild.textContent)")
        self.assertEqual([h["name"] for h in history], titles[:len(history)])
        bands = self.browser.run("return [...document.querySelectorAll('#course .time-plot')].map((p) => p.querySelectorAll('path.fill-band').length)")
        self.assertEqual([1] * len(history), bands[:len(history)])

    def test_shaping_filters(self):
        page = self.made("shape", "shape", "examples/nile.yaml", "data/nile.csv", code=1)
        self.looked_at("shape", page, 4)

    def test_a_model_from_data(self):
        """Order, poles, steps and frequency responses of states, and of polynomials with their table."""
        draw, x, rows = random.Random(11), [0.0, 0.0], []
        for t in range(600):
            u = draw.gauss(0, 1)
            rows.append(f"{0.1 * t:g},{u:.6f},{x[0] + 0.3 * draw.gauss(0, 1):.6f}")
            x = [0.8 * x[0] + 0.3 * x[1] + 0.2 * u, -0.3 * x[0] + 0.8 * x[1] + u]
        log = self.path / "driven.csv"
        log.write_text("t [s],force,position\n" + "\n".join(rows) + "\n")
        common = "model", log, "--input", "force", "--output", "position"
        self.looked_at("model", self.made("model", *common), 16)
        page = self.made("output_error", *common, "--as", "oe", "--order", "1:4")
        self.looked_at("output_error", page, 16)
        self.assertIn("F of force", self.browser.run("return document.querySelector('#poles').textContent"))

    def test_a_verdict_does_not_hide_failing_tests(self):
        model = self.path / "off.yaml"
        model.write_text((ROOT / "examples/nile.yaml").read_text().replace("column: volume", "column: level"))
        # Of 400 such recordings eleven fail the test, three of them with innovations whose past matters.
        draw, level, rows = random.Random(156), 1000.0, ["t,level"]
        for t in range(1000):
            level += draw.gauss(0, 20)
            rows.append(f"{t},{level + draw.gauss(0, 60):.6f}")
        recording = self.path / "swinging.csv"
        recording.write_text("\n".join(rows) + "\n")
        page = self.made("swinging", "tune", model, recording)
        result = json.loads(re.search(r'<script type="application/json" id="result">(.*?)</script>', page.read_text(), re.S)[1])
        failed = sum(not t["pass"] for t in result["tests"])
        self.assertEqual("ok", result["status"]["code"])
        self.assertGreater(failed, 0)
        self.browser.open(page)
        self.assertEqual(f"! Usable, but {failed} of {len(result['tests'])} tests fail", self.browser.run("return document.querySelector('#verdict strong').textContent"))

    def pointer(self, box, *steps):
        """Moves over a box [left, top, width, height]: (kind, share of its width, buttons) each."""
        for kind, share, buttons in steps:
            self.browser.devtools("Input.dispatchMouseEvent", type=kind, x=box[0] + share * box[2], y=box[1] + 0.5 * box[3],
                                  button="left" if kind != "mouseMoved" else "none", buttons=buttons, clickCount=1)
        time.sleep(0.2)

    def frame(self, number):
        """Where the axes of a plot over time are, after scrolling to it."""
        return self.browser.run("""const frame = document.querySelectorAll('.time-plot')[arguments[0]].querySelector('.frame');
            frame.scrollIntoView({block: 'center'}); const b = frame.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]""", number)

    def test_zoom_is_shared(self):
        page = self.made("nile", "tune", "examples/nile.yaml", "data/nile.csv")
        self.browser.screen(1200, 900)
        self.browser.open(page)
        before = self.browser.run(LINES)
        self.assertGreaterEqual(len(before), 4)
        zoomed = lambda: self.browser.run("return document.documentElement.classList.contains('zoomed')")
        drag = lambda: self.pointer(self.frame(0), ("mousePressed", 0.3, 1), ("mouseMoved", 0.45, 1), ("mouseMoved", 0.6, 1), ("mouseReleased", 0.6, 0))
        drag()
        self.assertTrue(all(a != b for a, b in zip(before, self.browser.run(LINES))))
        self.assertTrue(zoomed())
        # The years 29.7 to 59.4 of 99 remain.
        axis = self.browser.run("return [...document.querySelector('.time-plot').querySelectorAll('text[text-anchor=middle]')].map((t) => t.textContent)")
        self.assertEqual([str(t) for t in range(30, 60, 2)], axis)
        self.browser.run("document.querySelector('.reset').click()")
        self.assertEqual(before, self.browser.run(LINES))
        self.assertFalse(zoomed())
        drag()
        self.assertTrue(zoomed())
        box = self.frame(1)
        for clicks in (1, 2):
            for kind in ("mousePressed", "mouseReleased"):
                self.browser.devtools("Input.dispatchMouseEvent", type=kind, x=box[0] + 0.5 * box[2], y=box[1] + 0.5 * box[3], button="left", clickCount=clicks)
        self.assertEqual(before, self.browser.run(LINES))
        self.assertEqual([], self.browser.log("browser"))

    def test_the_cursor_is_read_off_everywhere(self):
        page = self.made("nile", "tune", "examples/nile.yaml", "data/nile.csv")
        data = self.drawn_by(page)
        self.browser.screen(1200, 900)
        self.browser.open(page)
        self.pointer(self.frame(0), ("mouseMoved", 81.8 / 99, 0))
        legends = self.browser.run(LEGENDS)
        channel = data["channels"][0]
        measured, one_step, simulation, band, instant = legends[0]
        self.assertEqual(("838", "at 82 s"), (measured, instant))
        self.assertAlmostEqual(channel["one_step"]["y"][82], float(one_step), delta=0.01)
        self.assertAlmostEqual(channel["simulation"]["y"][82], float(simulation), delta=0.01)
        for said, limit in zip(band.split(" … "), (channel["forecast_low"], channel["forecast_high"])):
            self.assertAlmostEqual(limit["y"][82], float(said), delta=0.5)
        self.assertAlmostEqual(channel["after"]["y"][82], float(legends[1][0]), delta=1e-3)
        self.assertEqual(["at 82 s"] * 2, [legend[-1] for legend in legends[1:3]])
        nis = min(data["nis"]["time"], key=lambda t: abs(t - 81.8))
        self.assertEqual(f"at {nis:g} s", legends[3][-1])
        self.pointer([0, 0, 10, 10], ("mouseMoved", 0.5, 0))
        self.assertEqual({""}, {text for legend in self.browser.run(LEGENDS) for text in legend})

    def test_a_finger_reads_and_zooms(self):
        page = self.made("nile", "tune", "examples/nile.yaml", "data/nile.csv")
        browser = self.browser
        browser.screen(360, 800)
        browser.devtools("Emulation.setTouchEmulationEnabled", enabled=True)
        try:
            browser.open(page)
            x, y, width, height = self.frame(0)
            touch = lambda kind, *shares: browser.devtools("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x + share * width, "y": y + 0.5 * height} for share in shares])
            touch("touchStart", 0.4), touch("touchEnd")
            time.sleep(0.2)
            self.assertEqual(["at 40 s"], list({legend[-1] for legend in browser.run(LEGENDS)[:3]}))
            touch("touchStart", 0.2)
            for share in (0.25, 0.35, 0.5, 0.6):
                touch("touchMove", share)
            touch("touchEnd")
            time.sleep(0.2)
            self.assertTrue(browser.run("return document.documentElement.classList.contains('zoomed')"))
        finally:
            browser.devtools("Emulation.setTouchEmulationEnabled", enabled=False)

    def test_missing_samples_break_a_line(self):
        rows = (ROOT / "data/nile.csv").read_text().splitlines(True)
        header = next(i for i, row in enumerate(rows) if row[0].isalpha())
        gap = self.path / "gap.csv"
        gap.write_text("".join(re.sub(r",[^,\n]*", ",", row) if i - header in range(41, 51) else row for i, row in enumerate(rows)))
        page = self.made("gap", "tune", "examples/nile.yaml", gap)
        after = self.drawn_by(page)["channels"][0]["after"]["y"]
        self.assertEqual(list(range(40, 50)), [i for i, e in enumerate(after) if e is None and i > 1])
        self.browser.open(page)
        line = self.browser.run(LINES)[1]
        self.assertEqual(2, line.count("M"))
        self.assertEqual(sum(e is not None for e in after), line.count("M") + line.count("L"))
        self.assertEqual(90, self.browser.run("return document.querySelector('.time-plot').querySelectorAll('circle').length"))

    def test_paper_is_white_and_as_wide_as_it_is(self):
        page = self.made("nile", "tune", "examples/nile.yaml", "data/nile.csv")
        self.browser.screen(1200, 900, "dark")
        self.browser.open(page)
        width = "return document.querySelector('.time-plot svg').viewBox.baseVal.width"
        self.assertGreater(self.browser.run(width), 1000)
        self.browser.run("dispatchEvent(new Event('beforeprint'))")
        self.browser.devtools("Emulation.setEmulatedMedia", media="print", features=[{"name": "prefers-color-scheme", "value": "dark"}])
        try:
            self.assertEqual(700, self.browser.run(width))
            self.assertEqual("rgb(255, 255, 255)", self.browser.run("return getComputedStyle(document.body).backgroundColor"))
            self.assertEqual("rgb(11, 100, 173)", self.browser.run("return getComputedStyle(document.querySelector('.time-plot path.accent')).stroke"))
        finally:
            self.browser.devtools("Emulation.setEmulatedMedia", media="")
        self.browser.run("dispatchEvent(new Event('afterprint'))")
        self.assertGreater(self.browser.run(width), 1000)

    def test_names_cannot_break_out(self):
        model = self.path / "spiteful.yaml"
        text = (ROOT / "examples/nile.yaml").read_text()
        spite = "</script><img src=x onerror=document.title='broken'>"
        model.write_text(text.replace("name: Nile", f'name: "{spite}"').replace("name: level", f'name: "{spite}"'))
        page = self.path / "spiteful.html"
        subprocess.run([PROGRAM, "tune", model, ROOT / "data/nile.csv", "--report", page], check=True, capture_output=True)
        self.browser.open(page)
        self.assertEqual(spite, self.browser.run("return document.querySelector('h1').textContent"))
        self.assertEqual(0, self.browser.run("return document.querySelectorAll('img').length"))
        self.assertEqual([], self.browser.log("browser"))

    def test_a_long_recording(self):
        data = self.path / "long.csv"
        model = self.path / "long.yaml"
        model.write_text((ROOT / "examples/nile.yaml").read_text().replace("column: volume", "column: level"))
        subprocess.run([PROGRAM, "simulate", model, "-n", "1000000", "-o", self.path / "long", "--seed", "3"], check=True, capture_output=True)
        data = self.path / "long" / "simulated.csv"
        used = lambda: sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])
        begin, before = time.monotonic(), used()
        page = self.made("long", "tune", str(model), str(data), "--starts", "1")
        wall, spent = time.monotonic() - begin, used() - before
        self.looked_at("long", page, 12)
        # Thinned signals are areas from the least to the largest of every column.
        areas = self.browser.run("return [...document.querySelectorAll('.time-plot')].map((p) => p.querySelectorAll('path.hair').length)")
        self.assertTrue(all(n >= 1 for n in areas[:-1]), areas)
        print(f"1e6 samples read, tuned and reported: {page.stat().st_size / 1000:.0f} kB, {spent:.2f} s of one core, {wall:.2f} s in all")
        self.assertLess(spent, 5.0)  # the processor's time: other tests run beside this one


TUNE = ["tune", "examples/nile.yaml", "data/nile.csv"]
FIT = ["fit", "examples/severe_lane_change.yaml", "data/severe_lane_change.csv", "--hold-out", "30%"]
# Of README and docs: the job, the width, and from which part of its page to which.
PICTURED = {
    "tune": (TUNE, 1020, "header", "#predictions"),
    "whiteness": (TUNE, 960, "#whiteness", "#whiteness .grid"),
    "vehicle": (FIT, 960, "#predictions", "#predictions figure:nth-of-type(2)"),
    "axles": (FIT, 960, "#car", "#car .grid"),
}


def write_pictures():
    browser = Browser()
    try:
        with tempfile.TemporaryDirectory() as folder:
            for name, (job, width, first, last) in PICTURED.items():
                page = pathlib.Path(folder) / f"{name}.html"
                subprocess.run([PROGRAM, *job, "--report", page], cwd=ROOT, check=True, capture_output=True)
                browser.screen(width, 900)
                browser.open(page)
                top, bottom = browser.run("""return [document.querySelector(arguments[0]).getBoundingClientRect().top,
                    document.querySelector(arguments[1]).getBoundingClientRect().bottom]""", first, last)
                picture = browser.picture({"x": 0, "y": top, "width": width, "height": bottom - top + 12})
                (PICTURES / f"{name}.png").write_bytes(picture)
                print(f"{PICTURES / name}.png: {len(picture) / 1000:.0f} kB")
    finally:
        browser.close()


if __name__ == "__main__":
    write_pictures() if PICTURES else unittest.main()
