//! Actions that fix errors.

use std::path::PathBuf;

use tactnet_data::Remedy;

/// Action that fixes an error. The front end words it, for example as an option of the command line.
#[derive(Debug, Clone, PartialEq)]
pub enum PipelineRemedy {
    /// Change the data or its description.
    Data(Remedy),
    /// Confirm that the axes of the data are in the right order.
    ConfirmAxes,
    /// Accept warnings about the data.
    AcceptWarnings,
    /// Train again with the sample rate named.
    TrainWithRate,
    /// Name the current path of a run's data set.
    NameData,
    /// Name a run directory.
    NameRun,
    /// Name another folder for the run.
    NameFolder,
    /// Continue the training of a run.
    Resume {
        /// Path of the run directory.
        run: PathBuf,
    },
    /// Continue the training of a run, or name another folder.
    ResumeOrNameFolder {
        /// Path of the run directory.
        run: PathBuf,
    },
    /// Train one of these built-in models instead.
    ChooseModel {
        /// Names of the models, at least one.
        models: Vec<&'static str>,
    },
    /// Train a network instead of a baseline.
    TrainNetwork,
    /// Make a network of a committee.
    Distill {
        /// Path of the committee's run directory.
        run: PathBuf,
    },
    /// Add the unknown material to the network, or calibrate a network so that it detects unknown materials.
    EnrollOrCalibrate,
    /// Calibrate a network, so that it detects unknown materials.
    Calibrate,
    /// Enrol fewer sweeps of a file, so that the others can be tested.
    EnrollFewerSweeps,
    /// Relax the targets of a calibration to these values.
    RelaxTargets {
        /// Share of false alarms; `None`: keep it.
        false_alarms: Option<f64>,
        /// Coverage of prediction sets; `None`: keep it.
        coverage: Option<f64>,
    },
    /// Accept the risks of an adaptation.
    AcceptRisk,
    /// Train a network, or a baseline with scaled features, instead.
    ChooseScaledModel,
    /// Adapt without labels, or train a network or a linear baseline instead.
    AdaptWithoutLabels,
    /// Train a committee whose recipe lists networks alone.
    ListNetworks,
    /// Record more sweeps.
    RecordMore,
}
