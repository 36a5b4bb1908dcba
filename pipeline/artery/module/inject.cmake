# SPDX-License-Identifier: GPL-2.0-only
#
# Builds advpipe's module inside Artery's build, without a change of its sources:
#   cmake -DCMAKE_PROJECT_Artery_INCLUDE=<this file> <Artery>
# targets.cmake is read after all of Artery's targets exist.
cmake_language(EVAL CODE "cmake_language(DEFER CALL include [[${CMAKE_CURRENT_LIST_DIR}/targets.cmake]])")
