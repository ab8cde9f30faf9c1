# How every target of the project is declared: same warnings, same options, one line a library.

option(NINESPRING_SANITIZE "Build with address and undefined-behaviour sanitizers" OFF)
option(NINESPRING_COVERAGE "Build with coverage counters" OFF)
option(NINESPRING_WERROR "Treat warnings as errors" ON)

add_library(ninespring_options INTERFACE)
target_compile_options(ninespring_options INTERFACE
    -Wall -Wextra -Wconversion -Wsign-conversion -Wshadow
    $<$<BOOL:${NINESPRING_WERROR}>:-Werror>
    $<$<NOT:$<STREQUAL:${CMAKE_SYSTEM_PROCESSOR},avr>>:-Wdouble-promotion>
    $<$<COMPILE_LANGUAGE:C>:-Wstrict-prototypes -Wmissing-prototypes>)
if(NINESPRING_SANITIZE)
    # float-cast-overflow is named: to GCC it is no part of `undefined`, and an infinite time cast to an integer passed unseen.
    set(sanitizers -fsanitize=address,undefined,float-cast-overflow)
    target_compile_options(ninespring_options INTERFACE
        ${sanitizers} -fno-sanitize-recover=all -fno-omit-frame-pointer
        -Wno-conversion) # GCC takes a cast that it checks for an int; every other build has this warning
    target_link_options(ninespring_options INTERFACE ${sanitizers})
endif()
if(NINESPRING_COVERAGE)
    target_compile_options(ninespring_options INTERFACE --coverage)
    target_link_options(ninespring_options INTERFACE --coverage)
endif()

# ninespring_compile_quickly(SOURCES...)
# Of a long program that reads arguments and writes JSON, once a run: to optimise what those headers hold took half of its time.
function(ninespring_compile_quickly)
    set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS -O0)
endfunction()

# ninespring_add_library(NAME SOURCES... [DEPENDS other...])
# One portable library of lib/: C99, headers beside its sources.
function(ninespring_add_library name)
    cmake_parse_arguments(ARG "" "" "SOURCES;DEPENDS" ${ARGN})
    add_library(${name} STATIC ${ARG_SOURCES})
    target_include_directories(${name} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
    target_link_libraries(${name} PUBLIC ${ARG_DEPENDS} PRIVATE ninespring_options)
endfunction()

# ninespring_add_unity_test(NAME SOURCES... DEPENDS lib... [LABELS label...])
# A Unity test that ctest runs. Call it from test/<name>/CMakeLists.txt.
function(ninespring_add_unity_test name)
    cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;DEPENDS;LABELS" ${ARGN})
    add_executable(${name} ${ARG_SOURCES})
    target_link_libraries(${name} PRIVATE ${ARG_DEPENDS} run_tests ninespring_options)
    add_test(NAME ${name} COMMAND ${name})
    if(ARG_LABELS)
        set_tests_properties(${name} PROPERTIES LABELS "${ARG_LABELS}")
    endif()
    if(ARG_TIMEOUT)
        set_tests_properties(${name} PROPERTIES TIMEOUT ${ARG_TIMEOUT})
    endif()
endfunction()

# Adds every subdirectory of the current one that has a CMakeLists.txt, in name order.
function(ninespring_add_subdirectories)
    file(GLOB listings CONFIGURE_DEPENDS */CMakeLists.txt)
    list(SORT listings)
    foreach(listing IN LISTS listings)
        cmake_path(GET listing PARENT_PATH directory)
        cmake_path(GET directory FILENAME name)
        if(NOT name IN_LIST ARGN) # names given as arguments are left out
            add_subdirectory(${name})
        endif()
    endforeach()
endfunction()
