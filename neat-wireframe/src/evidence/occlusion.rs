//! In how many views the surface leaves an edge visible.

use crate::{SignedDistance, ViewObservation};
use nalgebra::Vector3;
use neat_core::{Camera, LineSegment3};

/// Sight lines are followed in this many rounds of interleaved samples.
const ROUNDS: usize = 8;
/// The surface is asked for about this many points at once, and for all points
/// of at least one edge.
const POINTS_PER_BATCH: usize = 1 << 16;

/// Settings of `visible_views` and of the test that uses it. Lengths are in
/// the unit of a scene whose ball has radius 1.
#[derive(Clone, Debug, PartialEq)]
pub struct OcclusionConfig {
    /// Points of an edge whose sight lines are followed.
    pub points_per_edge: usize,
    /// The first and the last of them lie this share of the edge from its ends.
    pub end_margin: f64,
    /// Samples of each sight line …
    pub samples_per_sight_line: usize,
    /// … from this distance …
    pub start_distance: f64,
    /// … to this one, or the camera.
    pub end_distance: f64,
    /// A signed distance at or below this hides the point.
    pub min_sdf: f64,
    /// The first sample is at most this share of the edge's length away: small
    /// parts of a large scene are thinner than `start_distance`.
    pub max_relative_start_distance: f64,
    /// The depth below the surface that hides a point is at most this share of
    /// the edge's length.
    pub max_relative_depth: f64,
    /// Points outside this ball around the origin hide nothing: the surface
    /// means nothing there.
    pub ball_radius: f64,
    /// Share of its points that must be visible for an edge to count as visible.
    /// Nearly all: only a view that shows both ends can support an edge.
    pub min_visible_share: f64,
    /// An edge needs support in at least this share of the views in which it is
    /// visible.
    pub min_support_ratio: f64,
    /// The ratio's denominator is at least this number of views …
    pub min_denominator: f64,
    /// … or this share of all views, whichever is less.
    pub min_denominator_share: f64,
}

impl Default for OcclusionConfig {
    fn default() -> Self {
        Self {
            points_per_edge: 7,
            end_margin: 0.1,
            samples_per_sight_line: 40,
            start_distance: 0.05,
            end_distance: 1.2,
            min_sdf: -0.015,
            max_relative_start_distance: 0.25,
            max_relative_depth: 0.05,
            ball_radius: 1.0,
            min_visible_share: 0.85,
            min_support_ratio: 0.3,
            min_denominator: 20.0,
            min_denominator_share: 0.2,
        }
    }
}

impl OcclusionConfig {
    /// Support divided by visible views, the latter bounded from below so that
    /// edges visible almost nowhere need evidence too.
    pub fn support_ratio(&self, support: usize, visible_views: usize, views: usize) -> f64 {
        let least = (self.min_denominator_share * views as f64).min(self.min_denominator);
        let denominator = (visible_views as f64).max(least);
        if denominator > 0.0 {
            support as f64 / denominator
        } else {
            0.0
        }
    }
}

/// The number of views in which each edge is visible: most of its points project
/// into the image and have a free sight line to the camera.
///
/// The surface answers batches of points of many edges. Of every sight line a
/// few samples come first; what they decide is asked no further.
///
/// # Panics
/// If an edge names a junction that does not exist.
pub fn visible_views(
    views: &[ViewObservation],
    junctions: &[Vector3<f64>],
    edges: &[[usize; 2]],
    surface: &dyn SignedDistance,
    config: &OcclusionConfig,
) -> Vec<usize> {
    let lines_per_edge = (views.len() * config.points_per_edge).max(1);
    let samples_per_round = config.samples_per_sight_line.div_ceil(ROUNDS).max(1);
    let edges_at_once = (POINTS_PER_BATCH / (lines_per_edge * samples_per_round)).max(1);
    let mut batch = Batch::new(config);
    edges
        .chunks(edges_at_once)
        .flat_map(|edges| {
            let edges = edges
                .iter()
                .map(|[a, b]| LineSegment3::new(junctions[*a], junctions[*b]));
            batch.count_views(edges, views, surface)
        })
        .collect()
}

