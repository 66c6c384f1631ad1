//! What the edges that meet in a junction say about it and about each other.

use nalgebra::Vector3;
use neat_core::Wireframe3d;

/// Sine of the angle out of a plane, or off a line, from which on directions leave it: 15°.
/// Short edges of photographs are turned by less.
const MIN_SINE: f64 = 0.26;

/// How the edges of a junction meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JunctionType {
    /// No edge or one: nothing is known to go on from here.
    End,
    /// One edge or more end on another one, which goes straight on: mostly where one thing
    /// stands before or on another.
    Tee,
    /// Edges of one plane: two that meet under an angle, or lines that cross.
    Planar,
    /// Three edges or more that are not in one plane: a corner of a solid.
    Corner,
}

/// The type of every junction. Edges without length, or with an end that is no junction, do
/// not count; edges must be cut where others end on them.
///
/// ```
/// use nalgebra::Vector3;
/// use neat_wireframe::Wireframe3d;
/// use neat_wireframe::kinds::{JunctionType, junction_types};
///
/// let (o, axis) = (Vector3::zeros(), Vector3::<f64>::ith);
/// let axes = Wireframe3d {
///     junctions: vec![o, axis(0, 1.0), axis(1, 1.0), axis(2, 1.0)],
///     edges: vec![[0, 1], [0, 2], [3, 0]],
/// };
/// use JunctionType::{Corner, End};
/// assert_eq!(junction_types(&axes), [Corner, End, End, End]);
/// ```
pub fn junction_types(wireframe: &Wireframe3d) -> Vec<JunctionType> {
    let mut leaving: Vec<Vec<Vector3<f64>>> = vec![Vec::new(); wireframe.junctions.len()];
    for &[a, b] in &wireframe.edges {
        let ends = Option::zip(wireframe.junctions.get(a), wireframe.junctions.get(b));
        if let Some(direction) = ends.and_then(|(a, b)| (b - a).try_normalize(0.0)) {
            leaving[a].push(direction);
            leaving[b].push(-direction);
        }
    }
    leaving.iter().map(|edges| junction_type(edges)).collect()
}

fn junction_type(leaving: &[Vector3<f64>]) -> JunctionType {
    let pairs = || (0..leaving.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let is_corner = pairs().any(|(i, j)| {
        let normal = leaving[i].cross(&leaving[j]);
        leaving[..j].iter().any(|k| normal.dot(k).abs() >= MIN_SINE)
    });
    let straight = pairs().filter(|&(i, j)| {
        leaving[i].dot(&leaving[j]) < 0.0 && leaving[i].cross(&leaving[j]).norm() < MIN_SINE
    });
    match leaving.len() {
        0 | 1 => JunctionType::End,
        _ if is_corner => JunctionType::Corner,
        3.. if straight.count() == 1 => JunctionType::Tee,
        _ => JunctionType::Planar,
    }
}

/// For every edge the share of its ends at which no other edge is that `is_there`: 0, a half or 1.
pub(super) fn free_ends(wireframe: &Wireframe3d, is_there: &[bool]) -> Vec<f64> {
    let mut degrees = vec![0; wireframe.junctions.len()];
    for (ends, is_there) in wireframe.edges.iter().zip(is_there) {
        for end in ends {
            degrees[*end] += usize::from(*is_there);
        }
    }
    let free = |(ends, is_there): (&[usize; 2], &bool)| {
        let own = usize::from(*is_there);
        let free = ends.iter().filter(|end| degrees[**end] == own).count();
        free as f64 / 2.0
    };
    wireframe.edges.iter().zip(is_there).map(free).collect()
}

/// For every edge the sine of the largest angle between two planes that it spans with edges
/// it meets: 0 within a face, 1 where two faces meet at right angles. `directions` are those
/// of the edges.
pub(super) fn leaves_plane(
    wireframe: &Wireframe3d,
    directions: &[Option<Vector3<f64>>],
) -> Vec<f64> {
    let mut at: Vec<Vec<usize>> = vec![Vec::new(); wireframe.junctions.len()];
    for (edge, ends) in wireframe.edges.iter().enumerate() {
        for &end in ends {
            at[end].push(edge);
        }
    }
    let of_edge = |(edge, ends): (usize, &[usize; 2])| {
        let Some(own) = directions[edge] else {
            return 0.0;
        };
        let neighbours = ends
            .iter()
            .flat_map(|end| &at[*end])
            .filter(|other| **other != edge);
        let across: Vec<Vector3<f64>> = neighbours
            .filter_map(|other| {
                let direction = directions[*other]?;
                // What goes straight on spans no plane.
                (direction - own * own.dot(&direction)).try_normalize(MIN_SINE)
            })
            .collect();
        let pairs = (0..across.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
        let sines = pairs.map(|(i, j)| across[i].cross(&across[j]).norm());
        sines.fold(0.0, f64::max).min(1.0)
    };
    wireframe.edges.iter().enumerate().map(of_edge).collect()
}
