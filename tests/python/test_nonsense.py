"""Wrong arguments of every kind to every function: an exception that one can catch, and never a crash or a hang.

BALLAST_SEED sets the seed, BALLAST_CALLS the number of random calls.
"""
import copy
import datetime
import decimal
import faulthandler
import inspect
import os
import pickle
import signal
import tempfile
import threading
import time
import unittest
import warnings

import ballast
import numpy as np

SEED = int(os.environ.get("BALLAST_SEED", "24"))
HANGS_S = 20  # one call; the longest, a run, takes milliseconds
CALLS = int(os.environ.get("BALLAST_CALLS", "4000"))
# Everything else would be a defect: SystemError is pybind11's for a broken binding, AttributeError a slip of the package.
REFUSALS = (ValueError, TypeError, KeyError, IndexError, OverflowError, MemoryError, RecursionError, OSError, ballast.BallastError)


class Hostile:
    """An object whose conversions fail."""

    def __array__(self, *_):
        raise RuntimeError("no array")

    def __float__(self):
        raise RuntimeError("no float")

    def __str__(self):
        raise RuntimeError("no str")

    __index__ = __fspath__ = __iter__ = __len__ = __array__


class Shrinking(list):
    """A list that is shorter each time it is looked at."""

    def __len__(self):
        if super().__len__():
            self.pop()
        return super().__len__()


def values(rng):
    """Values that no function asks for, among good ones."""
    n = int(rng.integers(0, 5))
    return [
        None, True, -1, 0, 1, 2**31, 2**63, -2**63, 2**200, 0.5, -0.0, 1e308, 5e-324, float("nan"), float("inf"), 1 + 2j,
        "", "paper_ball", "nonsense", "\x00", "a" * 5000, "\ud800", "mass.0.mass", b"bytes", bytearray(3), memoryview(b"abc"),
        [], [1], [1.0, 2.0, 3.0], [[1], [2, 3]], [None], ["a"], (), {}, {"a": 1}, {1: 2}, set(), range(3), object(), type, len,
        Hostile(), Shrinking([1, 2, 3, 4]), decimal.Decimal("1.5"), datetime.datetime(2020, 1, 1), slice(1), Ellipsis,
        np.float32(1.5), np.int8(3), np.bool_(True), np.longdouble(1.5), np.datetime64("2020"), np.str_("x"),
        np.zeros(n), np.zeros((n, 3)), np.zeros((2, n, 4)), np.zeros((0, 3)), np.zeros((3, 0)), np.zeros(()),
        np.ones((4, 4), order="F")[::-1, ::2], np.zeros(3, dtype=">f8"), np.zeros(3, dtype=np.float16), np.zeros(3, dtype="M8[s]"),
        np.zeros(3, dtype=object), np.full(3, np.nan), np.zeros(3, dtype=[("a", float)]), np.array(["a", "b"]),
        np.broadcast_to(1.0, (3, 1, 4)), np.zeros(33).reshape((1,) * 31 + (33,)),
        np.frombuffer(bytearray(8 * 3 + 1), dtype=float, count=3, offset=1), np.ma.masked_all(3), np.matrix([[1.0, 2.0]]),
        np.array([1.0, 0, 0, 0]), np.array([[1.0, 0, 0, 0]] * 2), np.zeros(3), np.zeros((2, 3)),
    ]


