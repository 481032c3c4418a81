/* Measures round trips of one skin frame between two processes, as round_trip.rs does.
 *
 *   round_trip TABLE pong &  round_trip TABLE ping ROUNDS        prints nanoseconds: median and 99th percentile */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <tactnet/channel.h>
#include <tactnet/packets.h>

static void check(tactnet_outcome outcome) {
  if (outcome == TACTNET_OUTCOME_OK) return;
  fprintf(stderr, "error: %s\n", tactnet_last_error());
  exit(1);
}

static int by_size(const void *a, const void *b) {
  const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
  return (x > y) - (x < y);
}

/* Sends a frame, written in place. */
static void put(const tactnet_put_port *port, uint64_t sequence) {
  tactnet_loaned loan;
  check(tactnet_loan(port, 1, &loan));
  tactnet_skin_frame *frame = loan.items;
  frame->sequence = sequence;
  frame->taxels = 16;
  check(tactnet_put_loan(port, &loan));
}

/* Polls for the next frame and returns its sequence number. */
static uint64_t get(tactnet_get_port *port) {
  tactnet_received received;
  tactnet_outcome outcome;
  while ((outcome = tactnet_get(port, 0, &received)) == TACTNET_OUTCOME_TIMEOUT) {
  }
  check(outcome);
  const uint64_t sequence = ((const tactnet_skin_frame *)received.items)->sequence;
  tactnet_received_release(&received);
  return sequence;
}

int main(int argc, char **argv) {
  if (argc < 3) return 2;
  const int ping = strcmp(argv[2], "ping") == 0;
  const tactnet_packet frame = {TACTNET_SKIN_FRAME_NAME, TACTNET_SKIN_FRAME_VERSION, sizeof(tactnet_skin_frame)};
  tactnet_bus *bus;
  tactnet_put_port *out;
  tactnet_get_port *in;
  check(tactnet_bus_open(argv[1], &bus));
  check(tactnet_get_port_open(bus, ping ? "pong" : "ping", &frame, 0, &in));
  check(tactnet_put_port_open(bus, ping ? "ping" : "pong", &frame, TACTNET_PRIORITY_REAL_TIME, &out));
  if (!ping) {
    puts("ready");
    fflush(stdout);
    for (uint64_t sequence; (sequence = get(in)) != UINT64_MAX;) put(out, sequence);
  } else {
    const size_t rounds = strtoul(argv[3], NULL, 10);
    uint64_t *took = malloc(rounds * sizeof *took);
    for (size_t round = 0; round < rounds + 1000; round++) {
      const uint64_t begun = tactnet_now_ns();
      put(out, round);
      if (get(in) != round) return 1;
      if (round >= 1000) took[round - 1000] = tactnet_now_ns() - begun;
    }
    put(out, UINT64_MAX);
    qsort(took, rounds, sizeof *took, by_size);
    printf("%llu %llu\n", (unsigned long long)took[rounds / 2], (unsigned long long)took[rounds * 99 / 100]);
    free(took);
  }
  tactnet_put_port_close(out);
  tactnet_get_port_close(in);
  tactnet_bus_close(bus);
  return 0;
}
