//! Poses moved until lines in space lie on the edgels of the images, if the lines agree on it.
//!
//! Lines and poses are fitted in turn. Each half of the lines finds a change of the poses, too:
//! what both find is an error of the poses, the rest is noise. How much of the change that all
//! lines ask for is true follows from the correlation of the two (split-half reliability;
//! Spearman, Brown, *British Journal of Psychology* 3, 1910): the poses move by that share of it,
//! and stay if noise is the larger one.

use super::edge_samples::Images;
use super::line_fitting::change_by_edgels;
use super::line_selection::ChosenLine;
use super::projected_line::ProjectedLine;
use super::view_segments::PreparedView;
use crate::statistics::upper_median;
use nalgebra::{Rotation3, Vector6};
use neat_core::Camera;
use rayon::prelude::*;

/// Lines and poses are fitted in turn so often: photographs' poses do not move any more.
const ROUNDS: usize = 4;
/// A half of so many lines tells where a view stands twice over: each of them says two numbers,
/// and a pose is six. With fewer the halves of a part agree on errors of their own.
const MIN_LINES_OF_HALF: usize = 6;
/// Edgels of fewer samples tell of no line.
const MIN_EDGELS: usize = 4;
/// What is given counts as this share of the edgels, where it moves them as far as its
/// parameters are: it holds what edgels tell little of. With 0.001 or 0.1 F1 of photographs is
/// the same within 0.01.
const RIDGE: f64 = 0.01;
/// Less reliable changes are more noise than error …
const MIN_RELIABILITY: f64 = 0.5;
/// … and those of few views may agree by chance: so many standard deviations do not.
const SURE_DEVIATIONS: f64 = 3.0;

/// Poses that fit lines better than those given.
pub(super) struct PoseFit {
    pub views: Vec<PreparedView>,
    /// Share of the change of which the halves say that it is true.
    pub reliability: f64,
    /// How far it moves lines in the images, in pixels: the root of the mean square.
    pub pixels: f64,
}

impl PoseFit {
    /// The cameras, in a world whose scene ball has that radius.
    pub fn cameras(&self, scene_radius: f64) -> Vec<Camera> {
        let camera = |view: &PreparedView| Camera {
            center_in_world: view.camera.center_in_world * scene_radius,
            ..view.camera
        };
        self.views.iter().map(camera).collect()
    }
}

/// How the distance of an edgel from a line changes with the pose of its view, and the distance.
type Row = (Vector6<f64>, f64);

/// A change of a pose by all lines, and by halves of them.
struct PoseChange {
    /// Of the centre, and the angles of the turn by the depth: both move what is seen as far.
    parameters: Vector6<f64>,
    depth: f64,
    /// Over edgels, in squared pixels: the changes by both halves multiplied with each other …
    common: f64,
    /// … with themselves, mean of both …
    of_halves: f64,
    /// … and the change by all with itself.
    of_all: f64,
    edgels: usize,
}

/// Fits poses to `lines`, and these to the poses. `None` if the lines do not say that the poses
/// are off; they stay then, too.
pub(super) fn fit_poses(images: &Images, lines: &mut [ChosenLine]) -> Option<PoseFit> {
    let mut fitted = lines.to_vec();
    let mut found: Option<PoseFit> = None;
    for _ in 0..ROUNDS {
        let views = found.as_ref().map_or(images.views, |found| &found.views);
        fit_lines(&Images { views, ..*images }, &mut fitted);
        let changes: Vec<Option<PoseChange>> = (0..images.views.len())
            .into_par_iter()
            .map(|view| images.change_of_pose(view, &fitted))
            .collect();
        let sum = |of: fn(&PoseChange) -> f64| changes.iter().flatten().map(of).sum::<f64>();
        let correlation = sum(|change| change.common) / sum(|change| change.of_halves);
        // That of the whole, by Spearman and Brown.
        let reliability = 2.0 * correlation / (1.0 + correlation);
        // Fisher's transformation: normal, about zero where nothing but chance agrees.
        let parameters = 6.0 * changes.iter().flatten().count() as f64;
        let deviations = correlation.atanh() * (parameters - 3.0).sqrt();
        if !(reliability >= MIN_RELIABILITY && deviations >= SURE_DEVIATIONS) {
            return None;
        }
        let moved = (images.views.iter().zip(&changes)).map(|(view, change)| match change {
            Some(change) => view.moved_to(change.applied(&view.camera, reliability)),
            None => view.clone(),
        });
        let squares = sum(|change| change.of_all) / sum(|change| change.edgels as f64);
        found = Some(PoseFit {
            views: moved.collect(),
            reliability,
            pixels: reliability * squares.sqrt(),
        });
    }
    let found = found?;
    let views = &found.views;
    fit_lines(&Images { views, ..*images }, &mut fitted);
    lines.clone_from_slice(&fitted);
    Some(found)
}

