//! The trees themselves: every triangle once, boxes that hold what is below, refit, hard input.
mod trace_common;
use glam::Vec3;
use miplight::scene::bvh::{Blas, Bounds, Child, Tlas};
use std::time::Instant;
use trace_common::{Mesh, Random, grid, soup, sphere};

fn triangle_bounds(mesh: &Mesh, triangle: u32) -> Bounds {
    let corners = mesh.triangles[triangle as usize].map(|v| mesh.positions[v as usize]);
    corners.iter().fold(Bounds::EMPTY, |b, &p| b.union(Bounds { lo: p, hi: p }))
}

fn holds(outer: Bounds, inner: Bounds) -> bool {
    outer.lo.cmple(inner.lo).all() && outer.hi.cmpge(inner.hi).all()
}

/// Walks both layouts; an error names what is broken.
fn validate(blas: &Blas, mesh: &Mesh) -> Result<(), String> {
    let mut seen = vec![0; mesh.triangles.len()];
    let nodes = blas.nodes_bvh2();
    for (at, node) in nodes.iter().enumerate() {
        let below: Vec<Bounds> = if node.is_leaf() {
            let slots = &blas.triangle_order()[node.first as usize..(node.first + node.count) as usize];
            slots.iter().for_each(|&t| seen[t as usize] += 1);
            slots.iter().map(|&t| triangle_bounds(mesh, t)).collect()
        } else {
            if node.first as usize <= at {
                return Err(format!("node {at} has a child before it"));
            }
            (0..2).map(|i| nodes[node.first as usize + i].bounds()).collect()
        };
        if below.iter().fold(Bounds::EMPTY, |a, &b| a.union(b)) != node.bounds() {
            return Err(format!("box of node {at}"));
        }
    }
    if seen.iter().any(|&n| n != 1) {
        return Err("a triangle is not in exactly one leaf".into());
    }
    let mut wide = vec![0; mesh.triangles.len()];
    let mut todo = vec![(Child::ROOT, blas.bounds(), 1)];
    while let Some((child, bounds, depth)) = todo.pop() {
        if child.is_leaf() {
            for &t in &blas.blocks()[child.index()].triangle[..child.count()] {
                wide[t as usize] += 1;
                if !holds(bounds, triangle_bounds(mesh, t)) {
                    return Err(format!("triangle {t} sticks out"));
                }
            }
        } else {
            let node = &blas.nodes_wide()[child.index()];
            for slot in 0..node.count as usize {
                let row = |i: usize| node.bounds[i][slot];
                let inner = Bounds { lo: Vec3::new(row(0), row(1), row(2)), hi: Vec3::new(row(3), row(4), row(5)) };
                if !holds(bounds, inner) || depth > blas.depth_wide() {
                    return Err(format!("node {}", child.index()));
                }
                todo.push((node.children[slot], inner, depth + usize::from(!node.children[slot].is_leaf())));
            }
        }
    }
    if wide.iter().any(|&n| n != 1) { Err("a triangle is not in exactly one block".into()) } else { Ok(()) }
}

#[test]
fn trees_hold_every_triangle_once() {
    let mut random = Random::new(1);
    for mesh in
        [soup(1, 1.0, &mut random), soup(2, 1.0, &mut random), soup(3000, 0.1, &mut random), sphere(4, 0.1), grid(40)]
    {
        let blas = Blas::build(&mesh.positions, &mesh.triangles);
        assert_eq!(validate(&blas, &mesh), Ok(()));
        assert_eq!(blas.triangle_count(), mesh.triangles.len());
        // Control: the tree of another mesh is not one of this.
        let mut moved = mesh.clone();
        moved.positions[0] += Vec3::splat(10.0);
        assert!(validate(&blas, &moved).is_err());
    }
    assert!(Blas::build(&[], &[]).nodes_bvh2().is_empty());
}

