"""Breaks Ballast in places that chance chooses, and counts how many of the broken programs a guard tells from the sound.

  generate_mutants.py BUILD_DIR [--seed N | --seed-of-commit] [--count N] [--results FILE [--again]] [--survivors FILE]
                      [--least SHARE] [--jobs N]
  generate_mutants.py --list [--seed N] [--count N]

A mutant changes one sign, index, comparison or constant in one source file of firmware/, sim/ or tools/monitor. The seed
determines the mutants and their order; a change elsewhere leaves a mutant its place in that order. Each is compiled
alone and linked before the libraries of the build (test_mutants.py). Mutants that do not compile, or compile to the same
code, are left out and others take their place. Places where nothing but a text or a static_assert changes are no mutants.
Guards, the cheap ones first, up to the first that bites: 4 seeds of the soak, which include the run's own checks; the
fast tests of the file's room; 36 more seeds; the slow tests.

--results keeps one line of JSON per mutant and resumes from it: what is in it and still applies counts, and is not tried
again; with --again its survivors are, since tests may have been added. --survivors writes the survivors as a Markdown
table; verdicts that stand in it already are kept. The exit status is 1 if fewer than --least of the mutants are caught.
"""

import argparse
import concurrent.futures
import hashlib
import itertools
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import threading

from test_mutants import ROOT, Build, soak_ending, turn_of_today

FOLDERS = ("firmware", "sim", "tools/monitor")
LEFT_OUT = ("firmware/build_id",)
FEW_SEEDS, MORE_SEEDS = "soak --seeds 0..3 --quiet --jobs 1", "soak --seeds 4..39 --quiet --jobs 1"
TEST_LIMIT_S = 240
# Tests of a room, by the beginning of the file's path; the first match counts.
TESTS = (
    ("firmware/model", ("firmware_model_test", "firmware_closed_forms_test", "physics_test")),
    ("firmware/motion", ("firmware_motion_test", "firmware_control_test", "stepcheck_test")),
    ("firmware/governor", ("firmware_governor_test", "firmware_governing_test")),
    ("firmware/estimation", ("estimation_test", "firmware_governor_test", "firmware_governing_test", "measured_contact_test")),
    ("firmware/tracking", ("firmware_tracking_test", "tracking_test")),
    ("firmware", ("firmware_control_test", "firmware_governing_test", "firmware_closed_forms_test", "programs_test")),
    ("sim/scenario", ("scenario_test", "sil_test")),
    ("sim/closed_forms", ("firmware_closed_forms_test", "physics_test")),
    ("sim/integrators", ("integrators_test", "physics_test")),
    ("sim/plant/rolling_ode", ("integrators_test", "physics_test")),
    ("sim", ("physics_test", "scenario_test", "sil_test")),
    ("tools/monitor", ("monitor_test", "monitor_loop_test")),
)
# Tests that take most of their program's time, and are tried last.
SLOW = {
    "physics_test": "Impact.FrictionIsCoulombs:Regimes.RandomRobots*:Regimes.TransitionsDoNot*:ShortSlide.*:SlipStudy.*:"
                    "Stepping.TakesItsLastStep*:PlantFault.ARunSlips*:PhaseCurrent.IsWhatTheWinding*:RandomScenario.*:"
                    "Driven.EnergyBalance*:Conserved.Chaplygins*:Conserved.MomentumOfDriven*:Resonance.*",
    "sil_test": "*",
    "stepcheck_test": "*",
    "monitor_loop_test": "*",
}
# Calls whose arguments make a text, or nothing at all when the program runs.
TEXTS = re.compile(r"\b(static_assert|fmt::\w+|message|refuse|warn|complain|end_inconsistent)\s*\(")
NUMBER = re.compile(r"(?<![\w.])(\d+\.?\d*(?:e-?\d+)?)(?![\w.'])")
SWAPS = (("sign", r" \+ ", " - "), ("sign", r" - ", " + "), ("sign", r" \+= ", " -= "), ("sign", r" -= ", " += "),
         ("comparison", r" < ", " <= "), ("comparison", r" <= ", " < "), ("comparison", r" > ", " >= "),
         ("comparison", r" >= ", " > "), ("comparison", r" == ", " != "), ("comparison", r" != ", " == "),
         ("comparison", r" && ", " || "), ("comparison", r" \|\| ", " && "),
         ("index", r"\[0\]", "[1]"), ("index", r"\[1\]", "[0]"), ("index", r"\[2\]", "[1]"), ("index", r"\[i\]", "[0]"),
         ("index", r"\.x\b", ".y"), ("index", r"\.y\b", ".x"), ("index", r"\.z\b", ".y"))