fn fit_lines(images: &Images, lines: &mut [ChosenLine]) {
    lines.par_iter_mut().for_each(|chosen| {
        chosen.line = images.fit(&chosen.line, chosen.evidence.views(), images.reach);
    });
}

impl Images<'_> {
    /// What `lines` and halves of them ask of the pose of a view; `None` if they are too few.
    fn change_of_pose(&self, view: usize, lines: &[ChosenLine]) -> Option<PoseChange> {
        let PreparedView {
            camera,
            focal_in_pixels,
            ..
        } = &self.views[view];
        let shown: Vec<&ChosenLine> = (lines.iter())
            .filter(|chosen| chosen.evidence.views().any(|shows| shows == view))
            .collect();
        if shown.is_empty() {
            return None;
        }
        let depths = shown
            .iter()
            .map(|chosen| (chosen.line.point_at(0.5) - camera.center_in_world).norm());
        let depth = upper_median(&mut depths.collect::<Vec<f64>>());
        let rows: Vec<Vec<Row>> = (shown.iter())
            .filter_map(|chosen| self.rows_of_line(view, chosen, depth))
            .filter(|rows| rows.len() >= MIN_EDGELS)
            .collect();
        if rows.len() < 2 * MIN_LINES_OF_HALF {
            return None;
        }
        let change = |first: usize, step: usize| {
            let rows: Vec<Row> = (rows.iter().skip(first).step_by(step).flatten())
                .copied()
                .collect();
            let pixel = depth / focal_in_pixels;
            change_by_edgels(&rows, MIN_EDGELS, self.reach, RIDGE, pixel)
        };
        let [all, even, odd] =
            [change(0, 1)?, change(0, 2)?, change(1, 2)?].map(|change| change.solution);
        let mut found = PoseChange {
            parameters: all,
            depth,
            common: 0.0,
            of_halves: 0.0,
            of_all: 0.0,
            edgels: 0,
        };
        for (row, _) in rows.iter().flatten() {
            let [all, even, odd] = [all, even, odd].map(|change| row.dot(&change));
            found.common += even * odd;
            found.of_halves += 0.5 * (even * even + odd * odd);
            found.of_all += all * all;
            found.edgels += 1;
        }
        Some(found)
    }

    fn rows_of_line(&self, view: usize, chosen: &ChosenLine, depth: f64) -> Option<Vec<Row>> {
        let camera = &self.views[view].camera;
        let projected = ProjectedLine::new(camera, &chosen.line)?;
        let [start, end] = chosen.line.ends().map(|end| end - camera.center_in_world);
        let edgels = self.edgels_beside(view, &chosen.line, self.reach);
        let row = |pixel| {
            let found = projected.distance_with_gradient(camera, pixel);
            let [by_start, by_end] = found.by_points;
            // Cameras move against what they see.
            let by_center = -(by_start + by_end);
            let by_turn = -(start.cross(&by_start) + end.cross(&by_end)) / depth;
            let row = [by_center.as_slice(), by_turn.as_slice()].concat();
            (Vector6::from_column_slice(&row), found.distance)
        };
        Some(edgels.iter().map(row).collect())
    }
}

