//! Solids, imitated detectors of known noise, and how often the truth lies in the
//! ellipsoids that the assessment claims.

use crate::noise::Noise;
use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::synthetic::{Frustum, Solid, visible_parts};
use neat_core::{Camera, Intrinsics, LineSegment2, ScoredSegment2, Similarity, Wireframe3d};
use neat_wireframe::bundle_adjustment::{EdgeObservation, Loss, ObservedEdge, bundle_adjust};
use neat_wireframe::confidence::Confidence;
use neat_wireframe::dimensions::{Dimensions, Quantity};
use neat_wireframe::export::WireframeDocument;
use neat_wireframe::{SignedDistance, ViewObservation};

/// What a detector does to a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Detector {
    /// Segments that meet share a vertex, as in the wireframes of HAWP; the noise
    /// is one of vertices.
    Vertices,
    /// Every segment has ends of its own, as LSD finds them; three times as noisy
    /// along it as across.
    Segments,
}

/// A solid as an imitated detector sees it.
pub struct Scene {
    pub observations: Vec<ViewObservation>,
    pub truth: Wireframe3d,
    pub surface: Surface,
}

/// The surface of a solid.
pub struct Surface(Frustum);

impl SignedDistance for Surface {
    fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
        points.iter().map(|point| self.0.sdf(point)).collect()
    }

    fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        let with_gradient = |sdf| (sdf, Vector3::zeros());
        self.sdf(points).into_iter().map(with_gradient).collect()
    }
}

/// A fifth of the visible edges is missed, a seventh of the rest in two pieces,
/// and two false segments are in each view. Every scene has noise of its own.
pub fn scene(solid: Solid, detector: Detector, sigma: f64, views: usize, seed: u64) -> Scene {
    let frustum = solid.frustum();
    let mut noise = Noise(seed.wrapping_mul(1000) + solid as u64);
    noise.0 ^= noise.0 << 32;
    let cameras = cameras(views, &mut noise);
    let observations = cameras
        .into_iter()
        .map(|camera| ViewObservation {
            segments: detections(&frustum, &camera, detector, sigma, &mut noise),
            camera,
            junctions: Vec::new(),
        })
        .collect();
    Scene {
        observations,
        truth: frustum.wireframe().clone(),
        surface: Surface(frustum),
    }
}

/// Cameras around the origin at distance 2, as evenly as a Fibonacci lattice is,
/// somewhat displaced. Images have 512 × 512 pixels.
fn cameras(count: usize, noise: &mut Noise) -> Vec<Camera> {
    let camera = |i: usize| {
        let z = 1.0 - (2 * i + 1) as f64 / count as f64;
        let (sin, cos) = (2.399_963 * i as f64).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        let outward = Vector3::new(radius * cos, radius * sin, z) + 0.1 * noise.normal3();
        let forward = -outward.normalize();
        let right = forward.cross(&noise.normal3()).normalize();
        Camera {
            intrinsics: Intrinsics::centered(560.0, (512, 512)),
            world_from_camera: Matrix3::from_columns(&[right, forward.cross(&right), forward]),
            center_in_world: -2.0 * forward,
            width: 512,
            height: 512,
        }
    };
    (0..count).map(camera).collect()
}

