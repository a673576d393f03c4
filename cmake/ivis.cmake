# What every ivis target shares. No global flags: own code gets them by ivis_target().

find_program(IVIS_CCACHE ccache)
if(IVIS_CCACHE)
  set(CMAKE_C_COMPILER_LAUNCHER ${IVIS_CCACHE})
  set(CMAKE_CXX_COMPILER_LAUNCHER ${IVIS_CCACHE})
endif()

find_package(glm REQUIRED)

# Warnings, sanitizers and include root of own code.
function(ivis_target target)
  target_include_directories(${target} PUBLIC $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}>)
  target_compile_options(${target} PRIVATE
    -Wall -Wextra -Wpedantic -Wshadow
    $<$<CXX_COMPILER_ID:GNU>:-Wno-restrict>  # false alarms of gcc 12 on std::string
    $<$<COMPILE_LANGUAGE:CXX>:-Wconversion>
    $<$<BOOL:${IVIS_WARNINGS_AS_ERRORS}>:-Werror>
    -ffp-contract=off)  # the same bits from every SIMD target
  if(IVIS_SANITIZE)
    target_compile_options(${target} PRIVATE -fsanitize=${IVIS_SANITIZE} -fno-omit-frame-pointer
      -fno-sanitize-recover=all -O1
      -g1 $<$<CXX_COMPILER_ID:GNU>:-fno-var-tracking> $<$<CXX_COMPILER_ID:GNU>:-fno-var-tracking-assignments>)  # lines in reports; full -g takes gcc twice as long
    target_link_options(${target} PUBLIC -fsanitize=${IVIS_SANITIZE})
  endif()
endfunction()

# ivis_library(name SOURCES... ): static library ivis_<name>, alias ivis::<name>.
function(ivis_library name)
  add_library(ivis_${name} STATIC ${ARGN})
  add_library(ivis::${name} ALIAS ivis_${name})
  set_target_properties(ivis_${name} PROPERTIES EXPORT_NAME ${name})
  ivis_target(ivis_${name})
endfunction()

# ivis_test(name [SLOW] [TIMEOUT s] SOURCES ... LIBS ...): one GoogleTest binary; label fast or slow.
function(ivis_test name)
  cmake_parse_arguments(T "SLOW" "TIMEOUT" "SOURCES;LIBS" ${ARGN})
  if(NOT T_TIMEOUT)
    set(T_TIMEOUT 120)
  endif()
  set(label fast)
  if(T_SLOW)
    set(label slow)
  endif()
  add_executable(${name} ${T_SOURCES})
  ivis_target(${name})
  target_link_libraries(${name} PRIVATE ${T_LIBS} ivis::test_support GTest::gtest GTest::gmock GTest::gtest_main)
  gtest_discover_tests(${name} DISCOVERY_MODE PRE_TEST
    PROPERTIES LABELS ${label} TIMEOUT ${T_TIMEOUT})
endfunction()
