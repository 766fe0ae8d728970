"""Do the manual page and the completions that the build makes hold every verb and option, and do shells take them?

manual_test.py IDENTIKAL"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

IDENTIKAL = sys.argv.pop(1)


def run(*command):
    return subprocess.run([str(c) for c in command], capture_output=True, text=True)


def help_of(*verb):
    return run(IDENTIKAL, *verb, "--help").stdout


def verbs():
    return re.findall(r"^  ([a-z]+)  ", help_of().split("Subcommands:")[1], re.M)


def second_words(verb):
    """What may follow on "fleet"; nothing of most verbs."""
    below = help_of(verb).split("Subcommands:")
    return re.findall(r"^  ([a-z]+)  ", below[1], re.M) if len(below) > 1 else []


def options(*verb):
    return set(re.findall(r"^ +(?:-\w,)?(--[a-z-]+)", help_of(*verb), re.M))


class Reference(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.text, cls.file = {}, {}
        for kind in ("man", "bash", "zsh", "fish"):
            done = run(IDENTIKAL, "--generate", kind)
            assert done.returncode == 0, done.stderr
            cls.text[kind] = done.stdout
            cls.file[kind] = pathlib.Path(folder.name) / kind
            cls.file[kind].write_text(done.stdout)

    def complete(self, line):
        """What bash offers at the end of the line."""
        words = line.split(" ")
        script = (f'source "{self.file["bash"]}"; cd "{pathlib.Path(__file__).parents[1]}"; COMP_WORDS=("$@"); '
                  'COMP_CWORD=$(($# - 1)); _identikal; printf "%s\\n" "${COMPREPLY[@]}"')
        done = run("bash", "-u", "-c", script, "bash", *words)
        self.assertEqual((done.returncode, done.stderr), (0, ""), line)
        return done.stdout.split()

    def test_everything_of_the_help_is_there(self):
        self.assertGreaterEqual(len(verbs()), 10)
        page = self.text["man"].replace("\\-", "-")
        for verb in verbs():
            if second_words(verb):
                continue
            self.assertGreaterEqual(len(options(verb)), 1, verb)  # --help
            section = page.split(f".SS {verb}\n")[1].split(".SS")[0]
            zsh = self.text["zsh"].split(f"        {verb})")[1].split(";;")[0]
            fish = [line for line in self.text["fish"].splitlines() if f"from {verb}'" in line]
            for option in options(verb):
                self.assertIn(f"\\fB{option}\\fR", section)
                self.assertIn(f"{option}[", zsh)
                self.assertTrue(any(f" -l {option[2:]} " in line for line in fish), option)
            self.assertEqual(set(self.complete(f"identikal {verb} --")), options(verb))

    def test_verbs_of_two_words_are_there_too(self):
        page = self.text["man"].replace("\\-", "-")
        self.assertIn("tune", second_words("fleet"))
        self.assertEqual(set(self.complete("identikal fleet ")), set(second_words("fleet")))
        offered = set(self.complete("identikal fleet tune --"))
        for second in second_words("fleet"):
            section = page.split(f".SS fleet {second}\n")[1].split(".SS")[0]
            for option in options("fleet", second):
                self.assertIn(f"\\fB{option}\\fR", section)
                self.assertIn(option, offered)

    def test_bash_completes_verbs_options_and_values(self):
        self.assertEqual(self.complete("identikal tu"), ["tune"])
        self.assertEqual(set(self.complete("identikal ")) & set(verbs()), set(verbs()))
        self.assertEqual(self.complete("identikal tune --met"), ["--method"])
        methods = ["ml", "als", "als-weighted", "auto", "bayes"]
        self.assertEqual(sorted(self.complete("identikal tune --method ")), sorted(methods))
        self.assertEqual(self.complete("identikal tune --method b"), ["bayes"])
        # bash cuts "--method=b" at the sign.
        self.assertEqual(self.complete("identikal tune --method = b"), ["bayes"])
        self.assertEqual(sorted(self.complete("identikal tune --method =")), sorted(methods))
        self.assertIn("trajectory", self.complete("identikal fit a.yaml --method "))
        self.assertEqual(self.complete("identikal tune --starts "), [])
        self.assertEqual(self.complete("identikal study matisko-table-1")[0], "matisko-table-1")
        self.assertIn("obstacle-avoidance", self.complete("identikal simulate --manoeuvre "))
        self.assertEqual(self.complete("identikal init pend"), ["pendulum"])

    def test_bash_completes_files(self):
        self.assertIn("layers.py", self.complete("identikal tune lay"))
        self.assertIn("command", self.complete("identikal tune -o com"))

    def test_shells_and_groff_take_them(self):
        checks = {"man": ["groff", "-man", "-ww", "-z", "-Tutf8"], "bash": ["bash", "-n"], "zsh": ["zsh", "-n"], "fish": ["fish", "-n"]}
        for kind, command in checks.items():
            if not shutil.which(command[0]):
                continue
            done = run(*command, self.file[kind])
            self.assertEqual((done.returncode, done.stdout + done.stderr), (0, ""), kind)

    def test_manual_page_reads(self):
        if not shutil.which("groff"):
            self.skipTest("no groff")
        page = run("groff", "-man", "-Tascii", "-P-cbou", self.file["man"]).stdout
        for words in ("identikal - system identification", "identikal tune [options] MODEL DATA...", "EXIT STATUS",
                      "--method TEXT", "One of: ml, als", "Default: ml"):
            self.assertIn(words, re.sub(r"\s+", " ", page))

    def test_another_kind_is_refused(self):
        done = run(IDENTIKAL, "--generate", "csh")
        self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (2, "", 1))
        self.assertIn("man, bash, zsh or fish", done.stderr)


if __name__ == "__main__":
    unittest.main()