fn detections(
    solid: &Frustum,
    camera: &Camera,
    detector: Detector,
    sigma: f64,
    noise: &mut Noise,
) -> Vec<ScoredSegment2> {
    const MIN_LENGTH: f64 = 6.0;
    let vertices: Vec<Vector2<f64>> = (solid.wireframe().junctions.iter())
        .map(|junction| camera.project(junction).pixel + sigma * noise.normal2())
        .collect();
    let mut segments = Vec::new();
    for part in visible_parts(solid, camera) {
        if part.segment.length() < MIN_LENGTH || noise.uniform() < 0.2 {
            continue;
        }
        let mut pieces = vec![[0.0, 1.0]];
        if noise.uniform() < 1.0 / 7.0 && part.segment.length() > 30.0 {
            let [from, to] = [0.3, 0.5].map(|low| low + 0.15 * noise.uniform());
            pieces = vec![[0.0, from], [to, 1.0]];
        }
        for piece in pieces {
            let exact = LineSegment2::new(
                part.segment.point_at(piece[0]),
                part.segment.point_at(piece[1]),
            );
            let ends = [0, 1].map(|side| {
                let is_junction = piece[side] == side as f64;
                let junction = part.junctions[side].filter(|_| is_junction);
                match (detector, junction) {
                    (Detector::Vertices, Some(junction)) => vertices[junction],
                    (Detector::Vertices, None) => exact.ends()[side] + sigma * noise.normal2(),
                    (Detector::Segments, _) => jittered(&exact, side, sigma, noise),
                }
            });
            segments.push(LineSegment2::new(ends[0], ends[1]));
        }
    }
    for _ in 0..2 {
        let mut anywhere = || Vector2::new(noise.uniform(), noise.uniform()) * 300.0;
        let offset = Vector2::new(106.0, 106.0);
        segments.push(LineSegment2::new(anywhere() + offset, anywhere() + offset));
    }
    (segments.into_iter().enumerate())
        .map(|(edge, segment)| ScoredSegment2 {
            segment,
            score: 0.9,
            edge,
        })
        .collect()
}

fn jittered(segment: &LineSegment2, side: usize, sigma: f64, noise: &mut Noise) -> Vector2<f64> {
    let along = (segment.end - segment.start).normalize();
    let across = Vector2::new(-along.y, along.x);
    segment.ends()[side]
        + along * (3.0 * sigma * noise.normal())
        + across * (sigma * noise.normal())
}

/// The graph with noise of 0.003 in every coordinate.
pub fn displaced(truth: &Wireframe3d, seed: u64) -> Wireframe3d {
    let mut noise = Noise(seed);
    let mut wireframe = truth.clone();
    for junction in &mut wireframe.junctions {
        *junction += 0.003 * noise.normal3();
    }
    wireframe
}

/// The [`displaced`] truth, adjusted to the detections of its edges, which are sought ever
/// nearer.
pub fn adjusted(observations: &[ViewObservation], truth: &Wireframe3d, seed: u64) -> Wireframe3d {
    let loss = Loss {
        cauchy_scale_in_pixels: 1.0,
        end_weight: 1.0,
    };
    let mut wireframe = displaced(truth, seed);
    for reach in [6.0, 4.0, 3.0] {
        let observed: Vec<ObservedEdge> = (0..wireframe.edges.len())
            .map(|edge| observed_edge(observations, &wireframe, edge, reach))
            .collect();
        wireframe.junctions = bundle_adjust(&observed, &wireframe.junctions, loss).junctions;
    }
    wireframe
}

/// An edge with the detection in each view that lies within `reach` pixels of its line, covers
/// much of it and has the nearest ends.
fn observed_edge(
    observations: &[ViewObservation],
    wireframe: &Wireframe3d,
    edge: usize,
    reach: f64,
) -> ObservedEdge {
    let in_space = wireframe.segment(edge);
    let of_view = |view: &ViewObservation| {
        let projected = in_space.map(|end| view.camera.project(end).pixel);
        let near = reach.min(0.2 * projected.length());
        let lies_on_it = |detection: &LineSegment2| {
            let ends = detection.ends();
            let [from, to] = ends.map(|end| projected.line_parameter(&end).clamp(0.0, 1.0));
            ends.iter()
                .all(|end| projected.distance_to_line(end) < near)
                && (to - from).abs() > 0.4
                && detection.length() < 1.3 * projected.length()
        };
        let detection = (view.segments.iter())
            .map(|detected| projected.with_nearest_order(&detected.segment))
            .filter(lies_on_it)
            .min_by(|a, b| {
                let distance = |s| projected.end_distances(s).into_iter().fold(0.0, f64::max);
                distance(a).total_cmp(&distance(b))
            })?;
        let distances = projected.end_distances(&detection);
        let ends = detection.ends();
        Some(EdgeObservation {
            camera: view.camera,
            detection,
            ends: [0, 1].map(|side| (distances[side] < reach).then_some(ends[side])),
            weight: 1.0,
        })
    };
    ObservedEdge {
        junctions: wireframe.edges[edge],
        observations: observations.iter().filter_map(of_view).collect(),
    }
}

