//! `tactnet data`: look at, check, make, convert and fetch data sets.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::bail;
use clap::{Args, Subcommand, ValueEnum};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tactnet_data::format::{self, Format};
use tactnet_data::twin::{self, TwinConfig, statistics};
use tactnet_data::{
    Dataset, Finding, Origin, Progress, Severity, Source, check, fetch, group_findings, info,
};

use tactnet_recording::{Recording, SweepSettings, sweeps};

use crate::{failure, output, source, view};

#[derive(Subcommand)]
pub enum DataCommand {
    /// Show what a data set holds
    #[command(
        after_help = "Examples:\n  tactnet data info sweeps.h5\n  tactnet data info twin --json"
    )]
    Info(FileArgs),
    /// Show sweeps in the Rerun viewer
    View(view::SweepsArgs),
    /// Look for what would spoil training; exit code 1 if there are errors
    #[command(
        after_help = "Examples:\n  tactnet data check sweeps.h5\n  tactnet data check sweeps.npz --json"
    )]
    Check(CheckArgs),
    /// Make the synthetic TactMat twin
    #[command(after_help = "Examples:\n  tactnet data twin --out twin.h5\n  \
        tactnet data twin --materials 6 --sweeps 20 --out small.h5\n  \
        tactnet data twin --stats                compare its signal with the real one")]
    Twin(TwinArgs),
    /// Convert a recording into an HDF5 data set
    #[command(
        after_help = "Examples:\n  tactnet data import sweeps.npz --out sweeps.h5\n  \
        tactnet data import today.mcap --out today.h5                     sweeps labelled by their start commands\n  \
        tactnet data import felt.mcap --out felt.h5 --material felt       all of one material\n\n\
        Where a recording has not equally many sweeps of every material, write .npz."
    )]
    Import(ImportArgs),
    /// Convert a data set for other programs: .npz (numpy), .ts (aeon), .h5
    #[command(
        after_help = "Examples:\n  tactnet data export sweeps.h5 --out sweeps.ts\n  \
        tactnet data export twin --out twin.npz"
    )]
    Export(ConvertArgs),
    /// Download a published data set and verify it
    #[command(
        after_help = "Example:\n  tactnet data fetch tactmat --out tactmat.h5\n\n\
        A broken download is resumed by the same command."
    )]
    Fetch(FetchArgs),
}

