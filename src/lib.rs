//! miplight: multiresolution image-space lighting of triangle scenes by area lights.

pub mod error;
pub mod gpu;
