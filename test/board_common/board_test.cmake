# ninespring_add_board_test(NAME SOURCES... [DEPENDS lib...] [LABELS label...] [TIMEOUT s])
# A test that runs the firmware's ELF in the simulated Mega. Without avr-gcc or libsimavr it is still listed, and ctest
# reports it as skipped.
function(ninespring_add_board_test name)
    cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;DEPENDS;LABELS" ${ARGN})
    if(TARGET sim_board AND AVR_GCC)
        ninespring_add_unity_test(${name} SOURCES ${ARG_SOURCES} DEPENDS sim_board ${ARG_DEPENDS})
        target_include_directories(${name} PRIVATE ${PROJECT_SOURCE_DIR}/test/board_common)
        target_compile_definitions(${name} PRIVATE
            NINESPRING_AVR_DIR="${NINESPRING_AVR_DIR}" NINESPRING_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
    else()
        add_test(NAME ${name} COMMAND ${CMAKE_COMMAND} -E echo
            "SKIPPED: ${name} needs avr-gcc and libsimavr: apt-get install gcc-avr avr-libc libsimavr-dev libelf-dev")
        set_tests_properties(${name} PROPERTIES SKIP_REGULAR_EXPRESSION "SKIPPED")
    endif()
    if(NOT ARG_TIMEOUT)
        set(ARG_TIMEOUT 300)
    endif()
    set_tests_properties(${name} PROPERTIES LABELS "board;${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT}
        SKIP_RETURN_CODE 77)
endfunction()
