/* What the library says of wrong calls, and that packets are given back. Usage: faults TABLE, with channels ping and pong of SkinFrame. */
#undef NDEBUG
#include <assert.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include <tactnet/channel.h>
#include <tactnet/packets.h>

static const tactnet_packet FRAME = {TACTNET_SKIN_FRAME_NAME, TACTNET_SKIN_FRAME_VERSION, sizeof(tactnet_skin_frame)};

static void says(tactnet_outcome found, tactnet_outcome expected, const char *words) {
  if (found != expected || !strstr(tactnet_last_error(), words)) {
    fprintf(stderr, "expected outcome %d with `%s`, found %d with `%s`\n", (int)expected, words, (int)found, tactnet_last_error());
    assert(0);
  }
}

/* Another thread's errors are its own. */
static void *has_no_error(void *nothing) {
  assert(tactnet_last_error()[0] == '\0');
  return nothing;
}

enum { THREADS = 4, PACKETS = 200 };

static void *puts_packets(void *port) {
  for (int i = 0; i < PACKETS; i++) {
    tactnet_loaned loan;
    tactnet_outcome outcome = tactnet_loan(port, 1, &loan);
    if (outcome == TACTNET_OUTCOME_HELD) { /* the others have what there is */
      i--;
      continue;
    }
    assert(outcome == TACTNET_OUTCOME_OK);
    ((tactnet_skin_frame *)loan.items)->sequence = 7;
    assert(tactnet_put_loan(port, &loan) == TACTNET_OUTCOME_OK);
  }
  return NULL;
}

/* A channel that is created at run time, priorities on it, and losses that the putter knows. */
static void channel_of_ones_own(const tactnet_bus *bus) {
  const tactnet_packet number = {"u64", 1, sizeof(uint64_t)};
  const tactnet_channel_resources resources = {.depth = 4, .put_ports = 2};
  says(tactnet_channel_create(bus, "ping", &number, &resources), TACTNET_OUTCOME_CHANNEL, "ping");
  assert(tactnet_channel_create(bus, "own/numbers", &number, &resources) == TACTNET_OUTCOME_OK);
  says(tactnet_channel_create(bus, "own/numbers", &number, &resources), TACTNET_OUTCOME_CHANNEL, "own/numbers");
  tactnet_get_port *get;
  tactnet_put_port *bulk, *urgent;
  assert(tactnet_get_port_open(bus, "own/numbers", &number, 0, &get) == TACTNET_OUTCOME_OK);
  assert(tactnet_put_port_open(bus, "own/numbers", &number, TACTNET_PRIORITY_BULK, &bulk) == TACTNET_OUTCOME_OK);
  assert(tactnet_put_port_open(bus, "own/numbers", &number, TACTNET_PRIORITY_REAL_TIME, &urgent) == TACTNET_OUTCOME_OK);
  assert(tactnet_get_port_set_priority(get, TACTNET_PRIORITY_HIGH) == TACTNET_OUTCOME_OK);
  says(tactnet_get_port_set_priority(get, 4), TACTNET_OUTCOME_ARGUMENT, "found 4");

  const uint64_t order[] = {100, 0, 1, 2};
  for (uint64_t n = 0; n < 3; n++) assert(tactnet_put(bulk, &n, 1) == TACTNET_OUTCOME_OK);
  assert(tactnet_put(urgent, &order[0], 1) == TACTNET_OUTCOME_OK);
  for (int at = 0; at < 4; at++) {
    tactnet_received received;
    assert(tactnet_get(get, 1000000000, &received) == TACTNET_OUTCOME_OK);
    assert(*(const uint64_t *)received.items == order[at]);
    assert(received.priority == (at == 0 ? TACTNET_PRIORITY_REAL_TIME : TACTNET_PRIORITY_BULK));
    tactnet_received_release(&received);
  }

  tactnet_getter_loss loss;
  assert(tactnet_put_port_losses(bulk, &loss, 1) == 0);
  for (uint64_t n = 0; n < 10; n++) assert(tactnet_put(bulk, &n, 1) == TACTNET_OUTCOME_OK);
  assert(tactnet_put_port_losses(bulk, NULL, 0) == 1 && tactnet_put_port_losses(bulk, &loss, 1) == 1);
  assert(loss.getter == tactnet_get_port_number(get) && loss.packets == tactnet_get_port_lost(get) && loss.packets > 0);
  assert(tactnet_put_port_losses(urgent, &loss, 1) == 0);
  tactnet_put_port_close(urgent);
  tactnet_put_port_close(bulk);
  tactnet_get_port_close(get);
}

