"""Breaks Ballast, one thing at a time, and shows which guard catches it: the mutants of mutants.toml.

  test_mutants.py BUILD_DIR [--only REGEX] [--every N] [--record] [--table README.md]
  test_mutants.py --check

Of each mutant one file is compiled with its fault and linked before the libraries of the build, whose own object of that
file is then left out: nothing in the sources knows of this. `ballast` so broken makes the mutant's run, and the mutant's
test program is run. A mutant that neither the run nor the test tells from the sound program has survived, which is a
failure; so is a run that ends otherwise than mutants.toml says. --every N takes every Nth mutant only, --record writes
how the runs ended into mutants.toml, to be read before it is believed, --table what was seen into the file, between its
markers. --check builds nothing: it only looks whether the text of each mutant still stands once in its file.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
BEGIN, END = "<!-- the table: test_mutants.py --table -->", "<!-- end of the table -->"
buses = 0
TIME_LIMIT_S = 300  # of one program; a broken one may hang


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
        words = ["-O0" if w in ("-O2", "-O3") else w for w in words]
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


def outcome(program, arguments, folder):
    """How a run ends, in a few words."""
    out = folder / "run"
    # A bus of its own on this machine, below the ports that the system hands out itself.
    global buses
    buses += 1
    arguments = arguments.replace("URL", f"'udpm://239.255.76.67:{12000 + (os.getpid() + buses) % 8000}?ttl=0'")
    try:
        said = subprocess.run([str(program), "run", *shlex.split(arguments), "--quiet", "--out", str(out)], cwd=folder,
                              capture_output=True, text=True, timeout=TIME_LIMIT_S)
    except subprocess.TimeoutExpired:
        return "hangs"
    if said.returncode < 0:
        return f"dies of signal {-said.returncode}"
    if not (out / "summary.json").exists():
        return f"could not run: {said.stderr.strip().splitlines()[0].split(';')[0].removeprefix('ballast: ')}"
    summary = json.loads((out / "summary.json").read_text())
    words = [summary["end"]["reason"]]
    if summary["trip"]:
        words.append("trip: " + summary["trip"]["cause"])
    if any(m and m["lost_steps"] for m in summary["motors"]):
        words.append("steps lost")
    if summary.get("step_timing") and summary["step_timing"]["violations"]:
        words.append("pulses out of place")
    return ", ".join(words)


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


def try_mutant(build, mutant, runs, folder):
    """(how the run ended, whether the test failed), or a text that says why it could not be tried."""
    source = ROOT / mutant["file"]
    text = source.read_text()
    if text.count(mutant["old"]) != 1:
        return f"{mutant['file']} has the text to be broken {text.count(mutant['old'])} times; allowed: once"
    folder.mkdir()
    mutated, obj = folder / source.name, folder / "mutated.o"
    mutated.write_text(text.replace(mutant["old"], mutant["new"]))
    done = build.compile(source, mutated, obj)
    if done.returncode != 0:
        return "does not compile:\n" + done.stderr
    test, test_filter = mutant["test"].split(" ", 1)
    for program, out in (("bin/ballast", folder / "ballast"), ("tests/" + test, folder / test)):
        done = build.link(program, obj, out)
        if done.returncode != 0:
            return f"{program} does not link:\n" + done.stderr
    for peer in ("ballast-controller", "ballast-monitor"):
        (folder / peer).symlink_to(build.folder / "bin" / peer)
    return outcome(folder / "ballast", runs[mutant["run"]], folder), test_fails(folder / test, test_filter)


def record(name, seen):
    path = HERE / "mutants.toml"
    before, after = path.read_text().split(f'name = "{name}"\n', 1)
    after = re.sub(r"^caught = .*$", lambda _: f"caught = {json.dumps(seen)}", after, count=1, flags=re.MULTILINE)
    path.write_text(before + f'name = "{name}"\n' + after)


def table(rows):
    lines = [BEGIN, "", "| broken | file | the run | ends | test that fails |", "|---|---|---|---|---|"]
    for mutant, ended, failed in rows:
        test = mutant["test"].split(" ", 1)[1].strip("*") if failed else "-"
        lines.append(f"| {mutant['breaks']} | `{mutant['file']}` | {mutant['run']} | "
                     f"{ended if mutant['caught'] else 'as it should'} | {test or mutant['test'].split()[0]} |")
    caught = sum(1 for mutant, _, _ in rows if mutant["caught"])
    lines += ["", f"{len(rows)} mutants: {caught} are caught in the run itself, {sum(f for _, _, f in rows)} by the test "
              f"beside them, none by neither.", "", END]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path, nargs="?")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--only", default="")
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--record", action="store_true")
    parser.add_argument("--table", type=pathlib.Path)
    options = parser.parse_args()
    listed = tomllib.loads((HERE / "mutants.toml").read_text())
    runs, mutants = listed["runs"], listed["mutant"]
    if len({m["name"] for m in mutants}) != len(mutants):
        fail("two mutants have one name")
    chosen = [m for m in mutants if re.search(options.only, m["name"])][:: options.every]
    if not chosen:
        fail(f"--only {options.only}: no mutant is called so")
    if options.check:
        lost = [m["name"] for m in mutants if (ROOT / m["file"]).read_text().count(m["old"]) != 1]
        print("\n".join(f"{name}: its text does not stand once in its file" for name in lost) or f"{len(mutants)} mutants apply")
        return 1 if lost else 0
    if options.build is None:
        parser.error("BUILD_DIR is missing; allowed without it: --check")
    build = Build(options.build.resolve())

    with tempfile.TemporaryDirectory(prefix="ballast-mutants-") as scratch:
        scratch = pathlib.Path(scratch)
        # The robot of the end-stop tests, from where they have it.
        header = (ROOT / "tests/sil/into_its_stop.h").read_text()
        stop = scratch / "into_its_stop.toml"
        stop.write_text(header.split('R"(')[1].split(')"')[0])
        runs = {name: line.replace(stop.name, shlex.quote(str(stop))) for name, line in runs.items()}
        sound = {}
        for name, line in runs.items():
            (scratch / name).mkdir()
            sound[name] = outcome(build.folder / "bin/ballast", line, scratch / name)
            print(f"sound program, {name}: {sound[name]}", flush=True)

        # A test that fails anyway would catch every mutant.
        for test in sorted({mutant["test"] for mutant in chosen}):
            program, test_filter = test.split(" ", 1)
            if test_fails(build.folder / "tests" / program, test_filter):
                fail(f"{test}: fails on the sound program")

        rows, bad = [], 0
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            tried = pool.map(lambda m: try_mutant(build, m, runs, scratch / ("of " + m["name"])), chosen)
            for mutant, result in zip(chosen, tried):
                name = mutant["name"]
                if isinstance(result, str):
                    print(f"{name}: {result}", flush=True)
                    bad += 1
                    continue
                ended, failed = result
                seen = ended if ended != sound[mutant["run"]] else ""
                survives = not seen and not failed
                if options.record:
                    record(name, seen)
                    mutant["caught"] = seen
                unlike = seen != mutant["caught"]
                print(f"{name}: {'run: ' + seen if seen else 'run as sound'}; test {'fails' if failed else 'passes'}"
                      + ("  SURVIVES" if survives else "")
                      + (f"  NOT AS LISTED: {mutant['caught']!r}" if unlike else ""), flush=True)
                bad += survives or unlike
                rows.append((mutant, ended, failed))
    print(f"{len(chosen)} mutants, {bad} not caught as listed")
    if options.table and not bad:
        text = options.table.read_text()
        start, end = text.index(BEGIN), text.index(END) + len(END)
        options.table.write_text(text[:start] + table(rows) + text[end:])
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
