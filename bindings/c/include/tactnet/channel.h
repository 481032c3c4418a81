/*
 * The robot's channels for C11: zero-copy packets between processes of a host, and through the hub to other hosts.
 *
 * Every function that can fail returns a tactnet_outcome; tactnet_last_error() returns the text of the calling thread's last error.
 *
 * Threads: a bus and a put-port can be used by several threads at once, a get-port and a sync group by one thread at a time. The thread
 * that loaned or received a packet must release it. The library starts no threads.
 *
 * Real time: once ports are connected, tactnet_loan, tactnet_put, tactnet_put_loan, tactnet_get and tactnet_sync_group_wait neither allocate
 * nor lock on success, and sleep only for the given timeout.
 *
 * Linux 5.16 or newer; packets are little endian.
 */

#ifndef TACTNET_CHANNEL_H
#define TACTNET_CHANNEL_H

/* Generated from bindings/c/src by `cargo run -p tactnet-c --example header`; do not edit. */

#include <stddef.h>
#include <stdint.h>

/**
 * Number of private 64-bit words in a loan.
 */
#define TACTNET_LOAN_WORDS 16

/**
 * Number of private 64-bit words in a received packet.
 */
#define TACTNET_RECEIVED_WORDS 24

/**
 * Result of a function; `tactnet_last_error` returns the text of an error.
 */
typedef enum {
  /**
   * Success.
   */
  TACTNET_OUTCOME_OK = 0,
  /**
   * No packet arrived in time.
   */
  TACTNET_OUTCOME_TIMEOUT = 1,
  /**
   * An argument is null, not UTF-8, or already released.
   */
  TACTNET_OUTCOME_ARGUMENT = 2,
  /**
   * The table cannot be read or is wrong.
   */
  TACTNET_OUTCOME_TABLE = 3,
  /**
   * The table has no such channel, or a new one exists already.
   */
  TACTNET_OUTCOME_CHANNEL = 4,
  /**
   * No hub of this bus runs on this host.
   */
  TACTNET_OUTCOME_NO_HUB = 5,
  /**
   * The channel has another packet type.
   */
  TACTNET_OUTCOME_TYPE = 6,
  /**
   * All ports of the channel are taken.
   */
  TACTNET_OUTCOME_FULL = 7,
  /**
   * The packet has more items than the channel allows, or the channel keeps less history than requested.
   */
  TACTNET_OUTCOME_TOO_LARGE = 8,
  /**
   * Too many packets are on loan or held at this port.
   */
  TACTNET_OUTCOME_HELD = 9,
  /**
   * Not enough shared memory.
   */
  TACTNET_OUTCOME_MEMORY = 10,
  /**
   * The operating system refused an operation.
   */
  TACTNET_OUTCOME_SYSTEM = 11,
  /**
   * A defect of the library; the text names the place.
   */
  TACTNET_OUTCOME_INTERNAL = 12,
} tactnet_outcome;

/**
 * Priority of a port, on a host as between hosts: urgent packets are delivered before waiting bulk.
 */
