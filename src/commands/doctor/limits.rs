//! Limits of this user: file descriptors, real-time priorities, locked memory.

use super::{Check, Status};

pub(super) fn checks() -> Vec<Check> {
    vec![descriptors(), priority(), locked_memory()]
}

fn limit(resource: libc::__rlimit_resource_t) -> u64 {
    let mut found = libc::rlimit {
        rlim_cur: 0,
        rlim_max: 0,
    };
    // SAFETY: `found` is a valid place for the result; it stays zero if the call fails.
    unsafe { libc::getrlimit(resource, &mut found) };
    found.rlim_cur
}

fn is_root() -> bool {
    // SAFETY: a system call without arguments that always succeeds.
    unsafe { libc::geteuid() == 0 }
}

fn descriptors() -> Check {
    let found = limit(libc::RLIMIT_NOFILE);
    if found < 1024 {
        return Check::not_ok(
            Status::Warning,
            "open files",
            found.to_string(),
            "channels and the live page need 1024: run `ulimit -n 4096`, or set LimitNOFILE in the systemd unit",
        );
    }
    Check::ok("open files", found.to_string())
}

fn priority() -> Check {
    let most = limit(libc::RLIMIT_RTPRIO);
    if is_root() {
        return Check::ok("realtime", "any priority, as root");
    }
    if most == 0 {
        return Check::not_ok(
            Status::Note,
            "realtime",
            "no realtime priority",
            "needed by `serve --priority 60`: add `@robot - rtprio 60` to /etc/security/limits.conf, or set LimitRTPRIO in the systemd unit",
        );
    }
    Check::ok("realtime", format!("priorities up to {most}"))
}

fn locked_memory() -> Check {
    let most = limit(libc::RLIMIT_MEMLOCK);
    if is_root() || most == libc::RLIM_INFINITY {
        return Check::ok("locked memory", "no limit");
    }
    Check::not_ok(
        Status::Note,
        "locked memory",
        format!("{} KiB", most >> 10),
        "needed by `serve --lock-memory`: add `@robot - memlock unlimited` to /etc/security/limits.conf, or set LimitMEMLOCK in the systemd unit",
    )
}
