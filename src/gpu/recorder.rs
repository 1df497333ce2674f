//! Records the work of a frame in order, submits it, times it, and lets it be cancelled.

use std::time::Instant;

use bytemuck::Pod;

use crate::error::{Error, Result};
use crate::gpu::context::Gpu;
use crate::gpu::kernel::Kernel;
use crate::gpu::landing::Landing;
use crate::gpu::pass::Pass;
use crate::gpu::resource::Buffer;
use crate::gpu::staging::Staging;
use crate::gpu::timing::{Clock, Times};

/// Asked between pieces of work, from the recording thread; `true` ends the render with [`Error::Cancelled`].
pub type Cancel<'a> = &'a (dyn Fn() -> bool + Sync);

/// A check that never cancels.
pub fn never() -> Cancel<'static> {
    &|| false
}

/// Predicted time after which recorded work is submitted and the caller asked whether to go on, nanoseconds.
pub(crate) const PIECE_NS: f64 = 100e6;

/// The passes of a frame in order. Dropping it before [`Recorder::finish`] discards what was not submitted.
pub struct Recorder<'a> {
    pub(crate) gpu: Gpu,
    cancel: Cancel<'a>,
    encoder: Option<wgpu::CommandEncoder>,
    pub(crate) staging: Staging,
    pub(crate) clock: Clock,
    scope: String,
    /// Level that stages are told apart by.
    level: Option<u32>,
    /// Predicted time of what is recorded and not submitted, nanoseconds.
    pub(crate) predicted_ns: f64,
}

impl Gpu {
    /// Starts to record; `cancel` is asked between pieces of long work.
    ///
    /// # Errors
    /// [`Error::Device`] when the device cannot be used.
    pub fn record<'a>(&self, cancel: Cancel<'a>) -> Result<Recorder<'a>> {
        self.check()?;
        Ok(Recorder {
            gpu: self.clone(),
            cancel,
            encoder: None,
            staging: Staging::new(self)?,
            clock: Clock::new(self)?,
            scope: String::new(),
            level: None,
            predicted_ns: 0.0,
        })
    }
}

