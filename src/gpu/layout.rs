//! Proof that a `#[repr(C)]` struct and the WGSL struct of the same name have the same layout.

use wgpu::naga::TypeInner;
use wgpu::naga::proc::Layouter;

use crate::error::{Error, Result};
use crate::gpu::shader::{self, plain_name};

/// One field: name, byte offset, byte size.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Field {
    /// Field name.
    pub name: String,
    /// Offset from the start of the struct, bytes.
    pub offset: usize,
    /// Size, bytes.
    pub size: usize,
}

/// Layout of a struct on one side.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout {
    /// Struct name.
    pub name: String,
    /// Size with padding, as in an array, bytes.
    pub size: usize,
    /// Fields in order, without those of the host whose name starts with `_` (padding).
    pub fields: Vec<Field>,
}

/// Layout of a host struct: `host_layout!(Ray { origin, t_min, direction, t_max })`. Fields left out are an error of
/// the comparison, not of the macro.
#[macro_export]
macro_rules! host_layout {
    ($name:ident { $($field:ident),* $(,)? }) => {{
        fn size_of_field<S, F>(_: fn(&S) -> &F) -> usize {
            size_of::<F>()
        }
        $crate::gpu::layout::Layout {
            name: stringify!($name).to_string(),
            size: size_of::<$name>(),
            fields: vec![$($crate::gpu::layout::Field {
                name: stringify!($field).to_string(),
                offset: std::mem::offset_of!($name, $field),
                size: size_of_field(|s: &$name| &s.$field),
            }),*],
        }
    }};
}

/// Layout of the struct `name` as `shaders/<stem>.wgsl` declares or imports it.
///
/// # Errors
/// [`Error::Shader`] when the file does not compile or has no such struct.
pub fn shader_layout(stem: &str, name: &str) -> Result<Layout> {
    let text = shader::compile(stem, None)?;
    let mut layouter = Layouter::default();
    layouter.update(text.module.to_ctx()).map_err(|e| Error::Shader(format!("shaders/{stem}.wgsl: {e}")))?;
    let found = text.module.types.iter().find_map(|(_, ty)| match &ty.inner {
        TypeInner::Struct { members, span } if ty.name.as_deref().map(plain_name) == Some(name) => {
            Some((members, *span as usize))
        }
        _ => None,
    });
    let (members, size) = found.ok_or_else(|| Error::Shader(format!("shaders/{stem}.wgsl has no struct {name:?}")))?;
    let fields = members.iter().map(|member| Field {
        name: member.name.clone().unwrap_or_default(),
        offset: member.offset as usize,
        size: layouter[member.ty].size as usize,
    });
    Ok(Layout { name: name.to_string(), size, fields: fields.collect() })
}

/// Compares a host struct with its twin in a shader.
///
/// # Errors
/// A text that shows every difference.
pub fn same(host: &Layout, shader: &Layout) -> std::result::Result<(), String> {
    let mut faults = Vec::new();
    if host.size != shader.size {
        faults.push(format!("size {} on the host, {} in the shader", host.size, shader.size));
    }
    let visible: Vec<&Field> = host.fields.iter().filter(|f| !f.name.starts_with('_')).collect();
    for (h, s) in visible.iter().zip(&shader.fields) {
        if **h != *s {
            faults.push(format!("{h:?} on the host, {s:?} in the shader"));
        }
    }
    if visible.len() != shader.fields.len() {
        faults.push(format!("{} fields on the host, {} in the shader", visible.len(), shader.fields.len()));
    }
    if faults.is_empty() { Ok(()) } else { Err(format!("struct {}: {}", host.name, faults.join("; "))) }
}
