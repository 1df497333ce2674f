// Lights the hits of gather rays: one shadow ray to a point on a light, and one ray that goes on [Kaj86].
// Lights that are seen are black here: what they emit is direct light, and they reflect nothing.
// In: hits. In and out: rays (those that go on), paths. Out: shadow rays.

import package::common::basis::{PI, cosine_direction};
import package::common::gather_path::{GatherPath, GatherWave, NO_PIXEL};
import package::common::grid::{Grid, item_index};
import package::common::light::lights;
import package::common::light_choice::choose_light_point;
import package::common::random::{pcg4d, random4};
import package::common::ray::{Hit, MISS, Ray, inactive_ray};
import package::common::surface::{NO_LIGHT, ORIGIN_ERROR, Surface, geometry, instances, offset_origin, surface_with, texels};

// Of the instances: SMOOTH, COLORS, TEXTURE.
override FEATURES: u32 = 7u;
// Of the lights: SEVERAL, PICTURES.
override LIGHTS: u32 = 3u;
// 1: no ray goes on from these hits; 1: they are of a later bounce. As constants, for what they leave out is a third of it.
override LAST: u32 = 0u;
override LATER: u32 = 0u;
// 1: how the light of the first hits changes is asked for.
override SLOPES: u32 = 0u;

@group(0) @binding(30) var<uniform> grid: Grid;
@group(0) @binding(0) var<uniform> wave: GatherWave;
@group(0) @binding(1) var<storage, read> hits: array<Hit>;
@group(0) @binding(2) var<storage, read_write> rays: array<Ray>;
@group(0) @binding(3) var<storage, read_write> paths: array<GatherPath>;
@group(0) @binding(4) var<storage, read_write> shadow_rays: array<Ray>;

const FAR: f32 = 3e38;
// Of slanted hits' slopes, which are mostly noise below.
const LEAST_COSINE: f32 = 0.25;
// A shadow ray ends just short of the light's point, whose own rounding moves its surface (N5).
const SHADOW_END: f32 = 0.9999;

// Three numbers that cover the cube evenly over a pixel's strata [Rob18]: steps of the R3 sequence from a hashed start,
// in 32-bit fixed point so that no precision is lost; plain random ones from the second bounce on. The third counter
// keeps all draws of a pixel apart: 0 directions, 4 b + 1 lights, 4 b + 2 directions of bounce b, 3 the start.
fn light_places(path: GatherPath) -> vec3f {
    if LATER == 1u {
        return random4(vec4u(path.pixel, path.stratum, 4u * wave.bounce + 1u, wave.seed)).xyz;
    }
    let start = pcg4d(vec4u(path.pixel, 0u, 3u, wave.seed)).xyz;
    let steps = vec3u(3518319155u, 2882110345u, 2360945575u) * path.stratum;
    return vec3f((start + steps) >> vec3u(8u)) * (1.0 / 16777216.0);
}

// The hit's patch fills less of the hemisphere the farther and the more slanted it is: the gradient of
// log (cos cos' / r^2) by the ray's origin, without the part along its own normal [WH92; Krivanek's, without occlusion].
fn slope_of(s: Surface, ray: Ray) -> vec3f {
    let d = s.position - ray.origin;
    let r2 = max(dot(d, d), 1e-30);
    let cosine = max(-dot(s.normal_geo, d) * inverseSqrt(r2), LEAST_COSINE);
    return 4.0 * d / r2 + s.normal_geo * (inverseSqrt(r2) / cosine);
}

// Irradiance of the pixel that the shadow ray carries; zero and no ray where no light can be seen.
fn light_hit(s: Surface, origin: vec3f, path: GatherPath, i: u32) -> vec3f {
    let point = choose_light_point(wave.lights, LIGHTS, origin, s.normal_geo, light_places(path));
    shadow_rays[i] = inactive_ray();
    if !point.found {
        return vec3f(0.0);
    }
    let d = point.position - origin;
    let d2 = dot(d, d);
    let w = d * inverseSqrt(d2);
    let cos_s = dot(s.normal_shade, w);
    if !(d2 > 0.0) || cos_s <= 0.0 || dot(s.normal_geo, w) <= 0.0 {
        return vec3f(0.0);
    }
    shadow_rays[i] = Ray(origin, 0.0, d, SHADOW_END);
    return path.throughput * (s.albedo / PI) * point.radiance * (cos_s / d2);
}

@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = item_index(grid, group, groups, 64u, lane);
    if i >= grid.end {
        return;
    }
    let ray = rays[i];
    let hit = hits[i];
    var path = paths[i];
    path.pending = vec3f(0.0);
    var next = inactive_ray();
    if ray.t_max <= ray.t_min || hit.instance == MISS || instances[hit.instance].light != NO_LIGHT {
        shadow_rays[i] = inactive_ray();
    } else {
        let s = surface_with(hit, ray.direction, FEATURES);
        let origin = offset_origin(s.position, s.normal_geo, s.origin_error);
        path.pending = light_hit(s, origin, path, i);
        if SLOPES == 1u && LATER == 0u {
            path.slope = slope_of(s, ray);
        }
        if LAST == 0u {
            path.throughput *= s.albedo;
            let square = random4(vec4u(path.pixel, path.stratum, 4u * wave.bounce + 2u, wave.seed)).xy;
            let direction = cosine_direction(s.normal_shade, square);
            if dot(direction, s.normal_geo) > 0.0 && any(path.throughput > vec3f(0.0)) {
                next = Ray(origin, 0.0, direction, FAR);
            }
        }
    }
    rays[i] = next;
    paths[i] = path;
}
