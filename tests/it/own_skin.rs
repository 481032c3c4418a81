//! A user's own skin on the robot's channels: other value ranges, and settings that cannot be served.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;

use serde_json::Value;
use tactnet_channel::{Table, remove_bus};
use tactnet_data::format::{Format, read};
use tactnet_data::{Dataset, Samples, SweepRecord};

use crate::command::{Lab, RecipeChange, assert_says, output_of, refusal, signal, tactnet};
use crate::robot::{Robot, Running};

/// Writes the sweeps of `from` with this number of rows and columns, without blocks.
fn write_patch(from: &Path, to: &Path, (rows, cols): (usize, usize)) {
    let twin = read(from).unwrap().with_patch(rows, cols).unwrap();
    let records = twin.records().iter().map(|record| SweepRecord {
        block: None,
        ..*record
    });
    let own = Dataset::new(
        "own",
        twin.sample_rate_hz(),
        twin.shape(),
        twin.labels().clone(),
        records.collect(),
        twin.samples().clone(),
    );
    Format::Npz.write(to, &own.unwrap()).unwrap();
}

/// Writes the sweeps of `from` as a baseline-subtracted skin would record them: floats from -2.4 to 10.35 at 750 Hz.
fn write_own(from: &Path, to: &Path) {
    let twin = read(from).unwrap();
    let values = (0..twin.len()).flat_map(|sweep| twin.sweep(sweep));
    let own = Dataset::new(
        "own",
        twin.sample_rate_hz(),
        twin.shape(),
        twin.labels().clone(),
        twin.records().to_vec(),
        Samples::F32(values.map(|digit| digit * 0.05 - 2.4).collect()),
    );
    Format::Npz.write(to, &own.unwrap()).unwrap();
}

/// Trains a small network on `data` of the lab.
fn train(lab: &Lab, data: &str, out: &str) {
    lab.recipe(RecipeChange::default());
    lab.run(&format!(
        "train --data @{data} --recipe @small.toml --out @{out}"
    ));
}

#[test]
fn every_sweep_of_a_skin_with_values_below_zero_is_judged_in_the_demo() {
    let lab = Lab::new();
    write_own(&lab.path("twin.h5"), &lab.path("own.npz"));
    train(&lab, "own.npz", "own");
    let config = lab.json("own/config.json");
    let values = &config["classifier"]["values"];
    assert!(values["least"].as_f64().unwrap() < 0.0, "{values}");
    let mut demo = lab.command("demo --listen 127.0.0.1:0 --data @own.npz --run @own");
    let mut demo = Running(demo.stdout(Stdio::piped()).spawn().unwrap());
    let mut said = BufReader::new(demo.0.stdout.take().unwrap()).lines();
    assert_eq!(said.next().unwrap().unwrap(), "ready");
    // Two sweeps of each material remain to play.
    let object = said.next().unwrap().unwrap();
    assert!(object.starts_with("object 1: said "), "{object}");
    assert!(object.contains(" after 2 sweeps, it was "), "{object}");
    signal("INT", demo.0.id());
    let rest: Vec<String> = said.map(Result::unwrap).collect();
    assert!(!rest.iter().any(|line| line.contains("rejected")));
    assert!(demo.0.wait().unwrap().success());
}

#[test]
fn a_contact_that_own_values_never_reach_is_refused_before_anything_is_served() {
    let lab = Lab::new();
    write_own(&lab.path("twin.h5"), &lab.path("own.npz"));
    train(&lab, "own.npz", "own");
    let own = lab.path("own").display().to_string();
    let print = tactnet(["serve", "--print-table", "--run", &own]);
    let text = output_of(print);
    assert!(text.contains("\nvalues = [-"), "{text}");
    assert!(text.contains("\nskip = 0 "), "{text}");
    let bus = format!("owncontact{}", std::process::id());
    let text = text.replace("\"robot\"", &format!("\"{bus}\"")).replace(
        "segmentation = \"command\"",
        "segmentation = { contact = { begins = 40.0 } }",
    );
    std::fs::write(lab.path("robot.toml"), text).unwrap();
    let table = Table::load(&lab.path("robot.toml")).unwrap();
    let hub = Running::start(lab.command("channel hub --table @robot.toml"));
    let mut serve = tactnet(["serve", "--run", &own, "--table"]);
    serve.arg(lab.path("robot.toml"));
    let refused = refusal(serve);
    assert!(refused.contains("a contact at a mean of 40"), "{refused}");
    assert!(
        refused.contains("lower `begins` and `ends`") && refused.lines().count() == 1,
        "{refused}"
    );
    hub.end();
    remove_bus(&table).unwrap();
}

