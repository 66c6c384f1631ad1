//! Refinement of learned junctions by the surface (paper §4.3, eq. 7).

use crate::SignedDistance;
use crate::validity::is_finite;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// How junctions are pulled onto the surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JunctionRefinementConfig {
    /// Take the step of eq. 7. Without it junctions are only measured and sorted.
    pub enabled: bool,
    /// Drop junctions that lie farther than this from the surface after the
    /// step, in world units. The paper says 0.05; the published code computes
    /// this test and never applies it, hence none here.
    pub max_abs_sdf: Option<f64>,
}

impl Default for JunctionRefinementConfig {
    fn default() -> Self {
        Self {
            enabled: true,
            max_abs_sdf: None,
        }
    }
}

/// A junction after the step, with its signed distance there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RefinedJunction {
    /// Where it lies now, in the world.
    pub position: Vector3<f64>,
    /// Signed distance at `position`.
    pub sdf: f64,
}

/// Why junctions could not be refined.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RefinementError {
    /// A junction is NaN or infinite.
    #[error(
        "junction {junction} is not a finite point: the training has diverged, lower the learning rate"
    )]
    NonFiniteJunction {
        /// Index of the junction.
        junction: usize,
    },
    /// The surface answered NaN or infinity.
    #[error(
        "the signed distance at junction {junction} is not finite: the training has diverged, lower the learning rate"
    )]
    NonFiniteSurface {
        /// Index of the junction.
        junction: usize,
    },
    /// The surface did not answer once per point.
    #[error("the surface was asked for {asked} signed distances and gave {answered}")]
    AnswerCount {
        /// How many points were asked for.
        asked: usize,
        /// How many answers came.
        answered: usize,
    },
}

/// One step `J − d(J) ∇d(J)` for every junction, then sorted by signed distance,
/// ascending, as the published code does.
///
/// The gradient is used as it is, not normalised.
///
/// # Errors
/// If a junction, a distance or a gradient is not finite, or the surface does
/// not give one answer per point.
pub fn refine_junctions(
    junctions: &[Vector3<f64>],
    surface: &(impl SignedDistance + ?Sized),
    config: &JunctionRefinementConfig,
) -> Result<Vec<RefinedJunction>, RefinementError> {
    if let Some(junction) = junctions.iter().position(|j| !is_finite(j)) {
        return Err(RefinementError::NonFiniteJunction { junction });
    }
    let positions = if config.enabled {
        step(junctions, surface)?
    } else {
        junctions.to_vec()
    };
    let distances = surface.sdf(&positions);
    check_count(positions.len(), distances.len())?;
    if let Some(junction) = distances.iter().position(|sdf| !sdf.is_finite()) {
        return Err(RefinementError::NonFiniteSurface { junction });
    }
    let mut refined: Vec<RefinedJunction> = positions
        .into_iter()
        .zip(distances)
        .map(|(position, sdf)| RefinedJunction { position, sdf })
        .filter(|junction| {
            config
                .max_abs_sdf
                .is_none_or(|max| junction.sdf.abs() <= max)
        })
        .collect();
    refined.sort_by(|a, b| a.sdf.total_cmp(&b.sdf));
    Ok(refined)
}

fn step(
    junctions: &[Vector3<f64>],
    surface: &(impl SignedDistance + ?Sized),
) -> Result<Vec<Vector3<f64>>, RefinementError> {
    let answers = surface.sdf_and_gradient(junctions);
    check_count(junctions.len(), answers.len())?;
    junctions
        .iter()
        .zip(answers)
        .enumerate()
        .map(|(junction, (position, (sdf, gradient)))| {
            let moved = position - gradient * sdf;
            if is_finite(&moved) {
                Ok(moved)
            } else {
                Err(RefinementError::NonFiniteSurface { junction })
            }
        })
        .collect()
}

fn check_count(asked: usize, answered: usize) -> Result<(), RefinementError> {
    if asked == answered {
        Ok(())
    } else {
        Err(RefinementError::AnswerCount { asked, answered })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `scale · (|x| − 1)`: the unit sphere, with a gradient of norm `scale`.
    struct Sphere {
        scale: f64,
    }

    impl SignedDistance for Sphere {
        fn sdf(&self, points: &[Vector3<f64>]) -> Vec<f64> {
            points
                .iter()
                .map(|p| self.scale * (p.norm() - 1.0))
                .collect()
        }

        fn sdf_and_gradient(&self, points: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
            let gradients = points.iter().map(|p| p.normalize() * self.scale);
            self.sdf(points).into_iter().zip(gradients).collect()
        }
    }

    struct Silent;

    impl SignedDistance for Silent {
        fn sdf(&self, _: &[Vector3<f64>]) -> Vec<f64> {
            Vec::new()
        }

        fn sdf_and_gradient(&self, _: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
            Vec::new()
        }
    }

    #[test]
    fn a_true_distance_lands_on_the_surface_in_one_step() {
        let junctions = [Vector3::new(0.0, 1.4, 0.0), Vector3::new(0.3, 0.0, 0.4)];
        let refined =
            refine_junctions(&junctions, &Sphere { scale: 1.0 }, &Default::default()).unwrap();
        assert!(
            refined
                .iter()
                .all(|j| (j.position.norm() - 1.0).abs() < 1e-12)
        );
    }

    #[test]
    fn the_gradient_is_not_normalised_and_the_result_is_sorted() {
        let junctions = [Vector3::new(2.0, 0.0, 0.0), Vector3::new(0.0, 0.0, 0.6)];
        let refined =
            refine_junctions(&junctions, &Sphere { scale: 0.5 }, &Default::default()).unwrap();
        // From 2 by 0.5·1·0.5 inwards, from 0.6 by 0.5·0.4·0.5 outwards.
        assert!((refined[0].position.z - 0.7).abs() < 1e-12);
        assert!((refined[1].position.x - 1.75).abs() < 1e-12);
        assert!(refined[0].sdf < 0.0 && refined[1].sdf > 0.0);

        let close = JunctionRefinementConfig {
            max_abs_sdf: Some(0.2),
            ..Default::default()
        };
        assert_eq!(
            refine_junctions(&junctions, &Sphere { scale: 0.5 }, &close).unwrap(),
            refined[..1]
        );
    }

    #[test]
    fn without_the_step_junctions_stay_where_they_are() {
        let config = JunctionRefinementConfig {
            enabled: false,
            ..Default::default()
        };
        let junctions = [Vector3::new(2.0, 0.0, 0.0)];
        let refined = refine_junctions(&junctions, &Sphere { scale: 1.0 }, &config).unwrap();
        assert_eq!(refined[0].position, junctions[0]);
        assert_eq!(refined[0].sdf, 1.0);
    }

    #[test]
    fn bad_input_is_an_error_and_none_is_none() {
        let config = JunctionRefinementConfig::default();
        let sphere = Sphere { scale: 1.0 };
        assert_eq!(refine_junctions(&[], &sphere, &config), Ok(vec![]));
        let nan = [Vector3::zeros(), Vector3::new(0.0, f64::NAN, 0.0)];
        assert_eq!(
            refine_junctions(&nan, &sphere, &config),
            Err(RefinementError::NonFiniteJunction { junction: 1 })
        );
        // The sphere's gradient has no direction at its centre.
        assert_eq!(
            refine_junctions(&nan[..1], &sphere, &config),
            Err(RefinementError::NonFiniteSurface { junction: 0 })
        );
        assert_eq!(
            refine_junctions(&nan[..1], &Silent, &config),
            Err(RefinementError::AnswerCount {
                asked: 1,
                answered: 0
            })
        );
    }
}
