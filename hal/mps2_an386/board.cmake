# Cortex-M4F, whose FPU has single precision only: so has the model (firmware/model/types.h).
set(BALLAST_CPU_FLAGS "-mthumb -mcpu=cortex-m4 -mfpu=fpv4-sp-d16 -mfloat-abi=hard")
set(BALLAST_REAL float)
# Clocks, in MHz, of microcontrollers that have it (STM32F4): what shares of a tick are stated for.
set(BALLAST_CLOCKS_MHZ 84 180)
