//! A world's step does not allocate. The test runs in a separate process because it counts all allocations.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use tactnet_catching_packets::packets::{HandCommand, JointCommand};
use tactnet_catching_packets::{JOINTS, RobotDescription};
use tactnet_catching_world::{World, WorldConfig};

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: forwards to the system's allocator and counts.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let _ = ALLOCATIONS.try_with(|count| count.set(count.get() + 1));
        // SAFETY: the caller upholds the contract.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller upholds the contract.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

#[test]
fn steps_do_not_allocate() {
    let robot = RobotDescription::nominal();
    let mut world = World::new(&robot, &WorldConfig::default(), 1, &[0.0; JOINTS]).unwrap();
    world.throw(2);
    let command = JointCommand::still([0.2; JOINTS]);
    let catch = HandCommand {
        arm: 0,
        catch_ns: 700_000_000,
    };
    let before = ALLOCATIONS.get();
    for tick in 0..3500 {
        world.step(&command, &[(tick < 600).then_some(catch), None]);
    }
    assert_eq!(ALLOCATIONS.get(), before);
    assert_eq!(world.verdicts().len(), 2, "all of a throw was seen");
}
