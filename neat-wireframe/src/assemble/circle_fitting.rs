//! Circular arcs: followed from a chord along the edgels of all views, as far as these go.
//!
//! An arc is asked sector by sector, as a line is asked whole: a view shows the front of a rim
//! and hides its back. It grows by sectors that speak for it, at most to three times its length in
//! a round, and is fitted to the edgels beside them, until it grows no more.

use super::claimed_edgels::{CLAIM_DENSITY, take_beside};
use super::curve_samples::{SPACING, distance_of_curve};
use super::edge_samples::{Images, Sample};
use super::line_evidence::{LineEvidence, Showing};
use super::line_extent::{best_stretch, gain_of_sample};
use super::line_fitting::change_by_edgels;
use crate::statistics::upper_median;
use nalgebra::{Matrix4, SVector, Unit, UnitQuaternion, Vector3};
use neat_core::CircularArc;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Length of a sector in pixels: the shortest that a line would be asked with …
pub(super) const SECTOR_IN_PIXELS: f64 = 12.0;
/// … but so many make a circle: lines across a smaller part tell of its bend.
const MIN_SECTORS_OF_CIRCLE: f64 = 8.0;
/// … and not more than so many, of which most are out of sight.
const MAX_SECTORS_OF_CIRCLE: f64 = 1e6;
/// An arc has so many at most.
const MAX_SECTORS: f64 = 400.0;
/// Rounds of growth: a sector is a circle of 240 after five, which leaves some to settle.
const MAX_ROUNDS: usize = 12;
/// Reaches of the fits of a round.
pub(super) const FITTING_REACHES: [f64; 2] = [1.5, 1.0];
/// Fewer edgels determine no circle.
const MIN_EDGELS: usize = 20;
/// What keeps a parameter where no edgel tells of it.
const RIDGE: f64 = 1e-6;
/// A fit changes the radius by this factor at most: farther its rows do not hold.
const MAX_CHANGE: f64 = 2.0;
/// Pixels between places of which the ends are one.
const END_STEP: f64 = 2.0;

/// An arc that the images show.
#[derive(Clone, Debug)]
pub(super) struct FoundArc {
    pub arc: CircularArc,
    /// The sum over its sectors, in nats.
    pub gain: f64,
    /// The size of a pixel.
    pub pixel: f64,
    /// Its sectors, one after the other.
    pub sectors: Vec<Sector>,
    /// The covariance of its centre and radius, where profiles tell.
    pub covariance: Option<Matrix4<f64>>,
}

/// How the distance of an edgel from an arc changes with the circle's centre, its radius and its
/// turn around both axes (times the radius); and what takes the distance away.
type Row = (SVector<f64, 6>, f64);

/// A part of an arc, and what the images say about it.
#[derive(Clone, Debug)]
pub(super) struct Sector {
    pub angles: [f64; 2],
    pub evidence: LineEvidence,
}

/// How a distance changes with a circle's centre, its radius and its turn around both axes (times
/// a scale), where it changes so `by_point` at an angle of the circle. `arm` leads from the centre
/// to that point, by the scale.
pub(super) fn by_circle(
    circle: &CircularArc,
    angle: f64,
    arm: &Vector3<f64>,
    by_point: &Vector3<f64>,
) -> SVector<f64, 6> {
    let [x, y] = circle.axes.map(|axis| axis.cross(arm).dot(by_point));
    let by_radius = by_point.dot(&circle.toward(angle));
    SVector::from([by_point.x, by_point.y, by_point.z, by_radius, x, y])
}

/// The circle after a change of these parameters.
pub(super) fn changed(circle: &CircularArc, change: &[f64], scale: f64) -> CircularArc {
    let turn = change[4] * circle.axes[0] + change[5] * circle.axes[1];
    let turn = UnitQuaternion::from_scaled_axis(turn / scale);
    CircularArc {
        center: circle.center + Vector3::new(change[0], change[1], change[2]),
        radius: circle.radius + change[3],
        axes: circle.axes.map(|axis| *Unit::new_normalize(turn * axis)),
        ..*circle
    }
}

