//! Lens distortion: how a lens bends a ray before it meets a pinhole's image.

use crate::CameraError;
use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// A lens model. Every model but [`Self::ReverseRadial`] and [`Self::Division`] leads from the calibrated
/// coordinates (x, y) of an ideal pinhole, with r² = x² + y², to those in the
/// photograph; K then leads to pixels as for a pinhole.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Distortion {
    /// A pinhole.
    #[default]
    None,
    /// Brown's model with OpenCV's rational extension:
    /// `(x, y) · (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)` plus
    /// `(2 p1 x y + p2 (r² + 2x²), p1 (r² + 2y²) + 2 p2 x y)`.
    Brown {
        /// k1 … k6.
        radial: [f64; 6],
        /// p1, p2.
        tangential: [f64; 2],
    },
    /// Equidistant fisheye: with θ = atan r, `(u, v) = (x, y) · θ/r ·
    /// (1 + k1 θ² + k2 θ⁴ + …)`, then with ρ² = u² + v² plus
    /// `(2 p1 u v + p2 (ρ² + 2u²), p1 (ρ² + 2v²) + 2 p2 u v)` and
    /// `(s1 ρ² + s2 ρ⁴, s3 ρ² + s4 ρ⁴)`.
    Fisheye {
        /// k1 … k6.
        radial: [f64; 6],
        /// p1, p2.
        tangential: [f64; 2],
        /// s1 … s4.
        thin_prism: [f64; 4],
    },
    /// COLMAP's thin-prism fisheye, in which tangential and prism terms act before
    /// the radial ones: with θ = atan r and `(u, v) = (x, y) · θ/r`, it is
    /// `(u, v) · (1 + k1 θ² + k2 θ⁴ + k3 θ⁶ + k4 θ⁸)` plus
    /// `(2 p1 u v + p2 (θ² + 2u²), p1 (θ² + 2v²) + 2 p2 u v)` and
    /// `(s1 θ², s2 θ²)`.
    ThinPrismFisheye {
        /// k1 … k4.
        radial: [f64; 4],
        /// p1, p2.
        tangential: [f64; 2],
        /// s1, s2.
        thin_prism: [f64; 2],
    },
    /// Field of view: `(x, y) · atan(2 r tan(ω/2)) / (r ω)`.
    Fov {
        /// ω, in radians.
        omega: f64,
    },
    /// One radial parameter as VisualSfM stores it, which leads the other way,
    /// from the photograph's calibrated coordinates to those of a pinhole:
    /// `(u, v) · (1 + k (u² + v²))`.
    ReverseRadial {
        /// k.
        k: f64,
    },
    /// Division (Fitzgibbon 2001), which leads the other way too: with ρ² = u² + v²
    /// `(u, v) / (1 + k ρ²)`.
    Division {
        /// k.
        k: f64,
    },
    /// Extended unified camera model (Khomutenko et al. 2016):
    /// `(x, y) / (α √(β r² + 1) + 1 − α)`.
    ExtendedUnified {
        /// α: 0 is a pinhole.
        alpha: f64,
        /// β, positive.
        beta: f64,
    },
}

impl Distortion {
    /// [`Self::Brown`] of the first radial coefficients, at most six; the others are
    /// zero.
    pub fn brown(radial: &[f64], tangential: [f64; 2]) -> Self {
        Self::Brown {
            radial: filled(radial),
            tangential,
        }
    }

    /// [`Self::Fisheye`] of the first radial coefficients, at most six, and no others.
    pub fn fisheye(radial: &[f64]) -> Self {
        Self::Fisheye {
            radial: filled(radial),
            tangential: [0.0; 2],
            thin_prism: [0.0; 4],
        }
    }

    /// Whether all coefficients are zero and rays are not bent. A fisheye lens
    /// bends them with any coefficients.
    pub fn is_none(&self) -> bool {
        match self {
            Self::Fisheye { .. } | Self::ThinPrismFisheye { .. } => false,
            Self::ExtendedUnified { alpha, .. } => *alpha == 0.0,
            _ => self.coefficients().all(|x| x == 0.0),
        }
    }

    /// [`Self::None`] for a lens that does not bend rays.
    pub(crate) fn simplest(self) -> Self {
        if self.is_none() { Self::None } else { self }
    }

    /// Checks that no coefficient is NaN or infinite.
    ///
    /// # Errors
    /// If one is.
    pub fn validate(&self) -> Result<(), CameraError> {
        let is_finite = self.coefficients().all(f64::is_finite);
        is_finite.then_some(()).ok_or(CameraError::NotFinite)
    }