#[derive(Args)]
pub struct FileArgs {
    /// A data set (.h5, .npz), or `twin`
    #[arg(value_name = "FILE|twin")]
    data: String,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
pub struct CheckArgs {
    #[command(flatten)]
    file: FileArgs,
    /// List every finding, not only the first of each kind
    #[arg(long)]
    all: bool,
}

#[derive(Args)]
pub struct TwinArgs {
    /// Where to write it (.h5 or .npz)
    #[arg(long, value_name = "FILE", required_unless_present = "stats")]
    out: Option<PathBuf>,
    /// Materials, 1 to 36
    #[arg(long, value_name = "N")]
    materials: Option<usize>,
    /// Sweeps of each material
    #[arg(long, value_name = "N")]
    sweeps: Option<usize>,
    /// Time steps of a sweep, at 750 Hz
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Another twin of the same materials
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// How close the materials are
    #[arg(long, value_name = "X")]
    difficulty: Option<f64>,
    /// Print its signal statistics beside those of the real signal
    #[arg(long)]
    stats: bool,
    /// Overwrite the file
    #[arg(long)]
    force: bool,
}

#[derive(Args)]
pub struct ConvertArgs {
    /// What to read (.h5, .npz), or `twin`
    #[arg(value_name = "FILE|twin")]
    data: String,
    /// What to write; the extension decides the format
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Overwrite the file
    #[arg(long)]
    force: bool,
}

#[derive(Args)]
pub struct ImportArgs {
    #[command(flatten)]
    convert: ConvertArgs,
    /// Of a recording: what was swept over, where start commands do not name it
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// Of a recording: frames of a sweep [default: those of the recorded classifier, or 1000]
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Of a recording: frames a second [default: the recorded classifier's, or by the frames' own clock]
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Of a recording: rows and columns of taxels [default: the recorded classifier's, or a square]
    #[arg(long, value_name = "RxC", value_parser = shape)]
    shape: Option<(usize, usize)>,
}

#[derive(Args)]
pub struct FetchArgs {
    /// Which data set
    #[arg(value_enum)]
    name: Published,
    /// Where to put it
    #[arg(long, value_name = "FILE", default_value = "tactmat.h5")]
    out: PathBuf,
    /// Fetch from another address, a mirror; the content is verified all the same
    #[arg(long, value_name = "URL")]
    url: Option<String>,
}

/// Published data sets.
#[derive(Clone, Copy, ValueEnum)]
enum Published {
    /// TactMat: 36 materials, 100 sweeps each
    Tactmat,
}

/// Runs the command.
pub fn run(command: DataCommand) -> anyhow::Result<ExitCode> {
    match command {
        DataCommand::Info(arguments) => show_info(&arguments),
        DataCommand::View(arguments) => view::run_sweeps(&arguments),
        DataCommand::Check(arguments) => run_check(&arguments),
        DataCommand::Twin(arguments) => make_twin(&arguments),
        DataCommand::Import(arguments) => {
            let out = &arguments.convert.out;
            let is_recording = arguments.is_recording();
            let format = Format::from_extension(out)?;
            if format != Format::TactMat && !(is_recording && format == Format::Npz) {
                bail!(
                    "{}: `import` writes .h5 (of recordings also .npz); for other formats use `tactnet data export`",
                    out.display()
                );
            }
            import(&arguments)
        }
        DataCommand::Export(arguments) => convert(&arguments),
        DataCommand::Fetch(arguments) => run_fetch(&arguments),
    }
}

/// Reads a data set even if some of its values are no numbers.
fn load_with_gaps(data: &str) -> anyhow::Result<Dataset> {
    if data == source::TWIN || !Path::new(data).exists() {
        return Ok(source::load(data)?);
    }
    Ok(format::read_with_gaps(Path::new(data))?)
}

fn show_info(arguments: &FileArgs) -> anyhow::Result<ExitCode> {
    let info = info(&load_with_gaps(&arguments.data)?);
    if arguments.json {
        output::print_json(&info)?;
    } else {
        output::print(info)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn run_check(arguments: &CheckArgs) -> anyhow::Result<ExitCode> {
    let findings = check(&load_with_gaps(&arguments.file.data)?);
    let errors = count(&findings, Severity::Error);
    if arguments.file.json {
        output::print_json(&findings)?;
    } else {
        let shown = if arguments.all { findings.len() } else { 3 };
        for group in group_findings(&findings) {
            output::print(format_args!("{group:.shown$}"))?;
        }
        let warnings = count(&findings, Severity::Warning);
        output::print(format_args!(
            "{}: {errors} errors, {warnings} warnings",
            arguments.file.data
        ))?;
    }
    Ok(ExitCode::from(if errors > 0 { failure::FAILED } else { 0 }))
}

fn count(findings: &[Finding], severity: Severity) -> usize {
    findings
        .iter()
        .filter(|finding| finding.severity == severity)
        .count()
}

fn make_twin(arguments: &TwinArgs) -> anyhow::Result<ExitCode> {
    let default = TwinConfig::default();
    let config = TwinConfig {
        materials: arguments.materials.unwrap_or(default.materials),
        sweeps: arguments.sweeps.unwrap_or(default.sweeps),
        steps: arguments.steps.unwrap_or(default.steps),
        seed: arguments.seed.unwrap_or(default.seed),
        difficulty: arguments.difficulty.unwrap_or(default.difficulty),
    };
    if let Some(out) = &arguments.out {
        refuse_to_overwrite(out, arguments.force)?;
    }
    let twin = twin::generate(&config)?;
    if arguments.stats {
        let measured = statistics::measure(&twin);
        output::print(statistics::Comparison {
            name: "twin",
            measured: &measured,
        })?;
    }
    if let Some(out) = &arguments.out {
        Format::from_extension(out)?.write(out, &twin)?;
        eprintln!(
            "{}: {} synthetic sweeps ({})",
            out.display(),
            twin.len(),
            twin.shape()
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// `4x4`
fn shape(text: &str) -> Result<(usize, usize), String> {
    let parsed = text
        .split_once('x')
        .and_then(|(rows, cols)| Some((rows.parse().ok()?, cols.parse().ok()?)));
    parsed.ok_or_else(|| format!("expected rows and columns like 4x4, found `{text}`"))
}

impl ImportArgs {
    fn is_recording(&self) -> bool {
        Path::new(&self.convert.data)
            .extension()
            .is_some_and(|extension| extension == "mcap")
    }
}

/// A recording of the channels, or another program's data set.
fn import(arguments: &ImportArgs) -> anyhow::Result<ExitCode> {
    let convert_arguments = &arguments.convert;
    let path = Path::new(&convert_arguments.data);
    if !arguments.is_recording() {
        let of_a_recording = [
            arguments.material.is_some(),
            arguments.steps.is_some(),
            arguments.rate.is_some(),
            arguments.shape.is_some(),
        ];
        if of_a_recording.contains(&true) {
            bail!("--material, --steps, --rate, --shape: only for recordings (.mcap)");
        }
        return convert(convert_arguments);
    }
    let out = &convert_arguments.out;
    let format = Format::from_extension(out)?;
    refuse_to_overwrite(out, convert_arguments.force)?;
    let recording = Recording::read(path)?;
    if let Some(cut) = &recording.cut {
        eprintln!("{}: the end is missing ({cut})", path.display());
    }
    if recording.foreign > 0 {
        eprintln!(
            "left out: {} messages that are none of ours",
            recording.foreign
        );
    }
    let settings = SweepSettings {
        steps: arguments.steps,
        rate_hz: arguments.rate,
        rows_cols: arguments.shape,
    };
    let found = sweeps(path, &recording, arguments.material.as_deref(), settings)?;
    for reason in &found.rejected {
        eprintln!("left out: {reason}");
    }
    if found.unlabelled > 0 {
        eprintln!(
            "left out: {} sweeps of which nobody said what was swept over (`--material` names it)",
            found.unlabelled
        );
    }
    let counts = found.dataset.sweeps_per_label();
    if format == Format::TactMat && counts.iter().any(|count| *count != counts[0]) {
        bail!(
            "{}: an .h5 data set has equally many sweeps of every material, this recording has {} to {}; .npz holds any number",
            out.display(),
            counts.iter().min().unwrap_or(&0),
            counts.iter().max().unwrap_or(&0)
        );
    }
    format.write(out, &found.dataset)?;
    eprintln!(
        "{}: {} sweeps of {} materials ({})",
        out.display(),
        found.dataset.len(),
        found.dataset.labels().len(),
        found.dataset.shape()
    );
    Ok(ExitCode::SUCCESS)
}

fn convert(arguments: &ConvertArgs) -> anyhow::Result<ExitCode> {
    let format = Format::from_extension(&arguments.out)?;
    refuse_to_overwrite(&arguments.out, arguments.force)?;
    let dataset = source::load(&arguments.data)?;
    format.write(&arguments.out, &dataset)?;
    eprintln!(
        "{}: {} sweeps ({})",
        arguments.out.display(),
        dataset.len(),
        dataset.shape()
    );
    Ok(ExitCode::SUCCESS)
}

fn refuse_to_overwrite(out: &Path, force: bool) -> anyhow::Result<()> {
    if out.exists() && !force {
        bail!(
            "{}: exists already; overwrite it with `--force`",
            out.display()
        );
    }
    Ok(())
}

fn run_fetch(arguments: &FetchArgs) -> anyhow::Result<ExitCode> {
    let mut source = match arguments.name {
        Published::Tactmat => Source::tactmat(),
    };
    if let Some(url) = &arguments.url {
        source.url.clone_from(url);
    }
    let bar = download_bar();
    let fetched = fetch(
        &source,
        &arguments.out,
        &mut |Progress {
                  done_bytes,
                  total_bytes,
                  ..
              }| {
            if let Some(total) = total_bytes {
                bar.set_length(total);
            }
            bar.set_position(done_bytes);
        },
    );
    bar.finish_and_clear();
    let fetched = fetched?;
    let how = match fetched.origin {
        Origin::AlreadyThere => "there already, verified".to_string(),
        Origin::Downloaded { resumed_from: 0 } => "downloaded and verified".to_string(),
        Origin::Downloaded { resumed_from } => {
            format!("downloaded (resumed at byte {resumed_from}) and verified")
        }
    };
    output::print(format_args!(
        "{}: {} bytes, {how}",
        fetched.path.display(),
        fetched.bytes
    ))?;
    Ok(ExitCode::SUCCESS)
}

fn download_bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    let template = "[{bar:30}] {bytes}/{total_bytes}, {bytes_per_sec}, {eta} to go";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}
