// The robot's channels for C++17: ports, loans and packets as move-only types that release themselves, and errors as exceptions.
//
//   tactnet::bus bus("robot.toml");
//   auto skin = bus.put_port<tactnet_skin_frame>("skin/right", TACTNET_PRIORITY_HIGH);
//   auto frame = skin.loan();            // in shared memory, without a copy
//   frame->sequence = 1;
//   skin.put(std::move(frame));
//
// A custom packet needs `template <> struct tactnet::packet_traits<mine>` with `name` and `version`. The thread rules of channel.h apply.
#ifndef TACTNET_CHANNEL_HPP
#define TACTNET_CHANNEL_HPP

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <initializer_list>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "channel.h"
#include "packets.hpp"

namespace tactnet {

/// Error of the channels; `what()` returns its text.
class error : public std::runtime_error {
public:
  explicit error(tactnet_outcome outcome) : std::runtime_error(tactnet_last_error()), outcome_(outcome) {}
  tactnet_outcome outcome() const noexcept { return outcome_; }

private:
  tactnet_outcome outcome_;
};

/// Maximum time to wait; negative: no timeout.
using timeout = std::chrono::nanoseconds;
/// No timeout.
inline constexpr timeout for_ever{-1};

namespace detail {

inline void check(tactnet_outcome outcome) {
  if (outcome != TACTNET_OUTCOME_OK) throw error(outcome);
}

/// Returns false after a timeout; throws for errors.
inline bool came(tactnet_outcome outcome) {
  if (outcome == TACTNET_OUTCOME_TIMEOUT) return false;
  check(outcome);
  return true;
}

template <class T, void (*close)(T *)>
struct closer {
  void operator()(T *handle) const noexcept { close(handle); }
};

template <class T, void (*close)(T *)>
using handle = std::unique_ptr<T, closer<T, close>>;

template <class T>
tactnet_packet packet() {
  static_assert(std::is_trivially_copyable_v<T> && std::is_standard_layout_v<T>, "packets are plain data");
  static_assert(alignof(T) <= 64, "packets are aligned to 64 bytes at most");
  return {packet_traits<T>::name, packet_traits<T>::version, sizeof(T)};
}

} // namespace detail

template <class T>
class put_port;

/// A packet that is being written in shared memory. If it is not put, it is released unsent.
template <class T>
class loan {
public:
  loan(loan &&other) noexcept : loaned_(other.loaned_) { other.loaned_.items = nullptr; }
  loan &operator=(loan &&other) noexcept {
    if (this != &other) {
      tactnet_loan_release(&loaned_);
      loaned_ = other.loaned_;
      other.loaned_.items = nullptr;
    }
    return *this;
  }
  ~loan() { tactnet_loan_release(&loaned_); }

  T *begin() noexcept { return static_cast<T *>(loaned_.items); }
  T *end() noexcept { return begin() + size(); }
  std::size_t size() const noexcept { return loaned_.count; }
  T &operator[](std::size_t at) noexcept { return begin()[at]; }
  T &operator*() noexcept { return *begin(); }
  T *operator->() noexcept { return begin(); }

private:
  friend class put_port<T>;
  explicit loan(const tactnet_put_port *port, std::size_t count) { detail::check(::tactnet_loan(port, count, &loaned_)); }
  tactnet_loaned loaned_{};
};

/// A received packet in its sender's memory. Release it soon: a port holds only a few.
template <class T>
class received {
public:
  explicit received(const tactnet_received &packet) noexcept : received_(packet) {}
  received(received &&other) noexcept : received_(other.received_) { other.received_.items = nullptr; }
  received &operator=(received &&other) noexcept {
    if (this != &other) {
      tactnet_received_release(&received_);
      received_ = other.received_;
      other.received_.items = nullptr;
    }
    return *this;
  }
  ~received() { tactnet_received_release(&received_); }