/// Whether each view sees an edge, see [`visible_views`].
pub(crate) fn views_that_see(
    views: &[ViewObservation],
    edge: &LineSegment3,
    surface: &dyn SignedDistance,
    config: &OcclusionConfig,
) -> Vec<bool> {
    Batch::new(config).sees([*edge].into_iter(), views, surface)
}

/// The sight lines of some edges, with the memory of the queries.
struct Batch<'a> {
    config: &'a OcclusionConfig,
    /// Where on an edge the points lie.
    places: Vec<f64>,
    /// How far along its samples each one lies, in [0, 1].
    fractions: Vec<f64>,
    /// The sight lines on which nothing was hit so far.
    lines: Vec<SightLine>,
    samples: Vec<Vector3<f64>>,
}

/// The line from a point of an edge to a camera.
struct SightLine {
    /// Which pair of edge and view it belongs to.
    pair: usize,
    point: Vector3<f64>,
    direction: Vector3<f64>,
    camera_distance: f64,
    /// Distance of the first sample.
    start_distance: f64,
    /// A signed distance at or below this hides the point.
    min_sdf: f64,
    /// Where its samples of this round end.
    end: usize,
}

impl<'a> Batch<'a> {
    fn new(config: &'a OcclusionConfig) -> Self {
        let margin = config.end_margin;
        Self {
            config,
            places: linspace(margin, 1.0 - margin, config.points_per_edge),
            fractions: linspace(0.0, 1.0, config.samples_per_sight_line),
            lines: Vec::new(),
            samples: Vec::new(),
        }
    }

    /// The number of views that see each edge.
    fn count_views(
        &mut self,
        edges: impl ExactSizeIterator<Item = LineSegment3>,
        views: &[ViewObservation],
        surface: &dyn SignedDistance,
    ) -> Vec<usize> {
        if views.is_empty() {
            return vec![0; edges.len()];
        }
        self.sees(edges, views, surface)
            .chunks(views.len())
            .map(|sees| sees.iter().filter(|sees| **sees).count())
            .collect()
    }

    /// Whether the views see each edge: for one edge after the other, in the order
    /// of the views.
    fn sees(
        &mut self,
        edges: impl Iterator<Item = LineSegment3>,
        views: &[ViewObservation],
        surface: &dyn SignedDistance,
    ) -> Vec<bool> {
        // Points seen so far, of every edge in every view.
        let mut seen = Vec::new();
        self.lines.clear();
        for edge in edges {
            let length = edge.length();
            let config = self.config;
            let start_distance =
                (config.max_relative_start_distance * length).min(config.start_distance);
            let min_sdf = (-config.max_relative_depth * length).max(config.min_sdf);
            for view in views {
                let points = self.places.iter().map(|t| edge.point_at(*t));
                let before = self.lines.len();
                let in_image = points.filter(|point| is_in_image(&view.camera, point));
                self.lines.extend(in_image.map(|point| {
                    let to_camera = view.camera.center_in_world - point;
                    let camera_distance = to_camera.norm();
                    SightLine {
                        pair: seen.len(),
                        point,
                        direction: to_camera / camera_distance,
                        camera_distance,
                        start_distance,
                        min_sdf,
                        end: 0,
                    }
                }));
                seen.push(self.lines.len() - before);
            }
        }
        for round in 0..ROUNDS {
            self.follow(round, surface, &mut seen);
        }
        seen.into_iter().map(|seen| self.is_enough(seen)).collect()
    }

