//! Committees with the real binary.

use crate::command::{Lab, assert_says, expect, json, refusal, stderr};

/// Two small networks.
const NETWORKS: &str = r#"
name = "two"

[[members]]
name = "conv"
network = { maps = [8, 8], hidden = 16, keep_probability = 0.8 }
input = { scaling = "per-taxel" }
training = { epochs = 6, batch = 8, learning_rate = 0.005, method = { kind = "base" } }
prediction = { method = { kind = "mc-dropout", runs = 20 } }

[[members]]
name = "bands"
network = { spectra = { bands = 6, taxel_units = 5, units = 12 }, hidden = 16, keep_probability = 0.8 }
input = { scaling = "per-taxel", levels = "removed" }
training = { epochs = 6, batch = 8, learning_rate = 0.005, method = { kind = "base" } }
prediction = { method = { kind = "mc-dropout", runs = 20 } }
"#;

/// Trains a committee with these recipe and options into the folder `run`.
fn trained(lab: &Lab, recipe: &str, data: &str, more: &[&str]) {
    std::fs::write(lab.path("committee.toml"), recipe).unwrap();
    let line = format!("train --data @{data} --recipe @committee.toml --out @run");
    expect(0, lab.command_with(&line, more));
}

#[test]
fn a_calibrated_committee_says_what_it_does_not_know_and_compares_objects() {
    let lab = Lab::new();
    lab.twin("three.h5", "--materials 3 --sweeps 60 --steps 120");
    let recipe = "name = \"three\"\nmembers = [\"lda\", \"minirocket\", \"means\"]";
    let options = ["--calibrate", "--false-alarms", "0.1"];
    trained(&lab, recipe, "three.h5", &options);
    // The fourth material of the small twin is unknown.
    let found = json(lab.command("eval --json @run --data @twin.h5"));
    assert_eq!(found["n_unknown"], 10, "{found}");
    let verdicts = &found["verdicts"];
    assert_eq!(verdicts["detected"]["n"], 10, "{found}");
    // Sweeps of a material that no member knows are called unknown more often than those of known ones.
    let share = |name: &str| verdicts[name]["mean"].as_f64().unwrap();
    assert!(share("detected") > share("false_alarms"), "{found}");
    let own = json(lab.command("eval --json @run"));
    // 36 test sweeps at a target of 0.9: three standard deviations and the uncertainty of the threshold.
    let coverage = own["verdicts"]["coverage"]["mean"].as_f64().unwrap();
    assert!(coverage >= 0.7, "{own}");

    let predicted = json(lab.command("predict --json @run --data @twin.h5"));
    assert!(predicted["sweeps"][0]["unknown"].is_boolean());
    assert!(predicted["sweeps"][0]["prediction_set"].is_array());

    write_first_of(&lab, "three.h5", 0, &lab.path("one.npz"));
    let same = json(lab.command("same --json @run @one.npz @one.npz"));
    assert!(same["same"].as_f64().unwrap() > 0.5, "{same}");
}

#[cfg(feature = "onnxruntime")]
#[test]
fn a_committee_of_networks_is_one_onnx_file_with_the_same_probabilities() {
    assert!(
        std::env::var_os("ORT_DYLIB_PATH").is_some(),
        "ORT_DYLIB_PATH names ONNX Runtime's shared library"
    );
    let lab = Lab::new();
    lab.twin("data.h5", "--materials 4 --sweeps 20 --steps 125");
    trained(&lab, NETWORKS, "data.h5", &[]);
    let found = json(lab.command("eval --json --runtime onnxruntime @run"));
    for way in ["plain", "mc_dropout"] {
        let apart = found["runtimes"][way]["largest_difference"].as_f64();
        // As for single networks.
        assert!(apart.is_some_and(|apart| apart < 1e-4), "{way}: {found}");
    }
    for (file, masks) in [("plain.onnx", ""), ("masks.onnx", "--masks")] {
        lab.run(&format!("export @run {masks} --out @{file}"));
        let text = String::from_utf8_lossy(&lab.read(file)).into_owned();
        assert_eq!(text.contains("bands/masks"), !masks.is_empty(), "{file}");
        assert!(text.contains("[\"conv\",\"bands\"]"), "members: {file}");
    }
    let refused = lab.refused("export @run --out @run.safetensors");
    assert!(refused.contains("only an ONNX form"), "{refused}");
}

#[test]
fn members_without_an_onnx_form_are_named() {
    let lab = Lab::new();
    let recipe = "name = \"three\"\nmembers = [\"lda\", \"means\"]";
    trained(&lab, recipe, "twin.h5", &[]);
    let export = lab.command("export @run --out @run.onnx");
    let refused = refusal(export);
    assert_says!(refused, "no ONNX form: lda, means; export a network");
    assert!(!lab.path("run.onnx").exists());
    let refused = lab.refused("eval --runtime online @run");
    assert_says!(refused, "a committee runs in `burn`, and in `onnxruntime`");
}

