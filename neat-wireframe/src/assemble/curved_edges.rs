//! Edges of the graph that are curves between their junctions.
//!
//! A short curve between two corners, a quarter of an ellipse in which two cylinders meet or a
//! spline of twenty pixels, proposes its chord, from which most of its edgels lie no farther than
//! noise does, and [`super::arcs`] finds nothing that would go on beyond its ends. Once the graph
//! stands, though, its ends are known, and nothing else lies between them: all views together
//! tell whether it is bowed, and its neighbours lose no corner with it.
//!
//! What views say of a bow is weighed with one and without: by the probability of all that they
//! say if the bow of a curve may be anything up to an eighth of a circle or so, and if that of a
//! straight edge is what shading and smoothing make of it (MacKay, *Bayesian interpolation*,
//! 1992, by Laplace's approximation). How often an edge of the scene is a curve, all of them tell
//! together (Efron's *two groups*, 2008): one bow in eight hundred edges is none.

use super::circle_fitting::FoundArc;
use super::curves::{BESIDE_IN_PIXELS, runs_beside};
use super::edge_cutting::retain_edges;
use super::edge_samples::{Images, MIN_COSINE, project_segment};
use super::line_fitting::{directions_across, loss_of_reach};
use super::line_selection::REACH_NOISES;
use super::projected_line::ProjectedLine;
use crate::solve::reweighted;
use crate::statistics::upper_median;
use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};
use neat_core::{CircularArc, LineSegment3, Wireframe3d};
use rayon::prelude::*;
use std::ops::ControlFlow;

/// Shares of an edge around its middle, each of which has to tell of a bow: true lines bend at
/// their ends, where they run into arcs or corners are round, and there only.
const SHARES: [f64; 2] = [0.6, 0.9];
/// How high a curve bows, by its length: an eighth of a circle does so. With half of that four
/// more true edges of photographs with truth go, and one of an object …
const BOW_OF_CURVE: f64 = 0.1;
/// … and how high all views may see a straight edge bow, in reaches, judged: half the standard
/// deviation of an edgel.
const BOW_OF_LINE: f64 = 0.5 / REACH_NOISES;
/// Edgels of a bowed edge lie farther from its chord than those of a straight one: within so
/// many reaches, and at least so many pixels, judged.
const WIDE_REACH: f64 = 2.5;
const MIN_WIDE_REACH: f64 = 2.0;
/// Pixels between samples: each edgel is beside one of them.
const SPACING: f64 = 1.2;
/// Samples of a view.
const COUNTS: [f64; 2] = [6.0, 200.0];
/// Fewer edgels of a view, and fewer views, tell nothing of a bow.
const MIN_EDGELS: usize = 6;
const MIN_VIEWS: usize = 3;
/// What keeps a parameter that no edgel tells of.
const RIDGE: f64 = 1e-9;
/// Rounds of the fit to what views say.
const ROUNDS: usize = 12;
/// Rounds in which the share of curves settles: each brings it nearer by what is unsure in it.
const ROUNDS_OF_SHARE: usize = 100;
/// What a view says has Student's t distribution, with so many degrees of freedom, as profiles …
const DEGREES: f64 = 3.0;
/// … and half of it is less than this, by its scale.
const MEDIAN: f64 = 0.765;
/// From fewer numbers the scale is not estimated.
const MIN_RESIDUALS: usize = 30;

/// An edge that is a curve.
pub(super) struct CurvedEdge {
    /// Its junctions.
    pub ends: [usize; 2],
    /// Where it has its middle.
    pub middle: Vector3<f64>,
    gain: f64,
    pixel: f64,
}

/// What a view says of an edge, in pixels.
#[derive(Clone, Copy)]
struct BowOfView {
    /// Where the middle lies beside the line, and how high that is over the ends.
    middle: f64,
    height: f64,
    /// Of the height.
    variance: f64,
    /// How both change with the place of the middle in space.
    by_shift: Vector2<f64>,
}

/// An edge, and what the views that show it say of each share of it.
struct AskedEdge {
    line: LineSegment3,
    across: Matrix3x2<f64>,
    pixel: f64,
    views: [Vec<BowOfView>; SHARES.len()],
}