int main(int argc, char **argv) {
  assert(argc == 2);
  tactnet_bus *bus;
  tactnet_put_port *put;
  tactnet_get_port *get;
  tactnet_sync_group *group;
  says(tactnet_bus_open("nowhere.toml", &bus), TACTNET_OUTCOME_TABLE, "nowhere.toml");
  assert(bus == NULL);
  says(tactnet_bus_open(NULL, &bus), TACTNET_OUTCOME_ARGUMENT, "table is null");
  says(tactnet_bus_open("\xff", &bus), TACTNET_OUTCOME_ARGUMENT, "not UTF-8");
  says(tactnet_bus_open(argv[1], NULL), TACTNET_OUTCOME_ARGUMENT, "bus is null");
  pthread_t thread;
  assert(pthread_create(&thread, NULL, has_no_error, NULL) == 0);
  pthread_join(thread, NULL);
  assert(tactnet_bus_open(argv[1], &bus) == TACTNET_OUTCOME_OK);

  const tactnet_packet older = {FRAME.name, FRAME.version - 1, FRAME.bytes}, smaller = {FRAME.name, FRAME.version, FRAME.bytes - 8};
  says(tactnet_put_port_open(bus, "nothing", &FRAME, TACTNET_PRIORITY_HIGH, &put), TACTNET_OUTCOME_CHANNEL, "the table contains ping, pong");
  says(tactnet_put_port_open(bus, "ping", &older, TACTNET_PRIORITY_HIGH, &put), TACTNET_OUTCOME_TYPE, "SkinFrame");
  says(tactnet_get_port_open(bus, "ping", &smaller, 0, &get), TACTNET_OUTCOME_TYPE, "4112");
  says(tactnet_put_port_open(bus, "ping", &FRAME, 9, &put), TACTNET_OUTCOME_ARGUMENT, "found 9");
  says(tactnet_get_port_open(bus, "ping", &FRAME, 100, &get), TACTNET_OUTCOME_TOO_LARGE, "100");
  says(tactnet_sync_group_open(bus, NULL, 0, &group), TACTNET_OUTCOME_ARGUMENT, "at least one");

  assert(tactnet_get_port_open(bus, "ping", &FRAME, 0, &get) == TACTNET_OUTCOME_OK);
  assert(tactnet_put_port_open(bus, "ping", &FRAME, TACTNET_PRIORITY_HIGH, &put) == TACTNET_OUTCOME_OK);
  static tactnet_skin_frame frames[2];
  says(tactnet_put(put, frames, 2), TACTNET_OUTCOME_TOO_LARGE, "at most 1 items in a packet, found 2");
  says(tactnet_put(put, frames, SIZE_MAX), TACTNET_OUTCOME_TOO_LARGE, "at most");
  says(tactnet_put(put, NULL, 1), TACTNET_OUTCOME_ARGUMENT, "items is null");

  tactnet_received received;
  assert(tactnet_get(get, 0, &received) == TACTNET_OUTCOME_TIMEOUT && received.items == NULL);
  const uint64_t begun = tactnet_now_ns();
  assert(tactnet_get(get, 20000000, &received) == TACTNET_OUTCOME_TIMEOUT);
  assert(tactnet_now_ns() - begun >= 19000000);
  tactnet_received_release(&received); /* nothing */

  /* More loans than there are, given back, put twice. */
  tactnet_loaned loans[64];
  size_t held = 0;
  tactnet_outcome outcome = TACTNET_OUTCOME_OK;
  while (held < 64 && (outcome = tactnet_loan(put, 1, &loans[held])) == TACTNET_OUTCOME_OK) held++;
  says(outcome, TACTNET_OUTCOME_HELD, "loaned");
  assert(held > 0 && ((size_t)loans[0].items & 63) == 0);
  while (held > 0) tactnet_loan_release(&loans[--held]);
  tactnet_loan_release(&loans[0]);
  assert(tactnet_loan(put, 1, &loans[0]) == TACTNET_OUTCOME_OK);
  memset(loans[0].items, 0, sizeof(tactnet_skin_frame));
  ((tactnet_skin_frame *)loans[0].items)->digits[1023] = 0.5f;
  assert(tactnet_put_loan(put, &loans[0]) == TACTNET_OUTCOME_OK);
  says(tactnet_put_loan(put, &loans[0]), TACTNET_OUTCOME_ARGUMENT, "already put or released");

  const tactnet_get_port *ports[1] = {get};
  size_t which = 9;
  assert(tactnet_sync_group_open(bus, ports, 1, &group) == TACTNET_OUTCOME_OK);
  assert(tactnet_sync_group_wait(group, -1, &which) == TACTNET_OUTCOME_OK && which == 0);
  assert(tactnet_get(get, 0, &received) == TACTNET_OUTCOME_OK && received.count == 1 && received.sequence == 0 && !received.remote);
  assert(((const tactnet_skin_frame *)received.items)->digits[1023] == 0.5f);
  assert(tactnet_sync_group_wait(group, 1000000, &which) == TACTNET_OUTCOME_TIMEOUT);
  tactnet_received_release(&received);
  tactnet_received_release(&received);

  /* A put-port is for any number of threads. */
  pthread_t threads[THREADS];
  for (int i = 0; i < THREADS; i++) assert(pthread_create(&threads[i], NULL, puts_packets, put) == 0);
  for (int i = 0; i < THREADS; i++) pthread_join(threads[i], NULL);
  uint64_t got = 0;
  while (tactnet_get(get, 0, &received) == TACTNET_OUTCOME_OK) {
    got++;
    tactnet_received_release(&received);
  }
  assert(got > 0 && got + tactnet_get_port_lost(get) == THREADS * PACKETS);

  channel_of_ones_own(bus);

  /* Ports outlive the bus, a group its ports. */
  tactnet_bus_close(bus);
  assert(tactnet_put(put, frames, 1) == TACTNET_OUTCOME_OK);
  tactnet_get_port_close(get);
  assert(tactnet_sync_group_wait(group, 0, &which) != TACTNET_OUTCOME_INTERNAL);
  tactnet_sync_group_close(group);
  tactnet_put_port_close(put);
  tactnet_put_port_close(NULL);
  return 0;
}
