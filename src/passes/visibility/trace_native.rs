//! stub
use super::{Hit, Ray, Receiver};
use crate::scene::bvh::Blas;
use glam::DMat4;
use std::sync::Arc;
pub struct SampleTable<'a> {
    pub points: &'a [[f32; 4]],
    pub strata: u32,
    pub light_normal: [f32; 3],
    pub two_sided: bool,
    pub cone_axis: [f32; 3],
    pub cos_cutoff: f32,
}
pub struct TraceInstance {
    pub scene_from_object: DMat4,
    pub blas: Arc<Blas>,
}
pub struct TraceScene;
impl TraceScene {
    pub fn new(_i: Vec<TraceInstance>) -> Self {
        Self
    }
    pub fn closest(&self, _r: &[Ray], hits: &mut [Hit], _c: &(dyn Fn() -> bool + Sync)) {
        for h in hits {
            *h = Hit { t: 0.0, u: 0.0, v: 0.0, instance: u32::MAX, triangle: u32::MAX };
        }
    }
    pub fn any(&self, _r: &[Ray], bits: &mut [u32], _c: &(dyn Fn() -> bool + Sync)) {
        bits.fill(0);
    }
    pub fn shadow(
        &self,
        _r: &[Receiver],
        _t: &SampleTable<'_>,
        bits: &mut [u32],
        _c: &(dyn Fn() -> bool + Sync),
    ) -> u64 {
        bits.fill(u32::MAX);
        0
    }
}
