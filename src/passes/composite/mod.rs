//! From irradiance to the image.

#[allow(clippy::module_inception, reason = "the pass has the name of its stage")]
pub mod composite;
pub mod downsample;
