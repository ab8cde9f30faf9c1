# The Unity test framework as the target unity::framework, tried in this order:
#   1. an installed package (find_package)
#   2. -DUNITY_ROOT=DIR or the environment's UNITY_ROOT: a folder that holds unity.c, or Unity's source tree
#   3. release v2.6.1 from its home (FetchContent, checksum held)

if(TARGET unity::framework)
    return()
endif()
find_package(unity QUIET)
if(TARGET unity::framework)
    message(STATUS "Unity: installed package")
    return()
endif()

if(NOT UNITY_ROOT AND DEFINED ENV{UNITY_ROOT})
    set(UNITY_ROOT $ENV{UNITY_ROOT})
endif()
if(NOT UNITY_ROOT AND EXISTS ${PROJECT_SOURCE_DIR}/build/unity/src/unity.c)
    set(UNITY_ROOT ${PROJECT_SOURCE_DIR}/build/unity) # where script/setup puts it
endif()
if(UNITY_ROOT)
    find_path(UNITY_SOURCE_DIR unity.c PATHS ${UNITY_ROOT} ${UNITY_ROOT}/src NO_DEFAULT_PATH NO_CACHE)
    if(NOT UNITY_SOURCE_DIR)
        message(FATAL_ERROR "UNITY_ROOT=${UNITY_ROOT} holds no unity.c, nor does ${UNITY_ROOT}/src")
    endif()
else()
    include(FetchContent)
    FetchContent_Declare(unity
        URL https://github.com/ThrowTheSwitch/Unity/archive/refs/tags/v2.6.1.tar.gz
        URL_HASH SHA256=b41a66d45a6b99758fb3202ace6178177014d52fc524bf1f72687d93e9867292)
    FetchContent_GetProperties(unity)
    if(NOT unity_POPULATED)
        FetchContent_Populate(unity)
    endif()
    set(UNITY_SOURCE_DIR ${unity_SOURCE_DIR}/src)
endif()
message(STATUS "Unity: ${UNITY_SOURCE_DIR}")
set(NINESPRING_UNITY_SOURCE_DIR ${UNITY_SOURCE_DIR} CACHE INTERNAL "where unity.c is")
add_library(ninespring_unity STATIC ${UNITY_SOURCE_DIR}/unity.c)
target_compile_options(ninespring_unity PRIVATE -w) # not our code
target_include_directories(ninespring_unity SYSTEM PUBLIC ${UNITY_SOURCE_DIR})
target_compile_definitions(ninespring_unity PUBLIC UNITY_INCLUDE_DOUBLE UNITY_DOUBLE_PRECISION=1e-12)
add_library(unity::framework ALIAS ninespring_unity)
