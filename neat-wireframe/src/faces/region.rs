//! Where a face lies in space: what a ray hits.

use super::bounds::Bounds;
use super::cap::Cap;
use super::cells::{closed_points, polygon_of};
use super::curves::Curves;
use super::face::{Face, Step};
use super::patch::PatchFace;
use super::plane_fit::PlaneFrame;
use super::polygon::contains;
use super::surface::Surface;
use super::unrolled::{self, Chain, Unrolled};
use super::walls::{Wall, hit};
use nalgebra::{Vector2, Vector3};
use std::f64::consts::TAU;

/// A face that is no plane is asked about along so many straight lines on it …
const RULINGS: usize = 16;
/// … without this share at each end …
const AT_END: f64 = 0.02;
/// … and passes through another one if more of them do.
const FEW_RULINGS: usize = 4;
/// A face is asked about on a grid of so many points to each side of the box around it.
const GRID: usize = 8;

/// A face with its extent.
pub(super) enum Region {
    Plane {
        frame: PlaneFrame,
        polygons: Vec<Vec<Vector2<f64>>>,
    },
    /// Of a cylinder or a cone.
    Round {
        surface: Unrolled,
        loops: Vec<Chain>,
    },
    Cap(Cap),
    /// Between two splines.
    Wall(Wall),
    /// Through its boundary, with the triangles of a grid.
    Patch {
        face: PatchFace,
        grid: Vec<[(Vector2<f64>, Vector3<f64>); 3]>,
        bounds: Bounds,
    },
}

impl Region {
    /// `None` if the face is no part of a surface with an extent.
    pub fn new(curves: &Curves, face: &Face) -> Option<Self> {
        match face.surface {
            Surface::Plane { normal, offset } => {
                let frame = PlaneFrame::new(normal, offset);
                let polygon = |steps: &Vec<_>| polygon_of(curves, steps, &frame);
                Some(Self::Plane {
                    frame,
                    polygons: face.loops.iter().map(polygon).collect(),
                })
            }
            Surface::Sphere { .. } => {
                let around = closed_points(curves, face.loops.first()?);
                Cap::new(&face.surface, &around).map(Self::Cap)
            }
            Surface::Extruded { direction } => {
                let [one, other] = face.rims()?;
                let points = |step: Step| Some(curves.find(step.curve)?.points_along(&step));
                Some(Self::Wall(Wall::new(
                    [points(one)?, points(other)?],
                    direction,
                )))
            }
            Surface::Patch { .. } => {
                let face = PatchFace::new(face, |step| curves.points_along(step))?;
                let grid = face.patch.grid();
                let corners: Vec<Vector3<f64>> = grid.iter().flatten().map(|(_, p)| *p).collect();
                let bounds = Bounds::of(&corners);
                Some(Self::Patch { face, grid, bounds })
            }
            round => {
                let surface = Unrolled::new(&round)?;
                let around = |steps: &Vec<Step>| surface.chain(&closed_points(curves, steps));
                let loops: Vec<Chain> = face.loops.iter().map(around).collect();
                Some(Self::Round { surface, loops })
            }
        }
    }

    /// Where a ray hits the face, by its parameter.
    pub fn hits(&self, origin: &Vector3<f64>, direction: &Vector3<f64>) -> Vec<f64> {
        match self {
            Self::Plane { frame, polygons } => {
                let slope = frame.normal.dot(direction);
                let t = (frame.offset - frame.normal.dot(origin)) / slope;
                let point = frame.coordinates(&(origin + direction * t));
                let inside = polygons.iter().filter(|p| contains(p, &point)).count() % 2 == 1;
                Vec::from_iter((t.is_finite() && inside).then_some(t))
            }
            Self::Round { surface, loops } => {
                let hits = surface.hits(origin, direction).into_iter().flatten();
                let on_face = hits.filter(|(_, place)| unrolled::contains(loops, place));
                on_face.map(|(t, _)| t).collect()
            }
            Self::Cap(cap) => cap.hits(origin, direction),
            Self::Wall(wall) => wall.hits(origin, direction),
            Self::Patch { face, grid, bounds } => {
                if !bounds.are_hit(origin, direction) {
                    return Vec::new();
                }
                let hit = |corners: &[(Vector2<f64>, Vector3<f64>); 3]| {
                    let [a, b, c] = corners.map(|(place, _)| place);
                    let (t, [x, y]) = hit(&corners.map(|(_, point)| point), origin, direction)?;
                    face.contains(&(a + (b - a) * x + (c - a) * y)).then_some(t)
                };
                grid.iter().filter_map(hit).collect()
            }
        }
    }

