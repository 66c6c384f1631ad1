//! Poses and intrinsics against the images: if they disagree, why.

use crate::agreement::Agreement;
use crate::evidence::{Evidence, Gathered, evenly};
use crate::examination::{Check, Finding, Level, Repair, counted, median, percent};
use crate::hypothesis::{Hypothesis, PoseOrder};
use crate::point_transfer::{known_points, transfer_gain};
use crate::silhouettes::{Silhouette, covered_share, fit_of};
use neat_core::layout::{CameraAxes, PoseConvention};
use neat_core::{Camera, Scene};
use rayon::prelude::*;

/// Another explanation has to score this many times as much as what is given.
pub(crate) const CLEARLY: f64 = 1.3;
/// Views among whose corners better cameras are searched for.
const SEARCHED_VIEWS: usize = 60;

/// Points must be met more than by chance by so many standard deviations: with right poses they
/// are by 8 to 70 on photographs of bricks and leaves, with wrong ones seldom by more than 2.
const SIGNIFICANT: f64 = 4.0;
/// In a look at some of the views, one with less evidence than this share of what the others
/// have looks elsewhere than they do, and all that it has may be false. On photographs of a house
/// from all sides such views have 4 to 21 %, neighbours of three scenes at least 33 %.
const MIN_TOLD: f64 = 0.25;
/// So many views speak for the others.
const ASKED_VIEWS: usize = 8;
/// In the hull of fewer silhouettes than these, judged, what any cameras see may have a place.
const MIN_SILHOUETTES: usize = 6;
/// Right cameras explain at least this share of the silhouettes …
const MIN_COVERED: f64 = 0.95;
/// … and by so much more than the same cameras in another order.
const MIN_DIFFERENCE: f64 = 0.05;

/// A scene, what its images show, and how its poses were read.
pub(crate) struct Diagnosis<'a> {
    pub scene: &'a Scene,
    pub gathered: &'a Gathered,
    /// In the frame of the files: a pose is inverted about their origin.
    pub cameras: Vec<Camera>,
    pub names: Vec<&'a str>,
    /// What the scene was read with.
    pub read_with: Repair,
    /// The axes out of which its reader turned the cameras.
    pub file_axes: CameraAxes,
    /// The poses could only be read by mirroring the world.
    pub mirrored: bool,
}

/// A changed set of cameras, and how it does.
pub(crate) struct Candidate {
    pub hypothesis: Hypothesis,
    pub cameras: Vec<Camera>,
    pub agreement: Agreement,
}

/// What a kind of evidence can show.
pub(crate) struct Limits {
    /// Fewer pieces than this show nothing.
    min_total: usize,
    /// Fewer than so many for each view may all be false.
    min_per_view: usize,
    /// Shares from here on are those of right cameras.
    pub good_share: f64,
    /// Shares below are those of wrong cameras.
    pub bad_share: f64,
}

impl Limits {
    fn of(evidence: &Evidence, views: usize) -> Self {
        match evidence {
            Evidence::Tracks { .. } => Self {
                min_total: 60,
                // Walls of bricks from places 35° apart make 7 false ones.
                min_per_view: 10,
                good_share: 0.35,
                bad_share: 0.15,
            },
            // Curved things have few real corners among those that are found.
            Evidence::Corners(_) => Self {
                min_total: 5 * views.clamp(8, SEARCHED_VIEWS / 2),
                min_per_view: 0,
                good_share: 0.15,
                bad_share: 0.05,
            },
        }
    }
}

fn in_frame_of_files(scene: &Scene, camera: Camera) -> Camera {
    let original_from_world = scene.original_from_world.without_mirroring();
    Camera {
        center_in_world: original_from_world.apply(&camera.center_in_world),
        ..camera
    }
}

impl<'a> Diagnosis<'a> {
    pub fn new(
        scene: &'a Scene,
        gathered: &'a Gathered,
        read_with: Repair,
        file_axes: CameraAxes,
        mirrored: bool,
    ) -> Self {
        Self {
            scene,
            gathered,
            cameras: (scene.views.iter())
                .map(|view| in_frame_of_files(scene, view.camera))
                .collect(),
            names: scene.views.iter().map(|view| view.name.as_str()).collect(),
            read_with,
            file_axes,
            mirrored,
        }
    }

    pub fn read_as(&self) -> PoseConvention {
        self.read_with.pose_convention.unwrap_or_default()
    }

    pub fn evidence(&self) -> &Evidence {
        &self.gathered.evidence
    }

    /// Trusts all views whose images were looked at.
    fn all_trusted(&self) -> Vec<bool> {
        self.trusted(usize::MAX)
    }

    /// Trusts at most so many of them.
    fn trusted(&self, limit: usize) -> Vec<bool> {
        let mut trusted = vec![false; self.scene.views.len()];
        for index in evenly(self.gathered.views.len(), limit) {
            trusted[self.gathered.views[index]] = true;
        }
        trusted
    }

