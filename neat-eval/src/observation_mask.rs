//! Where the DTU scanner saw anything, and where its table is.
//!
//! Source: Aanæs et al., *Large-Scale Data for Multiple-View Stereopsis* (IJCV
//! 2016); files `ObsMask/ObsMask{scan}_10.mat` with `ObsMask`, `BB` and `Res`,
//! and `ObsMask/Plane{scan}.mat` with `P`. Constants and rounding as in
//! jzhangbs/DTUeval-python, which NEAT's `evaluation/eval-lsr-dtu.py` copies.

use crate::mat_file::{MatArray, read_mat};
use nalgebra::{Vector3, Vector4};
use neat_core::SceneError;
use std::path::Path;

/// How far outside of the mask's box predictions are kept for completeness, in
/// millimetres; on the far sides twice as far, as published.
const PATCH_MM: f32 = 60.0;

/// The cells of space that the scanner saw from a scene's views.
#[derive(Clone, Debug)]
pub struct ObservationMask {
    /// Corner of the first cell, in millimetres.
    min: Vector3<f32>,
    /// Opposite corner of the box.
    max: Vector3<f32>,
    /// Size of a cell.
    resolution: f64,
    /// Not 0 where something was seen; three axes x, y and z.
    cells: MatArray,
}

/// The plane of the table: surface points below it do not count for completeness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPlane {
    /// A point p lies above where the product with (p, 1) is positive.
    pub coefficients: Vector4<f64>,
}

impl ObservationMask {
    /// Reads `ObsMask{scan}_10.mat`.
    ///
    /// # Errors
    /// If the file cannot be read, or `ObsMask`, `BB` or `Res` is missing or of
    /// another shape.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let arrays = read_mat(path, "give ObsMaskN_10.mat of the DTU data set")?;
        Self::from_arrays(arrays, path)
    }

    fn from_arrays(mut arrays: Vec<MatArray>, path: &Path) -> Result<Self, SceneError> {
        let bounds = take(&mut arrays, "BB", &[2, 3], path)?.numbers();
        let resolution = take(&mut arrays, "Res", &[1, 1], path)?.number(0);
        let cells = take(&mut arrays, "ObsMask", &[0, 0, 0], path)?;
        if bounds.iter().any(|x| !x.is_finite()) || !(resolution > 0.0 && resolution.is_finite()) {
            return Err(SceneError::Malformed {
                path: path.into(),
                reason: "`BB` and `Res` must be finite, and `Res` positive".into(),
            });
        }
        // Column by column: x of both corners, then y, then z.
        let corner = |i: usize| Vector3::new(bounds[i], bounds[i + 2], bounds[i + 4]);
        Ok(Self {
            min: corner(0).map(|x| x as f32),
            max: corner(1).map(|x| x as f32),
            resolution,
            cells,
        })
    }

    /// Whether a point lies in the box or in the margin around it.
    pub fn is_near(&self, point: &Vector3<f64>) -> bool {
        let (min, max) = (self.min, self.max);
        (0..3).all(|axis| {
            point[axis] >= f64::from(min[axis] - PATCH_MM)
                && point[axis] < f64::from(max[axis] + 2.0 * PATCH_MM)
        })
    }

    /// Whether the cell that is nearest to a point was seen.
    pub fn is_observed(&self, point: &Vector3<f64>) -> bool {
        let mut index = 0;
        for axis in (0..3).rev() {
            let position = (point[axis] - f64::from(self.min[axis])) / self.resolution;
            // In single precision and half to even, as published.
            let cell = f64::from((position as f32).round_ties_even());
            let length = self.cells.shape[axis];
            if !(cell >= 0.0 && cell < length as f64) {
                return false;
            }
            index = index * length + cell as usize;
        }
        self.cells.number(index) != 0.0
    }
}

