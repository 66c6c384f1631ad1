//! 2D segments: how many there are, and whether they lie on edges of their images.

use crate::evidence::evenly;
use crate::examination::{
    Cause, Check, Finding, Level, counted, listed, median, percent, views_where,
};
use crate::gray_image::GrayImage;
use crate::working_copies::{WorkingCopies, in_copy};
use nalgebra::Vector2;
use neat_core::{LineSegment2, Scene, SceneError, View};

/// Views whose segments are held against their images.
const VIEWS: usize = 12;
/// Places along a segment, in pixels of the working image, and at most so many.
const SPACING: f64 = 3.0;
const MAX_PLACES: usize = 40;
/// Shorter segments are not asked, in pixels of the working image: anything lies on an edge
/// for so long.
const MIN_LENGTH: f64 = 12.0;
/// An edge is a steeper change within so many pixels of a segment …
const NEAR: [f32; 3] = [-1.0, 0.0, 1.0];
/// … than anywhere so far beside it …
const BESIDE: [f32; 6] = [-7.0, -6.0, -5.0, 5.0, 6.0, 7.0];
/// … and one that noise does not make: 2 of 255 levels per pixel.
const MIN_STEEPNESS: f32 = 0.008;
/// A segment lies on an edge if so many of its places do; a third of them do anywhere.
const ON_EDGE: f64 = 0.6;
/// Of the length of segments of other images less than this lies on edges: 0 to 1 % does for the
/// toy object, where the right ones have 44 to 53 %, on faint edges …
const MIN_SHARE: f64 = 0.1;
/// … and less than this, if so much more does with another explanation.
const MIN_EXPLAINED_SHARE: f64 = 0.3;
const CLEARLY: f64 = 0.2;

/// What is found about the 2D segments; nothing where there are none.
///
/// # Errors
/// If an image lies in a file that cannot be read.
pub(crate) fn segment_findings(
    scene: &Scene,
    working: &WorkingCopies<'_>,
) -> Result<Vec<Finding>, SceneError> {
    let Some(number) = number_of_segments(scene) else {
        return Ok(Vec::new());
    };
    let mut findings = vec![number];
    findings.extend(segments_beside_edges(scene, working)?);
    Ok(findings)
}

