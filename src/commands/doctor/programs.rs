//! Checks of other programs and libraries that parts of `tactnet` use.

use std::path::{Path, PathBuf};

use tactnet_models::{Adapter, Compute};

use super::{Check, Status};

/// Environment variable with the path of the ONNX Runtime library.
const ONNX_RUNTIME: &str = "ORT_DYLIB_PATH";

pub(super) fn checks(features: &[&str]) -> Vec<Check> {
    let mut checks = vec![onnx_runtime(features), gpu(features)];
    for (name, program, advice) in [
        (
            "browser",
            &["chromium", "google-chrome", "firefox"][..],
            "needed for the demo's page and reports, on this or another machine",
        ),
        (
            "Slurm",
            &["sbatch"][..],
            "needed only for `experiment run --engine slurm`",
        ),
        (
            "Rerun viewer",
            &["rerun"][..],
            "needed only for `tactnet view`: run `pip install rerun-sdk==0.36.3`",
        ),
        (
            "Python",
            &["python3"][..],
            "needed only for the scripts of experiments/bench",
        ),
    ] {
        checks.push(match program.iter().find_map(|program| found(program)) {
            Some(path) => Check::ok(name, path.display().to_string()),
            None => Check::not_ok(Status::Note, name, "not found", advice),
        });
    }
    checks
}

/// Returns the path of a program in the search path.
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
            "needed only for `eval --runtime onnxruntime`: build with `--features onnxruntime`",
        );
    }
    let advice =
        format!("run `pip install onnxruntime` and set {ONNX_RUNTIME}=…/libonnxruntime.so");
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
            "needed only for `train --device vulkan` or `cuda`: build with `--features vulkan` or `cuda`",
        );
    }
    if features.contains(&"vulkan") {
        return vulkan(Compute::vulkan_adapter().map_err(|error| error.to_string()));
    }
    if Path::new("/dev/nvidia0").exists() {
        let found = "NVIDIA card with its driver; CUDA itself is not tested";
        return Check::ok(name, found);
    }
    Check::not_ok(
        Status::Note,
        name,
        "no NVIDIA card with a driver",
        "needed only for `train --device cuda`: install NVIDIA's driver",
    )
}

/// Checks the Vulkan device.
///
/// - `adapter`: the Vulkan device, or the reason why there is none
fn vulkan(adapter: Result<Adapter, String>) -> Check {
    let name = "GPU";
    match adapter {
        Ok(card) if !card.software => Check::ok(name, format!("{} (Vulkan)", card.name)),
        Ok(driver) => Check::not_ok(
            Status::Note,
            name,
            format!("none, only a software driver ({})", driver.name),
            "`train --device vulkan` would run on the processor, slower than `--device cpu`",
        ),
        Err(reason) => Check::not_ok(
            Status::Note,
            name,
            format!("none: {reason}"),
            "needed only for `train --device vulkan`: install the card's driver (Debian: `apt install mesa-vulkan-drivers`, or NVIDIA's own)",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_software_driver_is_not_a_gpu() {
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
