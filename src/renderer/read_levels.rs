//! What incremental refinement looked at, level by level: causes, light and visibility bits, made on the host when asked.

use super::Kept;
use super::read::{SURFACE, xyz};
use crate::error::{Error, Result};
use crate::frame::{Image, Pixels, Reason};
use crate::gpu::Gpu;
use crate::passes::gather::levels::Looked;
use crate::plan::{adds_extra_samples, is_by_level, is_incremental, is_sub_fragment};
use crate::settings::Settings;

/// Bits of a node's state, twins of `shaders/common/fragment.wgsl` and `nodes.wgsl`, strongest reason first.
const SPLITS: [(u32, Reason); 4] =
    [(8, Reason::Depth), (16, Reason::Normal), (32, Reason::Illumination), (64 | SKIPS, Reason::Visibility)];
/// Nodes that lie across an edge are guides: their light is not shown.
const ROUGH: u32 = 24;
/// Split together with the node above.
const SKIPS: u32 = 512;
/// First of four bits: a sub-fragment does not see the same as those beside it.
const UNSTABLE: u32 = 16384;

/// What a name asks of the levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    Causes(u32),
    Light(u32),
    Bits,
    Stable,
    Extra,
}

fn asked(name: &str) -> Option<Asked> {
    match name {
        "bits" => return Some(Asked::Bits),
        "stable_map" => return Some(Asked::Stable),
        "extra_map" => return Some(Asked::Extra),
        _ => {}
    }
    let level = |rest: &str| rest.parse().ok().filter(|level| *level <= 16);
    let causes = name.strip_prefix("level_causes_").and_then(level).map(Asked::Causes);
    causes.or_else(|| name.strip_prefix("level_image_").and_then(level).map(Asked::Light))
}

/// Whether a name is one of these.
pub(super) fn is_level_name(name: &str) -> bool {
    asked(name).is_some()
}

/// # Errors
/// `Settings` for a name of these where nothing is refined level by level, or of a level that is not used.
pub(super) fn check_names(names: &[String], settings: &Settings) -> Result<()> {
    let [finest, coarsest] = ["finest_level", "coarsest_level"].map(|name| settings.int(name));
    for (name, what) in names.iter().filter_map(|name| Some((name, asked(name)?))) {
        let missing = match what {
            Asked::Stable if !is_sub_fragment(settings) => Some("refine=\"sub-fragment\""),
            Asked::Extra if !adds_extra_samples(settings) => {
                Some("refine=\"sub-fragment\" with extra_samples=\"on\" and upsample=\"rbf\"")
            }
            Asked::Causes(_) if !is_by_level(settings) => Some("refine=\"incremental\" or \"sub-fragment\""),
            Asked::Light(_) | Asked::Bits if !is_incremental(settings) => Some("refine=\"incremental\""),
            _ => None,
        };
        if let Some(allowed) = missing {
            return Err(Error::Settings(format!(
                "there is no resource {name:?} to keep with these settings; allowed: {allowed}"
            )));
        }
        held(name, what, finest, coarsest)?;
    }
    Ok(())
}

/// # Errors
/// `Settings` for a level that is not used.
fn held(name: &str, asked: Asked, finest: u32, coarsest: u32) -> Result<()> {
    match asked {
        Asked::Causes(level) | Asked::Light(level) if !(finest..=coarsest).contains(&level) => {
            Err(Error::Settings(format!("{name:?} is of no level that is used; allowed: {finest} to {coarsest}")))
        }
        _ => Ok(()),
    }
}

impl Kept {
    /// # Errors
    /// `Settings` where nothing was refined level by level, or not to this level; `Device`.
    pub(super) fn levels(&self, gpu: &Gpu, name: &str) -> Result<Image> {
        let Some(looked) = &self.looked else {
            return Err(Error::Settings(format!(
                "{name:?} is there only with fragments that are looked at level by level, and a light that reaches something"
            )));
        };
        let what = asked(name).unwrap_or(Asked::Bits);
        let pyramid = &looked.nodes.pyramid;
        held(name, what, pyramid.finest, pyramid.coarsest)?;
        match what {
            Asked::Causes(level) => self.causes(gpu, looked, level),
            Asked::Light(level) => self.light(gpu, looked, level),
            Asked::Bits => self.bits(gpu, looked),
            Asked::Stable => self.stable(gpu, looked),
            Asked::Extra => self.extra(gpu, looked),
        }
    }

    /// A texel: 255 where nothing was looked at, 0 for a fragment, else why it was split.
    fn causes(&self, gpu: &Gpu, looked: &Looked, level: u32) -> Result<Image> {
        let [width, height, first, count] = looked.nodes.pyramid.levels[level as usize];
        let at = gpu.read(&looked.nodes.at)?;
        let rows = gpu.read(&looked.nodes.rows)?;
        let cause = |&node: &u32| {
            let Some(row) = node.checked_sub(1).map(|node| rows[node as usize]) else { return Reason::Nothing as u8 };
            let split = level > looked.nodes.pyramid.finest;
            let why = SPLITS.iter().find(|(bit, _)| split && row[2] & bit != 0);
            why.map_or(Reason::Coarsest as u8, |(_, reason)| *reason as u8)
        };
        let bytes = at[first as usize..(first + count) as usize].iter().map(cause).collect();
        Ok(Image { width, height, pixels: Pixels::Bytes(bytes) })
    }

