# Defines the targets tactnet::channel (shared) and tactnet::channel_static for the headers <tactnet/channel.h>, <tactnet/channel.hpp>,
# <tactnet/packets.h>:
#
#   find_package(tactnet_channel REQUIRED)
#   target_link_libraries(skin_driver PRIVATE tactnet::channel)

get_filename_component(_tactnet_prefix "${CMAKE_CURRENT_LIST_DIR}/../../.." ABSOLUTE)
find_package(Threads REQUIRED)

if(NOT TARGET tactnet::channel)
  add_library(tactnet::channel SHARED IMPORTED)
  set_target_properties(tactnet::channel PROPERTIES
    IMPORTED_LOCATION "${_tactnet_prefix}/lib/libtactnet_channel.so"
    IMPORTED_SONAME "libtactnet_channel.so.0"
    INTERFACE_INCLUDE_DIRECTORIES "${_tactnet_prefix}/include")
  add_library(tactnet::channel_static STATIC IMPORTED)
  set_target_properties(tactnet::channel_static PROPERTIES
    IMPORTED_LOCATION "${_tactnet_prefix}/lib/libtactnet_channel.a"
    INTERFACE_INCLUDE_DIRECTORIES "${_tactnet_prefix}/include"
    INTERFACE_LINK_LIBRARIES "Threads::Threads;m;${CMAKE_DL_LIBS};gcc_s")
endif()

set(tactnet_channel_FOUND TRUE)
unset(_tactnet_prefix)
