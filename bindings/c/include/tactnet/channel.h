/*
 * The robot's channels for C11: put and get packets between processes of a host without copies, and through the hub to other hosts.
 *
 * Every function that can fail returns a tactnet_outcome; tactnet_last_error() has the text, for each thread its own.
 *
 * Threads: a bus and a put-port are for any number of threads at once. A get-port and a sync group are for one thread at a time. A packet
 * that is loaned or received is given back by the thread that has it. Nothing here starts a thread.
 *
 * Real time: once ports are connected, tactnet_loan, tactnet_put, tactnet_put_loan, tactnet_get and tactnet_sync_group_wait neither allocate
 * nor lock on success, and sleep only where a timeout asks for it.
 *
 * Linux 5.16 or newer; packets are little endian.
 */

#ifndef TACTNET_CHANNEL_H
#define TACTNET_CHANNEL_H

/* Generated from bindings/c/src by `cargo run -p tactnet-c --example header`; do not edit. */

#include <stddef.h>
#include <stdint.h>

/**
 * 64-bit words of a loan that belong to the library.
 */
#define TACTNET_LOAN_WORDS 16

/**
 * 64-bit words of a received packet that belong to the library.
 */
#define TACTNET_RECEIVED_WORDS 24

/**
 * How a function ended; `tactnet_last_error` gives the text of one that failed.
 */
typedef enum {
  /**
   * It did what was asked.
   */
  TACTNET_OUTCOME_OK = 0,
  /**
   * No packet came in time.
   */
  TACTNET_OUTCOME_TIMEOUT = 1,
  /**
   * An argument is null, no UTF-8, or was given back before.
   */
  TACTNET_OUTCOME_ARGUMENT = 2,
  /**
   * The table cannot be read or used.
   */
  TACTNET_OUTCOME_TABLE = 3,
  /**
   * The table has no such channel.
   */
  TACTNET_OUTCOME_CHANNEL = 4,
  /**
   * No hub of this bus runs on this host.
   */
  TACTNET_OUTCOME_NO_HUB = 5,
  /**
   * The channel carries other packets.
   */
  TACTNET_OUTCOME_TYPE = 6,
  /**
   * All ports of the channel are taken.
   */
  TACTNET_OUTCOME_FULL = 7,
  /**
   * The packet holds more items than the channel's do, or more history was asked for than it keeps.
   */
  TACTNET_OUTCOME_TOO_LARGE = 8,
  /**
   * Too many packets are on loan or held at this port.
   */
  TACTNET_OUTCOME_HELD = 9,
  /**
   * Shared memory is short.
   */
  TACTNET_OUTCOME_MEMORY = 10,
  /**
   * The system refused something.
   */
  TACTNET_OUTCOME_SYSTEM = 11,
  /**
   * The library is wrong; the text says where.
   */
  TACTNET_OUTCOME_INTERNAL = 12,
} tactnet_outcome;

/**
 * How urgent packets are between hosts.
 */
typedef enum {
  /**
   * Pictures, recordings.
   */
  TACTNET_PRIORITY_BULK = 0,
  /**
   * Everything else.
   */
  TACTNET_PRIORITY_NORMAL = 1,
  /**
   * Commands.
   */
  TACTNET_PRIORITY_HIGH = 2,
  /**
   * Control loops.
   */
  TACTNET_PRIORITY_REAL_TIME = 3,
} tactnet_priority;

/**
 * Access to the channels of a table, for any number of threads.
 */
typedef struct tactnet_bus tactnet_bus;

/**
 * Gets packets from one channel, for one thread at a time.
 */
typedef struct tactnet_get_port tactnet_get_port;

/**
 * Puts packets into one channel, for any number of threads.
 */
typedef struct tactnet_put_port tactnet_put_port;

/**
 * Get-ports that are waited for together, for one thread at a time.
 */
typedef struct tactnet_sync_group tactnet_sync_group;

/**
 * Which packets a port carries. Both ends of a channel must mean the same.
 */
typedef struct {
  /**
   * Its name, like `SkinFrame`.
   */
  const char *name;
  /**
   * Its version.
   */
  uint32_t version;
  /**
   * Size of one item, bytes.
   */
  size_t bytes;
} tactnet_packet;

/**
 * A packet where its sender wrote it. Give it back soon, with `tactnet_received_release`: a port holds only a few.
 */
typedef struct {
  /**
   * The items, aligned to 64 bytes, not to be written. Null once it was given back.
   */
  const void *items;
  /**
   * How many.
   */
  size_t count;
  /**
   * Random number of the put-port that sent it.
   */
  uint64_t sender;
  /**
   * Counts the packets of that put-port from 0.
   */
  uint64_t sequence;
  /**
   * When it was put, by the sender's `tactnet_now_ns`.
   */
  uint64_t put_ns;
  /**
   * 1 if it came from another host, whose clock `put_ns` is of.
   */
  uint32_t remote;
  /**
   * Its priority.
   */
  uint32_t priority;
  /**
   * The library's own.
   */
  uint64_t opaque[TACTNET_RECEIVED_WORDS];
} tactnet_received;

/**
 * A packet that is being written, in shared memory. It is put or given back by the thread that loaned it.
 */
typedef struct {
  /**
   * The items, aligned to 64 bytes; what they hold a former packet left. Null once it was put or given back.
   */
  void *items;
  /**
   * How many.
   */
  size_t count;
  /**
   * The library's own.
   */
  uint64_t opaque[TACTNET_LOAN_WORDS];
} tactnet_loaned;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Returns nanoseconds of the host's monotonic clock, of which `put_ns` of a received packet are.
 */
uint64_t tactnet_now_ns(void);

