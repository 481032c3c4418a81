//! Public sets from made-up files of the same forms as the real ones.

use std::io::Write;

use super::super::public_set::PublicSet;
use super::super::{FetchError, git_blob_id};
use super::script::{Reply, Server};
use super::*;

/// Returns an array of numpy, `[2][1][steps]`, of 32-bit floats.
fn npy(steps: usize, value: impl Fn(usize) -> f32) -> Vec<u8> {
    let mut header =
        format!("{{'descr': '<f4', 'fortran_order': False, 'shape': (2, 1, {steps}), }}");
    while !(10 + header.len() + 1).is_multiple_of(64) {
        header.push(' ');
    }
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend((0..2 * steps).flat_map(|k| value(k).to_le_bytes()));
    bytes
}

/// Returns a zip archive of sweeps in the folders of a split.
fn archive() -> Vec<u8> {
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    for sweep in 0..8 {
        let part = if sweep < 6 { "train" } else { "test" };
        let name = format!("Events/{part}/sample_{sweep}_label_{}.npy", sweep % 2);
        zip.start_file(name, options).unwrap();
        let file = npy(5, |k| ((k + sweep) % 3) as f32 + sweep as f32);
        zip.write_all(&file).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// Returns a table with a byte order mark and one row a frame, labelled.
fn stream() -> Vec<u8> {
    let mut text = String::from("\u{feff}acc_x,acc_y,alt,label\n");
    for frame in 0..60 {
        let label = ["flat", "stairs"][frame / 10 % 2];
        text.push_str(&format!(
            "{},{},0,{label}\n",
            frame * 7 % 13,
            frame * 5 % 11
        ));
    }
    text.into()
}

/// Returns a grasp: a line to ignore, then three lines a frame, of which the last two are taxels.
fn grasp(frames: usize, level: usize) -> Vec<u8> {
    let mut text = String::from("-10000\n");
    for frame in 0..frames {
        let value = level + frame * frame % 5;
        text.push_str(&format!("1 2\n{value} {}\n{} 3\n", value + 1, value * 2));
    }
    text.into()
}

/// A made-up set with its files.
struct MadeUp {
    table: String,
    files: Vec<(&'static str, Vec<u8>)>,
}

fn made_up() -> Vec<MadeUp> {
    let set = |layout: &str, files: Vec<(&'static str, Vec<u8>)>| MadeUp {
        table: layout.into(),
        files,
    };
    let grasps = ["book_1", "book_2", "lotion_1", "lotion_2"];
    let grasps = grasps.into_iter().enumerate().map(|(k, name)| {
        let path: &'static str = match name {
            "book_1" => "Grasps/book_1.txt",
            "book_2" => "Grasps/book_2.txt",
            "lotion_1" => "Grasps/lotion_1.txt",
            _ => "Grasps/lotion_2.txt",
        };
        (path, grasp(4 + k, 10 * k))
    });
    vec![
        set(
            "read = \"data.csv\"\nrate_hz = 20.0\ncolumns = [\"acc_x\", \"acc_y\"]\nwindow = 5",
            vec![("data.csv", stream())],
        ),
        set(
            "unpack = \"events.zip\"\nread = \"Events\"\nrate_hz = 50.0\n\
             names = \"{split}/sample_{sweep}_label_{material}.npy\"\naxes = \"rows,cols,steps\"",
            vec![("events.zip", archive())],
        ),
        set(
            "read = \"Grasps\"\nrate_hz = 10.0\nnames = \"{material}_{sweep}.txt\"\nlines_per_frame = 3\n\
             columns = [\"3-6\"]\nstretch = 6\nshape = [2, 2]",
            grasps.collect(),
        ),
    ]
}

impl MadeUp {
    /// Returns the set, whose content has this hash.
    fn set(&self, sha256: &str) -> PublicSet {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("file");
        let ids = self.files.iter().map(|(name, content)| {
            fs::write(&path, content).unwrap();
            format!("{} {name}\n", git_blob_id(&path).unwrap())
        });
        let ids: String = ids.collect();
        let text = format!(
            "name = \"made-up\"\ntitle = \"\"\nrepository = \"a/b\"\ncommit = \"c0\"\ncitation = \"\"\nsensor = \"\"\ncaveats = \"\"\n\
             sha256 = \"{sha256}\"\nfiles = \"\"\"\n{ids}\"\"\"\n[layout]\n{}",
            self.table
        );
        toml::from_str(&text).unwrap()
    }

    fn replies(&self) -> Vec<Reply> {
        let files = self.files.iter();
        files.map(|(_, content)| Reply::whole(content)).collect()
    }
}

/// Fetches from a server with these replies.
fn fetched(set: &PublicSet, out: &Path, replies: Vec<Reply>) -> Result<crate::Dataset, FetchError> {
    let server = Server::start(replies);
    let address = format!("http://{}/files/", server.address);
    let agent = Patience::default().config().proxy(None).build().new_agent();
    let found = set.fetch_with(&agent, Some(&address), out, &mut |_| {});
    server.finish();
    found
}

#[test]
fn files_of_each_form_become_the_data_set_of_the_table() {
    let expected = [(12, 2, 5, 2), (8, 2, 5, 2), (4, 2, 6, 4)];
    for (set, (sweeps, materials, steps, taxels)) in made_up().into_iter().zip(expected) {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("set.npz");
        // The first attempt tells the hash, as for a new row of the table.
        let FetchError::OtherConversion { found, .. } =
            fetched(&set.set("0"), &out, set.replies()).unwrap_err()
        else {
            panic!("another hash");
        };
        assert!(!out.exists());
        // The verified files are still there.
        let dataset = fetched(&set.set(&found), &out, Vec::new()).unwrap();
        assert_eq!((dataset.len(), dataset.labels().len()), (sweeps, materials));
        let shape = dataset.shape();
        assert_eq!((shape.steps, shape.taxels()), (steps, taxels));
        assert_eq!(crate::format::read(&out).unwrap().sha256(), found);
        let left: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
        assert_eq!(left.len(), 1, "only the data set is left");
        // The second call downloads nothing.
        fetched(&set.set(&found), &out, Vec::new()).unwrap();
    }
}

#[test]
fn blocks_and_the_authors_split_are_kept() {
    let sets = made_up();
    let read = |set: &MadeUp| {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("set.npz");
        let found = match fetched(&set.set("0"), &out, set.replies()) {
            Err(FetchError::OtherConversion { found, .. }) => found,
            other => panic!("{other:?}"),
        };
        fetched(&set.set(&found), &out, Vec::new()).unwrap()
    };
    let blocks = read(&sets[0]);
    let blocks: std::collections::BTreeSet<_> =
        blocks.records().iter().map(|record| record.block).collect();
    assert_eq!(blocks.len(), 6, "one for each stretch of one label");
    let test = read(&sets[1]);
    let test = test
        .records()
        .iter()
        .filter(|record| record.test == Some(true));
    assert_eq!(test.count(), 2);
}

#[test]
fn another_file_of_the_owner_is_refused() {
    let set = &made_up()[0];
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("set.npz");
    let other = Reply::whole(b"acc_x,acc_y,label\n1,2,flat\n");
    let refused = fetched(&set.set("0"), &out, vec![other]).unwrap_err();
    assert!(
        matches!(refused, FetchError::WrongContent { .. }),
        "{refused}"
    );
    assert!(!out.exists());
}

#[test]
fn the_table_is_complete() {
    let is_hash = |text: &str, digits| {
        text.len() == digits && text.bytes().all(|byte| byte.is_ascii_hexdigit())
    };
    for set in PublicSet::all() {
        assert!(
            is_hash(&set.commit, 40) && is_hash(&set.sha256, 64),
            "{}",
            set.name
        );
        let blobs: Vec<(&str, &str)> = set.blobs().collect();
        assert!(!blobs.is_empty());
        for (id, path) in blobs {
            assert!(is_hash(id, 40) && !path.starts_with('/'), "{path}");
        }
        for text in [&set.title, &set.citation, &set.sensor, &set.caveats] {
            assert!(text.len() > 10, "{}", set.name);
        }
    }
}
