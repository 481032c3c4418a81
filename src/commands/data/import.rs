//! `tactnet data import`: converts a recording, tables or arrays into a data set.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::Args;
use tactnet_data::format::{
    Axes, FileLayout, Format, Keep, NamePattern, ReadOptions, Span, Windows, read_to_classify_with,
    read_with,
};
use tactnet_data::{DataError, DataSource, Dataset, Severity};

use super::ConvertArgs;
use crate::commands::array_names::ArrayNames;
use crate::commands::choices::{rate, steps};
use crate::{output, source};

#[derive(Args)]
pub struct ImportArgs {
    #[command(flatten)]
    pub(super) convert: ConvertArgs,
    /// Material of the sweeps, for data that does not name it
    #[arg(long, value_name = "NAME")]
    pub(super) material: Option<String>,
    /// Number of time steps of each sweep to keep, from its start; `shortest`; or `all`, which keeps unequal lengths [default: all of
    /// equally long sweeps; for a recording the recorded classifier's, or 1000]
    #[arg(long, value_name = "N|shortest|all", value_parser = steps)]
    pub(super) steps: Option<Keep>,
    /// Sample rate, in Hz [default: from the data; for a recording the recorded classifier's, or by the frames' clock]
    #[arg(long, value_name = "HZ")]
    pub(super) rate: Option<f64>,
    /// Rows and columns of taxels [default: from the data; for a recording the recorded classifier's, or a square]
    #[arg(long, value_name = "RxC", value_parser = shape)]
    pub(super) shape: Option<(usize, usize)>,
    #[command(flatten)]
    pub(super) cut: CutArgs,
}

/// Options of continuous recordings and tables.
#[derive(Args)]
pub(super) struct CutArgs {
    /// Resample all sweeps to this rate, in Hz: low-pass filtered, from the time stamps; gaps are not bridged
    #[arg(long, value_name = "HZ", value_parser = rate)]
    resample: Option<f64>,
    /// Cut continuous recordings into sweeps of this length (128 steps, 1.28s, 640ms), within stretches of one label and
    /// without a gap; each stretch is a block
    #[arg(long, value_name = "LENGTH", value_parser = span)]
    window: Option<Span>,
    /// Distance between the starts of windows [default: their length, so that they do not overlap]
    #[arg(long, value_name = "LENGTH", value_parser = span, requires = "window")]
    hop: Option<Span>,
    /// Table of labelled intervals for `--window`: columns start, end (times of the recording's clock), label, and file if
    /// there are several recordings [default: the recording's column `label`]
    #[arg(long, value_name = "FILE.csv", requires = "window")]
    intervals: Option<PathBuf>,
    /// Leave out the frames with this label, or with `--names` the sweeps of this material; may be repeated
    #[arg(long, value_name = "NAME")]
    drop_label: Vec<String>,
    /// Columns of a table that are taxels [default: all that have no other meaning]
    #[arg(long, value_name = "A,B,...", value_delimiter = ',')]
    columns: Vec<String>,
    /// Pattern of the files' names in a folder, such as '{material}_{sweep}.txt' or '{split}/{block}/{material}.npy'
    #[arg(long, value_name = "PATTERN", value_parser = names)]
    names: Option<NamePattern>,
    /// Order of the axes of the array of one sweep (.npy), such as taxels,steps or rows,cols,steps
    #[arg(long, value_name = "ORDER", value_parser = axes)]
    axes: Option<Axes>,
    /// Number of lines of a text file that form a frame; `--columns 15-74` selects taxels among its numbers
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    lines_per_frame: Option<u32>,
    /// Stretch every sweep to this number of steps, by linear interpolation
    #[arg(long, value_name = "STEPS", value_parser = clap::value_parser!(u32).range(2..))]
    stretch: Option<u32>,
    /// Topic of a recording (.mcap) of any program whose numbers are frames: JSON, Protocol Buffers, ROS 1 and 2
    #[arg(long, value_name = "NAME")]
    pub(super) topic: Option<String>,
    /// Numbers of a message of `--topic`, such as `data`, `wrench.force` or `layers[0].values`; may be repeated [default:
    /// its only array]
    #[arg(long, value_name = "PATH", requires = "topic")]
    pub(super) field: Vec<String>,
    /// Text or number of a message of `--topic` that names the material of its frame
    #[arg(long, value_name = "PATH", requires = "topic")]
    pub(super) label_field: Option<String>,
    #[command(flatten)]
    arrays: ArrayNames,
}

