//! Where the cameras stand, what they look at, and what is known beside images.

use crate::examination::{Cause, Check, Finding, Level, counted, listed, percent};
use nalgebra::Vector3;
use neat_core::{Camera, Scene};

/// What is found about cameras, sparse points and segments.
pub(crate) fn capture_findings(scene: &Scene) -> Vec<Finding> {
    let mut findings = vec![coverage(scene), scene_sphere(scene)];
    findings.extend(sparse_points(scene));
    findings.extend(segments(scene));
    findings
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

/// Neighbouring views further apart, in degrees, share little.
const WIDE: f64 = 35.0;
/// Views closer together than this, in degrees, hardly tell a depth.
const NARROW: f64 = 5.0;

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
    let neighbour = median((0..count).map(nearest).collect());
    let widest = (0..count)
        .flat_map(|a| (a + 1..count).map(move |b| (a, b)))
        .map(|(a, b)| angle(a, b))
        .fold(0.0, f64::max);
    let message = format!(
        "{} with {neighbour:.1}° between neighbours (median) and {widest:.0}° in all, \
         seen from the middle of the scene sphere",
        counted(count, "view")
    );
    if widest < NARROW {
        return Finding::new(Check::Coverage, Level::Warning, message)
            .because(Cause::Other)
            .remedied_by("take photographs from places further apart");
    }
    if neighbour > WIDE {
        return Finding::new(Check::Coverage, Level::Warning, message)
            .because(Cause::Other)
            .remedied_by("take more photographs in between");
    }
    if count < 8 {
        return Finding::new(Check::Coverage, Level::Warning, message)
            .because(Cause::Other)
            .remedied_by("take more photographs: from 20 on results are good");
    }
    let one_sided = directions.iter().sum::<Vector3<f64>>().norm() / count as f64 > 0.6;
    if one_sided {
        let message = format!("{message}; what faces away from them stays empty");
        return Finding::new(Check::Coverage, Level::Note, message);
    }
    Finding::new(Check::Coverage, Level::Good, message)
}

fn scene_sphere(scene: &Scene) -> Finding {
    let names = |holds: Vec<bool>| -> Vec<String> {
        let views = scene.views.iter().zip(holds).filter(|(_, holds)| *holds);
        views.map(|(view, _)| view.name.clone()).collect()
    };
    let cameras = || scene.views.iter().map(|view| &view.camera);
    let shares: Vec<f64> = cameras()
        .map(|camera| seen_share(camera, scene.sphere_radius))
        .collect();
    let is_inside = |camera: &Camera| camera.center_in_world.norm() < scene.sphere_radius;
    let inside = names(cameras().map(is_inside).collect());
    let away = names(shares.iter().map(|&share| share == 0.0).collect());
    let seen = median(shares);
    // In the frame of the user's files, as --scene-sphere takes it.
    let [x, y, z] = scene.original_from_world.translation.into();
    let radius = scene.original_from_world.scale * scene.sphere_radius;
    let ball = format!("the ball around ({x:.2}, {y:.2}, {z:.2}) of radius {radius:.3}");
    let remedy = "give the sphere of the object by --scene-sphere";
    if !away.is_empty() {
        let message = format!(
            "{} of {} do not look at {ball}: {}",
            away.len(),
            counted(scene.views.len(), "camera"),
            listed(&away)
        );
        // What no camera looks at cannot be reconstructed.
        let level = match away.len() == scene.views.len() {
            true => Level::Problem,
            false => Level::Warning,
        };
        return Finding::new(Check::SceneSphere, level, message)
            .because(Cause::Other)
            .remedied_by(remedy)
            .of_views(away);
    }
    if !inside.is_empty() {
        let message = format!(
            "{} of {} stand inside {ball}: {}",
            inside.len(),
            counted(scene.views.len(), "camera"),
            listed(&inside)
        );
        return Finding::new(Check::SceneSphere, Level::Warning, message)
            .because(Cause::Other)
            .remedied_by(remedy)
            .of_views(inside);
    }
    let message = format!("cameras see {} of {ball} (median)", percent(seen));
    Finding::new(Check::SceneSphere, Level::Good, message)
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
    let residual = median(residuals);
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

fn segments(scene: &Scene) -> Option<Finding> {
    let counts: Vec<usize> = (scene.views.iter())
        .map(|view| view.wireframe.edges.len())
        .collect();
    if counts.iter().all(|&count| count == 0) {
        return None;
    }
    let empty: Vec<String> = (scene.views.iter().zip(&counts))
        .filter(|(_, count)| **count == 0)
        .map(|(view, _)| view.name.clone())
        .collect();
    let mut sorted = counts;
    sorted.sort_unstable();
    let message = format!("{} 2D segments per view (median)", sorted[sorted.len() / 2]);
    if empty.is_empty() {
        return Some(Finding::new(Check::Segments, Level::Good, message));
    }
    let message = format!(
        "{message}, none in {}: {}",
        counted(empty.len(), "view"),
        listed(&empty)
    );
    let level = if 4 * empty.len() > scene.views.len() {
        Level::Warning
    } else {
        Level::Note
    };
    Some(Finding::new(Check::Segments, level, message).of_views(empty))
}
