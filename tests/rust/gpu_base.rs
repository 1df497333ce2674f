//! The GPU base on whatever adapter this machine has: a software one is enough.

use miplight::gpu::{self, AdapterFacts, Gpu, Resources, Usage, never};

#[path = "gpu_common.rs"]
mod common;
use common::{HEAD, NUMBER, device, kernel, message};

fn adapter(name: &str, device_type: &'static str) -> AdapterFacts {
    AdapterFacts { name: name.into(), backend: "vulkan".into(), driver: String::new(), device_type }
}

#[test]
fn adapter_choice_prefers_the_fastest_kind() {
    let all = [adapter("llvmpipe (LLVM)", "software"), adapter("Iris", "integrated"), adapter("GeForce", "discrete")];
    assert_eq!(gpu::choose(&all, "auto"), Ok(2));
    assert_eq!(gpu::choose(&all[..2], "auto"), Ok(1));
    assert_eq!(gpu::choose(&all[..1], "auto"), Ok(0));
    assert_eq!(gpu::choose(&all, "cpu"), Ok(0));
    assert_eq!(gpu::choose(&all, "LLVM"), Ok(0));
    assert_eq!(gpu::choose(&all, "iris"), Ok(1));
    let text = message(gpu::choose(&all[..1], "gpu"));
    assert!(text.contains("\"gpu\"") && text.contains("llvmpipe"), "{text}");
    assert!(message(gpu::choose(&[], "auto")).contains("none"));
    assert!(gpu::choose(&all, "").is_err());
}

#[test]
fn every_shader_compiles_and_keeps_the_binding_limit() {
    let stems = gpu::files();
    assert!(stems.contains(&"common/grid".to_string()), "{stems:?}");
    for stem in &stems {
        let text = gpu::compile(stem, None).unwrap_or_else(|e| panic!("{e}"));
        for entry in &text.module.entry_points {
            let made = match format!("{:?}", entry.stage).as_str() {
                "Compute" => gpu::Reflection::of(&text, &entry.name, &[]),
                // The stages of points are one kernel.
                _ => gpu::Reflection::of_points(&text, "vertex", "fragment"),
            };
            made.unwrap_or_else(|e| panic!("{e}"));
        }
        let lines = gpu::source(stem).map_or(0, |s| s.lines().count());
        assert!(lines <= 250, "shaders/{stem}.wgsl has {lines} lines");
    }
}

#[test]
fn reflection_reads_names_sizes_and_workgroups() {
    let text = format!(
        "{HEAD}
        struct Pair {{ a: vec3<f32>, b: f32 }}
        override SIZE: u32 = 32;
        @group(1) @binding(3) var<storage, read> pairs: array<Pair>;
        @group(1) @binding(4) var<storage, read> unused: array<u32>;
        @compute @workgroup_size(SIZE, 2) fn main() {{ out[0] = u32(pairs[1].b) + grid.end; }}"
    );
    let kernel = device().kernel_from_text("tests/reflect", &text, "main", &[("SIZE", 16.0)]).unwrap();
    let reflection = kernel.reflection();
    assert_eq!(reflection.workgroup, [16, 2, 1]);
    let names: Vec<&str> = reflection.bindings.iter().map(|b| b.name.as_str()).collect();
    assert_eq!(names, ["grid", "out", "pairs"], "unused bindings are not asked for");
    let pairs = reflection.binding("pairs").unwrap();
    assert_eq!((pairs.group, pairs.binding, pairs.stride, pairs.kind), (1, 3, Some(16), gpu::BindingKind::ReadOnly));
    assert_eq!(reflection.binding("grid").unwrap().min_bytes, 8);
    let unknown = device().kernel_from_text("tests/reflect", &text, "main", &[("SIZES", 1.0)]);
    assert!(message(unknown).contains("SIZE"));
    assert!(message(device().kernel_from_text("tests/reflect", &text, "mian", &[])).contains("main"));
}

#[test]
fn more_than_eight_storage_buffers_are_refused() {
    let mut text = String::new();
    let mut sum = String::from("0u");
    for i in 0..9 {
        text.push_str(&format!("@group(0) @binding({i}) var<storage, read_write> b{i}: array<u32>;\n"));
        sum.push_str(&format!(" + b{i}[1]"));
    }
    text.push_str(&format!("@compute @workgroup_size(1) fn main() {{ b0[0] = {sum}; }}"));
    assert!(message(device().kernel_from_text("tests/nine", &text, "main", &[])).contains("9 storage buffers"));
}

