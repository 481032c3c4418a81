//! Compiles the messages without protoc, and keeps their description for MCAP files.

use prost_build::Config;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=proto/tactnet.proto");
    let description = protox::compile(["tactnet.proto"], ["proto"])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(
        out.join("tactnet.description"),
        prost_build_bytes(&description),
    )?;
    Config::new().compile_fds(description)?;
    Ok(())
}

fn prost_build_bytes(description: &impl protox::prost::Message) -> Vec<u8> {
    description.encode_to_vec()
}
