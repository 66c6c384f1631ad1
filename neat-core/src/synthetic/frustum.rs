//! Frustums: profiles swept upwards, with exact distance, faces and edges.

use super::planar_face::PlanarFace;
use super::profile::{Profile, Side};
use super::round_face::RoundFace;
use crate::{Camera, CircularArc, Wireframe3d};
use nalgebra::{Rotation3, Vector2, Vector3};

/// Nearer to the surface than this, the direction to it is rounding, and the
/// face's normal stands for it.
const ON_SURFACE: f64 = 1e-12;
/// Sides whose directions agree so well, by their dot product, go on smoothly: no edge is there.
const SMOOTH: f64 = 1.0 - 1e-9;

/// A solid between a profile of lines and arcs and a scaled copy of it above: a prism or a
/// cylinder when the scale is 1, a truncated pyramid or cone when it is smaller.
///
/// All of it is exact: faces are planes, cylinders and cones, edges are straight or arcs of circles and
/// are real creases.
#[derive(Clone, Debug, PartialEq)]
pub struct Frustum {
    faces: Vec<PlanarFace>,
    round_faces: Vec<RoundFace>,
    wireframe: Wireframe3d,
    arcs: Vec<CircularArc>,
    /// For each flat side, then each round one, the surface that it is a part of: sides that go on
    /// smoothly are one.
    surfaces: Vec<usize>,
    profile: Profile,
    half_height: f64,
    top_scale: f64,
    world_from_solid: Rotation3<f64>,
}

/// Bottom and top of a frustum.
struct Ends {
    scales: [f64; 2],
    heights: [f64; 2],
    world_from_solid: Rotation3<f64>,
}

impl Ends {
    fn point(&self, end: usize, in_profile: &Vector2<f64>) -> Vector3<f64> {
        let scaled = in_profile * self.scales[end];
        self.world_from_solid * Vector3::new(scaled.x, scaled.y, self.heights[end])
    }

    /// The arc of a side at one end.
    fn rim(&self, end: usize, side: &Side) -> Option<CircularArc> {
        let arc = side.arc?;
        let ends = [arc.angle, arc.angle + arc.sweep];
        Some(CircularArc {
            center: self.point(end, &arc.center),
            axes: [Vector3::x(), Vector3::y()].map(|axis| self.world_from_solid * axis),
            radius: arc.radius * self.scales[end],
            angles: [ends[0].min(ends[1]), ends[0].max(ends[1])],
        })
    }

    fn round_face(&self, side: &Side) -> Option<RoundFace> {
        Some(RoundFace {
            rims: [self.rim(0, side)?, self.rim(1, side)?],
            convex: side.arc?.sweep > 0.0,
        })
    }
}

/// What the sides of a profile sweep.
struct Sides {
    /// The straight edges of the bottom.
    edges: Vec<[usize; 2]>,
    /// Those between bottom and top.
    uprights: Vec<[usize; 2]>,
    faces: Vec<PlanarFace>,
    round_faces: Vec<RoundFace>,
    /// As [`Frustum::surfaces`].
    surfaces: Vec<usize>,
}

impl Sides {
    fn new(profile: &Profile, ends: &Ends, junctions: &[Vector3<f64>]) -> Self {
        let n = junctions.len() / 2;
        let (mut edges, mut uprights) = (Vec::new(), Vec::new());
        let (mut faces, mut round_faces) = (Vec::new(), Vec::new());
        let (mut of_planes, mut of_rounds) = (Vec::new(), Vec::new());
        let (mut first, mut surfaces) = (0, 0);
        for sides in &profile.loops {
            let surface_of = smooth_groups(sides);
            for (i, side) in sides.iter().enumerate() {
                let [a, b] = [first + i, first + (i + 1) % sides.len()];
                if let Some(face) = ends.round_face(side) {
                    round_faces.push(face);
                    of_rounds.push(surfaces + surface_of[i]);
                } else {
                    edges.push([a, b]);
                    faces.push(PlanarFace::polygon(vec![a, b, n + b, n + a], junctions));
                    of_planes.push(surfaces + surface_of[i]);
                }
                if corners_of(sides) > 0 && !goes_on_smoothly(before(sides, i), side) {
                    uprights.push([a, n + a]);
                }
            }
            surfaces += surface_of.iter().max().map_or(0, |last| last + 1);
            first += corners_of(sides);
        }
        of_planes.extend(of_rounds);
        Self {
            edges,
            uprights,
            faces,
            round_faces,
            surfaces: of_planes,
        }
    }
}