    /// The node that holds each pixel: the finest of `level` and above that was looked at.
    fn nodes_of(looked: &Looked, at: &[u32], level: u32, pixel: usize) -> Option<usize> {
        let pyramid = &looked.nodes.pyramid;
        let [x, y] = [pixel as u32 % pyramid.levels[0][0], pixel as u32 / pyramid.levels[0][0]];
        let node = (level..=pyramid.coarsest).find_map(|l| {
            let [width, _, first, _] = pyramid.levels[l as usize];
            at[(first + (y >> l) * width + (x >> l)) as usize].checked_sub(1)
        });
        node.map(|node| node as usize)
    }

    /// Reflected radiance as it stands after a level, in blocks; zeros where nothing is lit yet.
    fn light(&self, gpu: &Gpu, looked: &Looked, level: u32) -> Result<Image> {
        let (at, rows) = (gpu.read(&looked.nodes.at)?, gpu.read(&looked.nodes.rows)?);
        let irradiance = gpu.read(&looked.nodes.irradiance)?;
        let (albedo, kinds) = (gpu.read(&self.gbuffer.albedo)?, gpu.read(&self.gbuffer.normal)?);
        let finest = looked.nodes.pyramid.finest;
        let pixels = (0..self.view.pixels()).flat_map(|pixel| {
            let node = Self::nodes_of(looked, &at, level, pixel).filter(|_| kinds[pixel][3] == SURFACE);
            let shown = node.filter(|&node| level == finest || rows[node][2] & ROUGH == 0);
            let color = xyz(&albedo[pixel]);
            let light = shown.map_or([0.0; 4], |node| irradiance[node]);
            std::array::from_fn::<_, 3, _>(|c| color[c] * light[c] * std::f32::consts::FRAC_1_PI)
        });
        Ok(Image { width: self.view.width, height: self.view.height, pixels: Pixels::Rgb(pixels.collect()) })
    }

    fn mask(&self, pixels: Vec<bool>) -> Image {
        Image { width: self.view.width, height: self.view.height, pixels: Pixels::Mask(pixels) }
    }

    /// Pixels in sub-fragments of the finest test around them that see the same samples of all lights as those beside them
    /// [KJ16 Fig. 3].
    fn stable(&self, gpu: &Gpu, looked: &Looked) -> Result<Image> {
        let (at, rows) = (gpu.read(&looked.nodes.at)?, gpu.read(&looked.nodes.rows)?);
        let kinds = gpu.read(&self.gbuffer.normal)?;
        let pyramid = &looked.nodes.pyramid;
        let agrees = |pixel: usize| {
            let [x, y] = [pixel as u32 % pyramid.levels[0][0], pixel as u32 / pyramid.levels[0][0]];
            let tested = (pyramid.finest.max(1)..=pyramid.coarsest).find_map(|l| {
                let [width, _, first, _] = pyramid.levels[l as usize];
                let node = at[(first + (y >> l) * width + (x >> l)) as usize].checked_sub(1)?;
                let part = ((x >> (l - 1)) & 1) | (((y >> (l - 1)) & 1) << 1);
                Some((rows[node as usize][2], part))
            });
            tested.is_some_and(|(state, part)| state & (ROUGH | SKIPS | UNSTABLE << part) == 0)
        };
        Ok(self.mask((0..self.view.pixels()).map(|pixel| kinds[pixel][3] == SURFACE && agrees(pixel)).collect()))
    }

    /// Pixels that are samples beyond the fragments.
    fn extra(&self, gpu: &Gpu, looked: &Looked) -> Result<Image> {
        let mut pixels = vec![false; self.view.pixels()];
        if let Some(extras) = looked.extras.as_ref().filter(|extras| extras.places > 0) {
            let (points, light) = (gpu.read(&extras.receivers)?, gpu.read(&extras.irradiance)?);
            let samples = points.iter().zip(&light).take(extras.places).filter(|(_, light)| light[3] > 0.0);
            samples.for_each(|(point, _)| pixels[point.pixel as usize] = true);
        }
        Ok(self.mask(pixels))
    }

    /// For each pixel the words of the samples that its fragment sees, light after light; zeros where there is none.
    fn bits(&self, gpu: &Gpu, looked: &Looked) -> Result<Image> {
        let at = gpu.read(&looked.nodes.at)?;
        let words: usize = looked.bits.iter().map(|bits| bits.words).sum();
        let mut rows = vec![0; words * self.view.pixels()];
        let mut first = 0;
        for bits in &looked.bits {
            let held = gpu.read(&bits.buffer)?;
            for pixel in 0..self.view.pixels() {
                if let Some(node) = Self::nodes_of(looked, &at, 0, pixel) {
                    let seen = &held[(2 * node + 1) * bits.words..][..bits.words];
                    rows[pixel * words + first..][..bits.words].copy_from_slice(seen);
                }
            }
            first += bits.words;
        }
        Ok(Image { width: self.view.width, height: self.view.height, pixels: Pixels::Rows(words, rows) })
    }
}
