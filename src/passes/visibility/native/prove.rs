//! Proofs that a tile sees a whole light, or none of it.
//!
//! All happens in the light's affine coordinates a, b, h, where the light is a unit square (or a point) at h = 0: boxes
//! and triangles are taken there, planes and convex hulls stay what they are. The segments of a tile fill the hull of
//! the box of its origins and the light, which a [`Shaft`] knows exactly; the few triangles that reach it are tested
//! against the segments of each pixel by separating planes.
use super::super::prove_native::ProofTiles;
use super::super::trace_native::TraceScene;
use super::pixels::Pixels;
use super::rays::MARGIN;
use super::separate::{self, Triangle};
use super::shaft::{Interval, Shaft};
use super::simd::{Isa, Lanes, Mask, set_lanes, three};
use crate::passes::refine::light_bounds::flags;
use crate::scene::bvh::{Child, Node8, TriangleBlock};
use glam::{DMat3, DVec3, Vec3};

/// Shadow rays end here on their way to the light; what is nearer to it blocks none.
pub(crate) const T_MAX: f32 = 0.9999;
/// Nodes and triangles that a tile may cost: its rays cost no more than some dozen microseconds either.
const NODES: usize = 256;
const TRIANGLES: usize = 32;

/// An affine map into a light's coordinates, with a bound of what rounding does to each of them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ToLight {
    rows: [[f32; 3]; 3],
    at: [f32; 3],
    pub(crate) slack: [f32; 3],
}

impl ToLight {
    /// From a space with origin `center` in the scene and axes `linear`, whose points reach `reach`; `far` is how far
    /// the scene reaches, whose rounding all ray origins have.
    fn new(frame: &[DVec3; 3], linear: DMat3, center: DVec3, reach: f32, far: f32) -> Self {
        let row = |i: usize| linear.transpose() * frame[i];
        let size = |v: DVec3| v.abs().element_sum();
        let slack = |i: usize| size(row(i)) * f64::from(reach) + size(frame[i]) * f64::from(far);
        Self {
            rows: three!(i => row(i).as_vec3().to_array()),
            at: three!(i => frame[i].dot(center) as f32),
            slack: three!(i => (slack(i) * f64::from(MARGIN)) as f32),
        }
    }

    /// Children of a node that reach the shaft.
    #[inline(always)]
    fn children<N: Lanes>(&self, shaft: &Shaft, node: &Node8) -> u32 {
        let half = N::splat(0.5);
        let (lo, hi) = (three!(i => N::load(&node.bounds[i])), three!(i => N::load(&node.bounds[i + 3])));
        let (m, h) = (three!(i => (lo[i] + hi[i]) * half), three!(i => (hi[i] - lo[i]) * half));
        let at = three!(r => self.row(r, m));
        let reach = three!(r => {
            let row = three!(i => N::splat(self.rows[r][i].abs()));
            row[0].fma(h[0], row[1].fma(h[1], row[2] * h[2]))
        });
        let used = (1 << node.count) - 1;
        shaft.meets(three!(i => at[i] - reach[i]), three!(i => at[i] + reach[i])).bits() & used
    }

    #[inline(always)]
    fn row<L: Lanes>(&self, r: usize, p: [L; 3]) -> L {
        let row = three!(i => L::splat(self.rows[r][i]));
        row[0].fma(p[0], row[1].fma(p[1], row[2].fma(p[2], L::splat(self.at[r]))))
    }

    /// Corners of the triangles of a block.
    #[inline(always)]
    fn corners<B: Lanes>(&self, block: &TriangleBlock) -> [[B; 3]; 3] {
        three!(v => {
            let p = three!(i => B::load(&block.corner[v][i]));
            three!(r => self.row(r, p))
        })
    }
}

/// The maps for one side of a light.
pub(crate) struct Side {
    pub(crate) scene: ToLight,
    instances: Vec<ToLight>,
    /// Takes a scene-space normal to one of the light's coordinates: the edges, and the normal of this side.
    pub(crate) axes: [Vec3; 3],
    /// Rows of the frame.
    pub(crate) frame: [Vec3; 3],
}

