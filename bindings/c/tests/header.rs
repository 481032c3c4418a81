//! The committed header equals the generated one.

#[test]
fn the_header_is_that_of_the_sources() {
    let folder = env!("CARGO_MANIFEST_DIR");
    let mut generated = Vec::new();
    cbindgen::generate(folder)
        .expect("the sources can be read")
        .write(&mut generated);
    let committed = std::fs::read_to_string(format!("{folder}/include/tactnet/channel.h"))
        .expect("a committed header");
    assert!(
        String::from_utf8_lossy(&generated) == committed,
        "run `cargo run -p tactnet-c --example header > bindings/c/include/tactnet/channel.h`"
    );
}
