# For the microcontroller: the programs that tests of this folder and of tests/qemu talk to. They are written for the boards on an MPS2.
get_target_property(board_dir ballast_board SOURCE_DIR)
if(NOT board_dir STREQUAL ${PROJECT_SOURCE_DIR}/hal/mps2)
  return()
endif()
foreach(program conformance sabotage step_cost step_load)
  ballast_target(${program} ${CMAKE_CURRENT_LIST_DIR}/${program}_main.cpp)
endforeach()
ballast_target(worst_tick ${CMAKE_CURRENT_LIST_DIR}/worst_tick_main.cpp)