    /// Asks for every `ROUNDS`-th sample of each line, and drops the lines that
    /// are hit and those of views in which too few points are left.
    fn follow(&mut self, round: usize, surface: &dyn SignedDistance, seen: &mut [usize]) {
        let config = self.config;
        let enough = config.min_visible_share * self.places.len() as f64;
        self.lines.retain(|line| seen[line.pair] as f64 >= enough);
        self.samples.clear();
        for line in &mut self.lines {
            let span = config.end_distance - line.start_distance;
            let fractions = self.fractions.iter().skip(round).step_by(ROUNDS);
            self.samples.extend(
                fractions
                    .map(|fraction| line.start_distance + span * fraction)
                    .filter(|distance| *distance < line.camera_distance)
                    .map(|distance| line.point + line.direction * distance)
                    .filter(|sample| sample.norm() < config.ball_radius),
            );
            line.end = self.samples.len();
        }
        let sdf = surface.sdf(&self.samples);
        let mut begin = 0;
        self.lines.retain(|line| {
            // A surface that answers too few points hides the rest.
            let free = sdf
                .get(begin..line.end)
                .is_some_and(|sdf| sdf.iter().all(|distance| *distance > line.min_sdf));
            begin = line.end;
            if !free {
                seen[line.pair] -= 1;
            }
            free
        });
    }

    fn is_enough(&self, seen: usize) -> bool {
        seen as f64 >= self.config.min_visible_share * self.places.len() as f64
    }
}

fn is_in_image(camera: &Camera, point: &Vector3<f64>) -> bool {
    crate::projection::project_in_front(camera, point).is_some_and(|pixel| {
        (0.0..f64::from(camera.width)).contains(&pixel.x)
            && (0.0..f64::from(camera.height)).contains(&pixel.y)
    })
}

