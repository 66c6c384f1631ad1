//! The surfaces of which faces are parts.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_PI_2;

/// The surfaces of faces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Surface {
    /// The points x with `normal · x = offset`.
    Plane {
        /// Of length 1.
        normal: Vector3<f64>,
        /// Distance from the origin along the normal.
        offset: f64,
    },
    /// The points at a distance from an axis.
    Cylinder {
        /// A point of the axis.
        point: Vector3<f64>,
        /// Its direction, of length 1.
        axis: Vector3<f64>,
        /// The distance.
        radius: f64,
        /// Whether the normal points away from the axis, as on a pin; in a hole it points to it.
        convex: bool,
    },
    /// The points that are seen from an apex at an angle to an axis.
    Cone {
        /// The apex.
        apex: Vector3<f64>,
        /// From the apex into the cone, of length 1.
        axis: Vector3<f64>,
        /// The angle, in radians, between 0 and a right one.
        half_angle: f64,
        /// As of a cylinder.
        convex: bool,
    },
    /// The points at a distance from a centre.
    Sphere {
        /// The centre.
        center: Vector3<f64>,
        /// The distance.
        radius: f64,
        /// Whether the normal points away from the centre.
        convex: bool,
    },
    /// Straight lines in one direction through two splines, between which the face is: where it
    /// lies, and to which side its normal points, they say alone.
    Extruded {
        /// Of length 1.
        direction: Vector3<f64>,
    },
    /// A smooth surface through its boundary, where nothing simpler is: the bilinearly blended Coons
    /// patch between the four sides of the first loop, bent so that it holds the others.
    Patch {
        /// How many steps of the first loop each side has, from the first one on. One that has none
        /// is a point.
        sides: [usize; 4],
    },
}

impl Surface {
    /// How far a point lies over the surface, always 0 for one that its boundary says alone; away from
    /// the axis or centre of a round one whichever side its normal points to, and the direction in which
    /// that grows.
    pub fn height_of(&self, at: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let around = |offset: Vector3<f64>, axis: &Vector3<f64>| {
            let along = axis.dot(&offset);
            let across = offset - axis * along;
            let outward = across.try_normalize(0.0).unwrap_or_default();
            (along, across.norm(), outward)
        };
        match self {
            Self::Plane { normal, offset } => (normal.dot(at) - offset, *normal),
            Self::Extruded { .. } | Self::Patch { .. } => (0.0, Vector3::zeros()),
            Self::Sphere { center, radius, .. } => {
                let offset = at - center;
                let outward = offset.try_normalize(0.0).unwrap_or_default();
                (offset.norm() - radius, outward)
            }
            Self::Cylinder {
                point,
                axis,
                radius,
                ..
            } => {
                let (_, across, outward) = around(at - point, axis);
                (across - radius, outward)
            }
            Self::Cone {
                apex,
                axis,
                half_angle,
                ..
            } => {
                let (along, across, outward) = around(at - apex, axis);
                let (sine, cosine) = half_angle.sin_cos();
                (
                    across * cosine - along * sine,
                    outward * cosine - axis * sine,
                )
            }
        }
    }

    /// The normal near a point; 0 where its boundary says it alone.
    pub(super) fn normal_at(&self, at: &Vector3<f64>) -> Vector3<f64> {
        let outward = self.height_of(at).1;
        match self {
            Self::Plane { .. }
            | Self::Extruded { .. }
            | Self::Patch { .. }
            | Self::Cylinder { convex: true, .. }
            | Self::Cone { convex: true, .. }
            | Self::Sphere { convex: true, .. } => outward,
            Self::Cylinder { .. } | Self::Cone { .. } | Self::Sphere { .. } => -outward,
        }
    }

    /// A point of the axis and its direction; `None` of what has none.
    pub(super) fn axis(&self) -> Option<(Vector3<f64>, Vector3<f64>)> {
        match self {
            Self::Plane { .. }
            | Self::Sphere { .. }
            | Self::Extruded { .. }
            | Self::Patch { .. } => None,
            Self::Cylinder { point, axis, .. } => Some((*point, *axis)),
            Self::Cone { apex, axis, .. } => Some((*apex, *axis)),
        }
    }