#[test]
fn refit_follows_the_vertices() {
    let mut mesh = sphere(4, 0.1);
    let blas = Blas::build(&mesh.positions, &mesh.triangles);
    mesh.positions.iter_mut().for_each(|p| *p = *p * 1.5 + Vec3::new(p.y, 0.0, 3.0));
    let fitted = blas.refit(&mesh.positions, &mesh.triangles);
    assert_eq!(validate(&fitted, &mesh), Ok(()));
    assert_eq!(fitted.triangle_order(), blas.triangle_order());
    assert!(validate(&blas, &mesh).is_err());
    assert_eq!(validate(&blas.rebuild(&mesh.positions, &mesh.triangles), &mesh), Ok(()));
}

#[test]
fn bad_triangles_are_left_out() {
    let mut mesh = sphere(2, 0.0);
    mesh.positions[5].y = f32::NAN;
    mesh.positions[6].x = f32::INFINITY;
    mesh.triangles.push([0, 1, 1_000_000]);
    let bad = |t: &&[u32; 3]| t.iter().any(|&i| i == 5 || i == 6 || i == 1_000_000);
    let blas = Blas::build(&mesh.positions, &mesh.triangles);
    assert_eq!(blas.triangle_count(), mesh.triangles.len() - mesh.triangles.iter().filter(bad).count());
    assert!(blas.bounds().lo.is_finite() && blas.bounds().hi.is_finite());
}

#[test]
fn hard_input_builds_in_good_time_and_depth() {
    let mut random = Random::new(2);
    let one = soup(1, 0.5, &mut random);
    let copies = Mesh { positions: one.positions.clone(), triangles: vec![one.triangles[0]; 50_000] };
    let mut strip = Mesh::default();
    for i in 0..40_000_u32 {
        let x = i as f32;
        strip.positions.extend([Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 0.0, 0.0), Vec3::new(x, 1.0, 0.0)]);
        strip.triangles.push([3 * i, 3 * i + 1, 3 * i + 2]);
    }
    let points = Mesh { positions: vec![Vec3::ONE; 3], triangles: vec![[0, 1, 2]; 10_000] };
    let huge = Mesh {
        positions: soup(500, 0.3, &mut random).positions.iter().map(|p| *p * 1e37).collect(),
        ..soup(500, 0.3, &mut random)
    };
    for (name, mesh) in [("copies", copies), ("strip", strip), ("grid", grid(256)), ("points", points), ("huge", huge)]
    {
        let start = Instant::now();
        let blas = Blas::build(&mesh.positions, &mesh.triangles);
        println!("{name}: {} triangles, {:?}, depth {}", mesh.triangles.len(), start.elapsed(), blas.depth_bvh2());
        assert!(start.elapsed().as_secs_f32() < 2.0, "{name} takes {:?}", start.elapsed());
        assert!(blas.depth_bvh2() <= 64, "{name}: {} levels", blas.depth_bvh2());
        assert_eq!(validate(&blas, &mesh), Ok(()), "{name}");
    }
}

#[test]
fn the_same_input_gives_the_same_tree() {
    let mesh = sphere(5, 0.1);
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("pool");
        pool.install(|| Blas::build(&mesh.positions, &mesh.triangles))
    };
    let (a, b) = (build(1), build(3));
    assert_eq!(a.nodes_bvh2(), b.nodes_bvh2());
    assert_eq!(a.triangle_order(), b.triangle_order());
}

#[test]
fn the_top_level_names_each_instance_once() {
    let mut random = Random::new(3);
    for count in [0, 1, 7, 9, 300] {
        let mut boxes: Vec<Bounds> = (0..count)
            .map(|_| {
                let lo = random.cube(5.0);
                Bounds { lo, hi: lo + random.cube(0.5).abs() }
            })
            .collect();
        if count > 5 {
            boxes[3] = Bounds::EMPTY;
        }
        let tlas = Tlas::build(&boxes);
        let leaf = |c: &&Child| c.is_leaf();
        let children = tlas.nodes().iter().flat_map(|n| &n.children[..n.count as usize]);
        let mut named: Vec<usize> = children.filter(leaf).map(|c| c.index()).collect();
        named.sort_unstable();
        let wanted: Vec<usize> = (0..count).filter(|&i| !boxes[i].is_empty()).collect();
        assert_eq!(named, wanted);
    }
}
