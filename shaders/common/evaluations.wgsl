// How many virtual lights were looked at from a point: two words, so that their sum may be larger than one.

@group(0) @binding(14) var<storage, read_write> evaluations: array<atomic<u32>, 2>;

fn evaluated(count: u32) {
    atomicAdd(&evaluations[0], count & 255u);
    atomicAdd(&evaluations[1], count >> 8u);
}