    /// How well the given cameras explain what the `trusted` views show.
    pub fn given(&self, trusted: &[bool]) -> Agreement {
        self.evidence().agreement(&self.cameras, trusted)
    }

    /// How well the given cameras explain everything.
    pub fn all_given(&self) -> Agreement {
        self.given(&self.all_trusted())
    }

    pub fn limits(&self) -> Limits {
        Limits::of(self.evidence(), self.gathered.views.len())
    }

    /// Whether the given cameras explain what they should, in all views and
    /// better than with other focal lengths or a lens: nothing has to be searched for.
    pub fn is_plainly_good(&self) -> bool {
        const FOCAL_SCALES: [f64; 6] = [0.8, 0.9, 0.95, 1.05, 1.1, 1.25];
        const LENSES: [f64; 4] = [-0.05, 0.05, 0.1, 0.2];
        let trusted = self.all_trusted();
        let (given, limits) = (self.given(&trusted), self.limits());
        let explains = given.all.total >= limits.min_total && given.share() >= limits.good_share;
        let other_is_better = || {
            let focal = FOCAL_SCALES.into_iter().map(Hypothesis::FocalScale);
            let others: Vec<_> = focal.chain(LENSES.map(Hypothesis::Lens)).collect();
            others.into_par_iter().any(|other| {
                let other = self.try_out(other, &self.cameras, &trusted);
                other.agreement.score > CLEARLY * given.score
            })
        };
        !self.mirrored && explains && !other_is_better() && !self.any_is_refuted(&given)
    }

    /// Whether some view speaks against its camera that tells as much as the others do. What a
    /// look at some of the views cannot tell is no reason to look at all of them.
    fn any_is_refuted(&self, given: &Agreement) -> bool {
        let trusted = self.without_bad_views(self.all_trusted());
        let views = &self.gathered.views;
        let told = |&view: &usize| given.per_view[view].total as f64;
        let typical = median(views.iter().filter(|&&view| trusted[view]).map(told));
        let all_are_here = views.len() == self.scene.views.len();
        (self.bad_views_beside(&trusted).iter())
            .any(|view| all_are_here || told(view) >= MIN_TOLD * typical)
    }

    /// That the given cameras agree with the images.
    pub fn agreeing_findings(&self) -> Vec<Finding> {
        vec![self.agreeing(&self.all_given(), true)]
    }

    /// What is found about the poses.
    pub fn findings(&self) -> Vec<Finding> {
        // As many as a search among hundreds of hypotheses needs.
        let trusted = self.trusted(SEARCHED_VIEWS);
        let (given, limits) = (self.given(&trusted), self.limits());
        if given.all.total < limits.min_total {
            return vec![(self.witnessed()).unwrap_or_else(|| self.too_little(&given))];
        }
        if let Some(best) = (self.better_explanation(&given, &trusted, limits.bad_share))
            .filter(|best| !self.are_refuted_by_silhouettes(best))
        {
            return vec![self.explained_by(best, &given)];
        }
        if self.mirrored {
            return vec![self.mirrored_as_read()];
        }
        let trusted = self.without_bad_views(self.all_trusted());
        let rest = self.given(&trusted);
        if rest.share() < limits.bad_share {
            let may_all_be_false = self.gathered.views.len() * limits.min_per_view;
            return vec![(self.witnessed()).unwrap_or_else(|| {
                if given.all.total < may_all_be_false {
                    self.too_little(&given)
                } else {
                    self.disagreement(&given)
                }
            })];
        }
        let bad = self.bad_views_beside(&trusted);
        let mut findings = Vec::new();
        if !bad.is_empty() {
            let faults: Vec<_> = (bad.par_iter())
                .map(|&view| self.fault_of(view, &bad, &trusted, &rest))
                .collect();
            findings.push(self.bad_views(&bad, &faults));
        }
        let good = rest.share() >= limits.good_share || self.other_witness().is_some();
        findings.push(self.agreeing(&rest, good));
        findings.extend(self.views_apart(&trusted));
        findings
    }

    /// The silhouettes, if half of the views at least have one, and so many that they have a hull.
    fn silhouettes_of_most(&self) -> Option<&[Silhouette]> {
        let silhouettes = &self.gathered.silhouettes;
        let are_most = 2 * silhouettes.len() >= self.gathered.views.len();
        (are_most && silhouettes.len() >= MIN_SILHOUETTES).then_some(silhouettes)
    }

    /// Those of the scene, whose ball is around the origin, not that of the files.
    fn cameras_in_world(&self) -> Vec<Camera> {
        self.scene.views.iter().map(|view| view.camera).collect()
    }