    fn coefficients(&self) -> impl Iterator<Item = f64> {
        let lists: [&[f64]; 3] = match self {
            Self::None => [&[], &[], &[]],
            Self::Brown { radial, tangential } => [radial, tangential, &[]],
            Self::Fisheye {
                radial,
                tangential,
                thin_prism,
            } => [radial, tangential, thin_prism],
            Self::ThinPrismFisheye {
                radial,
                tangential,
                thin_prism,
            } => [radial, tangential, thin_prism],
            Self::Fov { omega: k } | Self::ReverseRadial { k } | Self::Division { k } => {
                [std::slice::from_ref(k), &[], &[]]
            }
            Self::ExtendedUnified { alpha, beta } => {
                [std::slice::from_ref(alpha), std::slice::from_ref(beta), &[]]
            }
        };
        lists.into_iter().flatten().copied()
    }

    /// The model in a word or two, for messages.
    pub fn name(&self) -> &'static str {
        match self {
            Self::None => "pinhole",
            Self::Brown { .. } => "Brown",
            Self::Fisheye { .. } => "fisheye",
            Self::ThinPrismFisheye { .. } => "thin prism fisheye",
            Self::Fov { .. } => "field of view",
            Self::ReverseRadial { .. } => "reverse radial",
            Self::Division { .. } => "division",
            Self::ExtendedUnified { .. } => "extended unified",
        }
    }

    /// Where the photograph shows what an ideal pinhole shows at `calibrated`.
    ///
    /// This is the formula alone: beyond the fold of a lens ([`Self::is_one_to_one_to`])
    /// it leads back inward. Of [`Self::ReverseRadial`] and [`Self::Division`], whose
    /// formulas lead the other way, it is the solution before the fold, and NaN where
    /// there is none.
    pub fn distort(&self, calibrated: &Vector2<f64>) -> Vector2<f64> {
        let point = calibrated;
        if let Some((value, ..)) = self.polynomial(point) {
            return value;
        }
        match self {
            Self::Fov { omega } => point * fov_scale(*omega, point.norm()),
            Self::ReverseRadial { k } => point * reverse_radial_scale(*k, point.norm()),
            // The smaller root of k r ρ² − ρ + r = 0.
            Self::Division { k } => {
                point * (2.0 / (1.0 + (1.0 - 4.0 * k * point.norm_squared()).sqrt()))
            }
            Self::ExtendedUnified { alpha, beta } => {
                point / (alpha * (beta * point.norm_squared() + 1.0).sqrt() + 1.0 - alpha)
            }
            _ => *point,
        }
    }

    /// Where an ideal pinhole shows what the photograph shows at `distorted`:
    /// the inverse of [`Self::distort`] before the fold. `None` where nothing in
    /// front of the camera is shown there.
    pub fn undistort(&self, distorted: &Vector2<f64>) -> Option<Vector2<f64>> {
        if !distorted.iter().all(|x| x.is_finite()) {
            return None;
        }
        match self {
            Self::None => Some(*distorted),
            Self::Brown { .. } | Self::Fisheye { .. } | Self::ThinPrismFisheye { .. } => {
                self.undistort_by_newton(distorted)
            }
            Self::Fov { omega } => {
                let half_tangent = (omega / 2.0).tan();
                let radius = distorted.norm();
                let angle = radius * omega;
                if *omega == 0.0 || radius == 0.0 {
                    return Some(*distorted);
                }
                let undistorted = distorted * (angle.tan() / (2.0 * half_tangent * radius));
                (angle.abs() < FRAC_PI_2).then_some(undistorted)
            }
            Self::ReverseRadial { k } => {
                let stretch = k * distorted.norm_squared();
                // The derivative of the radius: zero at the fold.
                (1.0 + 3.0 * stretch > 0.0).then_some(distorted * (1.0 + stretch))
            }
            Self::Division { k } => {
                let shrink = k * distorted.norm_squared();
                // Before the fold, and in front of the camera.
                (shrink.abs() < 1.0).then_some(distorted / (1.0 + shrink))
            }
            Self::ExtendedUnified { alpha, beta } => {
                let square = distorted.norm_squared();
                let root = (1.0 - (2.0 * alpha - 1.0) * beta * square).sqrt();
                let depth = (1.0 - beta * alpha * alpha * square) / (alpha * root + 1.0 - alpha);
                // NaN where no ray is shown.
                let undistorted = distorted / depth;
                (depth > 0.0 && self.is_one_to_one_to(&undistorted)).then_some(undistorted)
            }
        }
    }

    /// Whether no other point on the way from the axis to `calibrated` is shown
    /// at the same place: the lens does not fold before it.
    pub fn is_one_to_one_to(&self, calibrated: &Vector2<f64>) -> bool {
        match self {
            Self::None | Self::Fov { .. } => true,
            Self::Brown { .. } | Self::Fisheye { .. } | Self::ThinPrismFisheye { .. } => {
                (1..=FOLD_SAMPLES).all(|sample| {
                    let share = f64::from(sample) / f64::from(FOLD_SAMPLES);
                    self.with_jacobian(&(calibrated * share))
                        .is_some_and(|(_, jacobian)| jacobian.determinant() > 0.0)
                })
            }
            Self::ReverseRadial { .. } | Self::Division { .. } => {
                self.distort(calibrated).iter().all(|x| x.is_finite())
            }
            Self::ExtendedUnified { alpha, beta } => {
                let distance = (beta * calibrated.norm_squared() + 1.0).sqrt();
                // The denominator, and the sign of the radius's derivative.
                alpha * distance + 1.0 - alpha > 0.0 && alpha / distance + 1.0 - alpha > 0.0
            }
        }
    }

    /// Newton's method, led outward from the axis in steps: it then stays on the
    /// branch before the fold, wherever that lies.
    fn undistort_by_newton(&self, distorted: &Vector2<f64>) -> Option<Vector2<f64>> {
        let mut undistorted = Vector2::zeros();
        for step in 1..=STEPS_OUTWARD {
            let target = distorted * (f64::from(step) / f64::from(STEPS_OUTWARD));
            undistorted = self.newton(&target, undistorted)?;
        }
        self.is_one_to_one_to(&undistorted).then_some(undistorted)
    }

    /// The point near `start` that is distorted to `target`.
    fn newton(&self, target: &Vector2<f64>, start: Vector2<f64>) -> Option<Vector2<f64>> {
        let tolerance = NEWTON_TOLERANCE * (1.0 + target.norm());
        let mut point = start;
        for _ in 0..NEWTON_ITERATIONS {
            let (value, jacobian) = self.with_jacobian(&point)?;
            let residual = target - value;
            if residual.norm() <= tolerance {
                return Some(point);
            }
            // At the fold the map has no inverse, beyond it mirrors.
            if jacobian.determinant() <= 0.0 {
                return None;
            }
            point += jacobian.try_inverse()? * residual;
        }
        None
    }

    /// [`Self::distort`] and its derivative by the point, of the models that
    /// are inverted with it; `None` where they are not finite or have turned the
    /// point through the axis.
    fn with_jacobian(&self, point: &Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>)> {
        let (value, jacobian, scale) = self.polynomial(point)?;
        let finite = value.iter().chain(&jacobian).all(|x| x.is_finite());
        (finite && scale > 0.0).then_some((value, jacobian))
    }

    /// Of the models made of polynomials: [`Self::distort`], its derivative by the
    /// point, and the radial factor.
    #[inline]
    fn polynomial(&self, point: &Vector2<f64>) -> Option<(Vector2<f64>, Matrix2<f64>, f64)> {
        Some(match self {
            Self::Brown { radial, tangential } => {
                let (scale, slope) = brown_scale(radial, point.norm_squared());
                let jacobian = radial_jacobian(point, scale, 2.0 * slope)
                    + decentering_jacobian(tangential, point);
                let value = point * scale + decentering(tangential, point);
                (value, jacobian, scale)
            }
            Self::Fisheye {
                radial,
                tangential,
                thin_prism,
            } => {
                let (scale, slope_by_radius) = fisheye_scale(radial, point.norm());
                let bent = point * scale;
                let outer = Matrix2::identity()
                    + decentering_jacobian(tangential, &bent)
                    + prism_jacobian(thin_prism, &bent);
                let value = bent + decentering(tangential, &bent) + prism(thin_prism, &bent);
                let jacobian = outer * radial_jacobian(point, scale, slope_by_radius);
                (value, jacobian, scale)
            }
            Self::ThinPrismFisheye {
                radial,
                tangential,
                thin_prism: [s1, s2],
            } => {
                let prisms = [*s1, 0.0, *s2, 0.0];
                let (scale, slope_by_radius) = fisheye_scale(&[0.0; 6], point.norm());
                let bent = point * scale;
                let (outer_scale, slope) = series(radial, bent.norm_squared());
                let outer = radial_jacobian(&bent, outer_scale, 2.0 * slope)
                    + decentering_jacobian(tangential, &bent)
                    + prism_jacobian(&prisms, &bent);
                let value =
                    bent * outer_scale + decentering(tangential, &bent) + prism(&prisms, &bent);
                let jacobian = outer * radial_jacobian(point, scale, slope_by_radius);
                (value, jacobian, outer_scale)
            }
            _ => return None,
        })
    }
}