/// How many sectors of equal length a curve of this length has.
pub(super) fn sectors_along(length: f64, pixel: f64) -> f64 {
    (length / (SECTOR_IN_PIXELS * pixel))
        .ceil()
        .clamp(1.0, MAX_SECTORS)
}

/// The parts of equal length, about that of a sector, of a curve of this length between two
/// parameters.
pub(super) fn equal_parts([low, high]: [f64; 2], length: f64, pixel: f64) -> Vec<[f64; 2]> {
    let count = sectors_along(length, pixel);
    let width = (high - low) / count;
    let part = |k: usize| {
        let start = low + k as f64 * width;
        [start, start + width]
    };
    (0..count as usize).map(part).collect()
}

fn angles_of(sectors: &[Sector]) -> [f64; 2] {
    [sectors[0].angles[0], sectors[sectors.len() - 1].angles[1]]
}

impl Images<'_> {
    /// The arc that the images show around a part of it; `None` if they show none.
    pub(super) fn follow_arc(&self, start: &CircularArc, views: &[usize]) -> Option<FoundArc> {
        let mut arc = *start;
        for reaches in FITTING_REACHES {
            arc = self.fit_circle(&arc, &[(arc.angles, views.to_vec())], reaches * self.reach)?;
        }
        let mut sectors = Vec::new();
        for _ in 0..MAX_ROUNDS {
            let before = arc.sweep();
            let pixel = self.pixel_of_arc(&arc, views.iter().copied());
            sectors = self.speaking_sectors(&arc, pixel, 1.0, None)?;
            arc.angles = angles_of(&sectors);
            let parts: Vec<([f64; 2], Vec<usize>)> = (sectors.iter())
                .map(|sector| (sector.angles, sector.evidence.views().collect()))
                .collect();
            for reaches in FITTING_REACHES {
                arc = self.fit_circle(&arc, &parts, reaches * self.reach)?;
            }
            if arc.sweep() <= before {
                break;
            }
        }
        let pixel = self.pixel_of_arc(&arc, sectors.iter().flat_map(|s| s.evidence.views()));
        Some(FoundArc {
            arc,
            gain: sectors.iter().map(|sector| sector.evidence.gain).sum(),
            pixel,
            sectors,
            covariance: None,
        })
    }

    /// The part of an arc that the images show by edgels that are not `taken`.
    pub(super) fn settle_arc(&self, found: &FoundArc, taken: &[Vec<bool>]) -> Option<FoundArc> {
        let sectors = self.speaking_sectors(&found.arc, found.pixel, 0.0, Some(taken))?;
        let mut arc = CircularArc {
            angles: angles_of(&sectors),
            ..found.arc
        };
        arc.angles = self.ends_of_arc(&arc, &sectors, found.pixel)?;
        Some(FoundArc {
            arc,
            gain: sectors.iter().map(|sector| sector.evidence.gain).sum(),
            pixel: found.pixel,
            sectors,
            covariance: None,
        })
    }

    /// Takes the edgels beside an arc, in all views.
    pub(super) fn claim_arc(&self, found: &FoundArc, taken: &mut [Vec<bool>]) {
        self.claim_arc_of(found.pixel, |_| Some(found.arc), taken);
    }

    /// Likewise, beside what is the arc `in_view` in each view, where a pixel is `pixel` long.
    pub(super) fn claim_arc_of(
        &self,
        pixel: f64,
        in_view: impl Fn(usize) -> Option<CircularArc> + Sync,
        taken: &mut [Vec<bool>],
    ) {
        taken.par_iter_mut().enumerate().for_each(|(view, taken)| {
            if let Some(arc) = in_view(view) {
                let parts = equal_parts(arc.angles, arc.length(), pixel);
                self.claim_in_view(view, &parts, |angle| Some(arc.point_at(angle)), taken);
            }
        });
    }

    /// Takes the edgels beside parts of a curve, in all views.
    pub(super) fn claim_curve(
        &self,
        parts: &[[f64; 2]],
        at: impl Fn(f64) -> Option<Vector3<f64>> + Sync,
        taken: &mut [Vec<bool>],
    ) {
        let views = taken.par_iter_mut().enumerate();
        views.for_each(|(view, taken)| self.claim_in_view(view, parts, &at, taken));
    }

    fn claim_in_view(
        &self,
        view: usize,
        parts: &[[f64; 2]],
        at: impl Fn(f64) -> Option<Vector3<f64>>,
        taken: &mut [bool],
    ) {
        for part in parts {
            let samples = self.samples_of_curve(view, *part, CLAIM_DENSITY.recip(), &at);
            let samples = samples.unwrap_or_default();
            take_beside(&self.maps[view], &samples, self.reach, taken);
        }
    }

    fn pixel_of_arc(&self, arc: &CircularArc, views: impl Iterator<Item = usize>) -> f64 {
        let middle = arc.point_at(0.5 * (arc.angles[0] + arc.angles[1]));
        let sizes = views.map(|view| self.views[view].pixel_size_at(&middle));
        upper_median(&mut sizes.collect::<Vec<f64>>())
    }

    /// The run of sectors, of an arc and so much of it `beyond` each of its ends, that the images
    /// speak for most.
    pub(super) fn speaking_sectors(
        &self,
        arc: &CircularArc,
        pixel: f64,
        beyond: f64,
        taken: Option<&[Vec<bool>]>,
    ) -> Option<Vec<Sector>> {
        let of_circle = (TAU * arc.radius / (SECTOR_IN_PIXELS * pixel))
            .clamp(MIN_SECTORS_OF_CIRCLE, MAX_SECTORS_OF_CIRCLE)
            .floor();
        let width = TAU / of_circle;
        let inner = (arc.sweep() / width)
            .round()
            .clamp(1.0, of_circle.min(MAX_SECTORS));
        let beyond = (beyond * inner).min((0.5 * (of_circle - inner)).ceil());
        let count = (inner + 2.0 * beyond).min(of_circle) as usize;
        let first = 0.5 * (arc.angles[0] + arc.angles[1]) - 0.5 * count as f64 * width;
        let mut sectors: Vec<Sector> = (0..count)
            .into_par_iter()
            .map(|k| {
                let low = first + k as f64 * width;
                let angles = [low, low + width];
                Sector {
                    angles,
                    evidence: self.evidence_of_sector(arc, angles, taken),
                }
            })
            .collect();
        if count == of_circle as usize {
            // The ring is cut where least speaks for it.
            let weakest = (0..count)
                .min_by(|a, b| {
                    let gain = |k: &usize| sectors[*k].evidence.gain;
                    gain(a).total_cmp(&gain(b))
                })
                .unwrap_or(0);
            if sectors[weakest].evidence.gain <= 0.0 {
                sectors.rotate_left(weakest);
                for sector in &mut sectors[count - weakest..] {
                    sector.angles = sector.angles.map(|angle| angle + TAU);
                }
            }
        }
        let gains: Vec<f64> = sectors.iter().map(|sector| sector.evidence.gain).collect();
        let [start, end] = best_stretch(&gains);
        sectors.truncate(end);
        sectors.drain(..start);
        (!sectors.is_empty()).then_some(sectors)
    }

    /// From where to where the views that show the sectors of an arc speak for it, within a sector
    /// of its ends; `None` if they do so at no place.
    fn ends_of_arc(&self, arc: &CircularArc, sectors: &[Sector], pixel: f64) -> Option<[f64; 2]> {
        let width = sectors[0].angles[1] - sectors[0].angles[0];
        if arc.sweep() + 2.0 * width >= TAU {
            return Some(arc.angles);
        }
        let per_sector = (width * arc.radius / (END_STEP * pixel)).ceil().max(2.0);
        let step = width / per_sector;
        let first = arc.angles[0] - width;
        let count = (sectors.len() + 2) * per_sector as usize;
        let gains: Vec<f64> = (0..count)
            .into_par_iter()
            .map(|k| {
                let angle = first + step * (k as f64 + 0.5);
                let sector = (k / per_sector as usize).clamp(1, sectors.len()) - 1;
                self.gain_of_place(arc, angle, step, &sectors[sector].evidence.showing)
            })
            .collect();
        let [start, end] = best_stretch(&gains);
        (start < end).then(|| [start, end].map(|k| first + step * k as f64))
    }

    /// What the views that show an arc say about one place of it.
    fn gain_of_place(&self, arc: &CircularArc, angle: f64, step: f64, showing: &[Showing]) -> f64 {
        let gain = |Showing { view, chance }: &Showing| {
            let sample = self.sample_of_curve(*view, angle, step, |a| Some(arc.point_at(a)))?;
            let is_there = self.edgel(*view, &sample, self.reach).is_some();
            Some(gain_of_sample(is_there, *chance))
        };
        showing.iter().filter_map(gain).sum()
    }

    /// What the images say about a part of a curve near an arc, which is `at` a place for each
    /// view and angle.
    pub(super) fn evidence_of_curve(
        &self,
        arc: &CircularArc,
        angles: [f64; 2],
        at: impl Fn(usize, f64) -> Option<Vector3<f64>> + Sync,
        taken: Option<&[Vec<bool>]>,
    ) -> LineEvidence {
        let middle = arc.point_at(0.5 * (angles[0] + angles[1]));
        let in_view = |view| self.samples_of_curve(view, angles, SPACING, |angle| at(view, angle));
        self.evidence_of_samples(&middle, in_view, taken, f64::NEG_INFINITY, 1)
    }

    pub(super) fn evidence_of_sector(
        &self,
        arc: &CircularArc,
        angles: [f64; 2],
        taken: Option<&[Vec<bool>]>,
    ) -> LineEvidence {
        self.evidence_of_curve(arc, angles, |_, angle| Some(arc.point_at(angle)), taken)
    }

    /// What the images say about a part of an arc, sector by sector; edgels that are `taken` do
    /// not count.
    pub(super) fn gain_along(
        &self,
        arc: &CircularArc,
        angles: [f64; 2],
        pixel: f64,
        taken: Option<&[Vec<bool>]>,
    ) -> f64 {
        let length = (angles[1] - angles[0]) * arc.radius;
        let sectors = equal_parts(angles, length, pixel).into_iter();
        sectors
            .map(|sector| self.evidence_of_sector(arc, sector, taken).gain)
            .sum()
    }

    /// Samples of a part of an arc in a view; `None` where it does not see enough of it.
    pub(super) fn samples_of_sector(
        &self,
        view: usize,
        arc: &CircularArc,
        angles: [f64; 2],
        spacing: f64,
    ) -> Option<Vec<Sample>> {
        self.samples_of_curve(view, angles, spacing, |angle| Some(arc.point_at(angle)))
    }

    /// The circle through the edgels within `reach` pixels beside parts of an arc in some views.
    pub(super) fn fit_circle(
        &self,
        arc: &CircularArc,
        parts: &[([f64; 2], Vec<usize>)],
        reach: f64,
    ) -> Option<CircularArc> {
        let rows: Vec<Row> = (parts.par_iter())
            .flat_map_iter(|(angles, views)| {
                (views.iter()).flat_map(|view| {
                    let samples = self.samples_of_sector(*view, arc, *angles, SPACING);
                    self.rows_of_samples(arc, *view, &samples.unwrap_or_default(), reach)
                })
            })
            .collect();
        let pixel = self.pixel_of_arc(arc, parts.iter().flat_map(|(_, views)| views.clone()));
        let change = change_by_edgels(&rows, MIN_EDGELS, reach, RIDGE, pixel)?.solution;
        let mut fitted = changed(arc, change.as_slice(), arc.radius);
        fitted.radius = (fitted.radius).clamp(arc.radius / MAX_CHANGE, arc.radius * MAX_CHANGE);
        Some(fitted)
    }

    /// What the edgels beside samples of an arc in a view say.
    pub(super) fn rows_of_samples(
        &self,
        arc: &CircularArc,
        view: usize,
        samples: &[Sample],
        reach: f64,
    ) -> Vec<Row> {
        let camera = &self.views[view].camera;
        let row = |sample: &Sample| {
            let edgel = self.edgel(view, sample, reach)?;
            let position = self.maps[view].get(edgel).position.cast();
            let (point, tangent) = (arc.point_at(sample.place), arc.tangent_at(sample.place));
            let (distance, by_point) =
                distance_of_curve(camera, &point, &(arc.radius * tangent), &position)?;
            let arm = arc.toward(sample.place);
            Some((by_circle(arc, sample.place, &arm, &by_point), -distance))
        };
        samples.iter().filter_map(row).collect()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::assemble::test_views::TestViews;
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{cameras_on_sphere, views_of_edges};
    use neat_core::Camera;

    /// Views that show another arc each.
    pub(crate) fn views_of_arcs(count: usize, arc: impl Fn(&Camera) -> CircularArc) -> TestViews {
        let view = |camera: &Camera| {
            let points = arc(camera).points(TAU / 120.0);
            let edges: Vec<[usize; 2]> = (1..points.len()).map(|k| [k - 1, k]).collect();
            let seen = views_of_edges(&[*camera], &points, &edges);
            PreparedView::new(&seen[0], 1.0, 0.0)
        };
        TestViews::of(cameras_on_sphere(count).iter().map(view).collect())
    }

    /// An arc of which nothing else is known.
    pub(crate) fn found(arc: CircularArc) -> FoundArc {
        FoundArc {
            arc,
            gain: 100.0,
            pixel: 0.003,
            sectors: Vec::new(),
            covariance: None,
        }
    }

    pub(crate) fn arc(sweep: f64) -> CircularArc {
        CircularArc {
            center: Vector3::new(0.05, -0.1, 0.1),
            axes: [Vector3::new(0.6, 0.8, 0.0), Vector3::z()],
            radius: 0.3,
            angles: [0.0, sweep],
        }
    }

    #[test]
    fn a_part_of_an_arc_grows_to_all_of_it() {
        for sweep in [1.5, 4.0, TAU] {
            let truth = arc(sweep);
            let views = views_of_arcs(20, |_| truth);
            let images = views.images();
            // A part of it, a pixel beside it.
            let start = CircularArc {
                center: truth.center + Vector3::new(0.001, 0.002, -0.001),
                radius: 0.27,
                angles: [0.5, 0.9],
                ..truth
            };
            let moved = truth.point_at(0.7) - start.point_at(0.7);
            let start = start.map(|point| point + moved);
            let all: Vec<usize> = (0..20).collect();
            let found = images.follow_arc(&start, &all).unwrap();
            let settled = images.settle_arc(&found, &images.nothing_taken()).unwrap();
            assert!((settled.arc.center - truth.center).norm() < 1e-3);
            assert!((settled.arc.radius - truth.radius).abs() < 1e-3);
            assert!(
                (settled.arc.sweep() - sweep).abs() < 0.06,
                "{}",
                settled.arc.sweep()
            );
            if sweep < TAU {
                for [end, true_end] in [[0, 0], [1, 1]] {
                    let end = settled.arc.point_at(settled.arc.angles[end]);
                    let true_end = truth.point_at(truth.angles[true_end]);
                    assert!((end - true_end).norm() < 0.02);
                }
            }
            // Nothing is left of it for another one.
            let mut taken = images.nothing_taken();
            images.claim_arc(&settled, &mut taken);
            let left = images.settle_arc(&found, &taken);
            assert!(left.is_none_or(|left| left.gain < 0.05 * settled.gain));
        }
    }
}
