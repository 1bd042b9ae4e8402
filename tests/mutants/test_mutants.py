"""Breaks Ballast, one thing at a time, and shows which guard catches it: the mutants of mutants.toml.

  test_mutants.py BUILD_DIR [--only REGEX] [--every N [--turn K]] [--record] [--table README.md]
  test_mutants.py --check

Of each mutant one file is compiled with its fault and linked before the libraries of the build, whose own object of that
file is then left out: nothing in the sources knows of this. The guards are tried in the order of their price, and the
first that tells the broken program from the sound one ends it: `ballast`, so broken, makes the mutant's run, in which
monitor, firmware and step check are the guards. A run that only ends otherwise than the sound program's shows its user
nothing, so the soak is tried then. The mutant's test program is run in any case, and has to fail: a guard that stands in
mutants.toml is one that bites. A mutant that is not caught as mutants.toml says is a failure.

--every N takes each N-th mutant only, beginning with the K-th; without --turn K is the number of the repository's
commits, so that every commit is tried with others and each with the same ones (0 without a repository). --record tries
the run of every mutant, whatever mutants.toml says, and writes how it ended into it, to be read before it is believed;
--table writes what was seen into the file, between its markers. --check builds nothing: it only looks whether the text
of each mutant still stands once in its file.
"""

import argparse
import concurrent.futures
import fcntl
import json
import os
import pathlib
import re
import resource
import shlex
import shutil
import subprocess
import sys
import tomllib
from dataclasses import dataclass

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
BEGIN, END = "<!-- the table: test_mutants.py --table -->", "<!-- end of the table -->"
TIME_LIMIT_S = 300  # of one program; a broken one may hang
SOAK = "soak --seeds 0..199 --quiet --jobs 1"
MONITORS_CAUSES = {"normal_force", "friction", "nonfinite", "stale", "missing", "repeated", "disagreement"}
buses = 0


def fail(text):
    sys.exit(f"test_mutants.py: {text}")


class Build:
    """The build's own commands, with another source file, object or program in them."""

    def __init__(self, folder):
        self.folder = folder
        self.compile_commands = {}
        for entry in json.loads((folder / "compile_commands.json").read_text()):
            # A file that is compiled twice (the firmware in single precision): the first is the library's.
            self.compile_commands.setdefault(str(pathlib.Path(entry["file"]).resolve()), entry)
        self.link_commands = {}

    def compile(self, source, mutated, out):
        entry = self.compile_commands[str(source)]
        words = shlex.split(entry["command"])
        words = [str(mutated) if pathlib.Path(w).name == source.name and w.endswith(source.name) else w for w in words]
        words[words.index("-o") + 1] = str(out)
        # The optimiser would take most of the time and changes no result: no fast mathematics is allowed to it.
        words = ["-O1" if w in ("-O2", "-O3") else w for w in words]
        return subprocess.run(words, cwd=entry["directory"], capture_output=True, text=True)

    def link(self, program, obj, out):
        """`program` as Ninja names it: bin/ballast."""
        if program not in self.link_commands:
            said = subprocess.run(["ninja", "-C", str(self.folder), "-t", "commands", "-s", program],
                                  capture_output=True, text=True, check=True).stdout
            self.link_commands[program] = said.strip().splitlines()[-1].split("&&")[1]
        words = shlex.split(self.link_commands[program])
        at = words.index("-o")
        words[at + 1] = str(out)
        words.insert(at, str(obj))
        return subprocess.run(words, cwd=self.folder, capture_output=True, text=True)


@dataclass
class Ending:
    """How a run ends."""

    words: str
    cause: str = ""  # of the trip
    tick: int | None = None  # of the trip, or the last; None: there was none
    by: str = ""  # whose doing the end is, where that is not the trip's

    def guard(self, sound):
        """The test that has told it from the sound program's."""
        if self.by:
            return self.by
        if self.cause and self.cause != sound.cause:
            return ("monitor: " if self.cause in MONITORS_CAUSES else "controller: ") + self.cause
        return "the summary"


