//! Faces and lines of a graph: junctions that lie in one plane because a chain
//! of corners does, and on one line because edges continue each other.
//!
//! Only what hangs together is compared. Among thousands of junctions many lie in
//! one plane by chance, and that is no regularity.

use crate::pulls::JunctionPull;
use crate::regularities::RegularitiesConfig;
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;

/// Two edges closer to one line than this, in degrees, span no plane.
const MIN_CORNER_IN_DEGREES: f64 = 10.0;
/// Junctions of a face: three lie in a plane anyway.
const MIN_JUNCTIONS_OF_FACE: usize = 4;
/// Junctions of a line: two lie on a line anyway.
const MIN_JUNCTIONS_OF_LINE: usize = 3;
/// Of a group that is curved, not flat, only a part would fit.
const MIN_FITTING_SHARE: f64 = 0.8;

/// Pulls towards the planes of faces.
pub(crate) fn coplanar_pulls(
    junctions: &[Vector3<f64>],
    pairs: &[[usize; 2]],
    information: &[Matrix3<f64>],
    config: &RegularitiesConfig,
) -> Vec<JunctionPull> {
    let neighbours = neighbours(junctions.len(), pairs);
    let mut corners: Vec<Corner> = Vec::new();
    // The corners at each end of an edge, by the end and the other end.
    let mut along: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
    let min_sine = MIN_CORNER_IN_DEGREES.to_radians().sin();
    for (apex, ends) in neighbours.iter().enumerate() {
        for (i, a) in ends.iter().enumerate() {
            for b in &ends[i + 1..] {
                let [to_a, to_b] =
                    [a, b].map(|end| (junctions[*end] - junctions[apex]).normalize());
                let normal = to_a.cross(&to_b);
                if normal.norm() > min_sine {
                    for end in [*a, *b] {
                        along.entry([apex, end]).or_default().push(corners.len());
                    }
                    corners.push(Corner {
                        junctions: [apex, *a, *b],
                        normal: normal.normalize(),
                    });
                }
            }
        }
    }
    let mut groups = Groups::new(corners.len());
    let max_sine = config.max_angle_in_degrees.to_radians().sin();
    for ([apex, end], here) in &along {
        let there = along.get(&[*end, *apex]).map_or(&[][..], Vec::as_slice);
        for (i, j) in here
            .iter()
            .flat_map(|i| there.iter().map(move |j| (*i, *j)))
        {
            if corners[i].normal.cross(&corners[j].normal).norm() < max_sine {
                groups.join(i, j);
            }
        }
    }
    groups
        .members()
        .flat_map(|group| {
            let members = group.iter().flat_map(|corner| corners[*corner].junctions);
            Flat::Plane.pulls(members.collect(), junctions, information, config)
        })
        .collect()
}

/// Pulls towards the lines of edges that continue each other.
pub(crate) fn collinear_pulls(
    junctions: &[Vector3<f64>],
    pairs: &[[usize; 2]],
    information: &[Matrix3<f64>],
    config: &RegularitiesConfig,
) -> Vec<JunctionPull> {
    let mut edges_at = vec![Vec::new(); junctions.len()];
    for (edge, [a, b]) in pairs.iter().enumerate() {
        edges_at[*a].push((edge, *b));
        edges_at[*b].push((edge, *a));
    }
    let mut groups = Groups::new(pairs.len());
    let min_cosine = config.max_angle_in_degrees.to_radians().cos();
    for (middle, edges) in edges_at.iter().enumerate() {
        for (i, (edge, a)) in edges.iter().enumerate() {
            for (other, b) in &edges[i + 1..] {
                let [to_a, to_b] =
                    [a, b].map(|end| (junctions[*end] - junctions[middle]).normalize());
                if to_a.dot(&to_b) < -min_cosine {
                    groups.join(*edge, *other);
                }
            }
        }
    }
    groups
        .members()
        .flat_map(|group| {
            let members = group.iter().flat_map(|edge| pairs[*edge]);
            Flat::Line.pulls(members.collect(), junctions, information, config)
        })
        .collect()
}

/// Two edges that meet, with the normal of their plane.
struct Corner {
    /// The junction where they meet, then their other ends.
    junctions: [usize; 3],
    normal: Vector3<f64>,
}

fn neighbours(junctions: usize, pairs: &[[usize; 2]]) -> Vec<Vec<usize>> {
    let mut neighbours = vec![Vec::new(); junctions];
    for [a, b] in pairs {
        neighbours[*a].push(*b);
        neighbours[*b].push(*a);
    }
    neighbours
}

/// What a group of junctions may lie on.
#[derive(Clone, Copy)]
enum Flat {
    Plane,
    Line,
}