impl PoseChange {
    /// The camera after this share of the change, which takes the distances away.
    fn applied(&self, camera: &Camera, share: f64) -> Camera {
        let change = -share * self.parameters;
        let turn = Rotation3::new(change.fixed_rows::<3>(3) / self.depth);
        Camera {
            center_in_world: camera.center_in_world + change.fixed_rows::<3>(0),
            world_from_camera: turn.matrix() * camera.world_from_camera,
            ..*camera
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, chosen};
    use crate::test_scenes::{Noise, cameras_on_sphere, cube, views_of_edges};
    use nalgebra::Vector3;
    use neat_core::LineSegment3;

    const VIEWS: usize = 20;

    /// A cube with the diagonals of its faces.
    fn truth() -> (Vec<Vector3<f64>>, Vec<[usize; 2]>) {
        let (junctions, mut edges) = cube();
        for a in 0..8 {
            edges.extend(
                [3, 5, 6]
                    .map(|bits| [a, a ^ bits])
                    .into_iter()
                    .filter(|[a, b]| a < b),
            );
        }
        (junctions, edges)
    }

    /// Views of it: segments with ends off by so many pixels at most, and cameras by this.
    fn views_of(noise: &mut Noise, pixels: f64, turn: f64, shift: f64) -> TestViews {
        let (junctions, edges) = truth();
        let mut observations = views_of_edges(&cameras_on_sphere(VIEWS), &junctions, &edges);
        for observation in &mut observations {
            for detection in &mut observation.segments {
                for end in [&mut detection.segment.start, &mut detection.segment.end] {
                    *end += pixels * noise.vector().xy();
                }
            }
            let camera = &mut observation.camera;
            camera.center_in_world += shift * noise.vector();
            let turn = Rotation3::new(turn * noise.vector());
            camera.world_from_camera = turn.matrix() * camera.world_from_camera;
        }
        let views = observations.iter().map(|o| PreparedView::new(o, 1.0, 1.0));
        TestViews::of(views.collect())
    }

    fn lines(images: &Images) -> Vec<ChosenLine> {
        let (junctions, edges) = truth();
        let lines = edges.iter().map(|ends| ends.map(|end| junctions[end]));
        lines
            .map(|[a, b]| chosen(images, &LineSegment3::new(a, b)))
            .collect()
    }

    #[test]
    fn poses_that_are_off_are_found() {
        let images = &views_of(&mut Noise(1), 0.1, 1e-3, 1e-3);
        let images = Images {
            reach: 1.5,
            ..images.images()
        };
        // How far off corners are in the images, in pixels.
        let error = |views: &[PreparedView]| {
            let pairs = views.iter().zip(cameras_on_sphere(VIEWS));
            let squares = pairs.flat_map(|(view, truth)| {
                let off =
                    move |corner| view.camera.project(&corner).pixel - truth.project(&corner).pixel;
                (cube().0.into_iter()).map(move |corner| off(corner).norm_squared())
            });
            (squares.sum::<f64>() / (8 * VIEWS) as f64).sqrt()
        };
        let mut lines = lines(&images);
        let found = fit_poses(&images, &mut lines).unwrap();
        assert!(found.reliability > 0.9 && found.pixels > 0.3);
        // All poses may turn, shift and grow together, as the lines do: no image tells.
        assert!(error(&found.views) < 0.2 * error(images.views));
    }

    #[test]
    fn noise_moves_no_pose() {
        for seed in 0..10 {
            let images = views_of(&mut Noise(seed), 0.5, 0.0, 0.0);
            let images = Images {
                reach: 1.5,
                ..images.images()
            };
            let mut moved = lines(&images);
            assert!(fit_poses(&images, &mut moved).is_none());
            assert!(
                moved
                    .iter()
                    .zip(lines(&images))
                    .all(|(a, b)| a.line == b.line)
            );
        }
    }

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let images = views_of(&mut Noise(2), 0.5, 0.0, 0.0);
        let images = images.images();
        let (chosen, depth) = (&lines(&images)[5], 2.5);
        let camera = images.views[3].camera;
        let pixel = images.edgels_beside(3, &chosen.line, 0.5)[0];
        let (row, distance) = images.rows_of_line(3, chosen, depth).unwrap()[0];
        for k in 0..6 {
            let mut parameters = Vector6::zeros();
            parameters[k] = -1e-6;
            let change = PoseChange {
                parameters,
                depth,
                common: 0.0,
                of_halves: 0.0,
                of_all: 0.0,
                edgels: 1,
            };
            let moved = ProjectedLine::new(&change.applied(&camera, 1.0), &chosen.line).unwrap();
            let slope = (moved.distance(&pixel) - distance) / 1e-6;
            assert!(
                (slope - row[k]).abs() < 1e-3 * row.amax(),
                "{k}: {slope} {}",
                row[k]
            );
        }
    }
}