impl CutArgs {
    fn windows(&self) -> Option<Windows> {
        let length = self.window?;
        Some(Windows {
            hop: self.hop,
            intervals: self.intervals.clone(),
            drop_labels: self.drop_label.clone(),
            ..Windows::of(length)
        })
    }

    fn layout(&self) -> FileLayout {
        FileLayout {
            names: self.names.clone(),
            axes: self.axes.clone(),
            lines_per_frame: self.lines_per_frame.map(|lines| lines as usize),
            stretch: self.stretch.map(|steps| steps as usize),
            drop_materials: self.drop_label.clone(),
        }
    }

    /// Returns the first option that is set, for data that allows none.
    fn first(&self) -> Option<&'static str> {
        let options = [
            (self.resample.is_some(), "--resample"),
            (self.window.is_some(), "--window"),
            (!self.columns.is_empty(), "--columns"),
            (self.names.is_some(), "--names"),
            (self.topic.is_some(), "--topic"),
        ];
        let mut options = options.into_iter();
        let set = options.find_map(|(set, name)| set.then_some(name));
        set.or_else(|| self.arrays.first())
    }
}

fn names(text: &str) -> Result<NamePattern, String> {
    text.parse().map_err(|error: DataError| error.to_string())
}

fn axes(text: &str) -> Result<Axes, String> {
    text.parse().map_err(|error: DataError| error.to_string())
}

/// Parses the length of a window.
fn span(text: &str) -> Result<Span, String> {
    text.parse().map_err(|error: DataError| error.to_string())
}

/// Parses rows and columns, for example `4x4`.
fn shape(text: &str) -> Result<(usize, usize), String> {
    let parsed = text
        .split_once('x')
        .and_then(|(rows, cols)| Some((rows.parse().ok()?, cols.parse().ok()?)));
    parsed.ok_or_else(|| format!("expected rows and columns like 4x4, found `{text}`"))
}

impl ImportArgs {
    fn options(&self) -> ReadOptions {
        ReadOptions {
            keep: self.steps.unwrap_or_default(),
            rate_hz: self.rate,
            columns: self.cut.columns.clone(),
            resample_hz: self.cut.resample,
            windows: self.cut.windows(),
            samples: self.cut.arrays.samples.clone(),
            labels: self.cut.arrays.labels.clone(),
            blocks: self.cut.arrays.blocks.clone(),
            layout: self.cut.layout(),
        }
    }

    fn is_recording(&self) -> bool {
        Path::new(&self.convert.data)
            .extension()
            .is_some_and(|extension| extension == "mcap")
    }
}

/// Reads unlabelled sweeps, all of `material`.
///
/// # Errors
/// Fails as [`read_to_classify_with`] does, or if the file names its materials.
fn of_material(path: &Path, options: &ReadOptions, material: &str) -> anyhow::Result<Dataset> {
    let found = read_to_classify_with(path, options)?;
    if found.labelled {
        bail!(
            "--material {material}: {} names its materials itself",
            path.display()
        );
    }
    Ok(found.dataset.of_one_material(material)?)
}

