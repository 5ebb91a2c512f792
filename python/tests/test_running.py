"""Running the program from Python: with a stand-in for it, and with the program itself if it is installed."""

import inspect
import json
import os
import pickle
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import warnings
from pathlib import Path
from unittest import mock

import gprop
from gprop import _running

# A shell that starts the tests in the background has interrupts ignored, here and in the programs that are started.
signal.signal(signal.SIGINT, signal.default_int_handler)

FIXTURES = Path(__file__).resolve().parents[2] / "fixtures"

try:
    PROGRAM = _running._path()
except FileNotFoundError:
    PROGRAM = None


class StandIn(unittest.TestCase):
    """A script in the place of the program."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.program = self.folder / "gprop"
        patched = mock.patch.object(_running, "_path", lambda: str(self.program))
        patched.start()
        self.addCleanup(patched.stop)

    def write_program(self, script):
        self.program.write_text(f"#!/bin/sh\n{script}\n")
        self.program.chmod(0o755)

    def arguments_of(self, call):
        """The arguments that the program gets, one a line."""
        self.write_program(f'printf "%s\\n" "$@" > {self.folder}/arguments; echo \'{{"files": []}}\'')
        call()
        return (self.folder / "arguments").read_text().splitlines()

    def test_keyword_arguments_are_options(self):
        def export():
            switches = {"crop_to_foreground": False, "offline": True, "turntable": False}
            gprop.export(Path("-scene"), "out", format=["mjcf", "usda"], scale=0.5, render_views=None, **switches)

        found = self.arguments_of(export)
        flags = ["--format=mjcf", "--format=usda", "--scale=0.5", "--crop-to-foreground=false", "--offline"]
        self.assertEqual(found, ["--quiet", "export", "--json", "--out=out", *flags, "--", "-scene"])
        found = self.arguments_of(lambda: gprop.call("evaluate mass", "a", "b", from_="vote", progress=print))
        self.assertEqual(found, ["evaluate", "mass", "--json", "--from=vote", "--", "a", "b"])

    def test_unknown_options_are_refused_before_anything_runs(self):
        for call, words in (
            (lambda: gprop.run("scene", scael="metric"), r"run\(\) got an unexpected keyword argument 'scael'; did you mean 'scale'"),
            (lambda: gprop.materials(famly="wood"), "did you mean 'family'"),
            (lambda: gprop.export("scene", "out", dry_run=True), "'dry_run'"),
        ):
            with self.assertRaisesRegex(TypeError, words):
                call()
        with self.assertRaisesRegex(ValueError, "no result after the stage 'segment'"):
            gprop.run("scene", to="segment")

    def test_progress_warnings_and_results(self):
        self.write_program("echo 'stage 1 of 2' >&2; echo ' WARN the scale is unknown' >&2; echo 'stage 2 of 2' >&2; echo '{\"a\": 1}'")
        lines = []
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            self.assertEqual(gprop.call("inspect", "scene", progress=lines.append), {"a": 1})
        self.assertEqual(lines, ["stage 1 of 2", "stage 2 of 2"])
        self.assertEqual([(str(each.message), each.category, each.filename) for each in caught], [("the scale is unknown", gprop.SceneWarning, __file__)])

    def test_errors_are_of_the_kind_of_the_exit_code(self):
        kinds = [(2, gprop.UsageError), (3, gprop.SceneError), (4, gprop.ModelError), (5, gprop.AnswerError), (6, gprop.BatchError)]
        for code, kind in [*kinds, (70, gprop.BugError), (99, gprop.BugError)]:
            self.write_program(f"echo progress >&2; echo 'error: no splat in \"cup\"; put one there' >&2; echo '  list' >&2; exit {code}")
            with self.assertRaises(kind) as caught:
                gprop.call("run", "cup", progress=str)
            self.assertEqual(str(caught.exception), 'no splat in "cup"; put one there\n  list')
            again = pickle.loads(pickle.dumps(caught.exception))
            self.assertEqual((type(again), str(again), again.exit_code), (kind, str(caught.exception), code))
        self.write_program("kill -9 $$")
        with self.assertRaisesRegex(gprop.BugError, "SIGKILL ended gprop"):
            gprop.materials()
        self.write_program("true")
        with self.assertRaisesRegex(gprop.BugError, "exit code 0"):
            gprop.materials()

    def test_a_check_that_finds_something_has_its_result(self):
        self.write_program("echo '{\"files\": []}'; echo 'error: 3 problems' >&2; exit 1")
        self.assertEqual(gprop.audit("robot.urdf"), {"files": []})
        self.write_program("echo '{\"aligned\": false}'; echo 'error: not aligned' >&2; exit 3")
        with self.assertRaises(gprop.SceneError) as caught:
            gprop.call("inspect", "scene")
        self.assertEqual(caught.exception.result, {"aligned": False})

    def assert_ended(self, pids):
        for pid in pids:
            self.assertFalse(Path("/proc", pid).exists() and Path("/proc", pid, "stat").read_text().split()[2] != "Z", pid)

    def test_an_interrupt_ends_the_program_and_what_it_started(self):
        self.write_program("echo $$ >&2; sh -c 'echo $$ >&2; exec sleep 60'; exit 3")
        lines = []
        threading.Timer(0.5, os.kill, [os.getpid(), signal.SIGINT]).start()
        with self.assertRaises(KeyboardInterrupt):
            gprop.call("run", "scene", progress=lines.append)
        self.assert_ended(lines)

    def test_a_failing_callback_ends_the_program(self):
        self.write_program("echo $$ >&2; exec sleep 60")
        lines = []

        def fail(line):
            lines.append(line)
            raise RuntimeError("full")

        began = time.monotonic()
        with self.assertRaisesRegex(RuntimeError, "full"):
            gprop.call("run", "scene", progress=fail)
        self.assertLess(time.monotonic() - began, 5)
        self.assert_ended(lines)

    def test_the_program_can_tell_that_python_died(self):
        self.write_program(f"cat > /dev/null; touch {self.folder}/ended")
        script = f"import gprop; gprop._running._path = lambda: {str(self.program)!r}; gprop.materials()"
        child = subprocess.Popen([sys.executable, "-c", script], env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)})
        time.sleep(1)
        child.kill()
        child.wait()
        for _ in range(50):
            time.sleep(0.1)
            if (self.folder / "ended").exists():
                return
        self.fail("the program's stdin was not closed")

    def test_functions_show_their_options(self):
        for function, option, words in ((gprop.run, "scale", "metric"), (gprop.export, "format", "mjcf"), (gprop.audit, "fix", "inertia")):
            self.assertIn(option, inspect.signature(function).parameters)
            self.assertRegex(inspect.getdoc(function), f"(?s)\n{option}: .*{words}")
        self.assertNotIn("options", inspect.signature(gprop.run).parameters)


@unittest.skipUnless(PROGRAM or os.environ.get("GPROP_NO_SKIP"), "the program gprop is not installed")
class Program(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def test_the_library(self):
        woods = gprop.materials(family="wood")
        self.assertTrue(all(wood["family"] == "wood" for wood in woods) and len(woods) > 10)
        self.assertGreater(len(gprop.materials()), len(woods))
        self.assertEqual(gprop.call("materials show", "oak")["family"], "wood")

    def test_errors_say_what_to_do(self):
        with self.assertRaisesRegex(gprop.UsageError, "no family .*; the families are") as caught:
            gprop.materials(family="unobtainium")
        self.assertEqual(caught.exception.exit_code, 2)
        with self.assertRaises(gprop.SceneError):
            gprop.run(self.folder)
        with self.assertRaisesRegex(gprop.UsageError, "--frames") as caught:
            gprop.run(self.folder, frames="many")
        self.assertNotIn("Usage:", str(caught.exception))

    def test_an_audit(self):
        link = '<link name="a"><inertial><mass value="1"/><inertia ixx="9" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        (self.folder / "arm.urdf").write_text(f'<robot name="arm">{link}</robot>')
        (file,) = gprop.audit(self.folder)["files"]
        self.assertEqual(file["links"][0]["name"], "a")
        self.assertIn("inertia", json.dumps(file["links"][0]["problems"]))

    def test_an_interrupted_run_goes_on_later(self):
        scene = shutil.copytree(FIXTURES / "hammer", self.folder / "hammer")
        for path in [scene, *scene.rglob("*")]:
            path.chmod(path.stat().st_mode | stat.S_IWUSR)

        def interrupt(line):
            raise KeyboardInterrupt

        with self.assertRaises(KeyboardInterrupt):
            gprop.run(scene, answers="replay", progress=interrupt)
        stages = gprop.call("run", scene, answers="replay", dry_run=True)["stages"]
        self.assertEqual([stage["name"] for stage in stages if stage["reusable"]], ["scene"])


if __name__ == "__main__":
    unittest.main()
