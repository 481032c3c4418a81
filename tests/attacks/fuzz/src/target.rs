//! Runs libFuzzer's inputs on the target named by the program; aborts on a panic or above the memory ceiling.
#![no_main]

use std::cell::RefCell;
use std::panic;

use libfuzzer_sys::fuzz_target;
use tactnet_attacks::{Allocator, Target, most_held, open};
use tactnet_data::format::is_reading;

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

thread_local! {
    static TARGET: RefCell<Target> = RefCell::new(ready());
}

/// Returns the target after a check that it accepts its valid inputs, which a useful run requires. Writes them to the
/// folder `TACTNET_FUZZ_SEEDS`, if set.
fn ready() -> Target {
    // libFuzzer's own hook ends the process. Some readers panic on damaged files, and the panics
    // become errors.
    let ends = panic::take_hook();
    panic::set_hook(Box::new(move |panic| {
        if !is_reading() {
            ends(panic);
        }
    }));
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
