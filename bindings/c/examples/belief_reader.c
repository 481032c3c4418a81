/* Prints beliefs about complete sweeps with the names of their materials.
 *
 *   belief_reader robot.toml tactile/belief tactile/model 6        ends after six sweeps, or ten seconds without a packet */
#include <stdio.h>
#include <stdlib.h>

#include <tactnet/channel.h>
#include <tactnet/packets.h>

static const int64_t PATIENCE_NS = 10000000000;

static void check(tactnet_outcome outcome, const char *action) {
  if (outcome == TACTNET_OUTCOME_OK) return;
  fprintf(stderr, "error: %s: %s\n", action, tactnet_last_error());
  exit(1);
}

int main(int argc, char **argv) {
  if (argc != 5) {
    fprintf(stderr, "usage: belief_reader TABLE BELIEF_CHANNEL MODEL_CHANNEL SWEEPS\n");
    return 2;
  }
  const long wanted = atol(argv[4]);
  const tactnet_packet belief = {TACTNET_TACTILE_BELIEF_NAME, TACTNET_TACTILE_BELIEF_VERSION, sizeof(tactnet_tactile_belief)};
  const tactnet_packet model = {TACTNET_MODEL_NAMES_NAME, TACTNET_MODEL_NAMES_VERSION, sizeof(tactnet_model_names)};
  tactnet_bus *bus;
  tactnet_get_port *ports[2];
  tactnet_sync_group *group;
  check(tactnet_bus_open(argv[1], &bus), "bus");
  check(tactnet_get_port_open(bus, argv[2], &belief, 0, &ports[0]), "beliefs");
  check(tactnet_get_port_open(bus, argv[3], &model, 1, &ports[1]), "model"); /* the classifier puts it once, when it starts */
  check(tactnet_sync_group_open(bus, (const tactnet_get_port *const *)ports, 2, &group), "group");
  puts("ready");
  fflush(stdout);

  static tactnet_model_names names;
  long sweeps = 0;
  size_t port;
  while (sweeps < wanted && tactnet_sync_group_wait(group, PATIENCE_NS, &port) == TACTNET_OUTCOME_OK) {
    tactnet_received packet;
    if (tactnet_get(ports[port], 0, &packet) != TACTNET_OUTCOME_OK) continue;
    if (port == 1) {
      names = *(const tactnet_model_names *)packet.items;
    } else {
      const tactnet_tactile_belief *got = packet.items;
      if (got->stage == TACTNET_STAGE_PLAIN && got->label < names.materials && names.version == got->model_version) {
        printf("motion %llu: %.*s %.3f, %.0f us after its last frame\n", (unsigned long long)got->motion, (int)sizeof names.names[0],
               names.names[got->label], got->posterior[got->label], 1e-3 * (double)got->latency_ns);
        fflush(stdout);
        sweeps++;
      }
    }
    tactnet_received_release(&packet);
  }
  printf("%ld sweeps, %llu beliefs lost\n", sweeps, (unsigned long long)tactnet_get_port_lost(ports[0]));
  tactnet_sync_group_close(group);
  for (int i = 0; i < 2; i++) tactnet_get_port_close(ports[i]);
  tactnet_bus_close(bus);
  return sweeps == wanted ? 0 : 1;
}
