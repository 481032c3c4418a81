//! One target, attacked until time or executions are over.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

use anyhow::ensure;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::ceiling::most_held;
use crate::mutate::mutated;
use crate::targets;

/// A call that takes longer on the processor hangs,
const PATIENCE: Duration = Duration::from_secs(10);
/// and one that waits so much longer, since other programs may hold the processor.
const WAIT: u32 = 20;
/// Exit code of a process that hangs.
pub const HANGS: i32 = 3;
/// Findings of one kind of which the inputs are kept.
const KEPT: u64 = 5;

/// How long a target is attacked, and with what.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Most seconds.
    pub seconds: f64,
    /// Most inputs.
    pub executions: u64,
    /// Names every random choice.
    pub seed: u64,
    /// Where inputs go that break something.
    pub out: PathBuf,
}

/// What became of one target.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Row {
    /// Its name.
    pub target: String,
    /// Inputs that it was given.
    pub executions: u64,
    /// Inputs among them that it took as valid, seeds not counted.
    pub accepted: u64,
    /// Calls that panicked, or ended the process.
    pub panics: u64,
    /// Calls that took over ten seconds of the processor, or two hundred by the clock.
    pub hangs: u64,
    /// Calls that took more memory than the target's ceiling.
    pub over_memory: u64,
    /// Data that an attack cost, where it can.
    pub lost: u64,
    /// Most memory of a call, MiB.
    pub most_mib: f64,
    /// How long it took.
    pub seconds: f64,
}

/// Where a process keeps the input that it tries, in memory.
pub(crate) fn last_input(process: u32) -> PathBuf {
    format!("/dev/shm/tactnet-attacks-{process}").into()
}

/// Attacks `name` in this process.
///
/// # Errors
/// A target that is not there, or whose seeds are refused; a folder that cannot be written.
pub fn attack(name: &str, limits: &Limits) -> anyhow::Result<Row> {
    let mut target = targets::open(name)?;
    for (number, seed) in target.seeds.clone().iter().enumerate() {
        ensure!(
            (target.run)(seed),
            "{name}: seed {number} is refused, so the run would show nothing"
        );
    }
    // Panics are counted, not shown.
    std::panic::set_hook(Box::new(|_| {}));
    let begun = Instant::now();
    let since = Arc::new(AtomicU64::new(u64::MAX));
    watch(begun, since.clone());
    let mut rng = ChaCha8Rng::seed_from_u64(limits.seed);
    let mut row = Row {
        target: name.into(),
        ..Row::default()
    };
    let last = last_input(std::process::id());
    std::fs::create_dir_all(&limits.out)?;
    while row.executions < limits.executions && begun.elapsed().as_secs_f64() < limits.seconds {
        let input = mutated(&target.seeds, &mut rng);
        if target.may_abort {
            std::fs::write(&last, &input)?;
        }
        row.executions += 1;
        since.store(begun.elapsed().as_millis() as u64, Relaxed);
        let (outcome, most) = most_held(|| catch_unwind(AssertUnwindSafe(|| (target.run)(&input))));
        since.store(u64::MAX, Relaxed);
        row.most_mib = row.most_mib.max(most as f64 / f64::from(1 << 20));
        let keep = |kind: &str, before: u64| -> anyhow::Result<()> {
            if before < KEPT {
                let file = limits.out.join(format!("{name}-{kind}-{before}"));
                std::fs::write(file, &input)?;
            }
            Ok(())
        };
        match outcome {
            Ok(accepted) => row.accepted += u64::from(accepted),
            Err(_) => {
                keep("panic", row.panics)?;
                row.panics += 1;
            }
        }
        if most > target.ceiling {
            keep("memory", row.over_memory)?;
            row.over_memory += 1;
        }
    }
    row.seconds = begun.elapsed().as_secs_f64();
    Ok(row)
}

/// Ends the process if a call hangs; `since` is when the call began, milliseconds after `begun`.
fn watch(begun: Instant, since: Arc<AtomicU64>) {
    std::thread::spawn(move || {
        let mut seen = (u64::MAX, Duration::ZERO);
        loop {
            std::thread::sleep(Duration::from_millis(200));
            let since = since.load(Relaxed);
            if since != seen.0 {
                seen = (since, processor_time());
            } else if since != u64::MAX {
                let waited = begun.elapsed().saturating_sub(Duration::from_millis(since));
                if processor_time() - seen.1 > PATIENCE || waited > PATIENCE * WAIT {
                    std::process::exit(HANGS);
                }
            }
        }
    });
}

/// How long this process has had a processor.
fn processor_time() -> Duration {
    let mut time = libc::timespec {
        tv_sec: 0,
        tv_nsec: 0,
    };
    // SAFETY: `time` lives for the call.
    let failed = unsafe { libc::clock_gettime(libc::CLOCK_PROCESS_CPUTIME_ID, &raw mut time) };
    assert_eq!(failed, 0, "Linux has this clock");
    Duration::new(time.tv_sec as u64, time.tv_nsec as u32)
}
