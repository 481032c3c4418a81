//! Targets of `tests/attacks` for `cargo fuzz`, which looks for inputs that reach new code.

pub use libfuzzer_sys::fuzz_target;
pub use tactnet_attacks::{Target, open};

/// Feeds inputs to one target; its seeds are tried first and must be accepted.
#[macro_export]
macro_rules! target {
    ($name:literal) => {
        thread_local! {
            static TARGET: std::cell::RefCell<$crate::Target> = {
                let mut target = $crate::open($name).expect("the target is made ready");
                for seed in target.seeds.clone() {
                    assert!((target.run)(&seed), "a seed is refused");
                }
                std::cell::RefCell::new(target)
            };
        }

        $crate::fuzz_target!(|data: &[u8]| {
            TARGET.with(|target| {
                (target.borrow_mut().run)(data);
            });
        });
    };
}
