# Cortex-M4F. Its FPU has single precision only, so the model has floats (firmware/model/types.h).
set(BALLAST_CPU_FLAGS "-mthumb -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard")
set(BALLAST_REAL float)
# Clocks in MHz of microcontrollers with this processor (STM32F4). Shares of a tick are printed for them.
set(BALLAST_CLOCKS_MHZ 84 180)
