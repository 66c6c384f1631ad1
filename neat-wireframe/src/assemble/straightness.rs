//! Whether what a line stands for is straight: chords of curves are no edges.
//!
//! The edgels of all views are asked for a bow in space over the line. Noise averages out
//! over hundreds of edgels, so a tenth of a pixel tells.

use super::edge_samples::Images;
use super::line_evidence::LineEvidence;
use super::line_fitting::{change_by_edgels, directions_across};
use super::projected_line::ProjectedLine;
use crate::solve::Reweighted;
use nalgebra::{SVector, Vector2};
use neat_core::LineSegment3;

/// Edgels of a bent edge lie farther from its chord than those of a straight one: within so
/// many reaches, and at least so many pixels.
const WIDE_REACH: f64 = 2.5;
const MIN_WIDE_REACH: f64 = 0.8;
/// The part of a line that is asked: beyond, edges run into others that meet them at a small
/// angle.
const INNER: [f64; 2] = [0.1, 0.9];
/// Fewer edgels tell nothing of a bow.
const MIN_OF_BOW: usize = 20;
/// What keeps a direction that no view tells of where it is.
const RIDGE: f64 = 1e-6;
/// A bow of so many standard deviations of an edgel, and of itself, is one …
const BOW_NOISES: f64 = 2.0;
const BOW_ERRORS: f64 = 3.0;
/// … if two halves of the views agree on its direction to this cosine: what lies beside an
/// edge in some views bends it there only.
pub(super) const BOW_AGREEMENT: f64 = 0.8;
/// Edgels of a view are not independent: variances are so many times larger.
pub(super) const CORRELATION: f64 = 4.0;

/// The height of the arc that edgels draw over a line.
#[derive(Clone, Copy)]
pub(super) struct Bow {
    /// In two directions across the line, in pixels of the median view.
    pub height: Vector2<f64>,
    /// Standard deviation of its length.
    pub error: f64,
}

impl Bow {
    fn is_significant(&self, noise: f64) -> bool {
        let height = self.height.norm();
        height > BOW_NOISES * noise && height > BOW_ERRORS * self.error
    }

    fn agrees(&self, other: &Self) -> bool {
        self.height.dot(&other.height) > BOW_AGREEMENT * self.height.norm() * other.height.norm()
    }
}

/// How an edgel's distance from the line changes with the parameters of the bent line, and
/// what takes the distance away.
type Row = (SVector<f64, 6>, f64);
/// The rows of a view.
type RowsOfView = (usize, Vec<Row>);

/// What the edgels beside a line say of a bow over it.
pub(super) struct Bend {
    rows: Vec<RowsOfView>,
    /// That of all views.
    pub bow: Option<Bow>,
}

impl Images<'_> {
    fn wide_reach(&self) -> f64 {
        (WIDE_REACH * self.reach).max(MIN_WIDE_REACH)
    }

    /// What edgels say of a bow over a line, in the views that show it.
    pub(super) fn bend(&self, line: &LineSegment3, evidence: &LineEvidence) -> Bend {
        let rows: Vec<RowsOfView> = (evidence.views())
            .map(|view| (view, self.rows(line, view)))
            .collect();
        let bow = self.bow(line, rows.iter());
        Bend { rows, bow }
    }

    /// Whether edgels beside a line bend away from it in the middle, as those of an arc.
    /// `noise` is the standard deviation of an edgel, in pixels.
    pub(super) fn is_curved(&self, line: &LineSegment3, bend: &Bend, noise: f64) -> bool {
        let half = |skip: usize| {
            let bow = self.bow(line, bend.rows.iter().skip(skip).step_by(2))?;
            bow.is_significant(noise).then_some(bow)
        };
        (bend.bow.as_ref()).is_some_and(|bow| bow.is_significant(noise))
            && Option::zip(half(0), half(1)).is_some_and(|(one, other)| one.agrees(&other))
    }

    /// A row for each edgel beside the inner part of a line in a view.
    fn rows(&self, line: &LineSegment3, view: usize) -> Vec<Row> {
        let camera = &self.views[view].camera;
        let prepared = directions_across(line)
            .zip(ProjectedLine::new(camera, line))
            .zip(self.samples(view, line, INNER, None));
        let Some(((across, projected), samples)) = prepared else {
            return Vec::new();
        };
        (samples.iter())
            .filter_map(|sample| {
                let edgel = self.edgel(view, sample, self.wide_reach())?;
                let position = self.maps[view].get(edgel).position.cast();
                let found = projected.distance_with_gradient(camera, &position);
                let [by_start, by_end] = found.by_points;
                let [x, y] = across.tr_mul(&(by_start + by_end)).into();
                // A shift, a tilt and a bow, each in two directions.
                let along = 2.0 * sample.place - 1.0;
                let bend = 1.0 - along * along;
                let design = [x, y, x * along, y * along, x * bend, y * bend];
                Some((SVector::from(design), -found.distance))
            })
            .collect()
    }

    fn bow<'r>(
        &self,
        line: &LineSegment3,
        rows: impl Iterator<Item = &'r RowsOfView> + Clone,
    ) -> Option<Bow> {
        let pixel = self.pixel_size(line, rows.clone().map(|(view, _)| *view));
        let rows: Vec<Row> = rows.flat_map(|(_, rows)| rows).copied().collect();
        let Reweighted {
            solution,
            covariance,
        } = change_by_edgels(&rows, MIN_OF_BOW, self.wide_reach(), RIDGE, pixel)?;
        let height = solution.fixed_rows::<2>(4) / pixel;
        let direction = height.try_normalize(0.0).unwrap_or(Vector2::x());
        let variance = direction.dot(&(covariance.fixed_view::<2, 2>(4, 4) * direction));
        Some(Bow {
            height,
            error: (CORRELATION * variance).sqrt() / pixel,
        })
    }
}
