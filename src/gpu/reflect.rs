//! What a shader asks for: bindings by name, workgroup size, override constants. Read from the shader itself, so
//! that no binding number is ever written in Rust.

use wgpu::naga::proc::Layouter;
use wgpu::naga::{self, AddressSpace, ShaderStage, StorageAccess, TypeInner};

use crate::error::{Error, Result};
use crate::gpu::shader::{ShaderText, plain_name};

/// How a binding is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BindingKind {
    /// `var<uniform>`.
    Uniform,
    /// `var<storage, read>`.
    ReadOnly,
    /// `var<storage, read_write>`.
    ReadWrite,
}

/// One bound variable of an entry point.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Binding {
    /// Variable name, as in the file that declares it.
    pub name: String,
    /// `@group`.
    pub group: u32,
    /// `@binding`.
    pub binding: u32,
    /// Address space and access.
    pub kind: BindingKind,
    /// Smallest buffer that can be bound, bytes: the whole type, with one element of a run-time sized array.
    pub min_bytes: u64,
    /// Stride of the run-time sized array that ends the type, bytes.
    pub stride: Option<u64>,
}

/// Reflection of one entry point.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Reflection {
    /// Entry point name.
    pub entry: String,
    /// Threads of a workgroup along x, y, z.
    pub workgroup: [u32; 3],
    /// Bindings that the entry point uses, by group and binding.
    pub bindings: Vec<Binding>,
    /// Names of the override constants of the file.
    pub overrides: Vec<String>,
}

/// WebGPU promises eight storage buffers a stage; a shader that needs more would fail on some adapter.
pub(crate) const STORAGE_BUFFERS: usize = 8;

impl Reflection {
    /// Reads `entry` of a compiled shader; `overrides` set the constants that its workgroup size may depend on.
    ///
    /// # Errors
    /// [`Error::Shader`]: no such compute entry point, an unknown override, a binding that is no buffer, two
    /// bindings of one name, more than eight storage buffers.
    pub fn of(text: &ShaderText, entry: &str, overrides: &[(&str, f64)]) -> Result<Self> {
        let fault = |message: String| Error::Shader(format!("shaders/{}.wgsl: {message}", text.stem));
        let names: Vec<String> = text.module.overrides.iter().filter_map(|(_, o)| o.name.clone()).collect();
        let plain: Vec<&str> = names.iter().map(|name| plain_name(name)).collect();
        if let Some((unknown, _)) = overrides.iter().find(|(name, _)| !names.iter().any(|n| n == name)) {
            return Err(fault(format!("no override constant {unknown:?}; there are: {}", plain.join(", "))));
        }
        let position = text
            .module
            .entry_points
            .iter()
            .position(|p| p.name == entry && p.stage == ShaderStage::Compute)
            .ok_or_else(|| {
                let all: Vec<&str> = text.module.entry_points.iter().map(|p| p.name.as_str()).collect();
                fault(format!("no compute entry point {entry:?}; there are: {}", all.join(", ")))
            })?;
        let workgroup = workgroup_size(text, position, entry, overrides).map_err(&fault)?;
        let bindings = bindings(text, position).map_err(&fault)?;
        let reflection = Self { entry: entry.to_string(), workgroup, bindings, overrides: names };
        reflection.verify().map_err(fault)?;
        Ok(reflection)
    }

    /// Reads the vertex and the fragment entry point of a compiled shader as one: what either binds.
    ///
    /// # Errors
    /// As [`Reflection::of`].
    pub fn of_points(text: &ShaderText, vertex: &str, fragment: &str) -> Result<Self> {
        let fault = |message: String| Error::Shader(format!("shaders/{}.wgsl: {message}", text.stem));
        let mut found: Vec<Binding> = Vec::new();
        for (entry, stage) in [(vertex, ShaderStage::Vertex), (fragment, ShaderStage::Fragment)] {
            let mut points = text.module.entry_points.iter();
            let position = points.position(|p| p.name == entry && p.stage == stage);
            let position = position.ok_or_else(|| fault(format!("no {stage:?} entry point {entry:?}")))?;
            let more = bindings(text, position).map_err(&fault)?;
            found.extend(more.into_iter().filter(|b| !found.contains(b)).collect::<Vec<_>>());
        }
        found.sort_by_key(|b| (b.group, b.binding));
        let overrides = text.module.overrides.iter().filter_map(|(_, o)| o.name.clone()).collect();
        let reflection = Self { entry: vertex.to_string(), workgroup: [1; 3], bindings: found, overrides };
        reflection.verify().map_err(fault)?;
        Ok(reflection)
    }

