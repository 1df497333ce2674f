//! Leads an error in a compiled shader text back to the file and line that its author wrote.

use std::ops::Range;

use wesl::VirtualResolver;

use crate::gpu::shader::plain_name;

/// 1-based line of a byte offset.
pub(crate) fn line_of(text: &str, offset: usize) -> usize {
    let end = offset.min(text.len());
    text.as_bytes()[..end].iter().filter(|&&b| b == b'\n').count() + 1
}

/// Offset of the declaration of `name` at module level, if `text` has one.
pub(crate) fn declaration(text: &str, name: &str) -> Option<usize> {
    let mut offset = 0;
    for line in text.split_inclusive('\n') {
        if declared_name(line) == Some(name) {
            return Some(offset);
        }
        offset += line.len();
    }
    None
}

/// Name that a line declares: `fn x(`, `struct x {`, `const x =`, `override x:`, `alias x =`, `var<…> x:`.
fn declared_name(line: &str) -> Option<&str> {
    let mut rest = line.trim_end();
    // Declarations of a module start at the margin; attributes may stand in front of them.
    while let Some(after) = rest.strip_prefix('@') {
        let end = after.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(after.len());
        rest = after[end..].trim_start();
        if rest.starts_with('(') {
            rest = rest[rest.find(')')? + 1..].trim_start();
        }
    }
    let (keyword, after) = rest.split_at(rest.find(|c: char| !c.is_alphanumeric()).unwrap_or(rest.len()));
    let mut after = after;
    match keyword {
        "fn" | "struct" | "const" | "override" | "alias" => {}
        "var" => {
            if after.starts_with('<') {
                after = &after[after.find('>')? + 1..];
            }
        }
        _ => return None,
    }
    let name = after.trim_start();
    let end = name.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(name.len());
    (end > 0).then_some(&name[..end])
}

/// `shaders/<file>.wgsl:<line>` of an error at `span` of the compiled text `wgsl`. The line is that of the
/// first place in the same declaration that holds the same code; the compiled text names both.
pub(crate) fn in_sources(wgsl: &str, span: Option<Range<usize>>, stem: &str, sources: &VirtualResolver<'_>) -> String {
    let root = format!("shaders/{stem}.wgsl");
    let Some(span) = span.filter(|s| s.start <= wgsl.len()) else {
        return root;
    };
    // The declaration that holds the span is the last that starts before it.
    let mut holder = None;
    let mut offset = 0;
    for line in wgsl.split_inclusive('\n') {
        if offset > span.start {
            break;
        }
        if let Some(name) = declared_name(line) {
            holder = Some((name, offset));
        }
        offset += line.len();
    }
    let Some((compiled_name, compiled_start)) = holder else {
        return root;
    };
    let name = plain_name(compiled_name);
    let module = compiled_name.get(name.len() + 2..).unwrap_or_default();
    let owner = sources.modules().find(|(path, text)| {
        let joined = path.components.join("_");
        let here = if module.is_empty() { path.components.join("/") == stem } else { joined == module };
        here && declaration(text, name).is_some()
    });
    let Some((path, text)) = owner else {
        return root;
    };
    let file = format!("shaders/{}.wgsl", path.components.join("/"));
    let Some(start) = declaration(text, name) else {
        return file;
    };
    let wanted = squeeze(wgsl.get(span.clone()).unwrap_or_default());
    // How often the same code stands in the declaration before the span: skip as many in the source.
    let before = squeeze(wgsl.get(compiled_start..span.start).unwrap_or_default());
    let nth = if wanted.is_empty() { 0 } else { before.matches(wanted.as_str()).count() };
    let line = find_squeezed(text, start, &wanted, nth).unwrap_or_else(|| line_of(text, start));
    format!("{file}:{line}")
}

/// Code without white space, comments and the suffixes of imported names.
fn squeeze(code: &str) -> String {
    let mut out = String::new();
    for line in code.lines() {
        let line = line.split("//").next().unwrap_or_default();
        let mut word = String::new();
        for c in line.chars().chain(std::iter::once(' ')) {
            if c.is_alphanumeric() || c == '_' {
                word.push(c);
            } else {
                out.push_str(plain_name(&word));
                word.clear();
                if !c.is_whitespace() {
                    out.push(c);
                }
            }
        }
    }
    out
}

fn find_squeezed(text: &str, start: usize, wanted: &str, nth: usize) -> Option<usize> {
    if wanted.is_empty() {
        return None;
    }
    let mut squeezed = String::new();
    let mut lines = Vec::new();
    let first = line_of(text, start);
    for (index, line) in text[start..].lines().enumerate() {
        squeezed.push_str(&squeeze(line));
        lines.push((squeezed.len(), first + index));
    }
    let (at, _) = squeezed.match_indices(wanted).nth(nth)?;
    lines.iter().find(|(end, _)| at < *end).map(|(_, line)| *line)
}
