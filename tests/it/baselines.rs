//! `tactnet train --model` with classical and random-convolution classifiers, on real files with the real binary.

use crate::command::{Lab, assert_says, expect, json, refusal, stderr};

const MODELS: [&str; 12] = [
    "means",
    "first-frame",
    "last-frame",
    "knn-l",
    "knn-h",
    "svm-l",
    "svm-h",
    "lda",
    "svm-spectra",
    "minirocket",
    "multirocket-hydra",
    "quant",
];

fn train(lab: &Lab, model: &str, out: &str, more: &[&str]) -> std::process::Command {
    let line = format!("train --model {model} --data @twin.h5 --out @{out}");
    lab.command_with(&line, more)
}

#[test]
fn every_baseline_leaves_a_run_that_eval_reads_again() {
    let lab = Lab::new();
    for model in MODELS {
        expect(0, train(&lab, model, model, &[]));
        let result = lab.json(&format!("{model}/result.json"));
        assert_eq!(result["recipe"], model);
        assert!(
            result["evaluations"].get("mc_dropout").is_none(),
            "{model} has no dropout"
        );
        assert!(result.get("epochs").is_none(), "{model} has no epochs");
        assert_eq!(lab.prediction_rows(model).len(), 8, "{model}");
        for row in lab.prediction_rows(model) {
            let p: f64 = row
                .split(',')
                .skip(3)
                .map(|p| p.parse::<f64>().unwrap())
                .sum();
            assert!(
                (p - 1.0).abs() < 1e-6,
                "{model}: probabilities of {row} sum to {p}"
            );
        }
        let eval = lab.command(&format!("eval --json @{model}"));
        let again = json(eval);
        assert_eq!(
            again["evaluations"]["plain"]["negative_log_likelihood"],
            result["evaluations"]["plain"]["negative_log_likelihood"],
            "{model}: eval finds what train found"
        );
    }
    let refused = lab.refused("eval --mc 5 @knn-l");
    assert_says!(refused, "--mc: `knn-l` is a baseline without dropout");
    let accuracy = |model: &str| {
        lab.json(&format!("{model}/result.json"))["accuracy_one_sweep"]["mean"]
            .as_f64()
            .unwrap()
    };
    // Eight test sweeps of four materials: chance is 0.25.
    assert!(accuracy("minirocket") >= 0.5, "{}", accuracy("minirocket"));
}

#[test]
fn baselines_do_not_depend_on_the_number_of_threads() {
    let lab = Lab::new();
    for model in ["svm-h", "multirocket-hydra", "quant"] {
        for threads in ["1", "2", "4"] {
            let mut command = train(&lab, model, &format!("{model}{threads}"), &[]);
            command.env("RAYON_NUM_THREADS", threads);
            expect(0, command);
        }
        let of = |threads: &str| lab.read(&format!("{model}{threads}/weights.safetensors"));
        assert!(of("1") == of("2") && of("2") == of("4"), "{model}");
        assert_eq!(
            lab.prediction_rows(&format!("{model}1")),
            lab.prediction_rows(&format!("{model}4"))
        );
    }
}

/// Eigenvalues of large matrices are the computation whose sums could be split among threads.
#[test]
fn ridge_classifiers_of_many_sweeps_do_not_depend_on_the_number_of_threads() {
    let lab = Lab::new();
    lab.twin("many.h5", "--materials 10 --sweeps 60 --steps 40");
    for threads in ["1", "2", "4"] {
        let mut command = lab.command(&format!(
            "train --model minirocket --data @many.h5 --out @{threads}"
        ));
        command.env("RAYON_NUM_THREADS", threads);
        expect(0, command);
    }
    let of = |threads: &str| lab.read(&format!("{threads}/weights.safetensors"));
    assert!(of("1") == of("2") && of("2") == of("4"));
}

#[test]
fn without_levels_the_means_know_nothing() {
    let lab = Lab::new();
    expect(0, train(&lab, "means", "means", &["--levels", "removed"]));
    let labels: std::collections::BTreeSet<String> = lab
        .prediction_rows("means")
        .iter()
        .map(|row| row.split(',').nth(1).unwrap().to_string())
        .collect();
    assert_eq!(
        labels.len(),
        1,
        "all means are zero, so all predictions are the same"
    );
    let config = lab.json("means/config.json");
    assert_eq!(config["recipe"]["baseline"]["levels"], "removed");
}

#[test]
fn permuted_labels_are_another_data_set() {
    let lab = Lab::new();
    expect(0, train(&lab, "knn-l", "permuted", &["--permute-labels"]));
    expect(0, train(&lab, "knn-l", "true", &[]));
    let (permuted, own) = (
        lab.json("permuted/result.json"),
        lab.json("true/result.json"),
    );
    assert!(
        permuted["data"]
            .as_str()
            .unwrap()
            .contains("labels permuted")
    );
    assert_ne!(permuted["data_sha256"], own["data_sha256"]);
    let again = json(lab.command("eval --json @permuted"));
    assert_eq!(again["data_sha256"], permuted["data_sha256"]);
}

#[test]
fn what_a_baseline_cannot_do_is_said_in_one_line() {
    let lab = Lab::new();
    for (model, more, said) in [
        (
            "minirocket",
            ["--epochs", "3"],
            "`epochs`: expected the recipe of a network or committee",
        ),
        ("knn-h", ["--recipe", "fast"], "does not train the model"),
        ("knn-h", ["--steps", "50"], "a window of 0.1 s"),
        ("means", ["--steps", "121"], "1 to 120"),
        ("svm-l", ["--inner", "5"], "a number below 5"),
    ] {
        let output = expect(2, train(&lab, model, "refused", &more));
        let message = stderr(&output);
        let last = message.trim_end().lines().last().unwrap();
        assert!(last.contains(said), "{model} {more:?}: {message}");
    }
    // Some short sweeps of the twin are constant for nine steps and are refused; these values are not.
    let values = (0..12 * 9).map(|i| i * i % 101);
    let mut table = String::from("material,sweep,taxel\n");
    for (index, value) in values.enumerate() {
        let sweep = index / 9;
        table += &format!("m{},{sweep},{value}\n", sweep / 4);
    }
    std::fs::write(lab.path("short.csv"), table).unwrap();
    let short = lab.command("train --model minirocket --data @short.csv --out @refused");
    let message = refusal(short);
    assert!(message.contains("at least 10 steps"), "{message}");
}