def ending(program, arguments, folder):
    out = folder / "run"
    # A bus of its own on this machine, below the ports that the system hands out itself.
    global buses
    buses += 1
    arguments = arguments.replace("URL", f"'udpm://239.255.76.67:{12000 + (os.getpid() + buses) % 8000}?ttl=0'")
    if arguments.startswith("soak "):
        return soak_ending(program, arguments, folder)
    try:
        said = subprocess.run([str(program), "run", *shlex.split(arguments), "--quiet", "--out", str(out)], cwd=folder,
                              capture_output=True, text=True, timeout=TIME_LIMIT_S)
    except subprocess.TimeoutExpired:
        return Ending("hangs", by="the clock")
    if said.returncode < 0:
        return Ending(f"dies of signal {-said.returncode}", by="the system")
    if not (out / "summary.json").exists():
        lines = said.stderr.strip().splitlines() or ["says nothing"]
        # The processes of a run complain in an order that changes with the machine's load.
        peers = sorted(line for line in lines if re.match(r"ballast-(controller|monitor|plant): ", line))
        text = (peers or lines)[0].removeprefix("ballast: ")
        tick = re.search(r"tick (-?\d+)", text)
        return Ending(f"could not run: {text.split(';')[0]}", by="the run", tick=int(tick[1]) if tick else None)
    summary = json.loads((out / "summary.json").read_text())
    end = Ending(summary["end"]["reason"], tick=summary["ticks"])
    if trip := summary["trip"]:
        end.cause, end.tick = trip["cause"], trip["tick"]
        end.words += f", trip: {end.cause} in tick {end.tick}"
    if any(m and m["lost_steps"] for m in summary["motors"]):
        end.words += ", steps lost"
    if summary["end"]["reason"] == "step_timing":
        end.by = "step check"
    return end


def soak_ending(program, arguments, folder):
    try:
        said = subprocess.run([str(program), *shlex.split(arguments)], cwd=folder, capture_output=True, text=True,
                              timeout=TIME_LIMIT_S)
    except subprocess.TimeoutExpired:
        return Ending("hangs", by="the clock")
    broken = re.findall(r'^seed (\d+): "(\w+)" is broken in tick (-?\d+)', said.stdout, re.MULTILINE)
    if not broken:
        return Ending("0 broken") if said.returncode == 0 else Ending("dies", by="the system")
    seed, invariant, tick = min(broken, key=lambda found: int(found[0]))
    return Ending(f"soak: {invariant} is broken in seed {seed}", tick=int(tick), by=f"soak: {invariant}")


def test_fails(program, test_filter):
    try:
        said = subprocess.run([str(program), f"--gtest_filter={test_filter}", "--gtest_brief=1"], capture_output=True,
                              text=True, timeout=TIME_LIMIT_S)
    except subprocess.TimeoutExpired:
        return True
    ran = re.search(r"\[==========\] (\d+) test", said.stdout)
    if said.returncode == 0 and not (ran and int(ran[1]) > 0):
        fail(f"{test_filter}: no such test")
    return said.returncode != 0


class Trial:
    """One mutant."""

    def __init__(self, build, mutant, folder):
        self.build, self.mutant, self.folder = build, mutant, folder
        self.trouble = ""  # why it could not be tried
        self.ended = None  # its run; None: not made
        self.seen = ""  # how that ended, if otherwise than the sound program's
        self.guard = ""  # who has caught it
        self.object = folder / "mutated.o"

    def try_guards(self, runs, sound, with_run):
        source = ROOT / self.mutant["file"]
        text = source.read_text()
        if (times := text.count(self.mutant["old"])) != 1:
            self.trouble = f"{self.mutant['file']} has the text to be broken {times} times; allowed: once"
            return self
        self.folder.mkdir(parents=True)
        mutated = self.folder / source.name
        mutated.write_text(text.replace(self.mutant["old"], self.mutant["new"]))
        done = self.build.compile(source, mutated, self.object)
        if done.returncode != 0:
            self.trouble = "does not compile:\n" + done.stderr
            return self
        if with_run:
            self.make_run(runs, sound)
        if not self.trouble:
            self.make_test()
        shutil.rmtree(self.folder)
        return self

    def link(self, program):
        out = self.folder / pathlib.Path(program).name
        done = self.build.link(program, self.object, out)
        if done.returncode != 0:
            self.trouble = f"{program} does not link:\n" + done.stderr
        return out

    def make_run(self, runs, sound):
        program = self.link("bin/ballast")
        if self.trouble:
            return
        for peer in ("ballast-controller", "ballast-monitor"):
            (self.folder / peer).symlink_to(self.build.folder / "bin" / peer)
        name = self.mutant["run"]
        self.ended = ending(program, runs[name], self.folder)
        if self.ended.words != sound[name].words:
            self.seen = self.ended.words
            self.guard = self.ended.guard(sound[name])
        if self.guard == "the summary" and (soaked := soak_ending(program, SOAK, self.folder)).by:
            self.guard = soaked.by

    def make_test(self):
        test, test_filter = self.mutant["test"].split(" ", 1)
        program = self.link("tests/" + test)
        if self.trouble:
            return
        if not test_fails(program, test_filter):
            self.trouble = f"SURVIVES its test, {self.mutant['test']}" + (f"; caught by {self.guard}" if self.guard else "")
        elif not self.guard:
            self.guard = f"test: {test_filter.strip('*')}" if test_filter != "*" else f"test: {test}"


def record(name, seen):
    path = HERE / "mutants.toml"
    before, after = path.read_text().split(f'name = "{name}"\n', 1)
    after = re.sub(r"^caught = .*$", lambda _: f"caught = {json.dumps(seen)}", after, count=1, flags=re.MULTILINE)
    path.write_text(before + f'name = "{name}"\n' + after)


