//! Attack on one target until its time or number of executions is over.

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

/// Processor time after which a call counts as hanging.
const PATIENCE: Duration = Duration::from_secs(10);
/// Factor by which the waiting time may be longer, because other programs use the processor.
const WAIT: u32 = 20;
/// Exit code of a process that hangs.
pub const HANGS: i32 = 3;
/// Maximum number of inputs kept per kind of failure.
const KEPT: u64 = 5;

/// Limits and seed of an attack.
#[derive(Debug, Clone)]
pub struct Limits {
    /// Maximum duration, in s.
    pub seconds: f64,
    /// Maximum number of inputs.
    pub executions: u64,
    /// Seed of all random choices.
    pub seed: u64,
    /// Folder for failing inputs.
    pub out: PathBuf,
}

/// Result of one target.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Row {
    /// Name of the target.
    pub target: String,
    /// Number of executions.
    pub executions: u64,
    /// Number of mutated inputs that the target accepted.
    pub accepted: u64,
    /// Number of calls that panicked or ended the process.
    pub panics: u64,
    /// Number of calls that took over 10 s of processor time, or 200 s in total.
    pub hangs: u64,
    /// Number of calls above the target's memory ceiling.
    pub over_memory: u64,
    /// Number of data losses, for targets where they are possible.
    pub lost: u64,
    /// Peak memory of a call, in MiB.
    pub most_mib: f64,
    /// Duration, in s.
    pub seconds: f64,
}

/// Returns the file in shared memory with the current input of a process.
pub(crate) fn last_input(process: u32) -> PathBuf {
    format!("/dev/shm/tactnet-attacks-{process}").into()
}

/// Attacks `name` in this process.
///
/// # Errors
/// Fails if the target does not exist or refuses its seeds, or if a folder cannot be written.
pub fn attack(name: &str, limits: &Limits) -> anyhow::Result<Row> {
    let mut target = targets::open(name)?;
    for (number, seed) in target.seeds.clone().iter().enumerate() {
        ensure!(
            (target.run)(seed),
            "{name}: seed {number} is refused, so the run would show nothing"
        );
    }
    // Panics are counted, not printed.
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

/// Ends the process if a call hangs.
///
/// - `since`: start of the call, in ms after `begun`
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

/// Returns the processor time of this process.
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
