//! Every target for a moment, by the program that `tests/attacks/run.sh` runs for longer.

use std::process::Command;

use serde_json::Value;

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
    assert_eq!(rows.len(), tactnet_attacks::NAMES.len());
    for row in rows {
        assert!(row["executions"].as_u64().unwrap() > 20, "{row}");
        // Some changes do no harm.
        assert!(row["accepted"].as_u64().unwrap() > 0, "{row}");
    }
}