/// What all tiles share.
pub(crate) struct Job<'a> {
    pub(crate) tiles: &'a ProofTiles<'a>,
    sides: [Option<Side>; 2],
}

impl<'a> Job<'a> {
    /// Takes every instance to the light.
    pub(crate) fn new(scene: &TraceScene, tiles: &'a ProofTiles<'a>) -> Self {
        let back = (tiles.frame.two_sided != 0).then(|| Self::side(scene, tiles, -1.0));
        Self { tiles, sides: [Some(Self::side(scene, tiles, 1.0)), back] }
    }

    fn side(scene: &TraceScene, tiles: &ProofTiles<'_>, sign: f64) -> Side {
        let light = tiles.frame;
        let row = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        let frame = [row(light.dual_u), row(light.dual_v), row(light.normal) * sign];
        let corner = row(light.corner);
        let far = scene.tlas.bounds().max_abs().max(Vec3::from(light.corner).abs().max_element());
        let edges = DMat3::from_cols(frame[0], frame[1], frame[2]).transpose().inverse();
        let instance = |placed: &super::instance::Placed| {
            let rows = placed.rows.map(row);
            let linear = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose().inverse();
            ToLight::new(&frame, linear, row(placed.center) - corner, placed.reach, far)
        };
        Side {
            scene: ToLight::new(&frame, DMat3::IDENTITY, -corner, far, far),
            instances: scene.placed.iter().map(instance).collect(),
            axes: [edges.x_axis, edges.y_axis, edges.z_axis].map(|v| v.as_vec3()),
            frame: frame.map(|v| v.as_vec3()),
        }
    }
}

/// One tile under proof.
pub(crate) struct Search<'a> {
    pub(crate) job: &'a Job<'a>,
    pub(crate) side: &'a Side,
    pub(crate) tile: usize,
    /// Box of the ray origins, and the light.
    pub(crate) origin: Interval,
    pub(crate) light: Interval,
    /// Where the walk through the trees looks: the same, or their middles.
    from: Interval,
    to: Interval,
    pixels: Option<Box<Pixels>>,
    nodes: usize,
    triangles: usize,
}

