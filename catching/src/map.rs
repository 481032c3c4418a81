//! A map of what stands about, for planning a catch among obstacles (thesis, sections 3.5.4 and 3.8).
//!
//! ```text
//! depth pictures ─> Fusion: truncated signed distances, several views ─> solid cells ─> DistanceField: exact Euclidean distances
//! ```
//!
//! The frame is the one in which the head's pose is given. **Distances are positive in free space and negative inside obstacles**, the
//! other way round from the thesis, whose printed objective is 'maximised' over distances that are positive inside: with that sign it has
//! to be minimised. Here a squared hinge on the distance is minimised.
//!
//! What no picture shows: cells that the last look had in view and saw only from behind a surface are taken for solid (the back of a box
//! is not seen). Cells that were never in view, because they are out of the picture or behind the robot's own body, are taken for free:
//! the robot stands there. It holds its arms up while it looks, so that they hide little.

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
