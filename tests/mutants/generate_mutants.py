"""Breaks Ballast in places that chance chooses, and counts how many of the broken programs a guard tells from the sound.

  generate_mutants.py BUILD_DIR [--seed N | --seed-of-commit] [--count N] [--results FILE] [--survivors FILE] [--least SHARE]
  generate_mutants.py --list [--seed N] [--count N]

A mutant changes one sign, index, comparison or constant in one source file of firmware/, sim/ or tools/monitor. The seed
determines the mutants and their order, for the same sources. Each is compiled alone and linked before the libraries of
the build (test_mutants.py). Mutants that do not compile, or compile to the same code, are left out and others take their
place. Guards, in order: 40 seeds of the soak, which include the run's own checks; then the tests of the file's room.

--results keeps one line of JSON per mutant and resumes from it: what is in it is not tried again. --survivors writes the
survivors as a Markdown table; verdicts that stand in it already are kept. The exit status is 1 if fewer than --least of
the mutants are caught.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys

from test_mutants import ROOT, Build, soak_ending, turn_of_today

FOLDERS = ("firmware", "sim", "tools/monitor")
LEFT_OUT = ("firmware/build_id",)
SOAK = "soak --seeds 0..39 --quiet --jobs 1"
TEST_LIMIT_S = 240
# Tests of a room, by the beginning of the file's path; the first match counts.
TESTS = (
    ("firmware/model", ("firmware_closed_forms_test", "physics_test")),
    ("firmware/motion", ("firmware_motion_test", "firmware_control_test")),
    ("firmware", ("firmware_control_test", "firmware_closed_forms_test")),
    ("sim/scenario", ("scenario_test", "sil_test")),
    ("sim/closed_forms", ("firmware_closed_forms_test", "physics_test")),
    ("sim", ("physics_test", "scenario_test")),
    ("tools/monitor", ("monitor_test", "monitor_loop_test")),
)
NUMBER = re.compile(r"(?<![\w.])(\d+\.?\d*(?:e-?\d+)?)(?![\w.'])")
SWAPS = (("sign", r" \+ ", " - "), ("sign", r" - ", " + "), ("sign", r" \+= ", " -= "), ("sign", r" -= ", " += "),
         ("comparison", r" < ", " <= "), ("comparison", r" <= ", " < "), ("comparison", r" > ", " >= "),
         ("comparison", r" >= ", " > "), ("comparison", r" == ", " != "), ("comparison", r" != ", " == "),
         ("comparison", r" && ", " || "), ("comparison", r" \|\| ", " && "),
         ("index", r"\[0\]", "[1]"), ("index", r"\[1\]", "[0]"), ("index", r"\[2\]", "[1]"), ("index", r"\[i\]", "[0]"),
         ("index", r"\.x\b", ".y"), ("index", r"\.y\b", ".x"), ("index", r"\.z\b", ".y"))


def code_of(line):
    """The line with its comment and its strings blanked."""
    line = re.sub(r'"(?:[^"\\]|\\.)*"', lambda m: " " * len(m[0]), line)
    return line.split("//")[0]


def other_number(text):
    if "." in text or "e" in text:
        return repr(float(text) * 1.25) if float(text) else "1.0"
    return str(int(text) + 1)


def places(path):
    """All changes of one file: (kind, line number from 1, column, old, new)."""
    for number, line in enumerate(path.read_text().splitlines(), 1):
        code = code_of(line)
        if re.match(r"\s*(#|using|namespace|template|static_assert|constexpr int k|friend)", code) or "fmt::" in code:
            continue
        for kind, pattern, new in SWAPS:
            for match in re.finditer(pattern, code):
                yield kind, number, match.start(), match[0], new
        for match in NUMBER.finditer(code):
            before = code[: match.start()].rstrip()
            if before.endswith("[") or before.endswith("<"):  # indices have their own kind; template arguments
                continue
            yield "constant", number, match.start(), match[0], other_number(match[0])


def chosen(seed):
    """Every mutant there is, in the order of the seed; kinds take turns, so that none crowds out the others."""
    files = [f for top in FOLDERS for f in sorted((ROOT / top).rglob("*.cpp"))]
    by_kind = {}
    for file in files:
        name = file.relative_to(ROOT).as_posix()
        if name.startswith(LEFT_OUT):
            continue
        for kind, line, column, old, new in places(file):
            by_kind.setdefault(kind, []).append(
                {"file": name, "line": line, "column": column, "kind": kind, "old": old.strip(), "new": new.strip(),
                 "from": old, "to": new})
    chance = random.Random(seed)
    for mutants in by_kind.values():
        chance.shuffle(mutants)
    kinds = sorted(by_kind)
    while any(by_kind.values()):
        for kind in kinds:
            if by_kind[kind]:
                yield by_kind[kind].pop()


def key(mutant):
    return f"{mutant['file']}:{mutant['line']}:{mutant['column']} {mutant['old']} -> {mutant['new']}"


def mutated_text(mutant):
    lines = (ROOT / mutant["file"]).read_text().splitlines(keepends=True)
    line, at = lines[mutant["line"] - 1], mutant["column"]
    assert line[at:].startswith(mutant["from"])
    lines[mutant["line"] - 1] = line[:at] + mutant["to"] + line[at + len(mutant["from"]):]
    mutant["text"] = lines[mutant["line"] - 1].strip()
    return "".join(lines)


def code_of_object(obj):
    """Instructions and constants. The first lines of the listing name the file."""
    code = subprocess.run(["objdump", "-dr", str(obj)], capture_output=True, text=True).stdout
    data = subprocess.run(["objdump", "-s", "-j", ".rodata", "-j", ".rodata.cst8", "-j", ".data", str(obj)],
                          capture_output=True, text=True).stdout
    return code.split("\n", 3)[-1], data.split("\n", 3)[-1]


def tests_of(file):
    return next(tests for start, tests in TESTS if file.startswith(start))


def try_mutant(build, mutant, folder):
    """The mutant with its `result`: a guard, "survives", "same code", or "does not compile"."""
    folder.mkdir(parents=True, exist_ok=True)
    source = ROOT / mutant["file"]
    obj, sound = folder / "mutated.o", folder / "sound.o"
    try:
        (folder / source.name).write_text(mutated_text(mutant))
        if build.compile(source, folder / source.name, obj).returncode != 0:
            mutant["result"] = "does not compile"
            return mutant
        (folder / source.name).write_text(source.read_text())
        build.compile(source, folder / source.name, sound)
        if code_of_object(obj) == code_of_object(sound):
            mutant["result"] = "same code"
            return mutant
        mutant["result"] = guard(build, mutant, folder, obj)
        return mutant
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def guard(build, mutant, folder, obj):
    ballast = folder / "ballast"
    done = build.link("bin/ballast", obj, ballast)
    if done.returncode != 0:
        return "does not compile"
    if (ended := soak_ending(ballast, SOAK, folder)).by:
        return ended.by
    ballast.unlink()
    for test in tests_of(mutant["file"]):
        program = folder / test
        if build.link("tests/" + test, obj, program).returncode != 0:
            continue  # does not have this file
        try:
            said = subprocess.run([str(program), "--gtest_brief=1", "--gtest_fail_fast"], cwd=folder,
                                  capture_output=True, text=True, timeout=TEST_LIMIT_S, errors="replace")
        except subprocess.TimeoutExpired:
            return f"test: {test} hangs"
        if said.returncode != 0:
            failed = re.search(r"\[  FAILED  \] ([\w/.]+)", said.stdout)
            return f"test: {failed[1] if failed else test}"
        program.unlink()
    return "survives"


def write_survivors(path, mutants, seed):
    known = {}
    if path.exists():
        for row in path.read_text().splitlines():
            cells = [cell.strip() for cell in row.split(" | ")]
            if row.startswith("| `") and len(cells) == 4:
                known[cells[0].removeprefix("| ")] = cells[3].removesuffix(" |")
    counted = [m for m in mutants if m["result"] not in ("does not compile", "same code")]
    survivors = [m for m in counted if m["result"] == "survives"]
    lines = ["# Survivors of the generated mutants", "",
             f"`generate_mutants.py build --seed {seed}`: {len(counted)} mutants, {len(counted) - len(survivors)} caught "
             f"({100 * (1 - len(survivors) / max(1, len(counted))):.0f} %). {sum(m['result'] == 'same code' for m in mutants)} "
             "more compile to the same code.", "", "| place | was -> is | line | verdict |", "|---|---|---|---|"]
    for m in survivors:
        place = f"`{m['file']}:{m['line']}`"
        text = m["text"].replace("|", "\\|")
        lines.append(f"| {place} | `{m['old']}` -> `{m['new']}` ({m['kind']}) | `{text}` | {known.get(place, 'not judged yet')} |"
                     .replace("`|| `", "`or`"))
    path.write_text("\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path, nargs="?")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seed-of-commit", action="store_true")
    parser.add_argument("--count", type=int, default=8)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--results", type=pathlib.Path)
    parser.add_argument("--survivors", type=pathlib.Path)
    parser.add_argument("--least", type=float, default=0)
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    if options.seed_of_commit:
        options.seed = turn_of_today()
    order = chosen(options.seed)
    if options.list:
        for _, mutant in zip(range(options.count), order):
            print(key(mutant))
        return 0
    if options.build is None:
        parser.error("BUILD_DIR is missing; allowed without it: --list")
    build = Build(options.build.resolve())
    scratch = build.folder / "generated_mutants" / str(os.getpid())
    known = {}
    if options.results and options.results.exists():
        known = {key(m): m for m in map(json.loads, options.results.read_text().splitlines())}
    tried, counted = [], 0
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        while counted < options.count:
            batch = [m for _, m in zip(range(min(2 * options.jobs, options.count - counted)), order)]
            if not batch:
                break
            jobs = [pool.submit(lambda m, i: known.get(key(m)) or try_mutant(build, m, scratch / str(i)), m,
                                len(tried) + i) for i, m in enumerate(batch)]
            for job in jobs:
                mutant = job.result()
                tried.append(mutant)
                counted += mutant["result"] not in ("does not compile", "same code")
                if key(mutant) in known:
                    continue
                print(f"{key(mutant)}: {mutant['result']}", flush=True)
                if options.results:
                    with options.results.open("a") as file:
                        file.write(json.dumps(mutant) + "\n")
    shutil.rmtree(scratch, ignore_errors=True)
    survivors = sum(m["result"] == "survives" for m in tried)
    share = 1 - survivors / max(1, counted)
    print(f"seed {options.seed}: {counted} mutants, {counted - survivors} caught ({100 * share:.0f} %), "
          f"{len(tried) - counted} left out")
    if options.survivors:
        write_survivors(options.survivors, tried, options.seed)
    return 0 if share >= options.least else 1


if __name__ == "__main__":
    sys.exit(main())
