/* Prints packets of known values as bytes, as packet_bytes.rs does. */
#include <stdio.h>
#include <string.h>

#include <tactnet/packets.h>

static void print(const char *name, const void *packet, size_t bytes) {
  printf("%s %zu ", name, bytes);
  for (size_t i = 0; i < bytes; i++) printf("%02x", ((const unsigned char *)packet)[i]);
  putchar('\n');
}

int main(void) {
  static tactnet_skin_frame frame = {.sequence = 1, .sensor_time_ns = 0x0102030405060708u, .taxels = 2, .digits = {1.5f, -0.25f}};
  frame.digits[TACTNET_MAX_TAXELS - 1] = 3.0f;
  print("SkinFrame", &frame, sizeof frame);
  const tactnet_sweep_command command = {.kind = TACTNET_COMMAND_ENROLL, .finger = 1, .motion = 9, .sweeps = 3, .material = "gr\xc3\xbcner Filz"};
  print("SweepCommand", &command, sizeof command);
  tactnet_tactile_belief belief = {.sweep = 1, .motion = 2, .model_version = 3, .last_frame = 4, .latency_ns = 5};
  belief.stage = TACTNET_STAGE_DROPOUT, belief.finger = 6, belief.frames = 7, belief.filled_in = 8, belief.materials = 2, belief.label = 1;
  belief.verdict = TACTNET_VERDICT_UNKNOWN, belief.entropy = 0.5f, belief.strangeness = 0.75f, belief.threshold = 1.25f;
  belief.fused_sweeps = 9, belief.fused_label = 1, belief.fused_entropy = 2.5f, belief.fused_verdict = TACTNET_VERDICT_KNOWN;
  belief.posterior[1] = 1.0f, belief.fused[TACTNET_MAX_MATERIALS - 1] = 1.0f;
  print("TactileBelief", &belief, sizeof belief);
  tactnet_tactile_status status = {.event = TACTNET_EVENT_UNREACHABLE, .finger = 1, .sweep = 2, .motion = 3, .model_version = 4, .text = "one line"};
  status.counters.frames = 5, status.counters.worst_delay_ns = 6, status.counters.allocations = 7;
  print("TactileStatus", &status, sizeof status);
  static tactnet_model_names names = {.version = 1, .sample_rate_hz = 750.0, .steps = 1000, .rows = 4, .cols = 4, .mc_samples = 50, .materials = 2};
  strcpy(names.names[0], "felt");
  strcpy(names.names[1], "cork");
  print("ModelNames", &names, sizeof names);
  return 0;
}
