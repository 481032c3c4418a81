//! Messages for a new user with few sweeps of their own.

use std::process::Command;

use crate::command::{
    Lab, RecipeChange, assert_says, expect, json, messages_of, output_of, refusal, stderr, stdout,
    tactnet,
};

/// Writes a folder of `.csv` files, which do not state a rate: two materials with `sweeps` sweeps each.
pub fn own_sweeps(lab: &Lab, folder: &str, names: [&str; 2], sweeps: usize, taxels: usize) {
    for (material, swing) in names.into_iter().zip([3, 7]) {
        for sweep in 0..sweeps {
            let rows: String = (0..120)
                .map(|step| {
                    let value = |taxel: usize| (step * swing + taxel * 5 + sweep * 11) % 40;
                    let row: Vec<String> = (0..taxels).map(|t| value(t).to_string()).collect();
                    row.join(",") + "\n"
                })
                .collect();
            let folder = lab.path(folder).join(material);
            std::fs::create_dir_all(&folder).unwrap();
            std::fs::write(folder.join(format!("{sweep}.csv")), rows).unwrap();
        }
    }
}

/// Returns the command `verb` for a data set, with options, run in the lab's folder.
pub fn with(lab: &Lab, verb: &[&str], data: &str, options: &[&str]) -> Command {
    let mut command = tactnet(verb.iter().copied());
    command.arg(lab.path(data)).args(options);
    command.current_dir(lab.folder.path());
    command
}

/// A shape that differs from the run's is refused if it is declared, and reported if it is assumed.
fn assert_arrangement_of_taxels_is_named(lab: &Lab) {
    lab.run("data import @twin.h5 --shape 1x16 --out @flat.npz");
    let refused = lab.refused("eval @run --data @flat.npz");
    assert!(
        refused.contains("flat.npz") && refused.contains(" --out arranged.npz --shape 4x4`"),
        "{refused}"
    );
    // A declared shape is not rearranged to the run's.
    let refused = lab.refused("predict @run --data @flat.npz");
    assert_says!(refused, " --out arranged.npz --shape 4x4`");
    // If the arrangement is unknown, both commands state the assumed one.
    let known = ["synthetic leather rough", "metallic jersey"];
    own_sweeps(lab, "tables", known, 3, 16);
    for command in ["eval", "predict"] {
        let said = stderr(&lab.run(&format!("{command} @run --data @tables")));
        assert!(said.contains("row by row as the run's 4x4"), "{said}");
    }
}

#[test]
fn few_training_steps_are_named_and_what_comes_next() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange::default());
    let output = expect(0, lab.train(&recipe, "run"));
    let (found, said) = (stdout(&output), stderr(&output));
    assert_says!(
        said,
        "hint: 12 training steps are few; `--epochs 75` trains for 300"
    );
    assert!(
        !said.contains(" epochs instead of "),
        "the recipe's own: {said}"
    );
    assert!(said.contains("next: `tactnet demo --run "), "{said}");
    // With few training steps, the last lines give advice.
    let end = said.rfind("next: ").map_or("", |at| &said[at..]);
    assert!(end.contains("hint: 12 training steps are few"), "{said}");
    assert_says!(found, "guessing, with 4 materials: 25.0 %");
    assert_says!(
        said,
        "`tactnet experiment run crossval_baselines --set data="
    );
    assert!(
        found.contains("(fold 1 of 5)") && found.contains("in brackets: 95 % interval"),
        "{found}"
    );

    let more = lab.recipe(RecipeChange {
        extra_training: "least_steps = 40",
        ..RecipeChange::default()
    });
    let said = messages_of(lab.train(&more, "more"));
    let why = "note: 10 epochs instead of 3, since these few sweeps give 4 batches per epoch and the recipe trains on at least 40 batches";
    assert!(said.contains(why), "{said}");

    std::fs::create_dir(lab.path("held")).unwrap();
    std::fs::copy(lab.path("twin.h5"), lab.path("held/a.h5")).unwrap();
    for (folder, found) in [
        ("run", "a run directory, which holds a classifier"),
        ("held", "a.h5, which is a complete data set"),
    ] {
        let refused = refusal(with(&lab, &["data", "check"], folder, &[]));
        assert!(refused.contains(found), "{refused}");
    }

    assert_arrangement_of_taxels_is_named(&lab);
    let again = refusal(lab.train(&recipe, "run"));
    assert_says!(again, "which has ended; name another folder");
}

