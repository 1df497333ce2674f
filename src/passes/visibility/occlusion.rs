//! How a frame finds out whether a light sample is seen: with rays, in voxels, in shadow maps, or not at all.
use std::ops::Range;

use super::Receiver;
use super::map_rays::{self, ShadowMaps};
use super::map_shadow;
use super::shadow::ShadowLight;
use super::voxel_shadow;
use super::voxelize::{self, VoxelGrid};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu};
use crate::passes::Context;
use crate::passes::lights::light_samples::LightSamples;
use crate::plan;
use crate::scene::camera::Camera;
use crate::scene::snapshot::Snapshot;
use crate::settings::Settings;

/// Answers which samples are seen; made once a frame, after the light samples.
pub enum Occlusion {
    /// Nothing hides anything, and nothing is asked.
    None,
    /// Rays through the scene's trees.
    Ray,
    /// Marches through voxels of the view.
    Voxel(VoxelGrid),
    /// Looks into a shadow map of each light sample.
    Maps(ShadowMaps),
}

/// A question to whatever answers: see [`Occlusion::ask`].
pub struct Asked<'q> {
    /// Who asks.
    pub receivers: &'q Buffer<Receiver>,
    /// About which samples.
    pub light: &'q ShadowLight<'q>,
    /// What is asked, and where the answer goes.
    pub bits: &'q Buffer<u32>,
    /// Which receivers.
    pub range: Range<usize>,
    /// Only those samples whose bits are set.
    pub some: bool,
}

/// Whether the settings go together and what they ask for fits.
///
/// # Errors
/// `Settings`.
pub fn check(snapshot: &Snapshot, camera: &Camera, settings: &Settings, gpu: &Gpu) -> Result<()> {
    let most = gpu.limits().max_storage_buffer_binding_size;
    let coarse = ["voxel", "shadow-map"].into_iter().find(|kind| settings.is("visibility", kind));
    match coarse {
        Some(kind) if plan::is_adaptive(settings) => Err(Error::Settings(format!(
            "visibility={kind:?} with refine=\"one-pass\" and direct_estimator=\"ratio\": what is proven there, and the \
             width of penumbrae, is true of rays alone; allowed: visibility \"ray\" or \"none\", or refine \"none\""
        ))),
        Some("voxel") => voxelize::check(settings, camera, most),
        Some(_) => map_rays::check(settings, snapshot, most),
        None => Ok(()),
    }
}

impl Occlusion {
    /// Prepares what `visibility` needs for the samples of all lights.
    ///
    /// # Errors
    /// Those of the device; `Cancelled`.
    pub fn record(context: &mut Context<'_, '_>, samples: &[LightSamples]) -> Result<Self> {
        let is = |kind: &str| context.settings.is("visibility", kind);
        if is("none") {
            return Ok(Self::None);
        }
        if is("voxel") {
            return Ok(Self::Voxel(voxelize::record(context)?));
        }
        if is("shadow-map") {
            return Ok(Self::Maps(map_rays::record(context, samples)?));
        }
        Ok(Self::Ray)
    }

    /// Rays, or nothing where `visibility` is none: for what has neither voxels nor maps.
    pub fn of_rays(context: &Context<'_, '_>) -> Self {
        if context.settings.is("visibility", "none") { Self::None } else { Self::Ray }
    }

    /// Whether there are bits to ask for; without, everything is seen.
    pub fn asks(&self) -> bool {
        !matches!(self, Self::None)
    }

    /// Name of the stage that asks, unless the caller has a better one.
    pub fn stage(&self) -> &'static str {
        match self {
            Self::None | Self::Ray => "shadow",
            Self::Voxel(_) => "voxel_shadow",
            Self::Maps(_) => "map_shadow",
        }
    }

    /// Name in the plan of the pass that asks.
    pub fn pass(&self) -> &'static str {
        match self {
            Self::None | Self::Ray => plan::DIRECT[2],
            Self::Voxel(_) => plan::VOXELS[2],
            Self::Maps(_) => plan::MAPS[2],
        }
    }

    /// Which samples of `light` the receivers of `range` see, [`ShadowLight::words`] words a receiver; as
    /// [`super::trace::Tracer::shadow`], or where `some` is set as [`super::trace::Tracer::shadow_asked`], whoever
    /// answers. `range` starts at a multiple of 64. Rays are counted, marched ones and look-ups are none. Without
    /// visibility nothing is written.
    ///
    /// # Errors
    /// Those of the device; `Cancelled`.
    #[allow(clippy::too_many_arguments, reason = "the question, where its answer goes, and which form it has")]
    pub fn ask(
        &self,
        context: &mut Context<'_, '_>,
        stage: &str,
        receivers: &Buffer<Receiver>,
        light: &ShadowLight<'_>,
        bits: &Buffer<u32>,
        range: Range<usize>,
        some: bool,
    ) -> Result<()> {
        match self {
            Self::None => {}
            Self::Ray => {
                let tracer = context.tracer;
                context.rays += match some {
                    true => tracer.shadow_asked(context.recorder, stage, receivers, light, bits, range)?,
                    false => tracer.shadow(context.recorder, stage, receivers, light, bits, range)?,
                };
            }
            Self::Voxel(grid) => {
                voxel_shadow::record(context, stage, grid, &Asked { receivers, light, bits, range, some })?;
            }
            Self::Maps(maps) => {
                map_shadow::record(context, stage, maps, &Asked { receivers, light, bits, range, some })?;
            }
        }
        Ok(())
    }
}
