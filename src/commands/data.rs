//! `tactnet data`: inspects, checks, generates, converts and downloads data sets.

#[cfg_attr(not(feature = "fetch"), path = "data/without_fetch.rs")]
mod fetch;
mod import;
#[cfg(feature = "recording")]
mod import_recording;
mod info_table;
mod make_twin;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, Subcommand};
use tactnet_data::format::{self, Format, Keep, ReadOptions, SweepsToClassify};
use tactnet_data::{
    CheckReport, DataError, DataSource, FindingGroup, FindingKind, Severity, check, check_lengths,
    check_unlabelled, group_findings, info,
};
use tactnet_skin::packets::unfit;

use info_table::InfoTable;

use super::array_names::ArrayNames;
use super::choices::{rate, steps};
use crate::{failure, output, source, view};

#[derive(Subcommand)]
pub enum DataCommand {
    /// Show the contents of a data set
    #[command(
        after_help = "Examples:\n  tactnet data info sweeps.h5\n  tactnet data info twin --json"
    )]
    Info(FileArgs),
    /// Show sweeps in the Rerun viewer
    View(view::SweepsArgs),
    /// Check for problems that would spoil training; exit code 1 for errors, 2 if the data cannot be read
    #[command(
        after_help = "Examples:\n  tactnet data check sweeps.h5\n  tactnet data check sweeps.npz --json"
    )]
    Check(CheckArgs),
    /// Generate the synthetic TactMat twin
    #[command(after_help = "Examples:\n  tactnet data twin --out twin.h5\n  \
        tactnet data twin --materials 6 --sweeps 20 --out small.h5\n  \
        tactnet data twin --stats                compare its signal statistics with TactMat")]
    Twin(make_twin::TwinArgs),
    /// Convert a recording, tables or arrays into a data set: .h5, .npz, .ts
    #[command(
        alias = "convert",
        after_help = "Examples:\n  tactnet data import sweeps.npz --out sweeps.h5 --rate 100 --shape 4x4\n  \
        tactnet data import folder/ --out sweeps.npz --rate 100             a .csv per sweep, see docs/data.md\n  \
        tactnet data import today.mcap --out today.h5                     sweeps labelled by their start commands\n  \
        tactnet data import felt.mcap --out felt.h5 --material felt       all sweeps of one material; also .npz, .csv, .parquet\n  \
        tactnet data import walk.csv --out walk.npz --rate 20 --window 128            a recording with a label in each row\n  \
        tactnet data import log.csv --out log.npz --resample 100 --window 1s --intervals labels.csv\n  \
        tactnet data import bag.mcap --out bag.npz --topic /tip --field data --window 1s --intervals labels.csv\n\n\
        .h5 requires the same number of sweeps for every material; .npz does not."
    )]
    Import(Box<import::ImportArgs>),
    /// Convert a data set to another format: .npz (numpy), .ts (aeon), .h5
    #[command(
        after_help = "Examples:\n  tactnet data export sweeps.h5 --out sweeps.ts\n  \
        tactnet data export twin --out twin.npz"
    )]
    Export(ConvertArgs),
    /// Download a published data set and verify it
    #[command(
        after_help = "Examples:\n  tactnet data fetch tactmat --out tactmat.h5\n  \
        tactnet data fetch --list\n  \
        tactnet data fetch walking-terrain     writes public/walking-terrain.npz\n\n\
        Repeat the command to resume an interrupted download."
    )]
    Fetch(fetch::FetchArgs),
}

