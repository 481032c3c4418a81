//! A newcomer with few sweeps of their own: what they are told without having asked.

use std::process::Command;

use crate::command::{Lab, RecipeChange, expect, stderr, stdout, tactnet};

/// Writes a folder of `.csv`, which does not say its rate: two materials, `sweeps` of each.
fn own_sweeps(lab: &Lab, folder: &str, names: [&str; 2], sweeps: usize, taxels: usize) {
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

fn with(lab: &Lab, verb: &[&str], data: &str, options: &[&str]) -> Command {
    let mut command = tactnet(verb.iter().copied());
    command.arg(lab.path(data)).args(options);
    command.current_dir(lab.folder.path());
    command
}

#[test]
fn few_training_steps_are_named_and_what_comes_next() {
    let lab = Lab::new();
    let recipe = lab.recipe(RecipeChange::default());
    let output = expect(0, lab.train(&recipe, "run"));
    let (found, said) = (stdout(&output), stderr(&output));
    assert!(
        said.contains("hint: 12 training steps are few; `--epochs 75` trains for 300"),
        "{said}"
    );
    assert!(
        !said.contains(" epochs instead of "),
        "the recipe's own: {said}"
    );
    assert!(said.contains("next: `tactnet demo --run "), "{said}");
    // Few steps lead nowhere: the last lines say what helps.
    let end = said.rfind("next: ").map_or("", |at| &said[at..]);
    assert!(end.contains("hint: 12 training steps are few"), "{said}");
    assert!(
        found.contains("guessing one of 4 materials is right in 25.0 %"),
        "{found}"
    );
    assert!(
        said.contains("`tactnet experiment run crossval_baselines --set data="),
        "{said}"
    );
    assert!(
        found.contains("(fold 1 of 5)") && found.contains("in brackets: 95 % interval"),
        "{found}"
    );

    let more = lab.recipe(RecipeChange {
        extra_training: "least_steps = 40",
        ..RecipeChange::default()
    });
    let said = stderr(&expect(0, lab.train(&more, "more")));
    let why = "note: 10 epochs instead of 3, since these few sweeps make 4 batches an epoch, and the recipe trains on at least 40 batches";
    assert!(said.contains(why), "{said}");

    let flat = lab.path("flat.npz").display().to_string();
    let shape = ["--shape", "1x16", "--out", &flat];
    expect(0, with(&lab, &["data", "import"], "twin.h5", &shape));
    let refused = stderr(&expect(2, with(&lab, &["eval"], "run", &["--data", &flat])));
    assert!(
        refused.contains("`tactnet data import FILE --out NEW --shape 4x4`"),
        "{refused}"
    );
    // A shape that was declared is no more rearranged than the run's own.
    let refused = with(&lab, &["predict"], "run", &["--data", &flat]);
    let refused = stderr(&expect(2, refused));
    assert!(
        refused.contains("`tactnet data import FILE --out NEW --shape 4x4`"),
        "{refused}"
    );
    let again = stderr(&expect(2, lab.train(&recipe, "run")));
    assert!(
        again.contains("which has ended; name another folder"),
        "{again}"
    );
}

#[test]
fn a_missing_table_and_a_recording_that_is_there_come_with_what_to_do() {
    let lab = Lab::new();
    let serve = ["--table", "robott.toml"];
    let refused = stderr(&expect(2, with(&lab, &["serve", "--run"], "run", &serve)));
    assert!(
        refused.contains("`tactnet serve --print-table > robott.toml` writes one"),
        "{refused}"
    );
    std::fs::write(lab.path("there.mcap"), "").unwrap();
    let record = ["--table", "robott.toml"];
    let refused = with(&lab, &["record", "--out"], "there.mcap", &record);
    let refused = stderr(&expect(2, refused));
    assert!(
        refused.contains("exists already; name another file with `--out`"),
        "{refused}"
    );
}

#[test]
fn materials_that_a_run_does_not_know_are_named_while_it_predicts() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["cork", "felt"], 6, 4);
    own_sweeps(&lab, "other", ["cork", "silk"], 6, 4);
    let run = lab.path("run").display().to_string();
    let means = ["--model", "means", "--out", &run];
    let said = stderr(&expect(0, with(&lab, &["train", "--data"], "own", &means)));
    assert!(said.contains("note: one row of 4 taxels"), "{said}");
    let said = stderr(&expect(
        0,
        with(&lab, &["predict", &run, "--data"], "other", &[]),
    ));
    assert!(
        said.contains("hint: the run does not know `silk`, and cannot say \"unknown\""),
        "{said}"
    );
    let said = stderr(&expect(
        0,
        with(&lab, &["predict", &run, "--data"], "own", &[]),
    ));
    assert!(!said.contains("does not know"), "{said}");
}

