//! One dispatch as a sentence: bind by name, then dispatch.
//!
//! The shader may declare `@group(0) @binding(0) var<uniform> grid: Grid;` (`package::common::grid`); it is filled
//! here with the first item and the end of the items, so that a kernel knows its count, a dispatch of any size folds
//! into a 2-D grid, and long work is cut into pieces without a change to the shader. A uniform with a dynamic offset
//! carries it, because immediates are not there on every adapter.

use std::time::Instant;

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::gpu::bind::Group;
use crate::gpu::context::lock;
use crate::gpu::kernel::{Kernel, Pipeline};
use crate::gpu::recorder::{PIECE_NS, Recorder};
use crate::gpu::reflect::BindingKind;
use crate::gpu::resource::{Buffer, Slice, Usage};
use crate::gpu::timing::Work;

/// Name of the uniform that passes fill themselves.
pub(crate) const GRID: &str = "grid";

/// Host twin of `Grid` in `shaders/common/grid.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub(crate) struct Grid {
    first: u32,
    end: u32,
}

impl Grid {
    /// All of `items` at once.
    pub(crate) fn whole(items: u32) -> Self {
        Self { first: 0, end: items }
    }
}

/// More items would overflow the linear index of a folded grid.
const MOST_ITEMS: u64 = 1 << 31;

pub(crate) enum Bound<'r> {
    Buffer(Slice<'r>),
    Uniform(Vec<u8>),
}

/// A pass being described. Nothing is recorded before one of the `dispatch` calls.
pub struct Pass<'r, 'a> {
    pub(crate) recorder: &'r mut Recorder<'a>,
    pub(crate) stage: String,
    pub(crate) kernel: &'r Kernel,
    pub(crate) bound: Vec<(String, Bound<'r>)>,
    /// Items whose time the next prediction may use, and what this one was.
    work: Option<(u64, f64)>,
}

/// Workgroups along x and y for `groups` of them, none above `most`.
pub(crate) fn fold(groups: u64, most: u32) -> Option<[u32; 2]> {
    let most = u64::from(most);
    let rows = groups.div_ceil(most).max(1);
    if rows > most {
        return None;
    }
    // The last row is filled as far as possible, so that little more than `groups` start.
    Some([groups.div_ceil(rows) as u32, rows as u32])
}

impl<'r, 'a> Pass<'r, 'a> {
    pub(crate) fn new(recorder: &'r mut Recorder<'a>, stage: String, kernel: &'r Kernel) -> Self {
        Self { recorder, stage, kernel, bound: Vec::new(), work: None }
    }

    /// Binds a buffer, or a part of one, to the variable `name` of the shader.
    #[must_use]
    pub fn bind(mut self, name: &str, buffer: impl Into<Slice<'r>>) -> Self {
        self.bound.push((name.to_string(), Bound::Buffer(buffer.into())));
        self
    }

    /// Gives the uniform `name` a value for this dispatch.
    #[must_use]
    pub fn uniform<T: Pod>(mut self, name: &str, value: &T) -> Self {
        self.bound.push((name.to_string(), Bound::Uniform(bytemuck::bytes_of(value).to_vec())));
        self
    }

    /// Starts `threads` threads (rounded up to whole workgroups).
    ///
    /// # Errors
    /// [`Error::Shader`] for a missing, unknown, doubled or ill-fitting binding; [`Error::Device`];
    /// [`Error::Cancelled`].
    pub fn dispatch(mut self, threads: usize) -> Result<()> {
        self.recorder.check_cancel()?;
        self.piece(0, threads as u64)
    }

    /// Starts `groups` workgroups; the end of `grid` is their number.
    ///
    /// # Errors
    /// As [`Pass::dispatch`].
    pub fn dispatch_groups(mut self, groups: usize) -> Result<()> {
        self.recorder.check_cancel()?;
        self.groups(0, groups as u64, groups as u64)
    }

    /// Starts as many workgroups as three `u32` at element `first` of `arguments` say (`dispatch_size` of
    /// `common/grid.wgsl` writes them). The end of `grid` is unknown and set to the largest number.
    ///
    /// # Errors
    /// As [`Pass::dispatch`].
    pub fn dispatch_indirect(mut self, arguments: &Buffer<u32>, first: usize) -> Result<()> {
        self.recorder.check_cancel()?;
        arguments.check_range(&(first..first.saturating_add(3)))?;
        let slice = Slice::from(arguments);
        if slice.usage != Usage::Indirect {
            return Err(self.fault(&format!("{arguments:?} holds dispatch arguments and needs Usage::Indirect")));
        }
        self.record(Grid { first: 0, end: u32::MAX }, |pass| {
            pass.dispatch_workgroups_indirect(slice.raw, 4 * first as u64);
        })
    }

