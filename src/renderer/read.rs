//! Reading a frame's resources back, by name.

use std::borrow::Cow;
use std::sync::{Arc, PoisonError};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::read_levels::is_level_name;
use super::{Kept, Renderer, read_levels, read_lights, read_volume};
use crate::error::{Error, Result};
use crate::frame::{FrameInfo, Image, LEVEL_CULLED, LEVEL_NOTHING, Pixels, Reason};
use crate::gpu::{Buffer, Gpu};
use crate::settings::Settings;

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
/// The same where there is indirect light.
const INDIRECT_NAMES: [&str; 2] = ["indirect_level_map", "indirect_reason_map"];

fn is_known(name: &str) -> bool {
    let all = [&NAMES[..], &LOBE_NAMES, &INDIRECT_NAMES, &read_lights::NAMES, &read_volume::NAMES];
    all.iter().any(|names| names.contains(&name)) || is_level_name(name)
}

/// # Errors
/// `Settings` for a name that no frame has.
fn check_names(names: &[String]) -> Result<()> {
    match names.iter().find(|name| !is_known(name)) {
        None => Ok(()),
        Some(unknown) => Err(Error::Settings(format!(
            "there is no resource {unknown:?} to keep; there are: {}, and with refine=\"incremental\" bits, \
                 level_causes_L and level_image_L of each level L, with refine=\"sub-fragment\" level_causes_L, \
                 stable_map and extra_map, with indirect=\"splat\", \"gather\", \"clustered\" or \"hierarchical\" rsm \
                 and, but for the last, virtual_lights, with indirect=\"lpv\" {}",
            NAMES.join(", "),
            read_volume::NAMES.join(", ")
        ))),
    }
}

/// # Errors
/// `Settings` for what no frame with these settings has.
pub(super) fn check_asked(names: &[String], settings: &Settings) -> Result<()> {
    check_names(names)?;
    read_levels::check_names(names, settings)?;
    read_lights::check_names(names, settings)?;
    read_volume::check_names(names, settings)
}

type Row = [u32; 4];

pub(super) fn xyz(row: &Row) -> [f32; 3] {
    [row[0], row[1], row[2]].map(f32::from_bits)
}

