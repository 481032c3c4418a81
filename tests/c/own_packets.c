/* Gets one packet of channel_packets' arm.toml from channel `in`, adds 1 to all it knows, and puts it into channel `middle`. Usage: own_packets TABLE */
#undef NDEBUG
#include <assert.h>
#include <stdio.h>
#include <string.h>

#include <tactnet/channel.h>

#include "arm_packets.h"

static const tactnet_packet STATE = {ARM_ARM_STATE_NAME, ARM_ARM_STATE_VERSION, sizeof(arm_arm_state)};

int main(int argc, char **argv) {
  assert(argc == 2);
  tactnet_bus *bus;
  tactnet_put_port *put;
  tactnet_get_port *get;
  assert(tactnet_bus_open(argv[1], &bus) == TACTNET_OUTCOME_OK);
  assert(tactnet_get_port_open(bus, "in", &STATE, 0, &get) == TACTNET_OUTCOME_OK);
  assert(tactnet_put_port_open(bus, "middle", &STATE, TACTNET_PRIORITY_NORMAL, &put) == TACTNET_OUTCOME_OK);
  /* Another version of the packet is refused. */
  const tactnet_packet older = {STATE.name, STATE.version - 1, STATE.bytes};
  tactnet_get_port *refused;
  assert(tactnet_get_port_open(bus, "in", &older, 0, &refused) == TACTNET_OUTCOME_TYPE);
  puts("ready");
  fflush(stdout);
  tactnet_received received;
  assert(tactnet_get(get, 20000000000, &received) == TACTNET_OUTCOME_OK && received.count == 1);
  arm_arm_state state = *(const arm_arm_state *)received.items;
  tactnet_received_release(&received);
  assert(state.mode == ARM_MODE_MOVING && state.contacts == 1 && strcmp(state.tool, "gripper") == 0);
  state.time_ns += 1;
  for (int joint = 0; joint < ARM_JOINTS; joint++) state.joints[joint].position += 1;
  state.hand.rotation[2][1] += 1;
  state.contact_points[0][1].z += 1;
  state.grid[1][2][3] = (int16_t)(state.grid[1][2][3] + 1);
  memcpy(state.tags[1], "C", 2);
  assert(tactnet_put(put, &state, 1) == TACTNET_OUTCOME_OK);
  tactnet_put_port_close(put);
  tactnet_get_port_close(get);
  tactnet_bus_close(bus);
  return 0;
}