  const T *begin() const noexcept { return static_cast<const T *>(received_.items); }
  const T *end() const noexcept { return begin() + size(); }
  std::size_t size() const noexcept { return received_.count; }
  const T &operator[](std::size_t at) const noexcept { return begin()[at]; }
  const T &operator*() const noexcept { return *begin(); }
  const T *operator->() const noexcept { return begin(); }
  /// Random number of the put-port that sent it.
  std::uint64_t sender() const noexcept { return received_.sender; }
  /// Sequence number of the packet at that put-port, from 0.
  std::uint64_t sequence() const noexcept { return received_.sequence; }
  /// Time of the put, by the sender's `tactnet_now_ns`.
  std::uint64_t put_ns() const noexcept { return received_.put_ns; }
  /// Returns true if it came from another host.
  bool remote() const noexcept { return received_.remote != 0; }

private:
  tactnet_received received_;
};

/// Puts packets of `T` into one channel.
template <class T>
class put_port {
public:
  /// Returns a packet of `count` items to be written in place. Its content is undefined.
  tactnet::loan<T> loan(std::size_t count = 1) const { return tactnet::loan<T>(port_.get(), count); }
  /// Sends a loaned packet.
  void put(tactnet::loan<T> &&loan) const { detail::check(tactnet_put_loan(port_.get(), &loan.loaned_)); }
  /// Sends a copy.
  void put(const T &item) const { put(&item, 1); }
  void put(const T *items, std::size_t count) const { detail::check(tactnet_put(port_.get(), items, count)); }
  /// Connects to new get-ports now. Otherwise the next put does so, and allocates.
  void connect() const { detail::check(tactnet_put_port_connect(port_.get())); }
  /// Get-ports that have lost packets of this port, because they took them too slowly.
  std::vector<tactnet_getter_loss> losses() const {
    std::vector<tactnet_getter_loss> found(tactnet_put_port_losses(port_.get(), nullptr, 0));
    const std::size_t now = tactnet_put_port_losses(port_.get(), found.data(), found.size());
    found.resize(std::min(now, found.size()));
    return found;
  }

private:
  friend class bus;
  explicit put_port(tactnet_put_port *port) : port_(port) {}
  detail::handle<tactnet_put_port, tactnet_put_port_close> port_;
};

/// Gets packets of `T` from one channel.
template <class T>
class get_port {
public:
  /// Waits for the next packet. Returns nothing after the timeout.
  std::optional<received<T>> get(timeout patience = for_ever) {
    tactnet_received packet;
    if (!detail::came(tactnet_get(port_.get(), patience.count(), &packet))) return std::nullopt;
    return received<T>(packet);
  }
  /// Returns the next packet if there is one.
  std::optional<received<T>> try_get() { return get(timeout::zero()); }
  /// Number of packets that were put but did not arrive.
  std::uint64_t lost() const noexcept { return tactnet_get_port_lost(port_.get()); }
  /// Number of this port in the losses of put-ports.
  std::uint64_t number() const noexcept { return tactnet_get_port_number(port_.get()); }
  /// Sets the priority of this port in its sync groups.
  void set_priority(tactnet_priority priority) const { detail::check(tactnet_get_port_set_priority(port_.get(), priority)); }
  const tactnet_get_port *handle() const noexcept { return port_.get(); }

private:
  friend class bus;
  explicit get_port(tactnet_get_port *port) : port_(port) {}
  detail::handle<tactnet_get_port, tactnet_get_port_close> port_;
};

/// Get-ports that are waited for together.
class sync_group {
public:
  /// Waits until a port has a packet. Returns its index in the group, or nothing after the timeout.
  std::optional<std::size_t> wait(timeout patience = for_ever) {
    std::size_t port = 0;
    if (!detail::came(tactnet_sync_group_wait(group_.get(), patience.count(), &port))) return std::nullopt;
    return port;
  }

private:
  friend class bus;
  explicit sync_group(tactnet_sync_group *group) : group_(group) {}
  detail::handle<tactnet_sync_group, tactnet_sync_group_close> group_;
};

/// Access to the channels of a table that a hub of this host holds.
class bus {
public:
  explicit bus(const std::string &table) {
    tactnet_bus *opened = nullptr;
    detail::check(tactnet_bus_open(table.c_str(), &opened));
    bus_.reset(opened);
  }

  template <class T>
  tactnet::put_port<T> put_port(const std::string &channel, tactnet_priority priority = TACTNET_PRIORITY_NORMAL) const {
    const tactnet_packet packet = detail::packet<T>();
    tactnet_put_port *opened = nullptr;
    detail::check(tactnet_put_port_open(bus_.get(), channel.c_str(), &packet, priority, &opened));
    return tactnet::put_port<T>(opened);
  }

  /// Opens a port that first gets the last `history` packets of every sender, if the channel keeps them.
  template <class T>
  tactnet::get_port<T> get_port(const std::string &channel, std::size_t history = 0) const {
    const tactnet_packet packet = detail::packet<T>();
    tactnet_get_port *opened = nullptr;
    detail::check(tactnet_get_port_open(bus_.get(), channel.c_str(), &packet, history, &opened));
    return tactnet::get_port<T>(opened);
  }

  /// Creates a channel that is not in the table, for as long as this bus is open.
  template <class T>
  void create_channel(const std::string &channel, const tactnet_channel_resources &resources = {}) const {
    const tactnet_packet packet = detail::packet<T>();
    detail::check(tactnet_channel_create(bus_.get(), channel.c_str(), &packet, &resources));
  }

  template <class... T>
  tactnet::sync_group sync_group(const tactnet::get_port<T> &...ports) const {
    const std::vector<const tactnet_get_port *> handles{ports.handle()...};
    tactnet_sync_group *opened = nullptr;
    detail::check(tactnet_sync_group_open(bus_.get(), handles.data(), handles.size(), &opened));
    return tactnet::sync_group(opened);
  }

private:
  detail::handle<tactnet_bus, tactnet_bus_close> bus_;
};

} // namespace tactnet

#endif
