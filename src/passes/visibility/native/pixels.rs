//! The pixels of a tile in a light's coordinates.
use super::super::prove_native::ProofTiles;
use super::prove::Side;
use super::shaft::Interval;
use super::simd::three;
use glam::Vec3;

const TILE: usize = 8;
pub(crate) const TILE_PIXELS: usize = TILE * TILE;

/// Ray origins and geometric normals, by columns.
pub(crate) struct Pixels {
    pub(crate) origin: [[f32; TILE_PIXELS]; 3],
    /// Product with a difference of coordinates: height over the tangent plane.
    pub(crate) normal: [[f32; TILE_PIXELS]; 3],
    /// Bit of each pixel that may face the light.
    pub(crate) active: u64,
    /// Their common normal, if they have one, and the least height of an origin along it.
    pub(crate) flat: Option<([f32; 3], f32)>,
}

fn xyz(row: &[u32; 4]) -> Vec3 {
    Vec3::new(f32::from_bits(row[0]), f32::from_bits(row[1]), f32::from_bits(row[2]))
}

impl Pixels {
    /// Loads a tile whose facing pixels lie inside `bounds`.
    pub(crate) fn new(tiles: &ProofTiles<'_>, side: &Side, bounds: &Interval, tile: usize) -> Self {
        let mut pixels =
            Self { origin: [[0.0; TILE_PIXELS]; 3], normal: [[0.0; TILE_PIXELS]; 3], active: 0, flat: None };
        let across = (tiles.width as usize).div_ceil(TILE);
        let (left, top) = (tile % across * TILE, tile / across * TILE);
        for i in 0..TILE_PIXELS {
            let (x, y) = (left + i % TILE, top + i / TILE);
            let at = y * tiles.width as usize + x;
            if x < tiles.width as usize && y < tiles.height as usize && tiles.normal[at][3] == 1 {
                pixels.add(tiles, side, bounds, i, at);
            }
        }
        pixels.flat = pixels.common_plane();
        pixels
    }

    fn common_plane(&self) -> Option<([f32; 3], f32)> {
        let mut active = (0..TILE_PIXELS).filter(|i| self.active >> i & 1 == 1).peekable();
        let first = *active.peek()?;
        let normal = three!(r => self.normal[r][first]);
        let mut least = f32::INFINITY;
        for i in active {
            if three!(r => self.normal[r][i]) != normal {
                return None;
            }
            let o = three!(r => self.origin[r][i]);
            least = least.min(normal[0] * o[0] + normal[1] * o[1] + normal[2] * o[2]);
        }
        Some((normal, least))
    }

    fn add(&mut self, tiles: &ProofTiles<'_>, side: &Side, bounds: &Interval, i: usize, at: usize) {
        let geo = xyz(&tiles.geometric[at]);
        let q = xyz(&tiles.position[at]) + geo * f32::from_bits(tiles.position[at][3]) - Vec3::from(tiles.frame.corner);
        let (shade, slack) = (xyz(&tiles.normal[at]), side.scene.slack);
        let origin = three!(r => q.dot(side.frame[r]));
        let along = |n: Vec3| three!(r => n.dot(side.axes[r]));
        // A normal that all of the light lies below faces none of it: the highest corner decides, with a doubt for it.
        let faces = |n: [f32; 3]| {
            let extent = [tiles.frame.extent_a, tiles.frame.extent_b, 0.0];
            let top = three!(r => (-origin[r] * n[r]).max((extent[r] - origin[r]) * n[r]));
            let doubt = three!(r => n[r].abs() * slack[r]);
            top[0] + top[1] + top[2] > -(doubt[0] + doubt[1] + doubt[2])
        };
        let normal = along(geo);
        // Facing pixels lie inside the bounds, which were found by the same sums.
        let inside = three!(r => origin[r] >= bounds.lo[r] - slack[r] && origin[r] <= bounds.hi[r] + slack[r]);
        if inside == [true; 3] && faces(normal) && faces(along(shade)) {
            self.active |= 1 << i;
        }
        for r in 0..3 {
            self.origin[r][i] = origin[r];
            self.normal[r][i] = normal[r];
        }
    }
}
