# palpate_module(NAME SOURCES a.cpp ... PUBLIC libs ... PRIVATE libs ...)
# A library palpate::NAME from modules/NAME, with its public headers under include/.
function(palpate_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;PUBLIC;PRIVATE" ${ARGN})
  add_library(palpate_${name} STATIC ${ARG_SOURCES})
  add_library(palpate::${name} ALIAS palpate_${name})
  target_include_directories(palpate_${name} PUBLIC include PRIVATE src)
  target_link_libraries(palpate_${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE} palpate_warnings)
endfunction()

# palpate_test(NAME LABEL label SOURCES a.cpp ... LIBS libs ...)
# A GoogleTest program, one ctest entry a test, under the given label
# (unit, kernels, pipeline, render, gui, rules).
function(palpate_test name)
  cmake_parse_arguments(ARG "" "LABEL;TIMEOUT" "SOURCES;LIBS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 300)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LIBS} palpate_test_support palpate_warnings)
  gtest_discover_tests(${name}
    DISCOVERY_MODE PRE_TEST
    NO_PRETTY_VALUES NO_PRETTY_TYPES
    DISCOVERY_TIMEOUT 60
    TEST_PREFIX "${ARG_LABEL}/"
    PROPERTIES LABELS "${ARG_LABEL}" TIMEOUT ${ARG_TIMEOUT}
      ENVIRONMENT "PALPATE_TEST_DATA=${PALPATE_TEST_DATA}")
endfunction()
