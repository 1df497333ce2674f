//! Answers ray lists. Two forms with the same answers: WGSL on a GPU, native on a software adapter, where the CPU does
//! the work in both cases and the native form does it several times faster.
use std::ops::Range;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use rayon::prelude::*;

use super::trace_native::{Hit, Ray, TraceInstance, TraceScene};
use super::trace_wgsl::WgslTrace;
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Cancel, Gpu, Recorder};

/// Which of the two forms answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// All cores of the host, in SIMD packets.
    Native,
    /// The device.
    Wgsl,
}

/// Answers rays in the form that suits the adapter.
pub struct Tracer {
    pub(super) scene: TraceScene,
    pub(super) wgsl: Option<WgslTrace>,
}

/// Native work is cut by [`pieces`], never inside.
pub(super) static GO_ON: AtomicBool = AtomicBool::new(false);
/// Native work between two questions whether to go on takes about this long, seconds.
const PIECE_S: f64 = 0.05;
/// First piece, rays: some milliseconds.
pub(super) const FIRST_RAYS: usize = 1 << 15;
/// Pieces share no word of bits and split well over the cores.
const ALIGN: usize = 4096;

impl Tracer {
    /// Nothing to hit yet; native on a software adapter.
    ///
    /// # Errors
    /// `Device`.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Self::with_form(gpu, if gpu.software() { Form::Native } else { Form::Wgsl })
    }

    /// As [`Tracer::new`], in a form of the caller's choice.
    ///
    /// # Errors
    /// `Device`.
    pub fn with_form(gpu: &Gpu, form: Form) -> Result<Self> {
        let wgsl = if form == Form::Wgsl { Some(WgslTrace::new(gpu)?) } else { None };
        Ok(Self { scene: TraceScene::new(Vec::new()), wgsl })
    }

    /// Which form answers.
    pub fn form(&self) -> Form {
        if self.wgsl.is_some() { Form::Wgsl } else { Form::Native }
    }

    /// True when rays are answered on the host.
    pub fn native(&self) -> bool {
        self.wgsl.is_none()
    }

    /// What rays may hit from now on. Meshes that are there already are not sent again.
    ///
    /// # Errors
    /// `Device`: also when all meshes together do not fit into one binding.
    pub fn set_scene(&mut self, gpu: &Gpu, instances: Vec<TraceInstance>) -> Result<Vec<&'static str>> {
        self.scene = TraceScene::new(instances);
        match &mut self.wgsl {
            Some(wgsl) => wgsl.sync(gpu, &self.scene),
            None => Ok(Vec::new()),
        }
    }

    /// The first thing that each ray of `range` meets. Returns how many rays the host traced; those of the device are
    /// counted there, see [`Tracer::device_rays`]. `range` starts at a multiple of 2,048.
    ///
    /// # Errors
    /// `Device`, `Cancelled`.
    pub fn closest(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        rays: &Buffer<Ray>,
        hits: &Buffer<Hit>,
        range: Range<usize>,
    ) -> Result<u64> {
        if let Some(wgsl) = &self.wgsl {
            return wgsl.closest(recorder, stage, rays, hits, range).map(|()| 0);
        }
        recorder.host(stage, |gpu, cancel| {
            let rays = gpu.view(rays, range.clone())?;
            let mut answers = gpu.view_mut(hits, range.clone())?;
            pieces(cancel, range.len(), FIRST_RAYS, ALIGN, |part| {
                self.scene.closest(&rays[part.clone()], &mut answers[part], &GO_ON);
            })?;
            answers.commit(gpu)?;
            Ok(active(&rays))
        })
    }

    /// Bit `i % 32` of word `i / 32` is set when ray `i` of `range` meets anything; spare bits of the last word are
    /// cleared. As [`Tracer::closest`] otherwise.
    ///
    /// # Errors
    /// `Device`, `Cancelled`.
    pub fn any(
        &self,
        recorder: &mut Recorder<'_>,
        stage: &str,
        rays: &Buffer<Ray>,
        occluded: &Buffer<u32>,
        range: Range<usize>,
    ) -> Result<u64> {
        if let Some(wgsl) = &self.wgsl {
            return wgsl.any(recorder, stage, rays, occluded, range).map(|()| 0);
        }
        recorder.host(stage, |gpu, cancel| {
            let rays = gpu.view(rays, range.clone())?;
            let mut answers = gpu.view_mut(occluded, range.start / 32..range.end.div_ceil(32))?;
            pieces(cancel, range.len(), FIRST_RAYS, ALIGN, |part| {
                let words = part.start / 32..part.end.div_ceil(32);
                self.scene.any(&rays[part], &mut answers[words], &GO_ON);
            })?;
            answers.commit(gpu)?;
            Ok(active(&rays))
        })
    }

    /// The count of rays on the device, for whoever reads it with other things; see [`Tracer::counted`].
    pub fn counter(&self) -> Option<&Buffer<u32>> {
        self.wgsl.as_ref().map(WgslTrace::counter)
    }

    /// Rays by the words that were read of the counter, which begins anew.
    ///
    /// # Errors
    /// `Device`.
    pub fn counted(&self, gpu: &Gpu, words: &[u32]) -> Result<u64> {
        self.wgsl.as_ref().map_or(Ok(0), |wgsl| wgsl.counted(gpu, words))
    }

    /// Rays that the device traced since the last call, 0 for the native form; waits for the device, so ask once a
    /// frame, after [`Recorder::finish`].
    ///
    /// # Errors
    /// `Device`.
    pub fn device_rays(&self, gpu: &Gpu) -> Result<u64> {
        self.wgsl.as_ref().map_or(Ok(0), |wgsl| wgsl.take_rays(gpu))
    }
}

/// Runs `work` over `0..count` in pieces of about [`PIECE_S`], and asks before each whether to go on.
pub(super) fn pieces(
    cancel: Cancel<'_>,
    count: usize,
    first: usize,
    align: usize,
    mut work: impl FnMut(Range<usize>),
) -> Result<()> {
    let (mut done, mut len) = (0, first.next_multiple_of(align));
    while done < count {
        if cancel() {
            return Err(Error::Cancelled);
        }
        let part = done..(done + len).min(count);
        let started = Instant::now();
        done = part.end;
        let size = part.len();
        work(part);
        // Grow carefully: the next part of the list may be dearer.
        let wanted = size as f64 * PIECE_S / started.elapsed().as_secs_f64().max(1e-6);
        len = (wanted.min(8.0 * len as f64) as usize).next_multiple_of(align).max(align);
    }
    Ok(())
}

/// Rays that can hit something: those of `active_ray` in `shaders/common/bvh.wgsl`.
fn active(rays: &[Ray]) -> u64 {
    let usable = |ray: &&Ray| {
        let finite = ray.origin.iter().chain(&ray.direction).all(|x| x.is_finite());
        finite && ray.t_min < ray.t_max && ray.direction != [0.0; 3]
    };
    rays.par_chunks(ALIGN).map(|part| part.iter().filter(usable).count() as u64).sum()
}