#[test]
fn a_missing_table_and_a_recording_that_is_there_come_with_what_to_do() {
    let lab = Lab::new();
    let serve = ["--table", "robott.toml"];
    let refused = refusal(with(&lab, &["serve", "--run"], "run", &serve));
    assert_says!(
        refused,
        "`tactnet serve --print-table > robott.toml` writes one"
    );
    std::fs::write(lab.path("there.mcap"), "").unwrap();
    let record = ["--table", "robott.toml"];
    let refused = with(&lab, &["record", "--out"], "there.mcap", &record);
    let refused = refusal(refused);
    assert_says!(refused, "exists already; name another file with `--out`");
}

#[test]
fn materials_that_a_run_does_not_know_are_named_while_it_predicts() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["cork", "felt"], 6, 4);
    own_sweeps(&lab, "other", ["cork", "silk"], 6, 4);
    let said = stderr(&lab.run("train --data @own --model means --out @run"));
    assert!(said.contains("note: one row of 4 taxels"), "{said}");
    let said = messages_of(lab.command("predict @run --data @other"));
    assert_says!(
        said,
        "hint: the run does not know `silk`, and cannot detect that"
    );
    let said = messages_of(lab.command("predict @run --data @own"));
    assert!(!said.contains("does not know"), "{said}");
}

#[test]
fn a_recipe_that_ships_can_be_printed_and_trained_by() {
    let text = output_of(tactnet(["train", "--print-recipe", "fast"]));
    assert!(text.contains("name = \"fast\""), "{text}");
    let refused = refusal(tactnet(["train", "--print-recipe", "fats"]));
    assert!(refused.contains("did you mean `fast`?"), "{refused}");
    let refused = refusal(tactnet(["train", "--model", "tree"]));
    assert!(refused.contains("see `tactnet train --help`"), "{refused}");
}

#[test]
fn a_check_finds_an_assumed_rate_until_it_is_named() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["0", "1"], 6, 4);
    let check = |options: &[&str]| -> serde_json::Value {
        json(with(&lab, &["data", "check"], "own", options))
    };
    let kinds = |report: &serde_json::Value| -> Vec<String> {
        let findings = report["findings"].as_array().unwrap().iter();
        findings
            .map(|finding| finding["kind"].as_str().unwrap().into())
            .collect()
    };
    let assumed = check(&["--json"]);
    assert_eq!(
        (&assumed["errors"], &assumed["warnings"]),
        (&0.into(), &1.into())
    );
    assert_eq!(
        kinds(&assumed),
        ["assumed_rate", "numbered_materials", "assumed_patch"]
    );
    let named = check(&["--json", "--rate", "200"]);
    assert_eq!(kinds(&named), ["numbered_materials", "assumed_patch"]);
}

#[test]
fn a_run_with_a_named_rate_refuses_sweeps_of_an_assumed_one() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["0", "1"], 6, 4);
    lab.run("data import @own --rate 200 --out @own.npz");
    lab.run("train --data @own.npz --model means --out @run");
    let refused = lab.refused("eval @run --data @own");
    assert!(
        refused.contains("expects 200 Hz, the data set has 750 Hz, which is assumed")
            && refused.contains("set it with `--rate HZ`"),
        "{refused}"
    );
    lab.run("eval @run --data @own --rate 200");

    own_sweeps(&lab, "named", ["cork", "felt"], 6, 4);
    let refused = lab.refused("eval @run --data @named --rate 200");
    assert_says!(
        refused,
        "some of 0, 1, the data set has materials named `cork`, `felt`, which it does not know"
    );
}

/// Output of a small experiment.
struct Report {
    found: String,
    said: String,
    page: String,
}

