//! A pinhole camera by its intrinsics.

use glam::{DMat4, DVec3};

use crate::error::{Error, Result};

/// Looks down −Z with +Y up; x_camera / −z_camera = (column + 0.5 − cx) / fx, y = −(row + 0.5 − cy) / fy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Rigid, float64.
    pub world_from_camera: DMat4,
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels.
    pub fy: f64,
    /// Principal point, pixels from the left edge.
    pub cx: f64,
    /// Principal point, pixels from the top edge.
    pub cy: f64,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Camera {
    /// # Errors
    /// `Scene` when the matrix is singular or not finite, a focal length is not positive, or the image is empty.
    pub fn check(&self) -> Result<()> {
        let columns = self.world_from_camera.to_cols_array();
        let determinant = self.world_from_camera.determinant();
        if columns.iter().any(|c| !c.is_finite()) || determinant == 0.0 || !determinant.is_finite() {
            return Err(Error::Scene(format!(
                "world_from_camera is singular or not finite: {}",
                self.world_from_camera
            )));
        }
        let focal = [self.fx, self.fy].iter().all(|f| f.is_finite() && *f > 0.0);
        if !focal || !self.cx.is_finite() || !self.cy.is_finite() {
            return Err(Error::Scene(format!(
                "camera intrinsics fx {}, fy {}, cx {}, cy {}: focal lengths must be positive, all finite",
                self.fx, self.fy, self.cx, self.cy
            )));
        }
        if self.width == 0 || self.height == 0 {
            return Err(Error::Scene(format!(
                "image size {} x {}: width and height must be 1 or more",
                self.width, self.height
            )));
        }
        Ok(())
    }

    /// World position of the eye.
    pub fn position(&self) -> DVec3 {
        self.world_from_camera.w_axis.truncate()
    }

    /// Unit axes (right, up, backward) in world space.
    pub fn axes(&self) -> [DVec3; 3] {
        let m = self.world_from_camera;
        [m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.truncate().normalize())
    }

    /// The same view with `factor` × `factor` pixels for each.
    pub fn supersampled(&self, factor: u32) -> Self {
        let s = f64::from(factor);
        Self {
            fx: self.fx * s,
            fy: self.fy * s,
            cx: self.cx * s,
            cy: self.cy * s,
            width: self.width * factor,
            height: self.height * factor,
            ..*self
        }
    }
}
