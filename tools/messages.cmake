# Included by the message packages, after find_package(rosidl_default_generators).

# What Python nodes on Fast DDS use takes half the time to make. C++ nodes and other middleware need all of it.
option(PYTHON_ONLY "Build the messages for Python nodes on Fast DDS alone" OFF)
if(PYTHON_ONLY)
  list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "_cpp")
endif()

# generate_messages(FILES... DEPENDENCIES packages...): as rosidl_generate_interfaces, faster.
macro(generate_messages)
  set(sources ${ARGN})
  if(PYTHON_ONLY)
    # Each generator parses each file anew, and most of the time goes into comments.
    set(sources "")
    foreach(source IN ITEMS ${ARGN})
      if(source MATCHES "\\.(msg|srv|action)$")
        file(READ "${CMAKE_CURRENT_SOURCE_DIR}/${source}" text)
        string(REGEX REPLACE "[ \t]*#[^\n]*" "" text "${text}")
        file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/bare/${source}" "${text}")
        list(APPEND sources "${CMAKE_CURRENT_BINARY_DIR}/bare:${source}")
        set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/${source}")
      else()
        list(APPEND sources "${source}")
      endif()
    endforeach()
  endif()
  rosidl_generate_interfaces(${PROJECT_NAME} ${sources})
  if(PYTHON_ONLY) # recordings state the definitions with their comments
    foreach(folder IN ITEMS msg srv action)
      if(EXISTS "${CMAKE_CURRENT_SOURCE_DIR}/${folder}")
        install(DIRECTORY "${folder}" DESTINATION "share/${PROJECT_NAME}")
      endif()
    endforeach()
  endif()

  # The sources of a kind are compiled as one, as most of the time goes into the headers that all of them
  # include. Those of introspection_cpp cannot be: some use a type before another one specializes it.
  foreach(kind IN ITEMS c cpp introspection_c fastrtps_c fastrtps_cpp)
    if(TARGET ${PROJECT_NAME}__rosidl_typesupport_${kind})
      set_target_properties(${PROJECT_NAME}__rosidl_typesupport_${kind}
        PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
    endif()
  endforeach()
  foreach(target IN ITEMS ${PROJECT_NAME}__rosidl_generator_py ${PROJECT_NAME}__rosidl_generator_c)
    if(TARGET ${target})
      set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
      get_target_property(sources ${target} SOURCES)
      list(FILTER sources INCLUDE REGEX "__description\\.c$") # all have variables of the same names
      set_source_files_properties(${sources} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    endif()
  endforeach()
endmacro()
