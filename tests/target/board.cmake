# For the microcontroller: the programs the tests in this folder talk to.
foreach(program conformance overload sabotage step_cost step_load)
  ballast_target(${program} ${CMAKE_CURRENT_LIST_DIR}/${program}_main.cpp)
endforeach()
