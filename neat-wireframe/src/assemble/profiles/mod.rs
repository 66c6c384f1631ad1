//! Lines where the light changes, to a fraction of a pixel, and the edges beside them.
//!
//! Edgels are where smoothed gradients are strongest. Of two edges less than three pixels apart
//! that is neither the one nor the other, and it is the darker side of an edge with much contrast,
//! since files hold about a root of the light that lens and pixels have added up. So the images
//! are asked once more: the light across a line, in all views at once, is explained by steps
//! whose places are the same in space and whose heights are free in each view. The step nearest
//! to a line is where it is. Others are edges beside it, if they explain enough and both halves
//! of the views put them at the same place.

mod bundle;
mod light;
mod profile;
mod pursuit;
mod response;
mod step_fit;
mod step_model;
#[cfg(test)]
mod test_profiles;

use super::edge_samples::Images;
use super::line_fitting::directions_across;
use super::line_selection::ChosenLine;
use super::progress::OnProgress;
use bundle::Bundle;
use image::RgbImage;
use light::LightProfile;
use neat_core::LineSegment3;
use profile::{Across, Profile};
use rayon::prelude::*;
use response::response_of;
use std::borrow::Cow;
use std::ops::ControlFlow;

/// Lines nearer to each other are the same, in pixels: nearer ones are not told apart.
const SAME: f64 = 0.7;
/// Cosine of the largest angle between them, about 14°: ends that are a pixel off turn short
/// lines by that.
const SAME_COSINE: f64 = 0.97;
/// Share of the time after which all images have been looked at.
const LOOKED: f64 = 0.2;
/// So many lines are explained between two words about progress.
const LINES_AT_ONCE: usize = 64;

/// The images of all views.
#[derive(Clone, Copy)]
pub struct Photographs<'a> {
    /// That of a view by its index; one that cannot be had is not asked.
    pub image_of: &'a dyn Fn(usize) -> Option<Cow<'a, RgbImage>>,
    /// Both coordinates of the centre of the first pixel.
    pub pixel_center: f64,
}

/// A line, its profiles, and the directions across it.
type Line<'a> = ((&'a ChosenLine, &'a Vec<Profile>), &'a Option<Across>);

/// Moves lines to where the light changes, and adds those beside them. Those that the images
/// tell nothing of stay.
pub(super) fn place_lines(
    images: &Images,
    photographs: Photographs<'_>,
    lines: &mut Vec<ChosenLine>,
    progress: OnProgress<'_>,
) -> ControlFlow<()> {
    let across: Vec<Option<Across>> = (lines.iter())
        .map(|chosen| {
            let across = directions_across(&chosen.line)?;
            Some([across.column(0).into_owned(), across.column(1).into_owned()])
        })
        .collect();
    let profiles = profiles(images, photographs, lines, &across, progress)?;
    let Some(response) = response_of(&profiles) else {
        return ControlFlow::Continue(());
    };
    let mut bundles: Vec<Option<Bundle>> = Vec::with_capacity(lines.len());
    while bundles.len() < lines.len() {
        let from = bundles.len();
        let to = (from + LINES_AT_ONCE).min(lines.len());
        let some = lines[from..to].par_iter().zip(&profiles[from..to]);
        let of_line = |((chosen, profiles), across): Line<'_>| {
            let in_light = |profile| LightProfile::new(profile, response.exponent);
            let light: Vec<LightProfile> = profiles.iter().map(in_light).collect();
            Bundle::new(&chosen.line, across.as_ref()?, &light, response.blur)
        };
        bundles.par_extend(some.zip(&across[from..to]).map(of_line));
        progress(LOOKED + (1.0 - LOOKED) * to as f64 / lines.len() as f64)?;
    }
    let (before, moved) = (lines.len(), move_lines(lines, &bundles));
    add_beside(images, lines, &bundles);
    let beside = lines.len() - before;
    tracing::debug!(?response, moved, beside, "lines are placed by profiles");
    ControlFlow::Continue(())
}

