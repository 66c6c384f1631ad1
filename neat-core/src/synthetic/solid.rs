//! The catalogue of synthetic solids.

use super::Frustum;
use super::profile::Profile;
use nalgebra::{Rotation3, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use std::f64::consts::{FRAC_PI_2, SQRT_2};

/// A CAD-like solid around the origin, in general position; a house stands upright.
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
    /// A house with a gable roof.
    GableHouse,
    /// A circular cylinder.
    Cylinder,
    /// A truncated cone.
    TruncatedCone,
    /// A shaft with a flat: an arc that meets a line at an angle.
    DShaft,
    /// A block with a vault: an arc that goes on in two walls.
    Arch,
    /// A link with round ends and a hole in each.
    Link,
    /// A plate with rounded corners, four bolt holes and a bore.
    DrilledPlate,
}

impl Solid {
    /// Every solid.
    pub const ALL: [Self; 15] = [
        Self::Box,
        Self::LPrism,
        Self::StairPrism,
        Self::HexagonalPrism,
        Self::TPrism,
        Self::UPrism,
        Self::Wedge,
        Self::TruncatedPyramid,
        Self::GableHouse,
        Self::Cylinder,
        Self::TruncatedCone,
        Self::DShaft,
        Self::Arch,
        Self::Link,
        Self::DrilledPlate,
    ];

    /// Those with planes and straight edges only.
    pub const POLYHEDRA: [Self; 9] = [
        Self::Box,
        Self::LPrism,
        Self::StairPrism,
        Self::HexagonalPrism,
        Self::TPrism,
        Self::UPrism,
        Self::Wedge,
        Self::TruncatedPyramid,
        Self::GableHouse,
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
            Self::GableHouse => "gable-house",
            Self::Cylinder => "cylinder",
            Self::TruncatedCone => "truncated-cone",
            Self::DShaft => "d-shaft",
            Self::Arch => "arch",
            Self::Link => "link",
            Self::DrilledPlate => "drilled-plate",
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
        let (profile, half_height) = self.profile();
        let top_scale = match self {
            Self::TruncatedPyramid | Self::TruncatedCone => 0.5,
            _ => 1.0,
        };
        let world_from_solid = match self {
            // Lying on its side, so that the roof's ridge is swept.
            Self::GableHouse => {
                Rotation3::from_axis_angle(&Vector3::z_axis(), 0.35)
                    * Rotation3::from_axis_angle(&Vector3::x_axis(), FRAC_PI_2)
            }
            // No edge or face along an axis: a lucky alignment would hide mistakes.
            _ => Rotation3::from_euler_angles(0.35, -0.6, 0.2),
        };
        Frustum::new(profile, half_height, top_scale, world_from_solid)
    }

    /// What is swept, and half of how far.
    fn profile(self) -> (Profile, f64) {
        match self {
            Self::Cylinder => (Profile::disc([0.0, 0.0], 0.4), 0.3),
            Self::TruncatedCone => (Profile::disc([0.0, 0.0], 0.45), 0.35),
            Self::DShaft => {
                // Three quarters of a circle of radius 0.4.
                let half = 0.4 / SQRT_2;
                let three_quarters = 0.75 * FRAC_PI_2;
                let corners = [[half, half, three_quarters.tan()], [half, -half, 0.0]];
                (Profile::chain(&corners), 0.35)
            }
            Self::Arch => {
                let corners = [
                    [-0.45, -0.4, 0.0],
                    [-0.22, -0.4, 0.0],
                    [-0.22, 0.05, -1.0],
                    [0.22, 0.05, 0.0],
                    [0.22, -0.4, 0.0],
                    [0.45, -0.4, 0.0],
                    [0.45, 0.4, 0.0],
                    [-0.45, 0.4, 0.0],
                ];
                (Profile::chain(&corners), 0.25)
            }
            Self::Link => {
                let corners = [
                    [-0.25, -0.25, 0.0],
                    [0.25, -0.25, 1.0],
                    [0.25, 0.25, 0.0],
                    [-0.25, 0.25, 1.0],
                ];
                let profile = (Profile::chain(&corners))
                    .without_disc([-0.25, 0.0], 0.12)
                    .without_disc([0.25, 0.0], 0.12);
                (profile, 0.12)
            }
            Self::DrilledPlate => (drilled_plate(), 0.1),
            _ => {
                let (vertices, half_height) = self.polygon();
                let vertices: Vec<_> = vertices.iter().map(|v| Vector2::from(*v)).collect();
                (Profile::polygon(&vertices), half_height)
            }
        }
    }

    /// The profile of a polyhedron.
    fn polygon(self) -> (Vec<[f64; 2]>, f64) {
        match self {
            Self::Box => (
                vec![[-0.45, -0.35], [0.45, -0.35], [0.45, 0.35], [-0.45, 0.35]],
                0.25,
            ),
            Self::LPrism => (
                vec![
                    [-0.45, -0.45],
                    [0.45, -0.45],
                    [0.45, -0.1],
                    [-0.1, -0.1],
                    [-0.1, 0.45],
                    [-0.45, 0.45],
                ],
                0.3,
            ),
            Self::StairPrism => (
                vec![
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
            ),
            Self::HexagonalPrism => (hexagon(0.5).to_vec(), 0.35),
            Self::TPrism => (
                vec![
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
            ),
            Self::UPrism => (
                vec![
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
            ),
            Self::Wedge => (vec![[-0.45, -0.35], [0.45, -0.35], [-0.45, 0.35]], 0.35),
            Self::TruncatedPyramid => (
                vec![[-0.45, -0.45], [0.45, -0.45], [0.45, 0.45], [-0.45, 0.45]],
                0.35,
            ),
            _ => (
                // The gable house.
                vec![
                    [-0.35, -0.35],
                    [0.35, -0.35],
                    [0.35, 0.1],
                    [0.0, 0.35],
                    [-0.35, 0.1],
                ],
                0.45,
            ),
        }
    }
}

/// A plate with rounded corners, four bolt holes and a bore.
fn drilled_plate() -> Profile {
    let (x, y, radius) = (0.5, 0.35, 0.12);
    let quarter = (FRAC_PI_2 / 4.0).tan();
    let corners = [
        [-x + radius, -y, 0.0],
        [x - radius, -y, quarter],
        [x, -y + radius, 0.0],
        [x, y - radius, quarter],
        [x - radius, y, 0.0],
        [-x + radius, y, quarter],
        [-x, y - radius, 0.0],
        [-x, -y + radius, quarter],
    ];
    let bolts = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    (bolts.into_iter())
        .map(|[right, up]| [right * (x - radius), up * (y - radius)])
        .fold(Profile::chain(&corners), |plate, center| {
            plate.without_disc(center, 0.05)
        })
        .without_disc([0.0, 0.0], 0.17)
}

/// A regular hexagon with the given circumradius, counter-clockwise.
fn hexagon(radius: f64) -> [[f64; 2]; 6] {
    std::array::from_fn(|i| {
        let (sin, cos) = (i as f64 * std::f64::consts::FRAC_PI_3).sin_cos();
        [radius * cos, radius * sin]
    })
}
