//! Smooth surfaces through four curves: bilinearly blended Coons patches.
//!
//! With the four sides as B-splines of one kind, the patch between opposite ones is a tensor product
//! of the same B-splines, whose control points are the Coons patch of those of its sides, at Greville's
//! abscissae: the mean of B-splines with these weights is the place itself. Sides are approximated by
//! B-splines with [`CONTROLS`] control points.

use super::chain::point_along;
use super::face::{Face, Step};
use super::polygon::contains;
use super::quadrature::GAUSS;
use nalgebra::{DMatrix, Vector2, Vector3};
use neat_core::Spline;

/// Control points along each side: a side that turns by half a turn is met to a few ten thousandths
/// of its radius.
const CONTROLS: usize = 12;
const PIECES: usize = CONTROLS - 3;
/// Cells along each side of the grid by which rays are met.
const GRID: usize = 12;
/// Places along each side at which a patch is compared with it.
const ALONG_SIDE: usize = 32;
/// Pieces of a hole are at most this part of it.
const ALONG_HOLE: usize = 16;
/// Steps of Newton's method to the nearest place.
const STEPS: usize = 8;
/// What bending costs a patch that is to hold other points: little, so that it holds them, but enough
/// that what these are off by makes no waves beside them (with a millionth of .02 where points were
/// .002 off).
const STIFFNESS: f64 = 1e-3;
/// Half the step of derivatives by the place.
const HALF_STEP: f64 = 1e-4;

/// A patch, with places from 0 to 1 in both directions: the first side runs along the first direction
/// at 0, the second one along the second direction at 1, and so on around.
pub(crate) struct Patch {
    /// Control points, those of one place in the first direction after the other.
    controls: Vec<Vector3<f64>>,
    /// Any spline with as many control points: what weights they have.
    spline: Spline,
}

impl Patch {
    /// Through four sides, each of which begins where the one before ends; one may be a point.
    pub fn new(sides: [Vec<Vector3<f64>>; 4]) -> Option<Self> {
        let controls = |side: &Vec<Vector3<f64>>| -> Option<Vec<Vector3<f64>>> {
            if side.iter().all(|point| *point == side[0]) {
                return Some(vec![*side.first()?; CONTROLS]);
            }
            let along = |share: f64| point_along(side, share);
            Some(Spline::nearest_to(along, CONTROLS, false)?.controls)
        };
        let [low, right, mut high, mut left] = [
            controls(&sides[0])?,
            controls(&sides[1])?,
            controls(&sides[2])?,
            controls(&sides[3])?,
        ];
        high.reverse();
        left.reverse();
        let last = CONTROLS - 1;
        let share = greville();
        let at = |k: usize| {
            let (i, j) = (k / CONTROLS, k % CONTROLS);
            let (u, v) = (share[i], share[j]);
            let ruled = [
                low[i] * (1.0 - v) + high[i] * v,
                left[j] * (1.0 - u) + right[j] * u,
            ];
            let corners = (low[0] * (1.0 - u) + low[last] * u) * (1.0 - v)
                + (high[0] * (1.0 - u) + high[last] * u) * v;
            ruled[0] + ruled[1] - corners
        };
        Some(Self {
            controls: (0..CONTROLS * CONTROLS).map(at).collect(),
            spline: Spline {
                controls: vec![Vector3::zeros(); CONTROLS],
                closed: false,
            },
        })
    }

    /// How far the patch is off one of its sides.
    fn off_side(&self, side: usize, along: &[Vector3<f64>]) -> f64 {
        if along.len() < 2 {
            return 0.0;
        }
        let off = |share: f64| {
            let place = place_on_side(side, share);
            (self.point(&place) - point_along(along, share)).norm()
        };
        let shares = (0..=ALONG_SIDE).map(|k| k as f64 / ALONG_SIDE as f64);
        shares.map(off).fold(0.0, f64::max)
    }

