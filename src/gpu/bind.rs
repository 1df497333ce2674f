//! The bindings of a pass: found by name, checked, and turned into bind groups.

use crate::error::{Error, Result};
use crate::gpu::pass::{Bound, GRID, Grid, Pass};
use crate::gpu::reflect::{Binding, BindingKind};
use crate::gpu::resource::{Slice, Usage};

/// A bind group with the dynamic offsets of its uniforms.
pub(crate) type Group = (wgpu::BindGroup, Vec<u32>);

impl<'r> Pass<'r, '_> {
    pub(crate) fn bind_groups(&mut self, grid: Grid) -> Result<Vec<Option<Group>>> {
        let kernel = self.kernel;
        let mut made = Vec::with_capacity(kernel.groups.len());
        for (index, layout) in kernel.groups.iter().enumerate() {
            let Some(layout) = layout else {
                made.push(None);
                continue;
            };
            let bindings = kernel.reflection.bindings.iter().filter(|b| b.group == index as u32);
            let (mut entries, mut offsets) = (Vec::new(), Vec::new());
            for binding in bindings {
                let place = self.place(binding, grid)?;
                if binding.kind == BindingKind::Uniform {
                    offsets.push(place.dynamic);
                }
                entries.push((binding.binding, place));
            }
            let gpu = &self.recorder.gpu;
            let staging = &self.recorder.staging.raw;
            let entries: Vec<_> = entries.iter().map(|(binding, place)| place.entry(*binding, staging)).collect();
            let group = gpu.scoped(&format!("bindings of pass {:?}", self.stage), || {
                gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some(&self.stage),
                    layout,
                    entries: &entries,
                })
            })?;
            made.push(Some((group, offsets)));
        }
        Ok(made)
    }

    fn place(&mut self, binding: &Binding, grid: Grid) -> Result<Place<'r>> {
        let bound = self.bound.iter().find(|(name, _)| *name == binding.name).map(|(_, bound)| bound);
        Ok(match bound {
            Some(Bound::Buffer(slice)) => Place { slice: Some(*slice), dynamic: 0, bytes: slice.bytes },
            Some(Bound::Uniform(data)) => {
                let dynamic = self.recorder.staging.push(data)?;
                Place { slice: None, dynamic, bytes: binding.min_bytes }
            }
            // Only `grid` may be left out; `check_bindings` has seen to that.
            None => {
                let dynamic = self.recorder.staging.push(bytemuck::bytes_of(&grid))?;
                Place { slice: None, dynamic, bytes: binding.min_bytes }
            }
        })
    }

    pub(crate) fn check_bindings(&self) -> Result<()> {
        let reflection = &self.kernel.reflection;
        let names = || reflection.bindings.iter().map(|b| b.name.as_str()).collect::<Vec<_>>().join(", ");
        for (index, (name, bound)) in self.bound.iter().enumerate() {
            let Some(binding) = reflection.binding(name) else {
                return Err(self.fault(&format!("has no binding {name:?}; it uses: {}", names())));
            };
            if self.bound[..index].iter().any(|(other, _)| other == name) {
                return Err(self.fault(&format!("binds {name:?} twice")));
            }
            self.check_fit(binding, bound)?;
        }
        let given = |name: &str| self.bound.iter().any(|(n, _)| n == name);
        match reflection.bindings.iter().find(|b| b.name != GRID && !given(&b.name)) {
            Some(missing) => Err(self.fault(&format!("misses the binding {:?}; it uses: {}", missing.name, names()))),
            None => Ok(()),
        }
    }

    fn check_fit(&self, binding: &Binding, bound: &Bound<'_>) -> Result<()> {
        let name = &binding.name;
        let slice = match bound {
            Bound::Uniform(_) if binding.kind != BindingKind::Uniform => {
                return Err(self.fault(&format!("{name:?} is storage and needs a buffer")));
            }
            Bound::Uniform(data) if data.len() as u64 != binding.min_bytes => {
                let (got, wanted) = (data.len(), binding.min_bytes);
                return Err(self.fault(&format!("the uniform {name:?} has {wanted} bytes; {got} were given")));
            }
            Bound::Uniform(_) => return Ok(()),
            Bound::Buffer(slice) => slice,
        };
        let limits = self.recorder.gpu.limits();
        let (limit, limit_name) = match binding.kind {
            BindingKind::Uniform => (limits.max_uniform_buffer_binding_size, "max_uniform_buffer_binding_size"),
            _ => (limits.max_storage_buffer_binding_size, "max_storage_buffer_binding_size"),
        };
        let (label, bytes) = (slice.label, slice.bytes);
        if (binding.kind == BindingKind::Uniform) != (slice.usage == Usage::Uniform) {
            return Err(self.fault(&format!("{name:?} is {:?}, the buffer {label:?} is not", binding.kind)));
        }
        if bytes < binding.min_bytes {
            let wanted = binding.min_bytes;
            return Err(self.fault(&format!("{name:?} needs {wanted} bytes, the buffer {label:?} has {bytes}")));
        }
        if bytes > limit {
            return Err(Error::Device(format!(
                "buffer {label:?} has {bytes} bytes; this adapter binds at most {limit} ({limit_name})"
            )));
        }
        let element = slice.element_bytes;
        match binding.stride {
            Some(stride) if !stride.is_multiple_of(element) && !element.is_multiple_of(stride) => {
                Err(self.fault(&format!(
                    "elements of {name:?} have {stride} bytes in the shader and {element} in the buffer {label:?}"
                )))
            }
            _ => Ok(()),
        }
    }
}

/// Where the bytes of one binding lie.
struct Place<'r> {
    /// A buffer; `None`: staged uniforms.
    slice: Option<Slice<'r>>,
    dynamic: u32,
    bytes: u64,
}

impl Place<'_> {
    fn entry<'e>(&'e self, binding: u32, staging: &'e wgpu::Buffer) -> wgpu::BindGroupEntry<'e> {
        let (buffer, offset) = self.slice.as_ref().map_or((staging, 0), |s| (s.raw, s.offset));
        let size = wgpu::BufferSize::new(self.bytes);
        wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset, size }),
        }
    }
}
