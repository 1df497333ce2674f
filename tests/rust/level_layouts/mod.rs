//! Twins of the passes that work level by level, of virtual lights and of lobes.

use miplight::gpu::layout::Layout;
use miplight::host_layout;
use miplight::passes::composite::composite::ModulateParams;
use miplight::passes::gather::interleaved::InterleavedParams;
use miplight::passes::gather_points::{GatherPoint, PointParams};
use miplight::passes::indirect::light_cut::CutParams;
use miplight::passes::indirect::vpl_gather::VplGatherParams;
use miplight::passes::indirect::vpl_splat::VplSplatParams;
use miplight::passes::indirect::vpl_visible::VplVisibleParams;
use miplight::passes::lights::rsm_rays::RsmParams;
use miplight::passes::lights::rsm_tree::RsmTreeParams;
use miplight::passes::lights::virtual_light::{RsmMap, VirtualLight};
use miplight::passes::lights::vpl_clusters::VplClustersParams;
use miplight::passes::lights::vpl_grid::VplGridParams;
use miplight::passes::lights::vpl_importance::VplImportanceParams;
use miplight::passes::lobes::lobe_ask::LobeAskParams;
use miplight::passes::lobes::lobe_gather::LobeGatherParams;
use miplight::passes::lobes::lobe_levels::LobeLevelsParams;
use miplight::passes::lobes::lobe_points::LobePointsParams;
use miplight::passes::lobes::lobe_visible::LobeVisibleParams;
use miplight::passes::lpv::Volume;
use miplight::passes::lpv::blockers::BlockersParams;
use miplight::passes::lpv::inject::{EnterParams, InjectParams};
use miplight::passes::lpv::look_up::LookUpParams;
use miplight::passes::lpv::points::{LpvCell, LpvPoint};
use miplight::passes::lpv::propagate::PropagateParams;
use miplight::passes::refine::extra_samples::ExtraSamplesParams;
use miplight::passes::refine::incremental::IncrementalParams;
use miplight::passes::refine::nodes::NodesParams;
use miplight::passes::refine::stop_guard::StopGuardParams;
use miplight::passes::refine::sub_fragments::SubFragmentsParams;
use miplight::passes::refine::vpl_lists::VplListsParams;
use miplight::passes::refine::vpl_points::{ShadedPoint, ShortLight, VplPointsParams};
use miplight::passes::specular::LobeLight;
use miplight::passes::visibility::reuse::ReuseParams;

/// Twins by their place in the shaders.
pub(crate) fn twins() -> Vec<(Layout, &'static str, &'static str)> {
    let nodes = host_layout!(NodesParams { base, parents, patterns, classes, seed, inherit, pad1, pad2 });
    let incremental = host_layout!(IncrementalParams { first, count, words, least_bits, threshold, pad0, pad1, pad2 });
    let subs =
        host_layout!(SubFragmentsParams { first, classes, together, words, least_bits, most_apart, counts, hard });
    let guard = host_layout!(StopGuardParams { first, hard, pad1, pad2 });
    let extra = host_layout!(ExtraSamplesParams { patterns, seed, pad0, pad1 });
    let mut all = lobes();
    all.extend(volumes());
    all.extend(gather_points());
    all.extend(virtual_lights());
    all.extend(virtual_lists());
    all.extend(virtual_fragments());
    all.extend(vec![
        (nodes, "passes/refine/nodes", "NodesParams"),
        (reuse(), "common/facing_bits", "ReuseParams"),
        (interleaved(), "common/light_terms", "InterleavedParams"),
        (subs, "passes/refine/sub_fragments", "SubFragmentsParams"),
        (guard, "passes/refine/stop_guard", "StopGuardParams"),
        (extra, "passes/refine/extra_samples", "ExtraSamplesParams"),
        (incremental, "passes/refine/incremental", "IncrementalParams"),
    ]);
    all
}

