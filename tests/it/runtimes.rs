//! The exported network in other runtimes, evaluated on the same sweeps as in Burn.

use crate::command::{CONVOLUTIONS, Lab, RecipeChange, SPECTRA, json};

/// A small trained network with `layers`, `levels` removed or kept, and a number of steps that leaves a pool unfilled.
fn trained(levels: &str, layers: &'static str) -> Lab {
    let lab = Lab::new();
    lab.recipe(RecipeChange {
        epochs: Some(2),
        layers,
        ..RecipeChange::default()
    });
    lab.twin("data.h5", "--materials 4 --sweeps 20 --steps 125");
    let options = "--data @data.h5 --recipe @small.toml --out @run";
    lab.run(&format!("train --levels {levels} {options}"));
    lab
}

fn agrees(runtime: &str) {
    for (levels, layers) in [
        ("kept", CONVOLUTIONS),
        ("removed", CONVOLUTIONS),
        ("kept", SPECTRA),
        ("removed", SPECTRA),
    ] {
        let lab = trained(levels, layers);
        let found = json(lab.command(&format!("eval --json --runtime {runtime} @run")));
        for way in ["plain", "mc_dropout"] {
            let compared = &found["runtimes"][way];
            assert_eq!(compared["runtime"], runtime, "{found}");
            let apart = compared["largest_difference"].as_f64().unwrap();
            assert!(apart < 1e-4, "levels {levels}, {layers}, {way}: {apart}");
            assert!(compared["p50_us"].as_f64().unwrap() > 0.0);
        }
    }
}

#[test]
fn single_sweeps_in_burn_agree_with_batches() {
    agrees("burn");
}

#[cfg(feature = "candle")]
#[test]
fn candle_agrees_with_burn() {
    agrees("candle");
}

#[cfg(feature = "onnxruntime")]
#[test]
fn onnx_runtime_agrees_with_burn() {
    assert!(
        std::env::var_os("ORT_DYLIB_PATH").is_some(),
        "ORT_DYLIB_PATH names ONNX Runtime's shared library"
    );
    agrees("onnxruntime");
}

#[cfg(not(feature = "candle"))]
#[test]
fn a_runtime_that_was_left_out_is_named() {
    use crate::command::assert_says;
    let lab = trained("kept", CONVOLUTIONS);
    let said = lab.refused("eval --runtime candle @run");
    assert_says!(said, "`cargo install --path . --features candle`");
}
