//! Questions other than cross-validation, with the real binary on a small twin: transfer, differentiation, unknown
//! materials, sequential sweeps.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime};

use serde_json::Value;

use crate::command::{
    Lab, RecipeChange, SPECTRA, assert_says, expect, json, refusal, signal, stderr,
};

/// A twin of eight materials with thirty sweeps each, and a small recipe.
fn lab() -> Lab {
    lab_of(8)
}

/// The same with a recipe that barely trains, for tests of a study's course.
fn quick_lab() -> Lab {
    lab_of(2)
}

fn lab_of(epochs: usize) -> Lab {
    let lab = Lab::new();
    lab.twin("eight.h5", "--materials 8 --sweeps 30 --steps 120");
    lab.recipe_for(epochs);
    lab
}

fn study(lab: &Lab, name: &str, settings: &[&str], out: &str) -> Command {
    let own = "--set data=@eight.h5 --set models=[\"@small.toml\"]";
    let line = format!("experiment run {name} --json --out @{out} {own}");
    let more: Vec<&str> = settings.iter().flat_map(|of| ["--set", *of]).collect();
    lab.command_with(&line, &more)
}

fn rows(summary: &Value) -> &Vec<Value> {
    summary["rows"].as_array().unwrap()
}

const NSHOT: [&str; 3] = [
    "splits=2",
    "shots=[1, 3, 40]",
    "study={kind=\"nshot\", new_materials=3, scratch_folds=2}",
];

#[test]
fn n_shot_transfer_measures_every_method_the_same_way_however_many_threads() {
    let lab = quick_lab();
    let mut two = study(&lab, "nshot", &NSHOT, "two");
    two.args(["--jobs", "2"]);
    let two = json(two);
    let mut one = study(&lab, "nshot", &NSHOT, "one");
    one.args(["--jobs", "1"]);
    let one = json(one);
    assert_eq!(one["rows"], two["rows"], "threads change nothing");
    // Eleven methods; no material has 40 training sweeps.
    assert_eq!(rows(&one).len(), 22);
    for row in rows(&one) {
        let at = |field: &str| row[field].as_f64().unwrap();
        assert_eq!(row["n"], 2, "two draws of the materials");
        assert!((0.0..=1.0).contains(&at("mean")), "{row}");
        assert!(
            // Identical draws have no confidence interval.
            row["ci95"].is_null()
                || row["ci95"][0].as_f64() <= Some(at("mean"))
                    && Some(at("mean")) <= row["ci95"][1].as_f64(),
            "{row}"
        );
        // Three materials with thirty sweeps each are tested once; from scratch, in two of five folds.
        let decisions = if row["method"] == "nk" {
            2 * 36
        } else {
            2 * 90
        };
        assert_eq!(row["decisions"], decisions, "{row}");
    }
    let methods = |shots: usize| {
        rows(&one)
            .iter()
            .filter(move |row| row["shots"] == shots)
            .count()
    };
    assert_eq!((methods(1), methods(3)), (11, 11));
    assert_eq!(one["comparisons"].as_array().unwrap().len(), 20);
    let page = String::from_utf8(lab.read("one/report.html")).unwrap();
    assert!(page.contains("Methods of the thesis: accuracy against shots"));
    let again = expect(0, study(&lab, "nshot", &NSHOT, "one"));
    assert_says!(stderr(&again), "2 tasks, 2 done");
}

#[test]
fn networks_are_compared_under_every_circumstance_with_what_they_cost() {
    let lab = lab();
    let spectra = lab.recipe(RecipeChange {
        epochs: Some(8),
        layers: SPECTRA,
        ..RecipeChange::default()
    });
    std::fs::rename(&spectra, lab.path("spectra.toml")).unwrap();
    lab.recipe_for(8);
    let both = format!(
        "models=[\"{}\", \"{}\"]",
        lab.path("small.toml").display(),
        lab.path("spectra.toml").display()
    );
    let settings = ["folds=2", "sweeps=[5, 99]", "forces=[0.7]", &both];
    let found = json(study(&lab, "networks", &settings, "networks"));
    let costs: Vec<&Value> = rows(&found)
        .iter()
        .filter(|row| row["network"].is_string())
        .collect();
    // A file cannot be generated again with other forces, and no fold has 99 sweeps. Prediction methods: as trained,
    // and MC dropout.
    let conditions = [
        "as trained",
        "as trained",
        "5 sweeps a material",
        "a block left out",
    ];
    assert_eq!(costs.len(), 2 * conditions.len(), "{costs:?}");
    for condition in conditions {
        let own: Vec<&&Value> = costs
            .iter()
            .filter(|row| row["condition"] == condition && row["method"] == "plain")
            .collect();
        assert_eq!(own.len(), 2, "{condition}");
        assert!(own.iter().all(|row| row["accuracy"] == row["mean"]));
    }
    let cost = |network: &str, what: &str| {
        let own = costs
            .iter()
            .find(|row| row["network"] == network && row["condition"] == "as trained");
        own.unwrap()[what].as_f64().unwrap()
    };
    assert!(cost("spectra", "multiply_adds") < cost("small", "multiply_adds"));
    assert!(cost("small", "train_seconds") > 0.0);
    // Pairs with the same method, in three conditions, one of them with dropout.
    assert_eq!(found["comparisons"].as_array().unwrap().len(), 4);
}

