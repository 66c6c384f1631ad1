//! Why the poses of single views do not fit their images.

use crate::agreement::Agreement;
use crate::explanations::focal_factors;
use crate::hypothesis::Hypothesis;
use crate::pose_diagnosis::Diagnosis;
use neat_core::Camera;

/// What is wrong with one view.
pub(crate) enum ViewFault {
    /// Its image fits the pose of this view.
    PoseOf(usize),
    /// Its camera alone is to be changed like this.
    Camera(Hypothesis),
}

impl Diagnosis<'_> {
    /// What would make the image of a bad view fit at least half as well as those of the
    /// others.
    pub fn fault_of(
        &self,
        view: usize,
        bad: &[usize],
        trusted: &[bool],
        rest: &Agreement,
    ) -> Option<ViewFault> {
        let mut trusted = trusted.to_vec();
        trusted[view] = true;
        let share = |camera: Camera| {
            let mut cameras = self.cameras.clone();
            cameras[view] = camera;
            self.evidence().agreement(&cameras, &trusted).per_view[view].share()
        };
        let own = self.cameras[view];
        let others = bad.iter().filter(|&&other| other != view);
        let with_pose_of = others.map(|&other| {
            let pose = &self.cameras[other];
            let camera = Camera {
                world_from_camera: pose.world_from_camera,
                center_in_world: pose.center_in_world,
                ..own
            };
            (ViewFault::PoseOf(other), camera)
        });
        let turned = (1..4).map(Hypothesis::TurnedImages);
        let focal = focal_factors().filter(|factor| *factor != 1.0);
        let focal = focal.map(Hypothesis::FocalScale);
        let changed = turned.chain(focal).map(|hypothesis| {
            let camera = hypothesis.cameras(&[own], &[""])[0];
            (ViewFault::Camera(hypothesis), camera)
        });
        let mut best = (0.0, None);
        for (fault, camera) in with_pose_of.chain(changed) {
            let share = share(camera);
            if share > best.0 {
                best = (share, Some(fault));
            }
        }
        best.1.filter(|_| best.0 > 0.5 * rest.share())
    }
}
