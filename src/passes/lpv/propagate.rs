//! Steps of light from cell to cell.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use bytemuck::{Pod, Zeroable};
use glam::DVec3;

use super::{Flow, Volume, most};
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::settings::Settings;

/// What a step of a channel of a cell costs at first guess, nanoseconds.
const CELL_NS: f64 = 60.0;

/// Twin of `PropagateParams` in `shaders/passes/lpv/propagate.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct PropagateParams {
    /// Mean that arrives of a mean of 1.
    pub mean_of_mean: f32,
    /// Mean that arrives of a net flow of 1 along the axis.
    pub mean_of_along: f32,
    /// Net flow along the axis of a mean of 1.
    pub along_of_mean: f32,
    /// Net flow along the axis of one of 1.
    pub along_of_along: f32,
    /// Net flow across the axis of one of 1.
    pub across: f32,
    /// Largest net flow, as a share.
    pub most: f32,
    /// Share that closed faces send back.
    pub reflected: f32,
    /// Unused.
    pub pad: u32,
}

/// Squares of the basis functions' factors: 1 / 4 pi and 3 / 4 pi.
const MEAN: f64 = 1.0 / (4.0 * PI);
const ALONG: f64 = 3.0 / (4.0 * PI);

/// Integral of the cosine to the axis over the solid angle of a face, seen from the middle of the cell: [Lam60] gives
/// 4 a / sqrt(a^2 + d^2) atan(a / sqrt(a^2 + d^2)) for a square of half-width a at distance d.
pub(super) fn cosine_of_square(half: f64, distance: f64) -> f64 {
    let slope = half / half.hypot(distance);
    4.0 * slope * slope.atan()
}

/// What arrives through one of six faces.
///
/// With directions it is the projection of that sixth of the sphere: the integrals over it of 1, the cosine to the axis,
/// its square and that of another axis are 2 pi / 3, 2 sqrt 2 atan(1 / sqrt 2), 2 pi / 9 + 4 / (3 sqrt 3) and
/// 2 pi / 9 - 2 / (3 sqrt 3). With faces the flux of each goes on as a clamped cosine [KD10 Sec. 3.5].
fn arriving(settings: &Settings) -> [f64; 5] {
    let both = (MEAN * ALONG).sqrt();
    let whole = 4.0 * FRAC_1_SQRT_2 * FRAC_1_SQRT_2.atan();
    let mean_of_mean = MEAN * 2.0 * PI / 3.0;
    if !settings.is("lpv_transport", "faces") {
        let root = 3.0_f64.sqrt();
        let [along, across] = [4.0, -2.0].map(|share| ALONG * (2.0 * PI / 9.0 + share / (3.0 * root)));
        return [mean_of_mean, both * whole, both * whole, along, across];
    }
    let lobe = 2.0 / 3.0_f64.sqrt();
    let front = cosine_of_square(0.5, 1.5);
    // Seen from the middle: 4 atan(a^2 / (d sqrt(d^2 + 2 a^2))) = 0.4007.
    let front_angle = 4.0 * (0.25 / (1.5 * (2.25_f64 + 0.5).sqrt())).atan();
    let corner = |x: f64, z: f64| DVec3::new(x, 0.5, z);
    let side = [corner(0.5, -0.5), corner(0.5, 0.5), corner(1.5, 0.5), corner(1.5, -0.5)];
    let sideways = vector_of_polygon(&side).y.abs();
    [mean_of_mean, both * whole, MEAN * lobe * front_angle, both * lobe * front, both * lobe * 2.0 * sideways]
}

/// Integral of the unit direction over the solid angle of a polygon [Lam60].
fn vector_of_polygon(corners: &[DVec3]) -> DVec3 {
    let next = corners.iter().cycle().skip(1);
    let edges = corners.iter().zip(next);
    0.5 * edges.map(|(a, b)| a.cross(*b).normalize() * a.angle_between(*b)).sum::<DVec3>()
}

impl PropagateParams {
    /// As the settings say.
    pub fn new(settings: &Settings) -> Self {
        let [mean_of_mean, mean_of_along, along_of_mean, along_of_along, across] =
            arriving(settings).map(|coefficient| coefficient as f32);
        let reflected = settings.float("lpv_reflection").unwrap_or(0.0) as f32;
        let most = most(settings);
        Self { mean_of_mean, mean_of_along, along_of_mean, along_of_along, across, most, reflected, pad: 0 }
    }

    /// Irradiance before a face of unit area of a unit of mean, and of net flow towards it: what a step takes through it.
    pub fn irradiance(&self) -> [f32; 2] {
        let y0 = MEAN.sqrt() as f32;
        [self.mean_of_mean / y0, self.mean_of_along / y0]
    }
}

/// All steps; `flows[0]` and `total` hold what was left in the cells, `total` in the end all that passed them.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub(super) fn record(
    context: &mut Context<'_, '_>,
    volume: &Volume,
    flows: &[Flow; 2],
    open: &Buffer<u32>,
    total: &Flow,
) -> Result<()> {
    let params = PropagateParams::new(context.settings);
    let kernel = context.kernel("lpv/propagate", "main")?;
    for step in 0..context.settings.int("lpv_iterations") as usize {
        let (now, next) = (&flows[step % 2], &flows[(step + 1) % 2]);
        let pass = context.recorder.pass("propagate", &kernel).uniform("volume", volume).uniform("params", &params);
        let pass = pass.bind("flow", now).bind("open", open).bind("next", next).bind("total", total);
        pass.dispatch_cut(3 * volume.cells as usize, CELL_NS)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Value;

    #[test]
    fn six_directions_are_the_identity_and_faces_keep_the_flux() {
        let near = |found: [f64; 5], expected: [f64; 5]| {
            found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6)
        };
        // By quadrature: `coefficients` in tests/passes/reference/lpv.py.
        let directions = arriving(&Settings::default());
        assert!(near(directions, [0.166_667, 0.239_944, 0.239_944, 0.350_443, 0.074_779]), "{directions:?}");
        let [mean, .., along, across] = directions;
        assert!((6.0 * mean - 1.0).abs() < 1e-12 && (2.0 * along + 4.0 * across - 1.0).abs() < 1e-12);
        let faces = arriving(&Settings::new([("lpv_transport", Value::Text("faces".to_owned()))]).unwrap());
        assert!(near(faces, [0.166_667, 0.239_944, 0.036_817, 0.061_659, 0.069_829]), "{faces:?}");
        let [.., along, across] = faces;
        assert!(2.0 * along + 4.0 * across < 0.41, "three fifths of the net flow are forgotten in a step");
    }
}
