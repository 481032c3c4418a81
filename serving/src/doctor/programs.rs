//! Other programs and libraries that parts of `tactnet` use.

use std::path::{Path, PathBuf};

use tactnet_models::{Adapter, Compute};

use super::{Check, Status};

/// Where ONNX Runtime is looked for.
const ONNX_RUNTIME: &str = "ORT_DYLIB_PATH";

pub(super) fn checks(features: &[&str]) -> Vec<Check> {
    let mut checks = vec![onnx_runtime(features), gpu(features)];
    for (name, program, advice) in [
        (
            "browser",
            &["chromium", "google-chrome", "firefox"][..],
            "the demo's page and reports want one, on any machine that reaches this one",
        ),
        (
            "Slurm",
            &["sbatch"][..],
            "only for `experiment run --engine slurm`",
        ),
        (
            "Rerun viewer",
            &["rerun"][..],
            "only for `tactnet view`: `pip install rerun-sdk==0.36.3`",
        ),
        (
            "Python",
            &["python3"][..],
            "only for the scripts of experiments/bench",
        ),
    ] {
        checks.push(match program.iter().find_map(|program| found(program)) {
            Some(path) => Check::ok(name, path.display().to_string()),
            None => Check::not_ok(Status::Note, name, "not found", advice),
        });
    }
    checks
}

/// A program in the search path.
fn found(program: &str) -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders)
        .map(|folder| folder.join(program))
        .find(|path| path.is_file())
}

fn onnx_runtime(features: &[&str]) -> Check {
    let name = "ONNX Runtime";
    if !features.contains(&"onnxruntime") {
        return Check::not_ok(
            Status::Note,
            name,
            "not in this build",
            "only for `eval --runtime onnxruntime`: build with `--features onnxruntime`",
        );
    }
    let advice = format!("`pip install onnxruntime`, and {ONNX_RUNTIME}=…/libonnxruntime.so");
    match std::env::var_os(ONNX_RUNTIME) {
        Some(path) if Path::new(&path).is_file() => {
            Check::ok(name, Path::new(&path).display().to_string())
        }
        Some(path) => Check::not_ok(
            Status::Warning,
            name,
            format!("{ONNX_RUNTIME}: no file {}", Path::new(&path).display()),
            advice,
        ),
        None => Check::not_ok(
            Status::Note,
            name,
            format!("{ONNX_RUNTIME} is not set"),
            advice,
        ),
    }
}

fn gpu(features: &[&str]) -> Check {
    let name = "GPU";
    let built: Vec<&str> = ["vulkan", "cuda"]
        .into_iter()
        .filter(|feature| features.contains(feature))
        .collect();
    if built.is_empty() {
        return Check::not_ok(
            Status::Note,
            name,
            "not in this build",
            "only for `train --device vulkan` or `cuda`: build with `--features vulkan` or `cuda`",
        );
    }
    if features.contains(&"vulkan") {
        return vulkan(Compute::vulkan_adapter().map_err(|error| error.to_string()));
    }
    if Path::new("/dev/nvidia0").exists() {
        let found = "NVIDIA: a card and its driver; whether CUDA computes on it is not tried";
        return Check::ok(name, found);
    }
    Check::not_ok(
        Status::Note,
        name,
        "no NVIDIA card with a driver",
        "only for `train --device cuda`: NVIDIA's driver",
    )
}

/// - `answered`: what answers when a Vulkan device is asked for, or why nothing does
fn vulkan(answered: Result<Adapter, String>) -> Check {
    let name = "GPU";
    match answered {
        Ok(card) if !card.software => Check::ok(name, format!("{} (Vulkan)", card.name)),
        Ok(driver) => Check::not_ok(
            Status::Note,
            name,
            format!("none: a software driver alone answers ({})", driver.name),
            "`train --device vulkan` would compute on the processor, slower than `--device cpu`",
        ),
        Err(reason) => Check::not_ok(
            Status::Note,
            name,
            format!("none answers: {reason}"),
            "only for `train --device vulkan`: a card and its driver (Debian: `apt install mesa-vulkan-drivers`, or NVIDIA's own)",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_card_that_answers_is_a_gpu() {
        let adapter = |software| Adapter {
            name: "llvmpipe".into(),
            software,
        };
        assert_eq!(vulkan(Ok(adapter(false))).status, Status::Ok);
        let software = vulkan(Ok(adapter(true)));
        assert_eq!(software.status, Status::Note);
        assert!(software.found.contains("software driver"), "{software:?}");
        assert_eq!(vulkan(Err("no GPU".into())).status, Status::Note);
    }
}
