//! `tactnet channel packets`: packets for other languages.

use std::process::ExitCode;

use clap::{Args, ValueEnum};
use tactnet_catching_packets::packets::DESCRIPTION as CATCHING;
use tactnet_skin::packets::DESCRIPTION as TACTILE;

use crate::output;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet channel packets > packets.md                       offsets, types and what they mean\n  \
    tactnet channel packets --of catching                      those of the catching stack
  \
    tactnet channel packets --language c > packets.h           structs for C and C++, with assertions\n  \
    tactnet channel packets --language python > packets.py     dataclasses over NumPy; they need `pip install tactnet`")]
pub struct PacketsArgs {
    /// Which ones
    #[arg(long, value_enum, default_value_t = Of::Tactile)]
    of: Of,
    /// What to print them in
    #[arg(long, value_enum, default_value_t = Language::Markdown)]
    language: Language,
}

#[derive(Clone, Copy, ValueEnum)]
enum Of {
    /// Skin, commands, beliefs
    Tactile,
    /// Joints, circles, balls, plans, paths
    Catching,
}

#[derive(Clone, Copy, ValueEnum)]
enum Language {
    /// A page of tables
    Markdown,
    /// A header for C11 and C++
    C,
    /// What C++ templates need beside the header of C
    Cpp,
    /// Dataclasses over NumPy
    Python,
    /// The Protocol Buffers of recordings
    Proto,
}

/// Prints the packets.
pub fn packets(arguments: &PacketsArgs) -> anyhow::Result<ExitCode> {
    let description = match arguments.of {
        Of::Tactile => &TACTILE,
        Of::Catching => &CATCHING,
    };
    let text = match arguments.language {
        Language::Markdown => description.markdown(),
        Language::C => description.c_header(),
        Language::Cpp => description.cpp_traits(),
        Language::Python => description.python("tactnet._packet"),
        Language::Proto => description.proto(),
    };
    output::print(format_args!("{}", text.trim_end()))?;
    Ok(ExitCode::SUCCESS)
}