#[test]
fn models_of_all_kinds_are_tested_under_disturbances() {
    let lab = lab();
    let both = format!("models=[\"{}\", \"lda\"]", lab.path("small.toml").display());
    let settings = [
        "folds=2",
        "dead=[0.0625]",
        "gains=[2.0]",
        "speeds=[2.0]",
        "offsets=[]",
        "drifts=[1.0]",
        &both,
    ];
    let found = json(study(&lab, "robustness", &settings, "robustness"));
    let conditions = [
        "clean",
        "dead taxels 1",
        "masked taxels 1",
        "gain \u{d7} 2",
        "speed \u{d7} 2",
        "drift \u{b1} 1",
    ];
    for measure in ["accuracy", "expected calibration error"] {
        for model in ["small", "lda"] {
            let own = rows(&found)
                .iter()
                .filter(|row| row["measure"] == measure && row["model"] == model);
            let settings: Vec<&str> = own.map(|row| row["setting"].as_str().unwrap()).collect();
            assert_eq!(settings, conditions, "{measure} of {model}");
        }
    }
    let comparisons = found["comparisons"].as_array().unwrap();
    assert_eq!(comparisons.len(), conditions.len());
    let page = String::from_utf8(lab.read("robustness/report.html")).unwrap();
    assert!(page.contains("Dead taxels that are masked: accuracy on twin (eight)"));
    let refused = study(&lab, "robustness", &["dead=[1.5]"], "refused");
    assert!(refusal(refused).contains("shares between 0 and 1"));
}

#[test]
fn the_twin_is_felt_again_weaker_and_faster() {
    let lab = Lab::new();
    lab.recipe(RecipeChange {
        layers: SPECTRA,
        ..RecipeChange::default()
    });
    let found = json(lab.command(
        "experiment run networks --json --out @felt --set models=[\"@small.toml\"] --set folds=1 \
         --set epochs=1 --set steps=100 --set sweeps=[] --set blocks=false --set forces=[0.5] \
         --set speeds=[1.5]",
    ));
    let loss = |condition: &str| {
        let own = rows(&found).iter().find(|row| {
            row["setting"] == condition
                && row["method"] == "plain"
                && row["measure"] == "negative log-likelihood"
        });
        own.unwrap()["mean"].as_f64().unwrap()
    };
    // The same network on the same sweeps with another force and speed.
    assert!(loss("force \u{d7} 0.5") != loss("as trained"));
    assert!(loss("speed \u{d7} 1.5") != loss("as trained"));
}

