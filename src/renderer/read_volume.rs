//! A frame's propagation volume, read back: what passed the faces of its cells, which of them are open, and where it is.

use std::f32::consts::PI;

use glam::Vec3;

use super::Kept;
use crate::error::{Error, Result};
use crate::frame::{Image, Pixels};
use crate::gpu::Gpu;
use crate::passes::lpv::Passed;
use crate::plan;
use crate::settings::Settings;

/// What can be read where indirect light comes from a propagation volume, of that of the whole scene: the flux that left through each face, W, as
/// (6, 3, z, y, x); bits of open faces, (z, y, x); the lowest and the highest corner in the world, (2, 3).
pub(super) const NAMES: [&str; 3] = ["volume", "volume_open", "volume_bounds"];
const FACES: usize = 6;
const CHANNELS: usize = 3;

/// Those of a frame with these settings.
pub(super) fn names(settings: &Settings) -> impl Iterator<Item = &'static str> {
    NAMES.into_iter().filter(|_| plan::has_volume(settings))
}

/// # Errors
/// `Settings` for a name of these that a frame with these settings does not have.
pub(super) fn check_names(asked: &[String], settings: &Settings) -> Result<()> {
    match asked.iter().find(|name| NAMES.contains(&name.as_str()) && !plan::has_volume(settings)) {
        None => Ok(()),
        Some(name) => Err(Error::Settings(format!(
            "there is no resource {name:?} to keep with these settings; allowed: indirect lpv"
        ))),
    }
}

impl Kept {
    /// # Errors
    /// `Settings` where there is no volume; `Device`.
    pub(super) fn volume(&self, gpu: &Gpu, name: &str) -> Result<Image> {
        let none = || Error::Settings(format!("{name:?}: no light propagates in this frame"));
        let volume = self.volume.as_ref().and_then(|light| light.volumes.first()).ok_or_else(none)?;
        let pixels = match name {
            "volume" => flux(gpu, volume)?,
            "volume_open" => {
                let open = gpu.look(&volume.placed.open, |words| words.iter().map(|&word| word as u8).collect())?;
                Pixels::Cells(cells(volume).to_vec(), open)
            }
            _ => Pixels::Places(vec![2, 3], self.bounds(volume)),
        };
        Ok(Image { width: 1, height: 1, pixels })
    }

    /// Lowest and highest corner in the world.
    fn bounds(&self, volume: &Passed) -> Vec<f64> {
        let held = &volume.placed.volume;
        let low = Vec3::from(held.corner).as_dvec3() + self.anchor;
        let size = glam::UVec3::from(held.size).as_dvec3() * f64::from(held.edge);
        [low.to_array(), (low + size).to_array()].concat()
    }
}

/// Cells along z, y and x.
fn cells(volume: &Passed) -> [usize; 3] {
    let [x, y, z] = volume.placed.volume.size.map(|n| n as usize);
    [z, y, x]
}

/// Flux through each face, in the order of their bits: below and above along each axis.
fn flux(gpu: &Gpu, volume: &Passed) -> Result<Pixels> {
    let count = CHANNELS * volume.placed.volume.cells as usize;
    let mut flux = vec![0.0; FACES * count];
    for (side, passed) in volume.passed.iter().enumerate() {
        gpu.look(passed, |means| {
            for (axis, face) in (side..FACES).step_by(2).enumerate() {
                let out = &mut flux[face * count..(face + 1) * count];
                // A mean of 1 is a flux of the square root of 4 pi.
                out.iter_mut().zip(means).for_each(|(out, mean)| *out = (4.0 * PI).sqrt() * mean[axis]);
            }
        })?;
    }
    let shape = [&[FACES, CHANNELS][..], &cells(volume)].concat();
    Ok(Pixels::Numbers(shape, flux))
}
