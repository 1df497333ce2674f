//! Rays are lists: one pass writes them, the trace answers, the next pass reads the answers.

pub mod map_rays;
pub mod map_shadow;
mod native;
pub mod occlusion;
pub mod placed;
pub mod prove;
pub mod prove_native;
pub mod reuse;
pub mod shadow;
pub mod sub_bits;
pub mod trace;
pub mod trace_native;
pub mod trace_wgsl;
mod tree_upload;
pub mod voxel_blocks;
mod voxel_depths;
pub mod voxel_shadow;
pub mod voxelize;

pub use trace_native::{Hit, Ray, Receiver};
