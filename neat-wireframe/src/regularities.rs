//! Regularities of man-made things as soft constraints: edges of one direction,
//! directions at right angles, flat faces, and edges that continue each other.
//!
//! Directions that many edges share are found in the data, with the tolerance
//! that the uncertainty of each edge allows. A bundle adjustment then pulls the
//! edges towards them, robustly: an edge that the images hold elsewhere stays
//! there. Directions are found and edges adjusted in turn, so that the normal
//! equations keep the sparsity of the graph.

use crate::ViewObservation;
use crate::alignments::{collinear_pulls, coplanar_pulls};
use crate::bundle_adjustment::{
    BundleAdjustmentConfig, adjust_with_pulls, associate_edges, information,
};
use crate::point_grid::PointGrid;
use crate::pulls::{EdgeDirection, Pulls};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

/// A direction is common if of the edges this many times farther from it than
/// its members may be, all but few are members: chance neighbours among many
/// directions are no regularity.
const SURROUNDINGS: f64 = 3.0;
/// The share of members that this takes.
const MIN_SHARE_OF_SURROUNDINGS: f64 = 0.8;
/// Steps towards the mean of the members.
const MEAN_ITERATIONS: usize = 3;

/// Which regularities are looked for, and how hard they pull.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RegularitiesConfig {
    /// Pull edges towards the direction that many share.
    pub parallel: bool,
    /// Make directions orthogonal that nearly are; needs `parallel`.
    pub orthogonal: bool,
    /// Pull the junctions of a face into its plane.
    pub coplanar: bool,
    /// Pull edges that continue each other onto one line.
    pub collinear: bool,
    /// Edges farther from a direction never belong to it, nor do corners whose
    /// planes differ by more to one face.
    pub max_angle_in_degrees: f64,
    /// Junctions farther from a plane or a line never belong to it, in world
    /// units.
    pub max_distance: f64,
    /// Nor does what is farther off than this multiple of its own standard
    /// deviation, one pixel of noise assumed.
    pub max_sigmas: f64,
    /// A direction needs this many edges.
    pub min_edges: usize,
    /// How exactly edges are expected to keep their direction: the scale of the
    /// residuals.
    pub sigma_in_degrees: f64,
    /// The same for junctions and their plane or line, in world units.
    pub sigma_distance: f64,
    /// Times that directions are found and edges are adjusted.
    pub rounds: usize,
}

impl Default for RegularitiesConfig {
    fn default() -> Self {
        Self {
            parallel: false,
            orthogonal: false,
            coplanar: false,
            collinear: false,
            max_angle_in_degrees: 1.0,
            max_distance: 0.003,
            max_sigmas: 3.0,
            min_edges: 8,
            sigma_in_degrees: 0.1,
            sigma_distance: 2e-4,
            rounds: 2,
        }
    }
}

impl RegularitiesConfig {
    /// Whether any regularity is looked for.
    pub fn is_on(&self) -> bool {
        self.parallel || self.coplanar || self.collinear
    }
}

/// [`crate::bundle_adjustment::bundle_adjust`] with the regularities that the
/// junctions show. Without any it changes nothing that the plain adjustment has
/// brought to rest.
pub fn adjust_with_regularities(
    views: &[ViewObservation],
    junctions: &[Vector3<f64>],
    edges: &[[usize; 2]],
    association_in_pixels: f64,
    adjustment: &BundleAdjustmentConfig,
    config: &RegularitiesConfig,
) -> Vec<Vector3<f64>> {
    let observed = associate_edges(views, junctions, edges, association_in_pixels, adjustment);
    let pairs: Vec<[usize; 2]> = observed.iter().map(|edge| edge.junctions).collect();
    let mut junctions = junctions.to_vec();
    for _ in 0..config.rounds {
        let information = information(&observed, &junctions, adjustment);
        let mut pulls = Pulls {
            directions: common_directions(&junctions, &pairs, &information, config),
            junctions: Vec::new(),
        };
        if config.coplanar {
            let faces = coplanar_pulls(&junctions, &pairs, &information, config);
            pulls.junctions.extend(faces);
        }
        if config.collinear {
            let lines = collinear_pulls(&junctions, &pairs, &information, config);
            pulls.junctions.extend(lines);
        }
        if pulls.is_empty() {
            break;
        }
        junctions = adjust_with_pulls(&observed, &pulls, &junctions, adjustment);
    }
    junctions
}

/// An edge as a direction.
struct Bearing {
    pair: [usize; 2],
    direction: Vector3<f64>,
    length: f64,
    /// Largest angle from a common direction, in radians.
    tolerance: f64,
    /// The inverse variance of the direction.
    weight: f64,
}

