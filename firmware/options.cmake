# Options of every target that includes the firmware's headers, here and in a project that uses an installed Ballast. The
# firmware must give the same bits on this machine as on the microcontroller: hence no fused multiply-add and no
# vectorisation by Eigen. Eigen's alignment must also be the same in every translation unit.
target_compile_options(ballast_options INTERFACE -ffp-contract=off -fno-math-errno)
target_compile_definitions(ballast_options INTERFACE EIGEN_DONT_VECTORIZE EIGEN_MAX_ALIGN_BYTES=0)
target_link_libraries(ballast_options INTERFACE Eigen3::Eigen)

# On a microcontroller an assert of Eigen is a fault of the processor, because printing would need a heap.
if(CMAKE_SYSTEM_NAME STREQUAL "Generic")
  target_compile_options(ballast_options INTERFACE "-Deigen_assert(x)=((x)?(void)0:__builtin_trap())" -Wno-psabi)
  if(BALLAST_REAL)  # the scalar of the model, as the board or the project says
    target_compile_definitions(ballast_options INTERFACE BALLAST_REAL=${BALLAST_REAL})
  endif()
endif()