/// Runs an experiment with two of five folds on the lab's `own` sweeps.
fn two_folds(lab: &Lab, out: &str, more: &[&str]) -> Report {
    let models = "--set models=[\"means\",\"@small.toml\"]";
    let settings = "--set data=@own --set folds=2 --set probes=[] --set groups=0";
    let line = format!("experiment run crossval_baselines --out @{out} {models} {settings}");
    let output = expect(0, lab.command_with(&line, more));
    Report {
        found: stdout(&output),
        said: stderr(&output),
        page: String::from_utf8(lab.read(&format!("{out}/report.html"))).unwrap(),
    }
}

#[test]
fn an_experiment_names_an_assumed_rate_few_folds_and_few_steps() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["0", "1"], 6, 4);
    lab.recipe(RecipeChange::default());
    let Report { found, said, page } = two_folds(&lab, "assumed", &[]);
    let warning =
        "own does not state its sample rate; 750 Hz is assumed; `--set rate_hz=HZ` sets it";
    assert!(found.contains(&format!("warning: {warning}")), "{found}");
    assert!(said.contains(&format!("warning: {warning}")), "{said}");
    assert!(page.contains("<strong>Assumed:</strong> own does not state"));
    assert!(found.contains("TactNet-II (small), MC dropout"), "{found}");
    assert!(!found.contains("published"), "{found}");
    // Only two of the five folds were requested, which the output states.
    assert_says!(found, "own, 2 of 5 random folds, levels kept");
    assert!(found.contains("note: 95 % interval"), "{found}");
    assert!(page.contains("(2 of 5 random folds)"));
    assert!(page.contains("Test sweeps: 2 of 5 random folds, counted together."));
    assert!(!page.contains("random split") && !page.contains("Split "));
    let few =
        "TactNet-II (small) on own: 6 training steps are few; `--set epochs=150` trains for 300";
    assert!(found.contains(&format!("hint: {few}")), "{found}");
    let few = few.replace("`--set epochs=150`", "<code>epochs = 150</code>");
    assert!(page.contains(&few) && page.contains("training steps a fold, which are few."));
    let rated = ["--set", "rate_hz=200"];
    let Report { found, said, page } = two_folds(&lab, "rated", &rated);
    assert!(
        !found.contains("Hz is assumed")
            && !said.contains("Hz is assumed")
            && !page.contains("Assumed:"),
        "{found}"
    );
}

#[test]
fn experiments_refuse_what_does_not_suit_them_before_the_first_task() {
    let lab = Lab::new();
    own_sweeps(&lab, "wide", ["cork", "felt"], 6, 130);
    own_sweeps(&lab, "few", ["cork", "felt"], 3, 4);
    own_sweeps(&lab, "two", ["cork", "felt"], 6, 4);
    lab.twin("four.h5", "--materials 4 --sweeps 6 --steps 60");
    let refused = |name: &str, data: &str, options: &[&str]| {
        let out = lab.path("out").display().to_string();
        let verb = ["experiment", "run", name, "--out", &out, "--data"];
        let refused = refusal(with(&lab, &verb, data, options));
        assert!(!lab.path("out").exists(), "nothing was planned: {refused}");
        refused
    };
    let axes = refused("crossval_baselines", "wide", &["--set", "steps=100"]);
    assert!(
        axes.contains("wide: ") && axes.contains("add --axes-are-right"),
        "{axes}"
    );
    let few = refused("sequential", "few", &[]);
    assert_says!(
        few,
        "`cork`: expected at least 5, one for each fold, found 3"
    );
    let two = refused("nshot", "two", &[]);
    assert!(
        two.contains("at least four materials") && two.contains("found 2"),
        "{two}"
    );
    let four = refused("unknown", "four.h5", &[]);
    assert!(four.contains("`--set new_materials=2`"), "{four}");
    let none = refused("nshot", "no.npz", &[]);
    assert!(none.contains("no.npz"), "{none}");
}

