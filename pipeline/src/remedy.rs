//! Actions that fix errors.

use std::path::PathBuf;

/// Action that fixes an error. The front end words it, for example as an option of the command line.
#[derive(Debug, Clone, PartialEq)]
pub enum Remedy {
    /// Confirm that the axes of the data are in the right order.
    ConfirmAxes,
    /// Name the sample rate of the data.
    NameRate,
    /// Train again with the sample rate named.
    TrainWithRate,
    /// Keep only the first `steps` time steps of every sweep.
    KeepSteps {
        /// Number of steps.
        steps: usize,
    },
    /// Arrange the taxels of the data in rows and columns.
    ArrangeTaxels {
        /// Number of rows.
        rows: usize,
        /// Number of columns.
        columns: usize,
    },
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
    /// Record more sweeps.
    RecordMore,
}
