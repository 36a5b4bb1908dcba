# SPDX-License-Identifier: GPL-2.0-only
set(module ${CMAKE_CURRENT_LIST_DIR})
add_library(advpipe SHARED
    ${module}/GivenMobility.cc ${module}/GivenStations.cc ${module}/Link.cc ${module}/NodeManager.cc
    ${module}/PatientLauncher.cc ${module}/Radios.cc ${module}/Sender.cc)
target_include_directories(advpipe PRIVATE ${module})
target_link_libraries(advpipe PUBLIC core)
set_target_properties(advpipe PROPERTIES OUTPUT_NAME artery_advpipe)

# advpipe-artery: opp_run with Artery's libraries and NED folders, and ours
_build_opp_run_command(TARGET artery OUTPUT opp_run_command NED_FOLDERS ${module})
list(JOIN opp_run_command " " opp_run_command)
file(GENERATE
    OUTPUT ${PROJECT_BINARY_DIR}/advpipe-artery
    CONTENT "#!/bin/sh\nexec ${opp_run_command} -l $<TARGET_FILE:advpipe> -u Cmdenv \"$@\"\n"
    FILE_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
