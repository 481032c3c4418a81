//! Packets that are described in a file, without Rust.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use tactnet_packet::{Described, Description, FieldType, Fields, Layout, Packet};

// The generated file names the crate of the channels, which has the same items.
extern crate tactnet_packet as tactnet_channel;

#[rustfmt::skip]
#[allow(dead_code, missing_docs, reason = "generated")]
mod arm_packets;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/own_packets");

fn arm() -> Description {
    Description::read(&Path::new(FOLDER).join("arm.toml")).unwrap()
}

#[test]
fn the_generated_rust_file_is_the_committed_one() {
    let committed = std::fs::read_to_string(format!("{FOLDER}/arm_packets.rs")).unwrap();
    assert!(committed == arm().rust(), "run tests/generated_packets.sh");
}

/// Asserts that two layouts are the same, up to the spaces in their documentation.
fn assert_same(ours: &Layout, theirs: &Layout) {
    let docs = |docs: &[&str]| docs.join(" ").trim().to_owned();
    assert_eq!(
        (ours.name, ours.version, ours.bytes),
        (theirs.name, theirs.version, theirs.bytes)
    );
    assert_eq!(docs(ours.docs), docs(theirs.docs));
    assert_eq!(ours.fields.len(), theirs.fields.len());
    for (our, their) in ours.fields.iter().zip(theirs.fields) {
        assert_eq!(docs(our.docs), docs(their.docs));
        assert_eq!(
            (our.name, our.offset, our.number, our.counted_by),
            (their.name, their.offset, their.number, their.counted_by)
        );
        assert_eq!(
            (our.kind.size(), our.kind.align()),
            (their.kind.size(), their.kind.align())
        );
        let names = [our, their].map(|field| field.kind.part().map(|part| part.name));
        assert_eq!(names[0], names[1], "{}", our.name);
    }
}

/// Offsets, sizes and alignments of the description are those of the Rust compiler.
#[test]
fn layouts_of_the_file_are_those_of_the_compiler() {
    let (ours, theirs) = (arm(), arm_packets::DESCRIPTION);
    assert_eq!((ours.project, ours.source), (theirs.project, theirs.source));
    assert_eq!(ours.constants, theirs.constants);
    assert_eq!(ours.packets.len(), 4);
    for (our, their) in ours.packets.iter().zip(theirs.packets) {
        assert_same(our, their);
    }
    assert_eq!(
        arm_packets::ArmState::LAYOUT.fields[6].kind,
        ours.packets[3].fields[6].kind
    );
    assert_eq!(<arm_packets::ArmState as Packet>::VERSION, 2);
    assert_eq!(arm_packets::Mode::of(2), Some(arm_packets::Mode::Moving));
    assert_eq!(
        ours.choices[0].values[0].2,
        arm_packets::Mode::Braked as u32
    );
    // Parts come before the packets that contain them, and a file of parts is not a packet.
    let names: Vec<_> = ours.packets.iter().map(|layout| layout.name).collect();
    assert_eq!(names, ["Vector", "Frame", "Joint", "ArmState"]);
    assert!(ours.packets[3].is_packet() && !ours.packets[2].is_packet());
}

#[test]
fn numbers_in_recordings_are_positions_unless_they_are_given() {
    let arm = arm();
    let numbers: Vec<_> = arm.packets[3]
        .fields
        .iter()
        .map(|field| field.number)
        .collect();
    let expected = [1, 2, 0, 4, 5, 6, 7, 8, 20, 0].map(|number| (number > 0).then_some(number));
    assert_eq!(numbers, expected);
    let proto = arm.proto();
    assert!(
        proto.contains("message Vector {\n  double x = 1;"),
        "{proto}"
    );
    assert!(proto.contains("  repeated int32 grid = 7;"), "{proto}");
    assert!(proto.contains("  repeated Joint joints = 4;"), "{proto}");
    assert!(proto.contains("  // Position, in m.\n"), "{proto}");
}

#[test]
fn fields_of_such_a_packet_are_read_by_name() {
    let arm = arm();
    let layout: &'static Layout = Box::leak(Box::new(arm.packets[3]));
    let mut state: arm_packets::ArmState = bytemuck::Zeroable::zeroed();
    state.contacts = 1;
    state.joints[2].position = 0.5;
    state.contact_points[0][1].z = 0.25;
    state.grid[1][2][3] = -7;
    let fields = Fields::of(layout, bytemuck::bytes_of(&state)).unwrap();
    let value = serde_json::to_value(fields).unwrap();
    assert_eq!(value["joints"][2]["position"], 0.5);
    assert_eq!(value["contact_points"].as_array().unwrap().len(), 1);
    assert_eq!(value["contact_points"][0][1]["z"], 0.25);
    assert_eq!(value["grid"][1][2][3], -7);
}

/// Reads a description of this text, and returns its error without the folder.
fn error_of(text: &str) -> String {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.toml");
    std::fs::write(&path, text).unwrap();
    std::fs::write(folder.path().join("bad.toml"), "\n\nnothing = 1\n").unwrap();
    std::fs::write(
        folder.path().join("part.toml"),
        "include = [\"own.toml\"]\n[[struct]]\nname = \"Part\"\nfields = []\n",
    )
    .unwrap();
    let error = Description::read(&path).unwrap_err().to_string();
    let begin = format!("{}/", folder.path().display());
    error.replace(&begin, "")
}

