//! Progress of throws and benchmarks.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use crate::commands::progress_line::about;

/// Returns a callback that counts finished throws and reports them every two seconds.
pub fn throw_progress(all: u64) -> impl Fn() + Sync {
    every_two_seconds(all, move |done, left| {
        say!("{done} of {all} throws, {left} to go");
    })
}

/// Returns a callback that counts finished throws. Every two seconds, `report` receives their number and the remaining
/// time.
pub fn every_two_seconds(all: u64, report: impl Fn(u64, &str) + Sync) -> impl Fn() + Sync {
    let begun = Instant::now();
    let (done, said) = (AtomicU64::new(0), AtomicU64::new(2));
    move || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        let (elapsed, next) = (begun.elapsed(), said.load(Ordering::Relaxed));
        let again = elapsed.as_secs() + 2;
        if elapsed.as_secs() >= next
            && said
                .compare_exchange(next, again, Ordering::Relaxed, Ordering::Relaxed)
                .is_ok()
        {
            let left = elapsed.mul_f64(all.saturating_sub(done) as f64 / done as f64);
            report(done, &about(left));
        }
    }
}

/// Returns a callback that receives the number of finished parts and reports it every two seconds.
///
/// - `parts`: noun of the parts, in the plural
pub fn progress_of(all: usize, parts: &str) -> impl FnMut(usize) {
    let begun = Instant::now();
    let mut said = begun;
    move |done| {
        if said.elapsed().as_secs_f64() > 2.0 {
            said = Instant::now();
            let left = all.saturating_sub(done) as f64 / done.max(1) as f64;
            let left = about(begun.elapsed().mul_f64(left));
            say!("{done} of {all} {parts}, {left} to go");
        }
    }
}
