//! Check of a Parquet file's metadata before the external crate reads it, which allocates memory for as many entries as a
//! list claims.
//!
//! Metadata is a struct in Thrift's compact protocol at the end of the file, before its length and `PAR1`.

use std::io::{Read, Seek, SeekFrom};

/// Maximum nesting of structs; Parquet's own are less than ten deep.
const DEEPEST: usize = 64;

/// Returns true if no list of the metadata claims more entries than there are bytes left. Also true for other files than
/// Parquet.
pub(super) fn is_sound(mut file: impl Read + Seek) -> std::io::Result<bool> {
    let length = file.seek(SeekFrom::End(0))?;
    let mut end = [0; 8];
    if length < 12 {
        return Ok(true);
    }
    file.seek(SeekFrom::Start(length - 8))?;
    file.read_exact(&mut end)?;
    let [a, b, c, d, magic @ ..] = end;
    let size = u64::from(u32::from_le_bytes([a, b, c, d]));
    if magic != *b"PAR1" || size + 8 > length {
        return Ok(true);
    }
    file.seek(SeekFrom::Start(length - 8 - size))?;
    let mut metadata = vec![0; size as usize];
    file.read_exact(&mut metadata)?;
    file.seek(SeekFrom::Start(0))?;
    Ok(Walk(&metadata).structure(DEEPEST).is_some())
}

/// Remaining bytes; each step returns `None` if they are invalid.
struct Walk<'a>(&'a [u8]);

impl Walk<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    fn pass(&mut self, bytes: u64) -> Option<()> {
        self.0 = self.0.get(usize::try_from(bytes).ok()?..)?;
        Some(())
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0u64;
        for shift in (0..70).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// Returns the number of entries, at most one per remaining byte.
    fn count(&mut self, count: u64) -> Option<u64> {
        (count <= self.0.len() as u64).then_some(count)
    }

    fn structure(&mut self, deeper: usize) -> Option<()> {
        let deeper = deeper.checked_sub(1)?;
        loop {
            let head = self.byte()?;
            let kind = head & 0x0f;
            if kind == 0 {
                return Some(());
            }
            if head >> 4 == 0 {
                self.varint()?;
            }
            // The type of a Boolean field contains its value.
            if !matches!(kind, 1 | 2) {
                self.value(kind, deeper)?;
            }
        }
    }

    fn value(&mut self, kind: u8, deeper: usize) -> Option<()> {
        match kind {
            1..=3 => self.pass(1),
            4..=6 => self.varint().map(|_| ()),
            7 => self.pass(8),
            8 => {
                let length = self.varint()?;
                self.pass(length)
            }
            9 | 10 => {
                let head = self.byte()?;
                let short = u64::from(head >> 4);
                let count = if short == 15 { self.varint()? } else { short };
                let deeper = deeper.checked_sub(1)?;
                for _ in 0..self.count(count)? {
                    self.value(head & 0x0f, deeper)?;
                }
                Some(())
            }
            11 => {
                let count = self.varint()?;
                if count == 0 {
                    return Some(());
                }
                let kinds = self.byte()?;
                let deeper = deeper.checked_sub(1)?;
                for _ in 0..self.count(count)? {
                    self.value(kinds >> 4, deeper)?;
                    self.value(kinds & 0x0f, deeper)?;
                }
                Some(())
            }
            12 => self.structure(deeper),
            13 => self.pass(16),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;

    fn file(metadata: &[u8]) -> Cursor<Vec<u8>> {
        let mut bytes = b"PAR1".to_vec();
        bytes.extend(metadata);
        bytes.extend((metadata.len() as u32).to_le_bytes());
        bytes.extend(b"PAR1");
        Cursor::new(bytes)
    }

    #[test]
    fn lists_that_say_they_are_longer_than_the_file_are_found() {
        // Field 1 is an integer, field 2 a list of two bytes, followed by the end.
        assert!(is_sound(file(&[0x15, 2, 0x19, 0x23, 7, 8, 0])).unwrap());
        // The same list claims 2^35 structs.
        let long = [0x15, 2, 0x19, 0xfc, 0x80, 0x80, 0x80, 0x80, 0x80, 1, 0, 0];
        assert!(!is_sound(file(&long)).unwrap());
        assert!(!is_sound(file(&[0x15])).unwrap(), "ends within a field");
        assert!(!is_sound(file(&[0x1c; 100])).unwrap(), "too deep");
    }

    #[test]
    fn what_is_no_parquet_is_left_to_who_says_so() {
        assert!(is_sound(Cursor::new(b"wood".to_vec())).unwrap());
        assert!(is_sound(Cursor::new(vec![7; 100])).unwrap());
    }
}
