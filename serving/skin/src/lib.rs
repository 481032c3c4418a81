//! The agreement between skin driver, motion controller, recording reader and classifier: packets, the table of channels, and how frames
//! become sweeps.
//!
//! Pure logic, no clock and no thread: a [`SweepSegmenter`] is pushed one [`Frame`] at a time and neither allocates nor blocks
//! after it was made. Nothing here depends on learning, so that a driver compiles in seconds.

mod commented_table;
mod error;
mod frame;
pub mod packets;
mod readable;
mod segmenter;
mod serve_config;
mod table;
mod window;

pub use commented_table::commented;
pub use error::SkinError;
pub use frame::Frame;
pub use readable::{Answer, Readable, material_names};
pub use segmenter::{Contact, Reject, Segmentation, SegmenterConfig, SweepChange, SweepSegmenter};
pub use serve_config::{MAX_FINGERS, ServeConfig};
pub use window::{Push, SweepWindow, WindowConfig, WindowError};