/// How many lines have moved.
fn move_lines(lines: &mut [ChosenLine], bundles: &[Option<Bundle>]) -> usize {
    let mut moved = 0;
    for (chosen, bundle) in lines.iter_mut().zip(bundles) {
        if let Some(line) = bundle.as_ref().and_then(|bundle| bundle.line) {
            chosen.line = line;
            chosen.placed = true;
            moved += 1;
        }
    }
    moved
}

/// Adds what runs beside lines, the surest first, where no line is yet: as long as the line that
/// it is beside, in the views that show that.
fn add_beside(images: &Images, lines: &mut Vec<ChosenLine>, bundles: &[Option<Bundle>]) {
    let of_bundle = |(parent, bundle): (usize, &Option<Bundle>)| {
        let beside = bundle.iter().flat_map(|bundle| &bundle.beside);
        beside
            .map(move |(line, gain)| (*gain, parent, *line))
            .collect::<Vec<_>>()
    };
    let mut found: Vec<(f64, usize, LineSegment3)> =
        bundles.iter().enumerate().flat_map(of_bundle).collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    for (_, parent, line) in found {
        let evidence = lines[parent].evidence.clone();
        let pixel = images.pixel_size(&line, evidence.views());
        let known = |other: &ChosenLine| runs_along(&other.line, &line, SAME * pixel);
        if !lines.iter().any(known) {
            lines.push(ChosenLine {
                line,
                evidence,
                placed: true,
            });
        }
    }
}

/// Whether the middle of `line` lies on `other`, whose direction is much the same.
fn runs_along(other: &LineSegment3, line: &LineSegment3, gap: f64) -> bool {
    let middle = line.point_at(0.5);
    let [a, b] = [other, line].map(|line| line.end - line.start);
    (0.0..=1.0).contains(&other.line_parameter(&middle))
        && other.distance_to_line(&middle) <= gap
        && a.dot(&b).abs() > SAME_COSINE * a.norm() * b.norm()
}