impl Flat {
    /// Pulls for the junctions that fit, if enough do.
    fn pulls(
        self,
        mut members: Vec<usize>,
        junctions: &[Vector3<f64>],
        information: &[Matrix3<f64>],
        config: &RegularitiesConfig,
    ) -> Vec<JunctionPull> {
        members.sort_unstable();
        members.dedup();
        let least = match self {
            Self::Plane => MIN_JUNCTIONS_OF_FACE,
            Self::Line => MIN_JUNCTIONS_OF_LINE,
        };
        let all = members.len();
        if all < least {
            return Vec::new();
        }
        // Once with all, once with those that fit.
        for _ in 0..2 {
            let (anchor, across) = self.fit(&members, junctions);
            members.retain(|member| {
                let offset = across * (junctions[*member] - anchor);
                is_within_noise(&offset, &information[*member], config)
            });
            if members.len() < least || (members.len() as f64) < MIN_FITTING_SHARE * all as f64 {
                return Vec::new();
            }
        }
        let (anchor, across) = self.fit(&members, junctions);
        members
            .into_iter()
            .map(|junction| JunctionPull {
                junction,
                anchor,
                across,
                weight: config.sigma_distance.recip(),
            })
            .collect()
    }

    /// A point on it, and the projection on what is across it.
    fn fit(self, members: &[usize], junctions: &[Vector3<f64>]) -> (Vector3<f64>, Matrix3<f64>) {
        let count = members.len() as f64;
        let mean = members.iter().map(|m| junctions[*m]).sum::<Vector3<f64>>() / count;
        let scatter: Matrix3<f64> = members
            .iter()
            .map(|member| junctions[*member] - mean)
            .map(|offset| offset * offset.transpose())
            .sum();
        let eigen = scatter.symmetric_eigen();
        let across = match self {
            Self::Plane => {
                let normal = eigen.eigenvectors.column(eigen.eigenvalues.imin());
                normal * normal.transpose()
            }
            Self::Line => {
                let direction = eigen.eigenvectors.column(eigen.eigenvalues.imax());
                Matrix3::identity() - direction * direction.transpose()
            }
        };
        (mean, across)
    }
}

/// Whether a junction may be this far off by noise of one pixel.
fn is_within_noise(
    offset: &Vector3<f64>,
    information: &Matrix3<f64>,
    config: &RegularitiesConfig,
) -> bool {
    let distance = offset.norm();
    let Some(covariance) = information.try_inverse() else {
        return false;
    };
    let direction = offset.try_normalize(0.0).unwrap_or_default();
    let sigma = direction.dot(&(covariance * direction)).max(0.0).sqrt();
    distance <= config.max_distance && distance <= config.max_sigmas * sigma
}

/// Disjoint sets of indices.
struct Groups {
    parent: Vec<usize>,
}

impl Groups {
    fn new(count: usize) -> Self {
        Self {
            parent: (0..count).collect(),
        }
    }

    /// The lowest index of the group.
    fn root(&mut self, mut index: usize) -> usize {
        while self.parent[index] != index {
            self.parent[index] = self.parent[self.parent[index]];
            index = self.parent[index];
        }
        index
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b);
    }

    /// The groups, by their lowest index.
    fn members(mut self) -> impl Iterator<Item = Vec<usize>> {
        let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for index in 0..self.parent.len() {
            members.entry(self.root(index)).or_default().push(index);
        }
        members.into_values()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scenes::cube;

    fn named(pulls: &[JunctionPull]) -> Vec<usize> {
        pulls.iter().map(|pull| pull.junction).collect()
    }

    #[test]
    fn a_cube_has_six_faces_and_a_lifted_corner_breaks_three() {
        let (mut junctions, edges) = cube();
        let information = vec![Matrix3::identity() * 1e6; 8];
        let config = RegularitiesConfig::default();
        let pulls = coplanar_pulls(&junctions, &edges, &information, &config);
        assert_eq!(pulls.len(), 6 * 4);
        for pull in &pulls {
            let offset = pull.across * (junctions[pull.junction] - pull.anchor);
            assert!(offset.norm() < 1e-12);
        }
        // Two degrees, much more than noise.
        junctions[7] += Vector3::repeat(0.035);
        let pulls = coplanar_pulls(&junctions, &edges, &information, &config);
        assert_eq!(pulls.len(), 3 * 4);
        assert!(!named(&pulls).contains(&7));
    }

    #[test]
    fn edges_that_continue_each_other_make_a_line() {
        let at = |x: f64, y: f64| Vector3::new(x, y, 0.2);
        let straight = [at(0.0, 0.0), at(0.3, 0.0), at(0.5, 0.0005), at(0.9, 0.0)];
        let edges = [[0, 1], [1, 2], [2, 3]];
        let information = vec![Matrix3::identity() * 1e6; 4];
        let config = RegularitiesConfig::default();
        let pulls = collinear_pulls(&straight, &edges, &information, &config);
        assert_eq!(named(&pulls), [0, 1, 2, 3]);
        let bent = [at(0.0, 0.0), at(0.3, 0.0), at(0.5, 0.01), at(0.9, 0.0)];
        assert!(collinear_pulls(&bent, &edges, &information, &config).is_empty());
        // Apart, by chance on one line.
        let apart = [[0, 1], [2, 3]];
        assert!(collinear_pulls(&straight, &apart, &information, &config).is_empty());
    }
}
