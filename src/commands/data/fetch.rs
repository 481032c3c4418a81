//! `tactnet data fetch`: downloads a published data set and verifies it.

use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tactnet_data::{Origin, Progress, Source, fetch};

use crate::output;

#[derive(Args)]
pub struct FetchArgs {
    /// Name of the data set
    #[arg(value_enum)]
    name: Published,
    /// Output file
    #[arg(long, value_name = "FILE", default_value = "tactmat.h5")]
    out: PathBuf,
    /// Address of a mirror; the content is verified in the same way
    #[arg(long, value_name = "URL")]
    url: Option<String>,
}

/// Published data sets.
#[derive(Clone, Copy, ValueEnum)]
enum Published {
    /// TactMat: 36 materials, 100 sweeps each
    Tactmat,
}

/// Downloads the data set.
pub fn run(arguments: &FetchArgs) -> anyhow::Result<ExitCode> {
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
    ))?;
    Ok(ExitCode::SUCCESS)
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
}
