// Names and versions of packets for templates. Generated from serving/skin/src/packets.rs; do not edit.
#ifndef TACTNET_PACKETS_HPP
#define TACTNET_PACKETS_HPP

#include <cstdint>

#include "packets.h"

namespace tactnet {

/// Name and version of a packet; to be specialised for packets of one's own.
template <class T>
struct packet_traits;

template <>
struct packet_traits<tactnet_skin_frame> {
  static constexpr const char *name = TACTNET_SKIN_FRAME_NAME;
  static constexpr std::uint32_t version = TACTNET_SKIN_FRAME_VERSION;
};

template <>
struct packet_traits<tactnet_sweep_command> {
  static constexpr const char *name = TACTNET_SWEEP_COMMAND_NAME;
  static constexpr std::uint32_t version = TACTNET_SWEEP_COMMAND_VERSION;
};

template <>
struct packet_traits<tactnet_tactile_belief> {
  static constexpr const char *name = TACTNET_TACTILE_BELIEF_NAME;
  static constexpr std::uint32_t version = TACTNET_TACTILE_BELIEF_VERSION;
};

template <>
struct packet_traits<tactnet_tactile_status> {
  static constexpr const char *name = TACTNET_TACTILE_STATUS_NAME;
  static constexpr std::uint32_t version = TACTNET_TACTILE_STATUS_VERSION;
};

template <>
struct packet_traits<tactnet_model_names> {
  static constexpr const char *name = TACTNET_MODEL_NAMES_NAME;
  static constexpr std::uint32_t version = TACTNET_MODEL_NAMES_VERSION;
};

} // namespace tactnet

#endif
