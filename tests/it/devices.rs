//! `--device` and `bench device`, on machines with and without a GPU.

use serde_json::Value;

use crate::command::{Lab, RecipeChange, json, messages_of, refusal, tactnet};

#[test]
fn every_device_that_is_present_is_timed() {
    let mut bench = tactnet(["bench", "device", "--json", "--sweeps", "5"]);
    bench.args(["--materials", "3", "--steps", "60", "--adversarial", "2"]);
    let found = json(bench);
    assert_eq!(found["sweeps"], 12, "{found}");
    let rows = found["rows"].as_array().unwrap();
    for work in ["step", "epoch", "adversarial step"] {
        let of_cpu = |row: &&Value| row["device"] == "cpu" && row["work"] == work;
        let row = rows.iter().find(of_cpu).unwrap();
        assert!(row["ms"].as_f64().unwrap() > 0.0, "{row}");
    }
    assert!(rows.len() >= 3, "{found}");
    // The processor trains one network at a time.
    let stacked = |row: &&Value| {
        row["work"]
            .as_str()
            .is_some_and(|of| of.starts_with("stacked"))
    };
    for row in rows.iter().filter(stacked) {
        assert_ne!(row["device"], "cpu", "{found}");
    }
}

#[test]
fn the_fastest_device_is_named() {
    let lab = Lab::new();
    let mut train = lab.train(&lab.recipe(RecipeChange::default()), "run");
    train.args(["--device", "auto"]);
    let said = messages_of(train);
    assert!(said.starts_with("device: "), "{said}");
}

#[cfg(feature = "vulkan")]
#[test]
fn a_machine_without_a_driver_gets_one_line() {
    let lab = Lab::new();
    let mut train = lab.train(&lab.recipe(RecipeChange::default()), "run");
    train.args(["--device", "vulkan"]);
    for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
        train.env(variable, lab.path("no-driver.json"));
    }
    let said = refusal(train);
    let error = said.lines().last().unwrap();
    assert!(error.contains("no GPU with a driver was found"), "{said}");
    assert!(!said.contains("panicked"), "{said}");
}