#[test]
fn a_recipe_that_ships_can_be_printed_and_trained_by() {
    let text = stdout(&expect(0, tactnet(["train", "--print-recipe", "fast"])));
    assert!(text.contains("name = \"fast\""), "{text}");
    let refused = stderr(&expect(2, tactnet(["train", "--print-recipe", "fats"])));
    assert!(refused.contains("did you mean `fast`?"), "{refused}");
    let refused = stderr(&expect(2, tactnet(["train", "--model", "tree"])));
    assert!(refused.contains("see `tactnet train --help`"), "{refused}");
}

#[test]
fn a_rate_that_nobody_named_is_said_and_can_be_named_everywhere() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["0", "1"], 6, 4);
    let json = |options: &[&str]| -> serde_json::Value {
        let output = expect(0, with(&lab, &["data", "check"], "own", options));
        serde_json::from_str(&stdout(&output)).unwrap()
    };
    let kinds = |report: &serde_json::Value| -> Vec<String> {
        let findings = report["findings"].as_array().unwrap().iter();
        findings
            .map(|finding| finding["kind"].as_str().unwrap().into())
            .collect()
    };
    let assumed = json(&["--json"]);
    assert_eq!(
        (&assumed["errors"], &assumed["warnings"]),
        (&0.into(), &1.into())
    );
    assert_eq!(
        kinds(&assumed),
        ["assumed_rate", "numbered_materials", "assumed_patch"]
    );
    let named = json(&["--json", "--rate", "200"]);
    assert_eq!(kinds(&named), ["numbered_materials", "assumed_patch"]);

    let own = lab.path("own.npz").display().to_string();
    let rate = ["--rate", "200", "--out", &own];
    expect(0, with(&lab, &["data", "import"], "own", &rate));
    let run = lab.path("run").display().to_string();
    let means = ["--model", "means", "--out", &run];
    expect(0, with(&lab, &["train", "--data"], "own.npz", &means));
    let refused = stderr(&expect(
        2,
        with(&lab, &["eval", &run, "--data"], "own", &[]),
    ));
    assert!(
        refused.contains("expects 200 Hz, the data set has 750 Hz, which is assumed")
            && refused.contains("`--rate HZ` names it"),
        "{refused}"
    );
    let rate = ["--rate", "200"];
    expect(0, with(&lab, &["eval", &run, "--data"], "own", &rate));

    own_sweeps(&lab, "named", ["cork", "felt"], 6, 4);
    let refused = with(&lab, &["eval", &run, "--data"], "named", &rate);
    let refused = stderr(&expect(2, refused));
    assert!(
        refused.contains(
            "some of 0, 1, the data set has materials named `cork`, `felt`, which it does not know"
        ),
        "{refused}"
    );

    let recipe = lab.recipe(RecipeChange::default());
    let experiment = |out: &str, more: &[&str]| {
        let models = format!("models=[\"means\", \"{}\"]", recipe.display());
        let mut command = tactnet(["experiment", "run", "crossval_baselines", "--out"]);
        let data = format!("data={}", lab.path("own").display());
        command
            .arg(lab.path(out))
            .args(["--set", &data, "--set", &models]);
        command.args([
            "--set",
            "folds=2",
            "--set",
            "probes=[]",
            "--set",
            "groups=0",
        ]);
        command.args(more);
        let output = expect(0, command);
        let (found, said) = (stdout(&output), stderr(&output));
        let page = String::from_utf8(lab.read(&format!("{out}/report.html"))).unwrap();
        (found, said, page)
    };
    let (found, said, page) = experiment("assumed", &[]);
    let warning =
        "own does not say its sample rate; 750 Hz is assumed, `--set rate_hz=HZ` names it";
    assert!(found.contains(&format!("warning: {warning}")), "{found}");
    assert!(said.contains(&format!("warning: {warning}")), "{said}");
    assert!(page.contains("<strong>Assumed:</strong> own does not say"));
    assert!(found.contains("TactNet-II (small), MC dropout"), "{found}");
    assert!(!found.contains("published"), "{found}");
    // Two of the five folds are asked for, and that says little.
    assert!(
        found.contains("own, 2 of 5 random folds, levels kept"),
        "{found}"
    );
    assert!(found.contains("note: 95 % interval"), "{found}");
    assert!(page.contains("(2 of 5 random folds)"));
    assert!(page.contains("Test sweeps: 2 of 5 random folds, counted together."));
    assert!(!page.contains("random split") && !page.contains("Split "));
    let few =
        "TactNet-II (small) on own: 6 training steps are few; `--set epochs=150` trains for 300";
    assert!(found.contains(&format!("hint: {few}")), "{found}");
    let few = few.replace("`--", "<code>--").replace("`", "</code>");
    assert!(page.contains(&few) && page.contains("training steps a fold, which are few."));
    let (found, said, page) = experiment("rated", &["--set", "rate_hz=200"]);
    assert!(
        !found.contains("assumed") && !said.contains("assumed") && !page.contains("Assumed:"),
        "{found}"
    );
}

