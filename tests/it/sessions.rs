//! Recordings of a robot on ten floors, eight of which were recorded in one session each.

use std::fmt::Write as _;
use std::path::Path;

use crate::command::{Lab, assert_says, expect, json, output_of, stderr, stdout};

/// Sentence about the floors of one session each.
const CONFOUNDED: &str = "8 of 10 materials were recorded in one session each: this accuracy cannot be told from recognising the session";

/// Writes a table of sweeps of ten floors. Floors 0 to 7 have a session each, floors 8 and 9 share five sessions. Each floor of a session
/// has a level of its own, so that nothing but the session tells the floors apart.
fn write_floors(path: &Path) {
    let mut state = 1_u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f64 / (1_u64 << 24) as f64
    };
    let alone = (0..8).map(|floor| (floor, floor, 10));
    let shared = (8..13).flat_map(|session| [(8, session, 2), (9, session, 2)]);
    let mut table = String::from("sweep,time,material,session,t0,t1,t2,t3\n");
    let mut sweep = 0;
    for (floor, session, sweeps) in alone.chain(shared) {
        let level = 1000.0 * random();
        for _ in 0..sweeps {
            for frame in 0..20 {
                let time = 0.01 * f64::from(frame);
                let _ = write!(table, "{sweep},{time:.2},floor {floor},day {session}");
                for _ in 0..4 {
                    let _ = write!(table, ",{:.3}", level + random());
                }
                table.push('\n');
            }
            sweep += 1;
        }
    }
    std::fs::write(path, table).unwrap();
}

/// Returns `tactnet train` on the floors by nearest taxel means, into `out`.
fn train(lab: &Lab, out: &str, options: &[&str]) -> std::process::Command {
    let line = format!("train --model means --data @floors.csv --out @{out}");
    lab.command_with(&line, options)
}

#[test]
fn what_recognising_the_session_contributes_is_said_by_train_and_eval() {
    let lab = Lab::new();
    write_floors(&lab.path("floors.csv"));

    let strict = expect(2, train(&lab, "strict", &["--strict"]));
    let refused = stderr(&strict);
    assert!(refused.contains(CONFOUNDED), "{refused}");
    assert_says!(refused, "without --strict it is a warning");
    assert!(!lab.path("strict").exists());

    // Whole sessions are held out by default.
    let output = expect(0, train(&lab, "sessions", &[]));
    assert!(stderr(&output).contains(&format!("warning: {CONFOUNDED} (80 % of the sweeps: ")));
    let text = stdout(&output);
    assert!(text.contains("whole blocks"), "{text}");
    assert_says!(
        text,
        "\nsweeps of the same recordings in training: 100.0 % ("
    );
    assert_says!(
        text,
        "\nnot tested: 8 of 10 materials were recorded in one session each"
    );
    let result = lab.json("sessions/result.json");
    assert_eq!(result["random_fold"]["one_sweep"]["mean"], 1.0);
    assert_eq!(result["random_fold"]["split"], "fold 1 of 5");
    assert!(
        result["accuracy_one_sweep"]["mean"].as_f64().unwrap() < 0.8,
        "{result}"
    );
    assert_eq!(result["confounded"]["n_confounded"], 0);

    let output = expect(0, train(&lab, "folds", &["--split", "k-fold"]));
    let text = stdout(&output);
    assert!(text.contains(CONFOUNDED), "{text}");
    let of_others =
        "\nmaterials that share their sessions with others (floor 8, floor 9): 100.0 % (";
    assert!(text.contains(of_others), "{text}");
    let result = lab.json("folds/result.json");
    assert_eq!(result["random_fold"], serde_json::Value::Null);
    assert_eq!(
        result["confounded"]["unconfounded"],
        serde_json::json!(["floor 8", "floor 9"])
    );
    assert_eq!(result["confounded"]["unconfounded_one_sweep"]["mean"], 1.0);

    let eval = || lab.command("eval @folds");
    let text = output_of(eval());
    assert!(
        text.contains(CONFOUNDED) && text.contains(of_others),
        "{text}"
    );
    let row = text
        .lines()
        .find(|line| line.starts_with("floor 8 "))
        .unwrap();
    assert!(row.contains("100.0 (") && row.ends_with(" 2"), "{row}");
    let mut json = eval();
    json.arg("--json");
    let again: serde_json::Value = serde_json::from_str(&output_of(json)).unwrap();
    assert_eq!(again["confounded"], result["confounded"]);
}

#[test]
fn a_report_has_the_accuracy_on_the_materials_that_share_their_sessions() {
    let lab = Lab::new();
    write_floors(&lab.path("floors.csv"));
    let summary = json(lab.command(
        "experiment run crossval_baselines --json --set folds=2 --set data=@floors.csv --out @out \
         --set models=[\"means\"] --set probes=[\"first-frame\"] --set split=k-fold --set groups=0",
    ));
    let contender = &summary["contenders"][0];
    assert_eq!(
        contender["confounded"]["unconfounded"],
        serde_json::json!(["floor 8", "floor 9"])
    );
    assert_eq!(contender["confounded"]["unconfounded_one_sweep"]["n"], 8);
    let audit = &summary["audits"][0];
    // If both sweeps of a floor and session are tested, none is left to recognise it by.
    assert!(
        audit["block_identity"]["accuracy"].as_f64().unwrap() > 0.8,
        "{audit}"
    );
    assert!(
        audit["block_identity"]["guessing"].as_f64().unwrap() < 0.4,
        "{audit}"
    );
    // The table is sorted by floor within each session, which is no order of recording.
    assert_eq!(audit["recording_order"], serde_json::Value::Null);
    let page = String::from_utf8(lab.read("out/report.html"))
        .unwrap()
        .replace('\u{a0}', " ");
    assert!(page.contains(CONFOUNDED));
    assert!(page.contains("On the materials that share their sessions with others (floor 8 and floor 9) it is 100.0 % ["));
    assert!(page.contains("The first frame alone gives 100.0 % (model: 100.0 %)"));
    let text = stdout(&lab.run("experiment report @out"));
    assert_says!(
        text,
        "accuracy on the materials that share their sessions with others [%]: means, "
    );
}
