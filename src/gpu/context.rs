//! The device: which adapter, with which limits, and how its failures become errors.

use std::collections::HashMap;
use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use crate::error::{Error, Result};
use crate::gpu::kernel::{Kernel, KernelKey};
use crate::gpu::timing::{QueryPool, Work};

/// A submission that takes longer than this counts as a hang. Pieces are cut to about 0.1 s, so it
/// leaves three orders of magnitude for machines that are slower or busy.
const HANG: Duration = Duration::from_secs(120);
/// So long a thread asks whether the device is done before it sleeps.
const SPIN: Duration = Duration::from_millis(2);

/// What is known of an adapter before a device is made of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AdapterFacts {
    /// Name as the driver reports it.
    pub name: String,
    /// Graphics interface, e.g. `vulkan`.
    pub backend: String,
    /// Driver name and version.
    pub driver: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub device_type: &'static str,
}

impl AdapterFacts {
    fn of(info: &wgpu::AdapterInfo) -> Self {
        Self {
            name: info.name.clone(),
            backend: info.backend.to_string(),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_string(),
            device_type: match info.device_type {
                wgpu::DeviceType::DiscreteGpu => "discrete",
                wgpu::DeviceType::IntegratedGpu => "integrated",
                wgpu::DeviceType::VirtualGpu => "virtual",
                wgpu::DeviceType::Cpu => "software",
                wgpu::DeviceType::Other => "other",
            },
        }
    }

    /// True when the adapter computes on the CPU.
    pub fn software(&self) -> bool {
        self.device_type == "software"
    }

    /// Order of preference: lower is better.
    fn rank(&self) -> u32 {
        match self.device_type {
            "discrete" => 0,
            "integrated" => 1,
            "virtual" => 2,
            "other" => 3,
            _ => 4,
        }
    }
}

fn instance() -> wgpu::Instance {
    wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle())
}

fn enumerate(instance: &wgpu::Instance) -> Vec<wgpu::Adapter> {
    let found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let computes = wgpu::DownlevelFlags::COMPUTE_SHADERS;
    found.into_iter().filter(|a| a.get_downlevel_capabilities().flags.contains(computes)).collect()
}

/// All adapters of this machine that can run compute shaders.
pub fn adapters() -> Vec<AdapterFacts> {
    enumerate(&instance()).iter().map(|a| AdapterFacts::of(&a.get_info())).collect()
}

/// Picks an adapter: `"auto"` (discrete, integrated, virtual, then software), `"gpu"` (no software),
/// `"cpu"` (software only) or a part of its name, in any case. Pure, so that it is tested without one.
///
/// # Errors
/// [`Error::Device`] with the list of adapters when none fits.
pub fn choose(adapters: &[AdapterFacts], wanted: &str) -> Result<usize> {
    let needle = wanted.to_lowercase();
    let fits = |a: &AdapterFacts| match needle.as_str() {
        "auto" => true,
        "gpu" => !a.software(),
        "cpu" => a.software(),
        name => !name.is_empty() && a.name.to_lowercase().contains(name),
    };
    let best = adapters.iter().enumerate().filter(|(_, a)| fits(a)).min_by_key(|(_, a)| a.rank());
    best.map(|(index, _)| index).ok_or_else(|| {
        let list: Vec<String> =
            adapters.iter().map(|a| format!("\"{}\" ({}, {})", a.name, a.device_type, a.backend)).collect();
        let list = if list.is_empty() { "none".to_string() } else { list.join(", ") };
        Error::Device(format!(
            "no adapter fits adapter={wanted:?}; use \"auto\", \"gpu\", \"cpu\" or a part of a name; \
             this machine has: {list}"
        ))
    })
}

/// A device and all that is made once for it. Cheap to clone, shared by threads.
#[derive(Clone)]
pub struct Gpu(Arc<Shared>);

pub(crate) struct Shared {
    device: ManuallyDrop<wgpu::Device>,
    queue: ManuallyDrop<wgpu::Queue>,
    facts: AdapterFacts,
    limits: wgpu::Limits,
    features: wgpu::Features,
    pid: u32,
    lost: Arc<Mutex<Option<String>>>,
    stray: Arc<Mutex<Option<String>>>,
    pub(crate) kernels: Mutex<HashMap<KernelKey, Arc<Kernel>>>,
    pub(crate) queries: QueryPool,
    /// What copies to the host land in, kept: drivers take milliseconds to make a large one.
    pub(crate) landing: Mutex<Option<wgpu::Buffer>>,
    pub(crate) allocated: Arc<AtomicU64>,
    /// Measured cost of an item of a kernel, nanoseconds: better than the caller's estimate.
    pub(crate) rates: Mutex<HashMap<String, f64>>,
}

