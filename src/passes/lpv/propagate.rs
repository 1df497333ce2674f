//! Steps of light from cell to cell.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, IVec3};

use super::points::Placed;
use super::{Flow, most};
use crate::error::Result;
use crate::passes::Context;
use crate::settings::Settings;

/// What a step of a channel of a cell costs at first guess, nanoseconds.
const LEAVE_NS: f64 = 100.0;
const ARRIVE_NS: f64 = 30.0;
/// Bytes of what leaves along an axis at most, so that large volumes work on a channel at a time.
const LEAVING_BYTES: u64 = 1 << 27;

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
    /// Of the channels at work: cells before them.
    pub first: u32,
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

/// What arrives through one of six faces in the literature's form: the flux of each other face of the next cell goes on as
/// a clamped cosine [KD10 Sec. 3.5].
fn by_faces() -> [f64; 5] {
    let both = (MEAN * ALONG).sqrt();
    let lobe = 2.0 / 3.0_f64.sqrt();
    let front = cosine_of_square(0.5, 1.5);
    // Seen from the middle: 4 atan(a^2 / (d sqrt(d^2 + 2 a^2))) = 0.4007.
    let front_angle = 4.0 * (0.25 / (1.5 * (2.25_f64 + 0.5).sqrt())).atan();
    let corner = |x: f64, z: f64| DVec3::new(x, 0.5, z);
    let side = [corner(0.5, -0.5), corner(0.5, 0.5), corner(1.5, 0.5), corner(1.5, -0.5)];
    let sideways = vector_of_polygon(&side).y.abs();
    let mean_of_along = both * 4.0 * FRAC_1_SQRT_2 * FRAC_1_SQRT_2.atan();
    [1.0 / 6.0, mean_of_along, MEAN * lobe * front_angle, both * lobe * front, both * lobe * 2.0 * sideways]
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
            by_faces().map(|coefficient| coefficient as f32);
        let reflected = settings.float("lpv_reflection").unwrap_or(0.0) as f32;
        let most = most(settings);
        Self { mean_of_mean, mean_of_along, along_of_mean, along_of_along, across, most, reflected, first: 0 }
    }
}

/// Channels whose leaving light the adapter can hold at once: all, or each for itself.
fn channels_at_once(cells: usize, most_bytes: u64) -> usize {
    if (3 * cells * size_of::<[[f32; 4]; 2]>()) as u64 <= most_bytes.min(LEAVING_BYTES) { 3 } else { 1 }
}

/// All steps of what was left in the cells by surfaces that face one way, or by all; adds what leaves each cell through
/// its lower and its upper faces to `passed`.
///
/// # Errors
/// Those of the device; `Cancelled`.
pub(super) fn record(
    context: &mut Context<'_, '_>,
    placed: &Placed,
    side: IVec3,
    flow: &Flow,
    passed: &[Flow; 2],
) -> Result<()> {
    let cells = placed.volume.cells as usize;
    let channels = channels_at_once(cells, context.recorder.gpu().limits().max_storage_buffer_binding_size);
    let items = channels * cells;
    let x: Flow = context.resources.buffer("lpv_along_x", 2 * items)?;
    let y: Flow = context.resources.buffer("lpv_along_y", 2 * items)?;
    let z: Flow = context.resources.buffer("lpv_along_z", 2 * items)?;
    let faces = f64::from(u8::from(context.settings.is("lpv_transport", "faces")));
    let [side_x, side_y, side_z] = side.as_dvec3().to_array();
    let constants = [("FACES", faces), ("SIDE_X", side_x), ("SIDE_Y", side_y), ("SIDE_Z", side_z)];
    let leave = context.kernel_with("lpv/propagate", "leave", &constants)?;
    let arrive = context.kernel("lpv/propagate", "arrive")?;
    for first in (0..3 * cells).step_by(items) {
        let params = PropagateParams { first: first as u32, ..PropagateParams::new(context.settings) };
        for _ in 0..context.settings.int("lpv_iterations") {
            let pass = context.recorder.pass("propagate", &leave).uniform("params", &params).bind("flow", flow);
            let pass = pass.bind("along_x", &x).bind("along_y", &y).bind("along_z", &z);
            let pass = pass.bind("passed_lower", &passed[0]).bind("passed_upper", &passed[1]);
            pass.dispatch_cut(items, LEAVE_NS)?;
            let pass = context.recorder.pass("propagate", &arrive);
            let pass = pass.uniform("volume", &placed.volume).uniform("params", &params).bind("flow", flow);
            let pass = pass.bind("open", &placed.open).bind("along_x", &x).bind("along_y", &y).bind("along_z", &z);
            pass.dispatch_cut(items, ARRIVE_NS)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_keep_the_flux_and_forget_the_net_flow() {
        // By quadrature: `coefficients` in tests/passes/reference/lpv.py.
        let expected = [0.166_667, 0.239_944, 0.036_817, 0.061_659, 0.069_829];
        let faces = by_faces();
        assert!(faces.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-6), "{faces:?}");
        let [mean, .., along, across] = faces;
        assert!((6.0 * mean - 1.0).abs() < 1e-12);
        assert!(2.0 * along + 4.0 * across < 0.41, "three fifths of the net flow are forgotten in a step");
    }

    #[test]
    fn large_volumes_work_on_a_channel_at_a_time() {
        assert_eq!(channels_at_once(64 * 64 * 64, u64::MAX), 3);
        assert_eq!(channels_at_once(128 * 128 * 128, u64::MAX), 1);
        assert_eq!(channels_at_once(64 * 64 * 64, 1 << 24), 1);
    }
}