/// The first coefficients, and zero for those that a simpler model does not have.
pub(crate) fn filled<const N: usize>(first: &[f64]) -> [f64; N] {
    let mut all = [0.0; N];
    for (number, coefficient) in all.iter_mut().zip(first) {
        *number = *coefficient;
    }
    all
}

/// Samples between the axis and a point in which a fold is looked for.
const FOLD_SAMPLES: u32 = 32;
/// Steps from the axis to a point that is to be undistorted.
const STEPS_OUTWARD: u32 = 4;
/// Newton's method converges in less than ten; a fisheye lens near 90° off the
/// axis takes the most.
const NEWTON_ITERATIONS: usize = 50;
/// Far below what a pixel needs, and above the rounding of the formulas. Newton's
/// last step usually gains a dozen digits more.
const NEWTON_TOLERANCE: f64 = 1e-13;

/// `1 + k1 q + k2 q² + …` and its derivative by q.
fn series(coefficients: &[f64], q: f64) -> (f64, f64) {
    let (mut value, mut slope) = (0.0, 0.0);
    for k in coefficients.iter().rev() {
        slope = slope * q + value;
        value = value * q + k;
    }
    (1.0 + q * value, q * slope + value)
}

/// Brown's radial factor at q = r², and its derivative by q.
fn brown_scale(radial: &[f64; 6], q: f64) -> (f64, f64) {
    let (above, above_slope) = series(&radial[..3], q);
    let (below, below_slope) = series(&radial[3..], q);
    let scale = above / below;
    (scale, (above_slope - scale * below_slope) / below)
}

