//! One test suite for all domains.

#![allow(clippy::unwrap_used)]

mod allocations;
mod cases;
#[cfg(feature = "zenoh")]
mod namespaces;
mod small_memory;
mod wild_client;
mod world;

use world::World;

macro_rules! suite {
    ($($case:ident)*) => {
        mod process { $(#[test] fn $case() { super::cases::$case(&super::World::process()); })* }
        mod host { $(#[test] fn $case() { super::cases::$case(&super::World::host()); })* }
        #[cfg(feature = "zenoh")]
        mod distributed { $(#[test] fn $case() {
            if let Some(world) = super::World::distributed() {
                super::cases::$case(&world);
            }
        })* }
    };
}

suite! {
    packets_of_a_sender_arrive_in_their_order
    every_getter_gets_every_packet_of_every_putter
    a_late_joiner_gets_the_history_it_asks_for
    who_starts_now_gets_nothing_old
    a_full_ring_keeps_the_newest_and_counts_the_loss
    an_id_can_be_sent_over_a_channel
    priorities_and_times_come_with_the_packet
    packets_that_are_too_large_are_refused
    ports_of_another_type_are_refused
    ports_beyond_the_table_are_refused_until_one_is_dropped
    a_packet_outlives_its_ports
    more_packets_than_allowed_cannot_be_held_or_loaned
    a_sync_group_finds_the_port_that_has_a_packet
    a_large_group_is_woken_too
    a_busy_port_does_not_starve_the_group
    packets_of_all_put_ports_arrive_in_the_order_of_their_puts
    a_late_getter_gets_the_history_of_all_put_ports_in_order
    a_history_read_during_puts_has_no_gap
    order_holds_between_put_ports_of_two_threads
    a_bulk_sender_that_connected_first_starves_nobody
    losses_count_from_the_opening_and_the_putter_knows_them
    packets_of_a_closed_put_port_arrive
    what_a_closed_port_had_lost_is_counted
    urgent_packets_overtake_waiting_bulk
    bulk_displaces_no_urgent_packet
    a_sync_group_names_the_urgent_port_first
    a_channel_can_be_created_at_run_time
    blocking_gets_wake_up_and_time_out
    no_wake_up_is_lost
}
