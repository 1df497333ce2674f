//! Passes: bindings by name, grids of any size, cutting, cancelling, timing.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use miplight::error::Error;
use miplight::gpu::{Usage, never};

#[path = "gpu_common.rs"]
mod common;
use common::{HEAD, NUMBER, alone, device, kernel, message};

#[test]
fn wrong_bindings_are_named() {
    let _alone = alone();
    let gpu = device();
    let kernel = kernel(NUMBER);
    let out = gpu.buffer::<u32>("out list", 64, Usage::Storage).unwrap();
    let odd = gpu.buffer::<[f32; 3]>("triples", 64, Usage::Storage).unwrap();
    let small = gpu.buffer::<u32>("constants", 64, Usage::Uniform).unwrap();
    let mut recorder = gpu.record(never()).unwrap();
    let missing = message(recorder.pass("number", &kernel).dispatch(64));
    assert!(missing.contains("\"out\"") && missing.contains("\"number\""), "{missing}");
    let unknown = message(recorder.pass("number", &kernel).bind("out", &out).bind("hits", &out).dispatch(64));
    assert!(unknown.contains("\"hits\"") && unknown.contains("grid, out"), "{unknown}");
    let twice = message(recorder.pass("number", &kernel).bind("out", &out).bind("out", &out).dispatch(64));
    assert!(twice.contains("twice"), "{twice}");
    let kind = message(recorder.pass("number", &kernel).bind("out", &small).dispatch(64));
    assert!(kind.contains("constants"), "{kind}");
    let size = message(recorder.pass("number", &kernel).bind("out", &out).uniform("grid", &1u32).dispatch(64));
    assert!(size.contains("8 bytes"), "{size}");
    // 12-byte elements are whole multiples of the shader's 4: allowed.
    recorder.pass("number", &kernel).bind("out", &odd).dispatch(64).unwrap();
    recorder.finish().unwrap();
}

#[test]
fn elements_of_another_size_are_refused() {
    let gpu = device();
    let text = "@group(0) @binding(0) var<storage, read_write> rays: array<vec4<f32>>;
        @compute @workgroup_size(1) fn main() { rays[0] = vec4<f32>(1.0); }";
    let kernel = gpu.kernel_from_text("tests/stride", text, "main", &[]).unwrap();
    let hits = gpu.buffer::<[f32; 5]>("hits", 64, Usage::Storage).unwrap();
    let tiny = gpu.buffer::<f32>("tiny", 1, Usage::Storage).unwrap();
    let mut recorder = gpu.record(never()).unwrap();
    let stride = message(recorder.pass("stride", &kernel).bind("rays", &hits).dispatch(1));
    assert!(stride.contains("16 bytes") && stride.contains("20") && stride.contains("\"hits\""), "{stride}");
    let small = message(recorder.pass("stride", &kernel).bind("rays", &tiny).dispatch(1));
    assert!(small.contains("needs 16 bytes") && small.contains("\"tiny\""), "{small}");
}

#[test]
fn grids_beyond_65535_workgroups_reach_every_item() {
    let _alone = alone();
    let gpu = device();
    let body = NUMBER.replace("workgroup_size(64)", "workgroup_size(1)").replace("64u", "1u");
    let kernel = kernel(&body);
    for count in [1usize, 65_535, 65_536, 200_003] {
        let out = gpu.buffer::<u32>("out", count, Usage::Storage).unwrap();
        let mut recorder = gpu.record(never()).unwrap();
        recorder.pass("number", &kernel).bind("out", &out).dispatch(count).unwrap();
        recorder.finish().unwrap();
        let read = gpu.read(&out).unwrap();
        assert!(read.iter().enumerate().all(|(i, &n)| n == i as u32 + 1), "{count} items");
    }
}

