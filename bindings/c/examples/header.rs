//! Prints `include/tactnet/channel.h`.

fn main() {
    let crate_folder = env!("CARGO_MANIFEST_DIR");
    cbindgen::generate(crate_folder)
        .expect("the sources can be read")
        .write(std::io::stdout());
}
