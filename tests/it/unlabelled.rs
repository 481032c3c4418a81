//! Unlabelled sweeps: `predict` and `same`.

use std::process::Command;

use serde_json::Value;

use crate::command::{
    Lab, RecipeChange, assert_says, expect, json, messages_of, output_of, refusal, stderr, stdout,
};
use crate::newcomer::{own_sweeps, with};

/// Sweeps of the small twin: one of each material, and three more of the last.
const CHOSEN: [usize; 7] = [0, 10, 20, 30, 31, 32, 33];

/// Writes sweeps of the small twin without their labels: a folder of `.csv` files, and one file with one sweep.
fn without_labels(lab: &Lab) -> Vec<String> {
    let dataset = tactnet_data::format::read(&lab.path("twin.h5")).unwrap();
    let folder = lab.path("new");
    std::fs::create_dir(&folder).unwrap();
    for (place, sweep) in CHOSEN.iter().enumerate() {
        let rows: String = dataset
            .sweep(*sweep)
            .chunks_exact(16)
            .map(|frame| {
                frame
                    .iter()
                    .map(f32::to_string)
                    .collect::<Vec<_>>()
                    .join(",")
                    + "\n"
            })
            .collect();
        std::fs::write(folder.join(format!("{place}.csv")), rows).unwrap();
    }
    let name = |sweep: &usize| dataset.labels().name(dataset.records()[*sweep].label);
    CHOSEN.iter().map(|sweep| name(sweep).into()).collect()
}

/// Returns `predict` with the run of the lab.
fn predict(lab: &Lab, data: &str, options: &[&str]) -> Command {
    let mut command = with(lab, &["predict"], "run", options);
    command.args(["--data", data]);
    command
}

/// Compares the predictions for the chosen sweeps, and for all as one object, with those of the library.
fn assert_as_the_library_predicts(lab: &Lab, found: &Value) {
    let rows = found["sweeps"].as_array().unwrap();
    assert_eq!(rows.len(), CHOSEN.len());
    let run = tactnet::Classifier::load(lab.path("run")).unwrap();
    let dataset = tactnet_data::format::read(&lab.path("twin.h5")).unwrap();
    let view = tactnet::SweepView::new(&dataset, CHOSEN.to_vec());
    let expected = run.predict(&view).unwrap();
    let materials: Vec<&str> = run.materials().collect();
    let mut sums = vec![0.0; materials.len()];
    for (place, (row, score)) in rows.iter().zip(&expected.sweeps).enumerate() {
        assert_eq!(row["sweep"], place.to_string());
        assert_eq!(row["material"], materials[score.predicted()]);
        assert!(row["unknown"].is_boolean() && row["prediction_set"].is_array());
        assert!(row.get("named").is_none());
        for (sum, (found, log_p)) in sums.iter_mut().zip(
            row["probabilities"]
                .as_array()
                .unwrap()
                .iter()
                .zip(&score.log_probability),
        ) {
            assert!((found.as_f64().unwrap() - log_p.exp()).abs() < 1e-12);
            *sum += log_p;
        }
    }
    let fused = &found["object"];
    let best = (0..sums.len())
        .max_by(|a, b| sums[*a].total_cmp(&sums[*b]))
        .unwrap();
    assert_eq!(fused["material"], materials[best]);
    assert_eq!(fused["sweeps"], rows.len());
}

