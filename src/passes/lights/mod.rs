//! Where lights are sampled.

pub mod light_samples;
pub mod virtual_light;
