"""Nothing in the firmware can allocate: with the board's linker script and options, what would does not link.

Small programs that begin where the board's do, each with one thing in it that takes from the heap, and as many that do
not, which have to link.
"""
import os
import shlex
import subprocess
import unittest

from cross import COMPILER, Folder

ROOT = os.environ["BALLAST_ROOT"]
# The flags of the toolchain file and the board, with which its programs are built.
OPTIONS = shlex.split(os.environ["BALLAST_OPTIONS"]) + [
    "-std=c++20", "-O2", "-Wno-psabi", "-DEIGEN_DONT_VECTORIZE", "-DEIGEN_MAX_ALIGN_BYTES=0", "-DNDEBUG",
    "-Deigen_assert(x)=((x)?(void)0:__builtin_trap())", "-I", ROOT, "-isystem", os.environ["BALLAST_EIGEN"],
    "-T", os.environ["BALLAST_LINKER_SCRIPT"]]

PROGRAM = """
#include {header}
namespace {{ volatile int size = 3; }}
{helper}
extern "C" void ballast_reset() {{ {line} }}
"""
ALLOCATES = {
    "std::vector": ("<vector>", "", "std::vector<int> v(size); size = v[1];"),
    "new": ("<new>", "int* volatile kept;", "kept = new int(size);"),
    "malloc": ("<cstdlib>", "void* volatile kept;", "kept = std::malloc(size);"),
    "std::string": ("<string>", "", "std::string s(size, 'a'); size = s[2];"),
    "std::function": ("<functional>", "std::function<int()> kept;", "int a[8] = {size}; kept = [a] { return a[size]; };"),
    "printf": ("<cstdio>", "", 'std::printf("%d\\n", size);'),
    "virtual destructor": ("<new>", "struct V { virtual ~V() { size = 1; } }; struct W : V {}; V* volatile kept;",
                           "static W one; kept = &one; delete kept;"),
    "Eigen matrix of dynamic size": ('"Eigen/Core"', "", "Eigen::MatrixXd m(size, size); m.setZero(); size = int(m(1, 1));"),
}
DOES_NOT = {
    "std::array": ("<array>", "", "std::array<int, 4> a{}; size = a[size];"),
    "Eigen matrix of fixed size": ('"Eigen/Core"', "", "Eigen::Matrix3d m; m.setZero(); size = int(m(size - 3, 1));"),
    "libm": ("<cmath>", "", "size = int(std::fmod(size, 2.5));"),
    "std::span": ("<span>", "int a[4];", "std::span<int> s(a, size); size = s[1];"),
}


class NoHeap(Folder):
    def complaint(self, text):
        """The linker's, or nothing."""
        source = os.path.join(self.folder, "program.cpp")
        with open(source, "w", encoding="utf-8") as out:
            out.write(text)
        subprocess.run([COMPILER, *OPTIONS, "-c", source, "-o", source + ".o"], check=True)
        done = subprocess.run([COMPILER, *OPTIONS, source + ".o", "-o", source + ".elf", "-lm"], capture_output=True,
                              text=True, check=False)
        return "" if done.returncode == 0 else done.stderr

    def test_what_allocates_does_not_link(self):
        for name, (header, helper, line) in ALLOCATES.items():
            with self.subTest(name):
                said = self.complaint(PROGRAM.format(header=header, helper=helper, line=line))
                self.assertRegex(said, "the firmware has no heap|undefined reference to `_sbrk'", name)

    def test_what_does_not_allocate_links(self):
        for name, (header, helper, line) in DOES_NOT.items():
            with self.subTest(name):
                self.assertEqual(self.complaint(PROGRAM.format(header=header, helper=helper, line=line)), "")

    def test_a_vector_in_the_firmware(self):
        with open(os.path.join(ROOT, "firmware/safety/modes.cpp"), encoding="utf-8") as file:
            modes = file.read()
        use = """
            extern "C" void ballast_reset() {
              using namespace ballast::firmware;
              volatile Mode mode{};
              mode = next_mode(mode, Event::kArm, {true, true, false});
            }"""
        self.assertEqual(self.complaint(modes + use), "")
        body = "const GuardState& guards) {\n"
        self.assertEqual(modes.count(body), 2)  # holds() and next_mode()
        with_vector = modes[::-1].replace(body[::-1], (body + "std::vector<Mode> seen; seen.push_back(mode); "
                                                      "mode = *static_cast<volatile Mode*>(&seen[0]);\n")[::-1], 1)[::-1]
        self.assertRegex(self.complaint("#include <vector>\n" + with_vector + use), "the firmware has no heap|_sbrk")


if __name__ == "__main__":
    unittest.main()