/// One sweep as an array of frames, rows and columns is predicted as among others.
fn assert_alone_as_among_others(lab: &Lab, row: &Value) {
    let dataset = tactnet_data::format::read(&lab.path("twin.h5")).unwrap();
    let steps = dataset.shape().steps;
    let header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({steps}, 4, 4), }}\n");
    let mut one = b"\x93NUMPY\x01\x00".to_vec();
    one.extend((header.len() as u16).to_le_bytes());
    one.extend(header.as_bytes());
    one.extend(
        dataset
            .sweep(0)
            .iter()
            .flat_map(|digit| digit.to_le_bytes()),
    );
    std::fs::write(lab.path("one.npy"), one).unwrap();
    let alone = json(predict(lab, "one.npy", &["--json"]));
    assert_eq!(alone["sweeps"].as_array().unwrap().len(), 1);
    let of = |row: &Value| -> Vec<f64> {
        let all = row["probabilities"].as_array().unwrap().iter();
        all.map(|p| p.as_f64().unwrap()).collect()
    };
    for (one, among) in of(&alone["sweeps"][0]).iter().zip(of(row)) {
        // A batch of one has other rounding.
        assert!((one - among).abs() < 1e-6, "{one} {among}");
    }
}

fn assert_tables_are_written_once(lab: &Lab) {
    let table = String::from_utf8(lab.read("found.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + CHOSEN.len());
    assert!(
        table.starts_with("sweep,material,unknown,prediction_set,named,p("),
        "{table}"
    );

    for cell in table
        .lines()
        .skip(1)
        .flat_map(|line| line.split(',').skip(5))
    {
        assert!(cell.len() <= 8, "{cell}: digits that nobody reads");
    }
    let again = |out: &str| refusal(predict(lab, "new", &["--out", out]));
    assert!(again("found.csv").contains("overwrite it with `--force`"));
    assert!(again("found.txt").contains(".csv or .json"));
    expect(0, predict(lab, "new", &["--out", "found.csv", "--force"]));
    expect(0, predict(lab, "new", &["--out", "found.json"]));
    let written: Value = serde_json::from_slice(&lab.read("found.json")).unwrap();
    assert_eq!(written["sweeps"].as_array().unwrap().len(), CHOSEN.len());
}

/// Labels in the data are printed beside the predictions, and sweeps of the training are noticed.
fn assert_known_sweeps_are_named(lab: &Lab, named: &[String]) {
    // A single file, and a labelled data set, whose labels are printed beside the predictions.
    let one = output_of(predict(lab, "new/0.csv", &[]));
    assert!(
        one.contains("runner-up") && one.contains("1 sweep: "),
        "{one}"
    );
    let known = expect(0, predict(lab, "twin.h5", &["--json", "--mc", "0"]));
    let said = stderr(&known);
    assert_says!(said, "note: the run was trained on 32 of these 40 sweeps");
    let known: Value = serde_json::from_str(&stdout(&known)).unwrap();
    assert_eq!(known["sweeps"][30]["named"], named[3]);
    // The same sweeps in another file.
    lab.run("data import @new --rate 750 --shape 4x4 --material any --out @some.npz");
    let said = messages_of(predict(lab, "some.npz", &["--mc", "0"]));
    assert!(
        said.contains("note: the run was trained on ")
            && said.contains(" sweeps, so these predictions do not show"),
        "{said}"
    );
    let shown = output_of(predict(lab, "twin.h5", &[]));
    let mut lines = shown.lines();
    assert!(
        lines
            .next()
            .unwrap()
            .starts_with("like the training data (p = "),
        "{shown}"
    );
    assert!(lines.next().unwrap().contains("named"), "{shown}");
    assert!(shown.contains(" of 40 correct"), "{shown}");
    let plain = output_of(lab.command("eval --mc 0 @run"));
    assert!(!plain.contains("MC dropout"), "{plain}");
}

fn assert_unusable_sweeps_are_named(lab: &Lab) {
    // A constant skin among normal ones.
    let frame = "7,".repeat(15) + "7\n";
    std::fs::write(lab.path("new/still.csv"), frame.repeat(120)).unwrap();
    let still = expect(0, predict(lab, "new", &[]));
    assert_says!(
        stderr(&still),
        "warning: no taxel ever changes in sweep `still`"
    );
    let marked = stdout(&still);
    let marked = marked
        .lines()
        .filter(|line| line.ends_with("no taxel ever changes"));
    assert_eq!(marked.count(), 1);
    let refused = refusal(predict(lab, "new", &["--rate", "100"]));
    assert!(
        refused.contains("new: the classifier expects 750 Hz")
            && refused.contains("100 Hz, as named with `--rate`"),
        "{refused}"
    );
    let refused = refusal(predict(lab, "nothing", &[]));
    assert!(refused.contains("nothing"), "{refused}");
}

fn assert_longer_sweeps_are_cut(lab: &Lab) {
    let row = vec!["9"; 16].join(",") + "\n";
    std::fs::write(lab.path("long.csv"), row.repeat(200)).unwrap();
    let refused = refusal(predict(lab, "long.csv", &[]));
    assert!(refused.contains("`--steps 120`"), "{refused}");
    expect(0, predict(lab, "long.csv", &["--steps", "120"]));
    let same = |options: &[&str]| {
        let both = ["long.csv", "long.csv"];
        with(lab, &["same"], "run", &[&both[..], options].concat())
    };
    expect(2, same(&[]));
    expect(0, same(&["--steps", "120"]));
}

fn assert_another_rate_is_refused_everywhere(lab: &Lab) {
    let said = stderr(&lab.run("data import @twin.h5 --rate 100 --out @slow.npz"));
    assert_says!(
        said,
        "the data names 750 Hz; the named 100 Hz takes precedence"
    );
    for line in [
        "predict @run --data @slow.npz",
        "eval @run --data @slow.npz",
        "demo --listen 0 --data @slow.npz --run @run",
    ] {
        let refused = lab.refused(line);
        assert_says!(refused, "slow.npz: the classifier expects");
        assert!(refused.contains("100 Hz"), "{refused}");
    }
}

fn assert_unlabelled_sweeps_can_be_enrolled(lab: &Lab) {
    lab.run("enroll @run --data @new --material felt --out @grown --rate 750 --steps 120");
    let found = json(lab.command("predict @grown --data @new --json --one-object"));
    assert_eq!(found["materials"].as_array().unwrap().len(), 5);
}

#[test]
fn sweeps_without_materials_are_classified_as_eval_classifies_them() {
    let lab = Lab::new();
    let named = without_labels(&lab);
    let recipe = lab.recipe_for(12);
    let mut train = lab.train(&recipe, "run");
    train.args(["--calibrate", "--false-alarms", "0.2", "--coverage", "0.8"]);
    expect(0, train);
    let options = ["--json", "--one-object", "--out", "found.csv"];
    let found = json(predict(&lab, "new", &options));
    assert_as_the_library_predicts(&lab, &found);
    assert_alone_as_among_others(&lab, &found["sweeps"][0]);
    assert_tables_are_written_once(&lab);
    assert_known_sweeps_are_named(&lab, &named);
    assert_unusable_sweeps_are_named(&lab);
    assert_longer_sweeps_are_cut(&lab);
    assert_another_rate_is_refused_everywhere(&lab);
    assert_unlabelled_sweeps_can_be_enrolled(&lab);
}

/// Labels in the files that contradict the result, and labels that the run does not know.
fn assert_contradicting_labels_are_named(lab: &Lab) {
    let named = |file: &str, name: &str| {
        let out = lab.path(file).display().to_string();
        let more = ["--material", name, "--rate", "750", "--out", &out];
        expect(0, with(lab, &["data", "import"], "cup/glass", &more));
        out
    };
    let (glass, silk) = (named("glass.npz", "glass"), named("silk.npz", "silk"));
    let both = expect(0, with(lab, &["same"], "run", &[&glass, &silk]));
    let (verdict, hints) = (stdout(&both), stderr(&both));
    assert_says!(
        verdict,
        "the files name different materials: glass names `glass`, silk names `silk`"
    );
    assert!(hints.contains("the run does not know `silk`"), "{hints}");
}

/// Two files of one object each, and an object compared with itself.
#[test]
fn dead_taxels_are_masked_in_predictions_and_evaluations() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange::default());
    expect(0, lab.train(&recipe, "run"));
    // Two taxels of another skin are broken.
    let dataset = tactnet_data::format::read(&lab.path("twin.h5")).unwrap();
    let broken = |reading: [f32; 2]| {
        let rows = dataset.sweep(5);
        let rows = rows.chunks_exact(16).map(|frame| {
            let mut frame = frame.to_vec();
            (frame[3], frame[7]) = (reading[0], reading[1]);
            frame
                .iter()
                .map(f32::to_string)
                .collect::<Vec<_>>()
                .join(",")
                + "\n"
        });
        std::fs::write(lab.path("broken.csv"), rows.collect::<String>()).unwrap();
    };
    let mut found = Vec::new();
    for reading in [[0.0, 255.0], [90.0, 1.0]] {
        broken(reading);
        let line = "predict @run --json --dead 3,7 --data @broken.csv";
        found.push(json(lab.command(line)));
    }
    assert_eq!(found[0]["sweeps"], found[1]["sweeps"]);
    assert_eq!(found[0]["dead_taxels"], serde_json::json!([3, 7]));
    let evaluated = |options: &[&str]| expect(0, with(&lab, &["eval"], "run", options));
    assert!(stdout(&evaluated(&["--dead", "3,7"])).contains("masked taxels: 3, 7"));
    let compared = json(lab.command("eval --dead 3 --json --runtime online @run"));
    assert_eq!(compared["dead_taxels"], serde_json::json!([3]));
    let difference = compared["runtimes"]["plain"]["largest_difference"].as_f64();
    assert!(difference.unwrap() < 1e-4, "{compared}");
    let refused = expect(2, lab.command("eval @run --dead 16"));
    assert!(stderr(&refused).contains("expected numbers from 0 to 15"));
}

