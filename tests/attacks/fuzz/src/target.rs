//! Gives libFuzzer's inputs to the target that the program is named after, and ends where one panics or holds more than its ceiling.
#![no_main]

use std::cell::RefCell;

use libfuzzer_sys::fuzz_target;
use tactnet_attacks::{Allocator, Target, most_held, open};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

thread_local! {
    static TARGET: RefCell<Target> = RefCell::new(ready());
}

/// The target, which accepts its valid inputs: else a run would show nothing. Writes them into `TACTNET_FUZZ_SEEDS`, if that is a folder.
fn ready() -> Target {
    let name = env!("CARGO_BIN_NAME").replace('-', " ");
    let mut target = open(&name).unwrap_or_else(|error| panic!("{name}: {error:#}"));
    for (number, seed) in target.seeds.clone().iter().enumerate() {
        assert!((target.run)(seed), "{name}: seed {number} is refused");
        if let Ok(folder) = std::env::var("TACTNET_FUZZ_SEEDS") {
            let file = std::path::Path::new(&folder).join(format!("seed-{number}"));
            std::fs::write(file, seed).unwrap_or_else(|error| panic!("{folder}: {error}"));
        }
    }
    target
}

fuzz_target!(|input: &[u8]| {
    TARGET.with_borrow_mut(|target| {
        let (_, most) = most_held(|| (target.run)(input));
        assert!(
            most <= target.ceiling,
            "held {most} bytes, at most {} are allowed",
            target.ceiling
        );
    });
});
