//! Points that are drawn into a target of floats and added up there.
//!
//! Blending adds them in the order of the primitives at each pixel, which every API guarantees, so that the sums have the
//! same bits each run, as no order of atomic adds would.

use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

use crate::error::{Error, Result};
use crate::gpu::context::{Gpu, lock};
use crate::gpu::kernel::{Kernel, Pipeline, as_shader_fault, group_layouts, pipeline_layout};
use crate::gpu::pass::{Grid, Pass};
use crate::gpu::recorder::{PIECE_NS, Recorder};
use crate::gpu::reflect::Reflection;
use crate::gpu::resource::Buffer;
use crate::gpu::shader;

/// Entry point by which a kernel of points is known; its stages are `vertex` and `fragment`.
pub(crate) const POINTS: &str = "vertex + fragment";
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;
/// Bytes of a texel.
const TEXEL: u32 = 16;
/// Rows of a copied texture begin at multiples of so many bytes.
const ROW_BYTES: u32 = 256;

/// Four floats a pixel, added up by draws.
pub struct Target {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    width: u32,
    height: u32,
}

impl Target {
    /// Width, a multiple of 16, and height in pixels.
    ///
    /// # Errors
    /// `Device` when it is larger than the adapter allows.
    pub fn new(gpu: &Gpu, width: u32, height: u32) -> Result<Self> {
        let most = gpu.limits().max_texture_dimension_2d;
        if width.max(height) > most || !(width * TEXEL).is_multiple_of(ROW_BYTES) {
            return Err(Error::Device(format!(
                "a target of {width} x {height} pixels; this adapter allows {most} (max_texture_dimension_2d), and rows \
                 are multiples of 16"
            )));
        }
        gpu.scoped("a target of points", || {
            let texture = gpu.device().create_texture(&wgpu::TextureDescriptor {
                label: Some("points"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: FORMAT,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
            Self { texture, view, width, height }
        })
    }
}

impl Gpu {
    /// The kernel of points of `shaders/<stem>.wgsl`; compiled at first use, then kept.
    ///
    /// # Errors
    /// `Shader` with file and line when it does not compile.
    pub fn points(&self, stem: &str, overrides: &[(&str, f64)]) -> Result<Arc<Kernel>> {
        self.kernel_of(stem, None, POINTS, overrides)
    }

    pub(crate) fn make_points(&self, stem: &str, overrides: &[(&str, f64)]) -> Result<Kernel> {
        let compiled = shader::compile(stem, None)?;
        let constants: Vec<(&str, f64)> = overrides.iter().map(|&(n, value)| (compiled.full_name(n), value)).collect();
        let reflection = Reflection::of_points(&compiled, "vertex", "fragment")?;
        let label = format!("{stem}::{POINTS}");
        let made = self.scoped(&label, || {
            let device = self.device();
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(&label),
                source: wgpu::ShaderSource::Wgsl(compiled.wgsl.as_str().into()),
            });
            let groups = group_layouts(device, &label, &reflection.bindings, wgpu::ShaderStages::VERTEX_FRAGMENT);
            let pipeline = pipeline(device, &label, &module, &groups, &constants);
            (Pipeline::Points(pipeline), groups)
        });
        let (pipeline, groups) = made.map_err(as_shader_fault)?;
        Ok(Kernel { pipeline, groups, reflection, label })
    }
}

fn pipeline(
    device: &wgpu::Device,
    label: &str,
    module: &wgpu::ShaderModule,
    groups: &[Option<wgpu::BindGroupLayout>],
    constants: &[(&str, f64)],
) -> wgpu::RenderPipeline {
    let layout = pipeline_layout(device, label, groups);
    let add = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    };
    let target = wgpu::ColorTargetState {
        format: FORMAT,
        blend: Some(wgpu::BlendState { color: add, alpha: add }),
        write_mask: wgpu::ColorWrites::ALL,
    };
    let options = || wgpu::PipelineCompilationOptions { constants, ..Default::default() };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(label),
        layout: Some(&layout),
        vertex: wgpu::VertexState { module, entry_point: Some("vertex"), compilation_options: options(), buffers: &[] },
        primitive: wgpu::PrimitiveState { topology: wgpu::PrimitiveTopology::PointList, ..Default::default() },
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some("fragment"),
            compilation_options: options(),
            targets: &[Some(target)],
        }),
        multiview_mask: None,
        cache: None,
    })
}

