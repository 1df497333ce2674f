//! Volumes inside of volumes: each a cube of half the edge of the one that it lies in, with as many cells along an edge,
//! about what the camera sees.

use glam::{UVec3, Vec3};

use super::Volume;
use super::points::{Asked, Kept, Placed};
use crate::passes::View;
use crate::settings::Settings;

/// Most volumes of a frame.
pub const MOST: usize = 4;

/// Samples of a volume at most: what lies outside of it is found as well.
const MOST_SAMPLES: u32 = 1 << 18;

/// Powers of two by which samples are denser than in the volume outside: cells have a fourth of the surface.
const DENSER: u32 = 2;

/// How far ahead of the eye the middle of a volume lies, in its edges.
const AHEAD: f32 = 0.25;

impl Volume {
    /// The volume of half the edge inside of this one about what is seen from `eye` in a direction; it moves by whole cells
    /// of this one, and no further than its border. Also the cell of this one that it begins with.
    pub fn inside(&self, resolution: u32, eye: Vec3, forward: Vec3) -> (Self, UVec3) {
        let outer = UVec3::from(self.size);
        let span = UVec3::splat((resolution / 2).max(1)).min(outer);
        let reach = span.max_element() as f32;
        let middle = (eye - Vec3::from(self.corner)) / self.edge + AHEAD * reach * forward;
        let first = (middle - 0.5 * span.as_vec3()).round().clamp(Vec3::ZERO, (outer - span).as_vec3());
        let first = if first.is_finite() { first.as_uvec3() } else { UVec3::ZERO };
        let corner = Vec3::from(self.corner) + first.as_vec3() * self.edge;
        let size = 2 * span;
        let cells = size.element_product();
        (Self { corner: corner.to_array(), edge: 0.5 * self.edge, size: size.to_array(), cells }, first)
    }
}

/// What the volume inside of another is asked for.
pub fn asked(settings: &Settings, outer: &Placed, view: &View) -> (Asked, Volume) {
    let whole = Asked::of(settings);
    let (volume, first) = outer.volume.inside(whole.resolution, view.eye.into(), -Vec3::from(view.backward));
    // Samples lie all over the scene: more of them, as long as no more are inside than of the whole, both sides.
    let inside = points_inside(outer, first, UVec3::from(volume.size) / 2);
    let mut samples = outer.samples;
    for denser in 1..=DENSER {
        if inside << denser <= 2 * u64::from(whole.samples) && outer.samples << denser <= MOST_SAMPLES {
            samples = outer.samples << denser;
        }
    }
    (Asked { samples, first: Some(first.to_array()), ..whole }, volume)
}

/// Points that leave their light in some of the cells of a volume.
fn points_inside(outer: &Placed, first: UVec3, span: UVec3) -> u64 {
    let size = UVec3::from(outer.volume.size);
    let held = outer.held.iter().filter(|held| {
        let cell = UVec3::new(held.cell % size.x, held.cell / size.x % size.y, held.cell / (size.x * size.y));
        cell.cmpge(first).all() && cell.cmplt(first + span).all()
    });
    held.map(|held| u64::from(held.count)).sum()
}

/// Whether all volumes of a frame are kept.
pub fn are_kept(kept: &Kept, settings: &Settings, view: &View) -> bool {
    let Some(mut outer) = kept.placed(0, Asked::of(settings)) else { return false };
    for level in 1..settings.int("lpv_cascades") as usize {
        let (asked, _) = asked(settings, &outer, view);
        match kept.placed(level, asked) {
            Some(placed) => outer = placed,
            None => return false,
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: Volume = Volume { corner: [-2.0, 0.0, 1.0], edge: 0.5, size: [16, 9, 5], cells: 720 };

    fn eye_at(cell: Vec3) -> Vec3 {
        Vec3::from(WHOLE.corner) + WHOLE.edge * cell
    }

    #[test]
    fn cells_are_halved_on_the_same_grid() {
        for step in 0..40 {
            let eye = eye_at(Vec3::new(-3.0 + 0.6 * step as f32, 4.0, 2.0));
            let (inner, first) = WHOLE.inside(16, eye, Vec3::X);
            assert_eq!(inner.size, [16, 16, 10], "no larger than what it lies in");
            assert_eq!(inner.cells, 16 * 16 * 10);
            assert_eq!(inner.edge, 0.25);
            assert_eq!(Vec3::from(inner.corner), eye_at(first.as_vec3()));
            assert!((first + UVec3::from(inner.size) / 2).cmple(UVec3::from(WHOLE.size)).all());
        }
    }

    #[test]
    fn it_lies_ahead_of_the_eye() {
        let eye = eye_at(Vec3::new(8.0, 4.0, 2.0));
        let [ahead, back] = [Vec3::X, -Vec3::X].map(|forward| WHOLE.inside(16, eye, forward).1);
        assert_eq!((ahead.x, back.x), (6, 2), "two cells of eight each way");
        let moved = WHOLE.inside(16, eye + 0.1 * WHOLE.edge, Vec3::X).1;
        assert_eq!(ahead, moved, "by whole cells");
    }
}