#[test]
fn broken_shaders_name_file_and_line() {
    let at = |text: &str| message(device().kernel_from_text("tests/broken", text, "main", &[]));
    let syntax = at("\n\n@compute @workgroup_size(1) fn main() { let x = ; }\n");
    assert!(syntax.contains("shaders/tests/broken.wgsl:3"), "{syntax}");
    let unknown = at(
        "// head\nfn helper() -> f32 {\n    // note\n    return missing(1.0);\n}\n@compute @workgroup_size(1)\nfn main() { _ = helper(); }\n",
    );
    assert!(unknown.contains("shaders/tests/broken.wgsl:4") && unknown.contains("missing"), "{unknown}");
    let types = at("@compute @workgroup_size(1)\nfn main() {\n    var a = 1u;\n\n    a = a + 1.5;\n}\n");
    assert!(types.contains("shaders/tests/broken.wgsl:5"), "{types}");
    let import = at("import package::common::nowhere::thing;\n@compute @workgroup_size(1) fn main() { thing(); }\n");
    assert!(import.contains("nowhere") && import.contains("shaders/tests/broken.wgsl"), "{import}");
    assert!(message(device().kernel("passes/nowhere", "main", &[])).contains("common/grid"));
}

#[test]
fn kernels_are_made_once() {
    let (a, b) = (kernel(NUMBER), kernel(NUMBER));
    assert!(std::sync::Arc::ptr_eq(&a, &b));
}

#[test]
fn limits_are_respected_and_named() {
    let gpu = device();
    let limit = gpu.limits().max_buffer_size;
    let text = message(gpu.buffer::<u32>("giant", (limit / 4 + 1) as usize, Usage::Storage));
    assert!(text.contains("giant") && text.contains(&limit.to_string()) && text.contains("max_buffer_size"), "{text}");
    let binding = gpu.limits().max_storage_buffer_binding_size;
    if binding < limit {
        let big = gpu.buffer::<u32>("big", (binding / 4 + 64) as usize, Usage::Storage).unwrap();
        let kernel = kernel(NUMBER);
        let mut recorder = gpu.record(never()).unwrap();
        let text = message(recorder.pass("number", &kernel).bind("out", &big).dispatch(64));
        assert!(text.contains("\"big\"") && text.contains(&binding.to_string()), "{text}");
        let part = big.range(gpu, 64..128).unwrap();
        recorder.pass("number", &kernel).bind("out", part).dispatch(64).unwrap();
        recorder.finish().unwrap();
        assert_eq!(gpu.view(&big, 60..130).unwrap()[3..6], [0, 1, 2]);
        assert!(big.range(gpu, 1..64).is_err(), "unaligned ranges cannot be bound");
    }
}

#[test]
fn readback_brings_several_buffers_at_once() {
    let gpu = device();
    let numbers: Vec<u32> = (0..1000).collect();
    let bytes: Vec<u8> = (0..=250).collect();
    let triples: Vec<[f32; 3]> = (0..77).map(|i| [i as f32, 0.5, -1.0]).collect();
    let a = gpu.upload("numbers", &numbers).unwrap();
    let c = gpu.upload("triples", &triples).unwrap();
    let empty = gpu.buffer::<u32>("empty", 0, Usage::Storage).unwrap();
    let u = gpu.buffer::<u32>("constants", 4, Usage::Uniform).unwrap();
    u.write(gpu, 0, &[7, 8, 9, 10]).unwrap();
    let mut readback = gpu.readback();
    let (ta, tc) = (readback.add(&a, 3..997).unwrap(), readback.add(&c, 0..77).unwrap());
    let (te, tu) = (readback.add(&empty, 0..0).unwrap(), readback.add(&u, 1..3).unwrap());
    assert!(readback.add(&a, 0..1001).is_err());
    let mut landed = readback.wait().unwrap();
    assert_eq!(landed.take(tc), triples);
    assert_eq!(landed.take(ta), numbers[3..997]);
    assert_eq!(landed.take(te), Vec::<u32>::new());
    assert_eq!(landed.take(tu), [8, 9]);
    let odd = gpu.upload("bytes", &bytes[..248]).unwrap();
    assert_eq!(gpu.read(&odd).unwrap(), bytes[..248]);
}

