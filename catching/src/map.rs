//! Map of the surroundings, for planning a catch among obstacles (thesis, sections 3.5.4 and 3.8).
//!
//! ```text
//! depth pictures ─> Fusion: truncated signed distances, several views ─> solid cells ─> DistanceField: exact Euclidean distances
//! ```
//!
//! The map frame is the frame of the head pose. **Distances are positive in free space and negative inside obstacles.**
//! The thesis defines them with the opposite sign and states that its objective is maximised; with that sign it must be
//! minimised. This crate minimises a squared hinge of the distance.
//!
//! Cells that the last look saw only from behind a surface count as solid, because the back of a box is not visible.
//! Cells that were never in view count as free: they are outside of the picture or behind the robot's own body. The
//! robot raises its arms while it looks, so that they hide little.

mod error;
mod field;
mod fusion;
mod grid;
mod own_body;
mod spheres;
mod transform;

pub use error::MapError;
pub use field::DistanceField;
pub use fusion::{DepthCamera, Fusion, FusionConfig};
pub use grid::VoxelGrid;
pub use spheres::{ARM_SPHERES, ArmSpheres, STILL_SPHERES, Sphere, StillSpheres};
pub use transform::squared_distances;
