//! Which faces there are: those that together give the most edges two faces, none of which an
//! image speaks against.
//!
//! The energy is a sum over faces and curves, in nats. A face costs what images say against it
//! ([`super::visibility`]). A curve that lacks a face costs [`MISSING_FACE`], twice if it has none;
//! a curve between two faces of one plane is no crease and costs [`FLAT`]. An inferred line that has
//! no face is none, and costs nothing. A cone costs [`CONE`], an acute angle up to [`ACUTE`], and a
//! part of a sphere wins what its outlines have said for it, [`SHOWN`]. No curve has three faces, no
//! two faces lie on each other, and none but a plane passes through another face. The minimum is found by branch and bound.

use super::curves::{Curve, Curves};
use super::face::{CurveIndex, Face, Step};
use super::groups::groups;
use super::region::Region;
use super::surface::Surface;
use super::walls::inward_of_wall;
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
/// A dome has at least as much (`ADVANTAGE` in `assemble/domes.rs`).
const SHOWN: f64 = 12.0;
/// Two faces under an acute angle cost so much times its cosine: rims alone do not tell a pin with
/// chamfers from a tube with sharp ends or from two frustums, and most things are blunt. Less than
/// a rim without a face.
const ACUTE: f64 = 1.0;
/// Faces against which images speak more than this are out whatever they would close.
pub(super) const MOST_AGAINST: f64 = 3.0;
/// Cosine of the angle of two faces that go on as one plane, lie on each other, or touch at the rim of a
/// dome: 3°.
pub(super) const SAME_PLANE: f64 = 0.9986;
/// Places of a curve at which the angle between two faces is asked.
const PLACES: usize = 7;
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
        let is_inferred = curve.is_inferred();
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

/// Pairs of faces of which one that is no plane passes through the other.
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

/// Into which direction a face goes from a piece of a curve, which starts at this point of it and
/// along which its boundary runs forward.
fn inward(curves: &Curves, face: &Face, curve: &Curve, start: usize) -> Option<Vector3<f64>> {
    if let Surface::Extruded { direction } = face.surface {
        return inward_of_wall(curves, face, curve, &direction);
    }
    let [from, to] = [curve.points[start], curve.points[start + 1]];
    let normal = face.surface.normal_at(&(0.5 * (from + to)));
    Some(normal.cross(&(to - from).normalize()))
}