/// Takes the edges that are curves away from a wireframe. `sources` belong to its edges.
pub(super) fn take_curved_edges(
    images: &Images,
    wireframe: &mut Wireframe3d,
    sources: &mut Vec<Option<usize>>,
) -> Vec<CurvedEdge> {
    let Wireframe3d { junctions, edges } = wireframe;
    let mut asked: Vec<Option<AskedEdge>> = (edges.par_iter())
        .map(|ends| images.asked_edge(ends.map(|end| junctions[end])))
        .collect();
    for share in 0..SHARES.len() {
        scale_variances(&mut asked, share);
    }
    let least = BOW_OF_LINE * images.reach;
    let gains: Vec<Option<f64>> = (asked.par_iter())
        .map(|asked| asked.as_ref()?.gain(least))
        .collect();
    let least = least_gain(gains.iter().flatten().copied());
    let curved: Vec<Option<CurvedEdge>> = (edges.iter().zip(asked.iter().zip(&gains)))
        .map(|(ends, (asked, gain))| {
            let gain = gain.filter(|gain| *gain > least)?;
            asked.as_ref()?.curve(*ends, gain)
        })
        .collect();
    let kept: Vec<bool> = curved.iter().map(Option::is_none).collect();
    retain_edges(&kept, edges, sources);
    curved.into_iter().flatten().collect()
}

/// From which gain on an edge is rather a curve: what the odds of one cost, by the share of the edges
/// that are, of which one more is and one is not. In no scene are these more than half.
fn least_gain(gains: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = gains.clone().count() as f64;
    let mut cost = 0.0_f64;
    for _ in 0..ROUNDS_OF_SHARE {
        let curved: f64 = gains
            .clone()
            .map(|gain| (1.0 + (cost - gain).exp()).recip())
            .sum();
        let share = (1.0 + curved) / (2.0 + count);
        cost = (share.recip() - 1.0).ln().max(0.0);
    }
    cost
}

/// Adds those that no arc runs along, as arcs between their junctions.
pub(super) fn add_as_arcs(
    curved: &[CurvedEdge],
    junctions: &[Vector3<f64>],
    arcs: &mut Vec<FoundArc>,
) {
    for edge in curved {
        let [start, end] = edge.ends.map(|end| junctions[end]);
        let near = BESIDE_IN_PIXELS * edge.pixel;
        let arc = CircularArc::through([start, edge.middle, end])
            .filter(|arc| !arcs.iter().any(|other| runs_beside(other, arc, near)));
        arcs.extend(arc.map(|arc| FoundArc {
            arc,
            gain: edge.gain,
            pixel: edge.pixel,
            sectors: Vec::new(),
            covariance: None,
        }));
    }
}

/// Takes the variances of one share times what views differ by: by how far they are from what all
/// views of their edge say together, be it bowed or not.
fn scale_variances(asked: &mut [Option<AskedEdge>], share: usize) {
    let residuals = |edge: &AskedEdge| {
        let views = &edge.views[share];
        // Two numbers are fitted to them.
        let freedom = views.len().checked_sub(2).filter(|freedom| *freedom > 1)?;
        let (bow, _) = fit(views, |view| view.height, edge.bow_of_curve(share))?;
        let factor = (views.len() as f64 / freedom as f64).sqrt();
        let residual = |view: &BowOfView| (view.height - view.by_shift.dot(&bow)) * factor;
        let scaled = |view: &BowOfView| residual(view).abs() / view.variance.sqrt();
        Some(views.iter().map(scaled).collect::<Vec<f64>>())
    };
    let mut all: Vec<f64> = (asked.par_iter().flatten())
        .filter_map(residuals)
        .flatten_iter()
        .collect();
    if all.len() < MIN_RESIDUALS {
        return;
    }
    let scale = (upper_median(&mut all) / MEDIAN).powi(2);
    if scale.is_normal() {
        (asked.iter_mut().flatten())
            .flat_map(|edge| &mut edge.views[share])
            .for_each(|view| view.variance *= scale);
    }
}

impl Images<'_> {
    fn asked_edge(&self, [start, end]: [Vector3<f64>; 2]) -> Option<AskedEdge> {
        let line = LineSegment3::new(start, end);
        let across = directions_across(&line)?;
        let evidence = self.evidence(&line, None, f64::NEG_INFINITY);
        let views = SHARES.map(|share| {
            (evidence.views())
                .filter_map(|view| self.bow_of_view(view, &line, &across, share))
                .collect()
        });
        let pixel = self.pixel_size(&line, evidence.views());
        Some(AskedEdge {
            line,
            across,
            pixel,
            views,
        })
    }

    /// What a view says of a share of an edge around its middle.
    fn bow_of_view(
        &self,
        view: usize,
        line: &LineSegment3,
        across: &Matrix3x2<f64>,
        share: f64,
    ) -> Option<BowOfView> {
        let (camera, map) = (&self.views[view].camera, &self.maps[view]);
        let projected = ProjectedLine::new(camera, line)?;
        let length = project_segment(&self.views[view], line).map_or(0.0, |whole| whole.length());
        let count = (share * length / SPACING).clamp(COUNTS[0], COUNTS[1]) as usize;
        let inner = [0.5 - 0.5 * share, 0.5 + 0.5 * share];
        let samples = self.samples(view, line, inner, Some(count))?;
        let reach = (WIDE_REACH * self.reach).max(MIN_WIDE_REACH);
        let mut rows = Vec::new();
        for sample in &samples {
            let along = (2.0 * sample.place - 1.0) / share;
            let row = Vector3::new(1.0, along, -along * along);
            map.visit(
                &sample.pixel,
                &sample.normal,
                reach,
                MIN_COSINE,
                |_, edgel| {
                    rows.push((row, -projected.distance(&map.get(edgel).position.cast())));
                    ControlFlow::Continue(())
                },
            );
        }
        if rows.len() < MIN_EDGELS {
            return None;
        }
        let found = reweighted(&rows, loss_of_reach(self.reach), RIDGE)?;
        let noise = self.reach / REACH_NOISES;
        let middle = samples[samples.len() / 2].pixel;
        let [by_start, by_end] = projected.distance_with_gradient(camera, &middle).by_points;
        Some(BowOfView {
            middle: found.solution.x,
            height: found.solution.z,
            variance: found.covariance[(2, 2)].max(noise * noise / rows.len() as f64),
            by_shift: across.tr_mul(&(by_start + by_end)),
        })
    }
}

