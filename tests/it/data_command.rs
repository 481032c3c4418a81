//! `tactnet data` on the fixture files, with the real binary.

use std::path::{Path, PathBuf};

use crate::command::{Lab, RecipeChange, expect, stderr, stdout, tactnet};

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
            assert!(stdout(&expect(0, info)).contains("cork"));
            let text = stdout(&expect(1, check));
            assert!(text.contains("sweep"), "{text}");
        } else if name.starts_with("bad_") || name.contains("lzf") {
            for command in [info, check] {
                let message = stderr(&expect(2, command));
                assert!(message.contains(&name), "{message}");
                assert_eq!(message.trim_end().lines().count(), 1, "{message}");
            }
        } else {
            let text = stdout(&expect(0, info));
            for part in ["cork", "denim", "spun fleece"] {
                assert!(text.contains(part), "{name}: {text}");
            }
            let text = stdout(&expect(0, check));
            assert!(text.contains("0 errors"), "{name}: {text}");
        }
    }
}

#[test]
fn train_refuses_what_check_calls_an_error() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange::default());
    let bad = fixtures()
        .into_iter()
        .find(|f| f.ends_with("bad_nan.h5"))
        .unwrap();
    let mut train = tactnet(["train", "--data"]);
    train
        .arg(&bad)
        .arg("--recipe")
        .arg(recipe)
        .arg("--out")
        .arg(lab.path("run"));
    let message = stderr(&expect(2, train));
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
        let mut info = tactnet(["data", "info", "--json"]);
        info.arg(lab.path(name));
        let json: serde_json::Value = serde_json::from_str(&stdout(&expect(0, info))).unwrap();
        json["sha256"].as_str().unwrap().to_string()
    };
    let convert = |verb: &str, from: &str, to: &str| {
        let mut command = tactnet(["data", verb]);
        command.arg(lab.path(from)).arg("--out").arg(lab.path(to));
        command
    };
    expect(0, convert("export", "twin.h5", "twin.npz"));
    expect(0, convert("import", "twin.npz", "again.h5"));
    assert_eq!(sha("twin.h5"), sha("twin.npz"));
    assert_eq!(sha("twin.h5"), sha("again.h5"));
    expect(0, convert("export", "twin.h5", "twin.ts"));
    let ts = String::from_utf8(lab.read("twin.ts")).unwrap();
    assert!(ts.contains("@data"), "{}", &ts[..200.min(ts.len())]);
    let message = stderr(&expect(2, convert("export", "twin.h5", "twin.npz")));
    assert!(message.contains("--force"), "{message}");
    let message = stderr(&expect(2, convert("export", "twin.h5", "twin.doc")));
    assert!(message.contains("twin.doc"), "{message}");
}

#[test]
fn a_download_without_network_is_one_line_with_the_page_to_go_to() {
    let lab = Lab::new();
    let mut command = tactnet([
        "data",
        "fetch",
        "tactmat",
        "--url",
        "http://127.0.0.1:9/tactmat.h5",
        "--out",
    ]);
    command.arg(lab.path("tactmat.h5"));
    let message = stderr(&expect(1, command));
    assert_eq!(message.trim_end().lines().count(), 1, "{message}");
    assert!(
        message.contains("dlr-alr.github.io/dlr-tactmat"),
        "{message}"
    );
    assert!(!lab.path("tactmat.h5").exists());
}

#[test]
fn the_twin_is_called_a_twin_and_shows_its_statistics() {
    let output = expect(
        0,
        tactnet([
            "data",
            "twin",
            "--stats",
            "--materials",
            "3",
            "--sweeps",
            "10",
        ]),
    );
    let text = stdout(&output);
    assert!(text.contains("twin") && text.contains("TactMat"), "{text}");
}

#[test]
fn a_twin_stays_a_twin_whatever_its_file_is_called() {
    let lab = Lab::new();
    for file in ["tactmat.h5", "tactmat.npz"] {
        let mut export = tactnet(["data", "export"]);
        export
            .arg(lab.path("twin.h5"))
            .arg("--out")
            .arg(lab.path(file));
        expect(0, export);
        let mut info = tactnet(["data", "info", "--json"]);
        info.arg(lab.path(file));
        let info: serde_json::Value = serde_json::from_str(&stdout(&expect(0, info))).unwrap();
        assert_eq!(info["name"], "twin (tactmat)", "{file}");
    }
}
