# Cortex-M7 with double-precision FPU.
set(BALLAST_CPU_FLAGS "-mthumb -mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard")
# Clocks in MHz of microcontrollers with this processor (STM32F7 and H7). Shares of a tick are printed for them.
set(BALLAST_CLOCKS_MHZ 216 480)