impl Bearing {
    /// `None` for edges without length or with a junction of which nothing is
    /// known.
    fn new(
        pair: [usize; 2],
        junctions: &[Vector3<f64>],
        information: &[Matrix3<f64>],
        config: &RegularitiesConfig,
    ) -> Option<Self> {
        let [a, b] = pair;
        let offset = junctions[b] - junctions[a];
        let length = offset.norm();
        let covariance = information[a].try_inverse()? + information[b].try_inverse()?;
        let direction = offset / length;
        let along = direction.dot(&(covariance * direction));
        // Of the two directions across, the mean.
        let sigma = (0.5 * (covariance.trace() - along)).sqrt() / length;
        let max_angle = config.max_angle_in_degrees.to_radians();
        sigma.is_normal().then(|| Self {
            pair,
            direction,
            length,
            tolerance: (config.max_sigmas * sigma).min(max_angle),
            weight: sigma.powi(-2),
        })
    }
}

/// The edges that share a direction with enough others, and that direction.
pub(crate) fn common_directions(
    junctions: &[Vector3<f64>],
    pairs: &[[usize; 2]],
    information: &[Matrix3<f64>],
    config: &RegularitiesConfig,
) -> Vec<EdgeDirection> {
    if !config.parallel {
        return Vec::new();
    }
    let bearings: Vec<Bearing> = pairs
        .iter()
        .filter_map(|pair| Bearing::new(*pair, junctions, information, config))
        .collect();
    let mut clusters = clusters(&bearings, config);
    if config.orthogonal {
        make_orthogonal(&mut clusters, &bearings, config);
    }
    let sigma = config.sigma_in_degrees.to_radians();
    clusters
        .iter()
        .flat_map(|cluster| {
            cluster.members.iter().map(|member| {
                let bearing = &bearings[*member];
                EdgeDirection {
                    junctions: bearing.pair,
                    direction: cluster.direction,
                    weight: (sigma * bearing.length).recip(),
                }
            })
        })
        .collect()
}

/// A direction with the edges that share it.
struct Cluster {
    direction: Vector3<f64>,
    members: Vec<usize>,
}

/// The angle between two lines with these unit directions.
fn angle(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    a.cross(b).norm().atan2(a.dot(b).abs())
}

/// Directions with most neighbours first; every edge belongs to one at most.
fn clusters(bearings: &[Bearing], config: &RegularitiesConfig) -> Vec<Cluster> {
    let max_angle = config.max_angle_in_degrees.to_radians();
    // Both ends of every direction: an edge has no sense.
    let both = bearings
        .iter()
        .flat_map(|bearing| [bearing.direction, -bearing.direction]);
    let grid = PointGrid::new(both, SURROUNDINGS * max_angle);
    let near = |direction: &Vector3<f64>, max_angle: f64| {
        let mut near = Vec::new();
        grid.for_each_within(direction, |end, other, _| {
            if angle(direction, other) <= max_angle {
                near.push(end / 2);
            }
        });
        near.sort_unstable();
        near.dedup();
        near
    };
    let mut seeds: Vec<(usize, usize)> = bearings
        .iter()
        .enumerate()
        .map(|(seed, bearing)| (near(&bearing.direction, bearing.tolerance).len(), seed))
        .filter(|(count, _)| *count >= config.min_edges)
        .collect();
    seeds.sort_by_key(|(count, seed)| (std::cmp::Reverse(*count), *seed));

    let mut taken = vec![false; bearings.len()];
    let mut clusters = Vec::new();
    for (_, seed) in seeds {
        if taken[seed] {
            continue;
        }
        let mut direction = bearings[seed].direction;
        let mut members = Vec::new();
        for _ in 0..MEAN_ITERATIONS {
            members = near(&direction, max_angle);
            members.retain(|member| {
                let bearing = &bearings[*member];
                !taken[*member] && angle(&direction, &bearing.direction) <= bearing.tolerance
            });
            direction = mean_direction(&members, bearings, &direction);
        }
        let widest = members.iter().map(|member| bearings[*member].tolerance);
        let surroundings = SURROUNDINGS * widest.fold(0.0, f64::max);
        let around = near(&direction, surroundings).len();
        if members.len() >= config.min_edges
            && members.len() as f64 >= MIN_SHARE_OF_SURROUNDINGS * around as f64
        {
            for member in &members {
                taken[*member] = true;
            }
            clusters.push(Cluster { direction, members });
        }
    }
    clusters
}

/// The weighted mean of the members, in the sense of `towards`.
fn mean_direction(members: &[usize], bearings: &[Bearing], towards: &Vector3<f64>) -> Vector3<f64> {
    let sum: Vector3<f64> = members
        .iter()
        .map(|member| {
            let bearing = &bearings[*member];
            bearing.direction * bearing.weight.copysign(bearing.direction.dot(towards))
        })
        .sum();
    sum.try_normalize(0.0).unwrap_or(*towards)
}

