//! Checks of processor, memory and kernel.

use std::fs;

use super::{Check, Status};

/// Minimum kernel version: the first with `futex_waitv`, which waits for several channels at once.
const KERNEL: (u32, u32) = (5, 16);

pub(super) fn checks() -> Vec<Check> {
    let mut checks = vec![processor(), memory(), kernel()];
    checks.extend(governor());
    checks
}

fn processor() -> Check {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let route = instruction_set();
    let found = format!("{cores} cores, {route}");
    match (route, cores) {
        ("neither AVX-512 nor AVX2", _) => Check::not_ok(
            Status::Warning,
            "processor",
            found,
            "training and prediction are several times faster on a processor with AVX2",
        ),
        (_, 1) => Check::not_ok(
            Status::Warning,
            "processor",
            found,
            "on a robot the classifier needs a core of its own beside the skin driver",
        ),
        _ => Check::ok("processor", found),
    }
}

fn instruction_set() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx512f") {
            return "AVX-512";
        }
        if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
        {
            return "AVX2";
        }
    }
    "neither AVX-512 nor AVX2"
}

fn memory() -> Check {
    let text = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let kib = |name: &str| -> Option<u64> {
        let line = text.lines().find(|line| line.starts_with(name))?;
        line.split_whitespace().nth(1)?.parse().ok()
    };
    let (Some(total), Some(free)) = (kib("MemTotal:"), kib("MemAvailable:")) else {
        return Check::not_ok(
            Status::Note,
            "memory",
            "unknown",
            "/proc/meminfo cannot be read",
        );
    };
    let gib = |kib: u64| kib as f64 / f64::from(1 << 20);
    let found = format!("{:.1} of {:.1} GiB free", gib(free), gib(total));
    if free < 2 << 20 {
        return Check::not_ok(
            Status::Warning,
            "memory",
            found,
            "training on a data set of TactMat's size needs about 2 GiB",
        );
    }
    Check::ok("memory", found)
}

fn kernel() -> Check {
    let release = fs::read_to_string("/proc/sys/kernel/osrelease").unwrap_or_default();
    let release = release.trim();
    let mut numbers = release
        .split(['.', '-'])
        .map_while(|part| part.parse().ok());
    let version = (numbers.next().unwrap_or(0), numbers.next().unwrap_or(0));
    if version < KERNEL {
        return Check::not_ok(
            Status::Failure,
            "kernel",
            if release.is_empty() {
                "not Linux"
            } else {
                release
            },
            format!("channels need Linux {}.{} or newer", KERNEL.0, KERNEL.1),
        );
    }
    let realtime = fs::read_to_string("/sys/kernel/realtime").is_ok_and(|text| text.trim() == "1");
    Check::ok(
        "kernel",
        format!(
            "{release}, {}",
            if realtime { "realtime" } else { "not realtime" }
        ),
    )
}

/// Checks the clock governor; `None` if the system does not report it, as most virtual machines.
fn governor() -> Option<Check> {
    let path = "/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor";
    let found = fs::read_to_string(path).ok()?;
    let found = found.trim();
    Some(if found == "performance" {
        Check::ok("clock", found)
    } else {
        Check::not_ok(
            Status::Warning,
            "clock",
            found,
            "a low clock delays predictions: run `cpupower frequency-set -g performance`",
        )
    })
}