def code_of(text):
    """The text with comments, strings and calls that only make texts blanked."""
    def blank(match):
        return re.sub(r"[^\n]", " ", match[0])

    text = re.sub(r'//[^\n]*|R"(\w*)\(.*?\)\1"|"(?:[^"\\\n]|\\.)*"|\'(?:[^\'\\\n]|\\.)\'', blank, text, flags=re.DOTALL)
    for call in TEXTS.finditer(text):
        if text[call.start()] == " ":
            continue  # inside of another one
        end, depth = call.end(), 1
        while depth > 0 and end < len(text):
            depth += {"(": 1, ")": -1}.get(text[end], 0)
            end += 1
        text = text[: call.end()] + re.sub(r"[^\n]", " ", text[call.end() : end]) + text[end:]
    return text


def other_number(text):
    if "." in text or "e" in text:
        return repr(float(text) * 1.25) if float(text) else "1.0"
    return str(int(text) + 1)


def places(path):
    """All changes of one file: (kind, line number from 1, column, old, new)."""
    for number, code in enumerate(code_of(path.read_text()).splitlines(), 1):
        if re.match(r"\s*(#|using|namespace|template|constexpr int k|friend)", code):
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
        lines, times = file.read_text().splitlines(), {}
        for kind, line, column, old, new in places(file):
            text = lines[line - 1]
            mutant = {"file": name, "line": line, "column": column, "kind": kind, "old": old.strip(), "new": new.strip(),
                      "from": old, "to": new, "text": (text[:column] + new + text[column + len(old):]).strip()}
            # The same line may stand in a file several times.
            same = name, mutant["text"], column, old
            mutant["which"] = times[same] = times.get(same, -1) + 1
            by_kind.setdefault(kind, []).append(mutant)
    for mutants in by_kind.values():
        mutants.sort(key=lambda m: hashlib.sha256(f"{seed} {key(m)}".encode()).digest())
    return [m for turn in itertools.zip_longest(*(by_kind[kind] for kind in sorted(by_kind))) for m in turn if m]


def key(mutant):
    """Names a mutant by what it changes, so that it is the same after a change elsewhere in its file."""
    return f"{mutant['file']} {mutant['column']} {mutant['from']} -> {mutant['to']} {mutant['which']} {mutant['text']}"


def words(mutant):
    return f"{mutant['file']}:{mutant['line']}:{mutant['column']} {mutant['old']} -> {mutant['new']}"


def mutated_text(mutant):
    lines = (ROOT / mutant["file"]).read_text().splitlines(keepends=True)
    line, at = lines[mutant["line"] - 1], mutant["column"]
    assert line[at:].startswith(mutant["from"])
    lines[mutant["line"] - 1] = line[:at] + mutant["to"] + line[at + len(mutant["from"]):]
    return "".join(lines)


def code_of_object(obj):
    """Instructions and constants. The first lines of the listing name the file."""
    code = subprocess.run(["objdump", "-dr", str(obj)], capture_output=True, text=True).stdout
    data = subprocess.run(["objdump", "-s", "-j", ".rodata", "-j", ".rodata.cst8", "-j", ".data", str(obj)],
                          capture_output=True, text=True).stdout
    return code.split("\n", 3)[-1], data.split("\n", 3)[-1]


def tests_of(file):
    return next(tests for start, tests in TESTS if file.startswith(start))


class SoundCode:
    """The code that a file compiles to as it is: compiled once."""

    def __init__(self, build):
        self.build, self.known, self.lock = build, {}, threading.Lock()

    def of(self, source, folder):
        with self.lock:
            if source not in self.known:
                (folder / source.name).write_text(source.read_text())
                self.build.compile(source, folder / source.name, folder / "sound.o")
                self.known[source] = hash(code_of_object(folder / "sound.o"))
            return self.known[source]


def try_mutant(build, sound, mutant, folder):
    """The mutant with its `result`: a guard, "survives", "same code", or "does not compile"."""
    folder.mkdir(parents=True, exist_ok=True)
    source = ROOT / mutant["file"]
    obj = folder / "mutated.o"
    try:
        (folder / source.name).write_text(mutated_text(mutant))
        if build.compile(source, folder / source.name, obj).returncode != 0:
            mutant["result"] = "does not compile"
        elif hash(code_of_object(obj)) == sound.of(source, folder):
            mutant["result"] = "same code"
        else:
            mutant["result"] = guard(build, mutant, folder, obj)
        return mutant
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def failed_test(program, tests, folder):
    """The name of the first test that fails; empty: none."""
    try:
        said = subprocess.run([str(program), f"--gtest_filter={tests}", "--gtest_brief=1", "--gtest_fail_fast"], cwd=folder,
                              capture_output=True, text=True, timeout=TEST_LIMIT_S, errors="replace")
    except subprocess.TimeoutExpired:
        return f"{program.name} hangs"
    if said.returncode == 0:
        return ""
    failed = re.search(r"\[  FAILED  \] ([\w/.]+)", said.stdout)
    return failed[1] if failed else program.name