#[test]
fn training_warns_of_wrong_axes_and_of_sweeps_too_few_to_calibrate() {
    let lab = Lab::new();
    own_sweeps(&lab, "wide", ["cork", "felt"], 2, 130);
    let recipe = lab.recipe(RecipeChange::default()).display().to_string();
    let train = |options: &[&str]| {
        let mut command = with(&lab, &["train", "--data"], "wide", options);
        command.args(["--recipe", &recipe, "--steps", "100", "--out"]);
        command.arg(lab.path("run"));
        command
    };
    let refused = refusal(train(&[]));
    assert!(refused.contains("np.moveaxis"), "{refused}");
    assert!(refused.contains("add --axes-are-right"), "{refused}");
    // `check` reports as an error what `train` refuses.
    let check = |more: &[&str]| with(&lab, &["data", "check"], "wide", more);
    let found = stdout(&expect(1, check(&[])));
    assert!(found.contains("add --axes-are-right"), "{found}");
    expect(0, check(&["--axes-are-right"]));
    assert!(!lab.path("run").exists());
    let refused = refusal(train(&["--calibrate", "--axes-are-right"]));
    assert_says!(refused, "taxels: if 130 is the number of time steps");
    assert_says!(refused, "the axes are in another order");
    assert_says!(refused, "cross-validation uses 2 folds instead of 5");
    assert_says!(
        refused,
        "training sweeps of `cork`: expected at least 5, since a calibration sets a fifth"
    );
}

#[test]
fn a_path_without_its_option_is_answered_with_the_option() {
    let lab = Lab::new();
    std::fs::create_dir(lab.path("run")).unwrap();
    for (verb, path, option) in [
        (&["train"][..], "twin.h5", "--data"),
        (&["demo"], "run", "--run"),
        (&["serve"], "run", "--run"),
    ] {
        let mut command = tactnet(verb.iter().copied());
        command.arg(path).current_dir(lab.folder.path());
        let said = refusal(command);
        let tip = format!("did you mean `{option} {path}`?");
        assert!(said.contains(&tip), "{said}");
    }
    let mut run = tactnet(["experiment", "run", "crossval_baselines"]);
    run.args(["--data", "missing.npz", "--out", "out"]);
    run.current_dir(lab.folder.path());
    let said = refusal(run);
    assert!(said.contains("missing.npz"), "{said}");
}

#[test]
fn a_material_spelt_otherwise_is_answered_with_the_one_that_is_known() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["cork", "felt"], 6, 4);
    own_sweeps(&lab, "other", ["Cork", "felt"], 6, 4);
    lab.run("train --data @own --model means --out @run");
    let refused = lab.refused("eval @run --data @other");
    assert_says!(refused, "is `Cork` the `cork` that it knows?");
}

/// With two sweeps per material, one is left for training. Models that cannot train on it fail before they create a folder.
#[test]
fn models_that_cannot_learn_from_one_sweep_of_a_material_are_refused_at_once() {
    let lab = Lab::new();
    own_sweeps(&lab, "pair", ["cork", "felt"], 2, 4);
    for model in ["minirocket", "lda"] {
        let train = ["train", "--model", model, "--out", "run", "--data"];
        let refused = refusal(with(&lab, &train, "pair", &[]));
        let least = format!("training sweeps of `cork`: expected at least 2 for model `{model}`");
        assert!(refused.contains(&least), "{refused}");
        assert_says!(refused, "`--model fast` learns from fewer");
        assert!(!lab.path("run").exists());
    }
    let experiment = |options: &[&str]| {
        let line = "experiment run crossval_baselines --out @out --set folds=2 --data @pair";
        let mut run = lab.command(line);
        run.args(options);
        let refused = refusal(run);
        assert!(!lab.path("out").exists(), "nothing was planned: {refused}");
        refused
    };
    let refused = experiment(&[]);
    let remedy = "possible with `--set 'models=[\"fast\"]'` `--set 'probes=[\"means\", \"first-frame\", \"last-frame\"]'`";
    assert!(refused.contains(remedy), "{refused}");
    // The command that `train` suggests, with fewer epochs.
    let line = "experiment run crossval_baselines --out @possible --set folds=2 --data @pair";
    let mut proposed = lab.command(line);
    for setting in [
        "models=[\"fast\"]",
        "probes=[\"means\", \"first-frame\", \"last-frame\"]",
        "epochs=2",
    ] {
        proposed.args(["--set", setting]);
    }
    expect(0, proposed);
    let refused = experiment(&["--set", "models=[\"lda\"]", "--set", "probes=[]"]);
    assert!(refused.contains("record more sweeps"), "{refused}");
}
