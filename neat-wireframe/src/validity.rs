//! What every wireframe must fulfil before it is measured or written.

use nalgebra::Vector3;

/// What is wrong with a wireframe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum WireframeFlaw {
    /// A junction is NaN or infinite.
    #[error("junction {junction} is not a finite point")]
    NonFiniteJunction {
        /// Index of the junction.
        junction: usize,
    },
    /// An edge names a junction that does not exist.
    #[error("edge {edge} joins junctions {ends:?}, but there are only {junctions} junctions")]
    EdgeOutOfRange {
        /// Index of the edge.
        edge: usize,
        /// The junctions it names.
        ends: [usize; 2],
        /// How many junctions there are.
        junctions: usize,
    },
}

/// Checks that all junctions are finite and that all edges join existing ones.
///
/// # Errors
/// The first flaw found, junctions first.
pub fn check_wireframe(
    junctions: &[Vector3<f64>],
    edges: &[[usize; 2]],
) -> Result<(), WireframeFlaw> {
    if let Some(junction) = junctions.iter().position(|p| !is_finite(p)) {
        return Err(WireframeFlaw::NonFiniteJunction { junction });
    }
    let leads_nowhere = |ends: &[usize; 2]| ends.iter().any(|end| *end >= junctions.len());
    match edges.iter().position(leads_nowhere) {
        Some(edge) => Err(WireframeFlaw::EdgeOutOfRange {
            edge,
            ends: edges[edge],
            junctions: junctions.len(),
        }),
        None => Ok(()),
    }
}

/// Whether all coordinates of a point are finite.
pub(crate) fn is_finite(point: &Vector3<f64>) -> bool {
    point.iter().all(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flaws_are_named() {
        let junctions = [Vector3::zeros(), Vector3::new(0.0, f64::INFINITY, 0.0)];
        assert_eq!(check_wireframe(&[], &[]), Ok(()));
        assert_eq!(check_wireframe(&junctions[..1], &[[0, 0]]), Ok(()));
        assert_eq!(
            check_wireframe(&junctions, &[[0, 1]]),
            Err(WireframeFlaw::NonFiniteJunction { junction: 1 })
        );
        assert_eq!(
            check_wireframe(&junctions[..1], &[[0, 0], [0, 1]]),
            Err(WireframeFlaw::EdgeOutOfRange {
                edge: 1,
                ends: [0, 1],
                junctions: 1
            })
        );
    }
}
