"""`ballast spy` as people start it, in a real X display, during a real run; and what it says when it cannot start."""

import os
import re
import socket
import struct
import subprocess
import tempfile
import threading
import unittest
import zipfile
from pathlib import Path

import ballast

BALLAST = os.environ["BALLAST"]
PROBE = os.environ["BALLAST_SPY_PROBE"]
URL = f"udpm://239.255.76.67:{12000 + os.getpid() % 8000}?ttl=0"
PER_TICK = {"CONTACT": "contact_t", "PLANT_STATE": "plant_state_t", "SENSORS": "sensors_t", "TRIP": "trip_t",
            "STEP_COMMAND": "step_command_t", "CONTROLLER_STATUS": "controller_status_t"}
MESSAGES = 2000  # per channel before and after the windows are opened


class Display:
    """An X server of the test's own, on a number it finds free itself."""

    def __enter__(self):
        read, write = os.pipe()
        self._server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x800x24"],
                                        pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        with os.fdopen(read) as number:
            return ":" + number.readline().strip()

    def __exit__(self, *_):
        self._server.terminate()
        self._server.wait()


def spy(*options, display=None, **environment):
    variables = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    variables.update(environment)
    if display is not None:
        variables["DISPLAY"] = display
    return subprocess.run([BALLAST, "spy", "--lcm", URL, *options], env=variables, capture_output=True, text=True,
                          timeout=120)


def send_self_tests(done):
    """Publishes LCM's self-test every millisecond: every program that connects does, one also while lcm-spy starts."""
    group, port = re.fullmatch(r"udpm://(.+):(\d+)\?ttl=0", URL).groups()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        while not done.wait(0.001):
            message = struct.pack(">4sI", b"LC02", 0) + b"LCM_SELF_TEST\0lcm self test\0"
            sender.sendto(message, (group, int(port)))


class SpyWindowTest(unittest.TestCase):
    def test_shows_every_channel_decoded_at_its_rate(self):
        with Display() as display, tempfile.TemporaryDirectory() as folder:
            run = subprocess.Popen([BALLAST, "run", "paper_ball", "--speed", "1", "--lcm", URL, "--quiet", "--out",
                                    folder, "--set", "duration=60"])
            done = threading.Event()
            comers = threading.Thread(target=send_self_tests, args=[done])
            comers.start()
            try:
                seen = spy(display=display, JAVA_TOOL_OPTIONS=f"-javaagent:{PROBE}={MESSAGES}")
            finally:
                done.set()
                comers.join()
                run.terminate()
                run.wait()
        rows = [line.split("|")[1:] for line in seen.stdout.splitlines() if line.startswith("ROW|")]
        windows = dict(line.split("|")[1:] for line in seen.stdout.splitlines() if line.startswith("WINDOW|"))
        types = {row[0].removeprefix("BALLAST_"): row[1] for row in rows}
        self.assertEqual(types.pop("SCENARIO", "scenario_piece_t"), "scenario_piece_t")  # once a second
        types.pop("OPERATOR", None)  # says arm and start, perhaps before spy listens
        self.assertEqual(types, PER_TICK, seen.stdout + seen.stderr)
        waited_for = next(int(row[2]) for row in rows if row[0] == "BALLAST_TRIP")
        self.assertGreaterEqual(waited_for, 2 * MESSAGES)
        for channel, _, count, rate, *_, undecodable in rows:
            self.assertEqual(undecodable, "0", channel)
            if channel in ("BALLAST_OPERATOR", "BALLAST_SCENARIO"):  # not once per tick
                continue
            self.assertIn(channel, windows)
            # From there on lcm-spy's columns are 200 pixels wide, which our longest names need.
            self.assertGreaterEqual(int(windows[channel]), 800)
            # All have come once per tick, up to those on their way and what a loaded machine may lose. On one the probe
            # looks late: so many as of the channel that it waits for.
            self.assertAlmostEqual(int(count), waited_for, delta=0.1 * waited_for, msg=channel)
            self.assertGreater(float(rate), 0, channel)

    def test_everything_is_compiled_for_java_8(self):
        # Class files begin with 0xCAFEBABE, minor and major version; 52 is Java 8's, and newer Javas run it.
        types = Path(os.environ["BALLAST_TYPES_JAR"])
        for jar in (types, types.with_name("ballast-spy.jar")):
            with zipfile.ZipFile(jar) as file:
                classes = [name for name in file.namelist() if name.endswith(".class")]
                self.assertTrue(classes)
                for name in classes:
                    self.assertEqual(file.read(name)[:8], bytes.fromhex("cafebabe00000034"), name)

    def assert_refused(self, outcome, *words):
        self.assertEqual(outcome.returncode, 2, outcome.stderr)
        for word in (*words, "fix: "):
            self.assertIn(word, outcome.stderr)

    def test_a_missing_jar_is_named_with_what_makes_it(self):
        self.assert_refused(spy("--types", "nowhere.jar"), "nowhere.jar is missing", "--types with a jar that exists")

    def test_a_jar_without_types_is_refused_before_a_window_opens(self):
        with tempfile.TemporaryDirectory() as folder:
            jar = Path(folder) / "empty.jar"
            with zipfile.ZipFile(jar, "w") as file:
                file.writestr("nothing.txt", "")
            self.assert_refused(spy("--types", str(jar)), "0 types found", "empty.jar")
            jar.write_bytes(b"not a jar")
            self.assert_refused(spy("--types", str(jar)), "0 types found")

    def test_a_jar_with_some_of_the_types_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            jar = Path(folder) / "some.jar"
            with zipfile.ZipFile(os.environ["BALLAST_TYPES_JAR"]) as all_types, zipfile.ZipFile(jar, "w") as some:
                some.writestr("ballast/trip_t.class", all_types.read("ballast/trip_t.class"))
            self.assert_refused(spy("--types", str(jar)), "ballast.contact_t is not among the 1 types")

    def test_a_jar_of_another_build_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            jar = Path(folder) / "old.jar"
            with zipfile.ZipFile(os.environ["BALLAST_TYPES_JAR"]) as now, zipfile.ZipFile(jar, "w") as old:
                for name in now.namelist():
                    data = now.read(name)
                    if name == "ballast/trip_t.class":
                        # A class holds its fingerprint before lcm-gen's rotation by one bit, big-endian.
                        fingerprint = int.from_bytes(ballast.trip_t._get_packed_fingerprint(), "big")
                        base = (fingerprint >> 1 | (fingerprint & 1) << 63).to_bytes(8, "big")
                        self.assertEqual(data.count(base), 1)
                        data = data.replace(base, base[:7] + bytes([base[7] ^ 1]))
                    old.writestr(name, data)
            self.assert_refused(spy("--types", str(jar)), "ballast.trip_t is of another build")

    def test_a_bus_that_is_none_is_refused(self):
        outcome = subprocess.run([BALLAST, "spy", "--lcm", "nonsense://"], capture_output=True, text=True, timeout=60)
        self.assertEqual(outcome.returncode, 2, outcome.stderr)
        self.assertIn("cannot use the LCM bus nonsense://", outcome.stderr)

    def test_without_a_display_it_says_so(self):
        self.assert_refused(spy(), "no window can be opened", "ballast watch")

    def test_without_java_it_says_what_to_install(self):
        self.assert_refused(spy(PATH="/nowhere", JAVA_HOME=""), "no java in PATH", "apt-get install -y default-jre")


if __name__ == "__main__":
    unittest.main()
