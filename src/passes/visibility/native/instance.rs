//! An instance as the traversal wants it.
use super::super::trace_native::TraceInstance;
use crate::scene::bvh::{Blas, Bounds};
use glam::{Mat3A, Vec3, Vec3A};
use std::sync::Arc;

/// A mesh with what a ray needs to enter it.
#[derive(Debug)]
pub(crate) struct Placed {
    /// Triangles in object space.
    pub(crate) blas: Arc<Blas>,
    /// Rows of the linear part of `object_from_scene`.
    pub(crate) rows: [[f32; 3]; 3],
    /// The object's origin in scene space.
    pub(crate) center: [f32; 3],
    /// The linear part is the identity: directions stay as they are.
    pub(crate) identity: bool,
    /// Largest absolute object-space coordinate: scale of the box margin.
    pub(crate) reach: f32,
    /// Scene-space box.
    pub(crate) bounds: Bounds,
    /// |scene_from_object| · |object_from_scene| · 1: how much an object-space rounding grows on the way back.
    growth: Vec3,
}

/// Sum of absolute row entries.
fn row_sums(m: &Mat3A) -> Vec3A {
    m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()
}

impl Placed {
    /// Derives everything once per scene.
    pub(crate) fn new(instance: TraceInstance) -> Self {
        let TraceInstance { object_from_scene, scene_from_object, blas } = instance;
        let (inverse, forward) = (object_from_scene.matrix3, scene_from_object.matrix3);
        let center = scene_from_object.translation;
        let usable = inverse.is_finite() && scene_from_object.is_finite() && inverse.determinant() != 0.0;
        let object = blas.bounds();
        let bounds = if usable && !object.is_empty() {
            let middle = (object.lo + object.hi) * 0.5;
            let half = Vec3A::from(object.hi - middle).max(Vec3A::from(middle - object.lo));
            let abs = Mat3A::from_cols(forward.x_axis.abs(), forward.y_axis.abs(), forward.z_axis.abs());
            let (m, h) = (forward * Vec3A::from(middle) + center, abs * half);
            Bounds { lo: (m - h).into(), hi: (m + h).into() }
        } else {
            Bounds::EMPTY
        };
        let abs = Mat3A::from_cols(forward.x_axis.abs(), forward.y_axis.abs(), forward.z_axis.abs());
        let rows = inverse.transpose();
        Self {
            reach: object.max_abs(),
            rows: [rows.x_axis.into(), rows.y_axis.into(), rows.z_axis.into()],
            center: center.into(),
            identity: inverse == Mat3A::IDENTITY,
            bounds,
            growth: Vec3::from(abs * row_sums(&inverse)),
            blas,
        }
    }

    /// Scene-space box with a margin for the roundings of the transform, in a scene that reaches `reach` from the middle.
    pub(crate) fn padded_bounds(&self, reach: f32) -> Bounds {
        if self.bounds.is_empty() || !self.growth.is_finite() {
            return Bounds::EMPTY;
        }
        let pad = self.growth * (reach * 2.0_f32.powi(-21));
        Bounds { lo: self.bounds.lo - pad, hi: self.bounds.hi + pad }
    }
}
