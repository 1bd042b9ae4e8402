"""The model in single precision asks a processor without a double-precision FPU for no double arithmetic: of the functions
that replace the instructions it has not, __aeabi_d* , none is called."""
import os
import re
import subprocess
import unittest

from cross import COMPILER, Folder

ROOT = os.environ["BALLAST_ROOT"]
M4F = ["-mthumb", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-std=c++20", "-O2", "-fno-exceptions",
       "-fno-rtti", "-ffp-contract=off", "-fno-math-errno", "-Wno-psabi", "-DNDEBUG", "-DEIGEN_DONT_VECTORIZE",
       "-DEIGEN_MAX_ALIGN_BYTES=0", "-I", ROOT, "-isystem", os.environ["BALLAST_EIGEN"]]
MODEL = sorted(name for name in os.listdir(os.path.join(ROOT, "firmware/model")) if name.endswith(".cpp"))


class SinglePrecision(Folder):
    def doubles(self, source, *flags):
        """Functions for double arithmetic that it calls."""
        out = os.path.join(self.folder, "out.o")
        subprocess.run([COMPILER, *M4F, *flags, "-c", os.path.join(ROOT, source), "-o", out], check=True)
        names = subprocess.run(["arm-none-eabi-nm", "-u", out], check=True, capture_output=True, text=True).stdout
        return re.findall(r"__aeabi_(?:c?d\w+|\w+2d)\b", names)

    def test_the_model_is_free_of_doubles(self):
        self.assertTrue(MODEL)
        for name in MODEL:
            with self.subTest(name):
                self.assertEqual(self.doubles("firmware/model/" + name, "-DBALLAST_REAL=float"), [])

    def test_this_would_see_them(self):
        self.assertIn("__aeabi_dmul", self.doubles("firmware/model/rolling.cpp"))
        # Deliberate: types.h says why.
        self.assertIn("__aeabi_dmul", self.doubles("firmware/motion/crossing.cpp", "-DBALLAST_REAL=float"))


if __name__ == "__main__":
    unittest.main()
