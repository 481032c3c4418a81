//! Recordings.

use std::io::Cursor;
use std::path::PathBuf;
use std::time::Duration;

use bytemuck::Zeroable;
use mcap::records::Record;
use tactnet_channel::{Bus, Domain, Priority};
use tactnet_data::format::ReadOptions;
use tactnet_recording::{About, Recorder, Recording, Topic, TopicSelection, topic_frames};
use tactnet_skin::ServeConfig;
use tactnet_skin::packets::SkinFrame;

use super::Target;

/// Two files of the same recording: as written, and without compression and checksums, so that mutations reach the
/// protected parts.
pub(super) fn mcap() -> anyhow::Result<Target> {
    let folder = tempfile::tempdir_in("/dev/shm")?;
    let path: PathBuf = folder.path().join("recorded.mcap");
    let config = ServeConfig::default();
    let table = config.table("attacked");
    let bus = Bus::open(Domain::Process, &table)?;
    let about = About {
        material: Some("felt".into()),
        git: "0".into(),
        files: vec![("notes".into(), b"attached".to_vec())],
    };
    let mut recorder = Recorder::start(&bus, &table, &path, &about)?;
    let skin = bus.put_port::<SkinFrame>(config.fingers[0].as_str(), Priority::High)?;
    for sequence in 0..20 {
        let mut frame = SkinFrame::zeroed();
        frame.sequence = sequence;
        frame.taxels = 4;
        skin.put_copy(&[frame])?;
        recorder.step(Duration::from_millis(1))?;
    }
    recorder.finish()?;
    let written = std::fs::read(&path)?;
    let seeds = vec![plain(&written)?, written];
    Ok(Target::new(seeds, move |input| {
        let _folder = &folder;
        std::fs::write(&path, input).is_ok() && Recording::read(&path).is_ok()
    }))
}

/// Target: topics of recordings of other programs, in three encodings, with and without compression.
pub(super) fn topics() -> anyhow::Result<Target> {
    let folder = tempfile::tempdir_in("/dev/shm")?;
    let path: PathBuf = folder.path().join("foreign.mcap");
    let mut seeds = Vec::new();
    for name in ["json", "protobuf", "ros2"] {
        let fixtures = concat!(env!("CARGO_MANIFEST_DIR"), "/../fixtures/topics/");
        let written = std::fs::read(format!("{fixtures}{name}.mcap"))?;
        seeds.extend([plain(&written)?, written]);
    }
    let read = move |input: &[u8]| -> Option<()> {
        let _folder = &folder;
        std::fs::write(&path, input).ok()?;
        let topics = tactnet_recording::topics(&path).ok()?.topics;
        let has_numbers = |topic: &&Topic| topic.numbers.as_ref().is_ok_and(|n| !n.is_empty());
        let topic = topics.iter().find(has_numbers)?;
        let field = topic.numbers.as_ref().ok()?.last()?.0.clone();
        let selection = TopicSelection {
            topic: topic.name.clone(),
            fields: vec![field],
            label: None,
        };
        let frames = topic_frames(&path, &selection).ok()?;
        let sweeps = frames.series.into_sweeps(&path, &ReadOptions::default());
        sweeps.ok().map(|_| ())
    };
    Ok(Target::new(seeds, move |input| read(input).is_some()))
}

fn plain(written: &[u8]) -> anyhow::Result<Vec<u8>> {
    let mut writer = mcap::WriteOptions::new()
        .compression(None)
        .use_chunks(false)
        .calculate_data_section_crc(false)
        .calculate_summary_section_crc(false)
        .calculate_attachment_crcs(false)
        .create(Cursor::new(Vec::new()))?;
    for message in mcap::MessageStream::new(written)? {
        writer.write(&message?)?;
    }
    for record in mcap::read::LinearReader::new(written)? {
        match record? {
            Record::Metadata(metadata) => writer.write_metadata(&metadata)?,
            Record::Attachment { header, data, .. } => writer.attach(&mcap::Attachment {
                log_time: header.log_time,
                create_time: header.create_time,
                name: header.name,
                media_type: header.media_type,
                data,
            })?,
            _ => {}
        }
    }
    writer.finish()?;
    Ok(writer.into_inner().into_inner())
}