    /// Starts `items` threads in pieces that take about 0.1 s at most; `ns_per_item` is a first estimate, what was
    /// measured replaces it. Between pieces the caller's cancel check is asked.
    ///
    /// # Errors
    /// As [`Pass::dispatch`].
    pub fn dispatch_cut(mut self, items: usize, ns_per_item: f64) -> Result<()> {
        if self.kernel.reflection.binding(GRID).is_none() {
            return Err(self.fault("is cut into pieces and must read `grid`"));
        }
        let learnt = lock(&self.recorder.gpu.shared().rates).get(self.kernel.label()).copied();
        let rate = learnt.unwrap_or(ns_per_item).max(1e-3);
        let predicted = rate * items as f64;
        self.recorder.check_cancel()?;
        if predicted <= PIECE_NS {
            if self.recorder.predicted_ns + predicted > PIECE_NS {
                self.recorder.flush()?;
                self.recorder.gpu.wait()?;
                self.recorder.check_cancel()?;
            }
            self.recorder.predicted_ns += predicted;
            self.work = Some((items as u64, rate));
            return self.piece(0, items as u64);
        }
        self.recorder.flush()?;
        self.recorder.gpu.wait()?;
        // A mere guess may be far off: begin with an eighth of a piece.
        self.pieces(items as u64, rate, if learnt.is_some() { PIECE_NS } else { PIECE_NS / 8.0 })
    }

    fn pieces(&mut self, items: u64, mut rate: f64, first_ns: f64) -> Result<()> {
        let step = u64::from(self.kernel.reflection.threads());
        let (mut done, mut piece_ns) = (0, first_ns);
        while done < items {
            self.recorder.check_cancel()?;
            let count = ((piece_ns / rate) as u64).max(1).next_multiple_of(step).min(items - done);
            let started = Instant::now();
            self.piece(done, done + count)?;
            self.recorder.flush()?;
            self.recorder.gpu.wait()?;
            let measured = started.elapsed().as_secs_f64() * 1e9 / count as f64;
            // One piece may be cheap and the next dear (sky, then leaves): let the prediction sink slowly.
            rate = if measured > rate { measured } else { (0.5 * (rate + measured)).max(rate / 8.0) };
            piece_ns = PIECE_NS;
            done += count;
        }
        lock(&self.recorder.gpu.shared().rates).insert(self.kernel.label().to_string(), rate);
        Ok(())
    }

    fn piece(&mut self, first: u64, end: u64) -> Result<()> {
        let threads = u64::from(self.kernel.reflection.threads());
        self.groups(first, end, (end - first).div_ceil(threads))
    }

    fn groups(&mut self, first: u64, end: u64, groups: u64) -> Result<()> {
        let most = self.recorder.gpu.limits().max_compute_workgroups_per_dimension;
        let shape = fold(groups, most).filter(|_| end < MOST_ITEMS);
        let Some([x, y]) = shape else {
            return Err(self.fault(&format!("{end} items are more than one dispatch can take ({MOST_ITEMS})")));
        };
        self.record(Grid { first: first as u32, end: end as u32 }, |pass| pass.dispatch_workgroups(x, y, 1))
    }

    fn record(&mut self, grid: Grid, dispatch: impl FnOnce(&mut wgpu::ComputePass<'_>)) -> Result<()> {
        let kernel = self.kernel;
        let Pipeline::Compute(pipeline) = &kernel.pipeline else {
            return Err(self.fault("draws points and cannot be dispatched"));
        };
        let groups = self.bound_groups(grid)?;
        let gpu = self.recorder.gpu.clone();
        let stage = self.stage.clone();
        let started = Instant::now();
        let work = self.work.map(|(items, rate)| Work { kernel: kernel.label().to_string(), items, rate });
        let (encoder, clock) = self.recorder.parts();
        gpu.scoped(&format!("pass {stage:?}"), || {
            let timestamp_writes = clock.pass(&stage, work);
            let descriptor = wgpu::ComputePassDescriptor { label: Some(&stage), timestamp_writes };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            pass.set_pipeline(pipeline);
            for (index, group) in groups.iter().enumerate() {
                if let Some((group, offsets)) = group {
                    pass.set_bind_group(index as u32, group, offsets);
                }
            }
            dispatch(&mut pass);
        })?;
        self.recorded(started)
    }

    /// The bind groups of a pass that is about to be recorded, its bindings checked.
    pub(crate) fn bound_groups(&mut self, grid: Grid) -> Result<Vec<Option<Group>>> {
        self.check_bindings()?;
        let uniforms = self.kernel.reflection.bindings.iter().filter(|b| b.kind == BindingKind::Uniform);
        if !self.recorder.staging.fits(uniforms.map(|b| b.min_bytes as usize)) {
            self.recorder.flush()?;
        }
        self.bind_groups(grid)
    }

    /// What follows the recording of a pass that began at `started`, so that its time is known.
    pub(crate) fn recorded(&mut self, started: Instant) -> Result<()> {
        if self.recorder.clock.full() {
            self.recorder.flush()?;
        } else if !self.recorder.clock.on_gpu() {
            // Without timestamps the only honest time is that of the pass alone.
            self.recorder.flush()?;
            self.recorder.gpu.wait()?;
            self.recorder.clock.add(&self.stage, started.elapsed().as_secs_f64() * 1e3);
        }
        Ok(())
    }

    pub(crate) fn fault(&self, message: &str) -> Error {
        Error::Shader(format!("pass {:?} ({}) {message}", self.stage, self.kernel.label()))
    }
}