    /// The same, bent so that it holds other points as well: those of curves that lie on it.
    pub fn through(mut self, points: &[Vector3<f64>]) -> Self {
        let inner = CONTROLS - 2;
        let unknown = |i: usize, j: usize| {
            let within = |k: usize| (1..=inner).contains(&k);
            (within(i) && within(j)).then(|| (i - 1) * inner + j - 1)
        };
        for _ in 0..2 {
            let mut matrix = DMatrix::<f64>::zeros(inner * inner, inner * inner);
            let mut right = DMatrix::<f64>::zeros(inner * inner, 3);
            let mut add = |row: &[(usize, f64)], lacking: Vector3<f64>, weight: f64| {
                for (a, by_a) in row {
                    for (b, by_b) in row {
                        matrix[(*a, *b)] += weight * by_a * by_b;
                    }
                    for k in 0..3 {
                        right[(*a, k)] += weight * by_a * lacking[k];
                    }
                }
            };
            for point in points {
                let place = self.place(point);
                let weights = self.weights(&place);
                let row: Vec<(usize, f64)> = (weights.iter())
                    .filter_map(|((i, j), weight)| Some((unknown(*i, *j)?, *weight)))
                    .collect();
                add(&row, point - self.point(&place), 1.0);
            }
            // Differences of second order of what changes, in both directions.
            for i in 0..CONTROLS {
                for j in 1..CONTROLS - 1 {
                    for turned in [false, true] {
                        let at = |j: usize| if turned { unknown(j, i) } else { unknown(i, j) };
                        let three = [(at(j - 1), 1.0), (at(j), -2.0), (at(j + 1), 1.0)];
                        let row: Vec<(usize, f64)> = (three.into_iter())
                            .filter_map(|(at, weight)| Some((at?, weight)))
                            .collect();
                        add(&row, Vector3::zeros(), STIFFNESS * points.len() as f64);
                    }
                }
            }
            let Some(factor) = matrix.cholesky() else {
                return self;
            };
            let change = factor.solve(&right);
            for i in 1..=inner {
                for j in 1..=inner {
                    if let Some(row) = unknown(i, j) {
                        let by = Vector3::from_fn(|k, _| change[(row, k)]);
                        self.controls[i * CONTROLS + j] += by;
                    }
                }
            }
        }
        self
    }

    /// Control points, a row for each place in the first direction; both ways with uniform knots that
    /// are repeated at the ends.
    pub fn rows(&self) -> Vec<Vec<Vector3<f64>>> {
        self.controls
            .chunks_exact(CONTROLS)
            .map(<[_]>::to_vec)
            .collect()
    }

    /// The control points of which a place is the weighted mean.
    fn weights(&self, place: &Vector2<f64>) -> [((usize, usize), f64); 16] {
        let [first, second] =
            [place.x, place.y].map(|share| self.spline.weights_at(share * PIECES as f64));
        std::array::from_fn(|k| {
            let ((i, u), (j, v)) = (first[k / 4], second[k % 4]);
            ((i, j), u * v)
        })
    }

    pub fn point(&self, place: &Vector2<f64>) -> Vector3<f64> {
        let weighted = self.weights(place).into_iter();
        weighted
            .map(|((i, j), weight)| self.controls[i * CONTROLS + j] * weight)
            .sum()
    }

    /// How the point changes with the place.
    pub fn tangents(&self, place: &Vector2<f64>) -> [Vector3<f64>; 2] {
        [Vector2::x(), Vector2::y()].map(|along: Vector2<f64>| {
            let ends = [-HALF_STEP, HALF_STEP].map(|by| {
                let moved = place + along * by;
                moved.map(|share| share.clamp(0.0, 1.0))
            });
            (self.point(&ends[1]) - self.point(&ends[0])) / (ends[1] - ends[0]).norm()
        })
    }

