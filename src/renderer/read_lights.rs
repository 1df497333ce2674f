//! Reflective shadow maps and virtual lights of a frame, read back.

use glam::{DVec3, Vec3};

use super::Kept;
use crate::error::{Error, Result};
use crate::frame::{Image, Pixels};
use crate::gpu::Gpu;
use crate::passes::lights::virtual_light::{RSM_ROWS, VirtualLight};
use crate::plan;
use crate::settings::Settings;

/// What can be read where indirect light comes from virtual lights: the texels of all maps, map under map, each as its
/// [`RSM_ROWS`] rows; and the list of virtual lights, each as its words, where there is one.
pub(super) const NAMES: [&str; 2] = ["rsm", "virtual_lights"];
/// Words of a texel.
const TEXEL: usize = 4 * RSM_ROWS;
/// Words of a virtual light.
const LIGHT: usize = size_of::<VirtualLight>() / size_of::<u32>();

/// Whether settings leave something to read under a name of these.
fn has(settings: &Settings, name: &str) -> bool {
    plan::indirect_from_virtual_lights(settings) && (name == "rsm" || !settings.is("indirect", "hierarchical"))
}

/// Those of a frame with these settings.
pub(super) fn names(settings: &Settings) -> impl Iterator<Item = &'static str> {
    NAMES.into_iter().filter(|name| has(settings, name))
}

/// # Errors
/// `Settings` for a name of these that a frame with these settings does not have.
pub(super) fn check_names(asked: &[String], settings: &Settings) -> Result<()> {
    match asked.iter().find(|name| NAMES.contains(&name.as_str()) && !has(settings, name)) {
        None => Ok(()),
        Some(name) => {
            let cut = if name == "rsm" { ", hierarchical" } else { "" };
            Err(Error::Settings(format!(
                "there is no resource {name:?} to keep with these settings; allowed: indirect splat, gather, clustered{cut}"
            )))
        }
    }
}

/// Puts the place in the first three words back where the scene has it.
fn place(words: &mut [u32], anchor: DVec3) {
    let rebased = Vec3::new(f32::from_bits(words[0]), f32::from_bits(words[1]), f32::from_bits(words[2]));
    let world = (rebased.as_dvec3() + anchor).as_vec3().to_array();
    words[..3].copy_from_slice(&world.map(f32::to_bits));
}

impl Kept {
    /// # Errors
    /// `Settings` where there is no such thing; `Device`.
    pub(super) fn lights(&self, gpu: &Gpu, name: &str) -> Result<Image> {
        let held = self.virtual_lights.as_ref();
        let none = || Error::Settings(format!("{name:?}: no light reached anything in this frame"));
        if name == "rsm" {
            let rsm = &held.ok_or_else(none)?.0;
            let rows = gpu.read(&rsm.texels)?;
            let mut words: Vec<u32> = rows.into_iter().flatten().map(f32::to_bits).collect();
            words.chunks_exact_mut(TEXEL).for_each(|texel| place(texel, self.anchor));
            let height = rsm.resolution * rsm.maps.len() as u32;
            return Ok(Image { width: rsm.resolution, height, pixels: Pixels::Rows(TEXEL, words) });
        }
        let list = held.and_then(|(_, list)| list.as_ref()).ok_or_else(none)?;
        let lights = gpu.read(&list.lights)?;
        let mut words: Vec<u32> = bytemuck::cast_slice(&lights[..list.count]).to_vec();
        words.chunks_exact_mut(LIGHT).for_each(|light| place(light, self.anchor));
        Ok(Image { width: 1, height: list.count as u32, pixels: Pixels::Rows(LIGHT, words) })
    }
}
