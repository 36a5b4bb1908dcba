# SPDX-License-Identifier: GPL-2.0-only
# Adds advpipe's module to Artery's project once all of Artery's targets exist.
cmake_language(EVAL CODE "
    cmake_language(DEFER CALL add_subdirectory [[${CMAKE_CURRENT_LIST_DIR}]] [[${CMAKE_BINARY_DIR}/advpipe]])
")