    /// Whether the given cameras explain the silhouettes, and other ones do not: of something round
    /// hardly a corner is one.
    fn are_refuted_by_silhouettes(&self, others: &[Candidate]) -> bool {
        let Some(silhouettes) = self.silhouettes_of_most() else {
            return false;
        };
        let world_from_original = self.scene.original_from_world.without_mirroring().inverse();
        let in_world = |camera: &Camera| Camera {
            center_in_world: world_from_original.apply(&camera.center_in_world),
            ..*camera
        };
        let share =
            |cameras: &[Camera]| covered_share(silhouettes, cameras, self.scene.sphere_radius);
        let given = share(&self.cameras_in_world());
        let is_worse = |other: &Candidate| {
            let cameras: Vec<Camera> = other.cameras.iter().map(in_world).collect();
            share(&cameras) < given - MIN_DIFFERENCE
        };
        given > MIN_COVERED && others.iter().all(is_worse)
    }

    /// Takes trust from views, the worst first, that explain next to nothing
    /// while the others do.
    fn without_bad_views(&self, mut trusted: Vec<bool>) -> Vec<bool> {
        let views = self.gathered.views.len();
        for _ in 0..views / 2 {
            let agreement = self.given(&trusted);
            let mut shares: Vec<(f64, usize)> = (self.gathered.views.iter())
                .filter(|&&view| trusted[view] && agreement.per_view[view].total > 0)
                .map(|&view| (agreement.per_view[view].share(), view))
                .collect();
            shares.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let (Some(&(worst, view)), Some(&(median, _))) =
                (shares.first(), shares.get(shares.len() / 2))
            else {
                break;
            };
            // What a view with few right points shows, among those that show some: up to half
            // of all may be bad.
            let first = shares.partition_point(|share| share.0 <= 0.2 * median);
            let low = shares.get(first + 3 * (shares.len() - first) / 10);
            let low = low.map_or(0.0, |share| share.0);
            let chance_of_none = (1.0 - low).powi(agreement.per_view[view].total as i32);
            if worst > 0.2 * median || worst > 0.1 || chance_of_none > 0.01 {
                break;
            }
            trusted[view] = false;
        }
        trusted
    }

    /// The views without trust for which nothing else speaks: few tracks may all be false, as at
    /// the ends of a run of neighbours, and so may be the corners of something round from above.
    fn bad_views_beside(&self, trusted: &[bool]) -> Vec<usize> {
        let speaks = |view| self.shows_known_points(view, trusted) || self.fits_its_outline(view);
        (self.gathered.views.par_iter().copied())
            .filter(|&view| !trusted[view] && !speaks(view))
            .collect()
    }

    /// Whether the silhouette of a view fits those of all others, and would not if most of their
    /// cameras had seen it.
    fn fits_its_outline(&self, view: usize) -> bool {
        let given = self.cameras_in_world();
        let share = |camera: Camera| {
            let mut cameras = given.clone();
            cameras[view] = camera;
            let silhouettes = &self.gathered.silhouettes;
            fit_of(view, silhouettes, &cameras, self.scene.sphere_radius)
        };
        let fits = share(given[view]).filter(|share| *share > MIN_COVERED);
        fits.is_some_and(|fits| {
            let others = self.gathered.views.iter().filter(|other| **other != view);
            let as_seen_by_others = median(others.filter_map(|other| share(given[*other])));
            as_seen_by_others < fits - MIN_DIFFERENCE
        })
    }

    /// That something else speaks for the given cameras.
    fn witnessed(&self) -> Option<Finding> {
        let message = self.other_witness()?;
        Some(Finding::new(Check::Poses, Level::Good, message))
    }

    /// What speaks for the given cameras where tracks or corners do not; `None` if nothing does.
    fn other_witness(&self) -> Option<String> {
        let views = &self.gathered.views;
        let by_points = || {
            let asked = evenly(views.len(), ASKED_VIEWS);
            let agree = (asked.par_iter())
                .filter(|&&index| self.shows_known_points(views[index], &self.all_trusted()))
                .count();
            (4 * agree >= 3 * asked.len()).then(|| {
                format!(
                    "{agree} of {} show points of the others where they should be",
                    counted(asked.len(), "view")
                )
            })
        };
        by_points().or_else(|| self.witness_of_silhouettes())
    }

    /// That the given cameras explain the silhouettes, and others would not.
    fn witness_of_silhouettes(&self) -> Option<String> {
        let views = &self.gathered.views;
        let silhouettes = self.silhouettes_of_most()?;
        let share =
            |cameras: &[Camera]| covered_share(silhouettes, cameras, self.scene.sphere_radius);
        let cameras = self.cameras_in_world();
        let given = share(&cameras);
        // Things that look the same from everywhere tell nothing.
        let stands_out = |by: usize| {
            let order = Hypothesis::Order(PoseOrder::Shifted(by as isize));
            share(&order.cameras(&cameras, &self.names)) < given - MIN_DIFFERENCE
        };
        let agree = given > MIN_COVERED
            && [1, views.len() / 3, views.len() / 2]
                .into_iter()
                .all(stands_out);
        agree.then(|| {
            format!(
                "the cameras explain {} of the silhouettes of {}",
                percent(given),
                counted(silhouettes.len(), "view")
            )
        })
    }

