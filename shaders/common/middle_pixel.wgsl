// The pixel that stands for a texel: the surface pixel nearest to its middle.

import package::common::gbuffer::SURFACE;
import package::common::pyramid::pyramid;

@group(0) @binding(27) var<storage, read> g_normal: array<vec4u>;

// Of the pixels (first column and row, columns and rows) the first of the nearest, row by row.
fn middle_pixel(pixels: vec4u) -> vec2u {
    var best = pixels.xy + pixels.zw / 2u;
    if g_normal[best.y * pyramid.levels[0].x + best.x].w == SURFACE {
        return best;
    }
    let middle = vec2i(2u * pixels.xy + pixels.zw) - 1;
    var least = 0x7fffffff;
    for (var k = 0u; k < pixels.z * pixels.w; k++) {
        let pixel = pixels.xy + vec2u(k % pixels.z, k / pixels.z);
        let apart = 2 * vec2i(pixel) - middle;
        let far = apart.x * apart.x + apart.y * apart.y;
        if far < least && g_normal[pixel.y * pyramid.levels[0].x + pixel.x].w == SURFACE {
            least = far;
            best = pixel;
        }
    }
    return best;
}
