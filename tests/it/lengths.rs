//! Sweeps of unequal length, from a folder of tables to the report.

use std::fmt::Write as _;
use std::path::Path;

use crate::command::{Lab, expect, json, output_of, refusal, tactnet};

/// Writes a folder of three materials with twelve sweeps of 40 to 95 frames each. A material has a pitch of its own.
fn write_sweeps(folder: &Path) {
    let mut state = 3_u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1_u64 << 24) as f64
    };
    for (material, name) in ["cork", "felt", "wood"].into_iter().enumerate() {
        let pitch = 0.3 + 0.5 * material as f64;
        std::fs::create_dir_all(folder.join(name)).unwrap();
        for sweep in 0..12 {
            let (phase, frames) = (6.0 * random(), 40 + (sweep * 5 + material * 17) % 56);
            let mut text = String::new();
            for frame in 0..frames {
                let tone = (pitch * f64::from(frame as u32) + phase).sin();
                let mut taxel = || 100.0 + 20.0 * tone + 4.0 * random();
                let _ = writeln!(text, "{:.3},{:.3},{:.3}", taxel(), taxel(), taxel());
            }
            std::fs::write(folder.join(name).join(format!("{sweep:02}.csv")), text).unwrap();
        }
    }
}

#[test]
fn sweeps_of_unequal_length_train_and_predict_and_are_reported_by_length() {
    let lab = Lab::new();
    let folder = lab.path("sweeps");
    write_sweeps(&folder);
    let with = |command: &[&str], options: &[&str]| {
        let mut found = tactnet(command);
        found.arg(&folder).args(options);
        found
    };
    let refused = refusal(with(&["train", "--rate", "100", "--data"], &[]));
    assert!(refused.contains("`--steps all`"), "{refused}");
    // Without the option the check names the lengths; with it there is nothing to find.
    expect(1, with(&["data", "check"], &["--rate", "100"]));
    let check = json(with(
        &["data", "check"],
        &["--rate", "100", "--steps", "all", "--json"],
    ));
    assert_eq!(check["errors"], 0, "{check}");
    let info = json(with(
        &["data", "info"],
        &["--rate", "100", "--steps", "all", "--json"],
    ));
    assert_eq!(info["lengths"]["shortest"], 40);
    let longest = info["lengths"]["longest"].as_u64().unwrap();
    assert_eq!(info["shape"]["steps"], longest);

    let train = ["train", "--model", "lda", "--rate", "100", "--data"];
    let out = lab.path("run");
    let options = ["--steps", "all", "--out", out.to_str().unwrap()];
    let text = output_of(with(&train, &options));
    assert!(text.contains("accuracy by length"), "{text}");
    let result = lab.json("run/result.json");
    assert!(
        result["accuracy_one_sweep"]["mean"].as_f64().unwrap() > 0.8,
        "{result}"
    );
    let groups = result["evaluations"]["plain"]["by_length"]
        .as_array()
        .unwrap();
    assert!(groups.len() > 1, "{result}");

    // Other data is read with the run's setting; an imported file states the lengths.
    lab.run("data import @sweeps --steps all --rate 100 --out @sweeps.h5");
    let eval =
        |data: &str| json(lab.command(&format!("eval --json @run --data @{data} --rate 100")));
    let (from_tables, from_hdf5) = (eval("sweeps"), eval("sweeps.h5"));
    let accuracy = |found: &serde_json::Value| found["evaluations"]["plain"]["one_sweep"].clone();
    assert_eq!(accuracy(&from_tables), accuracy(&from_hdf5));
    let predict = lab.command("predict --json @run --data @sweeps --rate 100");
    assert_eq!(json(predict)["sweeps"].as_array().unwrap().len(), 36);
    // The shortest of the training sweeps of a run on equal lengths is too short.
    let cut = lab.path("cut");
    let options = ["--steps", "60", "--out", cut.to_str().unwrap()];
    let refused = refusal(with(&train, &options));
    assert!(refused.contains("at least the 60 frames"), "{refused}");
}

#[test]
fn the_report_of_unequal_lengths_has_accuracies_by_length_and_a_probe() {
    let lab = Lab::new();
    write_sweeps(&lab.path("sweeps"));
    let mut command = tactnet(["experiment", "run", "crossval_baselines"]);
    let data = format!("data=[{:?}]", lab.path("sweeps").display().to_string());
    let settings = [
        data.as_str(),
        "models=[\"means\", \"lda\"]",
        "steps=all",
        "rate_hz=100",
        "folds=2",
        "probes=[]",
    ];
    for setting in settings {
        command.args(["--set", setting]);
    }
    command.arg("--out").arg(lab.path("report"));
    expect(0, command);
    let summary = lab.json("report/summary.json");
    let contender = &summary["contenders"][0];
    assert_eq!(
        contender["by_length"].as_array().unwrap().len(),
        4,
        "{contender}"
    );
    let probe = summary["audits"][0]["sweep_length"].as_f64().unwrap();
    assert!((0.0..0.8).contains(&probe), "{probe}");
    let page = std::fs::read_to_string(lab.path("report/report.html")).unwrap();
    assert!(page.contains("id=\"lengths\""));
}
