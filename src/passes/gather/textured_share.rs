//! What a textured light's picture makes of its share: nodes that carry moments of the picture.

use bytemuck::{Pod, Zeroable};

use super::irradiance::IrradianceParams;
use crate::error::Result;
use crate::gpu::Buffer;
use crate::passes::Context;
use crate::passes::lights::light_samples::LightSamplesParams;

/// Cells of the picture along an edge; twin of `CELLS` in the shader.
const CELLS: usize = 32;
/// Blocks of the light along an edge, and nodes along an edge of a block. Fine: 10⁻³ of irradiance from half a light
/// size on, whatever the picture; coarse: the same from two sizes on, where the light is not cut by a horizon.
const FINE: (usize, usize) = (4, 3);
const COARSE: (usize, usize) = (1, 6);

/// Twin of `LightNode` in `shaders/passes/gather/textured_share.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct LightNode {
    /// a, b.
    pub place: [f32; 2],
    /// Unused.
    pub pad: [f32; 2],
    /// Of the picture over its mean; the last: of a light without a picture.
    pub moment: [f32; 4],
}

/// Twin of `MomentsParams` in `shaders/passes/gather/textured_share.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct MomentsParams {
    /// Mean radiance.
    pub mean: [f32; 3],
    /// Scene units.
    pub cell_area: f32,
    /// Nodes along an edge of the fine table.
    pub fine: u32,
    /// Nodes along an edge of the coarse table.
    pub coarse: u32,
    /// Unused.
    pub pad0: u32,
    /// Unused.
    pub pad1: u32,
}

/// Nodes of a light, the fine table before the coarse one.
pub(super) struct Table {
    pub(super) nodes: Buffer<LightNode>,
}

impl Table {
    /// First node and number of nodes.
    pub(super) fn range(&self, coarse: bool) -> (u32, u32) {
        let fine = square(FINE);
        if coarse { (fine, square(COARSE)) } else { (0, fine) }
    }
}

fn square((blocks, points): (usize, usize)) -> u32 {
    (blocks * points).pow(2) as u32
}

/// Gauss–Legendre abscissas on [0, 1].
fn abscissas(points: usize) -> Vec<f64> {
    let half: &[f64] = match points {
        3 => &[0.774_596_669_241_483_4, 0.0],
        _ => &[0.932_469_514_203_152, 0.661_209_386_466_264_5, 0.238_619_186_083_196_9],
    };
    let below = half.iter().map(|x| 0.5 - 0.5 * x);
    let above = half.iter().rev().filter(|x| **x > 0.0).map(|x| 0.5 + 0.5 * x);
    below.chain(above).collect()
}

/// Value at x of the polynomial that is 1 at node i and 0 at the others.
fn cardinal(nodes: &[f64], i: usize, x: f64) -> f64 {
    nodes.iter().enumerate().filter(|(j, _)| *j != i).map(|(_, n)| (x - n) / (nodes[i] - n)).product()
}

/// Places along an edge, and for each the integral of its polynomial over each cell.
fn edge_rule((blocks, points): (usize, usize)) -> (Vec<f64>, Vec<[f64; CELLS]>) {
    let nodes = abscissas(points);
    let place = |i: usize| ((i / points) as f64 + nodes[i % points]) / blocks as f64;
    let integral = |i: usize, cell: usize| {
        let block_cells = CELLS / blocks;
        if cell / block_cells != i / points {
            return 0.0;
        }
        // Three Gauss points are exact up to the fifth degree.
        let weights = [5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0];
        let at = |x: f64| ((cell % block_cells) as f64 + x) / block_cells as f64;
        let values = abscissas(3).into_iter().zip(weights).map(|(x, w)| w * cardinal(&nodes, i % points, at(x)));
        values.sum::<f64>() / CELLS as f64
    };
    let count = blocks * points;
    let rows = (0..count).map(|i| std::array::from_fn(|cell| integral(i, cell))).collect();
    ((0..count).map(place).collect(), rows)
}

/// a, b and weight of every node, and the rows of the polynomials' integrals.
fn rules() -> (Vec<[f32; 4]>, Vec<f32>) {
    let (mut rule, mut basis) = (Vec::new(), Vec::new());
    for table in [FINE, COARSE] {
        let (places, rows) = edge_rule(table);
        let weight = |i: usize| rows[i].iter().sum::<f64>();
        for (j, b) in places.iter().enumerate() {
            rule.extend(
                places.iter().enumerate().map(|(i, a)| [*a as f32, *b as f32, (weight(i) * weight(j)) as f32, 0.0]),
            );
        }
        basis.extend(rows.iter().flatten().map(|x| *x as f32));
    }
    (rule, basis)
}

/// Makes the nodes of one textured light.
///
/// # Errors
/// Those of the device.
pub(super) fn record(context: &mut Context<'_, '_>, light: &IrradianceParams, index: u32) -> Result<Table> {
    let cells = cell_means(context, index)?;
    let (rule, basis) = rules();
    let kept_rule: Buffer<[f32; 4]> = context.resources.buffer("light_rule", rule.len())?;
    let kept_basis: Buffer<f32> = context.resources.buffer("light_basis", basis.len())?;
    kept_rule.write(context.recorder.gpu(), 0, &rule)?;
    kept_basis.write(context.recorder.gpu(), 0, &basis)?;
    let nodes = context.resources.buffer("light_nodes", rule.len())?;
    let area = light.edge[0] * light.edge[2] * light.size * light.size;
    let params = MomentsParams {
        mean: light.radiance,
        cell_area: area / (CELLS * CELLS) as f32,
        fine: (FINE.0 * FINE.1) as u32,
        coarse: (COARSE.0 * COARSE.1) as u32,
        ..MomentsParams::zeroed()
    };
    let kernel = context.kernel("gather/textured_share", "moments")?;
    let pass = context.recorder.pass("textured_share", &kernel).uniform("texture", &params);
    pass.bind("rule", &kept_rule)
        .bind("basis", &kept_basis)
        .bind("radiance_cells", &cells)
        .bind("light_nodes", &nodes)
        .dispatch_groups(rule.len())?;
    Ok(Table { nodes })
}

/// Mean radiance times area of each cell.
fn cell_means(context: &mut Context<'_, '_>, light: u32) -> Result<Buffer<[f32; 4]>> {
    let cells = context.resources.buffer("radiance_cells", CELLS * CELLS)?;
    let params = LightSamplesParams {
        light,
        strata_u: CELLS as u32,
        strata_v: CELLS as u32,
        patterns: 1,
        ..LightSamplesParams::zeroed()
    };
    let kernel = context.kernel("lights/light_samples", "radiance")?;
    let pass = context.recorder.pass("textured_share", &kernel).uniform("params", &params);
    pass.bind("lights", context.scene.lights()?).bind("light_radiance", &cells).dispatch_groups(CELLS * CELLS)?;
    Ok(cells)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_polynomials_of_a_table_integrate_to_gauss_weights() {
        let (places, rows) = edge_rule(FINE);
        let weights: Vec<f64> = rows.iter().map(|row| row.iter().sum()).collect();
        for (i, w) in weights.iter().enumerate() {
            let gauss = [5.0, 8.0, 5.0][i % 3] / 18.0 / 4.0;
            assert!((w - gauss).abs() < 1e-12, "{w} of node {i}");
        }
        // ∫ x⁵ dx = 1/6 by the nodes.
        let sum: f64 = places.iter().zip(&weights).map(|(x, w)| w * x.powi(5)).sum();
        assert!((sum - 1.0 / 6.0).abs() < 1e-12);
    }
}
