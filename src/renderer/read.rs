//! Reading a frame's resources back, by name.

use std::sync::{Arc, PoisonError};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::read_levels::is_level_name;
use super::{Kept, Renderer};
use crate::error::{Error, Result};
use crate::frame::{FrameInfo, Image, LEVEL_CULLED, LEVEL_NOTHING, Pixels, Reason};
use crate::gpu::{Buffer, Gpu};

/// `g_normal`'s fourth word: twins of `shaders/common/gbuffer.wgsl`.
const NOTHING: u32 = 0;
pub(super) const SURFACE: u32 = 1;
const FIRST_LIGHT: u32 = 2;

/// Everything that can be read from a frame.
pub(super) const NAMES: [&str; 18] = [
    "image",
    "direct",
    "indirect",
    "depth",
    "position",
    "normal",
    "albedo",
    "light_mask",
    "surface_mask",
    "level_map",
    "reason_map",
    "normal_geometric",
    "triangle",
    "instance",
    "light",
    "direct_irradiance",
    "indirect_irradiance",
    "specular_radiance",
];

/// What there is besides where lobes have fragments of their own.
const LOBE_NAMES: [&str; 2] = ["specular_level_map", "specular_reason_map"];

/// # Errors
/// `Settings` for a name that no frame has.
pub(super) fn check_names(names: &[String]) -> Result<()> {
    match names
        .iter()
        .find(|name| !NAMES.contains(&name.as_str()) && !LOBE_NAMES.contains(&name.as_str()) && !is_level_name(name))
    {
        None => Ok(()),
        Some(unknown) => Err(Error::Settings(format!(
            "there is no resource {unknown:?} to keep; there are: {}, and with refine=\"incremental\" bits, \
                 level_causes_L and level_image_L of each level L, with refine=\"sub-fragment\" level_causes_L, \
                 stable_map and extra_map",
            NAMES.join(", ")
        ))),
    }
}

type Row = [u32; 4];

pub(super) fn xyz(row: &Row) -> [f32; 3] {
    [row[0], row[1], row[2]].map(f32::from_bits)
}

impl Renderer {
    /// What can be read from a frame.
    pub fn names(&self, frame: &FrameInfo) -> Vec<String> {
        let lobes = LOBE_NAMES.iter().filter(|_| frame.lobes).map(|name| (*name).to_owned());
        let asked = frame.keep.iter().filter(|name| !NAMES.contains(&name.as_str()));
        NAMES.iter().map(|name| (*name).to_owned()).chain(lobes).chain(asked.cloned()).collect()
    }

    /// A resource of a frame.
    ///
    /// # Errors
    /// `Device` once the renderer rendered again or was closed; `Settings` for an unknown name.
    pub fn read(&self, frame: &FrameInfo, name: &str) -> Result<Image> {
        check_names(&[name.to_owned()])?;
        let state = self.lock();
        self.gpu.check()?;
        let Some(kept) = state.kept.as_ref().filter(|_| state.generation == frame.generation) else {
            return Err(Error::Device(format!(
                "{name:?} of this frame is gone: its renderer has rendered again since; ask for it in outputs= or \
                 keep=, or read it before"
            )));
        };
        kept.read(&self.gpu, frame, name)
    }
}

impl Kept {
    fn read(&self, gpu: &Gpu, frame: &FrameInfo, name: &str) -> Result<Image> {
        let (width, height) = (frame.width, frame.height);
        let whole = |pixels| Ok(Image { width, height, pixels });
        match name {
            "image" => whole(rgb(gpu, Some(&self.images.image), frame)?),
            "direct" => whole(rgb(gpu, Some(&self.images.direct), frame)?),
            "indirect" => whole(rgb(gpu, self.images.indirect.as_ref(), frame)?),
            "direct_irradiance" | "indirect_irradiance" => {
                let buffer = &self.irradiance[usize::from(name == "indirect_irradiance")];
                let (width, height) = (self.view.width, self.view.height);
                let pixels = match buffer {
                    Some(buffer) => gpu.look(buffer, three)?,
                    None => vec![0.0; 3 * self.view.pixels()],
                };
                Ok(Image { width, height, pixels: Pixels::Rgb(pixels) })
            }
            "level_map" | "reason_map" => self.fragments(gpu, name == "level_map"),
            "specular_level_map" | "specular_reason_map" => match &self.specular_levels {
                Some(maps) => self.bytes(gpu, &maps[usize::from(name == "specular_reason_map")]),
                None => Err(Error::Settings(format!("{name:?}: no fragments of lobes in this frame"))),
            },
            "specular_radiance" => {
                let (width, height) = (self.view.width, self.view.height);
                let pixels = match &self.specular {
                    Some(buffer) => gpu.look(buffer, three)?,
                    None => vec![0.0; 3 * self.view.pixels()],
                };
                Ok(Image { width, height, pixels: Pixels::Rgb(pixels) })
            }
            _ if is_level_name(name) => self.levels(gpu, name),
            _ => whole(self.aov(gpu, frame, name)?),
        }
    }

