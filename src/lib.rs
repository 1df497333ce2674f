//! Multiresolution image-space lighting of triangle scenes by area lights and one bounce of indirect light.
//!
//! A frame is data: a [`scene::snapshot::Snapshot`], a camera and [`settings::Settings`] go in; [`plan`] says which
//! passes run; [`renderer`] runs them in order on the device ([`gpu`]); images stay there until they are read.
//! Each pass has one stem for its Rust file, its WGSL file, its numpy reference and its row in the docs.

pub mod error;
pub mod frame;
pub mod gpu;
pub mod passes;
pub mod plan;
#[cfg(feature = "python")]
mod py;
pub mod renderer;
pub mod scene;
pub mod settings;