typedef enum {
  /**
   * For images and recordings.
   */
  TACTNET_PRIORITY_BULK = 0,
  /**
   * For everything else.
   */
  TACTNET_PRIORITY_NORMAL = 1,
  /**
   * For commands.
   */
  TACTNET_PRIORITY_HIGH = 2,
  /**
   * For control loops.
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
 * Packet type of a port. Both ends of a channel must use the same.
 */
typedef struct {
  /**
   * Name of the type, like `SkinFrame`.
   */
  const char *name;
  /**
   * Version of the type.
   */
  uint32_t version;
  /**
   * Size of one item, in bytes.
   */
  size_t bytes;
} tactnet_packet;

/**
 * Resources of a channel that is created at run time; a zero stands for the default.
 */
typedef struct {
  /**
   * Maximum number of items in a packet; 1 by default.
   */
  size_t items;
  /**
   * Length of a get-port's ring for one put-port, in packets; 16 by default.
   */
  size_t depth;
  /**
   * Maximum number of put-ports; 1 by default.
   */
  size_t put_ports;
  /**
   * Maximum number of get-ports; 8 by default.
   */
  size_t get_ports;
  /**
   * Number of last packets of every put-port that a new get-port can request; 0 by default.
   */
  size_t history;
} tactnet_channel_resources;

/**
 * A received packet in its sender's memory. Release it soon with `tactnet_received_release`: a port holds only a few.
 */
typedef struct {
  /**
   * Items, aligned to 64 bytes, read-only. Null after the release.
   */
  const void *items;
  /**
   * Number of items.
   */
  size_t count;
  /**
   * Random number of the put-port that sent it.
   */
  uint64_t sender;
  /**
   * Sequence number of the packet at that put-port, from 0.
   */
  uint64_t sequence;
  /**
   * Time of the put, by the sender's `tactnet_now_ns`.
   */
  uint64_t put_ns;
  /**
   * 1 if it came from another host, whose clock `put_ns` then uses; otherwise 0.
   */
  uint32_t remote;
  /**
   * Priority of the put-port.
   */
  uint32_t priority;
  /**
   * Private to the library.
   */
  uint64_t opaque[TACTNET_RECEIVED_WORDS];
} tactnet_received;

/**
 * A packet that is being written, in shared memory. The thread that loaned it puts or releases it.
 */
typedef struct {
  /**
   * Items, aligned to 64 bytes, with undefined content. Null after the put or release.
   */
  void *items;
  /**
   * Number of items.
   */
  size_t count;
  /**
   * Private to the library.
   */
  uint64_t opaque[TACTNET_LOAN_WORDS];
} tactnet_loaned;

/**
 * Packets of a put-port that one get-port has lost.
 */
typedef struct {
  /**
   * Number of the get-port, as `tactnet_get_port_number` returns it.
   */
  uint64_t getter;
  /**
   * Packets that were overwritten in its ring.
   */
  uint64_t packets;
} tactnet_getter_loss;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Returns the time of the host's monotonic clock, in nanoseconds; `put_ns` of received packets uses the same clock.
 */
uint64_t tactnet_now_ns(void);

/**
 * Opens a bus; a hub of this host must run with the same table.
 *
 * - `table`: path of the hub's table
 * - `bus`: set to the bus; release it with `tactnet_bus_close`
 *
 * # Safety
 * `table` is a text, `bus` can be written.
 */
tactnet_outcome tactnet_bus_open(const char *table, tactnet_bus **bus);

/**
 * Closes a bus; its ports stay open. Null is ignored.
 *
 * # Safety
 * `bus` is null or was opened, and is not used afterwards.
 */
void tactnet_bus_close(tactnet_bus *bus);

/**
 * Creates a channel that is not in the table, for as long as the bus is open.
 *
 * - `channel`: id of the new channel, which other clients open by it
 * - `packet`: packet type of the channel
 *
 * # Safety
 * The pointers are valid.
 */
tactnet_outcome tactnet_channel_create(const tactnet_bus *bus,
                                       const char *channel,
                                       const tactnet_packet *packet,
                                       const tactnet_channel_resources *resources);

/**
 * Opens a port that gets packets of a channel.
 *
 * - `channel`: id, like `tactile/belief`
 * - `packet`: packet type of the channel
 * - `history`: number of earlier packets to get from every sender, if the channel keeps them; 0: only new ones
 * - `port`: set to the port; release it with `tactnet_get_port_close`
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
 * Closes a port; release its packets before. Null is ignored.
 *
 * # Safety
 * `port` is null or was opened, and is not used afterwards.
 */
void tactnet_get_port_close(tactnet_get_port *port);

/**
 * Gets the next packet.
 *
 * - `timeout_ns`: maximum sleep; 0: do not wait; negative: no timeout
 *
 * # Safety
 * `port` is open and used by this thread alone, `received` can be written and holds no packet.
 */
tactnet_outcome tactnet_get(tactnet_get_port *port, int64_t timeout_ns, tactnet_received *received);

/**
 * Releases a packet. A released one, null, or all zeros is ignored.
 *
 * # Safety
 * `received` is null, all zero, or was filled in by `tactnet_get`.
 */
void tactnet_received_release(tactnet_received *received);

/**
 * Sets the priority of a port in its sync groups, which name ports of high priority first.
 *
 * - `priority`: a `tactnet_priority`
 *
 * # Safety
 * `port` is open.
 */
tactnet_outcome tactnet_get_port_set_priority(const tactnet_get_port *port, uint32_t priority);

/**
 * Returns the random number of a port, for `tactnet_put_port_losses`; 0 for null.
 *
 * # Safety
 * `port` is null or open.
 */
uint64_t tactnet_get_port_number(const tactnet_get_port *port);

/**
 * Returns the number of packets since the opening that were put but did not arrive, because the ring was full or the
 * network too slow.
 *
 * # Safety
 * `port` is null or open, and used by this thread alone.
 */
uint64_t tactnet_get_port_lost(const tactnet_get_port *port);

/**
 * Returns the text of this thread's last error: one line of UTF-8, empty before the first error. It is valid until
 * the next error.
 */
const char *tactnet_last_error(void);

/**
 * Opens a port that puts packets into a channel.
 *
 * - `channel`: id, like `skin/right`
 * - `packet`: packet type of the channel
 * - `priority`: a `tactnet_priority`
 * - `port`: set to the port; release it with `tactnet_put_port_close`
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
 * Closes a port; put or release its loans before. Get-ports still get its last packets. Null is ignored.
 *
 * # Safety
 * `port` is null or was opened, and is not used afterwards.
 */
void tactnet_put_port_close(tactnet_put_port *port);

/**
 * Sends a copy of `count` items.
 *
 * # Safety
 * `items` points to `count` items of the port's packet type.
 */
tactnet_outcome tactnet_put(const tactnet_put_port *port, const void *items, size_t count);

/**
 * Loans a packet of `count` items to be written in place, without a copy. End the loan with `tactnet_put_loan` or
 * `tactnet_loan_release`.
 *
 * # Safety
 * `port` is open, `loan` can be written and holds no packet.
 */
tactnet_outcome tactnet_loan(const tactnet_put_port *port,
                             size_t count,
                             tactnet_loaned *loan);

/**
 * Sends a loaned packet. The loan ends, whatever the outcome.
 *
 * # Safety
 * `port` is open, `loan` was filled in by `tactnet_loan`.
 */
tactnet_outcome tactnet_put_loan(const tactnet_put_port *port, tactnet_loaned *loan);

/**
 * Releases a loaned packet unsent. One that was put, null, or all zeros is ignored.
 *
 * # Safety
 * `loan` is null, all zero, or was filled in by `tactnet_loan`.
 */
void tactnet_loan_release(tactnet_loaned *loan);

/**
 * Returns the number of get-ports that have lost packets of this port, because they took them too slowly.
 *
 * - `losses`: filled with the first `most` of them
 *
 * # Safety
 * `port` is null or open; `losses` points to `most` elements.
 */
size_t tactnet_put_port_losses(const tactnet_put_port *port, tactnet_getter_loss *losses, size_t most);

/**
 * Connects to new get-ports now. Otherwise the next put does so, and allocates.
 *
 * # Safety
 * `port` is open.
 */
tactnet_outcome tactnet_put_port_connect(const tactnet_put_port *port);

/**
 * Creates a group of get-ports.
 *
 * - `ports`, `count`: the ports, which may be closed before the group
 * - `group`: set to the group; release it with `tactnet_sync_group_close`
 *
 * # Safety
 * `ports` points to `count` open ports; the other pointers are valid.
 */
tactnet_outcome tactnet_sync_group_open(const tactnet_bus *bus,
                                        const tactnet_get_port *const *ports,
                                        size_t count,
                                        tactnet_sync_group **group);

/**
 * Waits until a port of the group has a packet; `tactnet_get` then takes it.
 *
 * - `timeout_ns`: maximum sleep; 0: do not wait; negative: no timeout
 * - `port`: set to the index of the port in the group
 *
 * # Safety
 * `group` is open and used by this thread alone, `port` can be written.
 */
tactnet_outcome tactnet_sync_group_wait(tactnet_sync_group *group, int64_t timeout_ns, size_t *port);

/**
 * Closes a group. Null is ignored.
 *
 * # Safety
 * `group` is null or was opened, and is not used afterwards.
 */
void tactnet_sync_group_close(tactnet_sync_group *group);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* TACTNET_CHANNEL_H */