    /// Fragment maps are at the internal size: one fragment of level 0 for each pixel that sees a surface.
    fn fragments(&self, gpu: &Gpu, level: bool) -> Result<Image> {
        if let Some(maps) = &self.levels {
            return self.bytes(gpu, &maps[usize::from(!level)]);
        }
        let byte = |&kind: &u32| match (kind, level) {
            (NOTHING, _) => LEVEL_NOTHING,
            (SURFACE, true) => 0,
            (SURFACE, false) => Reason::Coarsest as u8,
            (_, true) => LEVEL_CULLED,
            (_, false) => Reason::Emitter as u8,
        };
        let bytes = self.kinds(gpu)?.iter().map(byte).collect();
        Ok(Image { width: self.view.width, height: self.view.height, pixels: Pixels::Bytes(bytes) })
    }

    fn bytes(&self, gpu: &Gpu, map: &Buffer<u32>) -> Result<Image> {
        let bytes = gpu.look(map, |words| words.iter().map(|&word| word as u8).collect())?;
        Ok(Image { width: self.view.width, height: self.view.height, pixels: Pixels::Bytes(bytes) })
    }

    /// What each internal pixel sees: read once for all masks and maps.
    fn kinds(&self, gpu: &Gpu) -> Result<Arc<Vec<u32>>> {
        let mut kinds = self.kinds.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = &*kinds {
            return Ok(Arc::clone(known));
        }
        let kind = |rows: &[Row]| rows.par_iter().with_min_len(PART).map(|row| row[3]).collect();
        let read: Arc<Vec<u32>> = Arc::new(gpu.look(&self.gbuffer.normal, kind)?);
        *kinds = Some(Arc::clone(&read));
        Ok(read)
    }

    fn aov(&self, gpu: &Gpu, frame: &FrameInfo, name: &str) -> Result<Pixels> {
        let rows = |buffer: &Buffer<Row>| gpu.look(buffer, |all| pick(all, frame));
        let kinds = pick(&self.kinds(gpu)?, frame);
        Ok(match name {
            "light_mask" => Pixels::Mask(kinds.iter().map(|&kind| kind >= FIRST_LIGHT).collect()),
            "surface_mask" => Pixels::Mask(kinds.iter().map(|&kind| kind == SURFACE).collect()),
            "light" => {
                Pixels::Words(kinds.iter().map(|kind| kind.wrapping_sub(FIRST_LIGHT)).map(light_or_none).collect())
            }
            "triangle" => Pixels::Words(rows(&self.gbuffer.geometric)?.iter().map(|row| row[3]).collect()),
            "instance" => Pixels::Words(rows(&self.gbuffer.albedo)?.iter().map(|row| row[3]).collect()),
            "normal" => Pixels::Rgb(rows(&self.gbuffer.normal)?.iter().flat_map(xyz).collect()),
            "normal_geometric" => Pixels::Rgb(rows(&self.gbuffer.geometric)?.iter().flat_map(xyz).collect()),
            "albedo" => {
                let albedo = rows(&self.gbuffer.albedo)?;
                let surface = |(row, &kind): (&Row, &u32)| if kind == SURFACE { xyz(row) } else { [0.0; 3] };
                Pixels::Rgb(albedo.iter().zip(&kinds).flat_map(surface).collect())
            }
            "depth" => {
                let depth =
                    |(row, &kind): (&Row, &u32)| if kind != NOTHING { self.depth(xyz(row)) } else { f32::INFINITY };
                Pixels::Scalar(rows(&self.gbuffer.position)?.iter().zip(&kinds).map(depth).collect())
            }
            _ => {
                let world = |(row, &kind): (&Row, &u32)| {
                    let p = Vec3::from(xyz(row)).as_dvec3() + self.anchor;
                    if kind != NOTHING { p } else { DVec3::ZERO }.as_vec3().to_array()
                };
                Pixels::Rgb(rows(&self.gbuffer.position)?.iter().zip(&kinds).flat_map(world).collect())
            }
        })
    }

    /// Distance along the view axis.
    fn depth(&self, position: [f32; 3]) -> f32 {
        let [position, eye, backward] = [position, self.view.eye, self.view.backward].map(|v| Vec3::from(v).as_dvec3());
        (eye - position).dot(backward) as f32
    }
}

fn light_or_none(light: u32) -> u32 {
    // `SURFACE` and `NOTHING` wrap around to the two largest words.
    if light >= u32::MAX - 1 { u32::MAX } else { light }
}

/// The internal pixel nearest the middle of each pixel of the image.
fn pick<T: Copy>(rows: &[T], frame: &FrameInfo) -> Vec<T> {
    let s = frame.supersample as usize;
    if s == 1 {
        return rows.to_vec();
    }
    let (width, height) = (frame.width as usize, frame.height as usize);
    let at = |i: usize| rows[(i / width * s + s / 2) * width * s + i % width * s + s / 2];
    (0..width * height).map(at).collect()
}

/// Pixels that a thread takes at once.
const PART: usize = 1 << 14;

fn three(rows: &[[f32; 4]]) -> Vec<f32> {
    let mut colors = vec![0.0; 3 * rows.len()];
    colors.par_chunks_mut(3 * PART).zip(rows.par_chunks(PART)).for_each(|(colors, rows)| {
        colors.chunks_exact_mut(3).zip(rows).for_each(|(color, row)| color.copy_from_slice(&row[..3]));
    });
    colors
}

fn rgb(gpu: &Gpu, buffer: Option<&Buffer<[f32; 4]>>, frame: &FrameInfo) -> Result<Pixels> {
    Ok(Pixels::Rgb(match buffer {
        Some(buffer) => gpu.look(buffer, three)?,
        None => vec![0.0; 3 * frame.width as usize * frame.height as usize],
    }))
}
