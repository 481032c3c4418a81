//! Exported network in ONNX Runtime.

use std::path::PathBuf;
use std::sync::OnceLock;

use ort::environment::Environment;
use ort::session::Session;
use ort::value::TensorRef;
use tactnet_data::SweepShape;

use super::{ExportedNetwork, RuntimeFailure};

/// Environment variable with the path of the shared library, for a library outside the system's search path.
const LIBRARY: &str = "ORT_DYLIB_PATH";

/// Returns the environment of this process. The first call loads the library.
fn environment() -> Result<&'static Environment, RuntimeFailure> {
    static LOADED: OnceLock<Environment> = OnceLock::new();
    if let Some(loaded) = LOADED.get() {
        return Ok(loaded);
    }
    let library =
        std::env::var_os(LIBRARY).map_or_else(|| "libonnxruntime.so".into(), PathBuf::from);
    let builder = ort::init_from(&library).map_err(|error| {
        format!("cannot load ONNX Runtime; `{LIBRARY}` names its shared library, which is in PyPI's onnxruntime: capi/libonnxruntime.so.*: {error}")
    })?;
    let environment = builder.build()?;
    Ok(LOADED.get_or_init(|| environment))
}

/// Session with the masks of a Monte Carlo prediction.
pub struct OnnxRuntime {
    session: Session,
    shape: SweepShape,
    features: usize,
    masks: Vec<f32>,
}

impl OnnxRuntime {
    /// - `model`: bytes of an exported ONNX file
    /// - `masks`: `[mc_samples][features]`; empty: plain prediction
    ///
    /// # Errors
    /// A missing ONNX Runtime; a model that it rejects.
    pub fn new(
        model: &[u8],
        shape: SweepShape,
        features: usize,
        masks: Vec<f32>,
        threads: usize,
    ) -> Result<Self, RuntimeFailure> {
        let environment = environment()?;
        let session = Session::builder(environment)?
            .with_intra_threads(threads)
            .map_err(ort::Error::<()>::from)?
            .commit_from_memory(model)?;
        Ok(Self {
            session,
            shape,
            features,
            masks,
        })
    }
}

impl ExportedNetwork for OnnxRuntime {
    fn score(&mut self, digits: &[f32]) -> Result<Vec<f64>, RuntimeFailure> {
        let sweeps = digits.len() / self.shape.values();
        let digits =
            TensorRef::from_array_view(([sweeps, self.shape.steps, self.shape.taxels()], digits))?;
        let mut outputs;
        let output = if self.masks.is_empty() {
            outputs = self.session.run(ort::inputs!["digits" => digits])?;
            "log_probability"
        } else {
            let mc_samples = self.masks.len() / self.features;
            let masks = TensorRef::from_array_view(([mc_samples, self.features], &*self.masks))?;
            outputs = self
                .session
                .run(ort::inputs!["digits" => digits, "masks" => masks])?;
            "mc_log_probability"
        };
        let found = outputs
            .remove(output)
            .ok_or_else(|| format!("the model has no output `{output}`"))?;
        let (_, scores) = found.try_extract_tensor::<f32>()?;
        Ok(scores.iter().map(|score| f64::from(*score)).collect())
    }
}
