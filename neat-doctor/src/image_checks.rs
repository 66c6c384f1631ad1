//! Images by themselves and against their intrinsics: sizes, brightness, blur,
//! images that occur twice.

use crate::examination::{Cause, Check, Finding, Level, counted, listed, median, views_where};
use crate::gray_image::GrayImage;
use crate::working_copies::WorkingCopies;
use neat_core::{Camera, Scene, SceneError};
use std::hash::{DefaultHasher, Hasher};

/// What one image is like.
#[derive(Clone, Copy, Debug)]
struct ImageStatistics {
    /// Mean brightness in [0, 1].
    mean: f32,
    /// Share of pixels that are entirely black or white.
    clipped: f32,
    /// Brightest minus darkest.
    contrast: f32,
    /// The gradient that one of 200 pixels exceeds.
    steepness: f32,
    /// Whether the border has one colour, as around rendered objects.
    plain_border: bool,
}

impl ImageStatistics {
    fn new(image: &GrayImage) -> Self {
        let values = &image.values;
        let count = values.len() as f32;
        let darkest = values.iter().copied().fold(f32::INFINITY, f32::min);
        let brightest = values.iter().copied().fold(0.0, f32::max);
        let clipped = values.iter().filter(|&&v| v <= 0.002 || v >= 0.998).count();
        let [along_x, along_y] = image.gradients();
        let mut steepness: Vec<f32> = (along_x.values.iter().zip(&along_y.values))
            .map(|(x, y)| x.hypot(*y))
            .collect();
        let rank = steepness.len() - 1 - (steepness.len() - 1) / 200;
        let (_, steep, _) = steepness.select_nth_unstable_by(rank, f32::total_cmp);
        Self {
            mean: values.iter().sum::<f32>() / count,
            clipped: clipped as f32 / count,
            contrast: brightest - darkest,
            steepness: *steep,
            plain_border: has_plain_border(image),
        }
    }
}

/// Whether nine tenths of the border have one brightness, as around rendered objects.
pub(crate) fn has_plain_border(image: &GrayImage) -> bool {
    let corner = image.at(0, 0);
    let (right, bottom) = (image.width - 1, image.height - 1);
    let horizontal = (0..image.width).flat_map(|x| [(x, 0), (x, bottom)]);
    let vertical = (0..image.height).flat_map(|y| [(0, y), (right, y)]);
    let (mut plain, mut all) = (0, 0);
    for (x, y) in horizontal.chain(vertical) {
        all += 1;
        plain += usize::from((image.at(x, y) - corner).abs() < 0.01);
    }
    10 * plain >= 9 * all
}

/// A brightness that differs from the median by this factor is remarkable.
const EXPOSURE_FACTOR: f32 = 2.0;
/// An image whose edges are this many times as steep as usual is blurred.
const BLUR_FACTOR: f32 = 0.35;
/// Less contrast than this, of 255 levels 5, and an image shows nothing.
const MIN_CONTRAST: f32 = 0.02;

/// What is found about the images.
///
/// # Errors
/// If an image lies in a file that cannot be read.
pub(crate) fn image_findings(
    scene: &Scene,
    working: &WorkingCopies<'_>,
) -> Result<Vec<Finding>, SceneError> {
    let views: Vec<usize> = (0..scene.views.len()).collect();
    let looked = working.look_at(&views, |view| {
        let image = scene.views[view].image.read()?;
        let (copy, _) = GrayImage::working_copy(&image);
        Ok((ImageStatistics::new(&copy), fingerprint(image.as_raw())))
    })?;
    let (statistics, fingerprints): (Vec<_>, Vec<_>) = looked.into_iter().unzip();
    let mut findings = vec![sizes(scene)];
    findings.extend(intrinsics(scene));
    findings.push(exposure(scene, &statistics));
    findings.push(sharpness(scene, &statistics));
    findings.extend(duplicates(scene, &fingerprints)?);
    Ok(findings)
}

