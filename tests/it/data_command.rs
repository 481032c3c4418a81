//! `tactnet data` on the fixture files, with the real binary.

use std::path::{Path, PathBuf};

use crate::command::{
    Lab, RecipeChange, assert_says, expect, json, messages_of, output_of, refusal, stderr, stdout,
    tactnet,
};
use crate::newcomer::{own_sweeps, with};

fn fixtures() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/h5");
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "h5"))
        .collect();
    files.sort();
    assert!(files.len() >= 16, "{files:?}");
    files
}

#[test]
fn info_and_check_say_something_useful_about_every_fixture() {
    for file in fixtures() {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let mut info = tactnet(["data", "info"]);
        info.arg(&file);
        let mut check = tactnet(["data", "check"]);
        check.arg(&file);
        if name == "bad_nan.h5" {
            assert!(output_of(info).contains("cork"));
            let text = stdout(&expect(1, check));
            assert!(text.contains("sweep"), "{text}");
        } else if name.starts_with("bad_") || name.contains("lzf") {
            for command in [info, check] {
                let message = refusal(command);
                assert!(message.contains(&name), "{message}");
                assert_eq!(message.trim_end().lines().count(), 1, "{message}");
            }
        } else {
            let text = output_of(info);
            for part in ["cork", "denim", "spun fleece"] {
                assert!(text.contains(part), "{name}: {text}");
            }
            let text = output_of(check);
            assert!(text.contains("0 errors"), "{name}: {text}");
        }
    }
}

#[test]
fn samples_and_labels_in_groups_are_named_for_check_import_and_train() {
    let lab = Lab::new();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/foreign");
    let on = |words: &[&str], file: &str, more: &[&str]| {
        let mut command = tactnet(words.iter().copied());
        command.arg(folder.join(file)).args(more);
        command
    };
    let refused = refusal(on(&["data", "check"], "groups.h5", &[]));
    let listed = "`recorded/skin/pressure` [6, 12, 4] f64";
    let cure = "name the one that holds the taxels with `--samples NAME`";
    assert!(
        refused.contains(listed) && refused.contains(cure),
        "{refused}"
    );
    let names = [
        "--samples",
        "recorded/skin/pressure",
        "--labels",
        "recorded/material",
    ];
    let checked = output_of(on(&["data", "check"], "groups.h5", &names));
    assert_says!(
        checked,
        "6 sweeps of 12 steps of 1x4 taxels at 250 Hz, 3 materials"
    );
    let out = lab.path("own.npz").display().to_string();
    let import = [&names[..], &["--out", &out]].concat();
    expect(0, on(&["data", "import"], "groups.h5", &import));
    let run = lab.path("run").display().to_string();
    let means = [&names[..], &["--model", "means", "--out", &run]].concat();
    expect(0, on(&["train", "--data"], "groups.h5", &means));
    // The run's settings contain the names.
    expect(0, tactnet(["eval", &run]));
    let noted = messages_of(on(
        &["data", "import"],
        "v5_cell.mat",
        &["--out", &out, "--force"],
    ));
    let note = "note: `X`: the size 6x12x4 in MATLAB is read as sweeps x steps x taxels";
    assert!(noted.contains(note), "{noted}");
    let refused = refusal(tactnet(["data", "check", "twin", "--labels", "y"]));
    assert!(refused.contains("--labels: expected a file"), "{refused}");
}

/// Linux paths are bytes.
#[test]
fn a_path_that_is_not_utf8_is_an_error_in_one_line() {
    use std::os::unix::ffi::OsStrExt;
    let path = std::ffi::OsStr::from_bytes(b"caf\xe9.npz");
    for words in [
        &["data", "info"][..],
        &["data", "check"],
        &["data", "view"],
        &["data", "import"],
        &["view"],
        &["eval", "--data"],
        &["train", "--data"],
        &[],
    ] {
        let mut command = tactnet(words.iter().copied());
        command.arg(path);
        let message = refusal(command);
        assert!(!message.contains("panicked"), "{words:?}: {message}");
        assert_eq!(
            message.trim_end().lines().count(),
            1,
            "{words:?}: {message}"
        );
    }
}

