"""tools/elf/size: parts of a program of known sizes, and what the record lets pass."""
import os
import re
import subprocess
import unittest

from cross import COMPILER, FLAGS, MACHINE, Folder

MODEL = "extern const int table[{constants}] = {{1}}; int results[{results}]; int model(int i) {{ return results[i] = table[i]; }}"


class Size(Folder):
    """A project with a firmware of two rooms, a hal, libm and libgcc."""

    def built(self, constants=1000, results=500, elsewhere=None):
        def write(path, text):
            path = os.path.join(self.folder, path)
            os.makedirs(os.path.dirname(path), exist_ok=True)
            with open(path, "w", encoding="utf-8") as out:
                out.write(text)
            return path

        def compiled(path, text):
            write(path, text)
            run(COMPILER, *MACHINE, "-std=c++20", "-O1", "-fno-exceptions", "-c", path, "-o", path + ".obj")
            return path + ".obj"

        def run(*command):
            subprocess.run(command, check=True, cwd=self.folder)

        model = compiled("firmware/model/curve.cpp", MODEL.format(constants=constants, results=results))
        safety = compiled("firmware/safety/modes.cpp", "int variable = 7; int safety() { return ++variable; }")
        run("arm-none-eabi-ar", "rcs", "firmware/libballast_firmware.a", model, safety)
        hal = compiled("hal/board/main.cpp", "#include <cmath>\nint model(int); int safety(); volatile double x; volatile "
                       "long long n; int main() { x = std::fmod(x, 3.); n = n / (n + 1); return model(1) + safety(); }")
        extra = [compiled("elsewhere/odd.cpp", elsewhere)] if elsewhere else []
        elf = os.path.join(self.folder, "program.elf")
        run(COMPILER, *FLAGS, "-Wl,-Map=program.elf.map,-u,odd", *extra, hal, "firmware/libballast_firmware.a", "-lm", "-o", elf)
        return elf

    def size(self, elf, *arguments):
        return self.tool("size", elf, "--sources", self.folder, *arguments)

    def parts(self, elf):
        status, said, complaint = self.size(elf)
        self.assertEqual((status, complaint), (0, ""))
        return {p: (int(f), int(r)) for p, f, r in re.findall(r"^(\S+) +(\d+) +(\d+)$", said, re.M)}

    def test_parts_of_known_size(self):
        parts = self.parts(self.built())
        code = parts["firmware/model"][0] - 4000
        self.assertTrue(10 <= code <= 60, parts)  # a handful of instructions
        self.assertEqual(parts["firmware/model"][1], 2000)
        self.assertEqual(parts["firmware/safety"][1], 4)
        self.assertTrue(4 + 6 <= parts["firmware/safety"][0] <= 4 + 30, "its variable's initial value is flash too")
        self.assertEqual(parts["hal"][1], 16)
        self.assertGreater(parts["libm"][0], 200)
        self.assertGreater(parts["libgcc"][0], 200)
        self.assertNotIn("firmware/motion", parts)

    def test_parts_add_up_to_what_binutils_say(self):
        elf = self.built()
        parts = self.parts(elf)
        said = subprocess.run(["arm-none-eabi-size", elf], check=True, capture_output=True, text=True).stdout
        text, data, bss = map(int, said.splitlines()[1].split()[:3])
        self.assertEqual(parts["together"], (text + data, data + bss))

    def test_growth_beyond_a_tenth_is_refused(self):
        record = os.path.join(self.folder, "sizes.txt")
        elf = self.built()
        status, _, complaint = self.size(elf, "--record", record)  # there is none yet
        self.assertEqual(status, 2)
        self.assertIn(f" {elf} --record {record} --update writes it", complaint)
        self.assertEqual(self.size(elf, "--record", record, "--update")[0], 0)
        before = self.parts(elf)["firmware/model"]
        self.assertEqual(self.size(elf, "--record", record)[0], 0)
        self.assertEqual(self.size(self.built(constants=1080), "--record", record)[0], 0)
        self.assertEqual(self.size(self.built(constants=100), "--record", record)[0], 0)
        grown = self.built(constants=1120)
        status, _, complaint = self.size(grown, "--record", record)
        self.assertEqual(status, 1)
        self.assertIn(f"firmware/model: flash recorded {before[0]}, now {before[0] + 480} bytes (+12%)", complaint)
        self.assertIn("--update", complaint)
        status, _, complaint = self.size(self.built(results=560), "--record", record)
        self.assertEqual(status, 1)
        self.assertIn("firmware/model: RAM recorded 2000, now 2240 bytes", complaint)
        self.assertEqual(self.size(grown, "--record", record, "--update")[0], 0)
        self.assertEqual(self.size(grown, "--record", record)[0], 0)

    def test_a_part_that_was_not_there(self):
        record = os.path.join(self.folder, "sizes.txt")
        elf = self.built()
        self.size(elf, "--record", record, "--update")
        with open(record, encoding="utf-8") as file:
            lines = [line for line in file if not line.startswith("libm")]
        with open(record, "w", encoding="utf-8") as file:
            file.writelines(lines)
        status, _, complaint = self.size(elf, "--record", record)
        self.assertEqual(status, 1)
        self.assertRegex(complaint, r"libm: \d+ bytes of flash and \d+ of RAM, and not in the record")

    def test_what_belongs_to_no_part_is_refused(self):
        status, _, complaint = self.size(self.built(elsewhere="extern \"C\" int odd() { return 1; }"))
        self.assertEqual(status, 2)
        self.assertIn("elsewhere/odd.cpp.obj is in the program, and of no known part", complaint)

    def test_nonsense(self):
        elf = self.built()
        record = os.path.join(self.folder, "sizes.txt")
        with open(record, "w", encoding="utf-8") as out:
            out.write("hal many few\n")
        for arguments, expected in ((["--record", record], ":1: 'hal many few' is not a part and two numbers"),
                                    (["--map", os.path.join(self.folder, "absent")], "absent: No such file"),
                                    (["--map", record], "not a linker's map"), (["--update"], "--update needs --record")):
            with self.subTest(arguments=arguments):
                status, _, complaint = self.size(elf, *arguments)
                self.assertEqual(status, 2)
                self.assertIn(expected, complaint)
        status, _, complaint = self.size(elf + ".none")
        self.assertEqual(status, 2)
        self.assertNotIn("Traceback", complaint)


if __name__ == "__main__":
    unittest.main()