#[test]
fn differentiation_unknown_and_sequential_studies_report_what_they_measured() {
    let lab = lab();
    let found = json(study(
        &lab,
        "differentiate",
        &["splits=2", "shots=[1, 2]"],
        "differentiate",
    ));
    // Five judges with one and two sweeps; the hard pairs exist for TactMat's materials only.
    assert_eq!(rows(&found).len(), 10);
    assert!(rows(&found).iter().all(|row| row["decisions"] == 2 * 2700));
    // The small network is weak, but better than chance.
    let threshold = rows(&found)
        .iter()
        .find(|row| row["method"] == "threshold" && row["sweeps"] == 1);
    let accuracy = threshold.unwrap()["mean"].as_f64().unwrap();
    assert!(accuracy > 0.5, "{accuracy}");

    let settings = ["splits=2", "study={kind=\"unknown\", new_materials=3}"];
    let found = json(study(&lab, "unknown", &settings, "unknown"));
    // Four scores: three measures for one sweep; for three sweeps only the area, because five groups cannot guarantee 5
    // % false alarms. Two conformal targets with two measures.
    assert_eq!(rows(&found).len(), 4 * (3 + 1) + 4);
    for row in rows(&found)
        .iter()
        .filter(|row| row["measure"] != "set size")
    {
        assert!(
            (0.0..=1.0).contains(&row["mean"].as_f64().unwrap()),
            "{row}"
        );
    }

    let found = json(study(
        &lab,
        "sequential",
        &["runs=1", "folds=1"],
        "sequential",
    ));
    let mean = |measure: &str, setting: &str| {
        let row = rows(&found).iter().find(|row| {
            row["measure"] == measure && row["setting"] == setting && row["method"] == "plain"
        });
        row.unwrap_or_else(|| panic!("no {measure} {setting}"))["mean"]
            .as_f64()
            .unwrap()
    };
    assert_eq!(mean("mean sweeps", "fixed 3"), 3.0);
    assert!(mean("mean sweeps", "until 0.8") <= mean("mean sweeps", "until 0.99"));
    assert!(mean("accuracy", "fixed 3") >= mean("accuracy", "fixed 1") - 0.1);
}

/// Returns the mean of one row.
fn mean(summary: &Value, wanted: &[(&str, &str)]) -> f64 {
    let row = rows(summary).iter().find(|row| {
        wanted
            .iter()
            .all(|(field, value)| row[*field].to_string().trim_matches('"') == *value)
    });
    row.unwrap_or_else(|| panic!("no {wanted:?}"))["mean"]
        .as_f64()
        .unwrap()
}

#[test]
fn decisions_are_counted_over_the_splits_and_sweeps_that_were_asked_for() {
    let lab = lab();
    let settings = ["splits=2", "shots=[1, 2]", "epochs=2"];
    for (name, own) in [
        (
            "unknown",
            &["study={kind=\"unknown\", new_materials=3}"][..],
        ),
        ("sequential", &[]),
    ] {
        let found = json(study(&lab, name, &[&settings[..], own].concat(), name));
        assert_eq!(found["tasks"], 2, "{name}");
        assert!(rows(&found).iter().all(|row| row["n"] == 2), "{name}");
        if name == "sequential" {
            assert_eq!(
                mean(
                    &found,
                    &[("setting", "fixed 2"), ("measure", "mean sweeps")]
                ),
                2.0
            );
        } else {
            assert!(rows(&found).iter().any(|row| row["sweeps"] == 2), "{name}");
            assert!(rows(&found).iter().all(|row| row["sweeps"] != 3), "{name}");
        }
    }
}

#[test]
fn enrolment_tells_what_the_new_material_gains_and_the_others_lose() {
    let lab = lab();
    let found = json(study(
        &lab,
        "enrolment",
        &["splits=2", "shots=[1, 5, 20]"],
        "enrolment",
    ));
    let methods: BTreeSet<&str> = rows(&found)
        .iter()
        .map(|row| row["method"].as_str().unwrap())
        .collect();
    assert!(methods.len() >= 3, "{methods:?}");
    for method in methods {
        let of = |measure, shots| {
            mean(
                &found,
                &[("measure", measure), ("method", method), ("shots", shots)],
            )
        };
        for shots in ["1", "5", "20"] {
            let lost = of("known, before", shots) - of("known, after", shots);
            assert!((of("known, lost", shots) - lost).abs() < 1e-12, "{method}");
            // The results before enrolment do not depend on the enrolled material.
            assert_eq!(of("known, before", shots), of("known, before", "1"));
        }
        assert!(
            of("new material", "20") >= of("new material", "1"),
            "{method}"
        );
    }
    assert!(
        mean(
            &found,
            &[
                ("measure", "new material"),
                ("method", "knowledge prior"),
                ("shots", "20")
            ]
        ) > 0.3
    );
}

