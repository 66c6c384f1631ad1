//! Which faces there are: those that together give the most edges two faces, none of which an
//! image speaks against.
//!
//! The energy is a sum over faces and curves, in nats. A face costs what images say against it
//! ([`super::visibility`]). A curve that lacks a face costs [`MISSING_FACE`], twice if it has none;
//! a curve between two faces of one plane is no crease and costs [`FLAT`]. An inferred line that has
//! no face is none, and costs nothing. A cone costs [`CONE`], an acute angle up to [`ACUTE`]. No
//! curve has three faces, no two faces lie on each other, and no cylinder or cone passes through
//! another face. The minimum is found by branch and bound.

use super::curves::Curves;
use super::face::{CurveIndex, Face, Step};
use super::groups::groups;
use super::region::Region;
use super::surface::Surface;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

/// Edges of a solid have two faces: that one lacks one is as likely as that a line of the
/// wireframe is paint, 1 in 20.
pub(super) const MISSING_FACE: f64 = 3.0;
/// More than a face can win by one curve: a circle on a face is a hole before it is a lid.
const FLAT: f64 = 2.0 * MISSING_FACE;
/// Coaxial rims of different radii stand on two sides of a step more often than they bound a cone.
/// Less than a rim without a face: it decides where both would do.
const CONE: f64 = 1.0;
/// Two faces under an acute angle cost so much times its cosine: rims alone do not tell a pin with
/// chamfers from a tube with sharp ends or from two frustums, and most things are blunt. Less than
/// a rim without a face.
const ACUTE: f64 = 1.0;
/// Faces against which images speak more than this are out whatever they would close.
pub(super) const MOST_AGAINST: f64 = 3.0;
/// Cosine of the angle of two faces that go on as one plane, or lie on each other: 3°.
pub(super) const SAME_PLANE: f64 = 0.9986;
/// States that are looked at for one set of faces that exclude each other. What was best by then
/// is taken.
const MOST_STATES: usize = 20_000;

/// How two faces lie to each other: at one curve, or one through the other.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Pair {
    /// With the cosine of the angle between them.
    Crease(f64),
    Flat,
    Excluding,
}

impl Pair {
    /// `None` if there cannot be both.
    fn cost(&self) -> Option<f64> {
        match self {
            Self::Crease(cosine) => Some(ACUTE * cosine.max(0.0)),
            Self::Flat => Some(FLAT),
            Self::Excluding => None,
        }
    }
}

/// The places of the chosen faces, ascending; `against` is what images say against each.
pub(super) fn select(
    curves: &Curves,
    faces: &[Face],
    regions: &[Option<Region>],
    against: &[f64],
) -> Vec<usize> {
    let possible: Vec<usize> = (0..faces.len())
        .filter(|face| against[*face] <= MOST_AGAINST)
        .collect();
    let mut at_curve: BTreeMap<CurveIndex, Vec<(usize, Step)>> = BTreeMap::new();
    for face in &possible {
        for step in faces[*face].steps() {
            at_curve.entry(step.curve).or_default().push((*face, *step));
        }
    }
    let mut beside: Vec<Vec<(usize, Pair)>> = vec![Vec::new(); faces.len()];
    let mut contended: Vec<Vec<usize>> = possible.iter().map(|face| vec![*face]).collect();
    for (curve, at) in &at_curve {
        let is_inferred = matches!(curve, CurveIndex::Smooth(_));
        for (k, (one, step)) in at.iter().enumerate() {
            for (other, other_step) in &at[k + 1..] {
                let pair = pair(curves, [&faces[*one], &faces[*other]], [step, other_step]);
                if pair.cost() != Some(0.0) {
                    beside[*one].push((*other, pair));
                    beside[*other].push((*one, pair));
                }
                if at.len() > 2 || !matches!(pair, Pair::Crease(_)) || is_inferred {
                    contended.push(vec![*one, *other]);
                }
            }
        }
    }
    for [one, other] in crossing(regions, &possible) {
        beside[one].push((other, Pair::Excluding));
        beside[other].push((one, Pair::Excluding));
        contended.push(vec![one, other]);
    }
    let mut chosen: Vec<usize> = (groups(&contended).into_iter())
        .flat_map(|group| Search::new(faces, against, &beside, group).best())
        .collect();
    chosen.sort_unstable();
    chosen
}

/// Pairs of faces of which a round one passes through the other.
fn crossing(regions: &[Option<Region>], possible: &[usize]) -> Vec<[usize; 2]> {
    let known: Vec<(usize, &Region)> = (possible.iter())
        .filter_map(|face| Some((*face, regions[*face].as_ref()?)))
        .collect();
    let of_face = |(one, region): &(usize, &Region)| -> Vec<[usize; 2]> {
        let others = known.iter().filter(|(other, _)| other != one);
        let crossed = others.filter(|(_, other)| region.passes_through(other));
        crossed.map(|(other, _)| [*one, *other]).collect()
    };
    known.par_iter().flat_map_iter(of_face).collect()
}