fn virtual_lights() -> Vec<(Layout, &'static str, &'static str)> {
    let map = host_layout!(RsmMap {
        origin,
        kind,
        axis,
        tan_half,
        edge_u,
        cos_cutoff,
        edge_v,
        offset,
        tiles,
        resolution,
        equal,
        map
    });
    let light = host_layout!(VirtualLight {
        position,
        area,
        normal,
        radius,
        flux,
        solid_angle,
        spread,
        thickness,
        block,
        extent
    });
    let rays = host_layout!(RsmParams { first, stride, pad0, pad1 });
    let tree = host_layout!(RsmTreeParams { level, finest, maps, single });
    let clusters = host_layout!(VplClustersParams {
        first,
        maps,
        first_spot,
        by_range,
        coarsest_area,
        finest_area,
        coarsest_spot,
        finest_spot,
        depth_threshold,
        normal_threshold,
        pad0,
        pad1
    });
    let dense = host_layout!(VplImportanceParams { count, maps, finest, seed });
    let regular = host_layout!(VplGridParams { resolution, across, first_map, first_light });
    vec![
        (map, "common/rsm", "RsmMap"),
        (light, "common/virtual_light", "VirtualLight"),
        (rays, "passes/lights/rsm_rays", "RsmParams"),
        (tree, "passes/lights/rsm_tree", "RsmTreeParams"),
        (clusters, "passes/lights/vpl_clusters", "VplClustersParams"),
        (dense, "passes/lights/vpl_importance", "VplImportanceParams"),
        (regular, "passes/lights/vpl_grid", "VplGridParams"),
    ]
}

fn virtual_lists() -> Vec<(Layout, &'static str, &'static str)> {
    let point = host_layout!(ShadedPoint { origin, exponent, normal_shade, red, normal_geo, green, mirror, blue });
    let short = host_layout!(ShortLight { place, facing, flux });
    let points = host_layout!(VplPointsParams { lights, reach, threshold, first, end, pad0, pad1, pad2 });
    let lists = host_layout!(VplListsParams { first, count, words, lowest, reach, pad0, pad1, pad2 });
    vec![
        (point, "common/shaded_point", "ShadedPoint"),
        (short, "common/shaded_point", "ShortLight"),
        (points, "passes/refine/vpl_points", "VplPointsParams"),
        (lists, "common/vpl_masks", "VplListsParams"),
    ]
}

fn virtual_fragments() -> Vec<(Layout, &'static str, &'static str)> {
    let cut = host_layout!(CutParams {
        roots,
        coarsest,
        finest,
        maps,
        bound,
        threshold,
        reach,
        rays,
        seed,
        maps_size,
        reference,
        first_root,
        part,
        parts,
        pad0,
        pad1
    });
    let gather = host_layout!(VplGatherParams { first, end, reach, part, parts, pad0, pad1, pad2 });
    let splat = host_layout!(VplSplatParams { width, height, first, reach });
    let visible = host_layout!(VplVisibleParams { rays, pad0, pad1, pad2 });
    let modulate = host_layout!(ModulateParams { eye, modulation });
    vec![
        (cut, "common/light_cut", "CutParams"),
        (gather, "passes/indirect/vpl_gather", "VplGatherParams"),
        (splat, "passes/indirect/vpl_splat", "VplSplatParams"),
        (visible, "passes/indirect/vpl_visible", "VplVisibleParams"),
        (modulate, "passes/composite/composite", "ModulateParams"),
    ]
}

fn lobes() -> Vec<(Layout, &'static str, &'static str)> {
    let ask = host_layout!(LobeAskParams { first, strata, words, pad });
    let gather = host_layout!(LobeGatherParams { first, strata, words, two_sided, normal, places });
    let levels = host_layout!(LobeLevelsParams { lights, texels, threshold, pad });
    let points = host_layout!(LobePointsParams { patterns, seed, pad0, pad1 });
    let visible = host_layout!(LobeVisibleParams { first, places, side, pad });
    vec![
        (lobe_light(), "common/lobe_patch", "LobeLight"),
        (ask, "passes/lobes/lobe_ask", "LobeAskParams"),
        (gather, "passes/lobes/lobe_gather", "LobeGatherParams"),
        (levels, "passes/lobes/lobe_levels", "LobeLevelsParams"),
        (points, "passes/lobes/lobe_points", "LobePointsParams"),
        (visible, "passes/lobes/lobe_visible", "LobeVisibleParams"),
    ]
}

