//! Compaction on the device, and the indirect dispatch that follows it.

use miplight::gpu::{Buffer, Gpu, Resources, Usage, never};
use miplight::passes::refine::compact::{CompactParams, record_with};

/// Marks every item of the list that it is dispatched over.
const MARK: &str = "
import package::common::grid::{Grid, item_index};
@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<storage, read> list: array<u32>;
@group(0) @binding(1) var<storage, read> arguments: array<u32>;
@group(0) @binding(2) var<storage, read_write> marked: array<u32>;
@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i < arguments[3] { marked[list[i]] += 1u; }
}";

/// One flag of `every` is chosen; the others differ in a bit that is looked at, all in bits that are not.
fn flags(items: usize, every: u32) -> Vec<u32> {
    let hash = |i: u32| (i ^ (i >> 13)).wrapping_mul(0x9e37_79b1) >> 7;
    let chosen = |i: u32| every != 0 && hash(i).is_multiple_of(every);
    (0..items as u32).map(|i| hash(i + 1) << 8 | 0x30 | if chosen(i) { 5 } else { 1 + 3 * (i & 1) }).collect()
}

struct Compacted {
    list: Vec<u32>,
    arguments: Vec<u32>,
    marked: Vec<u32>,
}

fn compacted(gpu: &Gpu, given: &[u32], value: u32) -> Compacted {
    let items = given.len();
    let mark = gpu.kernel_from_text("tests/mark", MARK, "main", &[]).unwrap();
    let mut resources = Resources::new(gpu);
    let flags = gpu.upload("flags", given).unwrap();
    let list: Buffer<u32> = gpu.buffer("list", items, Usage::Storage).unwrap();
    let arguments: Buffer<u32> = gpu.buffer("arguments", 4, Usage::Indirect).unwrap();
    let marked: Buffer<u32> = gpu.buffer("marked", items, Usage::Storage).unwrap();
    arguments.write(gpu, 0, &[9, 9, 9, 9]).unwrap();
    let mut recorder = gpu.record(never()).unwrap();
    let params = CompactParams { items: items as u32, mask: 7, value, scanned: 0 };
    record_with(&mut recorder, &mut resources, "compact", params, &flags, &list, &arguments).unwrap();
    let pass = recorder.pass("mark", &mark).bind("list", &list).bind("arguments", &arguments);
    pass.bind("marked", &marked).dispatch_indirect(&arguments, 0).unwrap();
    recorder.finish().unwrap();
    let [list, arguments, marked] = [&list, &arguments, &marked].map(|buffer| gpu.read(buffer).unwrap());
    Compacted { list, arguments, marked }
}

#[test]
fn the_list_is_in_order_and_an_indirect_dispatch_reaches_exactly_its_items() {
    let gpu = Gpu::new("auto").unwrap();
    for items in [0usize, 1, 63, 64, 65, 2048, 2049, 4095, 131_072, 131_073, 1_000_003] {
        for every in [0, 1, 2, 37] {
            let given = flags(items, every);
            let expected: Vec<u32> = (0..items as u32).filter(|&i| given[i as usize] & 7 == 5).collect();
            let found = compacted(&gpu, &given, 5);
            assert_eq!(found.arguments[3] as usize, expected.len(), "{items} items, every {every}");
            assert_eq!(found.list[..expected.len()], expected, "{items} items, every {every}");
            assert!(found.list[expected.len()..].iter().all(|&i| i == 0), "nothing is written beyond the list");
            assert!(found.arguments[0] as usize * found.arguments[1] as usize >= expected.len().div_ceil(64));
            let marks = given.iter().map(|f| u32::from(f & 7 == 5));
            assert!(marks.eq(found.marked.iter().copied()), "{items} items, every {every}");
            // Negative control: another value chooses others.
            let others = compacted(&gpu, &given, 4);
            assert!(expected.is_empty() || others.marked != found.marked);
        }
    }
}

#[test]
fn short_lists_are_refused() {
    let gpu = Gpu::new("auto").unwrap();
    let mut resources = Resources::new(&gpu);
    let flags = gpu.upload("flags", &[1u32; 65]).unwrap();
    let list: Buffer<u32> = gpu.buffer("list", 64, Usage::Storage).unwrap();
    let arguments: Buffer<u32> = gpu.buffer("arguments", 4, Usage::Indirect).unwrap();
    let mut recorder = gpu.record(never()).unwrap();
    let params = CompactParams { items: 65, mask: 1, value: 1, scanned: 0 };
    let error = record_with(&mut recorder, &mut resources, "choose", params, &flags, &list, &arguments).unwrap_err();
    assert!(error.to_string().contains("\"choose\""), "{error}");
}