#[test]
fn train_refuses_what_check_calls_an_error() {
    let lab = Lab::new();
    lab.recipe(RecipeChange::default());
    let bad = fixtures()
        .into_iter()
        .find(|f| f.ends_with("bad_nan.h5"))
        .unwrap();
    let mut train = lab.command("train --recipe @small.toml --out @run --data");
    train.arg(bad);
    let message = refusal(train);
    assert!(
        message.contains("bad_nan.h5") && message.contains("sweep"),
        "{message}"
    );
    assert!(!lab.path("run").exists());
}

#[test]
fn export_and_import_bring_the_same_sweeps_back() {
    let lab = Lab::new();
    let sha = |name: &str| {
        let info = json(lab.command(&format!("data info --json @{name}")));
        info["sha256"].as_str().unwrap().to_string()
    };
    let convert =
        |verb: &str, from: &str, to: &str| lab.command(&format!("data {verb} @{from} --out @{to}"));
    expect(0, convert("export", "twin.h5", "twin.npz"));
    expect(0, convert("import", "twin.npz", "again.h5"));
    assert_eq!(sha("twin.h5"), sha("twin.npz"));
    assert_eq!(sha("twin.h5"), sha("again.h5"));
    expect(0, convert("export", "twin.h5", "twin.ts"));
    let ts = String::from_utf8(lab.read("twin.ts")).unwrap();
    assert!(ts.contains("@data"), "{}", &ts[..200.min(ts.len())]);
    let message = refusal(convert("export", "twin.h5", "twin.npz"));
    assert!(message.contains("--force"), "{message}");
    let message = refusal(convert("export", "twin.h5", "twin.doc"));
    assert!(message.contains("twin.doc"), "{message}");
}

#[test]
fn own_tables_are_checked_and_imported() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["cork", "felt"], 3, 4);
    let checked = output_of(lab.command("data check @own"));
    assert!(checked.contains("assumed sample rate"), "{checked}");
    assert_says!(checked, "cross-validation uses 3 folds");

    let own = lab.path("own.npz").display().to_string();
    let options = [
        "--out", &own, "--steps", "100", "--rate", "200", "--shape", "2x2",
    ];
    expect(0, with(&lab, &["data", "import"], "own", &options));
    let info = json(tactnet(["data", "info", &own, "--json"]));
    assert_eq!(
        info["shape"],
        serde_json::json!({"steps": 100, "rows": 2, "cols": 2})
    );
    assert_eq!(
        (&info["sample_rate_hz"], &info["sample_rate_assumed"]),
        (&200.0.into(), &false.into())
    );
    let contradicted = ["data", "check", &own, "--rate", "100"];
    let message = output_of(tactnet(contradicted));
    let precedence = "200 Hz; the named 100 Hz takes precedence";
    assert!(message.contains(precedence), "{message}");
}

#[test]
fn a_cell_that_is_no_number_is_named_with_line_and_column() {
    let lab = Lab::new();
    std::fs::write(
        lab.path("words.csv"),
        "sweep,material,a\n1,cork,2\n1,cork,x\n",
    )
    .unwrap();
    let message = lab.refused("data import --out @z.npz @words.csv");
    assert_says!(
        message,
        "words.csv: line 3, column 3: expected a number, found `x`"
    );
    assert!(!message.contains("z.npz"), "{message}");
}

#[test]
fn own_tables_are_trained_on_with_the_named_rate_and_folds() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["cork", "felt"], 3, 4);
    let recipe = lab.recipe(RecipeChange::default());
    let train = |out: &str, options: &[&str]| {
        let mut command = with(&lab, &["train", "--data"], "own", options);
        command.arg("--recipe").arg(&recipe);
        command.arg("--out").arg(lab.path(out));
        command
    };
    let message = messages_of(train("assumed", &["--split", "hold-out"]));
    assert!(message.contains("750 Hz is assumed"), "{message}");
    assert_eq!(
        lab.json("assumed/config.json")["classifier"]["sample_rate_assumed"],
        true
    );
    assert_eq!(
        lab.json("assumed/split.json")["test"]
            .as_array()
            .unwrap()
            .len(),
        2
    );
    let message = messages_of(train("named", &["--folds", "3", "--rate", "200"]));
    assert!(!message.contains("Hz is assumed"), "{message}");
    assert_eq!(lab.json("named/result.json")["n_train"], 4);
    let message = refusal(train("many", &["--folds", "4"]));
    assert_says!(message, "at least 4, one for each fold, found 3");
}

