/* Puts the frames of a skin and the commands of a motion controller on a robot's channels. A hub must run with the same table.
 *
 *   skin_driver robot.toml skin/right sweep/command 750 < frames.txt
 *
 * Each line of the input is a frame: digits in row-major order. An empty line ends a sweep. Between two sweeps the skin rests for 200
 * frames; each object has three sweeps. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <tactnet/channel.h>
#include <tactnet/packets.h>

enum { REST = 200, SWEEPS_OF_AN_OBJECT = 3 };

static void check(tactnet_outcome outcome, const char *action) {
  if (outcome == TACTNET_OUTCOME_OK) return;
  fprintf(stderr, "error: %s: %s\n", action, tactnet_last_error());
  exit(1);
}

struct driver {
  tactnet_put_port *frames, *commands;
  uint64_t sequence, motion, next_ns, period_ns;
};

static void command(struct driver *driver, uint32_t kind) {
  tactnet_sweep_command command = {.kind = kind, .motion = driver->motion};
  check(tactnet_put(driver->commands, &command, 1), "command");
}

/* Puts a frame at its time. */
static void put(struct driver *driver, const float *digits, uint32_t taxels) {
  struct timespec due = {(time_t)(driver->next_ns / 1000000000), (long)(driver->next_ns % 1000000000)};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
  tactnet_loaned packet;
  check(tactnet_loan(driver->frames, 1, &packet), "loan");
  tactnet_skin_frame *frame = packet.items; /* in shared memory: no further copy */
  memset(frame, 0, sizeof *frame);
  frame->sequence = driver->sequence++;
  frame->sensor_time_ns = driver->next_ns; /* time of the measurement, not of the put */
  driver->next_ns += driver->period_ns;
  frame->taxels = taxels;
  memcpy(frame->digits, digits, taxels * sizeof *digits);
  check(tactnet_put_loan(driver->frames, &packet), "put");
}

int main(int argc, char **argv) {
  if (argc != 5) {
    fprintf(stderr, "usage: skin_driver TABLE SKIN_CHANNEL COMMAND_CHANNEL FRAMES_PER_SECOND < FRAMES\n");
    return 2;
  }
  tactnet_bus *bus;
  check(tactnet_bus_open(argv[1], &bus), "bus");
  const tactnet_packet frame = {TACTNET_SKIN_FRAME_NAME, TACTNET_SKIN_FRAME_VERSION, sizeof(tactnet_skin_frame)};
  const tactnet_packet sweep_command = {TACTNET_SWEEP_COMMAND_NAME, TACTNET_SWEEP_COMMAND_VERSION, sizeof(tactnet_sweep_command)};
  struct driver driver = {.period_ns = (uint64_t)(1e9 / atof(argv[4])), .next_ns = tactnet_now_ns()};
  check(tactnet_put_port_open(bus, argv[2], &frame, TACTNET_PRIORITY_HIGH, &driver.frames), "skin");
  check(tactnet_put_port_open(bus, argv[3], &sweep_command, TACTNET_PRIORITY_HIGH, &driver.commands), "commands");

  static char line[32 * TACTNET_MAX_TAXELS];
  static float digits[TACTNET_MAX_TAXELS], at_rest[TACTNET_MAX_TAXELS];
  uint32_t taxels = 0;
  int sweeping = 0;
  while (fgets(line, sizeof line, stdin)) {
    uint32_t found = 0;
    char *from = line, *to;
    for (float digit = strtof(from, &to); to != from && found < TACTNET_MAX_TAXELS; digit = strtof(from = to, &to)) digits[found++] = digit;
    if (found == 0) {
      if (sweeping) command(&driver, TACTNET_COMMAND_STOP);
      sweeping = 0;
      continue;
    }
    if (!sweeping) {
      if (taxels == 0) memcpy(at_rest, digits, sizeof digits);
      taxels = found;
      for (int i = 0; i < REST; i++) put(&driver, at_rest, taxels);
      if (driver.motion % SWEEPS_OF_AN_OBJECT == 0) command(&driver, TACTNET_COMMAND_RESET);
      driver.motion++;
      command(&driver, TACTNET_COMMAND_START);
      sweeping = 1;
    }
    put(&driver, digits, taxels);
  }
  if (sweeping) command(&driver, TACTNET_COMMAND_STOP);
  printf("%llu frames, %llu sweeps\n", (unsigned long long)driver.sequence, (unsigned long long)driver.motion);
  tactnet_put_port_close(driver.commands);
  tactnet_put_port_close(driver.frames);
  tactnet_bus_close(bus);
  return 0;
}
