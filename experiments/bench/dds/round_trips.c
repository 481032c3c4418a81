// Round trips of Cyclone DDS over its shared memory, in packets loaned from it, so without copies; ddsperf's ping does not use it.
//
//     round_trips client SIZE             answers every packet until it is killed
//     round_trips master SIZE SECONDS     prints the median and the 99th percentile in us, and the number of round trips
//
// As in ddsperf, listeners answer, so that no second thread has to wake up. Reliable, keep-last 1.

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "dds/dds.h"
#include "dds/ddsc/dds_loan_api.h"
#include "packets.h"

enum { WARM_UP = 100, MOST = 1000000 };

static bool is_master;
static dds_entity_t writer;
static volatile bool stopped;
static volatile size_t count;
static int64_t begun, trips[MOST];

static void check(const char *what, dds_return_t code) {
  if (code < 0) {
    fprintf(stderr, "%s: %s\n", what, dds_strretcode(code));
    exit(1);
  }
}

static int64_t now(void) {
  struct timespec time;
  clock_gettime(CLOCK_MONOTONIC, &time);
  return time.tv_sec * INT64_C(1000000000) + time.tv_nsec;
}

// Sends a packet and writes only its first word.
static void put(uint32_t round) {
  void *packet = NULL;
  begun = now();
  check("loan", dds_loan_sample(writer, &packet));
  memcpy(packet, &round, sizeof round);
  check("write", dds_write(writer, packet));
}

static void on_data(dds_entity_t reader, void *argument) {
  (void)argument;
  void *packet = NULL;
  dds_sample_info_t info;
  dds_return_t taken;
  while ((taken = dds_take(reader, &packet, &info, 1, 1)) > 0) {
    uint32_t round = 0;
    if (info.valid_data)
      memcpy(&round, packet, sizeof round);
    dds_return_loan(reader, &packet, taken);
    packet = NULL;
    if (!info.valid_data || stopped)
      continue;
    if (is_master && round == count && count < MOST) {
      trips[count++] = now() - begun;
      round = (uint32_t)count;
    }
    put(round);
  }
}

static int by_value(const void *a, const void *b) {
  int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
  return (x > y) - (x < y);
}

int main(int argc, char **argv) {
  is_master = argc == 4 && strcmp(argv[1], "master") == 0;
  size_t size = argc > 2 ? strtoul(argv[2], NULL, 10) : 0;
  const dds_topic_descriptor_t *type = size == sizeof(packets_Small)    ? &packets_Small_desc
                                       : size == sizeof(packets_Medium) ? &packets_Medium_desc
                                       : size == sizeof(packets_Large)  ? &packets_Large_desc
                                                                        : NULL;
  if (!type || (!is_master && argc != 3)) {
    fprintf(stderr, "expected `client SIZE` or `master SIZE SECONDS`, with a size of 4, 65536 or 1048576\n");
    return 2;
  }
  dds_entity_t participant = dds_create_participant(DDS_DOMAIN_DEFAULT, NULL, NULL);
  check("participant", participant);
  dds_qos_t *qos = dds_create_qos();
  dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
  dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 1);
  const char *names[] = {"there", "back"};
  dds_entity_t put_topic = dds_create_topic(participant, type, names[!is_master], qos, NULL);
  dds_entity_t get_topic = dds_create_topic(participant, type, names[is_master], qos, NULL);
  check("topic", put_topic);
  check("topic", get_topic);
  writer = dds_create_writer(participant, put_topic, qos, NULL);
  check("writer", writer);
  if (!dds_is_loan_available(writer)) {
    fprintf(stderr, "no shared memory: is iox-roudi running, and SharedMemory/Enable true?\n");
    return 1;
  }
  dds_listener_t *listener = dds_create_listener(NULL);
  dds_lset_data_available(listener, on_data);
  dds_entity_t reader = dds_create_reader(participant, get_topic, qos, listener);
  check("reader", reader);
  if (!is_master)
    for (;;)
      dds_sleepfor(DDS_SECS(1));

  for (dds_publication_matched_status_t matched = {0}; matched.current_count == 0; dds_sleepfor(DDS_MSECS(10)))
    check("match", dds_get_publication_matched_status(writer, &matched));
  // The client has to know both ends, too.
  dds_sleepfor(DDS_MSECS(500));
  put(0);
  dds_sleepfor((dds_duration_t)(strtod(argv[3], NULL) * 1e9));
  stopped = true;
  dds_sleepfor(DDS_MSECS(50));
  if (count <= 2 * WARM_UP) {
    fprintf(stderr, "only %zu round trips\n", (size_t)count);
    return 1;
  }
  size_t measured = count - WARM_UP;
  qsort(trips + WARM_UP, measured, sizeof *trips, by_value);
  printf("%.3f %.3f %zu\n", trips[WARM_UP + measured / 2] / 1e3, trips[WARM_UP + measured * 99 / 100] / 1e3, measured);
  fflush(stdout);
  _Exit(0);
}