#[test]
fn indirect_dispatch_folds_like_the_host() {
    let _alone = alone();
    let gpu = device();
    let plan = kernel(
        "@compute @workgroup_size(1) fn main() { let s = dispatch_size(grid.end * 0u + 200003u, 1u); out[0] = s.x; out[1] = s.y; out[2] = s.z; }",
    );
    let body = NUMBER
        .replace("workgroup_size(64)", "workgroup_size(1)")
        .replace("64u", "1u")
        .replace("item >= grid.end", "item >= 200003u");
    let number = kernel(&body);
    let out = gpu.buffer::<u32>("out", 200_003, Usage::Storage).unwrap();
    let arguments = gpu.buffer::<u32>("arguments", 3, Usage::Indirect).unwrap();
    let plain = gpu.buffer::<u32>("plain", 3, Usage::Storage).unwrap();
    let mut recorder = gpu.record(never()).unwrap();
    recorder.pass("plan", &plan).bind("out", &arguments).dispatch(1).unwrap();
    assert!(
        message(recorder.pass("number", &number).bind("out", &out).dispatch_indirect(&plain, 0)).contains("Indirect")
    );
    recorder.pass("number", &number).bind("out", &out).dispatch_indirect(&arguments, 0).unwrap();
    recorder.finish().unwrap();
    assert!(gpu.read(&out).unwrap().iter().enumerate().all(|(i, &n)| n == i as u32 + 1));
}

/// Work that takes about a microsecond an item: a chain of dependent steps.
const SLOW: &str = "
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) workgroup: vec3<u32>, @builtin(num_workgroups) workgroups: vec3<u32>,
        @builtin(local_invocation_index) local: u32) {
    let item = item_index(grid, workgroup, workgroups, 64u, local);
    if item >= grid.end { return; }
    var x = item;
    for (var i = 0u; i < 3000u; i++) { x = x * 1664525u + 1013904223u; }
    out[item] = x | 1u;
}
";

fn slow_answer(item: u32) -> u32 {
    (0..3000).fold(item, |x, _| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223)) | 1
}

#[test]
fn long_work_is_cut_and_can_be_cancelled() {
    let _alone = alone();
    let gpu = device();
    let kernel = kernel(SLOW);
    let count = 300_000;
    let out = gpu.buffer::<u32>("out", count, Usage::Storage).unwrap();
    let asked = AtomicUsize::new(0);
    let ask = || {
        asked.fetch_add(1, Ordering::Relaxed);
        false
    };
    let mut recorder = gpu.record(&ask).unwrap();
    // A far too high estimate still ends, with many pieces; a far too low one begins with an eighth of a piece.
    recorder.pass("slow", &kernel).bind("out", &out).dispatch_cut(count, 20_000.0).unwrap();
    let times = recorder.finish().unwrap();
    assert!(asked.load(Ordering::Relaxed) > 3, "asked between the pieces");
    let read = gpu.read(&out).unwrap();
    for item in [0u32, 1, 63, 64, 65, 99_999, 299_999] {
        assert_eq!(read[item as usize], slow_answer(item), "item {item}");
    }
    assert!(read.iter().all(|&x| x != 0), "no item between the pieces is lost");
    assert!(times.of("slow") > 0.0);

    let out = gpu.buffer::<u32>("out", count, Usage::Storage).unwrap();
    let asked = AtomicUsize::new(0);
    let stop = || asked.fetch_add(1, Ordering::Relaxed) >= 1;
    let mut recorder = gpu.record(&stop).unwrap();
    let started = Instant::now();
    let ended = recorder.pass("slow", &kernel).bind("out", &out).dispatch_cut(1 << 30, 20_000.0);
    assert!(matches!(ended, Err(Error::Shader(_) | Error::Cancelled)), "{ended:?}");
    assert!(started.elapsed() < Duration::from_secs(5));
    // Cancelled work leaves the device usable.
    let mut recorder = gpu.record(never()).unwrap();
    recorder.pass("slow", &kernel).bind("out", &out).dispatch(64).unwrap();
    recorder.finish().unwrap();
}

