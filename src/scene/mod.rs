//! Validated input, free of GPU types.

pub mod bvh;
pub mod camera;
pub mod light;
pub mod material;
pub mod mesh;
pub mod prepare;
pub mod snapshot;
pub mod surface_samples;