impl Pass<'_, '_> {
    /// Draws `vertices` points for each of `instances`, in their order, and adds them to what the target holds, zero at
    /// first; in pieces that take about 0.1 s at most, `ns_per_point` being a first estimate.
    ///
    /// # Errors
    /// As [`Pass::dispatch`].
    pub fn draw_cut(mut self, target: &Target, vertices: u32, instances: Range<u32>, ns_per_point: f64) -> Result<()> {
        let learnt = lock(&self.recorder.gpu.shared().rates).get(self.kernel.label()).copied();
        let mut rate = learnt.unwrap_or(ns_per_point).max(1e-3);
        let mut first = instances.start;
        loop {
            self.recorder.check_cancel()?;
            let fits = (PIECE_NS / (rate * f64::from(vertices.max(1)))) as u32;
            let end = first.saturating_add(fits.max(1)).min(instances.end);
            let started = Instant::now();
            self.draw(target, vertices, first..end, first == instances.start)?;
            if end == instances.end && first == instances.start {
                return Ok(());
            }
            self.recorder.flush()?;
            self.recorder.gpu.wait()?;
            let points = f64::from(vertices) * f64::from(end - first);
            rate = (started.elapsed().as_secs_f64() * 1e9 / points.max(1.0)).max(1e-3);
            if end == instances.end {
                lock(&self.recorder.gpu.shared().rates).insert(self.kernel.label().to_string(), rate);
                return Ok(());
            }
            first = end;
        }
    }

    fn draw(&mut self, target: &Target, vertices: u32, instances: Range<u32>, clear: bool) -> Result<()> {
        let kernel = self.kernel;
        let Pipeline::Points(pipeline) = &kernel.pipeline else {
            return Err(self.fault("computes and cannot be drawn"));
        };
        self.recorder.time_by_the_wall()?;
        let groups = self.bound_groups(Grid::whole(vertices))?;
        let (gpu, stage, started) = (self.recorder.gpu.clone(), self.stage.clone(), Instant::now());
        let (encoder, clock) = self.recorder.parts();
        gpu.scoped(&format!("points {stage:?}"), || {
            let timestamps = clock.pass(&stage, None).map(|writes| wgpu::RenderPassTimestampWrites {
                query_set: writes.query_set,
                beginning_of_pass_write_index: writes.beginning_of_pass_write_index,
                end_of_pass_write_index: writes.end_of_pass_write_index,
            });
            let load = if clear { wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT) } else { wgpu::LoadOp::Load };
            let attachment = wgpu::RenderPassColorAttachment {
                view: &target.view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
            };
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(&stage),
                color_attachments: &[Some(attachment)],
                depth_stencil_attachment: None,
                timestamp_writes: timestamps,
                occlusion_query_set: None,
                multiview_mask: None,
            });
            pass.set_pipeline(pipeline);
            for (index, group) in groups.iter().enumerate() {
                if let Some((group, offsets)) = group {
                    pass.set_bind_group(index as u32, group, offsets);
                }
            }
            pass.draw(0..vertices, instances);
        })?;
        self.recorded(started)
    }
}

impl Recorder<'_> {
    /// Ends timestamps on a software adapter, for as long as the device lives: once something was drawn, Mesa's writes those
    /// of compute passes too when the drawing is flushed, and every pass seems to take no time.
    fn time_by_the_wall(&mut self) -> Result<()> {
        if !self.gpu.software() || !self.clock.on_gpu() {
            return Ok(());
        }
        self.flush()?;
        self.gpu.wait()?;
        self.clock.stop_timestamps(&self.gpu)
    }

    /// Copies a target to a buffer, row by row, in order with the passes.
    ///
    /// # Errors
    /// `Device` when it does not fit.
    pub fn copy_target(&mut self, target: &Target, to: &Buffer<[f32; 4]>) -> Result<()> {
        let Target { width, height, .. } = *target;
        to.check_range(&(0..(width * height) as usize))?;
        let gpu = self.gpu.clone();
        let encoder = self.encoder();
        gpu.scoped(&format!("copying points to {to:?}"), || {
            let layout =
                wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(width * TEXEL), rows_per_image: None };
            encoder.copy_texture_to_buffer(
                target.texture.as_image_copy(),
                wgpu::TexelCopyBufferInfo { buffer: to.raw(), layout },
                wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            );
        })
    }
}
