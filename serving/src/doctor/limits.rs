//! What this user may have: descriptors, realtime priorities, locked memory.

use super::{Check, Status};

pub(super) fn checks() -> Vec<Check> {
    vec![descriptors(), priority(), locked_memory()]
}

fn limit(resource: libc::__rlimit_resource_t) -> u64 {
    let mut found = libc::rlimit {
        rlim_cur: 0,
        rlim_max: 0,
    };
    // SAFETY: a place for the answer, which stays zero if the call fails.
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
            "channels and a page for browsers want 1024: `ulimit -n 4096`, or LimitNOFILE in a unit",
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
            "for `serve --priority 60`: `@robot - rtprio 60` in /etc/security/limits.conf, or LimitRTPRIO in a unit",
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
        "for `serve --lock-memory`: `@robot - memlock unlimited` in /etc/security/limits.conf, or LimitMEMLOCK in a unit",
    )
}
