# Where an installation has its parts, relative to its prefix. Programs find the others relative to themselves, so an
# installation may be moved as a whole.
set(BALLAST_PROGRAM_DIR bin)
set(BALLAST_LIBRARY_DIR lib)
set(BALLAST_HEADER_DIR include/ballast)
set(BALLAST_DATA_DIR share/ballast)
set(BALLAST_PYTHON_DIR lib/python3/dist-packages CACHE STRING "Folder of the Python package in an installation")
file(RELATIVE_PATH BALLAST_DATA_FROM_PROGRAMS /${BALLAST_PROGRAM_DIR} /${BALLAST_DATA_DIR})
file(RELATIVE_PATH BALLAST_PROGRAMS_FROM_MODULE /${BALLAST_PYTHON_DIR}/ballast /${BALLAST_PROGRAM_DIR})
