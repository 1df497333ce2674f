//! Areas add up, triangles have their part, points keep apart, and the same input gives the same points.

use std::time::Instant;

use glam::{DMat3, DVec3, Vec3};

use super::*;

/// A grid of `side` × `side` squares over the unit square.
fn square(side: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let at = |i: u32| i as f32 / side as f32;
    let positions = (0..=side).flat_map(|y| (0..=side).map(move |x| Vec3::new(at(x), at(y), 0.0))).collect();
    let corner = |x: u32, y: u32| y * (side + 1) + x;
    let squares = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
    let triangles = squares.flat_map(|(x, y)| {
        let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
        [[a, b, c], [a, c, d]]
    });
    (positions, triangles.collect())
}

fn places(positions: &[Vec3], triangles: &[[u32; 3]], map: DMat3, samples: &[SurfaceSample]) -> Vec<DVec3> {
    let place = |s: &SurfaceSample| {
        let [a, b, c] = triangles[s.triangle as usize].map(|v| map * positions[v as usize].as_dvec3());
        a + f64::from(s.u) * (b - a) + f64::from(s.v) * (c - a)
    };
    samples.iter().map(place).collect()
}

/// Mean distance to the nearest other point, over that of white noise: 1 / (2 sqrt(density)).
fn nearest(points: &[DVec3], area: f64) -> (f64, f64) {
    let white = 0.5 * (area / points.len() as f64).sqrt();
    let others = |i: usize| points.iter().enumerate().filter(move |(j, _)| *j != i).map(|(_, p)| *p);
    let each: Vec<f64> = points
        .iter()
        .enumerate()
        .map(|(i, p)| others(i).map(|q| p.distance(q)).fold(f64::INFINITY, f64::min) / white)
        .collect();
    (each.iter().sum::<f64>() / each.len() as f64, each.iter().copied().fold(f64::INFINITY, f64::min))
}

#[test]
fn areas_add_up_also_where_the_transform_stretches() {
    let (positions, triangles) = square(5);
    for map in [DMat3::IDENTITY, DMat3::from_diagonal(DVec3::new(3.0, 0.2, 7.0))] {
        let whole = area(&positions, &triangles, map);
        assert!((whole / (map.x_axis.x * map.y_axis.y) - 1.0).abs() < 1e-6);
        for count in [1, 2, 100, 1000] {
            let samples = sample(&positions, &triangles, map, count, 3);
            assert_eq!(samples.len(), count);
            let sum: f64 = samples.iter().map(|s| s.area).sum();
            assert!((sum / whole - 1.0).abs() < 1e-9, "{sum} of {whole}");
            assert!(samples.iter().all(|s| s.area > 0.0 && s.u >= 0.0 && s.v >= 0.0 && s.u + s.v <= 1.0));
            assert!(samples.is_sorted_by_key(|s| s.triangle));
        }
    }
    assert!(sample(&positions, &triangles, DMat3::ZERO, 10, 3).is_empty());
}

#[test]
fn points_keep_apart_and_white_noise_does_not() {
    let (positions, triangles) = square(20);
    for map in [DMat3::IDENTITY, DMat3::from_diagonal(DVec3::new(4.0, 0.5, 1.0))] {
        let whole = area(&positions, &triangles, map);
        let samples = sample(&positions, &triangles, map, 1000, 1);
        let (mean, least) = nearest(&places(&positions, &triangles, map, &samples), whole);
        // A hexagonal grid has 2.15.
        assert!(mean > 1.5 && least > 1.0, "{mean} {least}");
        let mesh = Triangles::new(&positions, &triangles, map);
        let white: Vec<DVec3> = (0..1000).map(|i| candidates(&mesh, 1, i)[0].position).collect();
        let (mean, least) = nearest(&white, whole);
        assert!(mean < 1.15 && least < 0.3, "{mean} {least}");
    }
}

#[test]
fn triangles_are_hit_as_large_as_they_are() {
    // Two sheets, one of them nine times as large, a hundredth of its width apart.
    let corner = |x: f32, y: f32, z: f32| Vec3::new(x, y, z);
    let large = [corner(0.0, 0.0, 0.0), corner(3.0, 0.0, 0.0), corner(0.0, 3.0, 0.0)];
    let small = [corner(0.0, 0.0, 0.03), corner(0.0, 1.0, 0.03), corner(1.0, 0.0, 0.03)];
    let positions = [large, small].concat();
    let triangles = [[0, 1, 2], [3, 4, 5]];
    let samples = sample(&positions, &triangles, DMat3::IDENTITY, 2000, 5);
    let on_small = samples.iter().filter(|s| s.triangle == 1).count();
    assert!((160..240).contains(&on_small), "{on_small} of 2000, 200 would be right");
    let area: f64 = samples.iter().filter(|s| s.triangle == 1).map(|s| s.area).sum();
    assert!((area - 0.5).abs() < 0.5 * 3e-3, "{area} instead of 0.5: one candidate in 1,000");
}

#[test]
fn the_same_input_gives_the_same_points_and_another_seed_others() {
    let (positions, triangles) = square(3);
    let made = |seed| sample(&positions, &triangles, DMat3::IDENTITY, 500, seed);
    assert_eq!(made(4), made(4));
    assert_ne!(made(4), made(5));
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    assert!(alone.is_ok_and(|pool| pool.install(|| made(4)) == made(4)));
}

#[test]
fn a_million_triangles_take_no_longer_than_a_frame_may_wait() {
    let (positions, triangles) = square(708);
    let started = Instant::now();
    let samples = sample(&positions, &triangles, DMat3::IDENTITY, 16_384, 0);
    let seconds = started.elapsed().as_secs_f64();
    assert_eq!(samples.len(), 16_384);
    // Half a second on two idle cores when optimised.
    assert!(seconds < if cfg!(debug_assertions) { 20.0 } else { 2.0 }, "{seconds} s");
    println!("{seconds:.3} s");
}