/// Makes directions orthogonal to those with more edges where the angle is
/// within the tolerance of their members.
fn make_orthogonal(clusters: &mut [Cluster], bearings: &[Bearing], config: &RegularitiesConfig) {
    clusters.sort_by_key(|cluster| std::cmp::Reverse(cluster.members.len()));
    for index in 1..clusters.len() {
        let (before, rest) = clusters.split_at_mut(index);
        let cluster = &mut rest[0];
        // The mean of n directions is sure to 1/√n of one.
        let weight: f64 = cluster.members.iter().map(|m| bearings[*m].weight).sum();
        let tolerance = config.max_sigmas / weight.sqrt();
        for other in before {
            let off = cluster.direction.dot(&other.direction);
            if off.abs() <= tolerance.min(config.max_angle_in_degrees.to_radians()) {
                let orthogonal = cluster.direction - other.direction * off;
                cluster.direction = orthogonal.normalize();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};
    use neat_core::LineSegment2;

    fn on() -> RegularitiesConfig {
        RegularitiesConfig {
            parallel: true,
            orthogonal: true,
            coplanar: true,
            collinear: true,
            ..Default::default()
        }
    }

    /// Cubes in a row, each turned by `turn` degrees more than the one before.
    fn row_of_cubes(count: usize, turn: f64) -> (Vec<Vector3<f64>>, Vec<[usize; 2]>) {
        let (corners, cube_edges) = cube();
        let mut junctions = Vec::new();
        let mut edges = Vec::new();
        for i in 0..count {
            let yaw = nalgebra::Rotation3::from_axis_angle(
                &Vector3::z_axis(),
                (turn * i as f64).to_radians(),
            );
            let center = Vector3::x() * 0.5 * (i as f64 - 0.5 * (count - 1) as f64);
            edges.extend(cube_edges.iter().map(|edge| edge.map(|c| c + 8 * i)));
            junctions.extend(corners.iter().map(|corner| center + yaw * (0.3 * corner)));
        }
        (junctions, edges)
    }

    /// Adjusts with and without regularities; the median errors of the junctions.
    fn errors(turn: f64, noise_in_pixels: f64) -> [f64; 2] {
        let (truth, edges) = row_of_cubes(3, turn);
        let mut views = views_of_edges(&cameras_on_sphere(8), &truth, &edges);
        let mut noise = Noise(51);
        for detection in views.iter_mut().flat_map(|view| &mut view.segments) {
            let moved = |end: nalgebra::Vector2<f64>, noise: &mut Noise| {
                end + 1.7 * noise_in_pixels * noise.vector().xy()
            };
            let [start, end] = detection.segment.ends();
            detection.segment = LineSegment2::new(moved(start, &mut noise), moved(end, &mut noise));
        }
        let adjustment = BundleAdjustmentConfig::default();
        let plain =
            crate::bundle_adjustment::bundle_adjust(&views, &truth, &edges, 6.0, &adjustment);
        let regular = adjust_with_regularities(&views, &plain, &edges, 6.0, &adjustment, &on());
        [plain, regular].map(|found| {
            let mut errors: Vec<f64> = found
                .iter()
                .zip(&truth)
                .map(|(found, truth)| (found - truth).norm())
                .collect();
            errors.sort_by(f64::total_cmp);
            errors[errors.len() / 2]
        })
    }

    #[test]
    fn parallel_and_orthogonal_edges_are_found_and_gain() {
        let [plain, regular] = errors(0.0, 0.7);
        assert!(regular < 0.9 * plain, "{plain} {regular}");
    }

    #[test]
    fn edges_two_degrees_apart_are_not_bent() {
        // Exact detections: whatever moves was bent.
        let [plain, regular] = errors(2.0, 0.0);
        assert!(plain < 1e-6 && regular < 1e-6, "{plain} {regular}");
        let [plain, regular] = errors(2.0, 0.7);
        assert!(regular < 1.02 * plain, "{plain} {regular}");
    }

    #[test]
    fn directions_at_random_have_nothing_in_common() {
        let mut noise = Noise(7);
        let junctions: Vec<_> = (0..600).map(|_| noise.vector()).collect();
        let pairs: Vec<_> = (0..300).map(|i| [2 * i, 2 * i + 1]).collect();
        let information = vec![Matrix3::identity() * 1e4; 600];
        assert!(common_directions(&junctions, &pairs, &information, &on()).is_empty());
        let off = RegularitiesConfig::default();
        let (junctions, edges) = row_of_cubes(3, 0.0);
        let information = vec![Matrix3::identity() * 1e6; junctions.len()];
        assert!(common_directions(&junctions, &edges, &information, &off).is_empty());
        let found = common_directions(&junctions, &edges, &information, &on());
        assert_eq!(found.len(), edges.len());
    }
}