impl Frustum {
    /// The frustum over `profile` at z = -`half_height`, scaled by `top_scale` > 0 about the
    /// z axis at z = `half_height`, and then rotated into the world. Where the scale is not 1,
    /// arcs must be whole circles around the axis, so that they bound cones.
    pub(super) fn new(
        profile: Profile,
        half_height: f64,
        top_scale: f64,
        world_from_solid: Rotation3<f64>,
    ) -> Self {
        let ends = Ends {
            scales: [1.0, top_scale],
            heights: [-half_height, half_height],
            world_from_solid,
        };
        let n: usize = profile.loops.iter().map(|sides| corners_of(sides)).sum();
        let with_corners = || profile.loops.iter().filter(|sides| corners_of(sides) > 0);
        let junctions: Vec<_> = (0..2)
            .flat_map(|end| with_corners().flatten().map(move |side| (end, side.start)))
            .map(|(end, start)| ends.point(end, &start))
            .collect();
        let sides = Sides::new(&profile, &ends, &junctions);
        let Sides {
            mut edges,
            uprights,
            mut faces,
            round_faces,
            surfaces,
        } = sides;
        let top: Vec<_> = edges.iter().map(|[a, b]| [n + a, n + b]).collect();
        edges.extend(top.into_iter().chain(uprights));
        let arcs = (0..2)
            .flat_map(|end| profile.sides().map(move |side| (end, side)))
            .filter_map(|(end, side)| ends.rim(end, side))
            .collect();
        // Corners of holes are no part of the outline.
        let around = corners_of(&profile.loops[0]);
        for (end, outline) in [
            (0, (0..around).rev().collect()),
            (1, (n..n + around).collect()),
        ] {
            faces.push(PlanarFace::end(
                &profile.scaled(ends.scales[end]),
                ends.heights[end],
                &world_from_solid,
                end == 1,
                outline,
                &junctions,
            ));
        }
        Self {
            faces,
            round_faces,
            wireframe: Wireframe3d { junctions, edges },
            arcs,
            surfaces,
            profile,
            half_height,
            top_scale,
            world_from_solid,
        }
    }

    /// The flat faces in the world: the straight sides in the order of the profile, then bottom,
    /// then top.
    pub fn faces(&self) -> &[PlanarFace] {
        &self.faces
    }

    /// The faces on cylinders and cones, in the order of the profile's arcs.
    pub fn round_faces(&self) -> &[RoundFace] {
        &self.round_faces
    }

    /// Junctions and straight edges in the world. With `n` corners: junctions 0..n are the
    /// bottom's, n..2n the top's, and arcs end at junctions, too; edges are the bottom ring, the top ring
    /// and the uprights.
    pub fn wireframe(&self) -> &Wireframe3d {
        &self.wireframe
    }

    /// The edges that are arcs or whole circles: of the bottom, then of the top, each in the order of
    /// [`Self::round_faces`].
    pub fn arcs(&self) -> &[CircularArc] {
        &self.arcs
    }

    /// The volume.
    pub fn volume(&self) -> f64 {
        let scale = self.top_scale;
        let mean_area = self.profile.area() * (1.0 + scale + scale * scale) / 3.0;
        mean_area * 2.0 * self.half_height
    }

    /// For each straight side, then each round one, the surface of which it is a part, counted from 0:
    /// sides that go on in each other without an edge are one.
    pub(super) fn surfaces(&self) -> &[usize] {
        &self.surfaces
    }

    /// Whether a world point lies inside.
    pub fn contains(&self, point_in_world: &Vector3<f64>) -> bool {
        let p = self
            .world_from_solid
            .inverse_transform_vector(point_in_world);
        let rise = (p.z / self.half_height + 1.0) / 2.0;
        let scale = 1.0 + (self.top_scale - 1.0) * rise;
        (0.0..1.0).contains(&rise) && self.profile.contains(&(p.xy() / scale))
    }

    /// Exact Euclidean distance from the surface, negative inside.
    pub fn sdf(&self, point_in_world: &Vector3<f64>) -> f64 {
        self.sdf_and_gradient(point_in_world).0
    }

