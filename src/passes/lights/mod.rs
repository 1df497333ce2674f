//! Where lights are sampled.

pub mod light_samples;