#[test]
fn a_committee_learns_a_material_and_names_the_members_that_cannot() {
    let lab = Lab::new();
    lab.twin("three.h5", "--materials 3 --sweeps 30 --steps 120");
    lab.twin("four.h5", "--materials 4 --sweeps 30 --steps 120");
    let names = |data: &str| {
        let dataset = tactnet_data::format::read(&lab.path(data)).unwrap();
        let names = dataset.labels().names();
        names.map(String::from).collect::<Vec<_>>()
    };
    let known = names("three.h5");
    let all = names("four.h5");
    let new = all.iter().find(|name| !known.contains(name)).unwrap();
    let recipe = "name = \"three\"\nmembers = [\"lda\", \"svm-spectra\", \"means\"]";
    let options = ["--calibrate", "--false-alarms", "0.2", "--coverage", "0.8"];
    trained(&lab, recipe, "three.h5", &options);
    let enroll = |run: &str, sweeps: &str, out: &str| {
        let line = format!("enroll @{run} --data @four.h5 --sweeps {sweeps} --json --out @{out}");
        lab.command_with(&line, &["--material", new])
    };
    let ten = json(enroll("run", "10", "ten"));
    assert_eq!(ten["materials"], 4, "{ten}");
    assert!(ten["left_out"].is_null() && ten["prior"].is_null(), "{ten}");
    // 90 sweeps: 18 are test sweeps; of the other 72, a fifth is held out.
    let held_out = ten["cost"]["held_out"].as_u64().unwrap();
    assert!((12..=15).contains(&held_out), "{ten}");
    assert_eq!(lab.json("ten/calibration.json")["sweeps"], held_out);
    let found = json(lab.command("eval --json @ten --data @four.h5"));
    assert_eq!(found["n_unknown"], 0, "{found}");
    let learnt = found["confusion"]["materials"].as_array().unwrap();
    assert_eq!(learnt.len(), 4, "{found}");

    let one = json(enroll("run", "1", "one"));
    assert_eq!(one["left_out"][0]["name"], "svm-spectra", "{one}");
    let again = refusal(enroll("ten", "1", "again"));
    assert!(again.contains("only once after its training"), "{again}");
    std::fs::rename(lab.path("three.h5"), lab.path("elsewhere.h5")).unwrap();
    let lost = refusal(enroll("run", "10", "lost"));
    assert_says!(lost, "need the run's training sweeps again");
    assert!(!lab.path("lost").exists());
}

/// Writes the first three sweeps of a material.
fn write_first_of(lab: &Lab, from: &str, label: usize, to: &std::path::Path) {
    use tactnet_data::format::{Format, read};
    use tactnet_data::{Dataset, Samples, SweepView};
    let all = read(&lab.path(from)).unwrap();
    let own = (0..all.len()).filter(|index| all.records()[*index].label == label);
    let own: Vec<usize> = own.take(3).collect();
    let mut values = vec![0.0; own.len() * all.shape().values()];
    SweepView::new(&all, own.clone()).copy_batch(&[0, 1, 2], &mut values);
    let records = own.iter().map(|index| all.records()[*index].clone());
    let (rate, labels) = (all.sample_rate_hz(), all.labels().clone());
    let samples = Samples::F32(values);
    let few = Dataset::new("few", rate, all.shape(), labels, records.collect(), samples);
    Format::Npz.write(to, &few.unwrap()).unwrap();
}

#[test]
fn a_committee_serves_its_network_and_a_distilled_one() {
    let lab = Lab::new();
    lab.twin("data.h5", "--materials 3 --sweeps 15 --steps 100");
    lab.run("train --epochs 2 --data @data.h5 --out @run");
    assert_eq!(lab.json("run/result.json")["recipe"], "committee");
    assert_eq!(lab.json("run/network/result.json")["recipe"], "fast");
    lab.run("serve --print-table --run @run");

    let said = stderr(&lab.run("export @run --out @network.onnx"));
    assert!(said.contains("its network `fast` is exported"), "{said}");

    let said = stderr(&lab.run("distill @run --out @one"));
    assert!(said.contains("committee, without part 5 of 5"), "{said}");
    let compared = said
        .lines()
        .any(|line| line.starts_with("one sweep: ") && line.contains("the committee "));
    assert!(compared, "{said}");
    let [whole, one] = ["run", "one"].map(|run| lab.json(&format!("{run}/result.json")));
    assert_eq!(one["recipe"], "distilled");
    assert_eq!(one["data_sha256"], whole["data_sha256"]);
    lab.run("export @one --out @one.onnx");

    let refused = lab.refused("distill @one");
    assert_says!(refused, "only committees are distilled");
}
