# Runs pytest where the package is installed; says loudly where it is not.
execute_process(COMMAND ${PYTHON} -c "import importlib.util as u, sys; sys.exit(not all(map(u.find_spec, ('ninespring', 'pytest'))))"
                RESULT_VARIABLE missing OUTPUT_QUIET ERROR_QUIET)
if(missing)
    message(STATUS "SKIPPED: ninespring is not installed for ${PYTHON}: run script/setup")
    return()
endif()
# Plugins that are installed with other packages are imported for every process, Hypothesis's with all of it: a second of each.
execute_process(COMMAND ${PYTHON} -m pytest -q -rs -p no:cacheprovider -p no:hypothesispytest -p no:anyio -m "${WHICH}" ${FILES}
                RESULT_VARIABLE failed)
if(failed)
    message(FATAL_ERROR "pytest failed")
endif()