    /// The place nearest to a point.
    pub fn place(&self, point: &Vector3<f64>) -> Vector2<f64> {
        let off = |place: &Vector2<f64>| (self.point(place) - point).norm_squared();
        let starts = grid_places(GRID);
        let mut place = starts
            .min_by(|a, b| off(a).total_cmp(&off(b)))
            .unwrap_or_default();
        for _ in 0..STEPS {
            let [u, v] = self.tangents(&place);
            let lacking = point - self.point(&place);
            let (uu, uv, vv) = (u.norm_squared(), u.dot(&v), v.norm_squared());
            let (by_u, by_v) = (u.dot(&lacking), v.dot(&lacking));
            let determinant = uu * vv - uv * uv;
            let step = Vector2::new(vv * by_u - uv * by_v, uu * by_v - uv * by_u) / determinant;
            let next = (place + step).map(|share| share.clamp(0.0, 1.0));
            if !next.iter().all(|share| share.is_finite()) || off(&next) >= off(&place) {
                break;
            }
            place = next;
        }
        place
    }

    /// The distance of a point from the nearest place.
    pub fn distance(&self, point: &Vector3<f64>) -> f64 {
        (self.point(&self.place(point)) - point).norm()
    }

    /// The integrals of the area and of the flux of x from a point over what is within loops of
    /// places, which are 1 to the left of it: by Gauss' theorem as integrals around it.
    fn integrals(&self, chain: &[Vector2<f64>], from: &Vector3<f64>) -> [f64; 2] {
        // From the side at 0 to a place, along the first direction.
        let up_to = |place: &Vector2<f64>| {
            let width = place.x / PIECES as f64;
            let mut sums = [0.0, 0.0];
            for piece in 0..PIECES {
                for (share, weight) in GAUSS {
                    let at = Vector2::new((piece as f64 + share) * width, place.y);
                    let [u, v] = self.tangents(&at);
                    let normal = u.cross(&v) * (weight * width);
                    sums[0] += normal.norm();
                    sums[1] += normal.dot(&(self.point(&at) - from));
                }
            }
            sums
        };
        let mut moments = [0.0, 0.0];
        for ends in chain.windows(2).filter(|ends| ends[0].y != ends[1].y) {
            for (share, weight) in GAUSS {
                let sums = up_to(&(ends[0] + (ends[1] - ends[0]) * share));
                for k in 0..2 {
                    moments[k] += sums[k] * weight * (ends[1].y - ends[0].y);
                }
            }
        }
        moments
    }

    /// Area without these holes, and the flux of x from a point through it, along the normal that
    /// has the first side to the right of the second one.
    pub fn moments(&self, holes: &[Vec<Vector2<f64>>], from: &Vector3<f64>) -> [f64; 2] {
        let side = (0..=PIECES).map(|k| Vector2::new(1.0, k as f64 / PIECES as f64));
        let mut moments = self.integrals(&side.collect::<Vec<_>>(), from);
        for hole in holes {
            let of_hole = self.integrals(hole, from);
            (0..2).for_each(|k| moments[k] += of_hole[k]);
        }
        moments
    }

    /// Triangles of a grid, by their places.
    pub fn grid(&self) -> Vec<[(Vector2<f64>, Vector3<f64>); 3]> {
        let corners: Vec<_> = grid_places(GRID)
            .map(|place| (place, self.point(&place)))
            .collect();
        let at = |i: usize, j: usize| corners[i * (GRID + 1) + j];
        let cells = (0..GRID * GRID).map(|k| (k / GRID, k % GRID));
        cells
            .flat_map(|(i, j)| {
                let (low, high) = (at(i, j), at(i + 1, j + 1));
                [[low, at(i + 1, j), high], [low, high, at(i, j + 1)]]
            })
            .collect()
    }

    /// Whether a place is on the patch and in none of the holes.
    pub fn is_within(&self, holes: &[Vec<Vector2<f64>>], place: &Vector2<f64>) -> bool {
        let inside = place.iter().all(|share| (0.0..=1.0).contains(share));
        inside && !holes.iter().any(|hole| contains(hole, place))
    }
}

/// A face that is a patch, with the places of its holes, each ending where it begins.
pub(crate) struct PatchFace {
    pub patch: Patch,
    pub holes: Vec<Vec<Vector2<f64>>>,
    /// How far its boundary is off it at most.
    pub off: f64,
}