/// The fisheye's radial factor ρ/r, and (its derivative by r) / r.
fn fisheye_scale(radial: &[f64; 6], radius: f64) -> (f64, f64) {
    // Below, the differences of the derivative are rounding, and it is constant.
    const SMALL: f64 = 1e-4;
    if radius < SMALL {
        // θ = r − r³/3 + …
        let slope = 2.0 * (radial[0] - 1.0 / 3.0);
        return (1.0 + slope / 2.0 * radius * radius, slope);
    }
    let angle = radius.atan();
    let (value, slope_by_square) = series(radial, angle * angle);
    let scale = angle * value / radius;
    let by_angle = value + 2.0 * angle * angle * slope_by_square;
    let by_radius = by_angle / (1.0 + radius * radius);
    (scale, (by_radius - scale) / (radius * radius))
}

/// `atan(2 r tan(ω/2)) / (r ω)`.
fn fov_scale(omega: f64, radius: f64) -> f64 {
    if omega == 0.0 {
        return 1.0;
    }
    let stretch = 2.0 * (omega / 2.0).tan();
    if radius == 0.0 {
        return stretch / omega;
    }
    (radius * stretch).atan() / (radius * omega)
}

/// r′ / r with r = r′ (1 + k r′²): the cubic's root by the formulas for thrice
/// the argument of sinh and sin.
fn reverse_radial_scale(k: f64, radius: f64) -> f64 {
    if k == 0.0 || radius == 0.0 {
        return 1.0;
    }
    let root = (3.0 * k.abs()).sqrt();
    let thrice = 1.5 * radius * root;
    let argument = if k > 0.0 {
        (thrice.asinh() / 3.0).sinh()
    } else {
        (thrice.asin() / 3.0).sin()
    };
    2.0 / root * argument / radius
}

/// The derivative of `point · scale(r)`; `slope` is (scale's derivative by r) / r.
fn radial_jacobian(point: &Vector2<f64>, scale: f64, slope: f64) -> Matrix2<f64> {
    Matrix2::identity() * scale + point * point.transpose() * slope
}

/// Tangential distortion: lenses whose axes are not in one line.
fn decentering(&[p1, p2]: &[f64; 2], point: &Vector2<f64>) -> Vector2<f64> {
    let (x, y, q) = (point.x, point.y, point.norm_squared());
    Vector2::new(
        2.0 * p1 * x * y + p2 * (q + 2.0 * x * x),
        p1 * (q + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
}

fn decentering_jacobian(&[p1, p2]: &[f64; 2], point: &Vector2<f64>) -> Matrix2<f64> {
    let (x, y) = (point.x, point.y);
    let mixed = 2.0 * (p1 * x + p2 * y);
    Matrix2::new(
        2.0 * p1 * y + 6.0 * p2 * x,
        mixed,
        mixed,
        6.0 * p1 * y + 2.0 * p2 * x,
    )
}

/// Thin prism distortion: a sensor that is tilted against the lens.
fn prism(&[s1, s2, s3, s4]: &[f64; 4], point: &Vector2<f64>) -> Vector2<f64> {
    let q = point.norm_squared();
    Vector2::new(q * (s1 + s2 * q), q * (s3 + s4 * q))
}

fn prism_jacobian(&[s1, s2, s3, s4]: &[f64; 4], point: &Vector2<f64>) -> Matrix2<f64> {
    let q = point.norm_squared();
    let by_square = Vector2::new(s1 + 2.0 * s2 * q, s3 + 2.0 * s4 * q);
    by_square * point.transpose() * 2.0
}

#[cfg(test)]
mod tests;