#[test]
fn a_baseline_is_refused_in_words() {
    let lab = Lab::new();
    lab.run("train --data @twin.h5 --model means --out @means");
    let both = "networks and committees";
    for (call, models, what) in [
        (
            "demo --listen 127.0.0.1:0 --run @means",
            "networks",
            "be served",
        ),
        ("serve --print-table --run @means", "networks", "be served"),
        ("export @means --out @out.onnx", both, "be exported"),
        (
            "enroll @means --data @twin.h5 --material wood --out @out.onnx",
            both,
            "learn a new material",
        ),
    ] {
        let refused = lab.refused(call);
        let reason = format!(
            "it is a baseline (means), and only {models} can {what}; train one with `tactnet train --data FILE`\n"
        );
        assert!(refused.ends_with(&reason), "{call}: {refused}");
    }
}

#[test]
fn beliefs_are_echoed_in_words_and_a_second_service_is_told_of_the_first() {
    let robot = Robot::new("echo");
    let _hub = robot.start(&["channel", "hub"]);
    let service = robot.serve("models/1");
    let table = robot.lab.path("robot.toml").display().to_string();
    let second = "serve --run @models/1 --metrics off --table @robot.toml";
    let refused = robot.lab.refused(second);
    let process = format!("process {}, probably another", service.0.id());
    assert!(refused.contains(&process), "{refused}");

    let _skin = robot.skin("1000");
    let echo = |channel: &str, arguments: &[&str]| {
        let mut echo = tactnet(["channel", "echo", channel, "--table", &table]);
        output_of({
            echo.args(arguments);
            echo
        })
    };
    let words = echo("tactile/belief", &["--count", "40"]);
    let last = words.lines().last().unwrap();
    assert!(last.contains("sweep ") && last.contains(" %"), "{words}");
    assert!(!last.contains("label "), "materials have names: {words}");
    // The sweep length follows from the network's names, and about every second belief is provisional.
    let provisional = words
        .lines()
        .any(|line| line.contains(" of 120 frames, provisional: "));
    let complete = words.lines().any(|line| line.contains(", complete"));
    assert!(provisional && complete, "{words}");
    let document = echo("tactile/belief", &["--count", "1", "--json"]);
    let document: Value = serde_json::from_str(&document).unwrap();
    let belief = &document["packet"];
    assert_eq!(belief["type"], "TactileBelief", "{document}");
    assert!(belief["sweep_says"]["probability"].is_number(), "{belief}");
    assert!(belief["sweep"].as_u64().unwrap() > 0, "{belief}");
    assert_eq!(belief["sweep_frames"], 120, "{belief}");
    assert_eq!(
        belief["provisional"],
        belief["stage"] == "anytime",
        "{belief}"
    );
    let frame = echo("skin/right", &["--count", "1"]);
    assert!(
        frame.contains(" frame ") && frame.contains("(8 more)"),
        "{frame}"
    );
}

#[test]
fn folds_and_grids_that_own_data_does_not_have_are_named_before_anything_is_trained() {
    let lab = Lab::new();
    write_patch(&lab.path("twin.h5"), &lab.path("own.npz"), (2, 8));
    write_patch(&lab.path("twin.h5"), &lab.path("turned.npz"), (8, 2));
    let experiment = |data: &str, folds: &str| {
        let mut run = tactnet(["experiment", "run", "leave_block_out", "--set", folds]);
        run.arg("--set");
        run.arg(format!("data=\"{}\"", lab.path(data).display()));
        run.arg("--out").arg(lab.path("out"));
        refusal(run)
    };
    let blocks = experiment("own.npz", "folds=1");
    assert!(blocks.contains("`blocks` of data set `own`"), "{blocks}");
    lab.twin("blocks.h5", "--materials 2 --sweeps 20 --steps 60");
    let many = experiment("blocks.h5", "folds=50");
    assert!(many.contains("expected `folds` of at most"), "{many}");
    assert!(!lab.path("out").exists(), "nothing was planned");

    train(&lab, "own.npz", "own");
    let turned = lab.refused("eval @own --data @turned.npz");
    assert_says!(turned, "rows and columns are probably exchanged");
    assert!(
        !turned.contains("--shape"),
        "that would mix up taxels: {turned}"
    );
}