/// Quantiles of χ² with three degrees of freedom at 50, 68 and 95 %.
const CHI_SQUARED: [f64; 3] = [2.366, 3.506, 7.815];

/// How junctions compare with the truth.
#[derive(Clone, Debug, Default)]
pub struct Coverage {
    /// Junctions that have a covariance.
    pub junctions: usize,
    /// Those that have none.
    pub undetermined: usize,
    /// Junctions within the 50, 68 and 95 % ellipsoids.
    inside: [usize; 3],
    /// Edges between true junctions, and how many of them have the true length within its
    /// 95 % interval.
    pub lengths: usize,
    lengths_held: usize,
    errors: Vec<f64>,
    sigmas: Vec<f64>,
}

impl Coverage {
    /// Adds the junctions of a wireframe; `true_position` is `None` for those
    /// that have no true counterpart.
    pub fn add(
        &mut self,
        wireframe: &Wireframe3d,
        confidence: &Confidence,
        true_position: impl Fn(usize) -> Option<Vector3<f64>>,
    ) {
        for (index, junction) in wireframe.junctions.iter().enumerate() {
            let Some(truth) = true_position(index) else {
                continue;
            };
            let Some(covariance) = confidence.junctions[index].covariance else {
                self.undetermined += 1;
                continue;
            };
            let error = junction - truth;
            let squared = error.dot(&(covariance.try_inverse().unwrap() * error));
            self.junctions += 1;
            for (inside, quantile) in self.inside.iter_mut().zip(CHI_SQUARED) {
                *inside += usize::from(squared <= quantile);
            }
            self.errors.push(error.norm());
            self.sigmas.push(covariance.trace().sqrt());
        }
        self.add_lengths(wireframe, confidence, true_position);
    }

    fn add_lengths(
        &mut self,
        wireframe: &Wireframe3d,
        confidence: &Confidence,
        true_position: impl Fn(usize) -> Option<Vector3<f64>>,
    ) {
        let mut document = WireframeDocument::from(wireframe);
        confidence.fill(&mut document, &[], &Similarity::identity());
        let dimensions = Dimensions::new(&document, None).unwrap();
        for length in dimensions.lengths() {
            let Quantity::Length { edge } = length.quantity else {
                continue;
            };
            let ends = wireframe.edges[edge].map(&true_position);
            if let ([Some(a), Some(b)], Some([low, high])) = (ends, length.interval) {
                self.lengths += 1;
                self.lengths_held += usize::from((low..=high).contains(&(b - a).norm()));
            }
        }
    }

    /// Share of the true lengths within the 95 % intervals.
    pub fn share_of_lengths(&self) -> f64 {
        self.lengths_held as f64 / self.lengths as f64
    }

    /// Shares within the 50, 68 and 95 % ellipsoids.
    pub fn shares(&self) -> [f64; 3] {
        self.inside
            .map(|count| count as f64 / self.junctions as f64)
    }

    /// Medians of the claimed error (root of the trace) and of the true one.
    pub fn medians(&self) -> [f64; 2] {
        [&self.sigmas, &self.errors].map(|numbers| {
            let mut numbers = numbers.clone();
            numbers.sort_by(f64::total_cmp);
            numbers.get(numbers.len() / 2).copied().unwrap_or(f64::NAN)
        })
    }
}
