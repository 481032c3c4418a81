//! `tactnet channel packets`: packets for other languages.

use std::process::ExitCode;

use clap::{Args, ValueEnum};
use tactnet_skin::packets::DESCRIPTION;

use crate::output;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet channel packets > packets.md                       offsets, types and what they mean\n  \
    tactnet channel packets --language c > packets.h           structs for C and C++, with assertions\n  \
    tactnet channel packets --language python > packets.py     dataclasses over NumPy; they need `pip install tactnet`")]
pub struct PacketsArgs {
    /// What to print them in
    #[arg(long, value_enum, default_value_t = Language::Markdown)]
    language: Language,
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
    let text = match arguments.language {
        Language::Markdown => DESCRIPTION.markdown(),
        Language::C => DESCRIPTION.c_header(),
        Language::Cpp => DESCRIPTION.cpp_traits(),
        Language::Python => DESCRIPTION.python("tactnet._packet"),
        Language::Proto => DESCRIPTION.proto(),
    };
    output::print(format_args!("{}", text.trim_end()))?;
    Ok(ExitCode::SUCCESS)
}
