"""Random episodes of the environment: no number that is not finite, and no memory that is not given back.

BALLAST_EPISODES sets their number; the bar is 1000. Memory is compared after that many and after twice as many:

- The bytes that malloc has given out. With PYTHONMALLOC=malloc these are those of Python's objects too, so an object that
  something keeps counts like one that nothing refers to.
- With the address sanitizer's runtime preloaded, which a build without sanitizers needs no change for, instead of the
  former: the blocks of this package that nothing refers to. The interpreter and NumPy lose some memory of their own when
  they start.
"""
import ctypes
import gc
import os
import tempfile
import unittest

import ballast
import numpy as np

SEED = 24
FEW = 20
CHECKS = 5  # for leaks, of which one has to come to its end
SMALLEST_BLOCK_BYTES = 32  # of glibc's malloc on 64 bits


class Mallinfo2(ctypes.Structure):
    """struct mallinfo2 of malloc.h."""
    _fields_ = [(name, ctypes.c_size_t) for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks",
                                                     "uordblks", "fordblks", "keepcost")]


LIBRARIES = ctypes.CDLL(None)
LIBRARIES.mallinfo2.restype = Mallinfo2
SANITIZER_LEAK_CHECK = getattr(LIBRARIES, "__lsan_do_recoverable_leak_check", None)  # None: not in this process
EPISODES = int(os.environ.get("BALLAST_EPISODES", "50" if SANITIZER_LEAK_CHECK is None else "5"))


def bytes_in_use():
    """The bytes that malloc has given out and not got back, by all threads."""
    gc.collect()
    info = LIBRARIES.mallinfo2()
    return info.uordblks + info.hblkhd


def resident_bytes():
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def growth(policy, episodes):
    """(bytes in use, bytes resident) that so many more episodes add."""
    resident = resident_bytes()
    used = bytes_in_use()  # last, because the first reading of a file keeps memory
    policy.play(episodes)
    return bytes_in_use() - used, resident_bytes() - resident


def leaks():
    """The sanitizer's reports of memory that nothing refers to and that this package's module asked for.

    A child process looks, since the sanitizer ends the process whose threads it cannot all stop, as on a machine with much
    to do. Then another one tries.
    """
    gc.collect()
    with tempfile.TemporaryFile() as file:
        for _ in range(CHECKS):
            file.truncate(0)
            child = os.fork()
            if child == 0:
                os.dup2(file.fileno(), 2)
                SANITIZER_LEAK_CHECK()
                os._exit(0)
            status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
            file.seek(0)
            report = file.read().decode(errors="replace")
            if status == 0:
                return [leak for leak in report.split("\n\n") if "/ballast/_core" in leak]
    raise AssertionError(f"{CHECKS} checks for leaks ended before they were through, the last with {status}: {report}")


class Policy:
    """Episodes with a random spin at the start, a random floor and random actions."""

    def __init__(self):
        self.env = ballast.Environment(ballast.Scenario("desk_ball", set={"duration": 2.0}), goal=(0.5, 0.0))
        self.rng = np.random.default_rng(SEED)
        self.steps = 0
        self.broken = 0  # steps with numbers that are not finite

    def play(self, episodes):
        """Then the environment is as after its first reset(), so that its memory is the same."""
        rng = self.rng
        for _ in range(episodes):
            observation, _ = self.env.reset(seed=int(rng.integers(2**31)), options={
                "set": {"initial.angular_velocity": rng.normal(0, 0.5, 3), "surface.static_friction": rng.uniform(0.1, 0.8),
                        "surface.kinetic_friction": 0.1}})
            self.begun()
            over = False
            while not over:
                observation, reward, terminated, truncated, _ = self.env.step(self.env.action_space.sample())
                self.broken += not (np.isfinite(observation).all() and np.isfinite(reward))
                over = terminated or truncated
                self.steps += 1
        self.env.reset(seed=SEED)

    def begun(self):
        """An episode has begun."""


class Leaking(Policy):
    """Loses an array in each episode: one reference too many, as a wrong binding would leave.

    A lost plant would not do. pybind11 keeps a list of its objects, so that the sanitizer finds a way to each of them.
    """

    def begun(self):
        array = self.env._plant.state.mass_position  # pylint: disable=protected-access
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(array))


class Keeping(Policy):
    """Keeps a number of each episode."""

    def __init__(self):
        super().__init__()
        self.kept = {}

    def begun(self):
        self.kept[self.steps + 1.5] = None


class Episodes(unittest.TestCase):
    def test_a_preloaded_sanitizer_is_there(self):
        """The loader only warns of a library that it does not find."""
        self.assertEqual(SANITIZER_LEAK_CHECK is not None, "libasan" in os.environ.get("LD_PRELOAD", ""))

    def test_no_episode_breaks_or_leaks(self):
        policy = Policy()
        policy.play(EPISODES)
        if SANITIZER_LEAK_CHECK is None:
            grown, resident = growth(policy, EPISODES)
            print(f"the last {EPISODES} episodes: {grown} bytes more in use, {resident} more resident")
            # Less than the smallest block for every other episode. What the interpreter keeps does not grow with episodes.
            self.assertLess(grown, SMALLEST_BLOCK_BYTES * EPISODES / 2)
        else:
            self.assertEqual(leaks(), [])
            policy.play(EPISODES)
            self.assertEqual(leaks(), [])
        print(f"seed {SEED}, {2 * EPISODES} episodes, {policy.steps} steps, {policy.broken} with numbers that are not finite")
        self.assertEqual(policy.broken, 0)
        self.assertGreater(policy.steps, 2 * EPISODES)

    def test_what_is_lost_or_kept_is_found(self):
        """The last test, because what it loses stays lost."""
        if SANITIZER_LEAK_CHECK is not None:
            Leaking().play(2)
            self.assertNotEqual(leaks(), [])
            return
        for policy in (Leaking(), Keeping()):
            policy.play(FEW)
            self.assertGreaterEqual(growth(policy, FEW)[0], SMALLEST_BLOCK_BYTES * FEW / 2, type(policy))


if __name__ == "__main__":
    unittest.main()
