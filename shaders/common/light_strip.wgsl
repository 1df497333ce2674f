// Means of a light's picture over one rectangle after the other of a strip of it. One that is too small for a difference
// of sums begins at an earlier column: a branch for it would be run wherever any thread takes it.

import package::common::light_sums::{LEAST_SHARE, light_sums, sum_at};

struct Strip {
    rows: vec2f,    // texels
    way: f32,       // 1 or -1: along the columns or against them
    least: f32,     // columns
    start: f32,     // column at which the rectangle begins
    sums: vec3f,    // there, of the strip
    mark: f32,      // a later one, for when the end is far enough from it
    sums_at_mark: vec3f,
    whole: vec3f,   // mean less that of the picture
}

fn sums_of(size: vec2u, column: f32, rows: vec2f) -> vec3f {
    return sum_at(size, vec2f(column, rows.y)) - sum_at(size, vec2f(column, rows.x));
}

// Such a column that a rectangle to it may be large enough.
fn column_of(size: vec2u, column: f32, least: f32, way: f32) -> f32 {
    let wide = f32(size.x);
    return clamp(column * wide, select(0.0, least, way > 0.0), select(wide - least, wide, way > 0.0));
}

// `rows` and `column`: shares of the picture.
fn strip_of(size: vec2u, rows: vec2f, column: f32, way: f32) -> Strip {
    let texels = vec2f(size);
    let side = sqrt(LEAST_SHARE);
    let tall = max(abs(rows.y - rows.x), side);
    let middle = clamp(0.5 * (rows.x + rows.y), 0.5 * tall, 1.0 - 0.5 * tall);
    let strip = clamp(middle + vec2f(-0.5, 0.5) * tall, vec2f(0.0), vec2f(1.0)) * texels.y;
    let least = LEAST_SHARE / tall * texels.x;
    let mark = column_of(size, column, least, way);
    let start = mark - way * least;
    return Strip(
        strip, way, least, start, sums_of(size, start, strip), mark, sums_of(size, mark, strip), vec3f(0.0));
}

// The next rectangle, to a column.
fn strip_to(before: Strip, size: vec2u, column: f32) -> Strip {
    var at = before;
    let end = column_of(size, column, at.least, at.way);
    let sums = sums_of(size, end, at.rows);
    let far = abs(end - at.mark) >= at.least;
    at.start = select(at.start, at.mark, far);
    at.sums = select(at.sums, at.sums_at_mark, far);
    at.mark = select(at.mark, end, far);
    at.sums_at_mark = select(at.sums_at_mark, sums, far);
    at.whole = (sums - at.sums) / ((end - at.start) * (at.rows.y - at.rows.x));
    return at;
}
