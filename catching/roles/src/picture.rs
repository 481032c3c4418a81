//! Pictures on channels: a head of 64 bytes, then the pixels row by row, a byte each.

use bytemuck::{Pod, Zeroable};

/// What stands before the pixels of a picture, 64 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct PictureHead {
    /// 0: number of the picture; both cameras count alike.
    pub frame: u64,
    /// 8: middle of the exposure.
    pub exposure_ns: u64,
    /// 16: 0 left, 1 right.
    pub camera: u32,
    /// 20: pixels of a row.
    pub width: u32,
    /// 24: rows.
    pub height: u32,
    /// 28: for what may come.
    pub reserved: [u32; 9],
}

impl PictureHead {
    /// Returns head and pixels of a packet; `None` if it is no picture.
    pub fn split(packet: &[u8]) -> Option<(Self, &[u8])> {
        let (head, pixels) = packet.split_at_checked(size_of::<Self>())?;
        let head: Self = bytemuck::pod_read_unaligned(head);
        let wanted = (head.width as usize).checked_mul(head.height as usize)?;
        (pixels.len() == wanted && head.camera < 2).then_some((head, pixels))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_picture_is_not_taken_for_one() {
        let head = PictureHead {
            frame: 3,
            width: 4,
            height: 2,
            ..PictureHead::zeroed()
        };
        let mut packet = bytemuck::bytes_of(&head).to_vec();
        assert_eq!(packet.len(), crate::PICTURE_HEAD);
        packet.extend([7; 8]);
        assert_eq!(PictureHead::split(&packet), Some((head, &[7; 8][..])));
        assert_eq!(PictureHead::split(&packet[..71]), None);
        assert_eq!(PictureHead::split(&packet[..20]), None);
        packet[16] = 2;
        assert_eq!(PictureHead::split(&packet), None);
    }
}
