# Cross build for the microcontroller board BALLAST_BOARD, a folder of hal/. Its board.cmake names the processor.
#   cmake --preset mps2-an500
set(CMAKE_SYSTEM_NAME Generic)
set(CMAKE_SYSTEM_PROCESSOR arm)
set(CMAKE_C_COMPILER arm-none-eabi-gcc)
set(CMAKE_CXX_COMPILER arm-none-eabi-g++)
set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)  # without startup code nothing links
set(CMAKE_TRY_COMPILE_PLATFORM_VARIABLES BALLAST_BOARD)
set(CMAKE_EXECUTABLE_SUFFIX_CXX .elf)

set(board_file ${CMAKE_CURRENT_LIST_DIR}/../../hal/${BALLAST_BOARD}/board.cmake)
if(NOT BALLAST_BOARD OR NOT EXISTS ${board_file})
  message(FATAL_ERROR "BALLAST_BOARD = '${BALLAST_BOARD}': there is no hal/${BALLAST_BOARD}/board.cmake")
endif()
include(${board_file})
# Static objects need no guards, because there are no threads, and no registered destructors.
set(CMAKE_CXX_FLAGS_INIT "${BALLAST_CPU_FLAGS} -ffunction-sections -fdata-sections -fno-exceptions -fno-rtti \
-fno-threadsafe-statics -fno-use-cxa-atexit -fno-unwind-tables -fno-asynchronous-unwind-tables")
set(CMAKE_C_FLAGS_INIT "${BALLAST_CPU_FLAGS}")
# nano.specs without nosys or rdimon has no _sbrk, so a program that allocates does not link.
set(CMAKE_EXE_LINKER_FLAGS_INIT "${BALLAST_CPU_FLAGS} --specs=nano.specs -nostartfiles -Wl,--gc-sections \
-Wl,--fatal-warnings")