#[test]
fn experiments_refuse_what_does_not_suit_them_before_the_first_task() {
    let lab = Lab::new();
    own_sweeps(&lab, "wide", ["cork", "felt"], 6, 130);
    own_sweeps(&lab, "few", ["cork", "felt"], 3, 4);
    own_sweeps(&lab, "two", ["cork", "felt"], 6, 4);
    let mut four = tactnet(["data", "twin", "--materials", "4", "--sweeps", "6"]);
    four.args(["--steps", "60", "--out"])
        .arg(lab.path("four.h5"));
    expect(0, four);
    let refused = |name: &str, data: &str, options: &[&str]| {
        let out = lab.path("out").display().to_string();
        let verb = ["experiment", "run", name, "--out", &out, "--data"];
        let refused = stderr(&expect(2, with(&lab, &verb, data, options)));
        assert!(!lab.path("out").exists(), "nothing was planned: {refused}");
        refused
    };
    let axes = refused("crossval_baselines", "wide", &["--set", "steps=100"]);
    assert!(
        axes.contains("wide: ") && axes.contains("add --axes-are-right"),
        "{axes}"
    );
    let few = refused("sequential", "few", &[]);
    assert!(
        few.contains("`cork`: expected at least 5, one for each fold, found 3"),
        "{few}"
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
    let refused = stderr(&expect(2, train(&[])));
    assert!(refused.contains("np.moveaxis"), "{refused}");
    assert!(refused.contains("add --axes-are-right"), "{refused}");
    // What `train` refuses is an error of the check as well.
    let check = |more: &[&str]| with(&lab, &["data", "check"], "wide", more);
    let found = stdout(&expect(1, check(&[])));
    assert!(found.contains("add --axes-are-right"), "{found}");
    expect(0, check(&["--axes-are-right"]));
    assert!(!lab.path("run").exists());
    let refused = stderr(&expect(2, train(&["--calibrate", "--axes-are-right"])));
    assert!(
        refused.contains("taxels: if 130 is the number of time steps"),
        "{refused}"
    );
    assert!(
        refused.contains("the axes are in another order"),
        "{refused}"
    );
    assert!(refused.contains("deals 2 folds instead of 5"), "{refused}");
    assert!(
        refused.contains(
            "training sweeps of `cork`: expected at least 5, since a calibration (`--calibrate`)"
        ),
        "{refused}"
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
        let said = stderr(&expect(2, command));
        let tip = format!("did you mean `{option} {path}`?");
        assert!(said.contains(&tip), "{said}");
    }
    let mut run = tactnet(["experiment", "run", "crossval_baselines"]);
    run.args(["--data", "missing.npz", "--out", "out"]);
    run.current_dir(lab.folder.path());
    let said = stderr(&expect(2, run));
    assert!(said.contains("missing.npz"), "{said}");
}

/// Writes sweeps of the small twin without their materials: a folder of `.csv`, and one file of one sweep.
fn without_labels(lab: &Lab) -> Vec<String> {
    let dataset = tactnet_data::format::read(&lab.path("twin.h5")).unwrap();
    let folder = lab.path("new");
    std::fs::create_dir(&folder).unwrap();
    // One of each material, and three more of the last.
    let chosen = [0, 10, 20, 30, 31, 32, 33];
    for (place, sweep) in chosen.iter().enumerate() {
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
    chosen.iter().map(|sweep| name(sweep).into()).collect()
}

#[test]
fn sweeps_without_materials_are_classified_as_eval_classifies_them() {
    let lab = Lab::new();
    let named = without_labels(&lab);
    let recipe = lab.recipe(RecipeChange {
        epochs: Some(12),
        ..RecipeChange::default()
    });
    let mut train = lab.train(&recipe, "run");
    train.args(["--calibrate", "--false-alarms", "0.2", "--coverage", "0.8"]);
    expect(0, train);
    let predict = |data: &str, options: &[&str]| {
        let mut command = with(&lab, &["predict"], "run", options);
        command.args(["--data", data]);
        command
    };
    let found = expect(
        0,
        predict("new", &["--json", "--one-object", "--out", "found.csv"]),
    );
    let found: serde_json::Value = serde_json::from_str(&stdout(&found)).unwrap();
    let rows = found["sweeps"].as_array().unwrap();
    assert_eq!(rows.len(), named.len());
    let run = tactnet::Classifier::load(lab.path("run")).unwrap();
    let dataset = tactnet_data::format::read(&lab.path("twin.h5")).unwrap();
    let view = tactnet::SweepView::new(&dataset, vec![0, 10, 20, 30, 31, 32, 33]);
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
    // One sweep as an array of its frames, rows and columns.
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
    let alone = expect(0, predict("one.npy", &["--json"]));
    let alone: serde_json::Value = serde_json::from_str(&stdout(&alone)).unwrap();
    assert_eq!(alone["sweeps"].as_array().unwrap().len(), 1);
    let of = |row: &serde_json::Value| -> Vec<f64> {
        let all = row["probabilities"].as_array().unwrap().iter();
        all.map(|p| p.as_f64().unwrap()).collect()
    };
    for (one, among) in of(&alone["sweeps"][0]).iter().zip(of(&rows[0])) {
        // A batch of one rounds otherwise.
        assert!((one - among).abs() < 1e-6, "{one} {among}");
    }
    let fused = &found["object"];
    let best = (0..sums.len())
        .max_by(|a, b| sums[*a].total_cmp(&sums[*b]))
        .unwrap();
    assert_eq!(fused["material"], materials[best]);
    assert_eq!(fused["sweeps"], rows.len());
    let table = String::from_utf8(lab.read("found.csv")).unwrap();
    assert_eq!(table.lines().count(), 1 + rows.len());
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
    let again = |out: &str| stderr(&expect(2, predict("new", &["--out", out])));
    assert!(again("found.csv").contains("overwrite it with `--force`"));
    assert!(again("found.txt").contains(".csv or .json"));
    expect(0, predict("new", &["--out", "found.csv", "--force"]));
    expect(0, predict("new", &["--out", "found.json"]));
    let written: serde_json::Value = serde_json::from_slice(&lab.read("found.json")).unwrap();
    assert_eq!(written["sweeps"].as_array().unwrap().len(), rows.len());

    // A file alone, and a data set with materials, which then stand beside.
    let one = stdout(&expect(0, predict("new/0.csv", &[])));
    assert!(
        one.contains("or else") && one.contains("1 sweep: "),
        "{one}"
    );
    let known = expect(0, predict("twin.h5", &["--json", "--mc", "0"]));
    let said = stderr(&known);
    assert!(
        said.contains("note: the run has learnt from 32 of these 40 sweeps"),
        "{said}"
    );
    let known: serde_json::Value = serde_json::from_str(&stdout(&known)).unwrap();
    assert_eq!(known["sweeps"][30]["named"], named[3]);
    // The same sweeps in another file.
    let some = lab.path("some.npz").display().to_string();
    let import = with(
        &lab,
        &["data", "import"],
        "new",
        &[
            "--rate",
            "750",
            "--shape",
            "4x4",
            "--material",
            "any",
            "--out",
            &some,
        ],
    );
    expect(0, import);
    let said = stderr(&expect(0, predict("some.npz", &["--mc", "0"])));
    assert!(
        said.contains("note: the run has learnt from ")
            && said.contains(" sweeps, which says nothing"),
        "{said}"
    );
    let shown = stdout(&expect(0, predict("twin.h5", &[])));
    assert!(shown.lines().next().unwrap().contains("named"), "{shown}");
    assert!(shown.contains(" of 40 right"), "{shown}");
    let plain = stdout(&expect(0, with(&lab, &["eval", "--mc", "0"], "run", &[])));
    assert!(!plain.contains("MC dropout"), "{plain}");
    let refused = stderr(&expect(2, predict("new", &["--rate", "100"])));
    assert!(
        refused.contains("new: the classifier expects 750 Hz")
            && refused.contains("100 Hz, as `--rate` says"),
        "{refused}"
    );
    let refused = stderr(&expect(2, predict("nothing", &[])));
    assert!(refused.contains("nothing"), "{refused}");
    // What is longer is cut, and a material is learnt from sweeps that nobody labelled.
    let row = vec!["9"; 16].join(",") + "\n";
    std::fs::write(lab.path("long.csv"), row.repeat(200)).unwrap();
    let refused = stderr(&expect(2, predict("long.csv", &[])));
    assert!(refused.contains("`--steps 120`"), "{refused}");
    expect(0, predict("long.csv", &["--steps", "120"]));
    let same = |options: &[&str]| {
        let both = ["long.csv", "long.csv"];
        with(&lab, &["same"], "run", &[&both[..], options].concat())
    };
    expect(2, same(&[]));
    expect(0, same(&["--steps", "120"]));
    let slow = lab.path("slow.npz").display().to_string();
    let slower = ["--rate", "100", "--out", &slow];
    let said = expect(0, with(&lab, &["data", "import"], "twin.h5", &slower));
    let said = stderr(&said);
    assert!(
        said.contains("twin.h5 says 750 Hz; `--rate 100` is taken instead"),
        "{said}"
    );
    for command in [
        predict("slow.npz", &[]),
        with(&lab, &["eval"], "run", &["--data", "slow.npz"]),
        with(
            &lab,
            &["demo", "--listen", "0", "--data", "slow.npz", "--run"],
            "run",
            &[],
        ),
    ] {
        let refused = stderr(&expect(2, command));
        assert!(
            refused.contains("slow.npz: the classifier expects"),
            "{refused}"
        );
        assert!(refused.contains("100 Hz"), "{refused}");
    }
    let mut enroll = with(
        &lab,
        &["enroll"],
        "run",
        &["--data", "new", "--material", "felt"],
    );
    enroll.args(["--out", "grown", "--rate", "750", "--steps", "120"]);
    expect(0, enroll);
    let mut again = with(&lab, &["predict"], "grown", &["--data", "new", "--json"]);
    again.arg("--one-object");
    let found: serde_json::Value = serde_json::from_str(&stdout(&expect(0, again))).unwrap();
    assert_eq!(found["materials"].as_array().unwrap().len(), 5);
}

#[test]
fn a_material_spelt_otherwise_is_answered_with_the_one_that_is_known() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["cork", "felt"], 6, 4);
    own_sweeps(&lab, "other", ["Cork", "felt"], 6, 4);
    let run = lab.path("run").display().to_string();
    let means = ["--model", "means", "--out", &run];
    expect(0, with(&lab, &["train", "--data"], "own", &means));
    let refused = stderr(&expect(
        2,
        with(&lab, &["eval", &run, "--data"], "other", &[]),
    ));
    assert!(
        refused.contains("is `Cork` the `cork` that it knows?"),
        "{refused}"
    );
}

