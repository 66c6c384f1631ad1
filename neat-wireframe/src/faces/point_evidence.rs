//! What points of surfaces say of a part of a plane: those that lie on it, and those that cameras
//! see through it.
//!
//! Points on a surface, and those that lie in its plane by chance where there is none, are Poisson
//! processes whose densities the plane tells: that on what looks like surface, and that beside it.

use super::explained_planes::Measured;
use super::plane_fit::FittedPlane;
use super::region::Region;
use super::surface_points::SurfacePoint;
use super::visibility::log_likelihood_ratio;
use nalgebra::{Matrix3, Vector3};

/// A point with the covariance by which planes are asked for it.
pub(super) struct Witness<'a> {
    pub measured: Measured,
    seen_from: &'a [Vector3<f64>],
}

/// All of them; none where there are no points.
pub(super) fn witnesses(points: &[SurfacePoint], floor: Matrix3<f64>) -> Vec<Witness<'_>> {
    let witness =
        |point: &'_ SurfacePoint| (point.position, point.covariance.unwrap_or_default() + floor);
    (points.iter())
        .map(|point| Witness {
            measured: witness(point),
            seen_from: &point.seen_from,
        })
        .collect()
}

/// What a point says of the place in a plane where it lies, or where it is seen through it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Sign {
    On,
    Beside,
    Through,
}

/// The slab of points beside a plane is so many times as thick, on either side, as that of the
/// points on it: near enough to tell of the same place, and with points enough to count.
const SLAB: f64 = 5.0;

/// Calls `say` with each place in the plane of which a point speaks.
pub(super) fn for_each_sign(
    witness: &Witness,
    plane: &FittedPlane,
    mut say: impl FnMut(Vector3<f64>, Sign),
) {
    let (point, covariance) = &witness.measured;
    let distance = plane.relative_distance(point, covariance);
    if distance <= 1.0 {
        say(*point, Sign::On);
        return;
    }
    if distance <= SLAB {
        say(*point, Sign::Beside);
    }
    let (normal, offset) = plane.plane();
    let height = normal.dot(point) - offset;
    for center in witness.seen_from {
        let from = normal.dot(center) - offset;
        if from * height < 0.0 {
            say(
                center + (point - center) * (from / (from - height)),
                Sign::Through,
            );
        }
    }
}

/// How many points say what of a part of a plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct PointEvidence {
    pub area: f64,
    pub on: usize,
    /// Each once, from however many views.
    pub through: usize,
}

/// Points per area.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Densities {
    /// On the surface.
    pub surface: f64,
    /// By chance, in the slab of a plane.
    pub chance: f64,
}

impl Densities {
    /// Of the parts of a plane: the surface is where more points lie on it than are seen through
    /// it, and of `beside` points in the slabs on both sides there are as many in its own by chance.
    /// One more is counted, as none is no density. `None` where there is no surface by that.
    pub fn of<'a>(
        parts: impl Iterator<Item = &'a PointEvidence> + Clone,
        beside: usize,
    ) -> Option<Self> {
        let looks_like_surface = parts.clone().filter(|part| part.on > part.through);
        let (on, on_area) = looks_like_surface.fold((0, 0.0), |(on, area), part| {
            (on + part.on, area + part.area)
        });
        let area: f64 = parts.map(|part| part.area).sum();
        let surface = on as f64 / on_area;
        let chance = (beside as f64 + 1.0) / (SLAB - 1.0) / area;
        (surface > chance).then_some(Self { surface, chance })
    }
}

impl PointEvidence {
    /// Where no point says anything.
    pub fn of_area(area: f64) -> Self {
        Self {
            area,
            ..Self::default()
        }
    }

    /// How much more likely the points are with a surface than without, in nats.
    pub fn log_ratio(&self, densities: &Densities) -> f64 {
        let Densities { surface, chance } = densities;
        let density = self.on as f64 * (surface / chance).ln() - (surface - chance) * self.area;
        density + log_likelihood_ratio(self.through, self.on + self.through)
    }
}

/// How much more likely the points on a face and those seen through it are with it than without:
/// points farther from its surface than `margin` are not on it.
pub(super) fn log_ratio_of_sight(region: &Region, witnesses: &[Witness], margin: f64) -> f64 {
    let (mut on, mut through) = (0, 0);
    for witness in witnesses {
        let (point, _) = &witness.measured;
        if region.distance_to_surface(point) <= margin {
            on += usize::from(region.is_near(point, margin));
        } else {
            let crosses = |center: &Vector3<f64>| region.is_between(center, point);
            through += usize::from(witness.seen_from.iter().any(crosses));
        }
    }
    log_likelihood_ratio(through, on + through)
}
