// Counter-based random numbers: a hash of where and when, never a state, so that the order of work does not matter.

// [JO20] pcg4d: four well-mixed words from four counters.
fn pcg4d(counter: vec4u) -> vec4u {
    var v = counter * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4u(16u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Four numbers in [0, 1): 24 bits each, so that 1 is never reached by rounding.
fn random4(counter: vec4u) -> vec4f {
    return vec4f(pcg4d(counter) >> vec4u(8u)) * (1.0 / 16777216.0);
}
