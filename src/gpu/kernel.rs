//! Pipelines, made at first use and kept for the life of the device.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::gpu::context::{Gpu, lock};
use crate::gpu::raster::POINTS;
use crate::gpu::reflect::{Binding, BindingKind, Reflection};
use crate::gpu::shader;

/// File, entry point and override constants: what a pipeline is known by.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct KernelKey {
    stem: String,
    entry: String,
    overrides: Vec<(String, u64)>,
    /// The text itself when it does not come from the embedded files.
    text: Option<String>,
}

/// What a kernel starts.
pub(crate) enum Pipeline {
    Compute(wgpu::ComputePipeline),
    /// Points that are added up, see `raster`.
    Points(wgpu::RenderPipeline),
}

/// A pipeline with its reflection.
pub struct Kernel {
    pub(crate) pipeline: Pipeline,
    /// Layouts by group, `None` for a group without bindings.
    pub(crate) groups: Vec<Option<wgpu::BindGroupLayout>>,
    pub(crate) reflection: Reflection,
    pub(crate) label: String,
}

impl Kernel {
    /// `file::entry (OVERRIDE=value)`, as errors name it.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Bindings, workgroup size and override constants.
    pub fn reflection(&self) -> &Reflection {
        &self.reflection
    }
}

impl Gpu {
    /// The kernel `entry` of `shaders/<stem>.wgsl`; compiled at first use, then kept.
    ///
    /// # Errors
    /// [`Error::Shader`] with file and line when it does not compile.
    pub fn kernel(&self, stem: &str, entry: &str, overrides: &[(&str, f64)]) -> Result<Arc<Kernel>> {
        self.kernel_of(stem, None, entry, overrides)
    }

    /// As [`Gpu::kernel`], from a text that may import the embedded files: for tests of shader functions.
    ///
    /// # Errors
    /// [`Error::Shader`] with file and line when it does not compile.
    pub fn kernel_from_text(
        &self,
        stem: &str,
        text: &str,
        entry: &str,
        overrides: &[(&str, f64)],
    ) -> Result<Arc<Kernel>> {
        self.kernel_of(stem, Some(text), entry, overrides)
    }

    pub(crate) fn kernel_of(
        &self,
        stem: &str,
        text: Option<&str>,
        entry: &str,
        overrides: &[(&str, f64)],
    ) -> Result<Arc<Kernel>> {
        self.check()?;
        let key = KernelKey {
            stem: stem.to_string(),
            entry: entry.to_string(),
            overrides: overrides.iter().map(|(n, v)| (n.to_string(), v.to_bits())).collect(),
            text: text.map(str::to_string),
        };
        if let Some(kernel) = lock(&self.shared().kernels).get(&key) {
            return Ok(kernel.clone());
        }
        // Not under the lock: compilation takes long, and making one twice is harmless.
        let kernel = Arc::new(match entry {
            POINTS => self.make_points(stem, overrides)?,
            _ => self.make_kernel(stem, text, entry, overrides)?,
        });
        Ok(lock(&self.shared().kernels).entry(key).or_insert(kernel).clone())
    }

    fn make_kernel(&self, stem: &str, text: Option<&str>, entry: &str, overrides: &[(&str, f64)]) -> Result<Kernel> {
        let compiled = shader::compile(stem, text)?;
        let constants: Vec<(&str, f64)> = overrides.iter().map(|&(n, value)| (compiled.full_name(n), value)).collect();
        let reflection = Reflection::of(&compiled, entry, &constants)?;
        let set: Vec<String> = overrides.iter().map(|(name, value)| format!("{name}={value}")).collect();
        let set = if set.is_empty() { String::new() } else { format!(" ({})", set.join(", ")) };
        let label = format!("{stem}::{entry}{set}");
        let threads = reflection.threads();
        let most = self.limits().max_compute_invocations_per_workgroup;
        if threads > most {
            return Err(Error::Device(format!(
                "{label} has {threads} threads a workgroup; this adapter allows {most}"
            )));
        }
        let made = self.scoped(&label, || {
            let device = self.device();
            let descriptor = wgpu::ShaderModuleDescriptor {
                label: Some(&label),
                source: wgpu::ShaderSource::Wgsl(compiled.wgsl.as_str().into()),
            };
            let mut checks = wgpu::ShaderRuntimeChecks::checked();
            checks.force_loop_bounding = text.is_some();
            // SAFETY: all checks stay but the counters that end endless loops, which the embedded shaders do not have:
            // each of their loops runs over a range or takes from a finite list.
            let module = unsafe { device.create_shader_module_trusted(descriptor, checks) };
            let groups = group_layouts(device, &label, &reflection.bindings, wgpu::ShaderStages::COMPUTE);
            let layout = pipeline_layout(device, &label, &groups);
            let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(&label),
                layout: Some(&layout),
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions { constants: &constants, ..Default::default() },
                // Drivers keep compiled code on disk themselves; within the process, `kernels` does.
                cache: None,
            });
            (Pipeline::Compute(pipeline), groups)
        });
        let (pipeline, groups) = made.map_err(as_shader_fault)?;
        Ok(Kernel { pipeline, groups, reflection, label })
    }
}

/// What goes wrong while a pipeline is made is the shader's fault.
pub(crate) fn as_shader_fault(error: Error) -> Error {
    match error {
        Error::Device(message) => Error::Shader(message),
        other => other,
    }
}

pub(crate) fn pipeline_layout(
    device: &wgpu::Device,
    label: &str,
    groups: &[Option<wgpu::BindGroupLayout>],
) -> wgpu::PipelineLayout {
    let refs: Vec<Option<&wgpu::BindGroupLayout>> = groups.iter().map(Option::as_ref).collect();
    device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(label),
        bind_group_layouts: &refs,
        immediate_size: 0,
    })
}

pub(crate) fn group_layouts(
    device: &wgpu::Device,
    label: &str,
    bindings: &[Binding],
    stages: wgpu::ShaderStages,
) -> Vec<Option<wgpu::BindGroupLayout>> {
    let count = bindings.iter().map(|b| b.group + 1).max().unwrap_or(0);
    (0..count)
        .map(|group| {
            let entries: Vec<_> =
                bindings.iter().filter(|b| b.group == group).map(|b| layout_entry(b, stages)).collect();
            (!entries.is_empty()).then(|| {
                device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                    label: Some(label),
                    entries: &entries,
                })
            })
        })
        .collect()
}

fn layout_entry(binding: &Binding, stages: wgpu::ShaderStages) -> wgpu::BindGroupLayoutEntry {
    let uniform = binding.kind == BindingKind::Uniform;
    wgpu::BindGroupLayoutEntry {
        binding: binding.binding,
        visibility: stages,
        ty: wgpu::BindingType::Buffer {
            ty: match binding.kind {
                BindingKind::Uniform => wgpu::BufferBindingType::Uniform,
                kind => wgpu::BufferBindingType::Storage { read_only: kind == BindingKind::ReadOnly },
            },
            // Uniforms are staged many to one buffer, so their place is chosen at each dispatch.
            has_dynamic_offset: uniform,
            min_binding_size: wgpu::BufferSize::new(binding.min_bytes),
        },
        count: None,
    }
}
