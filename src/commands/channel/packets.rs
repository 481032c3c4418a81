//! `tactnet channel packets`: packet descriptions for other languages.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use serde::{Serialize, Serializer};
use tactnet_catching_packets::packets::DESCRIPTION as CATCHING;
use tactnet_channel::{Description, DescriptionError, Fields, Layout};
use tactnet_skin::packets::DESCRIPTION as TACTILE;

use crate::output;

#[derive(Args)]
#[command(after_help = "Examples:\n  \
    tactnet channel packets > packets.md                       offsets, types and meaning\n  \
    tactnet channel packets --of catching                      packets of the catching stack\n  \
    tactnet channel packets --language c > packets.h           structs for C and C++, with assertions\n  \
    tactnet channel packets --language python > packets.py     NumPy-based dataclasses; they need `pip install tactnet`\n  \
    tactnet channel packets --from arm.toml --language cpp > arm_packets.hpp   packets of your own, for `arm_packets.h`\n\n\
    docs/packets.md explains description files.")]
pub struct PacketsArgs {
    /// Group of packets
    #[arg(long, value_enum, default_value_t = Of::Tactile)]
    of: Of,
    /// Description file of your own packets, instead of a group
    #[arg(long, value_name = "FILE.toml", conflicts_with = "of")]
    from: Option<PathBuf>,
    /// Output language
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
    /// Page of tables
    Markdown,
    /// Header for C11 and C++
    C,
    /// Traits for C++ templates, in addition to the C header
    Cpp,
    /// Dataclasses based on NumPy
    Python,
    /// Protocol Buffers of recordings
    Proto,
    /// Module for the crates `tactnet-channel` and `bytemuck`
    Rust,
}

#[derive(Args)]
pub struct OwnPacketsArgs {
    /// Description file of your own packets; see `tactnet channel packets --from`
    #[arg(long, value_name = "FILE.toml")]
    packets: Option<PathBuf>,
}

impl OwnPacketsArgs {
    /// Returns the description.
    pub fn description(&self) -> Result<Option<Description>, DescriptionError> {
        self.packets.as_deref().map(Description::read).transpose()
    }
}

/// Prints the packets.
pub fn packets(arguments: &PacketsArgs) -> anyhow::Result<ExitCode> {
    let description = match (&arguments.from, arguments.of) {
        (Some(file), _) => Description::read(file)?,
        (None, Of::Tactile) => TACTILE,
        (None, Of::Catching) => CATCHING,
    };
    let text = match arguments.language {
        Language::Markdown => description.markdown(),
        Language::C => description.c_header(),
        Language::Cpp => description.cpp_traits(),
        Language::Python => description.python("tactnet._packet"),
        Language::Proto => description.proto(),
        Language::Rust => description.rust(),
    };
    output::print(format_args!("{}", text.trim_end()))?;
    Ok(ExitCode::SUCCESS)
}

/// A packet of a type that is known only at run time.
pub struct DescribedPacket {
    layout: &'static Layout,
    bytes: Box<[u8]>,
}

impl DescribedPacket {
    /// Returns the first item of a packet's bytes; `None` for packets without a description and for too few bytes.
    ///
    /// - `own`: description of the user's packets
    /// - `name`, `version`: type of the channel's packets
    pub fn new(own: Option<&Description>, name: &str, version: u32, bytes: &[u8]) -> Option<Self> {
        let known = [TACTILE, CATCHING];
        let known = known.iter().chain(own);
        let mut layouts = known.flat_map(|description| description.packets);
        let layout = layouts.find(|layout| {
            layout.is_packet() && layout.name == name && layout.version == version
        })?;
        let bytes = bytes.get(..layout.bytes)?.into();
        Some(Self { layout, bytes })
    }

    /// Returns the fields of the packet.
    pub fn fields(&self) -> Fields<'_> {
        Fields::of(self.layout, &self.bytes).expect("as many bytes as the layout has")
    }
}

/// An object of the packet's fields, with the packet's name as `type`.
impl Serialize for DescribedPacket {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Typed<'a> {
            r#type: &'static str,
            #[serde(flatten)]
            fields: Fields<'a>,
        }
        let typed = Typed {
            r#type: self.layout.name,
            fields: self.fields(),
        };
        typed.serialize(serializer)
    }
}
