//! Packets, channel table and segmentation shared by skin drivers, motion controllers, recordings and the classifier.
//!
//! Pure logic without clocks or threads. A [`SweepSegmenter`] takes one [`Frame`] at a time; after construction it
//! neither allocates nor blocks. The crate depends on no learning code, so a skin driver compiles in seconds.

mod commented_table;
mod error;
mod frame;
mod frame_span;
pub mod packets;
mod readable_packet;
mod segmenter;
mod serve_config;
mod table;
mod window;

pub use commented_table::commented;
pub use error::SkinError;
pub use frame::Frame;
pub use frame_span::FrameSpan;
pub use readable_packet::{MaterialPrediction, ReadablePacket, material_names};
pub use segmenter::{Contact, Reject, Segmentation, SegmenterConfig, SweepChange, SweepSegmenter};
pub use serve_config::{MAX_FINGERS, ServeConfig};
pub use window::{Push, SweepWindow, WindowConfig, WindowError};