impl<'a> Recorder<'a> {
    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Starts a pass: `recorder.pass("gather", &kernel).bind("hits", &hits).dispatch(count)?`.
    pub fn pass<'r>(&'r mut self, stage: &str, kernel: &'r Kernel) -> Pass<'r, 'a> {
        let stage = self.stage(stage);
        Pass::new(self, stage, kernel)
    }

    /// Names of the stages inside `work` start with `scope/`.
    ///
    /// # Errors
    /// Those of `work`.
    pub fn scope<R>(&mut self, scope: &str, work: impl FnOnce(&mut Self) -> Result<R>) -> Result<R> {
        let outer = self.enter(scope);
        let result = work(self);
        self.leave(outer);
        result
    }

    /// As [`Recorder::scope`], where no closure can hold the recorder; returns the outer scope for
    /// [`Recorder::leave`].
    pub fn enter(&mut self, scope: &str) -> String {
        let inner = self.within(scope);
        std::mem::replace(&mut self.scope, inner)
    }

    /// Ends what [`Recorder::enter`] began.
    pub fn leave(&mut self, outer: String) {
        self.scope = outer;
    }

    /// Names of the stages end with `@level` from now on, or no longer.
    pub fn at_level(&mut self, level: Option<u32>) {
        self.level = level;
    }

    /// Runs host code after everything recorded so far is done; its wall time is the stage's.
    ///
    /// # Errors
    /// Those of `work`, [`Error::Device`], [`Error::Cancelled`].
    pub fn host<R>(&mut self, stage: &str, work: impl FnOnce(&Gpu, Cancel<'a>) -> Result<R>) -> Result<R> {
        self.flush()?;
        self.gpu.wait()?;
        self.check_cancel()?;
        let stage = self.stage(stage);
        let started = Instant::now();
        let result = work(&self.gpu, self.cancel);
        self.clock.add(&stage, started.elapsed().as_secs_f64() * 1e3);
        result
    }

    /// Fills a buffer with zeros, in order with the passes.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn clear<T: Pod>(&mut self, buffer: &Buffer<T>) -> Result<()> {
        let gpu = self.gpu.clone();
        let encoder = self.encoder();
        gpu.scoped(&format!("clearing {buffer:?}"), || encoder.clear_buffer(buffer.raw(), 0, None))
    }

    /// As [`Recorder::clear`], from element `first` on.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn clear_from<T: Pod>(&mut self, buffer: &Buffer<T>, first: usize) -> Result<()> {
        buffer.check_range(&(first..buffer.len()))?;
        let gpu = self.gpu.clone();
        let encoder = self.encoder();
        let offset = (first * size_of::<T>()) as u64;
        gpu.scoped(&format!("clearing {buffer:?}"), || encoder.clear_buffer(buffer.raw(), offset, None))
    }

    /// Copies the first `count` elements, in order with the passes.
    ///
    /// # Errors
    /// [`Error::Device`] when they do not fit.
    pub fn copy<T: Pod>(&mut self, from: &Buffer<T>, to: &Buffer<T>, count: usize) -> Result<()> {
        from.check_range(&(0..count))?;
        to.check_range(&(0..count))?;
        let bytes = ((count * size_of::<T>()) as u64).next_multiple_of(4);
        let gpu = self.gpu.clone();
        let encoder = self.encoder();
        gpu.scoped(&format!("copying {from:?}"), || encoder.copy_buffer_to_buffer(from.raw(), 0, to.raw(), 0, bytes))
    }

    /// Copies elements of `range` to the front of another buffer, in order with the passes.
    ///
    /// # Errors
    /// [`Error::Device`] when they do not fit.
    pub fn copy_from<T: Pod>(&mut self, from: &Buffer<T>, range: std::ops::Range<usize>, to: &Buffer<T>) -> Result<()> {
        from.check_range(&range)?;
        to.check_range(&(0..range.len()))?;
        let size = size_of::<T>();
        let (first, bytes) = ((range.start * size) as u64, (range.len() * size) as u64);
        let gpu = self.gpu.clone();
        let encoder = self.encoder();
        let copy = || encoder.copy_buffer_to_buffer(from.raw(), first, to.raw(), 0, bytes);
        gpu.scoped(&format!("copying {from:?}"), copy)
    }

    /// Submits what is recorded, without waiting for it.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn flush(&mut self) -> Result<()> {
        let Some(encoder) = self.encoder.take() else {
            return Ok(());
        };
        let (gpu, staging) = (&self.gpu, &mut self.staging);
        self.predicted_ns = 0.0;
        gpu.scoped("submitting", || {
            staging.flush(gpu.queue());
            gpu.queue().submit([encoder.finish()]);
        })?;
        if self.clock.full() {
            self.clock.collect(&self.gpu)?;
        }
        Ok(())
    }

    /// The words of some buffers after everything recorded so far: one submission and one wait.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::Cancelled`].
    pub fn fetch(&mut self, buffers: &[&Buffer<u32>]) -> Result<Vec<Vec<u32>>> {
        let gpu = self.gpu.clone();
        if buffers.iter().any(|buffer| buffer.mappable()) {
            self.flush()?;
            gpu.wait()?;
            self.check_cancel()?;
            return buffers.iter().map(|buffer| gpu.read(buffer)).collect();
        }
        let landing = Landing::of(&gpu, buffers, self.encoder())?;
        self.flush()?;
        let words = landing.look(&gpu, |parts| parts.iter().map(|part| part.to_vec()).collect())?;
        self.check_cancel()?;
        Ok(words)
    }

    /// Submits and waits for everything, and returns where the time went.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::Cancelled`].
    pub fn finish(self) -> Result<Times> {
        self.finish_and_fetch(&[]).map(|(times, _)| times)
    }

    /// As [`Recorder::finish`], with the words of some buffers, for which it need not wait again.
    ///
    /// # Errors
    /// As [`Recorder::finish`].
    pub fn finish_and_fetch(mut self, buffers: &[&Buffer<u32>]) -> Result<(Times, Vec<Vec<u32>>)> {
        let (encoder, clock) = self.parts();
        clock.resolve(encoder);
        let words = match buffers {
            [] => {
                self.flush()?;
                self.gpu.wait()?;
                self.check_cancel()?;
                Vec::new()
            }
            _ => self.fetch(buffers)?,
        };
        Ok((self.clock.finish(&self.gpu)?, words))
    }

    /// Asks the caller whether to go on.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    pub fn check_cancel(&self) -> Result<()> {
        if (self.cancel)() { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// Full name of a stage inside the current scope.
    pub(crate) fn stage(&self, name: &str) -> String {
        let stage = self.within(name);
        self.level.map_or(stage.clone(), |level| format!("{stage}@{level}"))
    }

    fn within(&self, name: &str) -> String {
        if self.scope.is_empty() { name.to_string() } else { format!("{}/{name}", self.scope) }
    }

    pub(crate) fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        let device = self.gpu.device();
        self.encoder.get_or_insert_with(|| {
            device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("frame") })
        })
    }

    /// The encoder and the clock at once.
    pub(crate) fn parts(&mut self) -> (&mut wgpu::CommandEncoder, &mut Clock) {
        self.encoder();
        let Self { encoder, clock, gpu, .. } = self;
        let device = gpu.device();
        let encoder = encoder.get_or_insert_with(|| device.create_command_encoder(&Default::default()));
        (encoder, clock)
    }
}
