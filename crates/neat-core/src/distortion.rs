//! Lens distortion: how a lens bends a ray before it meets a pinhole's image.

use serde::{Deserialize, Serialize};

/// A lens model. Every model but [`Self::Division`] leads from the calibrated
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
    /// One-parameter division as VisualSfM stores it, which leads the other way,
    /// from the photograph's calibrated coordinates to those of a pinhole:
    /// `(u, v) · (1 + k (u² + v²))`.
    Division {
        /// k.
        k: f64,
    },
}

impl Distortion {
    /// Whether all coefficients are zero and rays are not bent. A fisheye lens
    /// bends them with any coefficients.
    pub fn is_none(&self) -> bool {
        match self {
            Self::None => true,
            Self::Brown { radial, tangential } => {
                radial.iter().chain(tangential).all(|&x| x == 0.0)
            }
            Self::Fisheye { .. } | Self::ThinPrismFisheye { .. } => false,
            Self::Fov { omega } => *omega == 0.0,
            Self::Division { k } => *k == 0.0,
        }
    }
}