impl AskedEdge {
    /// How high a share of it bows if it is a curve: with the square of the share.
    fn bow_of_curve(&self, share: usize) -> f64 {
        BOW_OF_CURVE * self.line.length() * SHARES[share].powi(2)
    }

    /// What views say for a curve, in nats, against an edge that may bow by `least` pixels.
    fn gain(&self, least: f64) -> Option<f64> {
        let mut gain = f64::INFINITY;
        for (share, views) in self.views.iter().enumerate() {
            let curve = nats(views, self.bow_of_curve(share))?;
            gain = gain.min(curve - nats(views, least * self.pixel)?);
        }
        Some(gain)
    }

    /// The curve that it is.
    fn curve(&self, ends: [usize; 2], gain: f64) -> Option<CurvedEdge> {
        let (shift, _) = fit(&self.views[1], |view| view.middle, self.bow_of_curve(1))?;
        Some(CurvedEdge {
            ends,
            middle: self.line.point_at(0.5) + self.across * shift,
            gain,
            pixel: self.pixel,
        })
    }
}

/// How likely what views say is, in nats, if an edge bows by so much (a standard deviation along
/// each of two directions); up to what is the same for every one.
fn nats(views: &[BowOfView], deviation: f64) -> Option<f64> {
    let (bow, information) = fit(views, |view| view.height, deviation)?;
    let of_view = |view: &BowOfView| {
        let residual = view.height - view.by_shift.dot(&bow);
        let squared = residual * residual / view.variance;
        -0.5 * (DEGREES + 1.0) * (1.0 + squared / DEGREES).ln()
    };
    let of_bow = -0.5 * bow.norm_squared() / deviation.powi(2) - 2.0 * deviation.ln();
    let of_all: f64 = views.iter().map(of_view).sum();
    Some(of_all + of_bow - 0.5 * information.determinant().ln())
}