#[derive(Args)]
pub struct FileArgs {
    /// Data set (.h5, .npz, .mat, .csv, .parquet, a folder of .csv or .npy), or `twin`
    #[arg(value_name = "FILE|twin")]
    data: String,
    /// Sample rate, in Hz; it takes precedence over that of the data
    #[arg(long, value_name = "HZ", value_parser = rate)]
    rate: Option<f64>,
    /// Number of time steps of each sweep to use, from its start; `shortest`; or `all`, which keeps unequal lengths [default: all of
    /// equally long sweeps]
    #[arg(long, value_name = "N|shortest|all", value_parser = steps)]
    steps: Option<Keep>,
    #[command(flatten)]
    arrays: ArrayNames,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
pub struct CheckArgs {
    #[command(flatten)]
    file: FileArgs,
    /// List all findings [default: the first three of each kind]
    #[arg(long)]
    all: bool,
    /// Exit with code 1 for warnings, too
    #[arg(long)]
    strict: bool,
    /// Accept data with more taxels than time steps: the axes are correct
    #[arg(long)]
    axes_are_right: bool,
}

#[derive(Args)]
pub struct ConvertArgs {
    /// Data set or recording to read: .h5, .npz, .mat, .csv, .parquet, .mcap, a folder of .csv or .npy, or `twin`
    #[arg(value_name = "FILE|twin")]
    data: String,
    /// Output file; its extension selects the format
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Overwrite the file
    #[arg(long)]
    force: bool,
}

/// Runs the subcommand.
pub fn run(command: DataCommand) -> anyhow::Result<ExitCode> {
    match command {
        DataCommand::Info(arguments) => show_info(&arguments),
        DataCommand::View(arguments) => view::run_sweeps(&arguments),
        DataCommand::Check(arguments) => run_check(&arguments),
        DataCommand::Twin(arguments) => make_twin::run(&arguments),
        DataCommand::Import(arguments) => import::run(&arguments),
        DataCommand::Export(arguments) => convert(&arguments),
        DataCommand::Fetch(arguments) => fetch::run(&arguments),
    }
}

/// Reads a data set, even if some of its values are not finite.
///
/// - `otherwise`: frames to keep of each sweep without `--steps`
fn load_with_gaps(arguments: &FileArgs, otherwise: Keep) -> anyhow::Result<SweepsToClassify> {
    let data = arguments.data.as_str();
    Ok(if DataSource::is_twin(data) || !Path::new(data).exists() {
        if let Some(option) = arguments.arrays.first() {
            anyhow::bail!("{option}: expected a file, found `{data}`");
        }
        let dataset = source::load(data)?;
        let dataset = match arguments.steps {
            Some(Keep::First(steps)) => dataset.first_steps(steps)?,
            _ => dataset,
        };
        SweepsToClassify::of(dataset.with_named_rate(arguments.rate)?)
    } else {
        let options = ReadOptions {
            keep: arguments.steps.unwrap_or(otherwise),
            rate_hz: arguments.rate,
            samples: arguments.arrays.samples.clone(),
            labels: arguments.arrays.labels.clone(),
            blocks: arguments.arrays.blocks.clone(),
            ..ReadOptions::default()
        };
        format::read_to_classify_with_gaps(Path::new(data), &options)?
    })
}

fn show_info(arguments: &FileArgs) -> anyhow::Result<ExitCode> {
    let SweepsToClassify {
        dataset, labelled, ..
    } = load_with_gaps(arguments, Keep::Equal)?;
    let info = info(&dataset);
    let info = if labelled { info } else { info.unlabelled() };
    if arguments.json {
        output::print_json(&info)?;
    } else {
        output::print(InfoTable(info))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn run_check(arguments: &CheckArgs) -> anyhow::Result<ExitCode> {
    match load_with_gaps(&arguments.file, Keep::Most) {
        Ok(sweeps) => check_sweeps(arguments, sweeps),
        Err(error) => check_unreadable(arguments, error),
    }
}

/// Prints the places that cannot be read, if there are several or JSON was asked for, and returns the error.
fn check_unreadable(arguments: &CheckArgs, error: anyhow::Error) -> anyhow::Result<ExitCode> {
    if let Some(error) = error.downcast_ref::<DataError>().filter(|e| e.is_usage()) {
        let mut findings = error.findings();
        for finding in &mut findings {
            finding.message = failure::with_cure(&finding.message, finding.remedy.as_ref());
        }
        let report = CheckReport::of(findings);
        if arguments.file.json {
            output::print_json(&report)?;
        } else if report.findings.len() > 1 {
            print_report(arguments, &report)?;
        }
    }
    Err(error)
}

fn check_sweeps(arguments: &CheckArgs, sweeps: SweepsToClassify) -> anyhow::Result<ExitCode> {
    let SweepsToClassify {
        dataset,
        labelled,
        odd_lengths,
        ..
    } = sweeps;
    if !labelled {
        say!(
            "note: unlabelled data, checked as for `tactnet predict`; `train` needs labels (docs/data.md)"
        );
    }
    if let Some(reason) = unfit(dataset.taxel_shape().taxels(), dataset.labels().len()) {
        say!(
            "note: training and evaluation accept these sweeps, online classification does not: {reason}"
        );
    }
    let mut findings = if labelled {
        check(&dataset)
    } else {
        check_unlabelled(&dataset)
    };
    findings.extend(check_lengths(
        dataset.shape().steps,
        dataset.len(),
        &odd_lengths,
    ));
    for finding in &mut findings {
        finding.message = failure::with_cure(&finding.message, finding.remedy.as_ref());
        // `train` refuses axes in a suspicious order, so they are an error here.
        if finding.kind == FindingKind::AxisOrder && !arguments.axes_are_right {
            finding.severity = Severity::Error;
            finding
                .message
                .push_str("; if they are correct, add --axes-are-right");
        }
    }
    findings.sort_by_key(|finding| (finding.severity, finding.kind));
    let report = CheckReport::of(findings);
    if arguments.file.json {
        output::print_json(&report)?;
    } else {
        let materials = if labelled {
            output::counted(dataset.labels().len(), "material")
        } else {
            "materials not named".into()
        };
        output::print(format_args!(
            "{}: {} sweeps of {} at {} Hz, {materials}",
            arguments.file.data,
            dataset.len(),
            dataset.describe_shape(),
            dataset.sample_rate_hz(),
        ))?;
        print_report(arguments, &report)?;
    }
    let refused = report.errors > 0 || (arguments.strict && report.warnings > 0);
    Ok(ExitCode::from(if refused { failure::FAILED } else { 0 }))
}

fn print_report(arguments: &CheckArgs, report: &CheckReport) -> anyhow::Result<()> {
    let findings = &report.findings;
    let shown = if arguments.all { findings.len() } else { 3 };
    for group in group_findings(findings) {
        output::print(group_text(&group, shown))?;
    }
    output::print(format_args!(
        "{}: {}, {}",
        arguments.file.data,
        output::counted(report.errors, "error"),
        output::counted(report.warnings, "warning")
    ))
}

/// Returns a heading and the messages of the first `shown` findings, one a line.
fn group_text(group: &FindingGroup, shown: usize) -> String {
    let FindingGroup {
        severity,
        kind,
        findings,
    } = group;
    let mut text = format!("{severity}: {kind} ({})", findings.len());
    for finding in findings.iter().take(shown) {
        text.push_str("\n  ");
        text.push_str(&finding.message);
    }
    match findings.len().saturating_sub(shown) {
        0 => {}
        more => text.push_str(&format!("\n  and {more} more")),
    }
    text
}

fn convert(arguments: &ConvertArgs) -> anyhow::Result<ExitCode> {
    let format = Format::from_extension(&arguments.out)?;
    output::refuse_to_overwrite(&arguments.out, arguments.force)?;
    let dataset = source::load(&arguments.data)?;
    format.write(&arguments.out, &dataset)?;
    say!(
        "{}: {} sweeps ({})",
        arguments.out.display(),
        dataset.len(),
        dataset.shape()
    );
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use tactnet_data::Finding;

    use super::*;

    #[test]
    fn a_group_is_a_heading_and_a_limited_number_of_lines() {
        let of_sweep = |sweep| {
            let message = format!("`cork` sweep {sweep}");
            Finding::new(Severity::Error, FindingKind::NotFinite, message)
        };
        let findings: Vec<Finding> = (0..6).map(of_sweep).collect();
        let text = group_text(&group_findings(&findings)[0], 2);
        assert_eq!(
            text,
            "error: values that are not finite (6)\n  `cork` sweep 0\n  `cork` sweep 1\n  and 4 more"
        );
    }
}