impl Search<'_> {
    #[inline(always)]
    fn shaft(&self, space: &ToLight) -> Shaft {
        Shaft::with_margin(&self.from, &self.to, T_MAX, three!(i => 2.0 * space.slack[i]))
    }

    /// True when the search is over: with `DARK` a triangle hides the light from all pixels, else one may hide some of it.
    #[inline(always)]
    fn block<I: Isa, const DARK: bool>(
        &mut self,
        block: &TriangleBlock,
        count: usize,
        space: &ToLight,
        shaft: &Shaft,
    ) -> bool {
        let corners = space.corners::<I::Block>(block);
        let lo = three!(i => corners[0][i].min(corners[1][i]).min(corners[2][i]));
        let hi = three!(i => corners[0][i].max(corners[1][i]).max(corners[2][i]));
        let mut mask = shaft.meets(lo, hi).bits() & ((1 << count) - 1);
        if mask != 0 && !DARK {
            mask &= !separate::apart(&corners, &self.origin, &self.light, space.slack);
        }
        if mask != 0 && !DARK {
            let (job, side, tile, bounds) = (self.job, self.side, self.tile, self.origin);
            let pixels = self.pixels.get_or_insert_with(|| Box::new(Pixels::new(job.tiles, side, &bounds, tile)));
            if let Some((normal, least)) = pixels.flat {
                mask &= !separate::under_plane(&corners, normal, least, space.slack);
            }
        }
        for lane in set_lanes(mask) {
            let triangle = Triangle::new(three!(v => three!(i => corners[v][i].lane(lane))), space.slack);
            if DARK {
                if separate::hides(&triangle, &self.origin, &self.light) {
                    return true;
                }
                continue;
            }
            if self.triangles == 0 {
                return true;
            }
            self.triangles -= 1;
            if self.pixels.as_ref().is_none_or(|pixels| separate::harms::<I::Node>(&triangle, pixels, &self.light)) {
                return true;
            }
        }
        false
    }

    #[inline(always)]
    fn mesh<I: Isa, const DARK: bool>(&mut self, scene: &TraceScene, instance: usize, todo: &mut Vec<Child>) -> bool {
        let (blas, space) = (&scene.placed[instance].blas, &self.side.instances[instance]);
        let shaft = self.shaft(space);
        let base = todo.len();
        todo.push(Child::ROOT);
        while todo.len() > base {
            let Some(at) = todo.pop() else { break };
            let node = &blas.nodes_wide()[at.index()];
            if self.nodes == 0 {
                return !DARK;
            }
            self.nodes -= 1;
            for slot in set_lanes(space.children::<I::Node>(&shaft, node)) {
                let child = node.children[slot];
                if !child.is_leaf() {
                    todo.push(child);
                } else if self.block::<I, DARK>(&blas.blocks()[child.index()], child.count(), space, &shaft) {
                    return true;
                }
            }
        }
        false
    }

    /// Walks through all that the segments reach; true as for [`Search::block`].
    #[inline(always)]
    fn walk<I: Isa, const DARK: bool>(&mut self, scene: &TraceScene, todo: &mut Vec<Child>) -> bool {
        let nodes = scene.tlas.nodes();
        todo.clear();
        if nodes.is_empty() {
            return false;
        }
        let (side, shaft) = (self.side, self.shaft(&self.side.scene));
        todo.push(Child::ROOT);
        while let Some(at) = todo.pop() {
            let node = &nodes[at.index()];
            if self.nodes == 0 {
                return !DARK;
            }
            self.nodes -= 1;
            for slot in set_lanes(side.scene.children::<I::Node>(&shaft, node)) {
                let child = node.children[slot];
                if !child.is_leaf() {
                    todo.push(child);
                } else if self.mesh::<I, DARK>(scene, child.index(), todo) {
                    return true;
                }
            }
        }
        false
    }
}

/// The bit that a tile has earned, or 0.
#[inline(always)]
fn prove_tile<I: Isa>(scene: &TraceScene, job: &Job, tile: usize, known: u32, todo: &mut Vec<Child>) -> u32 {
    let wanted = flags::FACING | flags::MIXED_SIDES | flags::LIT | flags::DARK;
    let bounds = &job.tiles.bounds[tile];
    let Some(side) = &job.sides[usize::from(known & flags::BACK != 0)] else { return 0 };
    let origin = Interval { lo: bounds.lo, hi: bounds.hi };
    let usable = three!(i => origin.lo[i] <= origin.hi[i] && origin.lo[i].abs() < 1e30 && origin.hi[i].abs() < 1e30);
    // On the light's own plane nothing can be told apart.
    if known & wanted != flags::FACING || usable != [true; 3] || origin.lo[2] <= side.scene.slack[2] {
        return 0;
    }
    let frame = job.tiles.frame;
    let light = Interval { lo: [0.0; 3], hi: [frame.extent_a, frame.extent_b, 0.0] };
    let (from, to) = (origin, light);
    let (nodes, triangles) = (NODES, TRIANGLES);
    let mut search = Search { job, side, tile, origin, light, from, to, pixels: None, nodes, triangles };
    if !search.walk::<I, false>(scene, todo) {
        return flags::LIT;
    }
    // One triangle that hides all also hides the middle of the light from the middle of the tile.
    let middle = |b: &Interval| Interval::point(three!(i => 0.5 * b.lo[i] + 0.5 * b.hi[i]));
    (search.from, search.to, search.nodes) = (middle(&origin), middle(&light), NODES);
    if search.walk::<I, true>(scene, todo) { flags::DARK } else { 0 }
}

/// Tiles from `first` on.
#[inline(always)]
pub(crate) fn prove<I: Isa>(scene: &TraceScene, job: &Job, first: usize, flags: &mut [u32], todo: &mut Vec<Child>) {
    for (index, word) in flags.iter_mut().enumerate() {
        *word |= prove_tile::<I>(scene, job, first + index, *word, todo);
    }
}
