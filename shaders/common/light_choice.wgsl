// One point on one light for a surface point, chosen with a density that follows what each light can add.

import package::common::light::{Light, SPOT, light_at, light_radiance_at, lights};

struct LightPoint {
    position: vec3f,
    index: u32,
    radiance: vec3f,    // times area and cosine at the light, over the chance of this light; a spot's intensity
    found: bool,
}

fn luminance(c: vec3f) -> f32 {
    return dot(c, vec3f(0.2126, 0.7152, 0.0722));
}

// An estimate of what the light adds at p; zero only where it can add nothing.
fn light_weight(light: Light, p: vec3f, normal_geo: vec3f) -> f32 {
    let power = luminance(light.radiance) + 1e-4 * (light.radiance.x + light.radiance.y + light.radiance.z);
    if light.kind == SPOT {
        let d = light.corner - p;
        let inside = dot(-d, light.normal) >= light.cos_cutoff * length(d);
        return select(0.0, power / max(dot(d, d), 1e-30), inside && dot(d, normal_geo) > 0.0);
    }
    let corner = light.corner - p;
    let behind = dot(corner, light.normal) >= 0.0 && !light.two_sided;
    let highest = dot(corner, normal_geo) + max(0.0, dot(light.edge_u, normal_geo)) + max(0.0, dot(light.edge_v, normal_geo));
    let middle = corner + 0.5 * (light.edge_u + light.edge_v);
    let cosine = 0.1 + abs(dot(light.normal, middle)) * inverseSqrt(max(dot(middle, middle), 1e-30));
    let weight = power * cosine * light.area / max(dot(middle, middle) + light.area, 1e-30);
    return select(weight, 0.0, behind || highest <= 0.0);
}

// Which light, over how likely it is; over zero where none can add anything.
struct Chosen {
    light: u32,
    over_chance: f32,
}

fn choose_light(count: u32, p: vec3f, normal_geo: vec3f, place: f32) -> Chosen {
    var total = 0.0;
    for (var i = 0u; i < count; i++) {
        total += light_weight(light_at(i), p, normal_geo);
    }
    var left = place * total;
    var chosen = Chosen(0u, 0.0);
    for (var i = 0u; i < count; i++) {
        let w = light_weight(light_at(i), p, normal_geo);
        if w > 0.0 {
            chosen = Chosen(i, total / w);
            left -= w;
            if left < 0.0 {
                break;
            }
        }
    }
    return chosen;
}

// What the lights of a scene are like, as constants, which leave out code that a device without branches would execute.
const SEVERAL: u32 = 1u;
const PICTURES: u32 = 2u;

// `places`: two for the place on the light, the third for which light.
fn choose_light_point(count: u32, features: u32, p: vec3f, normal_geo: vec3f, places: vec3f) -> LightPoint {
    var none: LightPoint;
    none.found = false;
    var chosen = Chosen(0u, 1.0);
    if (features & SEVERAL) != 0u {
        chosen = choose_light(count, p, normal_geo, places.z);
    } else {
        chosen.over_chance = select(0.0, 1.0, light_weight(light_at(0u), p, normal_geo) > 0.0);
    }
    if chosen.over_chance == 0.0 {
        return none;
    }
    let light = light_at(chosen.light);
    if light.kind == SPOT {
        return LightPoint(light.corner, chosen.light, light.radiance * chosen.over_chance, true);
    }
    let position = light.corner + places.x * light.edge_u + places.y * light.edge_v;
    let w = normalize(position - p);
    let facing = -dot(light.normal, w);
    let cos_l = select(max(0.0, facing), abs(facing), light.two_sided);
    var radiance = light.radiance;
    if (features & PICTURES) != 0u {
        radiance = light_radiance_at(light, places.xy);
    }
    return LightPoint(position, chosen.light, radiance * (light.area * cos_l * chosen.over_chance), cos_l > 0.0);
}