/// The shift across an edge in space by which views see what they say, and its information. It is
/// about as large as `deviation` at most.
fn fit(
    views: &[BowOfView],
    seen: impl Fn(&BowOfView) -> f64,
    deviation: f64,
) -> Option<(Vector2<f64>, Matrix2<f64>)> {
    if views.len() < MIN_VIEWS {
        return None;
    }
    let mut shift = Vector2::zeros();
    let mut matrix = Matrix2::zeros();
    for _ in 0..ROUNDS {
        matrix = Matrix2::identity() * deviation.powi(-2);
        let mut right = Vector2::zeros();
        for view in views {
            let residual = seen(view) - view.by_shift.dot(&shift);
            let weight = (DEGREES + 1.0) / (DEGREES * view.variance + residual * residual);
            matrix += weight * view.by_shift * view.by_shift.transpose();
            right += weight * seen(view) * view.by_shift;
        }
        shift = matrix.cholesky()?.solve(&right);
    }
    (shift.iter().chain(&matrix).all(|x| x.is_finite())).then_some((shift, matrix))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::TestViews;
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use neat_core::Camera;
    use std::f64::consts::TAU;

    /// A sixteenth of a circle, 16 pixels long and .8 high.
    fn curve() -> CircularArc {
        CircularArc {
            center: Vector3::new(0.05, -0.1, 0.1),
            axes: [Vector3::new(0.6, 0.8, 0.0), Vector3::z()],
            radius: 0.15,
            angles: [0.1, 0.1 + TAU / 16.0],
        }
    }

    /// A four-sided graph, of which the first edge lies along the curve as lines are fitted to it,
    /// and views that see the curve if `shows_curve` says so, else that edge.
    fn scene(shows_curve: impl Fn(usize) -> bool) -> (TestViews, Wireframe3d) {
        let points = curve().points(TAU / 120.0);
        let last = points.len() - 1;
        let rise = points[last / 2] - 0.5 * (points[0] + points[last]);
        let beside = Vector3::new(0.1, -0.3, -0.05);
        let far = [points[last] + beside, points[0] + beside];
        let near = [points[0], points[last]].map(|end| end + rise * 2.0 / 3.0);
        let junctions = [near, far].concat();
        let edges = vec![[0, 1], [1, 2], [2, 3], [0, 3]];
        let curved: Vec<Vector3<f64>> = points.iter().copied().chain(far).collect();
        let pieces = (0..last).map(|k| [k, k + 1]);
        let rest = [[last, last + 1], [last + 1, last + 2], [0, last + 2]];
        let curved_edges: Vec<[usize; 2]> = pieces.chain(rest).collect();
        let view = |(k, camera): (usize, &Camera)| {
            let seen = if shows_curve(k) {
                views_of_edges(&[*camera], &curved, &curved_edges)
            } else {
                views_of_edges(&[*camera], &junctions, &edges)
            };
            PreparedView::new(&seen[0], 1.0, 0.0)
        };
        let cameras = cameras_on_sphere(20);
        let views = TestViews::of(cameras.iter().enumerate().map(view).collect());
        (views, Wireframe3d { junctions, edges })
    }

    #[test]
    fn a_curve_between_two_corners_is_no_edge() {
        let (views, mut wireframe) = scene(|_| true);
        let images = views.images();
        let mut sources = vec![Some(4), Some(5), None, Some(7)];
        let curved = take_curved_edges(&images, &mut wireframe, &mut sources);
        assert_eq!(wireframe.edges, [[1, 2], [2, 3], [0, 3]]);
        assert_eq!(sources, [Some(5), None, Some(7)]);
        let [edge] = &curved[..] else {
            panic!("{} curves", curved.len())
        };
        assert_eq!(edge.ends, [0, 1]);
        // Its neighbours tell where it ends.
        let truth = curve();
        let junctions = truth.angles.map(|angle| truth.point_at(angle));
        let mut arcs = Vec::new();
        for _ in 0..2 {
            add_as_arcs(&curved, &junctions, &mut arcs);
        }
        assert_eq!(arcs.len(), 1, "an arc is added once");
        assert!((arcs[0].arc.radius / truth.radius - 1.0).abs() < 0.1);
        assert!((arcs[0].arc.center - truth.center).norm() < 0.1 * truth.radius);
        let off = (0..=10).map(|k| {
            let angle = arcs[0].arc.sweep() * f64::from(k) / 10.0;
            truth.distance_to_circle(&arcs[0].arc.point_at(angle))
        });
        assert!(off.fold(0.0, f64::max) < 2e-4);
    }

    #[test]
    fn one_bow_among_many_edges_is_none() {
        let least = |curved: &[f64], straight: usize| {
            let straight = std::iter::repeat_n(-3.0, straight);
            least_gain(curved.iter().copied().chain(straight))
        };
        assert!(least(&[4.0], 800) > 5.0);
        assert!(least(&[4.0], 10) < 3.0);
        assert!(least(&[2.0, 13.0, 7.0, 4.0, 6.0, 22.0, 3.0, 6.0], 25) < 2.0);
        // No scene makes a curve of what speaks against one.
        assert_eq!(least(&[9.0; 20], 0), 0.0);
    }

    #[test]
    fn straight_edges_and_what_one_view_alone_shows_stay() {
        for curved in [None, Some(3)] {
            let (views, mut wireframe) = scene(|view| Some(view) == curved);
            let mut sources = vec![None; 4];
            let found = take_curved_edges(&views.images(), &mut wireframe, &mut sources);
            assert!(found.is_empty());
            assert_eq!([wireframe.edges.len(), sources.len()], [4, 4]);
        }
    }

    #[test]
    fn variances_become_what_views_differ_by() {
        let (views, wireframe) = scene(|_| true);
        let images = views.images();
        let asked = || -> Vec<Option<AskedEdge>> {
            (wireframe.edges.iter())
                .map(|ends| images.asked_edge(ends.map(|end| wireframe.junctions[end])))
                .collect()
        };
        // Seen heights that differ by 0.3 pixels to both sides.
        let mut edges = asked();
        for views in edges.iter_mut().flatten().map(|edge| &mut edge.views[1]) {
            for (k, view) in views.iter_mut().enumerate() {
                view.height = if k % 2 == 0 { 0.3 } else { -0.3 };
                view.variance = 1.0;
            }
        }
        scale_variances(&mut edges, 1);
        let variances = edges.iter().flatten().flat_map(|edge| &edge.views[1]);
        for view in variances {
            let deviation = view.variance.sqrt() * MEDIAN;
            assert!((0.25..0.4).contains(&deviation), "{deviation}");
        }
        assert!(
            asked()
                .iter()
                .flatten()
                .all(|edge| edge.views[0][0].variance < 0.1)
        );
    }
}