#[test]
fn views_read_and_write_in_place() {
    let gpu = device();
    let numbers: Vec<u32> = (0..1000).collect();
    let a = gpu.upload("numbers", &numbers).unwrap();
    {
        let view = gpu.view(&a, 5..995).unwrap();
        assert_eq!(view[..], numbers[5..995]);
    }
    let mut write = gpu.view_mut(&a, 501..777).unwrap();
    write.iter_mut().for_each(|x| *x = 5);
    write.commit(gpu).unwrap();
    let read = gpu.read(&a).unwrap();
    let expected: Vec<u32> = (0..1000).map(|i| if (501..777).contains(&i) { 5 } else { i }).collect();
    assert_eq!(read, expected);
    assert!(gpu.view(&a, 0..1001).is_err());
    if gpu.mappable() {
        let _first = gpu.view(&a, 0..10).unwrap();
        assert!(gpu.view(&a, 20..30).is_err(), "a buffer is lent once at a time");
    }
}

#[test]
fn the_pool_reuses_and_grows() {
    // On a device of its own: the other tests allocate meanwhile.
    let gpu = &Gpu::new("auto").unwrap();
    let before = gpu.allocated_bytes();
    let mut pool = Resources::new(gpu);
    let first = pool.buffer::<u32>("hits", 100).unwrap();
    let bytes = pool.bytes();
    let smaller = pool.buffer::<[u32; 2]>("hits", 20).unwrap();
    assert_eq!(first.raw(), smaller.raw());
    assert_eq!((smaller.len(), pool.bytes()), (20, bytes));
    let larger = pool.buffer::<u32>("hits", 1000).unwrap();
    assert_ne!(first.raw(), larger.raw());
    assert_eq!(gpu.allocated_bytes() - before, 4000 + 400);
    drop(first);
    drop(smaller);
    assert_eq!(gpu.allocated_bytes() - before, 4000);
    pool.release("hits");
    assert_ne!(pool.buffer::<u32>("hits", 1000).unwrap().raw(), larger.raw());
    assert_eq!(pool.names(), ["hits"]);
}

#[test]
fn faults_of_wgpu_become_errors() {
    let gpu = device();
    let bad = || {
        gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("bad"),
            size: 16,
            usage: wgpu::BufferUsages::empty(),
            mapped_at_creation: false,
        })
    };
    let text = message(gpu.scoped("making a bad buffer", bad));
    assert!(text.starts_with("making a bad buffer"), "{text}");
    // Outside a scope it is recorded, reported at the next use, and then forgotten.
    let own = Gpu::new("auto").unwrap();
    drop(own.device().create_buffer(&wgpu::BufferDescriptor {
        label: Some("bad"),
        size: 16,
        usage: wgpu::BufferUsages::empty(),
        mapped_at_creation: false,
    }));
    assert!(own.check().is_err());
    assert!(own.check().is_ok());
}

#[test]
fn a_closed_device_is_an_error() {
    let gpu = Gpu::new("auto").unwrap();
    let buffer = gpu.upload("numbers", &[1u32, 2, 3, 4]).unwrap();
    gpu.close();
    assert!(message(gpu.read(&buffer)).contains("closed"));
    assert!(gpu.record(never()).is_err());
    assert!(gpu.buffer::<u32>("more", 4, Usage::Storage).is_err());
}

#[test]
fn layouts_are_compared() {
    use miplight::gpu::layout::{same, shader_layout};
    use miplight::host_layout;
    #[repr(C)]
    struct Grid {
        first: u32,
        end: u32,
    }
    same(&host_layout!(Grid { first, end }), &shader_layout("common/grid", "Grid").unwrap()).unwrap();
    // Negative control: a field more, and another order, are both seen.
    mod wrong {
        #[repr(C)]
        pub(crate) struct Grid {
            pub(crate) end: u32,
            pub(crate) first: u32,
            pub(crate) third: f32,
        }
    }
    use wrong::Grid as Wrong;
    let text = same(&host_layout!(Wrong { end, first, third }), &shader_layout("common/grid", "Grid").unwrap());
    let text = text.unwrap_err();
    assert!(text.contains("size 12") && text.contains("\"end\""), "{text}");
}
