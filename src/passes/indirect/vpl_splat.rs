//! Splats of virtual lights.

use crate::error::{Error, Result};
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::virtual_light::VirtualLights;
use crate::passes::visibility::Receiver;

/// Not there yet.
///
/// # Errors
/// Always.
pub fn record(
    _context: &mut Context<'_, '_>,
    _receivers: (&Buffer<Receiver>, usize),
    _lights: &VirtualLights,
    _irradiance: &Buffer<[f32; 4]>,
) -> Result<()> {
    Err(Error::Settings("splat".to_owned()))
}
