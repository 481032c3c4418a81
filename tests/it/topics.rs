//! `tactnet data import --topic` on recordings that mcap, mcap-protobuf-support and rosbags wrote, see
//! tests/fixtures/topics/make.py.

use std::path::{Path, PathBuf};

use tactnet_data::format;
use tempfile::TempDir;

use crate::command::{expect, refusal, stderr, stdout, tactnet};

/// Frames of a window of the tests.
const STEPS: usize = 20;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/fixtures/topics")
        .join(name)
}

/// Returns the frames of the fixtures: `[frames][6]`.
fn values() -> Vec<f32> {
    let text = std::fs::read_to_string(fixture("values.csv")).unwrap();
    let numbers = text.split(['\n', ',']).filter(|cell| !cell.is_empty());
    numbers.map(|cell| cell.parse().unwrap()).collect()
}

/// Imports windows of a topic and returns their values in the order of time, with their materials.
fn imported(file: &str, options: &[&str]) -> (Vec<f32>, Vec<String>) {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("sweeps.npz");
    let mut import = tactnet(["data", "import"]);
    import.arg(fixture(file)).arg("--out").arg(&out);
    import.args(["--window", &STEPS.to_string()]).args(options);
    expect(0, import);
    let dataset = format::read(&out).unwrap();
    assert_eq!(dataset.sample_rate_hz(), 100.0, "{file}");
    let materials = dataset.records().iter();
    let materials = materials.map(|record| dataset.labels().name(record.label).to_owned());
    let values = (0..dataset.len()).flat_map(|index| dataset.sweep(index));
    (values.collect(), materials.collect())
}

fn expected_materials() -> Vec<String> {
    let of_window = |window: usize| if window < 3 { "cork" } else { "felt" };
    (0..6).map(|window| of_window(window).to_owned()).collect()
}

#[test]
fn json_fields_are_taxels_and_a_text_names_the_material() {
    let fields = [
        ["--topic", "/tip"],
        ["--field", "parts.v"],
        ["--label-field", "surface"],
    ];
    assert_eq!(
        imported("json.mcap", fields.as_flattened()),
        (values(), expected_materials())
    );
    // Other order, single entries.
    let fields = [
        ["--topic", "/tip"],
        ["--field", "parts[1].v"],
        ["--field", "parts[0].v[2]"],
        ["--label-field", "surface"],
    ];
    let (found, _) = imported("json.mcap", fields.as_flattened());
    let of_frame = |frame: &[f32]| [frame[4], frame[5], frame[2]];
    let expected: Vec<f32> = values().chunks(6).flat_map(of_frame).collect();
    assert_eq!(found, expected);
}

#[test]
fn protobuf_messages_are_decoded_by_their_description() {
    let fields = [
        ["--topic", "/tip"],
        ["--field", "force"],
        ["--field", "rest"],
        ["--label-field", "surface"],
    ];
    let (found, materials) = imported("protobuf.mcap", fields.as_flattened());
    let mut expected = values();
    // Zeros, which Protocol Buffers does not transmit.
    expected[5 * 6..5 * 6 + 3].fill(0.0);
    assert_eq!((found, materials), (expected, expected_materials()));
}

#[test]
fn ros_2_messages_are_decoded_by_their_definition_and_intervals_name_the_materials() {
    let labels = fixture("labels.csv").display().to_string();
    let wrench = [
        "--topic",
        "/wrench",
        "--field",
        "wrench",
        "--intervals",
        &labels,
    ];
    assert_eq!(
        imported("ros2.mcap", &wrench),
        (values(), expected_materials())
    );
    // Its only array of numbers; the times are those of the recorder, which writes in bursts.
    let array = ["--topic", "/array", "--material", "cork", "--rate", "100"];
    assert_eq!(imported("ros2.mcap", &array).0, values());
}

#[test]
fn topics_are_listed_and_wrong_names_say_what_there_is() {
    let folder = TempDir::new().unwrap();
    let out = folder.path().join("sweeps.npz");
    let refused = |file: &str, options: &[&str]| {
        let mut import = tactnet(["data", "import"]);
        import
            .arg(fixture(file))
            .arg("--out")
            .arg(&out)
            .args(options);
        let message = refusal(import);
        assert!(!out.exists());
        message
    };
    let listed = refused("ros2.mcap", &[]);
    for part in [
        "`/wrench` (geometry_msgs/msg/WrenchStamped, cdr, 120 messages): ",
        "wrench.force.x",
        "`/array` (std_msgs/msg/Float32MultiArray, cdr, 120 messages): data [6]",
        "`/words` (std_msgs/msg/String, cdr, 120 messages): no numbers",
        "--topic NAME --field PATH",
    ] {
        assert!(listed.contains(part), "{part}: {listed}");
    }
    let wrong = refused("ros2.mcap", &["--topic", "/wrenches"]);
    assert!(wrong.contains("`/wrench`"), "{wrong}");
    let wrong = refused(
        "ros2.mcap",
        &["--topic", "/wrench", "--field", "wrench.forces"],
    );
    assert!(wrong.contains("wrench.force.x"), "{wrong}");
    let wrong = refused("json.mcap", &["--topic", "/tip", "--field", "parts.v"]);
    assert!(wrong.contains("--material NAME"), "{wrong}");
    let wrong = refused("json.mcap", &["--topic", "/tip"]);
    assert!(wrong.contains("parts[0].v [4], parts[1].v [2]"), "{wrong}");
}

#[test]
fn a_cut_recording_is_read_up_to_the_cut_and_says_how_much_is_lost() {
    let folder = TempDir::new().unwrap();
    let whole = std::fs::read(fixture("long.mcap")).unwrap();
    let cut = folder.path().join("cut.mcap");
    std::fs::write(&cut, &whole[..whole.len() * 2 / 3]).unwrap();
    let out = folder.path().join("sweeps.npz");
    let mut import = tactnet(["data", "import"]);
    import.arg(&cut).arg("--out").arg(&out);
    import.args("--topic /tip --field parts.v --window 10 --label-field surface".split(' '));
    let output = expect(0, import);
    let message = stderr(&output);
    assert!(message.contains("bytes are lost"), "{message}");
    assert!(message.contains("frames of 6 numbers"), "{message}");
    let dataset = format::read(&out).unwrap();
    assert!((4..12).contains(&dataset.len()), "{}", stdout(&output));
}