impl PatchFace {
    /// By the points along each step, both ends among them; `None` if it is none.
    pub fn new(face: &Face, points: impl Fn(&Step) -> Vec<Vector3<f64>>) -> Option<Self> {
        let chain = |steps: &[Step]| {
            let mut chain: Vec<Vector3<f64>> = steps.iter().flat_map(&points).collect();
            chain.dedup();
            chain
        };
        let sides = with_points(face.sides()?.map(chain))?;
        let holes: Vec<Vec<Vector3<f64>>> =
            face.loops[1..].iter().map(|steps| chain(steps)).collect();
        // Straight pieces have points at their ends alone.
        let along = |hole: &Vec<Vector3<f64>>| -> Vec<Vector3<f64>> {
            let next = hole.iter().cycle().skip(1);
            let pieces = hole.iter().zip(next).map(|(a, b)| [*a, *b]);
            let length: f64 = pieces.clone().map(|[a, b]| (b - a).norm()).sum();
            let longest = length / ALONG_HOLE as f64;
            let in_piece = |[a, b]: [Vector3<f64>; 2]| {
                let count = ((b - a).norm() / longest)
                    .ceil()
                    .clamp(1.0, ALONG_HOLE as f64);
                (0..count as usize).map(move |k| a + (b - a) * (k as f64 / count))
            };
            pieces.flat_map(in_piece).collect()
        };
        let on_it: Vec<Vector3<f64>> = holes.iter().flat_map(along).collect();
        let mut patch = Patch::new(sides.clone())?;
        if !on_it.is_empty() {
            patch = patch.through(&on_it);
        }
        let places = |hole: &Vec<Vector3<f64>>| {
            let mut places: Vec<_> = hole.iter().map(|point| patch.place(point)).collect();
            places.extend(places.first().copied());
            places.dedup();
            places
        };
        let holes = holes.iter().map(places).collect();
        let of_sides = sides
            .iter()
            .enumerate()
            .map(|(k, side)| patch.off_side(k, side));
        let of_holes = on_it.iter().map(|point| patch.distance(point));
        let off = of_sides.chain(of_holes).fold(0.0, f64::max);
        Some(Self { patch, holes, off })
    }

    /// Whether a place is on it.
    pub fn contains(&self, place: &Vector2<f64>) -> bool {
        self.patch.is_within(&self.holes, place)
    }

    /// Its area, and the flux of x from a point through it.
    pub fn moments(&self, from: &Vector3<f64>) -> [f64; 2] {
        self.patch.moments(&self.holes, from)
    }
}

/// Four sides of which those without anything are the point where the one before them ends, the first
/// one where the loop does; `None` if there is nothing at all.
pub(super) fn with_points<T: Copy>(mut sides: [Vec<T>; 4]) -> Option<[Vec<T>; 4]> {
    let mut end = *sides.iter().rev().find_map(|side| side.last())?;
    for side in &mut sides {
        match side.last() {
            Some(last) => end = *last,
            None => side.push(end),
        }
    }
    Some(sides)
}

/// The place at a share of a side.
pub(super) fn place_on_side(side: usize, share: f64) -> Vector2<f64> {
    Vector2::from(match side {
        0 => [share, 0.0],
        1 => [1.0, share],
        2 => [1.0 - share, 1.0],
        _ => [0.0, 1.0 - share],
    })
}

/// Places of a grid, the corners and sides among them.
fn grid_places(count: usize) -> impl Iterator<Item = Vector2<f64>> {
    let side = count + 1;
    (0..side * side).map(move |k| Vector2::new((k / side) as f64, (k % side) as f64) / count as f64)
}