fn sizes(scene: &Scene) -> Finding {
    let size = |view: usize| scene.views[view].image.dimensions();
    let mut all: Vec<_> = (0..scene.views.len()).map(size).collect();
    all.sort_unstable();
    let usual = all[all.len() / 2];
    let others = views_where(scene, |view| size(view) != usual);
    let (width, height) = usual;
    if others.is_empty() {
        let message = format!("all images have {width}×{height} pixels");
        return Finding::new(Check::ImageSizes, Level::Good, message);
    }
    let message = format!(
        "{} of {} have another size than {width}×{height}: {}",
        others.len(),
        counted(scene.views.len(), "image"),
        listed(&others)
    );
    Finding::new(Check::ImageSizes, Level::Note, message).of_views(others)
}

/// Fields of view beyond these, in degrees, are seldom meant.
const FIELD_OF_VIEW: [f64; 2] = [4.0, 130.0];

/// How far a camera sees to the sides, in degrees.
pub(crate) fn field_of_view(camera: &Camera) -> f64 {
    let half = f64::from(camera.width) / (2.0 * camera.intrinsics.fx);
    2.0 * half.atan().to_degrees()
}

/// Whether a field of view is one of those that are meant.
pub(crate) fn is_usual(field_of_view: f64) -> bool {
    let [narrowest, widest] = FIELD_OF_VIEW;
    (narrowest..=widest).contains(&field_of_view)
}

fn intrinsics(scene: &Scene) -> Vec<Finding> {
    let mut findings = Vec::new();
    let camera = |view: usize| &scene.views[view].camera;
    let off_middle = |camera: &Camera| {
        let off = |center: f64, pixels: u32| (center / f64::from(pixels) - 0.5).abs();
        off(camera.intrinsics.cx, camera.width).max(off(camera.intrinsics.cy, camera.height))
    };
    let far = views_where(scene, |view| off_middle(camera(view)) > 0.15);
    if !far.is_empty() {
        let k = camera(0).intrinsics;
        let message = format!(
            "the principal point of {} is far from the middle of the image, such as \
             ({:.0}, {:.0}) in {}×{} pixels",
            counted(far.len(), "view"),
            k.cx,
            k.cy,
            camera(0).width,
            camera(0).height
        );
        let finding = Finding::new(Check::Intrinsics, Level::Warning, message)
            .because(Cause::PrincipalPoint)
            .remedied_by("give the intrinsics of these very images: were they scaled or cut?");
        findings.push(finding.of_views(far));
    }
    let odd = views_where(scene, |view| !is_usual(field_of_view(camera(view))));
    if !odd.is_empty() {
        let message = format!(
            "the field of view of {} is unusual: {:.1}° to the sides in the first view",
            counted(odd.len(), "view"),
            field_of_view(camera(0))
        );
        let finding = Finding::new(Check::Intrinsics, Level::Warning, message)
            .because(Cause::FocalLength)
            .remedied_by("check that focal lengths are in pixels of these images");
        findings.push(finding.of_views(odd));
    }
    let aspect = views_where(scene, |view| {
        let k = camera(view).intrinsics;
        (k.fx / k.fy - 1.0).abs() > 0.05
    });
    if !aspect.is_empty() {
        let message = format!(
            "the pixels of {} are not square: fx is {:.1} and fy {:.1} in the first view",
            counted(aspect.len(), "view"),
            camera(0).intrinsics.fx,
            camera(0).intrinsics.fy
        );
        findings.push(Finding::new(Check::Intrinsics, Level::Note, message).of_views(aspect));
    }
    if findings.is_empty() {
        let message = format!(
            "the field of view is {:.0}°, the principal point near the middle",
            field_of_view(camera(0))
        );
        findings.push(Finding::new(Check::Intrinsics, Level::Good, message));
    }
    findings
}

