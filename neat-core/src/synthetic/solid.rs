//! The catalogue of synthetic solids.

use super::Frustum;
use nalgebra::Rotation3;
use serde::{Deserialize, Serialize};

/// A CAD-like solid around the origin, in general position.
///
/// In configuration files the names are in kebab case, such as `stair-prism`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solid {
    /// A box with three different side lengths.
    Box,
    /// An L-shaped prism, like the published toy object without its hole.
    #[default]
    LPrism,
    /// A flight of three stairs.
    StairPrism,
    /// A regular hexagonal prism.
    HexagonalPrism,
    /// A T-shaped prism.
    TPrism,
    /// A U-shaped prism, whose arms hide each other.
    UPrism,
    /// A right-angled wedge: one slanted face.
    Wedge,
    /// A truncated pyramid: four slanted faces.
    TruncatedPyramid,
}

impl Solid {
    /// Every solid.
    pub const ALL: [Self; 8] = [
        Self::Box,
        Self::LPrism,
        Self::StairPrism,
        Self::HexagonalPrism,
        Self::TPrism,
        Self::UPrism,
        Self::Wedge,
        Self::TruncatedPyramid,
    ];

    /// Every solid lies within this distance of the origin.
    pub const BOUNDING_RADIUS: f64 = 0.75;

    /// The name as configuration files write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::LPrism => "l-prism",
            Self::StairPrism => "stair-prism",
            Self::HexagonalPrism => "hexagonal-prism",
            Self::TPrism => "t-prism",
            Self::UPrism => "u-prism",
            Self::Wedge => "wedge",
            Self::TruncatedPyramid => "truncated-pyramid",
        }
    }

    /// The solid's geometry.
    ///
    /// ```
    /// use nalgebra::Vector3;
    /// use neat_core::synthetic::Solid;
    ///
    /// let solid = Solid::LPrism.frustum();
    /// assert_eq!(solid.wireframe().edges.len(), 18);
    /// assert!(solid.sdf(&Vector3::new(2.0, 0.0, 0.0)) > 1.0);
    /// ```
    pub fn frustum(self) -> Frustum {
        let (profile, half_height, top_scale): (&[[f64; 2]], _, _) = match self {
            Self::Box => (
                &[[-0.45, -0.35], [0.45, -0.35], [0.45, 0.35], [-0.45, 0.35]],
                0.25,
                1.0,
            ),
            Self::LPrism => (
                &[
                    [-0.45, -0.45],
                    [0.45, -0.45],
                    [0.45, -0.1],
                    [-0.1, -0.1],
                    [-0.1, 0.45],
                    [-0.45, 0.45],
                ],
                0.3,
                1.0,
            ),
            Self::StairPrism => (
                &[
                    [-0.45, -0.4],
                    [0.45, -0.4],
                    [0.45, -0.13],
                    [0.15, -0.13],
                    [0.15, 0.13],
                    [-0.15, 0.13],
                    [-0.15, 0.4],
                    [-0.45, 0.4],
                ],
                0.35,
                1.0,
            ),
            Self::HexagonalPrism => (&hexagon(0.5), 0.35, 1.0),
            Self::TPrism => (
                &[
                    [-0.13, -0.45],
                    [0.13, -0.45],
                    [0.13, 0.15],
                    [0.45, 0.15],
                    [0.45, 0.45],
                    [-0.45, 0.45],
                    [-0.45, 0.15],
                    [-0.13, 0.15],
                ],
                0.3,
                1.0,
            ),
            Self::UPrism => (
                &[
                    [-0.45, -0.45],
                    [0.45, -0.45],
                    [0.45, 0.45],
                    [0.2, 0.45],
                    [0.2, -0.15],
                    [-0.2, -0.15],
                    [-0.2, 0.45],
                    [-0.45, 0.45],
                ],
                0.3,
                1.0,
            ),
            Self::Wedge => (&[[-0.45, -0.35], [0.45, -0.35], [-0.45, 0.35]], 0.35, 1.0),
            Self::TruncatedPyramid => (
                &[[-0.45, -0.45], [0.45, -0.45], [0.45, 0.45], [-0.45, 0.45]],
                0.35,
                0.5,
            ),
        };
        // No edge or face along an axis: a lucky alignment would hide mistakes.
        let world_from_solid = Rotation3::from_euler_angles(0.35, -0.6, 0.2);
        Frustum::new(profile, half_height, top_scale, world_from_solid)
    }
}

/// A regular hexagon with the given circumradius, counter-clockwise.
fn hexagon(radius: f64) -> [[f64; 2]; 6] {
    std::array::from_fn(|i| {
        let (sin, cos) = (i as f64 * std::f64::consts::FRAC_PI_3).sin_cos();
        [radius * cos, radius * sin]
    })
}
