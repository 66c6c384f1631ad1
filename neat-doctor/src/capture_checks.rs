//! Where the cameras stand, what they look at, and what is known beside images.

use crate::examination::{
    Cause, Check, Finding, Level, counted, listed, median, percent, views_where,
};
use nalgebra::Vector3;
use neat_core::{Camera, Scene};

/// What is found about cameras and sparse points.
pub(crate) fn capture_findings(scene: &Scene) -> Vec<Finding> {
    let mut findings = vec![coverage(scene), scene_sphere(scene)];
    findings.extend(sparse_points(scene));
    findings
}

/// Neighbouring views further apart, in degrees, share little.
const WIDE: f64 = 35.0;
/// Views closer together than this, in degrees, hardly tell a depth.
const NARROW: f64 = 5.0;

/// A scene sphere that is smaller in the images, in pixels, has no room for an edge.
const MIN_SIZE: f64 = 10.0;
/// Cameras within a scene sphere that are all nearer to each other, in its radii, look from one
/// place.
const MIN_BASELINE: f64 = 1e-3;

fn coverage(scene: &Scene) -> Finding {
    let count = scene.views.len();
    let directions: Vec<Vector3<f64>> = (scene.views.iter())
        .map(|view| view.camera.center_in_world.normalize())
        .collect();
    let extent = (scene.views.iter())
        .map(|view| (view.camera.center_in_world - scene.views[0].camera.center_in_world).norm())
        .fold(0.0, f64::max);
    let from_sphere = scene.views[0].camera.center_in_world.norm();
    if count < 2 || extent <= 1e-9 * from_sphere.max(1e-9) {
        let message = format!(
            "{} from one place: nothing tells how far things are",
            counted(count, "image")
        );
        return Finding::new(Check::Coverage, Level::Problem, message)
            .because(Cause::Other)
            .remedied_by("walk around the object and take photographs from many places");
    }
    let angle = |a: usize, b: usize| {
        let cosine = directions[a].dot(&directions[b]);
        cosine.clamp(-1.0, 1.0).acos().to_degrees()
    };
    let nearest = |view: usize| {
        let others = (0..count).filter(|&other| other != view);
        others
            .map(|other| angle(view, other))
            .fold(f64::INFINITY, f64::min)
    };
    let neighbour = median((0..count).map(nearest));
    let widest = (0..count)
        .flat_map(|a| (a + 1..count).map(move |b| (a, b)))
        .map(|(a, b)| angle(a, b))
        .fold(0.0, f64::max);
    let message = format!(
        "{} with {neighbour:.1}° between neighbours (median) and {widest:.0}° in all, \
         seen from the middle of the scene sphere",
        counted(count, "view")
    );
    let remedies = [
        (
            widest < NARROW,
            "take photographs from places further apart",
        ),
        (neighbour > WIDE, "take more photographs in between"),
        (
            count < 8,
            "take more photographs: from 20 on results are good",
        ),
    ];
    if let Some((_, remedy)) = remedies.into_iter().find(|(holds, _)| *holds) {
        return Finding::warning(Check::Coverage, message, remedy);
    }
    let one_sided = directions.iter().sum::<Vector3<f64>>().norm() / count as f64 > 0.6;
    if one_sided {
        let message = format!("{message}; what faces away from them stays empty");
        return Finding::new(Check::Coverage, Level::Note, message);
    }
    Finding::new(Check::Coverage, Level::Good, message)
}

