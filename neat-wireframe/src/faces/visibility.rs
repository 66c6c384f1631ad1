//! What images say about a face: edges that lie behind it are hidden, so those that are seen
//! through it speak against it.
//!
//! Of n curves behind a face, each in one view, k are seen. If the face is there, they are seen
//! by chance, each with a probability of [`BY_CHANCE`]; if not, with an unknown one, as other faces
//! may hide them: its prior is uniform, and the chance of k is B(k + 1, n − k + 1) (Laplace's rule
//! of succession).

use super::chain::point_along;
use super::curves::Curves;
use super::region::Region;
use crate::ViewObservation;
use crate::projection::project_in_front;
use crate::segment_grid::SegmentGrid;
use nalgebra::{Vector2, Vector3};
use neat_core::{Camera, LineSegment2};
use rayon::prelude::*;

/// Probability that 2D segments lie along a hidden curve nevertheless. At 0.02 and 0.1 the same
/// shells close.
pub(super) const BY_CHANCE: f64 = 0.05;
/// A segment shows a point of a curve if it passes so near, in pixels …
const NEAR: f64 = 2.0;
/// … in a direction that differs by a smaller sine.
const PARALLEL: f64 = 0.17;
/// Where another curve passes as near as this, in pixels, a segment may be of that one.
const APART: f64 = 6.0;
/// Points on each curve that are asked for.
const SAMPLES: usize = 24;
/// Their direction is that to a point so much farther on, by the length of the curve.
const STEP: f64 = 0.01;
/// A curve is asked for in a view if so many of its points lie behind the face, alone.
const MIN_SAMPLES: usize = 4;
/// A curve lies behind a face if it is so far from its surface, by the extent of the wireframe.
const BEHIND: f64 = 0.02;

/// A view with its 2D segments.
pub(super) struct DetectedView {
    pub camera: Camera,
    segments: Vec<LineSegment2>,
    grid: SegmentGrid,
}

impl DetectedView {
    /// Those with a usable camera.
    pub fn all(views: &[ViewObservation]) -> Vec<Self> {
        let usable = views
            .par_iter()
            .filter(|view| view.camera.validate().is_ok());
        let detected = usable.map(|view| {
            let segments: Vec<LineSegment2> = view.segments.iter().map(|s| s.segment).collect();
            let (width, height) = (view.camera.width, view.camera.height);
            Self {
                camera: view.camera,
                grid: SegmentGrid::new(&segments, width, height),
                segments,
            }
        });
        detected.collect()
    }

    /// The point at a share of a chain with its pixel and the direction in which the chain goes on
    /// there; `None` outside of the image.
    pub fn look_up(
        &self,
        chain: &[Vector3<f64>],
        place: f64,
    ) -> Option<(Vector3<f64>, Vector2<f64>, Vector2<f64>)> {
        let [point, next] = [place, place + STEP].map(|place| point_along(chain, place));
        let pixel = project_in_front(&self.camera, &point)?;
        let next = project_in_front(&self.camera, &next)?;
        let inside = (0.0..f64::from(self.camera.width)).contains(&pixel.x)
            && (0.0..f64::from(self.camera.height)).contains(&pixel.y);
        inside.then_some((point, pixel, next - pixel))
    }

    /// Whether a segment passes a point of the image in this direction.
    pub fn is_shown(&self, pixel: &Vector2<f64>, along: &Vector2<f64>) -> bool {
        let mut shown = false;
        self.grid.for_each_near(pixel, NEAR, |index| {
            let segment = &self.segments[index];
            let direction = segment.end - segment.start;
            shown |= segment.distance_to_point(pixel) <= NEAR
                && direction.perp(along).abs() <= PARALLEL * direction.norm() * along.norm();
        });
        shown
    }
}

/// A point of a curve in a view where no other curve is near.
struct Sample {
    point: Vector3<f64>,
    pixel: Vector2<f64>,
    seen: bool,
}

/// One view, with its samples curve by curve.
struct ViewSightings {
    camera: Camera,
    of_curves: Vec<(Bounds, Vec<Sample>)>,
}

/// What every view shows of the curves.
pub(super) struct Sightings {
    views: Vec<ViewSightings>,
    behind: f64,
}

impl Sightings {
    pub fn new(curves: &Curves, views: &[DetectedView]) -> Self {
        let chains: Vec<&[Vector3<f64>]> = (curves.observed().map(|curve| &curve.points[..]))
            .chain(curves.loose.iter().map(|points| &points[..]))
            .collect();
        let in_view = |view: &DetectedView| {
            let samples = samples(&chains, view);
            let of_curves = samples
                .into_iter()
                .filter(|of_curve| of_curve.len() >= MIN_SAMPLES);
            let with_bounds = |of_curve: Vec<Sample>| {
                let bounds = Bounds::of(of_curve.iter().map(|sample| Some(sample.pixel)));
                (bounds, of_curve)
            };
            ViewSightings {
                camera: view.camera,
                of_curves: of_curves.map(with_bounds).collect(),
            }
        };
        Self {
            views: views.par_iter().map(in_view).collect(),
            behind: BEHIND * curves.extent,
        }
    }

