//! `tactnet data fetch`: downloads a published data set and verifies it.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tactnet_data::{Origin, Progress, PublicSet, SetProgress, Source, fetch};

use crate::output;

#[derive(Args)]
pub struct FetchArgs {
    /// Name of the data set
    #[arg(value_enum, required_unless_present = "list")]
    name: Option<Published>,
    /// Output file (.npz or .h5) [default: tactmat.h5, or public/NAME.npz]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Address of a mirror: of the file, or of the folder with all files; the content is verified in the same way
    #[arg(long, value_name = "URL")]
    url: Option<String>,
    /// List the public data sets besides TactMat: source, licence, citation, sensor, groups, caveats
    #[arg(long, conflicts_with_all = ["name", "out", "url"])]
    list: bool,
    /// Print the list as JSON
    #[arg(long, requires = "list")]
    json: bool,
}

/// Published data sets.
#[derive(Clone, Copy, ValueEnum)]
enum Published {
    /// TactMat: 36 materials, 100 sweeps each
    Tactmat,
    /// Accelerometer of a walking person: 4 kinds of ground
    WalkingTerrain,
    /// Event-based skin: 20 containers
    EventContainers,
    /// Fingertips of iCub: 9 objects
    IcubGrasps,
}

/// Downloads the data set, or lists all.
pub fn run(arguments: &FetchArgs) -> anyhow::Result<ExitCode> {
    let Some(name) = arguments.name else {
        return list(arguments.json);
    };
    match name {
        Published::Tactmat => fetch_tactmat(arguments)?,
        public => {
            let value = public.to_possible_value();
            let set = value.and_then(|value| PublicSet::named(value.get_name()));
            fetch_public(&set.context("the table lacks this data set")?, arguments)?;
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn list(json: bool) -> anyhow::Result<ExitCode> {
    let sets = PublicSet::all();
    if json {
        output::print_json(&sets)?;
        return Ok(ExitCode::SUCCESS);
    }
    for set in &sets {
        let groups = set.groups.as_deref().unwrap_or("none known");
        output::print(format_args!(
            "{}\n    {}\n    source    {}\n    licence   {}\n    cite      {}\n    sensor    {}\n    groups    {groups}\n    caveats   {}",
            set.name,
            set.title,
            set.page(),
            licence(set),
            set.citation,
            set.sensor,
            set.caveats
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Returns the licence, or the sentence about its absence.
fn licence(set: &PublicSet) -> &str {
    let none = "none stated by the owner: do not pass the files on, and ask before publishing them";
    set.licence.as_deref().unwrap_or(none)
}

/// Downloads the files of a public set and writes the data set that they hold.
fn fetch_public(set: &PublicSet, arguments: &FetchArgs) -> anyhow::Result<()> {
    let own = Path::new("public").join(format!("{}.npz", set.name));
    let out = arguments.out.as_ref().unwrap_or(&own);
    say!("licence: {}", licence(set));
    let bar = download_bar();
    let fetched = set.fetch(
        arguments.url.as_deref(),
        out,
        &mut |SetProgress {
                  file,
                  files,
                  of_file,
              }| {
            // Most sets are many small files.
            if files > 1 {
                bar.set_length(files as u64);
                bar.set_position(file as u64);
            } else {
                show(&bar, of_file);
            }
        },
    );
    bar.finish_and_clear();
    let dataset = fetched?;
    say!("cite: {}", set.citation);
    say!("note: {}", set.caveats);
    output::print(format_args!(
        "{}: {} sweeps of {} ({}), verified",
        out.display(),
        dataset.len(),
        output::counted(dataset.labels().len(), "material"),
        dataset.describe_shape()
    ))
}

fn fetch_tactmat(arguments: &FetchArgs) -> anyhow::Result<()> {
    let mut source = Source::tactmat();
    if let Some(url) = &arguments.url {
        source.url.clone_from(url);
    }
    let own = PathBuf::from("tactmat.h5");
    let out = arguments.out.as_ref().unwrap_or(&own);
    let bar = download_bar();
    let fetched = fetch(&source, out, &mut |progress| show(&bar, progress));
    bar.finish_and_clear();
    let fetched = fetched?;
    let how = match fetched.origin {
        Origin::AlreadyThere => "already present, verified".to_string(),
        Origin::Downloaded { resumed_from: 0 } => "downloaded and verified".to_string(),
        Origin::Downloaded { resumed_from } => {
            format!("downloaded (resumed at byte {resumed_from}) and verified")
        }
    };
    output::print(format_args!(
        "{}: {} bytes, {how}",
        fetched.path.display(),
        fetched.bytes
    ))
}

fn show(bar: &ProgressBar, progress: Progress) {
    if let Some(total) = progress.total_bytes {
        bar.set_length(total);
    }
    bar.set_position(progress.done_bytes);
}

fn download_bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    byte_bar(ProgressDrawTarget::stderr())
}

fn byte_bar(target: ProgressDrawTarget) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, target);
    // Up to 48 columns before the bar: `999.99 MiB/999.99 MiB, 999.99 MiB/s, 59m to go`.
    let template = "{bytes}/{total_bytes}, {bytes_per_sec}, {eta} to go {wide_bar}";
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::progress_line::Screen;

    #[test]
    fn the_line_of_a_download_fits_terminals_of_every_width() {
        let megabyte = 1 << 20;
        let shown = Screen::shows(byte_bar, |bar| {
            bar.set_length(1000 * megabyte);
            bar.set_position(999 * megabyte);
        });
        assert!(shown[0].starts_with("999.00 MiB/"), "{shown:?}");
    }

    #[test]
    fn every_public_set_has_a_name_on_the_command_line() {
        let names = Published::value_variants().iter().skip(1);
        let names: Vec<String> = names
            .filter_map(|of| Some(of.to_possible_value()?.get_name().into()))
            .collect();
        let sets: Vec<String> = PublicSet::all().into_iter().map(|set| set.name).collect();
        assert_eq!(names, sets);
    }
}
