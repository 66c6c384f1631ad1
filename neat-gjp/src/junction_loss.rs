//! Losses of matched junctions (paper eq. 6, published reductions).

use burn::tensor::{Int, Tensor, TensorData};

/// Junctions paired by an assignment: `targets[k]` belongs to
/// `junction_of_target[k]`.
#[derive(Clone, Debug, Default)]
pub struct MatchedJunctions {
    /// Target positions `[K]` in the world.
    pub targets: Vec<[f32; 3]>,
    /// Their calibrated projections `[K]`; empty where the 2D term is off.
    pub targets_calibrated: Vec<[f32; 2]>,
    /// Index of the global junction of each target.
    pub junction_of_target: Vec<usize>,
}

/// The two junction terms.
#[derive(Clone, Debug)]
pub struct JunctionLoss {
    /// Mean over pairs of the L1 distance in the world, `[1]`.
    pub in_world: Tensor<1>,
    /// Mean over pairs of the L1 distance of the calibrated projections, `[1]`,
    /// where those were given.
    pub calibrated: Option<Tensor<1>>,
}

/// Loss of the global `junctions` `[N, 3]` (and their calibrated projections
/// `[N, 2]`) against their matched targets. `None` where nothing was matched.
pub fn junction_loss(
    junctions: Tensor<2>,
    calibrated: Option<Tensor<2>>,
    matched: &MatchedJunctions,
) -> Option<JunctionLoss> {
    let pairs = matched.targets.len();
    if pairs == 0 {
        return None;
    }
    let options =
        burn::tensor::TensorCreationOptions::new(junctions.device()).with_dtype(junctions.dtype());
    let indices: Vec<i64> = matched
        .junction_of_target
        .iter()
        .map(|j| *j as i64)
        .collect();
    let indices =
        Tensor::<1, Int>::from_data(TensorData::new(indices, [pairs]), &junctions.device());
    let l1 = |predicted: Tensor<2>, target: TensorData| {
        let target = Tensor::<2>::from_data(target, options.clone());
        (predicted - target).abs().sum_dim(1).mean()
    };
    let in_world = l1(
        junctions.select(0, indices.clone()),
        TensorData::new(matched.targets.as_flattened().to_vec(), [pairs, 3]),
    );
    let calibrated = match calibrated {
        Some(projected) if matched.targets_calibrated.len() == pairs => Some(l1(
            projected.select(0, indices),
            TensorData::new(
                matched.targets_calibrated.as_flattened().to_vec(),
                [pairs, 2],
            ),
        )),
        _ => None,
    };
    Some(JunctionLoss {
        in_world,
        calibrated,
    })
}