    /// Whether points that `trusted` views agree on are seen where a view's pose puts them.
    fn shows_known_points(&self, view: usize, trusted: &[bool]) -> bool {
        let Evidence::Tracks { tracks, keypoints } = self.evidence() else {
            return false;
        };
        let mut others = trusted.to_vec();
        others[view] = false;
        let points = known_points(tracks, &self.cameras, &others);
        (keypoints.iter().find(|of_view| of_view.view == view))
            .is_some_and(|own| transfer_gain(own, &self.cameras[view], &points) > SIGNIFICANT)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::gray_image::GrayImage;
    use crate::tracks::{Sighting, Track};
    use nalgebra::{Vector2, Vector3};
    use neat_core::synthetic::{SyntheticScene, generate};

    /// With what was gathered of a scene that was read as it is.
    pub(crate) fn diagnosis<'a>(scene: &'a Scene, gathered: &'a Gathered) -> Diagnosis<'a> {
        let (repair, axes) = (Repair::default(), CameraAxes::OPENCV);
        Diagnosis::new(scene, gathered, repair, axes, false)
    }

    /// Numbers in [-1, 1] that look like chance.
    fn scattered(index: usize, salt: usize) -> f64 {
        2.0 * ((index + 1) as f64 * (2.0 + salt as f64).sqrt() * 97.3).fract() - 1.0
    }

    /// Of nine of the views, eight see points together, and the last one has false tracks alone.
    fn is_plainly_good_with(views: usize, false_tracks: usize) -> bool {
        let config = SyntheticScene {
            views,
            image_size: 100,
            ..SyntheticScene::default()
        };
        let scene = generate(&config).unwrap().scene;
        let sighting = |view: usize, pixel| Sighting {
            view,
            pixel,
            tolerance: 1.0,
            descriptor: [0; 4],
        };
        let right = (0..400).map(|index| {
            let point = Vector3::from_fn(|axis, _| 0.4 * scattered(index, axis));
            Track::new([0, 1, 2].map(|step| {
                let view = (index + step) % 8;
                sighting(view, scene.views[view].camera.project(&point).pixel)
            }))
        });
        let wrong = (0..false_tracks).map(|index| {
            Track::new([index % 8, (index + 1) % 8, 8].map(|view| {
                let at = |axis| 50.0 + 45.0 * scattered(index, 3 * view + axis);
                sighting(view, Vector2::new(at(0), at(1)))
            }))
        });
        let gathered = Gathered {
            views: (0..9).collect(),
            evidence: Evidence::Tracks {
                tracks: right.chain(wrong).collect(),
                keypoints: Vec::new(),
            },
            likeness: Vec::new(),
            silhouettes: Vec::new(),
        };
        diagnosis(&scene, &gathered).is_plainly_good()
    }

    #[test]
    fn silhouettes_speak_for_cameras_where_all_tracks_are_false() {
        let config = SyntheticScene {
            views: 24,
            image_size: 100,
            ..SyntheticScene::default()
        };
        let scene = generate(&config).unwrap().scene;
        let silhouettes = (scene.views.iter().enumerate()).map(|(index, view)| {
            let (image, _) = GrayImage::working_copy(&view.image.read().unwrap());
            Silhouette::new(index, &image)
        });
        let tracks = (0..400).map(|index| {
            Track::new([0, 5, 11].map(|step| Sighting {
                view: (index + step) % 24,
                pixel: Vector2::new(scattered(index, step), scattered(index, step + 1)) * 45.0
                    + Vector2::repeat(50.0),
                tolerance: 1.0,
                descriptor: [0; 4],
            }))
        });
        let mut gathered = Gathered {
            views: (0..24).collect(),
            evidence: Evidence::Tracks {
                tracks: tracks.collect(),
                keypoints: Vec::new(),
            },
            likeness: vec![1.0; 24 * 23 / 2],
            silhouettes: silhouettes.collect(),
        };
        let level = |gathered: &Gathered| diagnosis(&scene, gathered).findings()[0].level;
        assert_eq!(level(&gathered), Level::Good);
        gathered.silhouettes.clear();
        assert_ne!(level(&gathered), Level::Good);
    }

    #[test]
    fn a_view_with_few_false_tracks_is_no_reason_to_look_at_all_views() {
        assert!(is_plainly_good_with(20, 20));
        assert!(!is_plainly_good_with(20, 100));
        // There are no others.
        assert!(!is_plainly_good_with(9, 20));
    }
}
