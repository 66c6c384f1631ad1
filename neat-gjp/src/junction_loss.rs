//! Losses of matched junctions (paper eq. 6, published reductions), and the way from
//! rendered segments to them.

use crate::candidates::{
    CandidateConfig, JunctionView, MatchingConfig, RenderedSegment, matching_cost,
};
use burn::tensor::{Int, Tensor, TensorData};
use nalgebra::Vector3;
use neat_core::Camera;
use neat_core::assignment::{AssignmentError, assign};
use neat_tensor::cameras::{RayCameras, project_calibrated};

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

/// How rendered ends pull at global junctions (paper §4.2).
#[derive(Clone, Copy, Debug)]
pub struct JunctionMatching<'a> {
    /// How ends become local junctions.
    pub candidates: &'a CandidateConfig,
    /// What pairs of local and global junctions cost.
    pub matching: &'a MatchingConfig,
    /// Whether the loss in the image is wanted.
    pub in_image: bool,
    /// The views that [`RenderedSegment::view`] speaks of.
    pub views: &'a [JunctionView<'a>],
}

impl JunctionMatching<'_> {
    /// Local junctions of rendered `segments`, matched with the `global` ones `[N, 3]`,
    /// which the host knows as `global_in_world`: the number of pairs, and their loss if
    /// there are any.
    ///
    /// The loss in the image needs a view per junction: it is that of segments from one
    /// view (as published), and rests where they are from many.
    ///
    /// # Errors
    /// If rendered ends are so far out that they cannot be matched.
    pub fn loss(
        &self,
        segments: &[RenderedSegment],
        global: Tensor<2>,
        global_in_world: &[[f32; 3]],
    ) -> Result<(usize, Option<JunctionLoss>), AssignmentError> {
        let local = self.candidates.local_junctions(segments, self.views)?;
        if local.is_empty() {
            return Ok((0, None));
        }
        let local_in_world: Vec<[f32; 3]> = local.iter().map(|l| l.in_world).collect();
        let camera = self.common_camera(segments);
        let (local_calibrated, global_calibrated, weight_2d) = match camera {
            Some(camera) => (
                calibrated(camera, &local_in_world),
                calibrated(camera, global_in_world),
                self.matching.weight_2d,
            ),
            None => (Vec::new(), Vec::new(), 0.0),
        };
        let cost = matching_cost(
            &local_in_world,
            &local_calibrated,
            global_in_world,
            &global_calibrated,
            weight_2d,
            self.matching.norm,
        );
        let pairs = assign(&cost, local.len(), global_in_world.len())?;
        let mut matched = MatchedJunctions::default();
        for (l, g) in pairs.pairs() {
            matched.targets.push(local_in_world[l]);
            matched.junction_of_target.push(g);
            if camera.is_some() {
                matched.targets_calibrated.push(local_calibrated[l]);
            }
        }
        let projected = camera.map(|camera| {
            let junctions = global.dims()[0];
            let cameras = RayCameras::new(std::iter::repeat_n(camera, junctions), &global.device());
            let twice = Tensor::cat(vec![global.clone(), global.clone()], 1);
            project_calibrated(twice, &cameras).narrow(1, 0, 2)
        });
        let pairs = matched.targets.len();
        Ok((pairs, junction_loss(global, projected, &matched)))
    }

    /// The camera of all segments, if the image plays a part and they have one in common.
    fn common_camera(&self, segments: &[RenderedSegment]) -> Option<&Camera> {
        let view = segments.first()?.view;
        let plays_a_part = self.in_image || self.matching.weight_2d > 0.0;
        let in_common = segments.iter().all(|segment| segment.view == view);
        (plays_a_part && in_common).then(|| self.views[view].camera)
    }
}

/// Where points of the world are in the image, calibrated.
fn calibrated(camera: &Camera, points: &[[f32; 3]]) -> Vec<[f32; 2]> {
    let project = |point: &[f32; 3]| {
        let point = Vector3::from(*point).map(f64::from);
        camera.project(&point).calibrated.map(|c| c as f32).into()
    };
    points.iter().map(project).collect()
}