#[test]
fn a_download_without_network_is_one_line_with_the_page_to_go_to() {
    let lab = Lab::new();
    let line = "data fetch tactmat --url http://127.0.0.1:9/tactmat.h5 --out @tactmat.h5";
    let message = stderr(&expect(1, lab.command(line)));
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    assert_says!(message, "dlr-alr.github.io/dlr-tactmat");
    assert!(!lab.path("tactmat.h5").exists());
}

#[test]
fn the_twin_is_called_a_twin_and_shows_its_statistics() {
    let text = output_of(tactnet(
        "data twin --stats --materials 3 --sweeps 10".split(' '),
    ));
    assert!(text.contains("twin") && text.contains("TactMat"), "{text}");
    // TactMat's statistics belong to other sweeps than these.
    assert!(!text.contains("trained classifiers"), "{text}");
}

#[test]
fn a_twin_stays_a_twin_whatever_its_file_is_called() {
    let lab = Lab::new();
    for file in ["tactmat.h5", "tactmat.npz"] {
        lab.run(&format!("data export @twin.h5 --out @{file}"));
        let info = json(lab.command(&format!("data info --json @{file}")));
        assert_eq!(info["name"], "twin (tactmat)", "{file}");
    }
}

#[test]
fn sweeps_without_materials_are_looked_at_checked_and_named() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("new");
    std::fs::create_dir(&folder).unwrap();
    for sweep in 0..3 {
        let rows: String = (0..40)
            .map(|t| format!("{},{}\n", (7 * t * t + sweep) % 101, (13 * t + sweep) % 53))
            .collect();
        std::fs::write(folder.join(format!("{sweep}.csv")), rows).unwrap();
    }
    let data = |arguments: &[&str], rest: &[&str]| {
        let mut command = tactnet(arguments);
        command.arg(&folder).args(rest).current_dir(dir.path());
        command
    };
    let text = output_of(data(&["data", "info"], &[]));
    assert!(text.contains("materials    none named"), "{text}");
    let found = expect(0, data(&["data", "info"], &["--json"]));
    let found: serde_json::Value = serde_json::from_str(&stdout(&found)).unwrap();
    assert_eq!(found["sweeps"], 3);
    assert!(found["materials"].as_array().unwrap().is_empty());
    let checked = expect(0, data(&["data", "check"], &["--rate", "100"]));
    assert!(stderr(&checked).contains("note: unlabelled data"));
    let text = stdout(&checked);
    assert!(text.contains("materials not named"), "{text}");
    assert!(text.contains("0 errors, 0 warnings"), "{text}");
    // Invalid values are found as in labelled data.
    std::fs::write(folder.join("3.csv"), "1,2\n".repeat(40)).unwrap();
    let text = stdout(&expect(1, data(&["data", "check"], &[])));
    assert_says!(text, "\n  sweep 3: no taxel ever changes");
    std::fs::remove_file(folder.join("3.csv")).unwrap();

    expect(2, data(&["data", "import"], &["--out", "felt.npz"]));
    let named = ["--out", "felt.npz", "--rate", "100", "--material", "felt"];
    let written = messages_of(data(&["data", "import"], &named));
    assert!(written.contains("3 sweeps of 1 material ("), "{written}");
    let felt = tactnet_data::format::read(&dir.path().join("felt.npz")).unwrap();
    assert_eq!(felt.labels().names().collect::<Vec<_>>(), ["felt"]);
    assert_eq!((felt.len(), felt.sample_rate_hz()), (3, 100.0));
    let mut again = tactnet(["data", "import", "felt.npz", "--material", "cork"]);
    again.args(["--out", "cork.npz"]).current_dir(dir.path());
    let refused = refusal(again);
    assert!(refused.contains("names its materials itself"), "{refused}");
}
