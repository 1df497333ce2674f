// The camera in scene space, with the size of the internal image.

struct View {
    eye: vec3f,
    width: u32,
    right: vec3f,
    height: u32,
    up: vec3f,
    fx: f32,
    backward: vec3f,
    fy: f32,
    cx: f32,
    cy: f32,
    first: u32,         // place in the tile order where this list begins
    tiled: u32,         // pixels of the tiles that cover the image
}

// Through the pixel's centre, scaled so that the ray's t is the distance along the view axis.
fn view_direction(view: View, pixel: vec2u) -> vec3f {
    let x = (f32(pixel.x) + 0.5 - view.cx) / view.fx;
    let y = (f32(pixel.y) + 0.5 - view.cy) / view.fy;
    return view.right * x - view.up * y - view.backward;
}
