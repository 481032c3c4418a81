//! Checks of the folder with the channels' shared memory, and of its buses.

use std::fs;
use std::path::Path;

use tactnet_channel::{MEMORY_FOLDER_VARIABLE, free_memory, memory_folder};

use super::{Check, Status};

/// Maximum memory of the channels of one finger and its classifier, in bytes.
const NEEDED: u64 = 64 << 20;

pub(super) fn checks() -> Vec<Check> {
    let folder = match memory_folder() {
        Ok(folder) => folder,
        Err(error) => {
            return vec![Check::not_ok(
                Status::Failure,
                "channels",
                error.to_string(),
                format!("set {MEMORY_FOLDER_VARIABLE} to a folder in memory that you own"),
            )];
        }
    };
    let free = free_memory(&folder);
    let found = format!("{}, {} MiB free", folder.display(), free >> 20);
    let channels = if free < NEEDED {
        Check::not_ok(
            Status::Warning,
            "channels",
            found,
            format!("a finger and its classifier need {} MiB", NEEDED >> 20),
        )
    } else {
        Check::ok("channels", found)
    };
    vec![channels, buses(&folder)]
}

/// Checks that a hub holds each existing bus.
fn buses(folder: &Path) -> Check {
    let mut held = Vec::new();
    let mut left = Vec::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let lock = fs::File::open(entry.path().join("hub"));
        let is_held = lock.is_ok_and(|file| file.try_lock_shared().is_err());
        if is_held { &mut held } else { &mut left }.push(name);
    }
    held.sort();
    left.sort();
    if left.is_empty() {
        return Check::ok(
            "hubs",
            if held.is_empty() {
                "none is running".into()
            } else {
                held.join(", ")
            },
        );
    }
    Check::not_ok(
        Status::Note,
        "hubs",
        format!(
            "{}; buses without a hub: {}",
            if held.is_empty() {
                "none is running".into()
            } else {
                held.join(", ")
            },
            left.join(", ")
        ),
        format!(
            "`tactnet channel hub` takes over a bus; to remove an unused one, delete its folder in {}",
            folder.display()
        ),
    )
}