impl GroundPlane {
    /// Reads `Plane{scan}.mat`.
    ///
    /// # Errors
    /// If the file cannot be read, or `P` is missing or is not four numbers.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let mut arrays = read_mat(path, "give PlaneN.mat of the DTU data set")?;
        let numbers = take(&mut arrays, "P", &[4, 1], path)
            .or_else(|_| take(&mut arrays, "P", &[1, 4], path))?
            .numbers();
        Ok(Self {
            coefficients: Vector4::from_column_slice(&numbers),
        })
    }

    /// Whether a point lies above the plane.
    pub fn is_above(&self, point: &Vector3<f64>) -> bool {
        self.coefficients.dot(&point.push(1.0)) > 0.0
    }
}

/// The variable `name`, whose axes have these lengths; 0 is any length.
fn take(
    arrays: &mut Vec<MatArray>,
    name: &str,
    shape: &[usize],
    path: &Path,
) -> Result<MatArray, SceneError> {
    let malformed = |reason| SceneError::Malformed {
        path: path.into(),
        reason,
    };
    let at = arrays
        .iter()
        .position(|array| array.name == name)
        .ok_or_else(|| malformed(format!("it holds no array `{name}`")))?;
    let found = &arrays[at].shape;
    let fits = found.len() == shape.len()
        && found
            .iter()
            .zip(shape)
            .all(|(found, expected)| *expected == 0 || found == expected);
    if !fits {
        return Err(malformed(format!(
            "`{name}` has the shape {found:?}, which is not that of DTU"
        )));
    }
    Ok(arrays.swap_remove(at))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::mat_file::parse_mat;
    use crate::mat_file::tests::{compressed, mat_file, matrix_element};

    /// Four cells of 10 mm along x, two along y and one along z, from (-5, 0, 0);
    /// the last cell along x was not seen.
    pub(crate) fn mask_file() -> Vec<u8> {
        let bounds: Vec<u8> = [-5.0_f32, 35.0, 0.0, 20.0, 0.0, 10.0]
            .iter()
            .flat_map(|x| x.to_le_bytes())
            .collect();
        mat_file(&[
            compressed(&matrix_element(
                "ObsMask",
                9,
                &[4, 2, 1],
                2,
                &[1, 1, 1, 0, 1, 1, 0, 0],
            )),
            compressed(&matrix_element("BB", 7, &[2, 3], 7, &bounds)),
            matrix_element("Res", 6, &[1, 1], 2, &[10]),
        ])
    }

    fn mask() -> ObservationMask {
        let path = Path::new("ObsMask1_10.mat");
        ObservationMask::from_arrays(parse_mat(&mask_file(), path).unwrap(), path).unwrap()
    }

    #[test]
    fn cells_are_found_by_rounding() {
        let mask = mask();
        let seen = |x, y, z| mask.is_observed(&Vector3::new(x, y, z));
        assert!(seen(-5.0, 0.0, 0.0) && seen(-9.0, 0.0, 0.0));
        assert!(!seen(-10.1, 0.0, 0.0), "before the first cell");
        assert!(seen(15.0, 0.0, 0.0) && !seen(15.0, 10.0, 0.0), "y decides");
        assert!(!seen(25.0, 0.0, 0.0) && !seen(36.0, 0.0, 0.0));
        // Cell 2.5 rounds to even, 2.
        assert!(seen(20.0, 0.0, 0.0));
        assert!(!seen(f64::NAN, 0.0, 0.0) && !seen(1e300, 0.0, 0.0));
    }

    #[test]
    fn the_margin_is_wider_on_the_far_side() {
        let mask = mask();
        let near = |x| mask.is_near(&Vector3::new(x, 5.0, 5.0));
        assert!(near(-65.0) && !near(-65.1));
        assert!(near(154.9) && !near(155.0));
    }

    #[test]
    fn missing_arrays_are_named() {
        let path = Path::new("ObsMask1_10.mat");
        let message = ObservationMask::from_arrays(Vec::new(), path)
            .unwrap_err()
            .to_string();
        assert!(message.contains("`BB`") && message.contains("ObsMask1_10.mat"));
    }

    #[test]
    fn the_plane_has_a_side() {
        let plane = GroundPlane {
            coefficients: Vector4::new(0.0, 0.0, 1.0, -3.0),
        };
        assert!(plane.is_above(&Vector3::new(9.0, 9.0, 4.0)));
        assert!(!plane.is_above(&Vector3::new(9.0, 9.0, 3.0)));
    }
}