impl Renderer {
    /// What can be read from a frame.
    pub fn names(&self, frame: &FrameInfo) -> Vec<String> {
        let lobes = LOBE_NAMES.iter().filter(|_| frame.lobes).map(|name| (*name).to_owned());
        let indirect = INDIRECT_NAMES.iter().filter(|_| frame.indirect).map(|name| (*name).to_owned());
        let sources = read_lights::names(&frame.settings).chain(read_volume::names(&frame.settings));
        let lights: Vec<&str> = if frame.indirect { sources.collect() } else { Vec::new() };
        let asked =
            frame.keep.iter().filter(|name| !NAMES.contains(&name.as_str()) && !lights.contains(&name.as_str()));
        let lights = lights.iter().map(|name| (*name).to_owned());
        NAMES
            .iter()
            .map(|name| (*name).to_owned())
            .chain(lobes)
            .chain(indirect)
            .chain(lights)
            .chain(asked.cloned())
            .collect()
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
            "level_map" | "reason_map" => self.fragments(gpu, self.levels.as_ref(), name == "level_map"),
            "indirect_level_map" | "indirect_reason_map" => {
                self.fragments(gpu, self.indirect_levels.as_ref(), name == "indirect_level_map")
            }
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
            _ if read_lights::NAMES.contains(&name) => self.lights(gpu, name),
            _ if read_volume::NAMES.contains(&name) => self.volume(gpu, name),
            _ => whole(self.aov(gpu, frame, name)?),
        }
    }

    /// Fragment maps are at the internal size; without any, one fragment of level 0 for each pixel that sees a surface.
    fn fragments(&self, gpu: &Gpu, maps: Option<&[Buffer<u32>; 2]>, level: bool) -> Result<Image> {
        if let Some(maps) = maps {
            return self.bytes(gpu, &maps[usize::from(!level)]);
        }
        let byte = |&kind: &u32| match (kind, level) {
            (NOTHING, _) => LEVEL_NOTHING,
            (SURFACE, true) => 0,
            (SURFACE, false) => Reason::Coarsest as u8,
            (_, true) => LEVEL_CULLED,
            (_, false) => Reason::Emitter as u8,
        };
        let bytes = each(&self.kinds(gpu)?, byte);
        Ok(Image { width: self.view.width, height: self.view.height, pixels: Pixels::Bytes(bytes) })
    }

    fn bytes(&self, gpu: &Gpu, map: &Buffer<u32>) -> Result<Image> {
        let bytes = gpu.look(map, |words| each(words, |&word| word as u8))?;
        Ok(Image { width: self.view.width, height: self.view.height, pixels: Pixels::Bytes(bytes) })
    }

    /// What each internal pixel sees: read once for all masks and maps.
    fn kinds(&self, gpu: &Gpu) -> Result<Arc<Vec<u32>>> {
        let mut kinds = self.kinds.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = &*kinds {
            return Ok(Arc::clone(known));
        }
        let read = Arc::new(gpu.look(&self.gbuffer.normal, |rows| each(rows, |row| row[3]))?);
        *kinds = Some(Arc::clone(&read));
        Ok(read)
    }

    fn aov(&self, gpu: &Gpu, frame: &FrameInfo, name: &str) -> Result<Pixels> {
        let all = self.kinds(gpu)?;
        let kinds = &*pick(&all, frame);
        let masked = |there: fn(u32) -> bool| Ok(Pixels::Mask(each(kinds, |&kind| there(kind))));
        let word =
            |buffer: &Buffer<Row>| gpu.look(buffer, |rows| Pixels::Words(each(&pick(rows, frame), |row: &Row| row[3])));
        let direction =
            |buffer: &Buffer<Row>| gpu.look(buffer, |rows| Pixels::Rgb(flat(&pick(rows, frame), |_, r| xyz(r))));
        match name {
            "light_mask" => masked(|kind| kind >= FIRST_LIGHT),
            "surface_mask" => masked(|kind| kind == SURFACE),
            "light" => Ok(Pixels::Words(each(kinds, |kind| light_or_none(kind.wrapping_sub(FIRST_LIGHT))))),
            "triangle" => word(&self.gbuffer.geometric),
            "instance" => word(&self.gbuffer.albedo),
            "normal" => direction(&self.gbuffer.normal),
            "normal_geometric" => direction(&self.gbuffer.geometric),
            "albedo" => {
                let surface = |i: usize, row: &Row| if kinds[i] == SURFACE { xyz(row) } else { [0.0; 3] };
                gpu.look(&self.gbuffer.albedo, |rows| Pixels::Rgb(flat(&pick(rows, frame), surface)))
            }
            "depth" => gpu.look(&self.gbuffer.position, |rows| {
                let depth =
                    |(row, &kind): (&Row, &u32)| if kind != NOTHING { self.depth(xyz(row)) } else { f32::INFINITY };
                Pixels::Scalar(pick(rows, frame).iter().zip(kinds).map(depth).collect())
            }),
            _ => {
                let world = |i: usize, row: &Row| {
                    let p = Vec3::from(xyz(row)).as_dvec3() + self.anchor;
                    if kinds[i] != NOTHING { p } else { DVec3::ZERO }.as_vec3().to_array()
                };
                gpu.look(&self.gbuffer.position, |rows| Pixels::Rgb(flat(&pick(rows, frame), world)))
            }
        }
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
fn pick<'r, T: Copy>(rows: &'r [T], frame: &FrameInfo) -> Cow<'r, [T]> {
    let s = frame.supersample as usize;
    if s == 1 {
        return rows.into();
    }
    let (width, height) = (frame.width as usize, frame.height as usize);
    let at = |i: usize| rows[(i / width * s + s / 2) * width * s + i % width * s + s / 2];
    (0..width * height).map(at).collect::<Vec<T>>().into()
}

/// Pixels that a thread takes at once: most of the time goes to memory that is touched for the first time.
const PART: usize = 1 << 14;

/// One value a pixel.
fn each<T: Sync, R: Send>(rows: &[T], value: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    rows.par_iter().with_min_len(PART).map(value).collect()
}

/// Three numbers a pixel, from its place and its row.
fn flat<T: Sync>(rows: &[T], value: impl Fn(usize, &T) -> [f32; 3] + Sync) -> Vec<f32> {
    let mut numbers = vec![0.0; 3 * rows.len()];
    numbers.par_chunks_mut(3 * PART).zip(rows.par_chunks(PART)).enumerate().for_each(|(part, (numbers, rows))| {
        for (i, (three, row)) in numbers.chunks_exact_mut(3).zip(rows).enumerate() {
            three.copy_from_slice(&value(part * PART + i, row));
        }
    });
    numbers
}

fn three(rows: &[[f32; 4]]) -> Vec<f32> {
    flat(rows, |_, row| [row[0], row[1], row[2]])
}

fn rgb(gpu: &Gpu, buffer: Option<&Buffer<[f32; 4]>>, frame: &FrameInfo) -> Result<Pixels> {
    Ok(Pixels::Rgb(match buffer {
        Some(buffer) => gpu.look(buffer, three)?,
        None => vec![0.0; 3 * frame.width as usize * frame.height as usize],
    }))
}