    /// [`Self::sdf`] and its gradient, a unit vector away from the solid. On
    /// the surface it is a face's normal; where several points of the surface
    /// are equally near, it belongs to one of them.
    pub fn sdf_and_gradient(&self, point_in_world: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let (mut distance, mut gradient) = (f64::INFINITY, Vector3::zeros());
        let mut ask = |nearest: Vector3<f64>, normal: &dyn Fn() -> Vector3<f64>| {
            let offset = point_in_world - nearest;
            let to_face = offset.norm();
            if to_face < distance {
                distance = to_face;
                gradient = if to_face > ON_SURFACE {
                    offset / to_face
                } else {
                    normal()
                };
            }
        };
        for face in &self.faces {
            ask(face.closest_point(point_in_world), &|| face.normal);
        }
        for face in &self.round_faces {
            let normal = || face.normal_beside(point_in_world);
            ask(face.closest_point(point_in_world), &normal);
        }
        if !self.contains(point_in_world) {
            (distance, gradient)
        } else if distance > ON_SURFACE {
            (-distance, -gradient)
        } else {
            (-distance, gradient)
        }
    }

    /// Lower and upper corner of the rectangle around the solid's image, in
    /// image coordinates. `None` unless all of it is in front of the camera.
    pub fn bounds_in_image(&self, camera: &Camera) -> Option<[Vector2<f64>; 2]> {
        let of_round = self.round_faces.iter().flat_map(RoundFace::hull);
        let hull: Vec<_> = (self.wireframe.junctions.iter().copied())
            .chain(of_round)
            .collect();
        bounds_in_image(&hull, camera)
    }
}

/// How many corners a closed curve has; a circle has none.
fn corners_of(sides: &[Side]) -> usize {
    if sides.len() == 1 { 0 } else { sides.len() }
}

/// The side before another one.
fn before(sides: &[Side], index: usize) -> &Side {
    &sides[(index + sides.len() - 1) % sides.len()]
}

fn goes_on_smoothly(side: &Side, next: &Side) -> bool {
    side.directions()[1].dot(&next.directions()[0]) > SMOOTH
}

/// For each side of a closed curve the number of the smooth stretch that it is in.
fn smooth_groups(sides: &[Side]) -> Vec<usize> {
    let is_start = |i: usize| !goes_on_smoothly(before(sides, i), &sides[i]);
    let first = (0..sides.len()).find(|&i| is_start(i)).unwrap_or(0);
    let mut groups = vec![0; sides.len()];
    let mut group = 0;
    for i in 1..sides.len() {
        let side = (first + i) % sides.len();
        group += usize::from(is_start(side));
        groups[side] = group;
    }
    groups
}

