//! Diffuse materials and linear RGB textures.

use glam::Vec3;

use super::mesh::next_id;
use crate::error::{Error, Result};

/// A linear RGB picture, row 0 at the top.
#[derive(Debug)]
pub struct Texture {
    /// Unique in this process.
    pub id: u64,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row by row.
    pub texels: Vec<[f32; 3]>,
}

impl Texture {
    /// # Errors
    /// `Scene` when the size does not fit the number of texels, or a texel is negative or not finite.
    pub fn new(width: u32, height: u32, texels: Vec<[f32; 3]>) -> Result<Self> {
        if width == 0 || height == 0 || texels.len() != width as usize * height as usize {
            return Err(Error::Scene(format!(
                "texture of {height} rows and {width} columns with {} texels: at least one row and column, and one \
                 texel for each place, are needed",
                texels.len()
            )));
        }
        if let Some(bad) = texels.iter().find(|t| t.iter().any(|c| !c.is_finite() || *c < 0.0)) {
            return Err(Error::Scene(format!("texture has the texel {bad:?}; texels must be finite and 0 or more")));
        }
        Ok(Self { id: next_id(), width, height, texels })
    }

    /// At each corner of the texels, (height + 1) rows of width + 1 from the bottom of the picture on: the sum of what lies
    /// left of and below it, less the mean of the whole picture [Cro84].
    pub fn sums(&self) -> Vec<[f32; 4]> {
        let (width, height) = (self.width as usize, self.height as usize);
        let mean = self.mean().as_dvec3();
        let mut sums = vec![[0.0; 4]; (width + 1) * (height + 1)];
        let mut below = vec![glam::DVec3::ZERO; width + 1];
        for row in 0..height {
            let texels = &self.texels[(height - 1 - row) * width..][..width];
            let mut left = glam::DVec3::ZERO;
            for column in 0..width {
                left += Vec3::from(texels[column]).as_dvec3() - mean;
                below[column + 1] += left;
                sums[(row + 1) * (width + 1) + column + 1] = below[column + 1].as_vec3().extend(0.0).to_array();
            }
        }
        sums
    }

    /// The mean over all texels.
    pub fn mean(&self) -> Vec3 {
        let mut sum = glam::DVec3::ZERO;
        for texel in &self.texels {
            sum += Vec3::from(*texel).as_dvec3();
        }
        (sum / self.texels.len() as f64).as_vec3()
    }
}
