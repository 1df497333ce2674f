//! Sums over virtual lights in parts: Mesa's software renderer ends a loop after 65,535 rounds.

use std::ops::Range;

use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;

/// Virtual lights, or nodes of the coarsest level, of a part.
pub const AT_ONCE: usize = 1 << 14;

/// What each part has of the irradiance of every receiver.
pub struct Parts {
    /// Mean over the channels, receiver by receiver; of a single part nothing.
    pub values: Buffer<f32>,
    /// Parts of a receiver.
    pub count: usize,
}

/// The parts of so many virtual lights; of none one.
pub fn ranges(lights: usize) -> impl Iterator<Item = Range<usize>> + Clone {
    ranges_of(lights, AT_ONCE)
}

/// The same, `len` in each.
pub fn ranges_of(lights: usize, len: usize) -> impl Iterator<Item = Range<usize>> + Clone {
    (0..lights.max(1)).step_by(len.max(1)).map(move |first| first..(first + len).min(lights))
}

impl Parts {
    /// For `receivers` of so many virtual lights.
    ///
    /// # Errors
    /// Those of the device.
    pub fn new(context: &mut Context<'_, '_>, receivers: usize, lights: usize) -> Result<Self> {
        Self::of_count(context, receivers, ranges(lights).count())
    }

    /// For `receivers` of `count` parts each.
    ///
    /// # Errors
    /// Those of the device.
    pub fn of_count(context: &mut Context<'_, '_>, receivers: usize, count: usize) -> Result<Self> {
        let values = context.resources.buffer("irradiance_parts", if count > 1 { receivers * count } else { 1 })?;
        Ok(Self { values, count })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_hold_all_lights_once() {
        assert!(ranges(5).eq(std::iter::once(0..5)));
        assert!(ranges(0).eq(std::iter::once(0..0)));
        assert_eq!(ranges(AT_ONCE).count(), 1);
        assert_eq!(ranges(2 * AT_ONCE + 1).last(), Some(2 * AT_ONCE..2 * AT_ONCE + 1));
    }
}