def table(trials):
    lines = [BEGIN, "", "| broken | file | run | caught by | in tick | the run ends |", "|---|---|---|---|---|---|"]
    for t in trials:
        tick = "-" if not t.seen else "before the first" if t.ended.tick is None else str(t.ended.tick)
        if t.guard == "the summary":
            tick = "at the end"
        lines.append(f"| {t.mutant['breaks']} | `{t.mutant['file']}` | {t.mutant['run']} | {t.guard} | {tick} | "
                     f"{t.seen or 'as it should'} |")
    counts = {}
    for t in trials:
        kind = t.guard.split(":")[0]
        counts[kind] = counts.get(kind, 0) + 1
    said = ", ".join(f"{kind} {count}" for kind, count in sorted(counts.items(), key=lambda c: -c[1]))
    lines += ["", f"{len(trials)} mutants, all caught: {said}.", "", END]
    return "\n".join(lines)


def turn_of_today():
    said = subprocess.run(["git", "-C", str(ROOT), "rev-list", "--count", "HEAD"], capture_output=True, text=True)
    return int(said.stdout) if said.returncode == 0 else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path, nargs="?")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--turn", type=int)
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--table", type=pathlib.Path)
    options = parser.parse_args()
    listed = tomllib.loads((HERE / "mutants.toml").read_text())
    runs, mutants = listed["runs"], listed["mutant"]
    if len({m["name"] for m in mutants}) != len(mutants):
        fail("two mutants have one name")
    if options.every < 1:
        fail(f"--every {options.every}: allowed: 1 and more")
    turn = options.turn if options.turn is not None else turn_of_today() if options.every > 1 else 0
    chosen = [m for m in mutants if re.search(options.only, m["name"])][turn % options.every :: options.every]
    if not chosen:
        fail(f"--only {options.only}: no mutant is called so")
    if options.check:
        lost = [m["name"] for m in mutants if (ROOT / m["file"]).read_text().count(m["old"]) != 1]
        print("\n".join(f"{name}: its text does not stand once in its file" for name in lost) or f"{len(mutants)} mutants apply")
        return 1 if lost else 0
    if options.build is None:
        parser.error("BUILD_DIR is missing; allowed without it: --check")
    build = Build(options.build.resolve())

    scratch = build.folder / "mutants"
    scratch.mkdir(exist_ok=True)
    with open(scratch / "lock", "w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            fail(f"{scratch}: mutants are being made there already")
        for left in scratch.iterdir():
            if left.is_dir():
                shutil.rmtree(left)
        bad = try_all(build, scratch, chosen, runs, options)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    print(f"{len(chosen)} of {len(mutants)} mutants, {bad} not caught as listed; {used.ru_utime + used.ru_stime:.0f} s of CPU")
    return 1 if bad else 0


def try_all(build, scratch, chosen, runs, options):
    """How many are not as they should be."""
    with_run = [m for m in chosen if m["caught"] or options.record]
    sound = {}
    for name in sorted({m["run"] for m in with_run}):
        folder = scratch / ("sound " + name)
        folder.mkdir()
        sound[name] = ending(build.folder / "bin/ballast", runs[name], folder)
        print(f"sound program, {name}: {sound[name].words}", flush=True)
        shutil.rmtree(folder)
    # A test that fails anyway would catch every mutant.
    for test in sorted({m["test"] for m in chosen}):
        program, test_filter = test.split(" ", 1)
        if test_fails(build.folder / "tests" / program, test_filter):
            fail(f"{test}: fails on the sound program")

    trials, bad = [], 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        tried = pool.map(lambda m: Trial(build, m, scratch / m["name"]).try_guards(runs, sound, m in with_run), chosen)
        for trial in tried:
            name, listed = trial.mutant["name"], trial.mutant["caught"]
            if trial.trouble:
                print(f"{name}: {trial.trouble}", flush=True)
                bad += 1
                continue
            if options.record:
                record(name, trial.seen)
            # Numbers aside: a tick may move with every change of the robots' motion.
            alike = re.sub(r"-?\d+", "#", trial.seen) == re.sub(r"-?\d+", "#", listed)
            unlike = trial.guard != "" and not alike and not options.record
            at = f", tick {trial.ended.tick}" if trial.seen and trial.ended.tick is not None else ""
            print(f"{name}: {trial.guard or 'SURVIVES'}{at}" + (f" ({trial.seen})" if trial.seen else "")
                  + (f"  NOT AS LISTED: {listed!r}" if unlike else ""), flush=True)
            bad += not trial.guard or unlike
            trials.append(trial)
    if options.table and not bad:
        text = options.table.read_text()
        start, end = text.index(BEGIN), text.index(END) + len(END)
        options.table.write_text(text[:start] + table(trials) + text[end:])
    return bad


if __name__ == "__main__":
    sys.exit(main())
