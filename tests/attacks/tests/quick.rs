//! A short attack on every target, with the program that `tests/attacks/run.sh` runs for longer.

use std::process::Command;

use serde_json::Value;
use tactnet_attacks::{Allocator, most_held, open};

#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

#[test]
fn damaged_input_breaks_nothing() {
    let out = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_tactnet-attacks"))
        .args(["--seconds", "0.5", "--out"])
        .arg(out.path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    let report: Value = serde_json::from_slice(&output.stdout).expect(&said);
    assert!(output.status.success(), "{report:#}\n{said}");
    let rows = report["rows"].as_array().unwrap();
    let skipped = report["skipped"].as_array().unwrap();
    assert_eq!(rows.len() + skipped.len(), tactnet_attacks::NAMES.len());
    let lacks_parquet = !tactnet_data::format::READS_PARQUET;
    assert_eq!(skipped.len(), usize::from(lacks_parquet), "{skipped:?}");
    for target in skipped {
        assert_eq!(target["target"], "parquet");
        let reason = target["reason"].as_str().unwrap();
        assert!(reason.contains("--features parquet"), "{reason}");
        assert!(said.contains("parquet: skipped"), "{said}");
    }
    for row in rows {
        assert!(row["executions"].as_u64().unwrap() > 20, "{row}");
        // Some changes are harmless.
        assert!(row["accepted"].as_u64().unwrap() > 0, "{row}");
    }
}

#[test]
fn a_record_that_says_it_is_long_takes_no_more_memory_than_its_file() {
    let mut target = open("mcap").unwrap();
    let mut input = target.seeds[0].clone();
    // The length of the first record follows the magic bytes and its kind.
    input[9..17].copy_from_slice(&((64_u64 << 20) - 1).to_le_bytes());
    let (accepted, most) = most_held(|| (target.run)(&input));
    assert!(!accepted, "the record is cut off");
    assert!(most < 8 << 20, "{most} bytes for {}", input.len());
}
