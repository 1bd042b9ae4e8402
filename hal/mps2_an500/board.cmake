# Cortex-M7 with double-precision FPU.
set(BALLAST_CPU_FLAGS "-mthumb -mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard")