fn scene_sphere(scene: &Scene) -> Finding {
    let camera = |view: usize| &scene.views[view].camera;
    let shares: Vec<f64> = (0..scene.views.len())
        .map(|view| seen_share(camera(view), scene.sphere_radius))
        .collect();
    let inside = views_where(scene, |view| {
        camera(view).center_in_world.norm() < scene.sphere_radius
    });
    let away = views_where(scene, |view| shares[view] == 0.0);
    // In the frame of the user's files, as --scene-sphere takes it.
    let [x, y, z] = scene.original_from_world.translation.into();
    let radius = scene.original_from_world.length_factor() * scene.sphere_radius;
    let ball = format!("the ball around ({x:.2}, {y:.2}, {z:.2}) of radius {radius:.3}");
    let remedy = "give the sphere of the object by --scene-sphere";
    let of_cameras = |names: &[String], what: &str| {
        let all = counted(scene.views.len(), "camera");
        format!("{} of {all} {what} {ball}: {}", names.len(), listed(names))
    };
    if !away.is_empty() {
        let message = of_cameras(&away, "do not look at");
        let mut finding = Finding::warning(Check::SceneSphere, message, remedy);
        // What most cameras do not look at is not what they were made for.
        if 2 * away.len() > scene.views.len() {
            finding.level = Level::Problem;
        }
        return finding.of_views(away);
    }
    let size = median(sizes_in_pixels(scene));
    if size < MIN_SIZE {
        let message = format!("{ball} is {size:.2} pixels large in the images (median)");
        return Finding::new(Check::SceneSphere, Level::Problem, message)
            .because(Cause::Other)
            .remedied_by(remedy);
    }
    if !inside.is_empty() {
        let count = scene.views.len();
        let apart = (scene.views.iter())
            .map(|view| (view.camera.center_in_world - camera(0).center_in_world).norm())
            .fold(0.0, f64::max);
        // From one place, as seen from what it holds.
        let from_one_place = inside.len() == count && apart < MIN_BASELINE * scene.sphere_radius;
        if 2 * inside.len() > count && !from_one_place {
            let message = format!(
                "{} of {} stand inside {ball}, as in a room; around an object, {remedy}",
                inside.len(),
                counted(count, "camera")
            );
            return Finding::new(Check::SceneSphere, Level::Note, message).of_views(inside);
        }
        let message = of_cameras(&inside, "stand inside");
        let mut finding = Finding::warning(Check::SceneSphere, message, remedy);
        if from_one_place {
            finding.level = Level::Problem;
        }
        return finding.of_views(inside);
    }
    let seen = median(shares.into_iter());
    let message = format!("cameras see {} of {ball} (median)", percent(seen));
    Finding::new(Check::SceneSphere, Level::Good, message)
}

/// Diameters of the scene sphere in the images of the cameras outside of it; infinite inside.
fn sizes_in_pixels(scene: &Scene) -> impl Iterator<Item = f64> {
    scene.views.iter().map(|view| {
        let (camera, radius) = (&view.camera, scene.sphere_radius);
        let distance = camera.center_in_world.norm();
        if distance <= radius {
            return f64::INFINITY;
        }
        2.0 * radius * camera.intrinsics.fx.max(camera.intrinsics.fy) / distance
    })
}

/// The share of the scene sphere that a camera sees.
fn seen_share(camera: &Camera, radius: f64) -> f64 {
    const STEPS: i32 = 4;
    let (mut seen, mut all) = (0, 0);
    let steps = || (-STEPS..=STEPS).map(|step| f64::from(step) / f64::from(STEPS));
    for x in steps() {
        for y in steps() {
            for z in steps() {
                let offset = Vector3::new(x, y, z);
                if offset.norm() > 1.0 {
                    continue;
                }
                all += 1;
                seen += u32::from(camera.sees(&(offset * radius)));
            }
        }
    }
    f64::from(seen) / f64::from(all)
}

/// Residuals of sparse points, in pixels of an image 1000 pixels wide, above
/// which they or the cameras are wrong.
const BAD_RESIDUAL: f64 = 5.0;

fn sparse_points(scene: &Scene) -> Option<Finding> {
    let mut residuals = Vec::new();
    let mut behind = 0;
    for point in &scene.sparse_points {
        for observation in &point.observations {
            let Some(view) = scene.views.get(observation.view) else {
                continue;
            };
            let projection = view.camera.project(&point.position_in_world);
            if projection.depth <= 0.0 {
                behind += 1;
                continue;
            }
            let side = f64::from(view.camera.width.max(view.camera.height));
            residuals.push((projection.pixel - observation.pixel).norm() * 1000.0 / side);
        }
    }
    let all = residuals.len() + behind;
    if all < 50 {
        return None;
    }
    let residual = median(residuals.into_iter());
    let message = format!(
        "{all} observations of sparse points: {residual:.2} pixels from their projections \
         (median, of 1000 across), {} behind their cameras",
        percent(behind as f64 / all as f64)
    );
    if residual > BAD_RESIDUAL || 5 * behind > all {
        let finding = Finding::new(Check::SparsePoints, Level::Problem, message)
            .because(Cause::PosesDisagree)
            .remedied_by("give points, poses and images of the same reconstruction");
        return Some(finding);
    }
    Some(Finding::new(Check::SparsePoints, Level::Good, message))
}
