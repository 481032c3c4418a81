//! Compiles the messages without protoc, and keeps their description for MCAP files.

use std::path::PathBuf;

use prost_build::Config;
use protox::prost::Message;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed=proto/tactnet.proto");
    let description = protox::compile(["tactnet.proto"], ["proto"])?;
    let out = PathBuf::from(std::env::var("OUT_DIR")?);
    std::fs::write(out.join("tactnet.description"), description.encode_to_vec())?;
    Config::new().compile_fds(description)?;
    Ok(())
}
