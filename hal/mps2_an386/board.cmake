# Cortex-M4F, whose FPU has single precision only: so has the model (firmware/model/types.h).
set(BALLAST_CPU_FLAGS "-mthumb -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard")
set(BALLAST_REAL float)