/// Lower and upper corner of the rectangle around the images of points, in image
/// coordinates. `None` unless all of them are in front of the camera.
pub(super) fn bounds_in_image(
    points: &[Vector3<f64>],
    camera: &Camera,
) -> Option<[Vector2<f64>; 2]> {
    let empty = [f64::INFINITY, f64::NEG_INFINITY].map(|bound| Vector2::new(bound, bound));
    (points.iter().map(|point| camera.project(point))).try_fold(
        empty,
        |[lower, upper], projection| {
            (projection.depth > 0.0)
                .then(|| [lower.inf(&projection.pixel), upper.sup(&projection.pixel)])
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Ray;
    use crate::synthetic::{Solid, viewpoints, visible_parts};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use std::f64::consts::TAU;

    /// Chords of a whole circle.
    const CHORDS: f64 = 512.0;
    /// No chord is farther from its arc: the radius is at most a half.
    const OFF: f64 = 0.25 * (TAU / CHORDS / 2.0) * (TAU / CHORDS / 2.0) * 1.1;

    /// The solids with arcs, each with a polyhedron that has chords in their place.
    fn curved() -> impl Iterator<Item = (&'static str, Frustum, Frustum)> {
        let is_curved = |solid: &Solid| !Solid::POLYHEDRA.contains(solid);
        Solid::ALL.into_iter().filter(is_curved).map(|solid| {
            let curved = solid.frustum();
            let flat = Frustum::new(
                curved.profile.with_chords(TAU / CHORDS),
                curved.half_height,
                curved.top_scale,
                curved.world_from_solid,
            );
            (solid.name(), curved, flat)
        })
    }

    fn points(count: usize) -> impl Iterator<Item = Vector3<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        (0..count).map(move |_| Vector3::from_fn(|_, _| rng.random_range(-0.8..0.8)))
    }

    #[test]
    fn distances_are_those_of_a_polyhedron_with_many_sides() {
        for (name, curved, flat) in curved() {
            let mut inside = 0;
            for point in points(1000) {
                let [sdf, expected] = [&curved, &flat].map(|solid| solid.sdf(&point));
                assert!((sdf - expected).abs() < OFF, "{name}: {sdf}, {expected}");
                if expected.abs() > OFF {
                    assert_eq!(curved.contains(&point), flat.contains(&point), "{name}");
                }
                inside += usize::from(sdf < 0.0);
            }
            assert!((10..700).contains(&inside), "{name}: {inside} inside");
        }
    }

    #[test]
    fn the_gradient_is_the_derivative() {
        let h = 1e-6;
        for (name, solid, _) in curved() {
            let mut smooth = 0;
            for point in points(300) {
                let (_, gradient) = solid.sdf_and_gradient(&point);
                assert!((gradient.norm() - 1.0).abs() < 1e-9);
                let differences = Vector3::from_fn(|axis, _| {
                    let step = Vector3::ith(axis, h);
                    (solid.sdf(&(point + step)) - solid.sdf(&(point - step))) / (2.0 * h)
                });
                smooth += usize::from((differences - gradient).norm() < 1e-4);
            }
            assert!(smooth >= 297, "{name}: only {smooth} of 300 are smooth");
        }
    }

    #[test]
    fn arcs_are_creases_and_faces_close() {
        for (name, solid, flat) in curved() {
            for arc in solid.arcs() {
                for point in arc.points(0.1) {
                    assert!(solid.sdf(&point).abs() < 1e-12, "{name}");
                }
            }
            let area =
                |solid: &Frustum| solid.true_faces().iter().map(|face| face.area).sum::<f64>();
            assert!((area(&solid) / area(&flat) - 1.0).abs() < 1e-4, "{name}");
            assert!(
                (solid.volume() / flat.volume() - 1.0).abs() < 1e-3,
                "{name}"
            );
            // Every sharp edge is beside two faces.
            let mut beside = vec![0; solid.wireframe().edges.len() + solid.arcs().len()];
            for face in solid.true_faces() {
                for edge in face.edges {
                    let index = match edge {
                        crate::ground_truth::FaceEdge::Line(index) => index,
                        crate::ground_truth::FaceEdge::Curve(index) => {
                            solid.wireframe().edges.len() + index
                        }
                    };
                    beside[index] += 1;
                }
            }
            assert!(beside.iter().all(|count| *count == 2), "{name}: {beside:?}");
        }
    }

    #[test]
    fn rays_meet_round_faces_where_they_meet_many_sides() {
        for (name, curved, flat) in curved() {
            let mut hits = 0;
            for (camera, point) in viewpoints(40, 2.0, (64, 64), 3).iter().zip(points(40)) {
                let offset = point - camera.center_in_world;
                let ray = Ray {
                    origin: camera.center_in_world,
                    direction: offset.normalize(),
                };
                let nearest = |solid: &Frustum| {
                    let planes = solid.faces().iter().filter_map(|face| face.intersect(&ray));
                    let rounds = solid.round_faces().iter();
                    planes
                        .chain(rounds.filter_map(|face| face.intersect(&ray)))
                        .fold(f64::INFINITY, f64::min)
                };
                let [distance, expected] = [&curved, &flat].map(nearest);
                // At a flat angle the chord is met later.
                if expected.is_finite() || distance.is_finite() {
                    assert!(
                        (distance - expected).abs() < 1e-3,
                        "{name}: {distance}, {expected}"
                    );
                    hits += 1;
                }
            }
            assert!(hits > 5, "{name}: {hits}");
        }
    }

    #[test]
    fn round_faces_hide_straight_edges_as_many_sides_do() {
        let (mut seen, mut hidden) = (0, 0);
        for (name, curved, flat) in curved() {
            for camera in viewpoints(12, 2.0, (128, 128), 1) {
                let parts = visible_parts(&curved, &camera);
                for (edge, segment) in curved.wireframe().segments().iter().enumerate() {
                    let ranges: Vec<[f64; 2]> = (parts.iter())
                        .filter(|part| part.edge == edge)
                        .map(|part| part.range)
                        .collect();
                    for t in (0..40).map(|i| (f64::from(i) + 0.5) / 40.0) {
                        if ranges.iter().flatten().any(|end| (end - t).abs() < 0.01) {
                            continue;
                        }
                        let exact = ranges.iter().any(|[a, b]| (*a..=*b).contains(&t));
                        let offset = segment.point_at(t) - camera.center_in_world;
                        let ray = Ray {
                            origin: camera.center_in_world,
                            direction: offset.normalize(),
                        };
                        let cast = (flat.faces().iter())
                            .filter_map(|face| face.intersect(&ray))
                            .all(|distance| distance > offset.norm() - 1e-3);
                        assert_eq!(exact, cast, "{name}: edge {edge} at {t}");
                        seen += usize::from(exact);
                        hidden += usize::from(!exact);
                    }
                }
            }
        }
        assert!(seen > 1000 && hidden > 1000, "{seen} seen, {hidden} hidden");
    }
}