    /// How much less likely the images are with a face than without, as a logarithm. That hidden
    /// curves are hidden says nothing for it, as other faces may hide them, and so many as are seen
    /// by chance nothing against it.
    ///
    /// `outline` are the points of the face's boundary.
    pub fn against(&self, region: &Region, outline: &[Vector3<f64>]) -> f64 {
        let (mut seen, mut asked) = (0, 0);
        for view in &self.views {
            let bounds = Bounds::of(outline.iter().map(|p| project_in_front(&view.camera, p)));
            let beside = view
                .of_curves
                .iter()
                .filter(|(other, _)| bounds.meets(other));
            for (_, of_curve) in beside {
                let center = &view.camera.center_in_world;
                let hidden = of_curve
                    .iter()
                    .filter(|sample| self.is_behind(region, center, sample));
                let (count, shown) = hidden.fold((0, 0), |(count, shown), sample| {
                    (count + 1, shown + usize::from(sample.seen))
                });
                if count >= MIN_SAMPLES {
                    asked += 1;
                    seen += usize::from(2 * shown >= count);
                }
            }
        }
        if seen as f64 <= BY_CHANCE * asked as f64 {
            return 0.0;
        }
        (-log_likelihood_ratio(seen, asked)).max(0.0)
    }

    fn is_behind(&self, region: &Region, center: &Vector3<f64>, sample: &Sample) -> bool {
        region.is_between(center, &sample.point)
            && region.distance_to_surface(&sample.point) > self.behind
    }
}

/// A rectangle in an image, or all of it.
#[derive(Clone, Copy)]
struct Bounds([Vector2<f64>; 2]);

impl Bounds {
    /// Around points; of those behind the camera nobody knows where they are.
    fn of(pixels: impl Iterator<Item = Option<Vector2<f64>>>) -> Self {
        let none = [Vector2::repeat(f64::MAX), Vector2::repeat(f64::MIN)];
        let all = [Vector2::repeat(f64::MIN), Vector2::repeat(f64::MAX)];
        Self(pixels.fold(none, |[low, high], pixel| match pixel {
            Some(pixel) => [low.inf(&pixel), high.sup(&pixel)],
            None => all,
        }))
    }

    fn meets(&self, other: &Self) -> bool {
        (0..2).all(|k| self.0[0][k] <= other.0[1][k] && other.0[0][k] <= self.0[1][k])
    }
}

/// Of `seen` out of `asked`, with the face by without it.
pub(super) fn log_likelihood_ratio(seen: usize, asked: usize) -> f64 {
    let hidden = asked - seen;
    let with = seen as f64 * BY_CHANCE.ln() + hidden as f64 * (1.0 - BY_CHANCE).ln();
    // B(k + 1, n − k + 1) is 1 / ((n + 1) times the binomial coefficient).
    let binomial: f64 = (1..=seen)
        .map(|k| ((hidden + k) as f64 / k as f64).ln())
        .sum();
    with + ((asked + 1) as f64).ln() + binomial
}

/// The points of each curve that the view shows or hides without doubt.
fn samples(chains: &[&[Vector3<f64>]], view: &DetectedView) -> Vec<Vec<Sample>> {
    let camera = &view.camera;
    let mut pieces = Vec::new();
    let mut owners = Vec::new();
    for (owner, chain) in chains.iter().enumerate() {
        for ends in chain.windows(2) {
            if let [Some(a), Some(b)] = [0, 1].map(|k| project_in_front(camera, &ends[k])) {
                pieces.push(LineSegment2::new(a, b));
                owners.push(owner);
            }
        }
    }
    let projected = SegmentGrid::new(&pieces, camera.width, camera.height);
    let mut samples: Vec<Vec<Sample>> = Vec::with_capacity(chains.len());
    for (curve, chain) in chains.iter().enumerate() {
        let mut of_curve = Vec::new();
        for k in 0..SAMPLES {
            let place = (k as f64 + 0.5) / SAMPLES as f64;
            let Some((point, pixel, along)) = view.look_up(chain, place) else {
                continue;
            };
            let mut alone = true;
            projected.for_each_near(&pixel, APART, |piece| {
                alone &= owners[piece] == curve || pieces[piece].distance_to_point(&pixel) > APART;
            });
            if alone {
                let seen = view.is_shown(&pixel, &along);
                of_curve.push(Sample { point, pixel, seen });
            }
        }
        samples.push(of_curve);
    }
    samples
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_seen_through_a_face_speaks_against_it() {
        assert_eq!(log_likelihood_ratio(0, 0), 0.0);
        // Hidden edges speak for it, but little: other faces may hide them as well.
        let hidden = log_likelihood_ratio(0, 20);
        assert!(hidden > 1.0 && hidden < 4.0, "{hidden}");
        assert!(log_likelihood_ratio(10, 20) < -15.0);
        // Integrating the likelihood over all probabilities gives the Beta function.
        let steps = 100_000;
        let likelihood = |k: usize| {
            let p = (k as f64 + 0.5) / steps as f64;
            p.powi(3) * (1.0 - p).powi(4) / steps as f64
        };
        let without: f64 = (0..steps).map(likelihood).sum();
        let with = BY_CHANCE.powi(3) * (1.0 - BY_CHANCE).powi(4);
        let expected = (with / without).ln();
        assert!((log_likelihood_ratio(3, 7) - expected).abs() < 1e-6);
    }
}
