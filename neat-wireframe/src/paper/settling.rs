//! Junctions that settle where the images have the ends that they attract. Not in the paper.
//!
//! Each end of each 2D segment has a place in space, which the field renders, and a place in
//! its image, where it was detected. The place in space says which junction it goes to: the
//! nearest one, as in the paper, of those that are seen near the detected end. The places in
//! the images then say where the junction is. No end is matched to another.

use super::corner_evidence::corner_evidence;
use super::junction_merging::{AttractingJunction, END_SCALE, EndScatter, fitted, merged};
use super::rendered_lines::{RenderedEnd, RenderedLine};
use crate::ViewObservation;
use crate::observation::end_key;
use crate::point_index::PointIndex;
use crate::projection::project_in_front;
use crate::statistics::upper_median;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

// Guesses, of which none but the reach in space was varied: with 8, 12 and 16 px
// of it, where ends go 6 px in the image, F1 at 5 cm of house_1 was .588, .644 and .648 in an
// early trial.

/// Depth is what a field knows least: an end may lie so much farther from its junction in
/// space than in the image.
const REACH_IN_SPACE: f64 = 2.0;
/// Moved junctions attract others.
const ROUNDS: usize = 2;
/// An end that lies nearer to its junction is explained by it: pixels, four times the scale of
/// ends.
const EXPLAINED: f64 = 4.0 * END_SCALE;
/// Steps towards the middle of the ends around.
const SHIFTS: usize = 5;
/// One view tells no depth.
const MIN_VIEWS: usize = 2;

/// A junction with what its ends say about it.
#[derive(Clone, Debug)]
pub(super) struct SettledJunction {
    pub(super) place: Vector3<f64>,
    /// Length of a pixel there, in world units: the median over its ends.
    pub(super) pixel: f64,
    /// Views with an end that it explains.
    pub(super) views: BTreeSet<usize>,
    /// What speaks for a corner there, in nats.
    pub(super) corner_evidence: f64,
}

/// The ends of all lines, which junctions attract.
pub(super) struct Ends<'a> {
    ends: Vec<RenderedEnd>,
    views: &'a [ViewObservation],
    /// No end goes farther in its image: pixels.
    reach: f64,
}

/// Where an end goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attracted {
    pub(super) junction: usize,
    /// From the detected end: pixels.
    distance: f64,
}

impl<'a> Ends<'a> {
    pub(super) fn new(lines: &[RenderedLine], views: &'a [ViewObservation], reach: f64) -> Self {
        let ends = lines.iter().flat_map(RenderedLine::ends).collect();
        Self { ends, views, reach }
    }

    /// Where each end goes: start and end of the first line, of the second, and so on.
    pub(super) fn attracted(&self, places: &[Vector3<f64>]) -> Vec<Option<Attracted>> {
        let index = index(places);
        let attracted = |end: &RenderedEnd| {
            let camera = &self.views[end.view].camera;
            let near = index.within(&end.place, REACH_IN_SPACE * self.reach * end.pixel);
            near.into_iter().find_map(|junction| {
                let pixel = project_in_front(camera, &places[junction])?;
                let distance = (pixel - end.detected).norm();
                (distance < self.reach).then_some(Attracted { junction, distance })
            })
        };
        self.ends.par_iter().map(attracted).collect()
    }

    /// Moves junctions to the ends that they attract, and makes one of those that are one
    /// corner. Those with ends in less than two views are left out.
    pub(super) fn settle(&self, mut places: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
        let scatter = EndScatter {
            scale: END_SCALE,
            gate: self.reach,
        };
        for _ in 0..ROUNDS {
            let mut attracting = self.attracting(&places, &self.attracted(&places));
            attracting.retain(|junction| views_of(junction).len() >= MIN_VIEWS);
            attracting.par_iter_mut().for_each(|junction| {
                junction.place = fitted(junction.place, &junction.ends, self.views, END_SCALE);
            });
            let merged = merged(attracting, self.views, scatter);
            places = merged.into_iter().map(|(place, _)| place).collect();
        }
        places
    }