#[test]
fn predictions_learn_from_work_that_was_not_cut() {
    let _alone = alone();
    let gpu = device();
    // Nothing is written, so that there may be as many items as this adapter needs for a fifth of a second.
    let body = SLOW.replace("out[item] = x | 1u;", "if x == 1u { out[0] = x; }").replace("3000u", "9000u");
    let kernel = gpu.kernel_from_text("tests/learn", &format!("{HEAD}{body}"), "main", &[]).unwrap();
    let out = gpu.buffer::<u32>("out", 1, Usage::Storage).unwrap();
    let mut count = 100_000;
    loop {
        let mut recorder = gpu.record(never()).unwrap();
        recorder.pass("slow", &kernel).bind("out", &out).dispatch(count).unwrap();
        if recorder.finish().unwrap().of("slow") > 200.0 {
            break;
        }
        count *= 2;
    }
    // Nothing is known of its cost yet; the estimate is far too low.
    let mut pieces = Vec::new();
    for _ in 0..2 {
        let asked = AtomicUsize::new(0);
        let ask = || {
            asked.fetch_add(1, Ordering::Relaxed);
            false
        };
        let mut recorder = gpu.record(&ask).unwrap();
        recorder.pass("slow", &kernel).bind("out", &out).dispatch_cut(count, 1e-3).unwrap();
        recorder.finish().unwrap();
        pieces.push(asked.load(Ordering::Relaxed));
    }
    assert!(pieces[0] <= 2 && pieces[1] >= 4, "asked {pieces:?} times");
}

#[test]
fn cutting_needs_the_grid() {
    let gpu = device();
    let text = "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
        @compute @workgroup_size(1) fn main() { out[0] = 1u; }";
    let kernel = gpu.kernel_from_text("tests/gridless", text, "main", &[]).unwrap();
    let out = gpu.buffer::<u32>("out", 1, Usage::Storage).unwrap();
    let mut recorder = gpu.record(never()).unwrap();
    assert!(message(recorder.pass("one", &kernel).bind("out", &out).dispatch_cut(1, 1.0)).contains("grid"));
}

#[test]
fn times_add_up_and_nest() {
    let _alone = alone();
    let gpu = device();
    let kernel = kernel(SLOW);
    // Enough of it to fill a GPU: below that more items take no more time.
    let part = if gpu.software() { 20_000 } else { 2_000_000 };
    let out = gpu.buffer::<u32>("out", 3 * part, Usage::Storage).unwrap();
    gpu.wait().unwrap();
    let started = Instant::now();
    let mut recorder = gpu.record(never()).unwrap();
    recorder.pass("warm", &kernel).bind("out", &out).dispatch(64).unwrap();
    recorder
        .scope("direct", |r| {
            for _ in 0..3 {
                r.pass("slow", &kernel).bind("out", &out).dispatch(3 * part)?;
            }
            r.host("sleep", |_, _| {
                std::thread::sleep(Duration::from_millis(40));
                Ok(())
            })
        })
        .unwrap();
    recorder.pass("slow", &kernel).bind("out", &out).dispatch(part).unwrap();
    let times = recorder.finish().unwrap();
    let wall = started.elapsed().as_secs_f64() * 1e3;
    let names: Vec<&str> = times.stages.iter().map(|(n, _)| n.as_str()).collect();
    assert_eq!(names, ["warm", "direct/slow", "direct/sleep", "slow", "host"]);
    let sum: f64 = times.stages.iter().map(|(_, ms)| ms).sum();
    println!("{times:#?} wall {wall} ms");
    assert!((sum - wall).abs() <= 0.1 * wall, "stages {sum} ms, wall {wall} ms");
    assert!((times.total_ms - wall).abs() <= 0.1 * wall);
    assert!(times.of("direct/sleep") >= 39.0 && times.of("direct/sleep") < 80.0);
    assert!((times.of("direct") - times.of("direct/slow") - times.of("direct/sleep")).abs() < 1e-9);
    // Negative control: three times nine parts of work against one part, so the times are not made up.
    let ratio = times.of("direct/slow") / times.of("slow");
    assert!((4.0..20.0).contains(&ratio), "ratio {ratio}");
    assert!(times.of("host") < 0.2 * wall, "{times:?}");
}

#[test]
fn more_passes_than_one_query_set_holds() {
    let _alone = alone();
    let gpu = device();
    let kernel = kernel(NUMBER);
    let out = gpu.buffer::<u32>("out", 64, Usage::Storage).unwrap();
    let mut recorder = gpu.record(never()).unwrap();
    for _ in 0..5000 {
        recorder.pass("number", &kernel).bind("out", &out).dispatch(64).unwrap();
    }
    let times = recorder.finish().unwrap();
    assert_eq!(gpu.read(&out).unwrap()[1], 5000 * 2);
    assert!(times.of("number") > 0.0);
}
