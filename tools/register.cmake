# Included by the CMakeLists.txt of each Python package, for `colcon build` in a sourced Jazzy. `./env` does not
# use it: see tools/register.py.
find_package(ament_cmake REQUIRED)
find_package(ament_cmake_python REQUIRED)
find_package(Python3 REQUIRED COMPONENTS Interpreter)

execute_process(
  COMMAND "${Python3_EXECUTABLE}" "${CMAKE_CURRENT_LIST_DIR}/register.py" --setup-cfg "${PROJECT_NAME}"
  OUTPUT_FILE "${CMAKE_CURRENT_BINARY_DIR}/setup.cfg" COMMAND_ERROR_IS_FATAL ANY)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${CMAKE_CURRENT_LIST_DIR}/../pyproject.toml")
ament_python_install_package(${PROJECT_NAME}
  PACKAGE_DIR "${CMAKE_CURRENT_SOURCE_DIR}/${PROJECT_NAME}"
  SETUP_CFG "${CMAKE_CURRENT_BINARY_DIR}/setup.cfg" SCRIPTS_DESTINATION "lib/${PROJECT_NAME}")
foreach(folder IN ITEMS launch config)
  if(EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/${folder}")
    install(DIRECTORY "${folder}" DESTINATION "share/${PROJECT_NAME}")
  endif()
endforeach()
ament_package()
