//! Emitted light plus albedo times irradiance.

use bytemuck::{Pod, Zeroable};

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::{Context, GBuffer};

/// Twin of `CompositeParams` in `shaders/passes/composite/composite.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct CompositeParams {
    /// 1: there is direct irradiance.
    pub direct: u32,
    /// 1: there is indirect irradiance.
    pub indirect: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// Radiance images, internal pixels.
#[derive(Debug, Clone)]
pub struct Images {
    /// Emitted, direct and indirect.
    pub image: Buffer<[f32; 4]>,
    /// Direct light alone.
    pub direct: Buffer<[f32; 4]>,
    /// Indirect light alone; one element when there is none.
    pub indirect: Option<Buffer<[f32; 4]>>,
}

/// Composes the images; an irradiance that is not there counts as zero. `specular`: what lobes reflect of direct and of
/// indirect light.
///
/// # Errors
/// Those of the device.
pub fn record(
    context: &mut Context<'_, '_>,
    gbuffer: &GBuffer,
    direct: Option<&Buffer<[f32; 4]>>,
    indirect: Option<&Buffer<[f32; 4]>>,
    specular: [Option<&Buffer<[f32; 4]>>; 2],
) -> Result<Images> {
    let pictures = f64::from(u8::from(!context.prepared.light_textures.is_empty()));
    let kernel = context.kernel_with("composite/composite", "main", &[("PICTURES", pictures)])?;
    let pixels = context.view.pixels();
    let nothing: Buffer<[f32; 4]> = context.resources.buffer("nothing", 1)?;
    let images = Images {
        image: context.resources.buffer("image", pixels)?,
        direct: context.resources.buffer("direct", pixels)?,
        indirect: indirect.map(|_| context.resources.buffer("indirect", pixels)).transpose()?,
    };
    // A binding must be there even where the shader does not touch it: 16 bytes stand for what is not rendered.
    let nowhere: Buffer<[f32; 4]> = context.resources.buffer("nowhere", 1)?;
    let params =
        CompositeParams { direct: direct.is_some().into(), indirect: indirect.is_some().into(), pad0: 0, pad1: 0 };
    context
        .recorder
        .pass("composite", &kernel)
        .uniform("params", &params)
        .bind("g_normal", &gbuffer.normal)
        .bind("g_albedo", &gbuffer.albedo)
        .bind("lights", context.scene.lights()?)
        .bind("direct_irradiance", direct.unwrap_or(&nothing))
        .bind("indirect_irradiance", indirect.unwrap_or(&nothing))
        .bind("image", &images.image)
        .bind("direct", &images.direct)
        .bind("indirect", images.indirect.as_ref().unwrap_or(&nowhere))
        .dispatch(pixels)?;
    let parts = [Some(&images.direct), images.indirect.as_ref()];
    for (specular, part) in specular.into_iter().zip(parts) {
        if let (Some(specular), Some(part)) = (specular, part) {
            let kernel = context.kernel("composite/composite", "specular")?;
            let pass = context.recorder.pass("composite", &kernel).bind("specular_radiance", specular);
            pass.bind("image", &images.image).bind("direct", part).dispatch(pixels)?;
        }
    }
    modulate(context, gbuffer, &images)?;
    Ok(images)
}

/// Twin of `ModulateParams` in `shaders/passes/composite/composite.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ModulateParams {
    /// Scene space.
    pub eye: [f32; 3],
    /// How much indirect light darkens where a surface turns away from the eye, 0 to 1.
    pub modulation: f32,
}

fn modulate(context: &mut Context<'_, '_>, gbuffer: &GBuffer, images: &Images) -> Result<()> {
    let modulation = context.settings.float("surface_modulation").unwrap_or(0.0) as f32;
    let Some(indirect) = images.indirect.as_ref().filter(|_| modulation > 0.0) else {
        return Ok(());
    };
    let params = ModulateParams { eye: context.view.eye, modulation };
    let kernel = context.kernel("composite/composite", "modulate")?;
    let pass = context.recorder.pass("composite", &kernel).uniform("look", &params);
    let pass = pass.bind("g_position", &gbuffer.position).bind("g_normal", &gbuffer.normal);
    pass.bind("image", &images.image).bind("indirect", indirect).dispatch(context.view.pixels())
}
