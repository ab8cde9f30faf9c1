# Runs pytest where the package is installed; says loudly where it is not.
execute_process(COMMAND ${PYTHON} -c "import ninespring.model.native as n, pytest; n.library()"
                RESULT_VARIABLE missing OUTPUT_QUIET ERROR_QUIET)
if(missing)
    message(STATUS "SKIPPED: ninespring is not installed for ${PYTHON}: run script/setup")
    return()
endif()
execute_process(COMMAND ${PYTHON} -m pytest -q -rs -p no:cacheprovider -m "${WHICH}" ${FILE} RESULT_VARIABLE failed)
if(failed)
    message(FATAL_ERROR "pytest failed")
endif()
