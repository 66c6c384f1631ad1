//! Which parts of true edges a camera sees, by a triangle mesh of the object.

use nalgebra::Vector3;
use neat_core::{Camera, LineSegment2, Wireframe3d};
use std::error::Error;
use std::fs;
use std::path::Path;

/// Samples along an edge.
const SAMPLES: usize = 200;
/// What lies in front of a sample by less than this share of its distance is the
/// surface that carries the edge.
const OWN_SURFACE: f64 = 0.004;
/// Visible parts shorter than this, in pixels, are left out.
const MIN_LENGTH: f64 = 6.0;

/// Triangles in the world.
pub struct Mesh {
    triangles: Vec<[Vector3<f64>; 3]>,
}

impl Mesh {
    /// Reads vertices and faces of a Wavefront OBJ file.
    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let text =
            fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
        for line in text.lines() {
            let mut words = line.split_whitespace();
            match words.next() {
                Some("v") => {
                    let numbers: Vec<f64> =
                        words.take(3).map(str::parse).collect::<Result<_, _>>()?;
                    vertices.push(Vector3::from_column_slice(
                        numbers
                            .get(..3)
                            .ok_or("a vertex with less than 3 numbers")?,
                    ));
                }
                Some("f") => {
                    let corners = words
                        .map(|word| {
                            let index: usize =
                                word.split('/').next().unwrap_or_default().parse()?;
                            let vertex = index.checked_sub(1).and_then(|index| vertices.get(index));
                            vertex
                                .copied()
                                .ok_or_else(|| "a face names no vertex".into())
                        })
                        .collect::<Result<Vec<Vector3<f64>>, Box<dyn Error>>>()?;
                    triangles.extend(
                        corners
                            .windows(2)
                            .skip(1)
                            .map(|side| [corners[0], side[0], side[1]]),
                    );
                }
                _ => {}
            }
        }
        Ok(Self { triangles })
    }

    /// The visible parts of all edges within the image, with whether each end is
    /// a junction. Hiding is sampled; creases between coplanar faces do not occur
    /// in the truth.
    pub fn visible_parts(
        &self,
        wireframe: &Wireframe3d,
        camera: &Camera,
    ) -> Vec<(LineSegment2, [bool; 2])> {
        let mut parts = Vec::new();
        for edge in wireframe.segments() {
            let seen: Vec<bool> = (0..=SAMPLES)
                .map(|i| {
                    // The very ends lie on other faces too: a step inside them.
                    let t = (i as f64 / SAMPLES as f64).clamp(2e-3, 1.0 - 2e-3);
                    self.sees(camera, &edge.point_at(t))
                })
                .collect();
            let mut first = None;
            for i in 0..=SAMPLES + 1 {
                match (first, seen.get(i).copied().unwrap_or(false)) {
                    (None, true) => first = Some(i),
                    (Some(start), false) => {
                        let [a, b] = [start, i - 1].map(|i| {
                            camera
                                .project(&edge.point_at(i as f64 / SAMPLES as f64))
                                .pixel
                        });
                        let part = LineSegment2::new(a, b);
                        if part.length() >= MIN_LENGTH {
                            parts.push((part, [start == 0, i - 1 == SAMPLES]));
                        }
                        first = None;
                    }
                    _ => {}
                }
            }
        }
        parts
    }

    fn sees(&self, camera: &Camera, point: &Vector3<f64>) -> bool {
        let origin = camera.center_in_world;
        let offset = point - origin;
        let distance = offset.norm();
        let direction = offset / distance;
        let in_front = |hit: f64| hit < distance * (1.0 - OWN_SURFACE);
        !self
            .triangles
            .iter()
            .any(|triangle| intersect(&origin, &direction, triangle).is_some_and(in_front))
    }
}

/// Distance to a triangle along a ray, after Möller and Trumbore.
fn intersect(
    origin: &Vector3<f64>,
    direction: &Vector3<f64>,
    [a, b, c]: &[Vector3<f64>; 3],
) -> Option<f64> {
    let (ab, ac, offset) = (b - a, c - a, origin - a);
    let p = direction.cross(&ac);
    let q = offset.cross(&ab);
    let determinant = ab.dot(&p);
    let u = offset.dot(&p) / determinant;
    let v = direction.dot(&q) / determinant;
    let distance = ac.dot(&q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(distance)
}
