//! Help, version and error messages of the command line.

use crate::command::{Lab, expect, json, output_of, refusal, tactnet};

#[test]
fn every_shell_gets_completions() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = output_of(tactnet(["completions", shell]));
        for part in ["tactnet", "experiment", "resume"] {
            assert!(script.contains(part), "{shell} lacks {part}");
        }
    }
    let refused = refusal(tactnet(["completions", "tcsh"]));
    assert_eq!(refused.trim_end().lines().count(), 1, "{refused}");
}

#[test]
fn every_command_has_a_manual_page_and_help() {
    let folder = tempfile::tempdir().unwrap();
    let pages = folder.path().join("man1");
    let page = output_of(tactnet(["man"]));
    assert!(page.contains(".TH tactnet 1"), "{page}");
    expect(0, tactnet(["man", "--out", pages.to_str().unwrap()]));
    for command in ["", "-train", "-data", "-data-check", "-experiment-run"] {
        let name = format!("tactnet{command}.1");
        let page = std::fs::read_to_string(pages.join(&name)).unwrap();
        assert!(page.contains(".SH DESCRIPTION"), "{name}: {page}");
    }
    assert!(!pages.join("tactnet-task.1").exists(), "it is hidden");
    let file = pages.join("tactnet.1").display().to_string();
    let refused = refusal(tactnet(["man", "--out", &file]));
    assert!(refused.contains(&file), "{refused}");

    for words in [&["train"][..], &["data", "check"]] {
        let mut asked = words.to_vec();
        asked.push("--help");
        assert_eq!(
            output_of(tactnet(["help"].iter().chain(words))),
            output_of(tactnet(asked)),
            "{words:?}"
        );
    }
    let unknown = refusal(tactnet(["help", "trian"]));
    assert!(unknown.contains("did you mean `train`?"), "{unknown}");
    for (words, meant) in [
        (["train", "--model", "lad"], "did you mean `lda`?"),
        (["train", "--data", "twim"], "did you mean `twin`?"),
        (["train", "--device", "gpu"], "did you mean `vulkan`?"),
        (
            ["train", "--batch", "64"],
            "found; it is a setting of the recipe",
        ),
        (
            ["train", "--lr=0.01", ""],
            "found; it is a setting of the recipe",
        ),
    ] {
        let refused = refusal(tactnet(words));
        assert!(refused.contains(meant), "{refused}");
        assert!(!refused.contains("tip:"), "{refused}");
    }
    // Without a better suggestion, clap's own one stays.
    let near = refusal(tactnet(["train", "--epoch", "3"]));
    assert!(
        near.contains("`--epochs`") || near.contains("'--epochs'"),
        "{near}"
    );
}

#[test]
fn a_build_says_which_it_is_and_what_it_lacks() {
    let version = json(tactnet(["version", "--json"]));
    assert_eq!(version["version"], env!("CARGO_PKG_VERSION"));
    let text = output_of(tactnet(["version"]));
    assert_eq!(text, output_of(tactnet(["--version"])));
    let first = format!(
        "tactnet {} (commit {})\n",
        env!("CARGO_PKG_VERSION"),
        version["git"].as_str().unwrap()
    );
    assert!(text.starts_with(&first), "{text}");
    for (feature, built) in [
        ("vulkan", cfg!(feature = "vulkan")),
        ("cuda", cfg!(feature = "cuda")),
        ("zenoh", cfg!(feature = "zenoh")),
        ("onnxruntime", cfg!(feature = "onnxruntime")),
        ("candle", cfg!(feature = "candle")),
        ("rerun", cfg!(feature = "rerun")),
        ("parquet", cfg!(feature = "parquet")),
    ] {
        let listed = |list: &str| {
            let names = version[list].as_array().unwrap();
            names.contains(&feature.into())
        };
        assert_eq!((listed("features"), listed("left_out")), (built, !built));
    }
}

#[test]
fn nothing_is_coloured_where_nobody_wants_colours() {
    let help = |variables: &[(&str, &str)]| {
        let mut help = tactnet(["train", "--help"]);
        help.env_remove("NO_COLOR").envs(variables.iter().copied());
        output_of(help)
    };
    let escape = '\u{1b}';
    assert!(help(&[("CLICOLOR_FORCE", "1")]).contains(escape));
    assert!(!help(&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]).contains(escape));
    assert!(!help(&[]).contains(escape));
}

#[test]
fn without_a_hub_every_command_says_so_at_once() {
    let lab = Lab::new();
    let table = output_of(tactnet(["serve", "--print-table"]));
    let table = table.replace("\"robot\"", "\"nohub\"");
    std::fs::write(lab.path("robot.toml"), table).unwrap();
    let recording = lab.path("a.mcap").display().to_string();
    for words in [
        &["record", "--out", &recording][..],
        &["simulate", "skin"],
        &["simulate", "catching"],
        &["dashboard"],
        &["channel", "list"],
        &["channel", "put", "skin/right"],
    ] {
        let mut command = tactnet(words);
        command.arg("--table").arg(lab.path("robot.toml"));
        let said = refusal(command);
        assert_eq!(
            said,
            "error: no hub of bus `nohub` runs on this host; start `tactnet channel hub --table FILE` with the same table\n",
            "{words:?}"
        );
    }
}

#[test]
fn a_wrong_path_is_a_mistake_in_the_call() {
    let lab = Lab::new();
    let path = |name: &str| lab.path(name).display().to_string();
    std::fs::create_dir(lab.path("folder")).unwrap();
    let (folder, twin) = (path("folder"), path("twin.h5"));
    let as_data = format!("data={folder}");
    for words in [
        &["train", "--data", &folder][..],
        &["train", "--recipe", &folder],
        &["train", "--data", &twin, "--out", &path("twin.h5/run")],
        &["eval", &folder],
        &["experiment", "run", &folder],
        &["experiment", "run", "unknown", "--set", &as_data],
        &["data", "info", &folder],
        &["data", "import", &folder, "--out", &path("a.h5")],
        &["data", "export", &twin, "--out", &path("nowhere/a.npz")],
        &["data", "fetch", "tactmat", "--out", &folder],
        &["channel", "hub", "--table", &folder],
        &["demo", "--run", &folder],
        &["replay", &folder],
        &["simulate", "soak", "--data", &folder],
    ] {
        let said = refusal(tactnet(words));
        assert_eq!(said.matches("error:").count(), 1, "{words:?}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{words:?}: {said}");
        let named = if words.contains(&twin.as_str()) {
            words[words.len() - 1]
        } else {
            &folder
        };
        assert!(said.contains(named), "{words:?}: {said}");
    }
}
