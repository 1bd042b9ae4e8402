#!/usr/bin/env python3
"""libm_test.py NM LIBRARY...: the firmware calls no function of libm whose bits IEEE does not fix.

They differ between glibc and newlib, and so would the step commands. What the library leaves undefined is compared with
what it may.
"""
import re
import subprocess
import sys

# fmod is exact. fmin and fmax choose one of their arguments; which of two zeros is open, and nothing here asks.
# sqrt is exact; a compiler that inlines it may still call it for errno's sake.
EXACT = {name + suffix for name in ("fmod", "fmin", "fmax", "sqrt", "floor", "ceil", "trunc") for suffix in ("", "f")}
MEMORY = {"memcpy", "memmove", "memset", "memcmp"}
COMPILERS_OWN = re.compile(r"__(asan|ubsan|tsan|sanitizer|stack_chk|aeabi|gcov|cyg_profile)_|_GLOBAL_OFFSET_TABLE_|__assert")
PROBES = {"sin", "cosf", "pow", "cbrt"}  # have to be refused, or this test sees nothing


def undefined(nm, libraries):
    """Names that members of the libraries want and none of them has."""
    wanted, had = set(), set()
    for line in subprocess.run([nm, *libraries], check=True, capture_output=True, text=True).stdout.splitlines():
        match = re.fullmatch(r"[0-9a-f]* *(\w) (\S+)", line)
        if match:
            (wanted if match[1] in "Uw" else had).add(match[2])
    return wanted - had


def refused(names):
    return sorted(n for n in names if n not in EXACT | MEMORY and not COMPILERS_OWN.match(n))


def main():
    nm, *libraries = sys.argv[1:]
    names = undefined(nm, libraries)
    if not names:
        sys.exit(f"{libraries}: nothing is undefined, which cannot be: not even fmod?")
    if refused(names | PROBES) != sorted(set(refused(names)) | PROBES):
        sys.exit("this test would let sin pass")
    bad = refused(names)
    if bad:
        sys.exit(f"{libraries}: calls {', '.join(bad)}: not exact, or not the firmware's business")


if __name__ == "__main__":
    main()