fn lobe_light() -> Layout {
    host_layout!(LobeLight {
        corner,
        two_sided,
        edge_u,
        area,
        edge_v,
        light,
        normal,
        seed,
        dual_u,
        columns,
        dual_v,
        rows,
        radiance,
        side,
        least,
        pad0,
        pad1,
        pad2
    })
}

fn reuse() -> Layout {
    host_layout!(ReuseParams {
        light_normal,
        two_sided,
        cone_axis,
        cos_cutoff,
        first,
        strata,
        words,
        reuse,
        corner,
        classes,
        edge_u,
        together,
        edge_v,
        above
    })
}

fn interleaved() -> Layout {
    host_layout!(InterleavedParams {
        first,
        strata,
        words,
        classes,
        normal,
        cos_cutoff,
        corner,
        two_sided,
        step_u,
        row,
        step_v,
        pad
    })
}

/// Those of light propagation volumes.
fn volumes() -> Vec<(Layout, &'static str, &'static str)> {
    let propagate = host_layout!(PropagateParams {
        mean_of_mean,
        mean_of_along,
        along_of_mean,
        along_of_along,
        across,
        most,
        reflected,
        first
    });
    vec![
        (host_layout!(Volume { corner, edge, size, cells }), "common/lpv_volume", "Volume"),
        (host_layout!(LpvPoint { normal, area, instance, triangle, u, v }), "common/lpv_point", "LpvPoint"),
        (host_layout!(LpvCell { cell, first, count, pad }), "common/lpv_point", "LpvCell"),
        (host_layout!(InjectParams { side, most }), "passes/lpv/inject", "InjectParams"),
        (host_layout!(EnterParams { side, most, outer, outer_cells, first, pad }), "passes/lpv/inject", "EnterParams"),
        (host_layout!(BlockersParams { first, pad0, pad1, pad2 }), "passes/lpv/blockers", "BlockersParams"),
        (host_layout!(LookUpParams { scale, pad0, pad1, pad2 }), "passes/lpv/look_up", "LookUpParams"),
        (propagate, "passes/lpv/propagate", "PropagateParams"),
    ]
}

fn gather_points() -> Vec<(Layout, &'static str, &'static str)> {
    let point = host_layout!(GatherPoint {
        position,
        inverse,
        normal,
        level,
        red,
        met,
        green,
        pad1,
        blue,
        pad2,
        red_slope,
        pad3,
        green_slope,
        pad4,
        blue_slope,
        pad5
    });
    let params = host_layout!(PointParams { reach, first, count, covered });
    vec![(point, "common/gather_point", "GatherPoint"), (params, "common/gather_point", "PointParams")]
}

#[test]
fn constants_of_volumes_are_the_same_on_both_sides() {
    use miplight::gpu::{Gpu, Usage, never};
    use miplight::passes::lpv::points::{CLEAR, NOWHERE};
    let text = "
import package::common::lpv_volume::{CLEAR, NOWHERE};
@group(0) @binding(0) var<storage, read_write> out: array<f32>;
@compute @workgroup_size(1)
fn main() {
    out[0] = CLEAR;
    out[1] = NOWHERE;
}";
    let device = Gpu::new("auto").unwrap();
    let kernel = device.kernel_from_text("tests/volume_constants", text, "main", &[]).unwrap();
    let out = device.buffer::<f32>("out", 2, Usage::Storage).unwrap();
    let mut recorder = device.record(never()).unwrap();
    recorder.pass("constants", &kernel).bind("out", &out).dispatch_groups(1).unwrap();
    recorder.finish().unwrap();
    assert_eq!(device.read(&out).unwrap(), [CLEAR, NOWHERE]);
}
