// Whether a surface point can receive anything from a light, and if not, why not; occluders apart.

import package::common::light::{Light, SPOT};
import package::common::light_frame::{LightFrame, in_light_frame};
import package::common::polygon::FAR_SIZES;

struct Facing {
    place: vec3f,       // a, b, h in the light's frame
    facing: bool,
    behind: bool,       // the light does not emit towards the point
    clipped: bool,      // a horizon of the point crosses the light
    near: bool,
}

// Least and largest height over the plane through `origin` with normal `n` that the light reaches.
fn light_heights(light: Light, origin: vec3f, n: vec3f) -> vec2f {
    let at_corner = dot(n, light.corner - origin);
    let u = dot(n, light.edge_u);
    let v = dot(n, light.edge_v);
    return vec2f(at_corner + min(0.0, u) + min(0.0, v), at_corner + max(0.0, u) + max(0.0, v));
}

fn facing_of(light: Light, frame: LightFrame, origin: vec3f, normal_geo: vec3f, normal_shade: vec3f) -> Facing {
    let place = in_light_frame(frame, origin);
    let geometric = light_heights(light, origin, normal_geo);
    let shading = light_heights(light, origin, normal_shade);
    let to_middle = light.corner + 0.5 * (light.edge_u + light.edge_v) - origin;
    let distance2 = dot(to_middle, to_middle);
    let size2 = max(dot(light.edge_u, light.edge_u), dot(light.edge_v, light.edge_v));
    let in_cone = light.kind != SPOT || place.z >= frame.cos_cutoff * sqrt(distance2);
    let emits = select(place.z > 0.0, place.z != 0.0, frame.two_sided != 0u) && in_cone;
    var f: Facing;
    f.place = place;
    f.behind = !emits;
    f.facing = emits && geometric.y > 0.0 && shading.y > 0.0;
    f.clipped = min(geometric.x, shading.x) < 0.0;
    f.near = distance2 <= FAR_SIZES * FAR_SIZES * size2;
    return f;
}