/// Reads the data set of the arguments.
fn read(arguments: &ImportArgs) -> anyhow::Result<Dataset> {
    let data = &arguments.convert.data;
    let path = Path::new(data);
    if DataSource::is_twin(data) || !path.exists() {
        if arguments.material.is_some() {
            bail!("--material: `{data}` names its materials itself");
        }
        if let Some(option) = arguments.cut.first() {
            bail!("{option}: expected a file, found `{data}`");
        }
        let twin = source::load(data)?.with_named_rate(arguments.rate)?;
        return Ok(match arguments.steps {
            Some(Keep::First(steps)) => twin.first_steps(steps)?,
            _ => twin,
        });
    }
    let options = arguments.options();
    if let Some(topic) = &arguments.cut.topic {
        return read_topic(arguments, topic, &options);
    }
    match &arguments.material {
        Some(material) => of_material(path, &options, material),
        None => Ok(read_with(path, &options)?),
    }
}

#[cfg(feature = "recording")]
use super::import_recording::read_topic;

#[cfg(not(feature = "recording"))]
fn read_topic(_: &ImportArgs, _: &str, _: &ReadOptions) -> anyhow::Result<Dataset> {
    bail!(tactnet_models::MissingFeature {
        feature: "recording"
    })
}

/// Prints the findings of reading.
///
/// # Errors
/// Fails if there are errors: the converted file would not show them.
fn review(data: &str, dataset: &Dataset) -> anyhow::Result<()> {
    let findings = dataset.reading_findings();
    for finding in findings
        .iter()
        .filter(|finding| finding.severity == Severity::Note)
    {
        say!("note: {}", finding.message);
    }
    source::warn_of_findings(findings);
    let errors = findings
        .iter()
        .filter(|finding| finding.severity == Severity::Error);
    match errors.count() {
        0 => Ok(()),
        errors => bail!(
            "{data}: {}; `tactnet data check {} --all` lists all",
            output::counted(errors, "error"),
            tactnet_pipeline::quoted(data)
        ),
    }
}

/// Another program's data set, in any format that is read.
fn import_data_set(arguments: &ImportArgs, format: Format) -> anyhow::Result<ExitCode> {
    let ConvertArgs { data, out, force } = &arguments.convert;
    output::refuse_to_overwrite(out, *force)?;
    let mut dataset = read(arguments)?;
    review(data, &dataset)?;
    if let Some((rows, cols)) = arguments.shape {
        let own = dataset.shape();
        if !dataset.is_patch_assumed() && (own.rows, own.cols) != (rows, cols) {
            say!(
                "warning: {data} states {}x{} taxels, but `--shape {rows}x{cols}` takes precedence",
                own.rows,
                own.cols
            );
        }
        dataset = dataset.with_patch(rows, cols)?;
    }
    source::warn_of_assumed_rate(dataset.is_rate_assumed(), dataset.sample_rate_hz());
    if dataset.is_patch_assumed() && dataset.shape().taxels() > 1 {
        say!(
            "note: the data does not state the arrangement of its {} taxels; they form one row, unless `--shape RxC` is given",
            dataset.shape().taxels()
        );
    }
    format.write(out, &dataset)?;
    say!(
        "{}: {} sweeps of {} ({})",
        out.display(),
        dataset.len(),
        output::counted(dataset.labels().len(), "material"),
        dataset.describe_shape()
    );
    Ok(ExitCode::SUCCESS)
}

/// Converts a recording or a data set.
///
/// # Errors
/// Fails if the input cannot be read or the output format cannot hold it.
pub fn run(arguments: &ImportArgs) -> anyhow::Result<ExitCode> {
    let format = Format::from_extension(&arguments.convert.out)?;
    if !arguments.is_recording() || arguments.cut.topic.is_some() {
        return import_data_set(arguments, format);
    }
    if let Some(option) = arguments.cut.first() {
        bail!("{option}: expected `--topic NAME` with it, for a recording");
    }
    #[cfg(feature = "recording")]
    return super::import_recording::run(arguments, format);
    #[cfg(not(feature = "recording"))]
    bail!(tactnet_models::MissingFeature {
        feature: "recording"
    })
}