/// The means of three knots each, from 0 to 1.
fn greville() -> [f64; CONTROLS] {
    let knot = |k: usize| (k as f64 - 3.0).clamp(0.0, PIECES as f64);
    std::array::from_fn(|i| (knot(i + 1) + knot(i + 2) + knot(i + 3)) / (3.0 * PIECES as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sides(at: impl Fn(f64, f64) -> Vector3<f64>) -> [Vec<Vector3<f64>>; 4] {
        let share = |k: usize| k as f64 / 200.0;
        let along = |f: &dyn Fn(f64) -> Vector3<f64>| (0..=200).map(|k| f(share(k))).collect();
        [
            along(&|s| at(s, 0.0)),
            along(&|s| at(1.0, s)),
            along(&|s| at(1.0 - s, 1.0)),
            along(&|s| at(0.0, 1.0 - s)),
        ]
    }

    /// A quarter of a cylinder of radius 2 and length 3.
    fn quarter(u: f64, v: f64) -> Vector3<f64> {
        let (sine, cosine) = (u * std::f64::consts::FRAC_PI_2).sin_cos();
        Vector3::new(2.0 * cosine, 2.0 * sine, 3.0 * v)
    }

    #[test]
    fn a_quarter_of_a_cylinder_is_met() {
        let patch = Patch::new(sides(quarter)).unwrap();
        for place in grid_places(7) {
            let point = patch.point(&place);
            assert!((point - quarter(place.x, place.y)).norm() < 1e-3, "{point}");
            let outside = point + Vector3::new(0.3 * point.x, 0.3 * point.y, 0.0);
            assert!((patch.place(&outside) - place).norm() < 1e-3);
        }
        let [area, flux] = patch.moments(&[], &Vector3::zeros());
        let truth = 3.0 * std::f64::consts::PI;
        assert!(
            (area - truth).abs() < 2e-3 && (flux - 2.0 * truth).abs() < 4e-3,
            "{area} {flux}"
        );
    }

    #[test]
    fn a_hole_takes_its_part() {
        let patch = Patch::new(sides(quarter)).unwrap();
        let corners = [
            [0.25, 0.25],
            [0.25, 0.75],
            [0.75, 0.75],
            [0.75, 0.25],
            [0.25, 0.25],
        ];
        let hole = corners.map(Vector2::from).to_vec();
        let whole = patch.moments(&[], &Vector3::zeros());
        let left = patch.moments(std::slice::from_ref(&hole), &Vector3::zeros());
        for (left, whole) in left.iter().zip(whole) {
            assert!((left / whole - 0.75).abs() < 1e-4);
        }
        assert!(!patch.is_within(std::slice::from_ref(&hole), &Vector2::new(0.5, 0.5)));
        assert!(patch.is_within(&[hole], &Vector2::new(0.1, 0.5)));
    }

    #[test]
    fn it_bends_through_points_and_keeps_its_sides() {
        let flat = |u: f64, v: f64| Vector3::new(u, v, 0.0);
        let points: Vec<Vector3<f64>> = (0..40)
            .map(|k| {
                let (sine, cosine) = (0.157 * f64::from(k)).sin_cos();
                Vector3::new(0.5 + 0.2 * cosine, 0.5 + 0.2 * sine, 0.05)
            })
            .collect();
        let patch = Patch::new(sides(flat)).unwrap().through(&points);
        for point in &points {
            assert!((patch.point(&patch.place(point)) - point).norm() < 1e-3);
        }
        for place in [[0.0, 0.3], [1.0, 0.6], [0.2, 0.0], [0.7, 1.0]].map(Vector2::from) {
            assert!(patch.point(&place).z.abs() < 1e-12);
        }
    }

    #[test]
    fn a_side_may_be_a_point() {
        let corner = |x: f64, y: f64| Vector3::new(x, y, 0.0);
        let line = |a: Vector3<f64>, b: Vector3<f64>| vec![a, b];
        let [a, b, c] = [corner(0.0, 0.0), corner(2.0, 0.0), corner(0.0, 1.0)];
        let patch = Patch::new([line(a, b), line(b, c), vec![c], line(c, a)]).unwrap();
        assert!((patch.moments(&[], &a)[0] - 1.0).abs() < 1e-6);
    }
}
