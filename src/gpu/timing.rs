//! Where the time of a frame went: GPU timestamps for passes, wall clock for host work, and the rest by name.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::error::Result;
use crate::gpu::context::{Gpu, lock};

/// WebGPU allows 4,096 queries a set: 2,048 passes, then they are read and the set is used again.
const PASSES: usize = 2048;

/// Name of what is neither a pass nor a host scope: recording, submitting, waiting.
pub(crate) const HOST: &str = "host";

/// Times of a frame. The stages add up to the total.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Times {
    /// Milliseconds by stage name, in the order of first use; a repeated stage is summed; `host` comes last.
    pub stages: Vec<(String, f64)>,
    /// Wall time from the start of the recording to its end, milliseconds.
    pub total_ms: f64,
}

impl Times {
    /// Time of the stage `name` and of all stages nested in it (`name/…`), milliseconds.
    pub fn of(&self, name: &str) -> f64 {
        let nested =
            |stage: &str| stage.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'));
        self.stages.iter().filter(|(stage, _)| nested(stage)).map(|(_, ms)| ms).sum()
    }

    fn add(&mut self, name: &str, ms: f64) {
        match self.stages.iter_mut().find(|(stage, _)| stage == name) {
            Some((_, sum)) => *sum += ms,
            None => self.stages.push((name.to_string(), ms)),
        }
    }
}

/// Timestamp queries and the buffers to read them.
struct QuerySet {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    landed: wgpu::Buffer,
}

impl QuerySet {
    fn new(device: &wgpu::Device) -> Self {
        let count = 2 * PASSES as u32;
        let bytes = 8 * u64::from(count);
        let buffer = |label, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage,
                mapped_at_creation: false,
            })
        };
        use wgpu::BufferUsages as U;
        Self {
            set: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count,
            }),
            resolved: buffer("timestamps", U::QUERY_RESOLVE | U::COPY_SRC),
            landed: buffer("timestamps read", U::MAP_READ | U::COPY_DST),
        }
    }
}

/// Query sets that no frame uses at the moment.
pub(crate) struct QueryPool {
    free: Mutex<Vec<QuerySet>>,
    nanoseconds_per_tick: Option<f64>,
    /// Timestamps are not to be trusted any more.
    stopped: AtomicBool,
}

impl QueryPool {
    pub(crate) fn new(device: &wgpu::Device, queue: &wgpu::Queue) -> Self {
        let supported = device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let period = f64::from(queue.get_timestamp_period());
        Self {
            free: Mutex::default(),
            nanoseconds_per_tick: (supported && period > 0.0).then_some(period),
            stopped: AtomicBool::new(false),
        }
    }
}

/// What a later prediction can use the time of.
pub(crate) struct Work {
    pub(crate) kernel: String,
    pub(crate) items: u64,
    /// Predicted cost of an item, nanoseconds.
    pub(crate) rate: f64,
}

/// A pass whose timestamps are not read yet.
struct Timed {
    stage: String,
    work: Option<Work>,
}

/// Collects the times of one recording.
pub(crate) struct Clock {
    started: Instant,
    times: Times,
    set: Option<QuerySet>,
    /// For each pair of queries written since the last reading.
    pending: Vec<Timed>,
    /// Their copy to the host is recorded.
    resolved: bool,
    ns_per_tick: f64,
}

impl Clock {
    pub(crate) fn new(gpu: &Gpu) -> Result<Self> {
        let started = Instant::now();
        let pool = &gpu.shared().queries;
        let set = match pool.nanoseconds_per_tick.filter(|_| !pool.stopped.load(Ordering::Relaxed)) {
            None => None,
            Some(_) => {
                let free = lock(&pool.free).pop();
                Some(match free {
                    Some(set) => set,
                    None => gpu.scoped("timestamps", || QuerySet::new(gpu.device()))?,
                })
            }
        };
        let ns_per_tick = pool.nanoseconds_per_tick.unwrap_or(0.0);
        Ok(Self { started, times: Times::default(), set, pending: Vec::new(), resolved: false, ns_per_tick })
    }

    /// True when passes carry timestamps; else each is waited for and timed by the wall clock.
    pub(crate) fn on_gpu(&self) -> bool {
        self.set.is_some()
    }

    /// True when the queries must be read before another pass is timed.
    pub(crate) fn full(&self) -> bool {
        self.pending.len() >= PASSES
    }

    /// Timestamps for a pass of that stage; `work`: where the time teaches something.
    pub(crate) fn pass(&mut self, stage: &str, work: Option<Work>) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        // The order of first use is that of recording, not of reading.
        self.times.add(stage, 0.0);
        let set = self.set.as_ref()?;
        let first = 2 * self.pending.len() as u32;
        self.pending.push(Timed { stage: stage.to_string(), work });
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &set.set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// From here on every pass is timed by the wall clock, in the frames to come as well; all passes must be done.
    pub(crate) fn stop_timestamps(&mut self, gpu: &Gpu) -> Result<()> {
        self.collect(gpu)?;
        self.set = None;
        gpu.shared().queries.stopped.store(true, Ordering::Relaxed);
        Ok(())
    }

    /// Adds a wall-clock time.
    pub(crate) fn add(&mut self, stage: &str, ms: f64) {
        self.times.add(stage, ms);
    }

    /// Records the copy of the timestamps to the host behind the passes that they belong to.
    pub(crate) fn resolve(&mut self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(set) = self.set.as_ref().filter(|_| !self.pending.is_empty() && !self.resolved) {
            let count = 2 * self.pending.len() as u32;
            encoder.resolve_query_set(&set.set, 0..count, &set.resolved, 0);
            encoder.copy_buffer_to_buffer(&set.resolved, 0, &set.landed, 0, 8 * u64::from(count));
            self.resolved = true;
        }
    }

    /// Reads the timestamps written so far; all passes must be submitted.
    pub(crate) fn collect(&mut self, gpu: &Gpu) -> Result<()> {
        if !self.resolved {
            gpu.scoped("reading timestamps", || {
                let mut encoder = gpu.device().create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
                self.resolve(&mut encoder);
                gpu.queue().submit([encoder.finish()]);
            })?;
        }
        let Some(set) = self.set.as_ref().filter(|_| self.resolved) else {
            return Ok(());
        };
        let bytes = 16 * self.pending.len() as u64;
        gpu.map(&set.landed, wgpu::MapMode::Read, 0..bytes)?;
        let read = set.landed.get_mapped_range(0..bytes).map(|view| bytemuck::pod_collect_to_vec::<u8, u64>(&view));
        set.landed.unmap();
        let read = read.map_err(|e| crate::error::Error::Device(format!("reading timestamps: {e}")))?;
        for (Timed { stage, work }, pair) in self.pending.iter().zip(read.chunks_exact(2)) {
            let ms = pair[1].saturating_sub(pair[0]) as f64 * self.ns_per_tick * 1e-6;
            self.times.add(stage, ms);
            if let Some(work) = work {
                gpu.learn(work, ms);
            }
        }
        self.pending.clear();
        self.resolved = false;
        Ok(())
    }

    /// The times, with the remainder as `host`.
    pub(crate) fn finish(mut self, gpu: &Gpu) -> Result<Times> {
        self.collect(gpu)?;
        if let Some(set) = self.set.take() {
            lock(&gpu.shared().queries.free).push(set);
        }
        let mut times = self.times;
        times.total_ms = self.started.elapsed().as_secs_f64() * 1e3;
        let known: f64 = times.stages.iter().map(|(_, ms)| ms).sum();
        times.add(HOST, (times.total_ms - known).max(0.0));
        Ok(times)
    }
}