#[test]
fn two_objects_are_of_one_material_or_of_two() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["glass", "felt"], 12, 4);
    lab.recipe(RecipeChange::default());
    let data = lab.path("own").display().to_string();
    lab.run("train --data @own --rate 750 --epochs 60 --recipe @small.toml --out @run");
    own_sweeps(&lab, "cup", ["glass", "other"], 2, 4);
    own_sweeps(&lab, "cloth", ["other", "felt"], 2, 4);
    let [cup, cloth] = [("cup", "glass"), ("cloth", "felt")]
        .map(|(a, b)| lab.path(a).join(b).display().to_string());
    let same = |first: &str, second: &str| -> f64 {
        let call = with(&lab, &["same"], "run", &[first, second, "--json"]);
        let found = json(call);
        assert_eq!(found["objects"][0]["sweeps"], 2);
        found["same"].as_f64().unwrap()
    };
    let (alone, apart) = (same(&cup, &cup), same(&cup, &cloth));
    assert!(alone > apart, "{alone} {apart}");
    assert!(
        (same(&cloth, &cup) - apart).abs() < 1e-12,
        "either way round"
    );
    let said = output_of(with(&lab, &["same"], "run", &[&cup, &cloth]));
    assert!(said.contains("probability of one material "), "{said}");
    expect(2, with(&lab, &["same"], "run", &[&cup, "nowhere.npz"]));
    assert_contradicting_labels_are_named(&lab);
    // The run can be named either way, and problems of the files are reported.
    let named = with(&lab, &["same", "--run"], "run", &[&cup, &cloth]);
    assert_eq!(output_of(named), said);
    expect(
        2,
        with(&lab, &["same", "--run"], "run", &[&cup, &cloth, &cup]),
    );
    expect(2, with(&lab, &["same"], "run", &[&cup]));
    let several = refusal(with(&lab, &["same"], "run", &[&cup, &data]));
    assert_says!(several, "expected sweeps of one object, found 2 materials");
    let twice = messages_of(with(&lab, &["same"], "run", &[&cup, &cup]));
    assert!(twice.contains("are the same sweeps"), "{twice}");
}