/// `count` evenly spaced numbers from `first` to `last`; `first` alone for one.
fn linspace(first: f64, last: f64, count: usize) -> Vec<f64> {
    let intervals = count.saturating_sub(1).max(1) as f64;
    (0..count)
        .map(|i| first + (last - first) * i as f64 / intervals)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::{Noise, camera_looking_at_origin, cube};

    /// A box of half side 0.5.
    struct Cube;

    impl SignedDistance for Cube {
        fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
            points.iter().map(|p| p.amax() - 0.5).collect()
        }

        fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
            let gradient = |p: &Vector3<f64>| Vector3::ith(p.iamax(), p[p.iamax()].signum());
            points
                .iter()
                .zip(self.sdf(points))
                .map(|(p, sdf)| (sdf, gradient(p)))
                .collect()
        }
    }

    fn view_from(x: f64, y: f64, z: f64) -> ViewObservation {
        ViewObservation {
            camera: camera_looking_at_origin(&Vector3::new(x, y, z)),
            segments: Vec::new(),
            junctions: Vec::new(),
        }
    }

    #[test]
    fn the_object_hides_its_far_edges_and_the_chords_through_it() {
        let (junctions, _) = cube();
        let views = [
            view_from(1.5, 1.6, 1.7),
            view_from(1.5, -1.6, 1.7),
            view_from(-1.5, -1.6, -1.7),
        ];
        // The edge x = y = +0.5 along z, its opposite, and the space diagonal.
        let edges = [[3, 7], [0, 4], [0, 7]];
        let config = OcclusionConfig::default();
        assert_eq!(
            visible_views(&views, &junctions, &edges, &Cube, &config),
            [2, 2, 0]
        );
    }

    #[test]
    fn an_edge_outside_the_image_is_not_visible() {
        let (junctions, _) = cube();
        let mut view = view_from(1.5, 1.6, 1.7);
        let config = OcclusionConfig::default();
        let count = |view: &ViewObservation| {
            visible_views(
                std::slice::from_ref(view),
                &junctions,
                &[[3, 7]],
                &Cube,
                &config,
            )[0]
        };
        assert_eq!(count(&view), 1);
        view.camera.intrinsics.cx = -400.0;
        assert_eq!(count(&view), 0);
    }

    /// The definition: every sample of every sight line is asked for.
    fn visible_views_by_scan(
        views: &[ViewObservation],
        edge: &LineSegment3,
        config: &OcclusionConfig,
    ) -> usize {
        let length = edge.length();
        let start = (config.max_relative_start_distance * length).min(config.start_distance);
        let min_sdf = (-config.max_relative_depth * length).max(config.min_sdf);
        let margin = config.end_margin;
        let places = linspace(margin, 1.0 - margin, config.points_per_edge);
        let is_visible = |view: &ViewObservation, point: Vector3<f64>| {
            let to_camera = view.camera.center_in_world - point;
            let samples = linspace(start, config.end_distance, config.samples_per_sight_line);
            is_in_image(&view.camera, &point)
                && samples
                    .iter()
                    .filter(|distance| **distance < to_camera.norm())
                    .map(|distance| point + to_camera.normalize() * *distance)
                    .filter(|sample| sample.norm() < config.ball_radius)
                    .all(|sample| Cube.sdf(&[sample])[0] > min_sdf)
        };
        views
            .iter()
            .filter(|view| {
                let visible = places
                    .iter()
                    .filter(|t| is_visible(view, edge.point_at(**t)));
                visible.count() as f64 >= config.min_visible_share * places.len() as f64
            })
            .count()
    }

    #[test]
    fn rounds_and_batches_change_nothing() {
        let mut noise = Noise(19);
        let junctions: Vec<_> = (0..400).map(|_| 0.8 * noise.vector()).collect();
        let edges: Vec<[usize; 2]> = (0..200).map(|i| [2 * i, 2 * i + 1]).collect();
        let mut views: Vec<_> = (0..7)
            .map(|_| {
                let [x, y, z] = (2.0 * noise.vector().normalize()).into();
                view_from(x, y, z)
            })
            .collect();
        views[0].camera.intrinsics.cx = 60.0;
        for config in [
            OcclusionConfig::default(),
            OcclusionConfig {
                points_per_edge: 3,
                samples_per_sight_line: 5,
                min_visible_share: 1.0,
                ..Default::default()
            },
        ] {
            let counts = visible_views(&views, &junctions, &edges, &Cube, &config);
            let scanned: Vec<_> = edges
                .iter()
                .map(|[a, b]| LineSegment3::new(junctions[*a], junctions[*b]))
                .map(|edge| visible_views_by_scan(&views, &edge, &config))
                .collect();
            assert_eq!(counts, scanned);
            assert!(counts.contains(&0) && counts.iter().any(|count| *count > 3));
        }
        assert_eq!(
            visible_views(&[], &junctions, &edges, &Cube, &OcclusionConfig::default()),
            vec![0; edges.len()]
        );
    }

    #[test]
    fn points_outside_the_ball_hide_nothing() {
        /// Solid everywhere.
        struct Solid;
        impl SignedDistance for Solid {
            fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
                vec![-1.0; points.len()]
            }
            fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
                vec![(-1.0, Vector3::zeros()); points.len()]
            }
        }
        let views = [view_from(2.0, 2.0, 2.0)];
        let junctions = [Vector3::new(0.6, 0.5, 0.5), Vector3::new(0.5, 0.6, 0.5)];
        let config = OcclusionConfig {
            ball_radius: 0.9,
            ..Default::default()
        };
        let count = |config| visible_views(&views, &junctions, &[[0, 1]], &Solid, config)[0];
        assert_eq!(count(&config), 1);
        assert_eq!(count(&OcclusionConfig::default()), 0);
    }

    #[test]
    fn the_ratio_has_a_floor() {
        let config = OcclusionConfig::default();
        assert_eq!(config.support_ratio(30, 60, 100), 0.5);
        assert_eq!(config.support_ratio(5, 0, 100), 0.25);
        assert_eq!(config.support_ratio(5, 0, 1000), 0.25);
        assert_eq!(config.support_ratio(0, 0, 0), 0.0);
    }
}