    /// Whether a straight line from one point to another passes through the face.
    pub fn is_between(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> bool {
        let hits = self.hits(from, &(to - from));
        hits.iter().any(|t| (0.0..1.0).contains(t))
    }

    /// Whether a face that is no plane passes through another one.
    pub fn passes_through(&self, other: &Self) -> bool {
        let passes = |ends: &[Vector3<f64>; 2]| {
            let at = |share: f64| ends[0] + (ends[1] - ends[0]) * share;
            other.is_between(&at(AT_END), &at(1.0 - AT_END))
        };
        let count = match self {
            Self::Plane { .. } => 0,
            Self::Round { surface, loops } => (0..RULINGS)
                .filter(|ruling| rulings_at(surface, loops, *ruling).iter().any(passes))
                .count(),
            Self::Cap(cap) => (0..RULINGS)
                .filter(|line| cap.pieces_at(*line, RULINGS, AT_END).iter().any(passes))
                .count(),
            Self::Wall(wall) => wall
                .rulings(RULINGS)
                .iter()
                .filter(|ends| passes(ends))
                .count(),
            Self::Patch { face, .. } => {
                let on_line = |line: &usize| (lines_at(face, *line).iter()).any(passes);
                (0..RULINGS).filter(on_line).count()
            }
        };
        count > FEW_RULINGS
    }

    /// Points all over a plane face; none of others.
    pub fn points(&self) -> Vec<Vector3<f64>> {
        let Self::Plane { frame, polygons } = self else {
            return Vec::new();
        };
        let corners = || polygons.iter().flatten();
        let low = corners().fold(Vector2::repeat(f64::MAX), |low, corner| low.inf(corner));
        let high = corners().fold(Vector2::repeat(f64::MIN), |high, corner| high.sup(corner));
        let at = |k: usize| {
            let share = [k % GRID, k / GRID].map(|k| (k as f64 + 0.5) / GRID as f64);
            low + (high - low).component_mul(&Vector2::from(share))
        };
        let inside = |p: &Vector2<f64>| polygons.iter().filter(|q| contains(q, p)).count() % 2 == 1;
        let points = (0..GRID * GRID).map(at).filter(inside);
        points.map(|point| frame.point(&point)).collect()
    }

    /// Points within a face that reaches beyond its curves: a part of a sphere.
    pub fn inner_points(&self) -> Vec<Vector3<f64>> {
        match self {
            Self::Cap(cap) => cap.inner_points(),
            _ => Vec::new(),
        }
    }

    /// Distance of a point from the surface of which the face is a part.
    pub fn distance_to_surface(&self, point: &Vector3<f64>) -> f64 {
        match self {
            Self::Plane { frame, .. } => (frame.normal.dot(point) - frame.offset).abs(),
            Self::Round { surface, .. } => surface.distance(point),
            Self::Cap(cap) => cap.distance(point),
            Self::Wall(wall) => wall.distance(point),
            Self::Patch { face, .. } => face.patch.distance(point),
        }
    }

    /// Whether a point lies over or under the face itself, at most `distance` away.
    pub fn is_near(&self, point: &Vector3<f64>, distance: f64) -> bool {
        let toward = match self {
            Self::Plane { frame, .. } => frame.normal,
            Self::Round { surface, .. } => surface.outward(surface.place(point).x),
            Self::Cap(cap) => cap.outward(point),
            Self::Wall(wall) => return wall.is_near(point, distance),
            Self::Patch { bounds, .. } if !bounds.widened(distance).contain(point) => return false,
            Self::Patch { face, .. } => {
                let [u, v] = face.patch.tangents(&face.patch.place(point));
                u.cross(&v).normalize()
            }
        };
        let hits = self.hits(point, &toward);
        hits.iter().any(|t| t.abs() <= distance)
    }
}

/// Pieces of a line across a patch, all but its ends.
fn lines_at(face: &PatchFace, line: usize) -> Vec<[Vector3<f64>; 2]> {
    let across = (line as f64 + 0.5) / RULINGS as f64;
    let places: Vec<Vector2<f64>> = (0..=RULINGS)
        .map(|k| AT_END + (1.0 - 2.0 * AT_END) * k as f64 / RULINGS as f64)
        .map(|along| Vector2::new(across, along))
        .collect();
    let pieces = places.windows(2).map(|ends| [ends[0], ends[1]]);
    let on_face = pieces.filter(|ends| ends.iter().all(|place| face.contains(place)));
    on_face
        .map(|ends| ends.map(|place| face.patch.point(&place)))
        .collect()
}

/// Pieces of one of so many rulings that are on a round face.
fn rulings_at(surface: &Unrolled, loops: &[Chain], ruling: usize) -> Vec<[Vector3<f64>; 2]> {
    let angles = || loops.iter().flatten().map(|place| place.x);
    // Where a loop begins must not matter if it runs around the axis.
    let [from, to] = if loops.iter().any(|chain| unrolled::turns(chain) != 0) {
        [0.0, TAU]
    } else {
        [
            angles().fold(f64::MAX, f64::min),
            angles().fold(f64::MIN, f64::max),
        ]
    };
    let angle = from + (to - from) * (ruling as f64 + 0.5) / RULINGS as f64;
    surface.pieces_at(loops, angle)
}