class Functions(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.addClassCleanup(os.chdir, os.getcwd())
        os.chdir(folder.name)  # a path of nonsense is a file in here
        short = ballast.Scenario("paper_ball", set={"duration": 0.01, "run.actuation": "ideal"})
        cls.run_ = ballast.run(short)
        cls.ball, cls.disk, cls.plant = ballast.Ball("paper_ball"), ballast.Ball("paper_disk"), ballast.Plant(short)
        cls.env = ballast.Environment(short)
        cls.env.reset()

    def targets(self):
        """(function, names of its parameters). Those that start the program are left out: they take only its options' texts."""
        scenario = ballast.Scenario("paper_ball")
        found = {ballast.Scenario: ["source", "set", "faults"], scenario.set: ["key", "value"], scenario.add_fault: ["fault"],
                 scenario.__getitem__: ["key"], scenario.save: ["path"],
                 ballast.run: ["scenario", "out", "actuation", "seed", "log"], ballast.Run.load: ["folder"],
                 self.run_.plot: ["picture"], self.run_.channels.__getitem__: ["name"],
                 self.run_.channels["contact"].__getitem__: ["index"], ballast.Sweep.load: ["folder"],
                 ballast.Ball: ["scenario", "believed"], self.ball.rail: ["mass", "theta"],
                 self.plant.advance: ["dt_s", "steps", "position", "velocity"], ballast.Plant: ["scenario"],
                 ballast.Environment: ["scenario", "period_s", "goal", "reward", "render_mode"],
                 self.env.reset: ["seed", "options"], self.env.step: ["action"], ballast.friction: ["scenario"]}
        for form in (ballast.rolling_forces, ballast.detached_motion, ballast.rolling_disk_forces, ballast.detached_disk_motion):
            found[form] = list(inspect.signature(form).parameters)
        return list(found.items())

    def good(self, function, name):
        """An argument that the function takes."""
        own = self.disk if "disk" in getattr(function, "__name__", "") else self.ball
        n = own.mass_count
        return {"ball": own, "q": [1.0, 0, 0, 0], "Omega": [0.0] * 3, "phi": 0.0, "phidot": 0.0, "theta": [0.0] * n,
                "thetadot": [0.0] * n, "thetaddot": [0.0] * n, "jac": True,
                "scenario": ballast.Scenario("paper_ball").set("duration", 0.01), "mass": 0, "dt_s": 1e-3,
                "key": "mass.0.mass", "source": "paper_ball", "action": [0.0] * n}.get(name)

    def call(self, rng, function, names):
        """Calls with most arguments good and at least one from values(). Returns what was passed."""
        bad = set(rng.choice(len(names), size=int(rng.integers(1, len(names) + 1)), replace=False))
        arguments = {}
        for i, name in enumerate(names):
            pool = values(rng)
            value = pool[int(rng.integers(len(pool)))] if i in bad else self.good(function, name)
            if value is not None or i in bad or name in ("scenario", "source", "key"):
                arguments[name] = value
        if function == self.plant.advance and isinstance(arguments.get("dt_s"), (int, float)) and arguments["dt_s"] > 0.5:
            arguments["dt_s"] = 1e-3  # good, and it would take its time
        positional = function.__name__ in ("__getitem__",)
        try:
            function(*arguments.values()) if positional else function(**arguments)  # pylint: disable=expression-not-assigned
        except REFUSALS:
            pass
        except RuntimeError as error:
            self.assertIn(str(error), ("no array", "no float", "no str"))  # Hostile's own
        return arguments

    def test_no_call_crashes(self):
        self.addCleanup(faulthandler.cancel_dump_traceback_later)
        rng = np.random.default_rng(SEED)
        targets = self.targets()
        for number in range(CALLS):
            function, names = targets[int(rng.integers(len(targets)))]
            if function in (ballast.run, ballast.friction) and number % 10:
                continue  # these take longer
            faulthandler.dump_traceback_later(HANGS_S, exit=True)  # in place of the one before
            with self.subTest(f"seed {SEED}, call {number}: {function.__name__}"), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                self.call(rng, function, names)
        faulthandler.cancel_dump_traceback_later()
        # And all still works.
        self.assertGreater(ballast.rolling_forces(self.ball, [1, 0, 0, 0], [0, 0, 0], *[[0] * 3] * 3).normal_force_n, 0)
        self.assertEqual(ballast.run(ballast.Scenario("paper_ball").set("duration", 0.01)).end_reason, "completed")

    def test_nonsense_for_the_programs_options(self):
        for call in (lambda: ballast.integrate("paper_ball", method="--help\n"), lambda: ballast.integrate("paper_ball", tolerance="x"),
                     lambda: ballast.integrate("paper_ball", step_s=float("nan")), lambda: ballast.plan("paper_ball", "\x00"),
                     lambda: ballast.plan("paper_ball", "x.toml", seed="x"), lambda: ballast.plan(None, "x.toml"),
                     lambda: ballast.sweep("nowhere.toml", "x"), lambda: ballast.sweep({}, "x"), lambda: ballast.sweep(3, "x"),
                     lambda: ballast.sweep({"scenario": "paper_ball"}, "x", jobs=-1),
                     lambda: ballast.sweep({"scenario": "paper_ball", "runs": 2}, "x", map_keys=("a", "b"))):
            with self.assertRaises(REFUSALS):
                call()

    def test_classes_without_their_constructor(self):
        """__new__ alone makes an object that holds nothing."""
        with self.assertRaises(TypeError):
            ballast.rolling_forces(ballast.Ball.__new__(ballast.Ball), [1, 0, 0, 0], [0, 0, 0], *[[0.0] * 3] * 3)

    def test_copies(self):
        """A copy of a plant goes its own way; one of what never changes is as good as the original. Pickles serve other processes."""
        plant = ballast.Plant(ballast.Scenario("paper_ball").set("run.actuation", "prescribed"))
        plant.advance(0.5)
        for other in (plant.copy(), copy.copy(plant), copy.deepcopy([plant])[0]):
            self.assertEqual(other.advance(0.1).time_s, 0.6)
            self.assertEqual(plant.state.time_s, 0.5)
        plant.advance(0.1)
        np.testing.assert_array_equal(other.state.orientation, plant.state.orientation)
        core = plant._plant  # pylint: disable=protected-access
        for other in (copy.copy(core), copy.deepcopy(core)):
            other.advance(0.1, [], [], [])
            self.assertEqual((other.state()["time_s"], core.state()["time_s"]), (0.7, 0.6))
        env = copy.deepcopy(self.env)
        np.testing.assert_array_equal(env.step(np.zeros(3))[0], self.env.step(np.zeros(3))[0])
        state = ([1, 0, 0, 0], [0, 0, 0], *[[0.1] * 3] * 3)
        for ball in (copy.copy(self.ball), copy.deepcopy(self.ball), pickle.loads(pickle.dumps(self.ball))):
            self.assertEqual(ballast.rolling_forces(ball, *state).normal_force_n,
                             ballast.rolling_forces(self.ball, *state).normal_force_n)
        scenario = ballast.Scenario("paper_ball").set("mass.1.mass", 1.2)
        self.assertEqual(pickle.loads(pickle.dumps(scenario)).fingerprint, scenario.fingerprint)
        self.assertEqual(copy.deepcopy(scenario).fingerprint, scenario.fingerprint)
        with self.assertRaises(TypeError):
            pickle.dumps(plant)
        try:
            scenario.set("ball.mass", -1).check()
        except ballast.ScenarioError as error:
            again = pickle.loads(pickle.dumps(error))
            self.assertEqual((str(again), again.key, again.allowed), (str(error), error.key, error.allowed))


class Interrupts(unittest.TestCase):
    """SIGINT in the middle of a call: KeyboardInterrupt, long before the call's own end, and all works afterwards."""

    def interrupted(self, call, after_s=0.2, within_s=20.0):
        """The call would take minutes, unless a bound is given; 20 s tell these apart on a busy machine too."""
        timer = threading.Timer(after_s, lambda: signal.pthread_kill(threading.main_thread().ident, signal.SIGINT))
        start = time.monotonic()
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            call()
        self.assertLess(time.monotonic() - start, within_s)

    def test_a_plant(self):
        plant = ballast.Plant(ballast.Scenario("paper_ball", set={"run.actuation": "prescribed"}))
        self.interrupted(lambda: plant.advance(1e6))
        self.assertGreater(plant.state.time_s, 0)
        plant.advance(0.1)

    def test_friction(self):
        self.interrupted(lambda: ballast.friction(ballast.Scenario("paper_ball").set("duration", 1e6)))

    def test_a_program(self):
        spec = {"scenario": "paper_ball", "runs": 10**7, "seed": 1, "vary": {"mass.0.mass": {"normal": [1.0, 0.05]}}}
        with tempfile.TemporaryDirectory() as folder:
            self.interrupted(lambda: ballast.sweep(spec, folder + "/x"), after_s=1.0)

    def test_arrays(self):
        """A call for 300,000 rows ends early: in less than half of the time in which 300 calls for 1,000 rows are done."""
        disk = ballast.Ball("paper_disk")
        rest = np.zeros(disk.mass_count)

        def rows(count):
            start = time.monotonic()
            ballast.rolling_disk_forces(disk, np.zeros(count), 0.0, rest, rest, rest, jac=True)
            return time.monotonic() - start

        whole_s = 300 * min(rows(1000) for _ in range(5))
        self.interrupted(lambda: rows(300_000), after_s=0.1 * whole_s, within_s=0.5 * whole_s)

    def test_what_a_handler_raises_arrives(self):
        class Enough(Exception):
            pass

        def handler(*_):
            raise Enough

        before = signal.signal(signal.SIGALRM, handler)
        try:
            signal.setitimer(signal.ITIMER_REAL, 0.2)
            with self.assertRaises(Enough), tempfile.TemporaryDirectory() as folder:
                ballast.run(ballast.Scenario("paper_ball").set("duration", 1e4), folder + "/x")
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            signal.signal(signal.SIGALRM, before)


class Threads(unittest.TestCase):
    def test_all_at_once(self):
        """Forms, plants, runs and refusals in eight threads give what they give alone."""
        ball = ballast.Ball("paper_ball")
        rng = np.random.default_rng(SEED)
        q = rng.normal(size=(500, 4))
        q /= np.linalg.norm(q, axis=-1, keepdims=True)
        arguments = (q, rng.normal(size=(500, 3)), *(rng.normal(size=(500, ball.mass_count)) for _ in range(3)))
        expected = ballast.rolling_forces(ball, *arguments)
        wrong = []

        def work(number):
            try:
                for _ in range(10):
                    forces, _ = ballast.rolling_forces(ball, *arguments, jac=True)
                    if not np.array_equal(forces.normal_force_n, expected.normal_force_n):
                        wrong.append(number)
                    ballast.Plant("desk_ball").advance(0.01)
                    try:
                        ballast.Scenario("paper_ball").set("ball.mass", -1).check()
                        wrong.append(number)
                    except ballast.ScenarioError:
                        pass
            except Exception as error:  # pylint: disable=broad-exception-caught
                wrong.append(error)

        threads = [threading.Thread(target=work, args=(i,)) for i in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        self.assertEqual(wrong, [])


if __name__ == "__main__":
    print(f"seed {SEED}")
    unittest.main()
