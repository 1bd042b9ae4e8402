"""find_package(ballast) in a build for a microcontroller: the firmware is compiled from the installed sources."""
import subprocess
import unittest

from installation import CMAKE, Installed

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
    components = ("development",)

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


if __name__ == "__main__":
    unittest.main()