fn exposure(scene: &Scene, statistics: &[ImageStatistics]) -> Finding {
    let empty = views_where(scene, |view| statistics[view].contrast < MIN_CONTRAST);
    if !empty.is_empty() {
        let message = format!(
            "{} of one colour: {}",
            counted(empty.len(), "image"),
            listed(&empty)
        );
        let remedy = "take these images out or export them again";
        let mut finding = Finding::warning(Check::Exposure, message, remedy);
        if 2 * empty.len() > scene.views.len() {
            finding.level = Level::Problem;
        }
        return finding.of_views(empty);
    }
    let on_background = statistics.iter().filter(|s| s.plain_border).count();
    if 2 * on_background > statistics.len() {
        let message = "the object stands before a plain background";
        return Finding::new(Check::Exposure, Level::Good, message);
    }
    let usual = median(statistics.iter().map(|s| f64::from(s.mean))) as f32;
    let odd = views_where(scene, |view| {
        let ratio = statistics[view].mean / usual;
        !(1.0 / EXPOSURE_FACTOR..=EXPOSURE_FACTOR).contains(&ratio)
    });
    let clipped = views_where(scene, |view| statistics[view].clipped > 0.3);
    if !odd.is_empty() {
        let message = format!(
            "{} twice as bright or half as bright as usual, or beyond: {}",
            counted(odd.len(), "image"),
            listed(&odd)
        );
        let remedy = "develop all photographs with one exposure, or take these out";
        return Finding::warning(Check::Exposure, message, remedy).of_views(odd);
    }
    if !clipped.is_empty() {
        let message = format!(
            "more than 30 % of the pixels of {} are black or white: {}",
            counted(clipped.len(), "image"),
            listed(&clipped)
        );
        return Finding::new(Check::Exposure, Level::Note, message).of_views(clipped);
    }
    let message = format!(
        "all images are about as bright, {:.0} of 255",
        255.0 * usual
    );
    Finding::new(Check::Exposure, Level::Good, message)
}

fn sharpness(scene: &Scene, statistics: &[ImageStatistics]) -> Finding {
    let usual = median(statistics.iter().map(|s| f64::from(s.steepness))) as f32;
    let blurred = views_where(scene, |view| {
        statistics[view].steepness < BLUR_FACTOR * usual
            && statistics[view].contrast >= MIN_CONTRAST
    });
    if blurred.is_empty() {
        let message = "no image is much less sharp than the others";
        return Finding::new(Check::Sharpness, Level::Good, message);
    }
    let message = format!(
        "{} much less sharp than usual: {}",
        counted(blurred.len(), "image"),
        listed(&blurred)
    );
    let remedy = "take blurred images out where others show the same";
    Finding::warning(Check::Sharpness, message, remedy).of_views(blurred)
}

/// Images that are equal to the last bit; equal ones have equal `fingerprints`.
///
/// # Errors
/// If an image lies in a file that cannot be read.
fn duplicates(scene: &Scene, fingerprints: &[u64]) -> Result<Option<Finding>, SceneError> {
    let mut order: Vec<usize> = (0..scene.views.len()).collect();
    order.sort_by_key(|&view| (fingerprints[view], view));
    let mut twice = Vec::new();
    for pair in order.windows(2) {
        let [a, b] = [pair[0], pair[1]].map(|view| &scene.views[view].image);
        // Different images of one fingerprint are as good as impossible; of equal ones
        // there are few.
        if fingerprints[pair[0]] == fingerprints[pair[1]] && a.read()? == b.read()? {
            twice.push(pair[1]);
        }
    }
    if twice.is_empty() {
        return Ok(None);
    }
    let names = views_where(scene, |view| twice.contains(&view));
    let message = format!(
        "{} the same as another one to the last pixel: {}",
        counted(names.len(), "image"),
        listed(&names)
    );
    let remedy = "keep one image of each and its pose";
    let mut finding = Finding::warning(Check::Duplicates, message, remedy);
    if 2 * twice.len() > scene.views.len() {
        finding.level = Level::Problem;
    }
    Ok(Some(finding.of_views(names)))
}

/// The same for equal pixels, and hardly for others.
fn fingerprint(pixels: &[u8]) -> u64 {
    let mut hasher = DefaultHasher::new();
    hasher.write(pixels);
    hasher.finish()
}