#[test]
fn errors_name_file_and_line() {
    let fields = |fields: &str| {
        format!(
            "project = \"own\"\n\n[[struct]]\nname = \"State\"\nversion = 1\nfields = [\n{fields}\n]\n"
        )
    };
    let field = |rest: &str| fields(&format!("  {{ name = \"a\", {rest} }},"));
    for (text, line, words) in [
        (String::new(), "own.toml:1: ", "expected the key `project`"),
        ("project = \"Own\"".into(), "own.toml:1: ", "found `Own`"),
        (
            "project = \"tactnet\"".into(),
            "own.toml:1: ",
            "tactnet's own packets",
        ),
        (
            "project = \"own\"\nfoo = 1".into(),
            "own.toml:2: ",
            "unknown field `foo`",
        ),
        (
            "project = \"own\"\n[[struct]".into(),
            "own.toml:2: ",
            "expected",
        ),
        (
            "project = \"own\"\ninclude = [\n\"none.toml\"]".into(),
            "own.toml:3: ",
            "include: none.toml: No such file",
        ),
        (
            "project = \"own\"\ninclude = [\"bad.toml\"]".into(),
            "bad.toml:3: ",
            "unknown field `nothing`",
        ),
        (
            "project = \"own\"\ninclude = [\"part.toml\"]".into(),
            "part.toml:3: ",
            "at least one field",
        ),
        (
            field("type = \"f65\""),
            "own.toml:7: ",
            "unknown type `f65`",
        ),
        (
            field("type = \"State\""),
            "own.toml:7: ",
            "`State` contains itself",
        ),
        (
            field("type = \"text\""),
            "own.toml:7: ",
            "expected its length as `bytes`",
        ),
        (
            field("type = \"u8\", bytes = 3"),
            "own.toml:7: ",
            "only for a text",
        ),
        (
            field("type = \"u8\", shape = [2, \"N\"]"),
            "own.toml:7: ",
            "the name of a constant, found \"N\"",
        ),
        (
            field("type = \"u8\", shape = [0]"),
            "own.toml:7: ",
            "a length of at least 1",
        ),
        (
            field("type = \"u8\", shape = [70000, 70000]"),
            "own.toml:7: ",
            "at most 1073741824 bytes",
        ),
        (
            field("type = \"u8\", number = 19000"),
            "own.toml:7: ",
            "number 19000 is not allowed",
        ),
        (
            field("type = \"u8\", counted_by = \"n\", shape = [2]"),
            "own.toml:7: ",
            "counted_by: expected an array",
        ),
        (
            fields("  { name = \"n\", type = \"u32\" },\n  { name = \"n\", type = \"u32\" },"),
            "own.toml:8: ",
            "`n` is there twice",
        ),
        (
            fields("  { name = \"class\", type = \"u32\" },"),
            "own.toml:7: ",
            "`class` is a reserved word",
        ),
        (
            fields("  { name = \"n\", type = \"u32\" },\n  { name = \"x\", type = \"f64\" },"),
            "own.toml:8: ",
            "`x` would begin at byte 4, which is no multiple of 8; insert { name = \"reserved\", type = \"u8\", shape = [4] }",
        ),
        (
            fields("  { name = \"x\", type = \"f64\" },\n  { name = \"n\", type = \"u8\" },"),
            "own.toml:4: ",
            "9 bytes are no multiple of 8; at the end insert",
        ),
        (
            fields(
                "  { name = \"x\", type = \"u8\", number = 2 },\n  { name = \"n\", type = \"u8\" },",
            ),
            "own.toml:8: ",
            "number 2 is taken by `x`",
        ),
        (
            fields("") + "[[enum]]\nname = \"State\"\nvalues = []",
            "own.toml:10: ",
            "expected at least one value",
        ),
        (
            fields("  { name = \"x\", type = \"u8\" },")
                + "[[struct]]\nname = \"State\"\nfields = []",
            "own.toml:10: ",
            "already defined in own.toml:4",
        ),
    ] {
        let error = error_of(&text);
        assert!(
            error.starts_with(line) && error.contains(words),
            "{text}\n{error}"
        );
    }
    let missing = Description::read(Path::new("/nowhere/own.toml")).unwrap_err();
    assert!(
        missing
            .to_string()
            .starts_with("/nowhere/own.toml: No such file"),
        "{missing}"
    );
}

#[test]
fn a_part_may_be_defined_after_its_use_and_a_type_fits_a_text() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("own.toml");
    let text = "project = \"own\"\n[[struct]]\nname = \"A\"\nversion = 1\nfields = [{ name = \"b\", type = \"B\", shape = [2] }]\n\
        [[struct]]\nname = \"B\"\nfields = [{ name = \"t\", type = \"text\", bytes = 3 }]\n";
    std::fs::write(&path, text).unwrap();
    let own = Description::read(&path).unwrap();
    let [b, a] = own.packets else {
        panic!("{own:?}");
    };
    assert_eq!((b.name, a.name, a.bytes), ("B", "A", 6));
    assert_eq!(b.fields[0].kind, FieldType::Text(3));
}