    /// The radius of a round surface where its axis passes a point, and by how much it grows along
    /// a direction of the axis; `None` of what has no axis.
    pub(super) fn radius_at(
        &self,
        center: &Vector3<f64>,
        along: &Vector3<f64>,
    ) -> Option<[f64; 2]> {
        match self {
            Self::Plane { .. }
            | Self::Sphere { .. }
            | Self::Extruded { .. }
            | Self::Patch { .. } => None,
            Self::Cylinder { radius, .. } => Some([*radius, 0.0]),
            Self::Cone {
                apex,
                axis,
                half_angle,
                ..
            } => {
                let slope = half_angle.tan();
                let growth = slope * axis.dot(along).signum();
                Some([slope * axis.dot(&(center - apex)), growth])
            }
        }
    }

    /// Whether its numbers are such.
    pub(super) fn is_valid(&self) -> bool {
        let unit = |v: &Vector3<f64>| (v.norm() - 1.0).abs() < 1e-6;
        let finite = |v: &Vector3<f64>| v.iter().all(|x| x.is_finite());
        match self {
            Self::Plane { normal, offset } => unit(normal) && offset.is_finite(),
            Self::Sphere { center, radius, .. } => {
                finite(center) && radius.is_normal() && *radius > 0.0
            }
            Self::Extruded { direction } => unit(direction),
            Self::Patch { sides } => sides.iter().filter(|steps| **steps > 0).count() > 1,
            Self::Cylinder {
                point,
                axis,
                radius,
                ..
            } => unit(axis) && finite(point) && radius.is_normal() && *radius > 0.0,
            Self::Cone {
                apex,
                axis,
                half_angle,
                ..
            } => {
                let opens = half_angle.is_normal() && (0.0..FRAC_PI_2).contains(half_angle);
                unit(axis) && finite(apex) && opens
            }
        }
    }

    /// The same where a similarity has moved it that turns nothing, but may mirror it at a point.
    pub(super) fn map(&self, f: impl Fn(&Vector3<f64>) -> Vector3<f64>) -> Self {
        let origin = f(&Vector3::zeros());
        let scale = (f(&Vector3::x()) - origin).x;
        match *self {
            Self::Plane { normal, offset } => {
                let outward = normal * scale.signum();
                Self::Plane {
                    normal: outward,
                    offset: outward.dot(&f(&(normal * offset))),
                }
            }
            Self::Cylinder {
                point,
                axis,
                radius,
                convex,
            } => Self::Cylinder {
                point: f(&point),
                axis: axis * scale.signum(),
                radius: radius * scale.abs(),
                convex,
            },
            Self::Cone {
                apex,
                axis,
                half_angle,
                convex,
            } => Self::Cone {
                apex: f(&apex),
                axis: axis * scale.signum(),
                half_angle,
                convex,
            },
            Self::Sphere {
                center,
                radius,
                convex,
            } => Self::Sphere {
                center: f(&center),
                radius: radius * scale.abs(),
                convex,
            },
            Self::Extruded { .. } => *self,
            // In the mirror, its loop runs the other way around.
            Self::Patch { .. } if scale < 0.0 => self.turned(),
            Self::Patch { .. } => *self,
        }
    }

    /// The same with its normal on the other side.
    pub(super) fn turned(&self) -> Self {
        let mut turned = *self;
        match &mut turned {
            Self::Plane { normal, offset } => (*normal, *offset) = (-*normal, -*offset),
            Self::Cylinder { convex, .. }
            | Self::Cone { convex, .. }
            | Self::Sphere { convex, .. } => *convex = !*convex,
            // Its loop runs the other way around.
            Self::Patch { sides } => sides.reverse(),
            Self::Extruded { .. } => {}
        }
        turned
    }
}
