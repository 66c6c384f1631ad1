//! The planar parts of a mesh: what faces can be found of.

use crate::total::total;
use crate::triangle::{Triangle, area, normal};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// Cosine of the angle by which a triangle may be turned against its patch: 1°.
const FLAT: f64 = 0.999_848;

/// A planar part of a mesh.
pub(super) struct PlanarPatch {
    /// A point of its plane …
    pub point: Vector3<f64>,
    /// … and the normal of this, of length 1.
    pub normal: Vector3<f64>,
    pub triangles: Vec<Triangle>,
}

impl PlanarPatch {
    /// Of a point over the plane.
    pub fn height(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(&(point - self.point))
    }
}

/// Patches of at least `min_area`: connected triangles within `thickness` of the plane of the
/// largest of them.
pub(super) fn planar_patches(
    triangles: &[Triangle],
    min_area: f64,
    thickness: f64,
) -> Vec<PlanarPatch> {
    let neighbours = neighbours(triangles);
    let mut order: Vec<usize> = (0..triangles.len()).collect();
    order.sort_by(|a, b| {
        let areas = [a, b].map(|triangle| area(&triangles[*triangle]));
        areas[1].total_cmp(&areas[0]).then(a.cmp(b))
    });
    let mut taken = vec![false; triangles.len()];
    let mut patches = Vec::new();
    for seed in order {
        let Some(up) = normal(&triangles[seed]).filter(|_| !taken[seed]) else {
            continue;
        };
        let belongs = |triangle: &Triangle| {
            let near =
                |corner: &Vector3<f64>| up.dot(&(corner - triangles[seed][0])).abs() <= thickness;
            normal(triangle).is_some_and(|n| n.dot(&up).abs() >= FLAT) && triangle.iter().all(near)
        };
        let mut patch = vec![seed];
        taken[seed] = true;
        let mut next = 0;
        while next < patch.len() {
            for other in &neighbours[patch[next]] {
                if !taken[*other] && belongs(&triangles[*other]) {
                    taken[*other] = true;
                    patch.push(*other);
                }
            }
            next += 1;
        }
        let patch: Vec<Triangle> = (patch.into_iter())
            .map(|triangle| triangles[triangle])
            .collect();
        if total(patch.iter().map(area)) >= min_area {
            patches.push(PlanarPatch {
                point: triangles[seed][0],
                normal: up,
                triangles: patch,
            });
        }
    }
    patches
}

/// For each triangle those that share a side with it. Corners in the same place are one: programs
/// write them once for every normal.
fn neighbours(triangles: &[Triangle]) -> Vec<Vec<usize>> {
    // Adding zero makes -0 and 0 the same.
    let key = |corner: &Vector3<f64>| [corner.x, corner.y, corner.z].map(|x| (x + 0.0).to_bits());
    let mut at_side: BTreeMap<[[u64; 3]; 2], Vec<usize>> = BTreeMap::new();
    for (index, corners) in triangles.iter().enumerate() {
        for side in [[0, 1], [1, 2], [2, 0]] {
            let mut ends = side.map(|corner| key(&corners[corner]));
            ends.sort_unstable();
            at_side.entry(ends).or_default().push(index);
        }
    }
    let mut neighbours = vec![Vec::new(); triangles.len()];
    for shared in at_side.values() {
        for one in shared {
            neighbours[*one].extend(shared.iter().filter(|other| *other != one));
        }
    }
    neighbours
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::triangle_mesh::TriangleMesh;
    use crate::triangle_mesh::tests::cube;

    #[test]
    fn patches_end_where_the_surface_turns_and_small_ones_do_not_count() {
        let cube = cube().corners();
        let patches = planar_patches(&cube, 0.99, 0.001);
        assert_eq!(patches.len(), 6);
        assert!(patches.iter().all(|patch| patch.triangles.len() == 2));
        assert!(planar_patches(&cube, 1.01, 0.001).is_empty());
        // Turned by 6° at a time, a wall is not flat, whoever calls its pieces neighbours.
        let corner = |k: usize, z: f64| {
            let (sine, cosine) = (k as f64 * 6.0_f64.to_radians()).sin_cos();
            Vector3::new(cosine, sine, z)
        };
        let bent = TriangleMesh {
            vertices: (0..16)
                .flat_map(|k| [corner(k, 0.0), corner(k, 1.0)])
                .collect(),
            triangles: (0..15)
                .map(|k| 2 * k)
                .flat_map(|k| [[k, k + 1, k + 2], [k + 2, k + 1, k + 3]])
                .collect(),
        };
        assert!(planar_patches(&bent.corners(), 0.2, 0.001).is_empty());
        assert_eq!(planar_patches(&bent.corners(), 0.1, 0.001).len(), 15);
    }
}
