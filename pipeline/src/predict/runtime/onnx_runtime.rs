//! Exported network in ONNX Runtime.

use std::path::PathBuf;
use std::sync::OnceLock;

use ort::environment::Environment;
use ort::session::Session;
use ort::value::TensorRef;
use tactnet_data::SweepShape;

use super::{ExportedNetwork, Masks, RuntimeFailure};

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
    masks: Vec<Masks>,
}

impl OnnxRuntime {
    /// - `model`: bytes of an exported ONNX file
    /// - `masks`: dropout masks of every network; empty: plain prediction
    ///
    /// # Errors
    /// A missing ONNX Runtime; a model that it rejects.
    pub fn new(
        model: &[u8],
        shape: SweepShape,
        masks: Vec<Masks>,
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
            masks,
        })
    }
}

impl ExportedNetwork for OnnxRuntime {
    fn score(&mut self, digits: &[f32]) -> Result<Vec<f64>, RuntimeFailure> {
        let output = match self.masks.is_empty() {
            true => "log_probability",
            false => "mc_log_probability",
        };
        self.output(output, digits)
    }
}

impl OnnxRuntime {
    /// Returns the values of an output.
    ///
    /// - `digits`: `[sweeps][steps][taxels]`
    fn output(&mut self, output: &str, digits: &[f32]) -> Result<Vec<f64>, RuntimeFailure> {
        let sweeps = digits.len() / self.shape.values();
        let digits =
            TensorRef::from_array_view(([sweeps, self.shape.steps, self.shape.taxels()], digits))?;
        let mut inputs = ort::inputs!["digits" => digits];
        for of in &self.masks {
            let extents = [of.samples, of.values.len() / of.samples];
            let masks = TensorRef::from_array_view((extents, &*of.values))?;
            inputs.push((of.input.as_str().into(), masks.into()));
        }
        let mut outputs = self.session.run(inputs)?;
        let found = outputs
            .remove(output)
            .ok_or_else(|| format!("the model has no output `{output}`"))?;
        let (_, scores) = found.try_extract_tensor::<f32>()?;
        Ok(scores.iter().map(|score| f64::from(*score)).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use tactnet_data::twin;
    use tactnet_data::{Dataset, Fold, Samples, Scheme, Seed, SweepView};
    use tactnet_models::Compute;

    use super::*;
    use crate::{
        FittedModel, Likeness, ModelRecipe, NetworkRecipe, OnnxInputs, PredictionMethod, fit_model,
        to_onnx, train_network,
    };

    /// Returns the test sweeps, then the same with a dead taxel, with another gain, and with two taxels exchanged.
    fn disturbed(fold: &Fold<'_>) -> Dataset {
        let (view, shape) = (&fold.test, fold.test.shape());
        let mut values = vec![0.0; 4 * view.len() * shape.values()];
        let mut records = Vec::new();
        let sweeps = values.chunks_exact_mut(shape.values());
        for (number, sweep) in sweeps.enumerate() {
            let position = number % view.len();
            view.copy_batch(&[position], sweep);
            for frame in sweep.chunks_exact_mut(shape.taxels()) {
                match number / view.len() {
                    0 => {}
                    1 => frame[6] = 0.0,
                    2 => frame.iter_mut().for_each(|value| *value *= 1.5),
                    _ => frame.swap(0, 9),
                }
            }
            records.push(view.dataset().records()[view.indices()[position]].clone());
        }
        let labels = view.dataset().labels().clone();
        let samples = Samples::F32(values);
        Dataset::new("disturbed", 750.0, shape, labels, records, samples).unwrap()
    }

    #[test]
    fn p_values_of_the_exported_file_are_those_of_the_comparison_with_training_data() {
        assert!(
            std::env::var_os(LIBRARY).is_some(),
            "{LIBRARY} names ONNX Runtime's shared library"
        );
        let dataset = twin::small(6, 20, 125).unwrap();
        let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
        let recipe = "name = \"small\"\nnetwork = { maps = [4], hidden = 8 }\ninput = { scaling = \"per-taxel\" }\n\
             [training]\nepochs = 1\nbatch = 16\nlearning_rate = 0.005\nmethod = { kind = \"base\" }\n";
        let recipe = NetworkRecipe::parse("small", recipe).unwrap();
        let device = Compute::Cpu.open().unwrap();
        let trained = train_network(&recipe, &fold.train, Seed(1), &device, |_| true);
        let classifier = trained.unwrap().unwrap();
        let likeness = Likeness::fit(&fold.train, Seed(1)).unwrap().unwrap();
        let weights = classifier.network().unwrap().weights();
        let (config, about) = (classifier.config(), BTreeMap::new());
        let inputs = OnnxInputs::Digits;
        let model = to_onnx(config, &weights, None, Some(&likeness), inputs, &about).unwrap();
        let mut runtime = OnnxRuntime::new(&model, dataset.shape(), Vec::new(), 1).unwrap();

        let sweeps = disturbed(&fold);
        let offline = likeness.assess(&SweepView::all(&sweeps), Seed(1));
        let digits: Vec<f32> = (0..sweeps.len()).flat_map(|at| sweeps.sweep(at)).collect();
        let found = runtime.output("likeness", &digits).unwrap();
        assert_eq!(found.len(), sweeps.len());
        // A p-value is a rank among the training sweeps; the file computes in single precision, which may exchange two neighbours.
        let rank = 1.0 / (1 + fold.train.len()) as f64;
        let apart: Vec<f64> = found
            .iter()
            .zip(&offline.p_of_sweeps)
            .map(|(found, offline)| (found - offline).abs())
            .collect();
        assert!(apart.iter().all(|apart| *apart < 1.5 * rank), "{apart:?}");
        let same = apart.iter().filter(|apart| **apart < 1e-6).count();
        assert!(20 * same >= 19 * apart.len(), "{same} of {}", apart.len());
        // Both small and large ones occur.
        assert!(found.iter().any(|p| *p < 0.02) && found.iter().any(|p| *p > 0.5));
    }
    #[test]
    fn the_file_of_a_committee_averages_the_probabilities_of_its_networks() {
        let dataset = twin::small(3, 10, 60).unwrap();
        let fold = Fold::new(&dataset, Scheme::default(), Seed(1), 0, 0).unwrap();
        let training = "training = { epochs = 1, batch = 8, learning_rate = 0.01, method = { kind = \"base\" } }";
        let members = format!(
            "name = \"two\"\nmembers = [{{ name = \"a\", network = {{ maps = [4], hidden = 8 }}, {training} }}, \
             {{ name = \"b\", network = {{ maps = [3], hidden = 6 }}, input = {{ levels = \"removed\" }}, {training} }}]"
        );
        let recipe = ModelRecipe::parse("two", &members).unwrap();
        let device = Compute::Cpu.open().unwrap();
        let fitted = fit_model(&recipe, &fold.train, Seed(1), &device, |_| true);
        let FittedModel {
            classifier,
            weights,
        } = fitted.unwrap().unwrap();
        let (config, about) = (classifier.config(), BTreeMap::new());
        let model = to_onnx(config, &weights, None, None, OnnxInputs::Digits, &about).unwrap();
        let mut runtime = OnnxRuntime::new(&model, dataset.shape(), Vec::new(), 1).unwrap();
        let digits: Vec<f32> = (0..fold.test.len())
            .flat_map(|at| fold.test.sweep(at))
            .collect();
        let found = runtime.score(&digits).unwrap();
        let expected = classifier.log_probabilities(&fold.test, PredictionMethod::Plain);
        for (found, expected) in found.iter().zip(expected.unwrap().concat()) {
            // Single precision.
            assert!((found - expected).abs() < 1e-4, "{found} {expected}");
        }
    }
}
