//! The nearest and the farthest depth of what a camera sees, from bounds: between them lie the slices of the voxels.

use glam::{DMat4, DVec3};

use super::voxelize::Voxels;
use crate::scene::prepare::Placed;

/// Meshes of no more triangles are looked at triangle by triangle, others by their box: a room's box holds the camera.
const FEW_TRIANGLES: usize = 1024;
/// Nearest depth that counts, as a share of the farthest: slices are of equal depth, and this is less than one.
const NEAREST: f64 = 1e-3;
/// Share of depth by which rounding may move a vertex, and more.
const SLACK: f64 = 1e-5;

/// Corners of the six faces of a box whose corner k has the upper bound along axis i where bit i of k is set.
const FACES: [[usize; 4]; 6] = [[0, 2, 6, 4], [1, 3, 7, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 3, 2], [4, 5, 7, 6]];

/// Inward normals of the planes through the eye that bound the grid, along the camera's axes (right, down, depth).
fn sides(voxels: &Voxels) -> [DVec3; 4] {
    let [sx, sy] = voxels.scale.map(f64::from);
    let [cx, cy] = voxels.center.map(f64::from);
    let (columns, rows) = (f64::from(voxels.columns), f64::from(voxels.rows));
    [
        DVec3::new(sx, 0.0, cx),
        DVec3::new(-sx, 0.0, columns - cx),
        DVec3::new(0.0, sy, cy),
        DVec3::new(0.0, -sy, rows - cy),
    ]
}

/// The part of a convex polygon on the inner side of a plane through the eye [SH74].
fn cut(polygon: &[DVec3], normal: DVec3, cut: &mut Vec<DVec3>) {
    cut.clear();
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (at_a, at_b) = (normal.dot(a), normal.dot(b));
        if at_a >= 0.0 {
            cut.push(a);
        }
        if at_a * at_b < 0.0 {
            cut.push(a + (b - a) * (at_a / (at_a - at_b)));
        }
    }
}

/// Depths of what the polygon has inside the view; none where it is outside. Cut by the sides only what is before the
/// eye is left.
fn widen(range: &mut [f64; 2], polygon: &[DVec3], sides: &[DVec3; 4], room: &mut [Vec<DVec3>; 2]) {
    let [a, b] = room;
    a.clear();
    a.extend_from_slice(polygon);
    for &side in sides {
        cut(a, side, b);
        std::mem::swap(a, b);
    }
    for p in a.iter() {
        *range = [range[0].min(p.z), range[1].max(p.z)];
    }
}

/// Nearest and farthest depth of the meshes inside the view, the nearest above zero.
pub(super) fn range(voxels: &Voxels, eye_from_scene: DMat4, meshes: &[&Placed]) -> [f64; 2] {
    let sides = sides(voxels);
    let mut room = [Vec::new(), Vec::new()];
    let mut range = [f64::INFINITY, 0.0];
    for placed in meshes {
        let eye_from_object = eye_from_scene * placed.scene_from_object;
        let mesh = &placed.mesh;
        if mesh.triangles.len() <= FEW_TRIANGLES {
            for corners in &mesh.triangles {
                let corner = |v: u32| mesh.positions[v as usize].as_dvec3();
                let triangle = corners.map(|v| eye_from_object.transform_point3(corner(v)));
                widen(&mut range, &triangle, &sides, &mut room);
            }
            continue;
        }
        let [lo, hi] = mesh.bounds.map(|p| p - mesh.origin);
        let corner = |k: usize| {
            let pick = |axis: usize| if k >> axis & 1 == 1 { hi[axis] } else { lo[axis] };
            eye_from_object.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
        };
        for face in FACES {
            widen(&mut range, &face.map(corner), &sides, &mut room);
        }
        let inside = eye_from_object.inverse().transform_point3(DVec3::ZERO);
        if inside.cmpge(lo).all() && inside.cmple(hi).all() {
            range[0] = 0.0;
        }
    }
    let far = if range[1] > 0.0 { range[1] * (1.0 + SLACK) } else { 1.0 };
    let near = (range[0] * (1.0 - SLACK)).clamp(NEAREST * far, (1.0 - NEAREST) * far);
    [near, far]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn voxels() -> Voxels {
        // The view is |x| <= z and |y| <= z.
        Voxels { columns: 2, rows: 2, scale: [1.0; 2], center: [1.0; 2], ..bytemuck::Zeroable::zeroed() }
    }

    fn depths(polygon: &[DVec3]) -> [f64; 2] {
        let mut range = [f64::INFINITY, 0.0];
        widen(&mut range, polygon, &sides(&voxels()), &mut [Vec::new(), Vec::new()]);
        range
    }

    #[test]
    fn only_what_is_in_the_view_counts() {
        let floor = [(-9.0, -3.0), (9.0, -3.0), (9.0, 5.0), (-9.0, 5.0)].map(|(x, z)| DVec3::new(x, 1.0, z));
        assert_eq!(depths(&floor), [1.0, 5.0]);
        assert_eq!(depths(&floor.map(|p| p - 20.0 * DVec3::Z)), [f64::INFINITY, 0.0]);
        assert_eq!(depths(&floor.map(|p| p + 40.0 * DVec3::Y)), [f64::INFINITY, 0.0]);
    }

    #[test]
    fn an_empty_view_has_a_range_all_the_same() {
        let [near, far] = range(&voxels(), DMat4::IDENTITY, &[]);
        assert!(0.0 < near && near < far);
    }
}
