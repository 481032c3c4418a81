//! Other programs and libraries that parts of `tactnet` use.

use std::path::{Path, PathBuf};

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
            "only for `tactnet view`: `pip install rerun-sdk`",
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
    // A driver says in such a file that it is there; NVIDIA's driver has a device besides.
    let drivers: Vec<String> = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"]
        .iter()
        .filter_map(|folder| std::fs::read_dir(folder).ok())
        .flatten()
        .flatten()
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| name.ends_with(".json"))
        .collect();
    let nvidia = Path::new("/dev/nvidia0").exists();
    if drivers.is_empty() && !nvidia {
        return Check::not_ok(
            Status::Note,
            name,
            format!("no driver for {}", built.join(" and ")),
            "Debian: `apt install mesa-vulkan-drivers`, or NVIDIA's own",
        );
    }
    Check::ok(
        name,
        format!(
            "Vulkan drivers: {}; NVIDIA: {}",
            if drivers.is_empty() {
                "none".into()
            } else {
                drivers.join(", ")
            },
            if nvidia { "yes" } else { "no" }
        ),
    )
}
