//! Layout of pictures on channels: a header of 64 bytes, then the pixels row by row, one byte each.

use bytemuck::{Pod, Zeroable};
use tactnet_catching_packets::packets::Circles;

/// Header of a picture, 64 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct PictureHead {
    /// Offset 0: number of the picture, equal for both cameras.
    pub frame: u64,
    /// Offset 8: middle of the exposure, in ns.
    pub exposure_ns: u64,
    /// Offset 16: camera, 0 for left and 1 for right.
    pub camera: u32,
    /// Offset 20: width in pixels.
    pub width: u32,
    /// Offset 24: height in pixels.
    pub height: u32,
    /// Offset 28: reserved.
    pub reserved: [u32; 9],
}

impl PictureHead {
    /// Returns header and pixels of a packet, or `None` if its size and header do not match.
    pub fn split(packet: &[u8]) -> Option<(Self, &[u8])> {
        let (head, pixels) = packet.split_at_checked(size_of::<Self>())?;
        let head: Self = bytemuck::pod_read_unaligned(head);
        let wanted = (head.width as usize).checked_mul(head.height as usize)?;
        (pixels.len() == wanted && head.camera < 2).then_some((head, pixels))
    }

    /// Returns a packet for the circles of the picture.
    pub(crate) fn circles(&self) -> Circles {
        Circles {
            frame: self.frame,
            exposure_ns: self.exposure_ns,
            camera: self.camera,
            ..Circles::zeroed()
        }
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
