// Ray counter: how many rays a dispatch traced, added up in a workgroup first.
// Integers, so that the order does not matter; two words, because a frame may trace more than 2^32.

@group(0) @binding(7) var<storage, read_write> counter: array<atomic<u32>, 2>;

var<workgroup> rays_here: atomic<u32>;

fn count_rays(rays: u32) {
    atomicAdd(&rays_here, rays);
}

// All threads of a workgroup call it, once, after they have counted.
fn add_rays(lane: u32) {
    workgroupBarrier();
    if lane == 0u {
        let rays = atomicLoad(&rays_here);
        let before = atomicAdd(&counter[0], rays);
        if before + rays < before {
            atomicAdd(&counter[1], 1u);
        }
    }
}