fn pair(curves: &Curves, faces: [&Face; 2], steps: [&Step; 2]) -> Pair {
    // Both from the same end of the curve: a face to the left of its loop is to the right of the
    // same loop backwards.
    let forward = [0, 1].map(|k| {
        let turned = steps[k].reversed.then(|| faces[k].turned());
        turned.unwrap_or_else(|| faces[k].clone())
    });
    let curve = curves.find(steps[0].curve);
    let cosine = curve.map_or(0.0, |curve| {
        let pieces = curve.points.len() - 1;
        let count = PLACES.min(pieces);
        let cosine = |k: usize| {
            let start = (2 * k + 1) * pieces / (2 * count);
            let [one, other] = [0, 1].map(|k| inward(curves, &forward[k], curve, start));
            one.zip(other).map_or(0.0, |(one, other)| one.dot(&other))
        };
        // Where cylinders of one radius meet they touch at two places: most of the curve counts.
        let mut cosines: Vec<f64> = (0..count).map(cosine).collect();
        cosines.sort_by(f64::total_cmp);
        cosines[count / 2]
    });
    // A plane that touches a cylinder or a cone goes on as another surface: the end of a slot. So does
    // what touches a sphere.
    let is_plane = |face: &Face| matches!(face.surface, Surface::Plane { .. });
    let is_sphere = |face: &Face| matches!(face.surface, Surface::Sphere { .. });
    if matches!(steps[0].curve, CurveIndex::Rim(_)) && cosine > -SAME_PLANE {
        Pair::Excluding
    } else if is_plane(faces[0]) != is_plane(faces[1]) || is_sphere(faces[0]) != is_sphere(faces[1])
    {
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
    /// For each face those that it does not simply meet.
    beside: &'a [Vec<(usize, Pair)>],
    /// In the order in which they are decided on, those first that win most.
    order: Vec<Candidate>,
    taken: BTreeSet<usize>,
    /// Of each curve of the group, whether it is inferred and how many faces it has.
    curves: Vec<(bool, usize)>,
    best: (f64, Vec<usize>),
    states: usize,
}

/// A face that may be chosen.
struct Candidate {
    face: usize,
    /// What it wins by its curves, if none of them has two faces, less its own cost.
    gain: f64,
    /// What of that it wins by what its outlines have said, whatever is beside it.
    shown: f64,
    /// The places of its curves in [`Search::curves`].
    curves: Vec<usize>,
}

impl<'a> Search<'a> {
    fn new(
        faces: &'a [Face],
        against: &[f64],
        beside: &'a [Vec<(usize, Pair)>],
        group: Vec<usize>,
    ) -> Self {
        let steps = group.iter().flat_map(|face| faces[*face].steps());
        let known: BTreeSet<CurveIndex> = steps.map(|step| step.curve).collect();
        let known: Vec<CurveIndex> = known.into_iter().collect();
        let place = |step: &Step| known.binary_search(&step.curve).ok();
        let candidate = |face: usize| {
            let (of_surface, shown) = match faces[face].surface {
                Surface::Cone { .. } => (CONE, 0.0),
                Surface::Sphere { .. } => (0.0, SHOWN),
                _ => (0.0, 0.0),
            };
            let cost = against[face] + of_surface;
            let curves: Vec<usize> = faces[face].steps().filter_map(place).collect();
            Candidate {
                face,
                gain: MISSING_FACE * curves.len() as f64 + shown - cost,
                shown,
                curves,
            }
        };
        let mut order: Vec<Candidate> = (group.into_iter())
            .map(candidate)
            .filter(|candidate| candidate.gain > 0.0)
            .collect();
        order.sort_by(|a, b| b.gain.total_cmp(&a.gain).then(a.face.cmp(&b.face)));
        Self {
            beside,
            order,
            taken: BTreeSet::new(),
            curves: (known.iter())
                .map(|curve| (curve.is_inferred(), 0))
                .collect(),
            best: (0.0, Vec::new()),
            states: 0,
        }
    }

    fn best(mut self) -> Vec<usize> {
        self.descend(0, 0.0);
        self.best.1
    }

    /// Decides on the faces from the `next` one on, after `won`.
    fn descend(&mut self, next: usize, won: f64) {
        if won > self.best.0 {
            self.best = (won, self.taken.iter().copied().collect());
        }
        self.states += 1;
        if next == self.order.len() || self.states > MOST_STATES {
            return;
        }
        if won + self.most_of_rest(next) <= self.best.0 {
            return;
        }
        let Candidate { face, gain, .. } = self.order[next];
        if let Some(cost) = self.cost_beside_taken(&self.order[next]) {
            let cost = cost + self.cost_of_first(&self.order[next]);
            self.taken.insert(face);
            self.add(next, 1);
            self.descend(next + 1, won + gain - cost);
            self.add(next, -1);
            self.taken.remove(&face);
        }
        self.descend(next + 1, won);
    }

    fn add(&mut self, candidate: usize, by: isize) {
        for curve in &self.order[candidate].curves {
            let (_, count) = &mut self.curves[*curve];
            *count = count.saturating_add_signed(by);
        }
    }

    /// What the faces from the `next` one on win at most: each curve by the faces that it lacks,
    /// of those that can be taken still the ones that cost least.
    fn most_of_rest(&self, next: usize) -> f64 {
        let mut won_by = vec![[0.0_f64; 2]; self.curves.len()];
        let mut shown = 0.0;
        for candidate in &self.order[next..] {
            let Some(cost) = self.cost_beside_taken(candidate) else {
                continue;
            };
            shown += candidate.shown;
            let won = (candidate.gain - candidate.shown - cost) / candidate.curves.len() as f64;
            for curve in &candidate.curves {
                let [first, second] = &mut won_by[*curve];
                *second = second.max(won.min(*first));
                *first = first.max(won);
            }
        }
        let of_curve =
            |((is_inferred, count), [first, second]): (&(bool, usize), &[f64; 2])| match count {
                // An inferred line wins nothing before it has both.
                0 if *is_inferred => 0.0,
                0 => first + second,
                1 => *first,
                _ => 0.0,
            };
        shown + self.curves.iter().zip(&won_by).map(of_curve).sum::<f64>()
    }

    /// What the faces that are taken make a further one cost; `None` if they exclude it.
    fn cost_beside_taken(&self, candidate: &Candidate) -> Option<f64> {
        let is_full = |curve: &usize| self.curves[*curve].1 > 1;
        if candidate.curves.iter().any(is_full) {
            return None;
        }
        let beside =
            (self.beside[candidate.face].iter()).filter(|(other, _)| self.taken.contains(other));
        beside.map(|(_, pair)| pair.cost()).sum()
    }

    /// A curve is inferred for the first face, which wins nothing by it and lacks the other.
    fn cost_of_first(&self, candidate: &Candidate) -> f64 {
        let is_first = |curve: &&usize| self.curves[**curve] == (true, 0);
        2.0 * MISSING_FACE * candidate.curves.iter().filter(is_first).count() as f64
    }
}
