//! Reader of the records of an MCAP file, up to the first damaged one.

use std::io::Read;
use std::path::Path;

use mcap::records::op;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::RecordingError;
use crate::lengths::lengths_fit;

/// Maximum length of a record that is always accepted, in bytes. Longer records need a longer file.
const LONGEST_RECORD: u64 = 64 << 20;
const NOT_NEEDED: [u8; 7] = [
    op::MESSAGE_INDEX,
    op::CHUNK_INDEX,
    op::ATTACHMENT_INDEX,
    op::STATISTICS,
    op::METADATA_INDEX,
    op::SUMMARY_OFFSET,
    op::DATA_END,
];

/// Returns a reader that verifies chunks and needs no end of the file.
///
/// - `limit`: maximum length of a record, in bytes
fn reader_of(limit: usize) -> LinearReader {
    LinearReader::new_with_options(
        LinearReaderOptions::default()
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(limit),
    )
}

/// Passes every record to `take`, except indices and statistics. Returns the reason and the number of lost bytes if the
/// rest of the file is unreadable.
///
/// Indices and statistics are not needed, and reading them would mean to trust their lengths.
///
/// - `take`: gets the kind of a record and its bytes; its error ends the reading
///
/// # Errors
/// The file cannot be read, or is not an MCAP file.
pub(crate) fn each_record(
    path: &Path,
    mut take: impl FnMut(u8, &[u8]) -> Result<(), String>,
) -> Result<Option<String>, RecordingError> {
    let failed = |source| RecordingError::Io {
        path: path.into(),
        source,
    };
    let mut file = tactnet_data::open_file(path).map_err(failed)?;
    let length = file.metadata().map_err(failed)?.len();
    let mut reader = reader_of(length.max(LONGEST_RECORD) as usize);
    let (mut unread, mut records) = (length, 0);
    let mut ended = false;
    // Up to the last chunk with a record that was read.
    let mut read_bytes = 0;
    let lost = |reason: String, read_bytes: u64| match length - read_bytes {
        0 => reason,
        lost => format!("{reason}; the last {lost} of {length} bytes are lost"),
    };
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(bytes)) => {
                // Reserves the memory that the record claims, but at most what the file can fill.
                let bytes = bytes.min(usize::try_from(unread).unwrap_or(bytes));
                let read = file.read(reader.insert(bytes)).map_err(failed)?;
                unread = unread.saturating_sub(read as u64);
                reader.notify_read(read);
            }
            Ok(LinearReadEvent::Record { data, opcode }) => {
                records += 1;
                ended |= opcode == op::FOOTER;
                if !lengths_fit(opcode, data) {
                    let reason = format!("a record of kind {opcode:#04x} is damaged");
                    return Ok(Some(lost(reason, read_bytes)));
                }
                if NOT_NEEDED.contains(&opcode) {
                    continue;
                }
                if let Err(reason) = take(opcode, data) {
                    return Ok(Some(lost(reason, read_bytes)));
                }
                read_bytes = length - unread;
            }
            Err(mcap::McapError::BadMagic) if records == 0 => {
                return Err(RecordingError::Unreadable {
                    path: path.into(),
                    reason: "not an MCAP file".into(),
                });
            }
            Err(error) => return Ok(Some(lost(error.to_string(), read_bytes))),
        }
    }
    Ok(match ended {
        true => None,
        false => Some(lost("the file has no proper end".into(), read_bytes)),
    })
}
