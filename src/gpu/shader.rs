//! Shader texts: embedded files, imports, one plain WGSL text per root file.
//!
//! A file `shaders/common/grid.wgsl` is the module `package::common::grid`; another file takes from it
//! with `import package::common::grid::thread_index;`. Names of the root file stay as they are; imported
//! names become `name__common_grid`, which [`plain_name`] undoes.

use std::borrow::Cow;
use std::path::Path;

use include_dir::{Dir, include_dir};
use wesl::syntax::PathOrigin;
use wesl::{CompileOptions, Diagnostic, ModulePath, VirtualResolver};

use crate::error::{Error, Result};
use crate::gpu::locate;

static SHADERS: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/shaders");

/// One compiled root file: plain WGSL without imports.
pub struct ShaderText {
    /// Path below `shaders/`, without extension, e.g. `passes/gather/gather`.
    pub stem: String,
    /// WGSL as the device gets it.
    pub wgsl: String,
    /// Parsed and validated form, for reflection.
    pub module: wgpu::naga::Module,
    /// What naga's validation found out.
    pub info: wgpu::naga::valid::ModuleInfo,
}

/// Stems of all embedded shader files (paths below `shaders/` without extension), sorted.
pub fn files() -> Vec<String> {
    fn walk(dir: &Dir<'static>, into: &mut Vec<String>) {
        for file in dir.files() {
            let path = file.path().to_string_lossy().replace('\\', "/");
            if let Some(stem) = path.strip_suffix(".wgsl") {
                into.push(stem.to_string());
            }
        }
        for child in dir.dirs() {
            walk(child, into);
        }
    }
    let mut stems = Vec::new();
    walk(&SHADERS, &mut stems);
    stems.sort();
    stems
}

/// Text of one embedded file by its stem.
pub fn source(stem: &str) -> Option<&'static str> {
    SHADERS.get_file(format!("{stem}.wgsl"))?.contents_utf8()
}

/// The text as embedded, or as it is now below the folder that `MIPLIGHT_SHADERS` names: whoever works on a shader need
/// not rebuild the crate.
fn current(stem: &str) -> Option<Cow<'static, str>> {
    let embedded = source(stem)?;
    let file = std::env::var_os("MIPLIGHT_SHADERS").map(|dir| Path::new(&dir).join(format!("{stem}.wgsl")));
    let changed = file.and_then(|file| std::fs::read_to_string(file).ok());
    Some(changed.map_or(Cow::Borrowed(embedded), Cow::Owned))
}

fn module_path(stem: &str) -> ModulePath {
    ModulePath::new(PathOrigin::Absolute, stem.split('/').map(str::to_string).collect())
}

/// Imported names keep their own name in front, so that errors, bindings and structs stay readable.
struct SuffixMangler;

impl wesl::Mangler for SuffixMangler {
    fn mangle(&self, path: &ModulePath, item: &str) -> String {
        format!("{item}__{}", path.components.join("_"))
    }
}

impl ShaderText {
    /// Name of an override constant in the compiled text: of an imported file it has a suffix.
    pub(crate) fn full_name<'n>(&'n self, name: &'n str) -> &'n str {
        let mut names = self.module.overrides.iter().filter_map(|(_, constant)| constant.name.as_deref());
        names.find(|full| plain_name(full) == name).unwrap_or(name)
    }
}

/// The name as written in its file: `Ray__common_ray` is `Ray`.
pub(crate) fn plain_name(name: &str) -> &str {
    // A leading or trailing run of underscores is the author's own.
    name.find("__").filter(|&at| at > 0).map_or(name, |at| &name[..at])
}

/// Compiles an embedded file with its imports, or `root` when given in its place (tests do that).
/// Everything in the root file is kept and checked; of imported files, what is used.
///
/// # Errors
/// [`Error::Shader`] with file and line.
pub fn compile(stem: &str, root: Option<&str>) -> Result<ShaderText> {
    let mut resolver = VirtualResolver::new();
    for file in files() {
        resolver.add_module(module_path(&file), current(&file).unwrap_or_default());
    }
    match (root, source(stem)) {
        (Some(text), _) => resolver.add_module(module_path(stem), Cow::Borrowed(text)),
        (None, Some(_)) => {}
        (None, None) => {
            return Err(Error::Shader(format!(
                "no shader file shaders/{stem}.wgsl; there are: {}",
                files().join(", ")
            )));
        }
    }
    let options = CompileOptions { keep_root: true, ..CompileOptions::default() };
    let compiled = wesl::compile_sourcemap(&module_path(stem), &resolver, &SuffixMangler, &options)
        .map_err(|e| Error::Shader(import_error(stem, e, &resolver)))?;
    let wgsl = compiled.to_string();
    let (module, info) = check(&wgsl).map_err(|(message, span)| {
        let place = locate::in_sources(&wgsl, span, stem, &resolver);
        Error::Shader(format!("{place}: {message}"))
    })?;
    Ok(ShaderText { stem: stem.to_string(), wgsl, module, info })
}

type Faulty = (String, Option<std::ops::Range<usize>>);

fn check(wgsl: &str) -> std::result::Result<(wgpu::naga::Module, wgpu::naga::valid::ModuleInfo), Faulty> {
    use wgpu::naga::{front, valid};
    let module = front::wgsl::parse_str(wgsl).map_err(|e| {
        let span = e.labels().next().and_then(|(span, _)| span.to_range());
        let labels: Vec<&str> = e.labels().map(|(_, text)| text).filter(|t| !t.is_empty()).collect();
        let hint = if labels.is_empty() { String::new() } else { format!(" ({})", labels.join("; ")) };
        (format!("{}{hint}", e.message()), span)
    })?;
    let capabilities =
        valid::Capabilities::default() | valid::Capabilities::SUBGROUP | valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32;
    let info = valid::Validator::new(valid::ValidationFlags::all(), capabilities).validate(&module).map_err(|e| {
        let span = e.spans().next().and_then(|(span, _)| span.to_range());
        (chain(e.as_inner()), span)
    })?;
    Ok((module, info))
}

/// An error with its causes: naga says what is wrong only in the innermost one.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        text.push_str(": ");
        text.push_str(&inner.to_string());
        cause = inner.source();
    }
    text
}

fn import_error(stem: &str, error: wesl::Error, resolver: &VirtualResolver<'_>) -> String {
    let found = Diagnostic::from(error);
    let path = found.detail.module_path.clone().unwrap_or_else(|| module_path(stem));
    let file = path.components.join("/");
    let text = resolver.get_module(&path).ok().map(str::to_string).or_else(|| found.detail.source.clone());
    let line = match (&text, &found.detail.span, &found.detail.declaration) {
        (Some(text), Some(span), _) => Some(locate::line_of(text, span.start)),
        (Some(text), None, Some(name)) => {
            locate::declaration(text, plain_name(name)).map(|at| locate::line_of(text, at))
        }
        _ => None,
    };
    let line = line.map(|l| format!(":{l}")).unwrap_or_default();
    let message = found.error.to_string();
    // The parser puts byte offsets in front; the line says it better.
    let message = match message.split_once(": ") {
        Some((offsets, rest)) if offsets.starts_with("chars ") => rest,
        _ => &message,
    };
    format!("shaders/{file}.wgsl{line}: {message}")
}