/**
 * Opens a bus that a hub of this host holds (`tactnet channel hub --table FILE`).
 *
 * - `table`: path of the hub's table
 * - `bus`: is set to the bus; give it back with `tactnet_bus_close`
 *
 * # Safety
 * `table` is a text, `bus` can be written.
 */
tactnet_outcome tactnet_bus_open(const char *table, tactnet_bus **bus);

/**
 * Closes a bus; its ports stay open. Null is nothing.
 *
 * # Safety
 * `bus` is null or was opened, and is not used any more.
 */
void tactnet_bus_close(tactnet_bus *bus);

/**
 * Opens a port to get packets of a channel.
 *
 * - `channel`: its id, like `tactile/belief`
 * - `packet`: what it carries
 * - `history`: how many packets of before to get of every sender, where the channel keeps them; 0: only new ones
 * - `port`: is set to the port; give it back with `tactnet_get_port_close`
 *
 * # Safety
 * The pointers are valid.
 */
tactnet_outcome tactnet_get_port_open(const tactnet_bus *bus,
                                      const char *channel,
                                      const tactnet_packet *packet,
                                      size_t history,
                                      tactnet_get_port **port);

/**
 * Closes a port; packets of it are to be given back before. Null is nothing.
 *
 * # Safety
 * `port` is null or was opened, and is not used any more.
 */
void tactnet_get_port_close(tactnet_get_port *port);

/**
 * Gets the next packet.
 *
 * - `timeout_ns`: how long to sleep until one comes; 0: look once; below 0: for ever
 *
 * # Safety
 * `port` is open and used by this thread alone, `received` can be written and holds no packet.
 */
tactnet_outcome tactnet_get(tactnet_get_port *port, int64_t timeout_ns, tactnet_received *received);

/**
 * Gives a packet back. One that was given back, null, or all zero is nothing.
 *
 * # Safety
 * `received` is null, all zero, or was filled in by `tactnet_get`.
 */
void tactnet_received_release(tactnet_received *received);

/**
 * Returns how many packets were put but never got here, because the ring was full or the network too slow.
 *
 * # Safety
 * `port` is null or open, and used by this thread alone.
 */
uint64_t tactnet_get_port_lost(const tactnet_get_port *port);

/**
 * Returns the text of this thread's last failure, one line of UTF-8, empty before the first; it is valid until the next one.
 */
const char *tactnet_last_error(void);

/**
 * Opens a port to put packets into a channel.
 *
 * - `channel`: its id, like `skin/right`
 * - `packet`: what it carries
 * - `priority`: a `tactnet_priority`
 * - `port`: is set to the port; give it back with `tactnet_put_port_close`
 *
 * # Safety
 * The pointers are valid.
 */
tactnet_outcome tactnet_put_port_open(const tactnet_bus *bus,
                                      const char *channel,
                                      const tactnet_packet *packet,
                                      uint32_t priority,
                                      tactnet_put_port **port);

/**
 * Closes a port; packets on loan are to be put or given back before, and packets that a getter has not looked for yet may be lost to it. Null
 * is nothing.
 *
 * # Safety
 * `port` is null or was opened, and is not used any more.
 */
void tactnet_put_port_close(tactnet_put_port *port);

/**
 * Sends a copy of `count` items.
 *
 * # Safety
 * `items` points to `count` items of the port's packet.
 */
tactnet_outcome tactnet_put(const tactnet_put_port *port, const void *items, size_t count);

/**
 * Loans a packet of `count` items to be written in place, without a copy; then `tactnet_put_loan` or `tactnet_loan_release`.
 *
 * # Safety
 * `port` is open, `loan` can be written and holds no packet.
 */
tactnet_outcome tactnet_loan(const tactnet_put_port *port,
                             size_t count,
                             tactnet_loaned *loan);

/**
 * Sends a loaned packet, which then is no longer the sender's, whatever the outcome.
 *
 * # Safety
 * `port` is open, `loan` was filled in by `tactnet_loan`.
 */
tactnet_outcome tactnet_put_loan(const tactnet_put_port *port, tactnet_loaned *loan);

/**
 * Gives a loaned packet back unsent. One that was put, null, or all zero is nothing.
 *
 * # Safety
 * `loan` is null, all zero, or was filled in by `tactnet_loan`.
 */
void tactnet_loan_release(tactnet_loaned *loan);

/**
 * Connects to get-ports that came since the last packet, at a time of the caller's choice; else the next put does it, which then allocates.
 *
 * # Safety
 * `port` is open.
 */
tactnet_outcome tactnet_put_port_connect(const tactnet_put_port *port);

/**
 * Puts get-ports of a bus into a group.
 *
 * - `ports`, `count`: the ports, which may be closed before the group
 * - `group`: is set to the group; give it back with `tactnet_sync_group_close`
 *
 * # Safety
 * `ports` points to `count` open ports; the other pointers are valid.
 */
tactnet_outcome tactnet_sync_group_open(const tactnet_bus *bus,
                                        const tactnet_get_port *const *ports,
                                        size_t count,
                                        tactnet_sync_group **group);

/**
 * Waits until any port of a group has a packet, which `tactnet_get` then takes.
 *
 * - `timeout_ns`: 0: look once; below 0: for ever
 * - `port`: is set to the port's place in the group
 *
 * # Safety
 * `group` is open and used by this thread alone, `port` can be written.
 */
tactnet_outcome tactnet_sync_group_wait(tactnet_sync_group *group, int64_t timeout_ns, size_t *port);

/**
 * Closes a group. Null is nothing.
 *
 * # Safety
 * `group` is null or was opened, and is not used any more.
 */
void tactnet_sync_group_close(tactnet_sync_group *group);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* TACTNET_CHANNEL_H */