/// Two files of one object each, and the object beside itself.
#[test]
fn two_objects_are_of_one_material_or_of_two() {
    let lab = Lab::new();
    own_sweeps(&lab, "own", ["glass", "felt"], 12, 4);
    let recipe = lab.recipe(RecipeChange::default());
    let data = lab.path("own").display().to_string();
    let train = ["train", "--data", &data, "--rate", "750", "--epochs", "60"];
    let mut training = tactnet(train);
    training
        .arg("--recipe")
        .arg(&recipe)
        .arg("--out")
        .arg(lab.path("run"));
    expect(0, training);
    own_sweeps(&lab, "cup", ["glass", "other"], 2, 4);
    own_sweeps(&lab, "cloth", ["other", "felt"], 2, 4);
    let [cup, cloth] = [("cup", "glass"), ("cloth", "felt")]
        .map(|(a, b)| lab.path(a).join(b).display().to_string());
    let same = |first: &str, second: &str| -> f64 {
        let call = with(&lab, &["same"], "run", &[first, second, "--json"]);
        let found: serde_json::Value = serde_json::from_str(&stdout(&expect(0, call))).unwrap();
        assert_eq!(found["objects"][0]["sweeps"], 2);
        found["same"].as_f64().unwrap()
    };
    let (alone, apart) = (same(&cup, &cup), same(&cup, &cloth));
    assert!(alone > apart, "{alone} {apart}");
    assert!(
        (same(&cloth, &cup) - apart).abs() < 1e-12,
        "either way round"
    );
    let said = stdout(&expect(0, with(&lab, &["same"], "run", &[&cup, &cloth])));
    assert!(said.contains("probability of one material "), "{said}");
    expect(2, with(&lab, &["same"], "run", &[&cup, "nowhere.npz"]));
    // Names in the files that contradict the verdict, and those that the run does not know.
    let named = |file: &str, name: &str| {
        let out = lab.path(file).display().to_string();
        let more = ["--material", name, "--rate", "750", "--out", &out];
        expect(0, with(&lab, &["data", "import"], "cup/glass", &more));
        out
    };
    let (glass, silk) = (named("glass.npz", "glass"), named("silk.npz", "silk"));
    let both = expect(0, with(&lab, &["same"], "run", &[&glass, &silk]));
    let (verdict, hints) = (stdout(&both), stderr(&both));
    assert!(
        verdict.contains("the files say otherwise: glass names `glass`, silk `silk`"),
        "{verdict}"
    );
    assert!(hints.contains("the run does not know `silk`"), "{hints}");
    // The run is named either way, and what is odd about the files is said.
    let named = with(&lab, &["same", "--run"], "run", &[&cup, &cloth]);
    assert_eq!(stdout(&expect(0, named)), said);
    expect(
        2,
        with(&lab, &["same", "--run"], "run", &[&cup, &cloth, &cup]),
    );
    expect(2, with(&lab, &["same"], "run", &[&cup]));
    let several = stderr(&expect(2, with(&lab, &["same"], "run", &[&cup, &data])));
    assert!(
        several.contains("expected sweeps of one object, found 2 materials"),
        "{several}"
    );
    let twice = stderr(&expect(0, with(&lab, &["same"], "run", &[&cup, &cup])));
    assert!(twice.contains("are the same sweeps"), "{twice}");
}
