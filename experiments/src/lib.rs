//! Questions and answers: what was measured, beside what was published.

mod published;

pub use published::{PUBLISHED, PublishedAccuracy, published_for};