fn number_of_segments(scene: &Scene) -> Option<Finding> {
    let count = |view: usize| scene.views[view].wireframe.edges.len();
    let empty = views_where(scene, |view| count(view) == 0);
    if empty.len() == scene.views.len() {
        return None;
    }
    let usual = median((0..scene.views.len()).map(|view| count(view) as f64));
    let message = format!("{usual} 2D segments per view (median)");
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

/// How the segments of a view could have been meant.
#[derive(Clone, Copy, PartialEq)]
enum Meant {
    AsGiven,
    /// Counted from the right border.
    Mirrored,
    /// Those of the view so many before or behind it.
    OfView(isize),
}

const MEANT: [Meant; 4] = [
    Meant::AsGiven,
    Meant::Mirrored,
    Meant::OfView(-1),
    Meant::OfView(1),
];

/// That segments lie elsewhere than on the edges of their images; `None` if they do not, or
/// if there are too few to tell.
fn segments_beside_edges(
    scene: &Scene,
    working: &WorkingCopies<'_>,
) -> Result<Option<Finding>, SceneError> {
    let asked: Vec<usize> = (evenly(scene.views.len(), VIEWS).into_iter())
        .filter(|&view| !scene.views[view].wireframe.edges.is_empty())
        .collect();
    let shares = working.look_at(&asked, |view| {
        let (image, factor) = working.of(view)?;
        let gradients = image.blurred(1).gradients();
        let of = |meant| {
            let segments = meant_segments(scene, view, meant)?;
            share_on_edges(&gradients, &in_working_pixels(&segments, scene, factor))
        };
        Ok(MEANT.map(of))
    })?;
    let of = |k: usize| {
        let known: Vec<f64> = shares.iter().filter_map(|of_view| of_view[k]).collect();
        (2 * known.len() > asked.len()).then(|| median(known.into_iter()))
    };
    let Some(given) = of(0).filter(|given| *given < MIN_EXPLAINED_SHARE) else {
        return Ok(None);
    };
    let best = (1..MEANT.len())
        .filter_map(|k| Some((of(k)?, MEANT[k])))
        .filter(|(share, _)| *share > given + CLEARLY)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    if best.is_none() && given >= MIN_SHARE {
        return Ok(None);
    }
    let message = format!(
        "{} of the length of the 2D segments lies on edges of their images (median of {})",
        percent(given),
        counted(asked.len(), "view")
    );
    let (why, remedy) = match best {
        Some((share, Meant::Mirrored)) => (
            format!(
                ", {} if they are mirrored from left to right",
                percent(share)
            ),
            "make the 2D wireframes from these very images, or mirror their x",
        ),
        Some((share, Meant::OfView(by))) => (
            format!(
                ", {} of those of the view {}",
                percent(share),
                if by < 0 { "before" } else { "behind" }
            ),
            "give the files of 2D wireframes the names of their images",
        ),
        _ => (
            String::new(),
            "make the 2D wireframes from these very images, or remove them: neat detects its own",
        ),
    };
    let finding = Finding::new(Check::Segments, Level::Problem, message + &why);
    Ok(Some(
        finding
            .because(Cause::SegmentsOfOtherImages)
            .remedied_by(remedy),
    ))
}

fn meant_segments(scene: &Scene, view: usize, meant: Meant) -> Option<Vec<LineSegment2>> {
    let of = |view: &View| -> Vec<LineSegment2> {
        let all = view.wireframe.segments(0.0);
        all.into_iter().map(|scored| scored.segment).collect()
    };
    let own = &scene.views[view];
    match meant {
        Meant::AsGiven => Some(of(own)),
        Meant::Mirrored => {
            let border = f64::from(own.wireframe.width) - 1.0 + 2.0 * scene.pixel_center;
            let mirrored = |end: Vector2<f64>| Vector2::new(border - end.x, end.y);
            let all = of(own).into_iter();
            Some(
                all.map(|s| LineSegment2::new(mirrored(s.start), mirrored(s.end)))
                    .collect(),
            )
        }
        Meant::OfView(by) => view
            .checked_add_signed(by)
            .and_then(|other| Some(of(scene.views.get(other)?))),
    }
}

fn in_working_pixels(segments: &[LineSegment2], scene: &Scene, factor: u32) -> Vec<LineSegment2> {
    let working = |end: &Vector2<f64>| in_copy(end, scene.pixel_center, factor);
    let map = |s: &LineSegment2| LineSegment2::new(working(&s.start), working(&s.end));
    segments.iter().map(map).collect()
}

/// The share of the length of segments that lies on edges; `None` if they are all short.
fn share_on_edges(gradients: &[GrayImage; 2], segments: &[LineSegment2]) -> Option<f64> {
    let (mut on_edges, mut all) = (0.0, 0.0);
    for segment in segments {
        let length = segment.length();
        if length < MIN_LENGTH {
            continue;
        }
        all += length;
        if lies_on_edge(gradients, segment, length) {
            on_edges += length;
        }
    }
    (all > 0.0).then(|| on_edges / all)
}

fn lies_on_edge(gradients: &[GrayImage; 2], segment: &LineSegment2, length: f64) -> bool {
    let offset = (segment.end - segment.start) / length;
    let normal = Vector2::new(-offset.y as f32, offset.x as f32);
    let [along_x, along_y] = gradients;
    let steepness =
        |x: f32, y: f32| (normal.x * along_x.sample(x, y) + normal.y * along_y.sample(x, y)).abs();
    let count = ((length / SPACING) as usize).clamp(1, MAX_PLACES);
    let hits = (0..count)
        .filter(|place| {
            let share = (*place as f64 + 0.5) / count as f64;
            let at = segment.start + (segment.end - segment.start) * share;
            let steepest = |shifts: &[f32]| {
                (shifts.iter())
                    .map(|shift| {
                        steepness(
                            at.x as f32 + shift * normal.x,
                            at.y as f32 + shift * normal.y,
                        )
                    })
                    .fold(0.0, f32::max)
            };
            let near = steepest(&NEAR);
            near > MIN_STEEPNESS && near > steepest(&BESIDE)
        })
        .count();
    hits as f64 >= ON_EDGE * count as f64
}