/// The profiles of all lines, image after image.
fn profiles(
    images: &Images,
    photographs: Photographs<'_>,
    lines: &[ChosenLine],
    across: &[Option<Across>],
    progress: OnProgress<'_>,
) -> ControlFlow<(), Vec<Vec<Profile>>> {
    let mut profiles: Vec<Vec<Profile>> = vec![Vec::new(); lines.len()];
    for view in 0..images.views.len() {
        let Some(image) = (photographs.image_of)(view) else {
            continue;
        };
        let center = photographs.pixel_center;
        let of_lines = profiles.par_iter_mut().zip(lines).zip(across);
        of_lines.for_each(|((profiles, chosen), across)| {
            if let Some(across) = across {
                let line = &chosen.line;
                profiles.extend(images.profiles(view, &image, center, line, across));
            }
        });
        progress(LOOKED * (view + 1) as f64 / images.views.len() as f64)?;
    }
    ControlFlow::Continue(profiles)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, chosen, end_distance};
    use crate::assemble::view_segments::PreparedView;
    use crate::test_scenes::{camera_looking_at_origin, views_of_edges};
    use image::Rgb;
    use nalgebra::{Vector2, Vector3};
    use neat_core::Camera;

    /// Two bright bars in the plane z = 0, of 28 and 3 pixels, as they reach along x.
    const BARS: [[f64; 2]; 2] = [[-0.3, -0.2], [0.2, 0.211]];

    fn cameras() -> Vec<Camera> {
        let place = |k: u32| {
            let (sin, cos) = (0.9 * f64::from(k)).sin_cos();
            2.5 * Vector3::new(0.7 * cos, 0.5 * sin, 1.0).normalize()
        };
        (0..12)
            .map(|k| camera_looking_at_origin(&place(k)))
            .collect()
    }

    /// The bars, which reach beyond the image: each pixel is the root of the light that falls on it.
    fn photograph(camera: &Camera) -> RgbImage {
        RgbImage::from_fn(camera.width, camera.height, |x, y| {
            let mut light = 0.0;
            for k in 0..16 {
                let part = Vector2::new(f64::from(k % 4), f64::from(k / 4)).add_scalar(0.5) / 4.0;
                let pixel = Vector2::new(f64::from(x), f64::from(y)) + part;
                let ray = camera.ray_through(&pixel);
                let x = ray.origin.x - ray.direction.x * ray.origin.z / ray.direction.z;
                let bright = BARS.iter().any(|[from, to]| (*from..*to).contains(&x));
                light += if bright { 0.8 } else { 0.03 } / 16.0;
            }
            Rgb([(255.0 * f64::powf(light, 1.0 / 2.4)) as u8; 3])
        })
    }

    fn edge(x: f64) -> LineSegment3 {
        LineSegment3::new(Vector3::new(x, -0.25, 0.0), Vector3::new(x, 0.25, 0.0))
    }

    #[test]
    fn lines_beside_edges_of_photographs_come_to_lie_on_them_and_find_what_was_missed() {
        let cameras = cameras();
        // The last edge was missed; pixels are 0.0036 wide.
        let seen = [-0.297, -0.203, 0.2035].map(edge);
        let junctions: Vec<Vector3<f64>> = seen.iter().flat_map(LineSegment3::ends).collect();
        let observations = views_of_edges(&cameras, &junctions, &[[0, 1], [2, 3], [4, 5]]);
        let prepared = observations
            .iter()
            .map(|view| PreparedView::new(view, 1.0, 1.0));
        let views = TestViews::of(prepared.collect());
        let images = views.images();
        let mut lines: Vec<ChosenLine> = seen.iter().map(|line| chosen(&images, line)).collect();
        let photographs: Vec<RgbImage> = cameras.iter().map(photograph).collect();
        place(
            &images,
            &|view| Some(Cow::Borrowed(&photographs[view])),
            &mut lines,
        );
        let expected = [-0.3, -0.2, 0.2, 0.211].map(edge);
        assert_eq!(lines.len(), 4);
        for (found, expected) in lines.iter().zip(&expected) {
            assert!(found.placed);
            let off = end_distance(&found.line, expected);
            // A fifth of a pixel, of which lines were off by one: between pixels values are not quite
            // a root of light.
            assert!(off < 7e-4, "{off} {:?}", found.line);
        }
    }

    #[test]
    fn lines_stay_where_no_image_can_be_had_or_tells() {
        let cameras = cameras();
        let junctions = edge(-0.3).ends();
        let observations = views_of_edges(&cameras, &junctions, &[[0, 1]]);
        let prepared = observations
            .iter()
            .map(|view| PreparedView::new(view, 1.0, 1.0));
        let views = TestViews::of(prepared.collect());
        let images = views.images();
        let before = [chosen(&images, &edge(-0.3))];
        for image in [
            None,
            Some(RgbImage::new(512, 512)),
            Some(RgbImage::new(3, 3)),
        ] {
            let mut lines = before.to_vec();
            place(&images, &|_| image.as_ref().map(Cow::Borrowed), &mut lines);
            assert_eq!(lines.len(), 1);
            assert_eq!(lines[0].line, before[0].line);
            assert!(!lines[0].placed);
        }
    }

    fn place<'a>(
        images: &Images,
        image_of: &'a dyn Fn(usize) -> Option<Cow<'a, RgbImage>>,
        lines: &mut Vec<ChosenLine>,
    ) {
        let photographs = Photographs {
            image_of,
            pixel_center: 0.5,
        };
        let go_on = &mut |_| ControlFlow::Continue(());
        assert!(place_lines(images, photographs, lines, go_on).is_continue());
    }
}
