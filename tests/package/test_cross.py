"""Builds for a microcontroller with an installed Ballast: find_package(ballast), and the firmware of a board."""
import shutil
import subprocess
import unittest

from installation import BUILD, CMAKE, Installed

# A Cortex-M4F, whose FPU has single precision only. nosys.specs has empty system calls, so that a program links.
TOOLCHAIN = """\
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
set(CMAKE_CXX_FLAGS_INIT "-mthumb -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard -ffunction-sections -fno-exceptions -fno-rtti")
set(CMAKE_EXE_LINKER_FLAGS_INIT "--specs=nano.specs --specs=nosys.specs -Wl,--gc-sections")
"""


class Cross(Installed):
    components = ("programs", "development")

    def test_the_examples_of_the_firmware_link_for_another_processor(self):
        (self.folder / "toolchain.cmake").write_text(TOOLCHAIN)
        self.run_in_folder(CMAKE, "-S", self.prefix / "share/doc/ballast/examples", "-B", "build", "-G", "Ninja",
                           f"-DCMAKE_TOOLCHAIN_FILE={self.folder}/toolchain.cmake", "-DBALLAST_REAL=float", "-DCMAKE_BUILD_TYPE=MinSizeRel",
                           f"-Dballast_DIR={self.prefix}/lib/cmake/ballast")
        self.run_in_folder("ninja", "-C", "build")
        for name in ("01_tick", "04_own_board"):
            header = subprocess.run(["arm-none-eabi-readelf", "-h", "-A", self.folder / "build" / name], capture_output=True,
                                    text=True, check=True).stdout
            self.assertRegex(header, r"Machine: +ARM")
            self.assertRegex(header, r"Tag_ABI_VFP_args: VFP registers")
        self.assertFalse((self.folder / "build/02_plant").exists())

    def test_the_installed_sources_make_the_firmware_of_a_board(self):
        """As tools/docs/install.md has it. Its run in QEMU has the bytes of the run with the firmware on the host."""
        shutil.copytree(self.prefix / "share/ballast/firmware", self.folder / "firmware")
        self.run_in_folder(CMAKE, "-S", "firmware", "-B", "build", "-G", "Ninja", "-DBALLAST_BOARD=mps2_an500", "-DBALLAST_TESTS=OFF",
                           "-DCMAKE_TOOLCHAIN_FILE=tools/toolchain/arm-none-eabi.cmake")
        self.run_in_folder("ninja", "-C", "build")
        short = ("ballast", "run", "paper_ball", "--set", "duration=0.2", "--quiet")
        self.run_in_folder(*short, "--out", "host")
        self.run_in_folder(*short, "--firmware", "qemu", "--firmware-elf", "build/bin/ballast-mps2_an500.elf", "--out", "qemu")
        self.assertEqual((self.folder / "qemu/run.lcmlog").read_bytes(), (self.folder / "host/run.lcmlog").read_bytes())

    def test_programs_find_the_firmware_that_is_installed_with_them(self):
        """That of the build, if it has made one. It may be older than the programs, which refuse it then."""
        elf = self.prefix / "share/ballast/elf/ballast-mps2_an500.elf"
        self.assertEqual(elf.exists(), (BUILD / "mps2_an500/bin/ballast-mps2_an500.elf").exists())
        elf.parent.mkdir(exist_ok=True)
        elf.write_bytes(b"no program")
        done = subprocess.run(["ballast", "run", "paper_ball", "--firmware", "qemu"], cwd=self.folder, env=self.environment,
                              capture_output=True, text=True, check=False)
        self.assertIn(f"{elf}: is no program for mps2_an500", done.stderr)


if __name__ == "__main__":
    unittest.main()