impl Drop for Shared {
    fn drop(&mut self) {
        // In a forked child the driver's threads do not exist, and its destructors would wait for
        // them forever: leak there.
        if self.pid == std::process::id() {
            // SAFETY: dropped once, here, and not used afterwards.
            unsafe {
                ManuallyDrop::drop(&mut self.queue);
                ManuallyDrop::drop(&mut self.device);
            }
        }
    }
}

/// A lock whose poisoning is ignored: what it guards is valid after any panic.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

fn wanted_features(adapter: &wgpu::Adapter, software: bool) -> wgpu::Features {
    let mut wanted = wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::FLOAT32_BLENDABLE;
    if software {
        // Its memory is ours: buffers that both sides use need no copies.
        wanted |= wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;
    }
    adapter.features() & wanted
}

impl Gpu {
    /// Opens the adapter that [`choose`] picks, with all its limits.
    ///
    /// # Errors
    /// [`Error::Device`] when no adapter fits or the driver refuses.
    pub fn new(wanted: &str) -> Result<Self> {
        let instance = instance();
        let found = enumerate(&instance);
        let facts: Vec<_> = found.iter().map(|a| AdapterFacts::of(&a.get_info())).collect();
        let index = choose(&facts, wanted)?;
        let (adapter, facts) = (&found[index], facts[index].clone());
        let features = wanted_features(adapter, facts.software());
        let limits = adapter.limits();
        let request = adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("miplight"),
            required_features: features,
            required_limits: limits.clone(),
            ..Default::default()
        });
        let (device, queue) = pollster::block_on(request)
            .map_err(|e| Error::Device(format!("the adapter \"{}\" cannot be opened: {e}", facts.name)))?;
        let (lost, stray) = watch(&device);
        Ok(Self(Arc::new(Shared {
            queries: QueryPool::new(&device, &queue),
            device: ManuallyDrop::new(device),
            queue: ManuallyDrop::new(queue),
            facts,
            limits,
            features,
            pid: std::process::id(),
            lost,
            stray,
            kernels: Mutex::default(),
            landing: Mutex::default(),
            allocated: Arc::default(),
            rates: Mutex::default(),
        })))
    }

    /// Fails when the device cannot be used any more: lost, closed, or inherited through `fork`.
    ///
    /// # Errors
    /// [`Error::Device`] that says which.
    pub fn check(&self) -> Result<()> {
        if self.0.pid != std::process::id() {
            return Err(Error::Device(
                "the renderer was made before fork() and cannot be used in the child process; \
                 make a new one there (or use the \"spawn\" start method)"
                    .to_string(),
            ));
        }
        if let Some(reason) = lock(&self.0.lost).as_ref() {
            return Err(Error::Device(format!("the device is lost: {reason}")));
        }
        match lock(&self.0.stray).take() {
            Some(message) => Err(Error::Device(message)),
            None => Ok(()),
        }
    }

    /// Runs `work` inside error scopes; any validation, memory or internal error of wgpu comes back as an error that
    /// starts with `what`.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub fn scoped<R>(&self, what: &str, work: impl FnOnce() -> R) -> Result<R> {
        self.check()?;
        let device = self.device();
        let internal = device.push_error_scope(wgpu::ErrorFilter::Internal);
        let memory = device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = device.push_error_scope(wgpu::ErrorFilter::Validation);
        let result = work();
        // Scopes are popped innermost first; the futures are ready at once on native backends.
        let errors = [
            pollster::block_on(validation.pop()),
            pollster::block_on(memory.pop()),
            pollster::block_on(internal.pop()),
        ];
        match errors.into_iter().flatten().next() {
            Some(error) => Err(Error::Device(describe(what, &error))),
            None => Ok(result),
        }
    }

    /// Waits until everything submitted so far is done.
    ///
    /// # Errors
    /// [`Error::Device`] when the device is lost or does not answer for two minutes.
    pub fn wait(&self) -> Result<()> {
        self.wait_for(None)
    }

    pub(crate) fn wait_for(&self, index: Option<wgpu::SubmissionIndex>) -> Result<()> {
        self.check()?;
        if index.is_none() && self.spin()? {
            return self.check();
        }
        let poll = wgpu::PollType::Wait { submission_index: index, timeout: Some(HANG) };
        let polled = self.scoped("waiting for the device", || self.device().poll(poll))?;
        self.check()?;
        polled
            .map(|_| ())
            .map_err(|e| Error::Device(format!("the device did not answer for {} s: {e}", HANG.as_secs())))
    }

    /// Asks for a moment again and again whether everything is done; whoever sleeps is woken late, and a frame waits a
    /// dozen times. A software adapter needs the cores itself.
    fn spin(&self) -> Result<bool> {
        let started = Instant::now();
        while !self.software() && started.elapsed() < SPIN {
            let polled = self.scoped("waiting for the device", || self.device().poll(wgpu::PollType::Poll))?;
            if polled.is_ok_and(|status| status.is_queue_empty()) {
                return Ok(true);
            }
            std::hint::spin_loop();
        }
        Ok(false)
    }

    /// Destroys the device; every later use is an [`Error::Device`].
    pub fn close(&self) {
        lock(&self.0.lost).get_or_insert_with(|| "it was closed".to_string());
        if self.0.pid == std::process::id() {
            self.0.device.destroy();
        }
    }

    /// The adapter's facts.
    pub fn facts(&self) -> &AdapterFacts {
        &self.0.facts
    }

    /// True when the adapter computes on the CPU.
    pub fn software(&self) -> bool {
        self.0.facts.software()
    }

    /// The limits of the device: those of the adapter.
    pub fn limits(&self) -> &wgpu::Limits {
        &self.0.limits
    }

    /// Features that were there and are used.
    pub fn features(&self) -> wgpu::Features {
        self.0.features
    }

    /// True when storage buffers can be lent to host code without a copy.
    pub fn mappable(&self) -> bool {
        self.0.features.contains(wgpu::Features::MAPPABLE_PRIMARY_BUFFERS)
    }

    /// True when floats of 32 bits can be added up by blending.
    pub fn can_blend_floats(&self) -> bool {
        self.0.features.contains(wgpu::Features::FLOAT32_BLENDABLE)
    }

    /// Bytes in buffers that are alive now.
    pub fn allocated_bytes(&self) -> u64 {
        self.0.allocated.load(Ordering::Relaxed)
    }

    /// The limits worth reporting, by name.
    pub fn limits_report(&self) -> Vec<(&'static str, u64)> {
        let l = &self.0.limits;
        vec![
            ("max_buffer_size", l.max_buffer_size),
            ("max_storage_buffer_binding_size", l.max_storage_buffer_binding_size),
            ("max_storage_buffers_per_shader_stage", l.max_storage_buffers_per_shader_stage.into()),
            ("max_compute_workgroups_per_dimension", l.max_compute_workgroups_per_dimension.into()),
            ("max_compute_invocations_per_workgroup", l.max_compute_invocations_per_workgroup.into()),
            ("max_texture_dimension_2d", l.max_texture_dimension_2d.into()),
        ]
    }

    /// The wgpu device, for what this base does not cover.
    pub fn device(&self) -> &wgpu::Device {
        &self.0.device
    }

    /// The wgpu queue, for what this base does not cover.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.0.queue
    }

    /// Notes what an item of a kernel costs. Times below a millisecond say more about starting a pass than about items,
    /// but that no item costs more than its part of one.
    pub(crate) fn learn(&self, work: &Work, ms: f64) {
        let rate = ms.max(1.0) * 1e6 / work.items.max(1) as f64;
        if ms >= 1.0 || rate < work.rate {
            lock(&self.0.rates).insert(work.kernel.clone(), rate);
        }
    }

    pub(crate) fn shared(&self) -> &Shared {
        &self.0
    }
}

type Message = Arc<Mutex<Option<String>>>;

/// Records device loss and errors outside scopes instead of panicking, which is wgpu's default.
fn watch(device: &wgpu::Device) -> (Message, Message) {
    let (lost, stray) = (Message::default(), Message::default());
    let (lost_in, stray_in) = (lost.clone(), stray.clone());
    device.set_device_lost_callback(move |reason, message| {
        lock(&lost_in).get_or_insert_with(|| format!("{reason:?}: {message}"));
    });
    device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
        lock(&stray_in).get_or_insert_with(|| describe("the device reported", &error));
    }));
    (lost, stray)
}

fn describe(what: &str, error: &wgpu::Error) -> String {
    match error {
        wgpu::Error::OutOfMemory { .. } => format!("{what}: out of device memory"),
        other => format!("{what}: {other}"),
    }
}