    /// The binding of that name.
    pub fn binding(&self, name: &str) -> Option<&Binding> {
        self.bindings.iter().find(|b| b.name == name)
    }

    /// Threads in a workgroup.
    pub fn threads(&self) -> u32 {
        self.workgroup.iter().product()
    }

    fn verify(&self) -> std::result::Result<(), String> {
        for (index, binding) in self.bindings.iter().enumerate() {
            if self.bindings[..index].iter().any(|b| b.name == binding.name) {
                return Err(format!("{:?} has two bindings named {:?}", self.entry, binding.name));
            }
        }
        let storage = self.bindings.iter().filter(|b| b.kind != BindingKind::Uniform).count();
        if storage > STORAGE_BUFFERS {
            return Err(format!(
                "{:?} uses {storage} storage buffers; WebGPU promises {STORAGE_BUFFERS} a stage",
                self.entry
            ));
        }
        Ok(())
    }
}

fn workgroup_size(
    text: &ShaderText,
    position: usize,
    entry: &str,
    overrides: &[(&str, f64)],
) -> std::result::Result<[u32; 3], String> {
    let point = &text.module.entry_points[position];
    if point.workgroup_size_overrides.is_none() {
        return Ok(point.workgroup_size);
    }
    let mut constants = naga::back::PipelineConstants::default();
    for (name, value) in overrides {
        constants.insert((*name).to_string(), *value);
    }
    let stage = Some((ShaderStage::Compute, entry));
    let (module, _) = naga::back::pipeline_constants::process_overrides(&text.module, &text.info, stage, &constants)
        .map_err(|e| format!("workgroup size of {entry:?}: {e}"))?;
    module
        .entry_points
        .iter()
        .find(|p| p.name == entry)
        .map(|p| p.workgroup_size)
        .ok_or_else(|| format!("entry point {entry:?} was lost"))
}

fn bindings(text: &ShaderText, position: usize) -> std::result::Result<Vec<Binding>, String> {
    let mut layouter = Layouter::default();
    layouter.update(text.module.to_ctx()).map_err(|e| e.to_string())?;
    let uses = text.info.get_entry_point(position);
    let mut found = Vec::new();
    for (handle, variable) in text.module.global_variables.iter() {
        let (Some(place), false) = (&variable.binding, uses[handle].is_empty()) else {
            continue;
        };
        let name = plain_name(variable.name.as_deref().unwrap_or_default()).to_string();
        let kind = match variable.space {
            AddressSpace::Uniform => BindingKind::Uniform,
            AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => BindingKind::ReadWrite,
            AddressSpace::Storage { .. } => BindingKind::ReadOnly,
            _ => {
                return Err(format!("binding {name:?} is no buffer; only buffers are bound by name"));
            }
        };
        let stride = run_time_stride(&text.module, variable.ty);
        // naga's size of a type that ends in a run-time sized array counts one element of it.
        let min_bytes = u64::from(layouter[variable.ty].size).max(stride.unwrap_or(0));
        found.push(Binding { name, group: place.group, binding: place.binding, kind, min_bytes, stride });
    }
    found.sort_by_key(|b| (b.group, b.binding));
    Ok(found)
}

fn run_time_stride(module: &naga::Module, ty: naga::Handle<naga::Type>) -> Option<u64> {
    match &module.types[ty].inner {
        TypeInner::Array { size: naga::ArraySize::Dynamic, stride, .. } => Some(u64::from(*stride)),
        TypeInner::Struct { members, .. } => members.last().and_then(|m| run_time_stride(module, m.ty)),
        _ => None,
    }
}