    /// Where the field puts ends that no junction explains: the middles of groups of at least
    /// two views, those of most views first.
    pub(super) fn unexplained(&self, places: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let attracted = self.attracted(places);
        let is_free = |attracted: &Option<Attracted>| {
            attracted.is_none_or(|attracted| attracted.distance > EXPLAINED)
        };
        let free: Vec<&RenderedEnd> = (self.ends.iter().zip(&attracted))
            .filter(|(_, attracted)| is_free(attracted))
            .map(|(end, _)| end)
            .collect();
        let places: Vec<Vector3<f64>> = free.iter().map(|end| end.place).collect();
        let around_free = index(&places);
        let middle = |end: &&RenderedEnd| {
            let radius = EXPLAINED * end.pixel;
            let mut middle = end.place;
            for _ in 0..SHIFTS {
                let around = around_free.within(&middle, radius);
                let sum: Vector3<f64> = around.iter().map(|other| places[*other]).sum();
                middle = sum / around.len().max(1) as f64;
            }
            let around = around_free.within(&middle, radius);
            let views: BTreeSet<usize> = around.iter().map(|other| free[*other].view).collect();
            (views.len(), middle, radius)
        };
        let mut middles: Vec<_> = free.par_iter().map(middle).collect();
        middles.retain(|(views, ..)| *views >= MIN_VIEWS);
        middles.sort_by_key(|(views, ..)| std::cmp::Reverse(*views));
        let all: Vec<Vector3<f64>> = middles.iter().map(|(_, middle, _)| *middle).collect();
        let of_middles = index(&all);
        let mut is_taken = vec![false; all.len()];
        let mut proposals = Vec::new();
        for (at, (_, middle, radius)) in middles.iter().enumerate() {
            if !is_taken[at] {
                proposals.push(*middle);
                for other in of_middles.within(middle, *radius) {
                    is_taken[other] = true;
                }
            }
        }
        proposals
    }

    /// What the ends that it has [`attracted`](Self::attracted) say about each junction.
    pub(super) fn settled(
        &self,
        places: &[Vector3<f64>],
        attracted: &[Option<Attracted>],
    ) -> Vec<SettledJunction> {
        let settled = |junction: &AttractingJunction| {
            let distance = |(view, end): (usize, &Vector2<f64>)| {
                let pixel = project_in_front(&self.views[view].camera, &junction.place)?;
                Some((view, (pixel - end).norm()))
            };
            let distances: Vec<(usize, f64)> = (junction.ends.iter())
                .filter_map(|((view, _), end)| distance((*view, end)))
                .collect();
            let explained: BTreeSet<usize> = (distances.iter())
                .filter(|(_, distance)| *distance < EXPLAINED)
                .map(|(view, _)| *view)
                .collect();
            let distances: Vec<f64> = distances.iter().map(|(_, distance)| *distance).collect();
            SettledJunction {
                place: junction.place,
                pixel: junction.pixel,
                views: explained,
                corner_evidence: corner_evidence(&distances, self.reach, END_SCALE),
            }
        };
        let attracting = self.attracting(places, attracted);
        attracting.par_iter().map(settled).collect()
    }

    /// All junctions with the ends that they attract.
    fn attracting(
        &self,
        places: &[Vector3<f64>],
        attracted: &[Option<Attracted>],
    ) -> Vec<AttractingJunction> {
        let mut ends = vec![BTreeMap::new(); places.len()];
        let mut pixels = vec![Vec::new(); places.len()];
        for (end, attracted) in self.ends.iter().zip(attracted) {
            if let Some(Attracted { junction, .. }) = *attracted {
                ends[junction].insert(end_key(end.view, &end.detected), end.detected);
                pixels[junction].push(end.pixel);
            }
        }
        let attracting = |((place, ends), mut pixels): ((&Vector3<f64>, _), Vec<f64>)| {
            let segments = pixels.len();
            let pixel = match segments {
                0 => 0.0,
                _ => upper_median(&mut pixels),
            };
            AttractingJunction {
                place: *place,
                ends,
                segments,
                pixel,
            }
        };
        (places.iter().zip(ends).zip(pixels))
            .map(attracting)
            .collect()
    }
}

/// The views in which a junction attracts an end.
fn views_of(junction: &AttractingJunction) -> BTreeSet<usize> {
    junction.ends.keys().map(|(view, _)| *view).collect()
}

/// There are fewer ends than an index holds points: the field has rendered each.
fn index(places: &[Vector3<f64>]) -> PointIndex {
    PointIndex::new(places).expect("fewer ends than 2³²")
}