#[test]
fn feature_maps_put_every_test_sweep_in_the_plane_and_into_the_report() {
    let lab = lab();
    let settings = ["splits=1", "study={kind=\"feature-maps\", new_materials=3}"];
    let found = json(study(&lab, "feature_maps", &settings, "maps"));
    let maps = found["maps"].as_array().unwrap();
    assert_eq!(maps.len(), 2, "input and embedding");
    for map in maps {
        let points = map["points"].as_array().unwrap();
        assert!(points.len() >= 3 * 6, "{}", points.len());
    }
    for space in ["whole space", "plane"] {
        let purity = |method| {
            mean(
                &found,
                &[
                    ("setting", &format!("easy materials, {space}")),
                    ("method", method),
                ],
            )
        };
        // Chance level is a third.
        assert!((0.0..=1.0).contains(&purity("input")));
        assert!(purity("embedding") > 1.0 / 3.0, "{space}");
    }
    let page = std::fs::read_to_string(lab.path("maps/report.html")).unwrap();
    assert!(page.contains("t-SNE"), "the report draws the maps");
}

#[test]
fn questions_refuse_what_they_cannot_use_in_one_line() {
    let lab = lab();
    for (code, settings, named) in [
        (
            2,
            &["models=[\"minirocket\"]"][..],
            "the question `nshot` needs networks",
        ),
        (2, &["groups=3"][..], "unknown field `groups`"),
        (2, &["shots=[]"][..], "`shots`"),
        (
            2,
            &["study={kind=\"nshot\", new_materials=8}"][..],
            "`--set new_materials=6`",
        ),
    ] {
        let refused = stderr(&expect(
            code,
            study(
                &lab,
                "nshot",
                &[&["splits=1"], settings].concat(),
                "refused",
            ),
        ));
        assert!(refused.contains(named), "{settings:?}: {refused}");
    }
}

#[test]
fn a_stopped_question_keeps_its_finished_networks_and_finds_the_same() {
    let lab = quick_lab();
    let settings = [
        "splits=1",
        "shots=[1, 3]",
        "methods=[\"nk\", \"ol-mean\"]",
        "study={kind=\"nshot\", new_materials=3, scratch_folds=3}",
    ];
    let undisturbed = json(study(&lab, "nshot", &settings, "undisturbed"));
    let mut runner = study(&lab, "nshot", &settings, "stopped")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let networks = lab.path("stopped/tasks/eight-small-nshot-000/networks");
    let finished = || -> Vec<(PathBuf, SystemTime)> {
        let files = std::fs::read_dir(&networks).into_iter().flatten();
        files
            .map(|file| file.unwrap().path())
            .filter(|path| path.extension().is_some_and(|end| end == "safetensors"))
            .map(|path| {
                let written = path.metadata().unwrap().modified().unwrap();
                (path, written)
            })
            .collect()
    };
    let begun = Instant::now();
    while finished().is_empty() && begun.elapsed() < Duration::from_secs(120) {
        sleep(Duration::from_millis(5));
    }
    signal("INT", runner.id());
    assert_eq!(runner.wait().unwrap().code(), Some(130));
    assert!(!finished().is_empty(), "finished networks stay");
    let again = json(study(&lab, "nshot", &settings, "stopped"));
    assert_eq!(again["rows"], undisturbed["rows"]);
    assert!(!networks.exists(), "the task has its result");
    let log = String::from_utf8(lab.read("stopped/tasks/eight-small-nshot-000.log")).unwrap();
    assert_says!(
        log,
        "stopped; running the task again resumes it with its next network"
    );
}

#[test]
fn the_measurements_of_a_question_are_metrics_for_mlflow() {
    let lab = lab();
    let settings = ["splits=1", "study={kind=\"unknown\", new_materials=3}"];
    let found = json(study(&lab, "unknown", &settings, "unknown"));
    lab.run("experiment export @unknown --mlflow @mlruns");
    let experiments = std::fs::read_dir(lab.path("mlruns")).unwrap();
    let run = experiments
        .map(|folder| folder.unwrap().path())
        .filter(|folder| folder.join("tags").exists())
        .flat_map(|folder| std::fs::read_dir(folder).unwrap())
        .map(|folder| folder.unwrap().path())
        .find(|folder| folder.join("metrics").exists())
        .unwrap();
    let metric = std::fs::read_to_string(run.join("metrics/energy.auroc.1_sweeps")).unwrap();
    let value: f64 = metric.split(' ').nth(1).unwrap().parse().unwrap();
    let wanted = [("measure", "auroc"), ("method", "energy"), ("sweeps", "1")];
    assert_eq!(value, mean(&found, &wanted));
    assert_eq!(
        std::fs::read_to_string(run.join("params/question.new_materials")).unwrap(),
        "3"
    );
}
