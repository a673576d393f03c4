# The yardstick is a library of its own file: it alone is compiled for the machine it runs on.
include_guard(GLOBAL)
find_package(embree 3 CONFIG REQUIRED)
ivis_library(yardstick ${CMAKE_CURRENT_LIST_DIR}/yardstick.cpp)
target_compile_options(ivis_yardstick PRIVATE -O3 -march=native)
target_link_libraries(ivis_yardstick PUBLIC ivis::core ivis::scenes PRIVATE embree)
