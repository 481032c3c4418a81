//! Data elements of MATLAB files of version 5: a type, a length, the bytes.

use hdf5_reader::ByteOrder;

/// Type of an element that holds an array.
pub(super) const MATRIX: u32 = 14;
/// Type of an element that holds another one, packed by zlib.
pub(super) const PACKED: u32 = 15;

/// Data element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Element<'a> {
    /// Number of the type in MATLAB's documentation ("miINT8" is 1).
    pub(super) kind: u32,
    pub(super) data: &'a [u8],
}

/// Elements in the order of a file or of an array.
#[derive(Debug, Clone, Copy)]
pub(super) struct Elements<'a> {
    rest: &'a [u8],
    order: ByteOrder,
    /// True if the bytes may end within an element, because only the first are there.
    is_start: bool,
}

impl<'a> Elements<'a> {
    pub(super) fn new(bytes: &'a [u8], order: ByteOrder) -> Self {
        Self {
            rest: bytes,
            order,
            is_start: false,
        }
    }

    /// Returns the elements at the start of an array, the last of which may be cut short.
    pub(super) fn of_start(bytes: &'a [u8], order: ByteOrder) -> Self {
        Self {
            is_start: true,
            ..Self::new(bytes, order)
        }
    }

    pub(super) fn order(&self) -> ByteOrder {
        self.order
    }

    pub(super) fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// Removes and returns the next element.
    ///
    /// # Errors
    /// A sentence about an element that is longer than the file.
    pub(super) fn next(&mut self) -> Result<Element<'a>, String> {
        let short = || "an element that is cut short".to_owned();
        let (tag, behind) = self.rest.split_first_chunk::<4>().ok_or_else(short)?;
        let first = number(*tag, self.order);
        // Up to four bytes are stored within the tag; its upper half is then their number.
        if first >> 16 != 0 {
            let length = (first >> 16) as usize;
            let (data, rest) = behind.split_at_checked(4).ok_or_else(short)?;
            self.rest = rest;
            let data = data.get(..length).ok_or_else(short)?;
            return Ok(Element {
                kind: first & 0xffff,
                data,
            });
        }
        let (length, behind) = behind.split_first_chunk::<4>().ok_or_else(short)?;
        let length = number(*length, self.order) as usize;
        let data = match behind.get(..length) {
            Some(data) => data,
            None if self.is_start => behind,
            None => return Err(short()),
        };
        let padded = match first {
            PACKED => length,
            _ => length.next_multiple_of(8),
        };
        self.rest = behind.get(padded..).unwrap_or_default();
        Ok(Element { kind: first, data })
    }
}

/// Returns the number of four bytes.
pub(super) fn number(bytes: [u8; 4], order: ByteOrder) -> u32 {
    match order {
        ByteOrder::LittleEndian => u32::from_le_bytes(bytes),
        ByteOrder::BigEndian => u32::from_be_bytes(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_are_padded_to_eight_bytes_and_short_ones_are_within_the_tag() {
        let bytes = [
            &[1, 0, 0, 0, 5, 0, 0, 0][..],
            b"abcde\0\0\0",
            &[2, 0, 3, 0],
            b"xyz\0",
        ]
        .concat();
        let mut elements = Elements::new(&bytes, ByteOrder::LittleEndian);
        let next =
            |elements: &mut Elements<'_>| elements.next().map(|of| (of.kind, of.data.to_vec()));
        assert_eq!(next(&mut elements).unwrap(), (1, b"abcde".to_vec()));
        assert_eq!(next(&mut elements).unwrap(), (2, b"xyz".to_vec()));
        assert!(elements.is_empty() && elements.next().is_err());
        assert!(
            Elements::new(&bytes[..12], ByteOrder::LittleEndian)
                .next()
                .is_err()
        );
        let start = Elements::of_start(&bytes[..12], ByteOrder::LittleEndian).next();
        assert_eq!(start.unwrap().data, b"abcd");
    }
}