/// Into which direction a face goes from the start of a curve of its boundary.
fn inward(curves: &Curves, face: &Face, step: &Step) -> Option<Vector3<f64>> {
    let points = curves.find(step.curve)?.points_along(step);
    let along = (points[1] - points[0]).normalize();
    let normal = face.surface.normal_at(&(0.5 * (points[0] + points[1])));
    Some(normal.cross(&along))
}

fn pair(curves: &Curves, faces: [&Face; 2], steps: [&Step; 2]) -> Pair {
    let [one, other] = [0, 1].map(|k| {
        // Both from the same end of the curve: a face to the left of its loop is to the
        // right of the same loop backwards.
        let forward = if steps[k].reversed {
            faces[k].turned()
        } else {
            faces[k].clone()
        };
        let step = Step {
            curve: steps[k].curve,
            reversed: false,
        };
        inward(curves, &forward, &step)
    });
    let cosine = one.zip(other).map_or(0.0, |(one, other)| one.dot(&other));
    // A plane that touches a cylinder or a cone goes on as another surface: the end of a slot.
    let is_plane = |face: &Face| matches!(face.surface, Surface::Plane { .. });
    if is_plane(faces[0]) != is_plane(faces[1]) {
        Pair::Crease(cosine)
    } else if cosine > SAME_PLANE {
        Pair::Excluding
    } else if cosine < -SAME_PLANE {
        Pair::Flat
    } else {
        Pair::Crease(cosine)
    }
}

/// Branch and bound over the faces of one group.
struct Search<'a> {
    faces: &'a [Face],
    /// For each face those that it does not simply meet.
    beside: &'a [Vec<(usize, Pair)>],
    /// In the order in which they are decided on, each with what it wins at most.
    order: Vec<(f64, usize)>,
    taken: BTreeSet<usize>,
    count: BTreeMap<CurveIndex, usize>,
    best: (f64, Vec<usize>),
    states: usize,
}

impl<'a> Search<'a> {
    fn new(
        faces: &'a [Face],
        against: &[f64],
        beside: &'a [Vec<(usize, Pair)>],
        group: Vec<usize>,
    ) -> Self {
        let gain = |face: usize| {
            let is_cone = matches!(faces[face].surface, Surface::Cone { .. });
            let cost = against[face] + if is_cone { CONE } else { 0.0 };
            MISSING_FACE * faces[face].steps().count() as f64 - cost
        };
        let gains = group.into_iter().map(|face| (gain(face), face));
        let mut order: Vec<(f64, usize)> = gains.filter(|(gain, _)| *gain > 0.0).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        Self {
            faces,
            beside,
            order,
            taken: BTreeSet::new(),
            count: BTreeMap::new(),
            best: (0.0, Vec::new()),
            states: 0,
        }
    }

    fn best(mut self) -> Vec<usize> {
        let left = self.order.iter().map(|(gain, _)| gain).sum();
        self.descend(0, 0.0, left);
        self.best.1
    }

    /// Decides on the faces from the `next` one on, which win `left` at most, after `won`.
    fn descend(&mut self, next: usize, won: f64, left: f64) {
        if won > self.best.0 {
            self.best = (won, self.taken.iter().copied().collect());
        }
        self.states += 1;
        if next == self.order.len() || won + left <= self.best.0 || self.states > MOST_STATES {
            return;
        }
        let (gain, face) = self.order[next];
        if let Some(cost) = self.cost_beside_taken(face) {
            self.taken.insert(face);
            self.add(face, 1);
            self.descend(next + 1, won + gain - cost, left - gain);
            self.add(face, -1);
            self.taken.remove(&face);
        }
        self.descend(next + 1, won, left - gain);
    }

    fn add(&mut self, face: usize, by: isize) {
        for step in self.faces[face].steps() {
            let count = self.count.entry(step.curve).or_default();
            *count = count.saturating_add_signed(by);
        }
    }

    /// What the faces that are taken make a further one cost; `None` if they exclude it.
    fn cost_beside_taken(&self, face: usize) -> Option<f64> {
        let full = |step: &Step| self.count.get(&step.curve).is_some_and(|count| *count > 1);
        if self.faces[face].steps().any(full) {
            return None;
        }
        let beside = self.beside[face]
            .iter()
            .filter(|(other, _)| self.taken.contains(other));
        let cost: Option<f64> = beside.map(|(_, pair)| pair.cost()).sum();
        // A line is inferred for the first face, which wins nothing by it and lacks the other.
        let is_first = |step: &&Step| {
            matches!(step.curve, CurveIndex::Smooth(_))
                && self.count.get(&step.curve).is_none_or(|count| *count == 0)
        };
        let inferred = self.faces[face].steps().filter(is_first).count();
        cost.map(|cost| cost + 2.0 * MISSING_FACE * inferred as f64)
    }
}
