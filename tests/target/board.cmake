# For the microcontroller: the programs the tests in this folder talk to.
foreach(program conformance sabotage step_cost)
  ballast_target(${program} ${CMAKE_CURRENT_LIST_DIR}/${program}_main.cpp)
endforeach()
