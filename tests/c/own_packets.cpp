// Passes one packet of channel_packets' arm.toml from channel `middle` to channel `out`, with 1 added to the time. Usage: own_packets TABLE
#include <cstdio>

#include <tactnet/channel.hpp>

#include "arm_packets.hpp"

int main(int argc, char **argv) {
  if (argc != 2) return 2;
  tactnet::bus bus(argv[1]);
  auto get = bus.get_port<arm_arm_state>("middle");
  auto put = bus.put_port<arm_arm_state>("out");
  std::puts("ready");
  std::fflush(stdout);
  auto state = get.get(std::chrono::seconds(20));
  if (!state) return 1;
  auto loan = put.loan();
  *loan = **state;
  loan->time_ns += 1;
  put.put(std::move(loan));
  return 0;
}