def guard(build, mutant, folder, obj):
    ballast = folder / "ballast"
    if build.link("bin/ballast", obj, ballast).returncode != 0:
        return "does not compile"
    if (ended := soak_ending(ballast, FEW_SEEDS, folder)).by:
        return ended.by
    programs = [folder / test for test in tests_of(mutant["file"])]
    # A program that does not have the file is not linked.
    programs = [p for p in programs if build.link("tests/" + p.name, obj, p).returncode == 0]
    for program in programs:
        if SLOW.get(program.name) != "*" and (test := failed_test(program, "-" + SLOW.get(program.name, ""), folder)):
            return f"test: {test}"
    if (ended := soak_ending(ballast, MORE_SEEDS, folder)).by:
        return ended.by
    for program in programs:
        if program.name in SLOW and (test := failed_test(program, SLOW[program.name], folder)):
            return f"test: {test}"
    return "survives"


def write_survivors(path, mutants, seed):
    known = {}
    if path.exists():
        for row in path.read_text().splitlines():
            cells = [cell.strip() for cell in row.split(" | ")]
            if row.startswith("| `") and len(cells) == 4:
                known[tuple(cells[1:3])] = cells[3].removesuffix(" |")
    counted = [m for m in mutants if m["result"] not in ("does not compile", "same code")]
    survivors = [m for m in counted if m["result"] == "survives"]
    lines = ["# Survivors of the generated mutants", "",
             f"`generate_mutants.py build --seed {seed}`: {len(counted)} mutants, {len(counted) - len(survivors)} caught "
             f"({100 * (1 - len(survivors) / max(1, len(counted))):.0f} %). {sum(m['result'] == 'same code' for m in mutants)} "
             "more compile to the same code.", "", "| place | was -> is | line | verdict |", "|---|---|---|---|"]
    for m in sorted(survivors, key=lambda m: (m["file"], m["line"])):
        text = m["text"].replace("|", "\\|")
        what = f"`{m['old']}` -> `{m['new']}` ({m['kind']})".replace("`|| `", "`or`").replace("`||`", "`or`")
        verdict = known.get((what, f"`{text}`"), "not judged yet")
        lines.append(f"| `{m['file']}:{m['line']}` | {what} | `{text}` | {verdict} |")
    path.write_text("\n".join(lines) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path, nargs="?")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seed-of-commit", action="store_true")
    parser.add_argument("--count", type=int, default=8)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--results", type=pathlib.Path)
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--survivors", type=pathlib.Path)
    parser.add_argument("--least", type=float, default=0)
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    if options.seed_of_commit:
        options.seed = turn_of_today()
    order = chosen(options.seed)
    if options.list:
        print("\n".join(words(mutant) for mutant in order[: options.count]))
        return 0
    if options.build is None:
        parser.error("BUILD_DIR is missing; allowed without it: --list")
    build = Build(options.build.resolve())
    scratch = build.folder / "generated_mutants" / str(os.getpid())
    known = {}
    if options.results and options.results.exists():
        known = {key(m): m["result"] for m in map(json.loads, options.results.read_text().splitlines())}
    tried = []
    for mutant in order:
        result = known.get(key(mutant))
        if result is not None and not (options.again and result == "survives"):
            tried.append(mutant | {"result": result})
    if options.again:  # what has survived comes first
        order.sort(key=lambda mutant: known.get(key(mutant)) != "survives")
    done = {key(mutant) for mutant in tried}
    left = iter([m for m in order if key(m) not in done])

    def counts(mutant):
        return mutant["result"] not in ("does not compile", "same code")

    counted = sum(map(counts, tried))
    sound = SoundCode(build)
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        while counted < options.count:
            batch = list(itertools.islice(left, min(options.jobs, options.count - counted)))
            if not batch:
                break
            jobs = [pool.submit(try_mutant, build, sound, m, scratch / str(len(tried) + i)) for i, m in enumerate(batch)]
            for job in jobs:
                mutant = job.result()
                tried.append(mutant)
                counted += counts(mutant)
                print(f"{words(mutant)}: {mutant['result']}", flush=True)
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
