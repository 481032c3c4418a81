//! Check of the lengths in a record of an MCAP file.
//!
//! mcap 0.26 reserves memory for a length before it checks that the data exist, and panics at a too short attachment.

use mcap::records::op;

/// Returns true if every text, map and block of a record ends within the record. Records without lengths pass.
pub(crate) fn lengths_fit(opcode: u8, data: &[u8]) -> bool {
    let mut rest = Rest(data);
    let ends = match opcode {
        op::HEADER => rest.text().and_then(|()| rest.text()),
        op::SCHEMA => rest
            .skip(2)
            .and_then(|()| rest.text())
            .and_then(|()| rest.text())
            .and_then(|()| rest.text()),
        op::CHANNEL => rest
            .skip(4)
            .and_then(|()| rest.text())
            .and_then(|()| rest.text())
            .and_then(|()| rest.map()),
        op::METADATA => rest.text().and_then(|()| rest.map()),
        // Two times, two texts, the data, a checksum.
        op::ATTACHMENT => rest
            .skip(16)
            .and_then(|()| rest.text())
            .and_then(|()| rest.text())
            .and_then(|()| rest.block())
            .and_then(|()| rest.skip(4)),
        _ => Some(()),
    };
    ends.is_some()
}

/// Bytes that are not checked yet.
struct Rest<'a>(&'a [u8]);

impl Rest<'_> {
    fn skip(&mut self, bytes: usize) -> Option<()> {
        self.0 = self.0.get(bytes..)?;
        Some(())
    }

    fn number(&mut self) -> Option<usize> {
        let (number, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        usize::try_from(u32::from_le_bytes(*number)).ok()
    }

    /// Skips a text: a length of four bytes, then as many bytes.
    fn text(&mut self) -> Option<()> {
        let bytes = self.number()?;
        self.skip(bytes)
    }

    /// Skips a block: a length of eight bytes, then as many bytes.
    fn block(&mut self) -> Option<()> {
        let (number, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        self.skip(usize::try_from(u64::from_le_bytes(*number)).ok()?)
    }

    /// Skips a map: a length of four bytes, then as many bytes of texts.
    fn map(&mut self) -> Option<()> {
        let bytes = self.number()?;
        let mut texts = Rest(self.0.get(..bytes)?);
        while !texts.0.is_empty() {
            texts.text()?;
        }
        self.skip(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    #[test]
    fn lengths_beyond_the_record_are_seen_wherever_they_stand() {
        let entry = [text("table"), text("bus")].concat();
        let map = [(entry.len() as u32).to_le_bytes().to_vec(), entry].concat();
        let metadata = [text("tactnet"), map.clone()].concat();
        let channel = [vec![0; 4], text("skin"), text("protobuf"), map].concat();
        let schema = [vec![0; 2], text("Frame"), text("protobuf"), text("data")].concat();
        for (opcode, record) in [
            (op::METADATA, metadata),
            (op::CHANNEL, channel),
            (op::SCHEMA, schema),
        ] {
            assert!(lengths_fit(opcode, &record), "{opcode}");
            for end in 0..record.len() {
                assert!(!lengths_fit(opcode, &record[..end]), "{opcode} {end}");
            }
            for at in 0..record.len() - 4 {
                // The high bytes of a small length.
                if record[at + 1..at + 4] == [0; 3] && record[at] > 2 {
                    let mut damaged = record.clone();
                    damaged[at..at + 4].copy_from_slice(&u32::MAX.to_le_bytes());
                    assert!(!lengths_fit(opcode, &damaged), "{opcode} {at}");
                }
            }
        }
        assert!(lengths_fit(op::MESSAGE, &[]), "a message has no lengths");
    }
}
