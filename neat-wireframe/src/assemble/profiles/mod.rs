//! Lines and arcs where the light changes, to a fraction of a pixel, and the edges beside lines.
//!
//! Edgels are where smoothed gradients are strongest. Of two edges less than three pixels apart
//! that is neither the one nor the other, and it is the darker side of an edge with much contrast,
//! since files hold about a root of the light that lens and pixels have added up. So the images
//! are asked once more: the light across a curve, in all views at once, is explained by steps
//! whose places are the same in space and whose heights are free in each view. The step nearest
//! to a curve is where it is. Others are edges beside it, if they explain enough and both halves
//! of the views put them at the same place. A line whose step moves aside as that of
//! a fillet does is no edge.

mod bundle;
mod circular;
mod covariance;
mod curve;
mod light;
mod normal_distribution;
mod pixels;
mod placed_arcs;
mod profile;
mod pursuit;
mod response;
mod rounding;
mod short_pieces;
mod softness;
mod step_fit;
mod step_model;
mod straight;
#[cfg(test)]
mod test_profiles;

use super::circle_fitting::FoundArc;
use super::edge_samples::Images;
use super::line_selection::ChosenLine;
use super::outlines::MIN_REACHES;
use super::progress::{OnProgress, part};
use bundle::Bundle;
use circular::Circular;
use curve::Curve;
use image::RgbImage;
use light::LightProfile;
pub(super) use light::Response;
use neat_core::{Camera, LineSegment3};
use pixels::Pixels;
use placed_arcs::{PlacedArc, move_arcs};
use profile::{Profile, profiles};
use rayon::prelude::*;
use response::response_of;
use rounding::{ADVANTAGE, Widths, outline_gain};
pub(super) use short_pieces::{Asked, light_across};
use softness::{Softness, least_gain};
use std::borrow::Cow;
use std::ops::ControlFlow;
use straight::Straight;

/// Lines nearer to each other are the same, in pixels: nearer ones are not told apart.
const SAME: f64 = 0.7;
/// Cosine of the largest angle between them, about 14°: ends that are a pixel off turn short
/// lines by that.
const SAME_COSINE: f64 = 0.97;
/// Shares of the time after which all images have been looked at, and arcs explained.
const LOOKED: f64 = 0.2;
const ROUND: f64 = 0.3;
/// So many curves are explained between two words about progress.
const CURVES_AT_ONCE: usize = 64;

/// The images of all views.
#[derive(Clone, Copy)]
pub struct Photographs<'a> {
    /// That of a view by its index; one that cannot be had is not asked.
    pub image_of: &'a dyn Fn(usize) -> Option<Cow<'a, RgbImage>>,
    /// Both coordinates of the centre of the first pixel.
    pub pixel_center: f64,
}

/// Curves, and what the views show across each.
struct Profiled<const N: usize, C> {
    curves: Vec<C>,
    profiles: Vec<Vec<Profile<N>>>,
}

impl<const N: usize, C: Curve<N>> Profiled<N, C> {
    fn new(curves: Vec<C>) -> Self {
        let profiles = curves.iter().map(|_| Vec::new()).collect();
        Self { curves, profiles }
    }

    /// Adds what one view shows.
    fn look(&mut self, view: usize, camera: &Camera, image: &Pixels<'_>) {
        let curves = self.curves.par_iter().zip(&mut self.profiles);
        curves.for_each(|(curve, found)| found.extend(profiles(curve, view, camera, image)));
    }

    /// What is made of the bundle that explains the profiles of each curve.
    fn explained<T: Send>(
        &self,
        response: Response,
        make: impl Fn(&C, &[LightProfile<N>], &Bundle<'_, N>) -> T + Sync,
        progress: OnProgress<'_>,
    ) -> ControlFlow<(), Vec<Option<T>>> {
        let count = self.curves.len();
        let mut made = Vec::with_capacity(count);
        while made.len() < count {
            let from = made.len();
            let to = (from + CURVES_AT_ONCE).min(count);
            let some = self.curves[from..to].par_iter();
            let of_curve = |(curve, profiles): (&C, &Vec<Profile<N>>)| {
                let in_light = |profile| LightProfile::new(profile, response.exponent);
                let light: Vec<LightProfile<N>> = profiles.iter().map(in_light).collect();
                Bundle::new(curve, &light, response.blur).map(|bundle| make(curve, &light, &bundle))
            };
            made.par_extend(some.zip(&self.profiles[from..to]).map(of_curve));
            progress(to as f64 / count as f64)?;
        }
        ControlFlow::Continue(made)
    }
}

/// Moves lines and arcs to where the light changes, adds lines beside lines, and leaves out the
/// middles of rounded edges. Those that the images tell nothing of stay.
pub(super) fn place_curves(
    images: &Images,
    photographs: Photographs<'_>,
    lines: &mut Vec<ChosenLine>,
    arcs: &mut [FoundArc],
    progress: OnProgress<'_>,
) -> ControlFlow<(), Option<Response>> {
    let of_line = |(index, chosen): (usize, &ChosenLine)| {
        Straight::new(&chosen.line).map(|straight| (index, straight))
    };
    let (indices, straight): (Vec<usize>, Vec<Straight>) =
        lines.iter().enumerate().filter_map(of_line).unzip();
    let mut straight = Profiled::new(straight);
    let mut circular = Profiled::new(arcs.iter().map(Circular::new).collect());
    for (view, prepared) in images.views.iter().enumerate() {
        let camera = &prepared.camera;
        if let Some(image) = (photographs.image_of)(view)
            && image.dimensions() == (camera.width, camera.height)
        {
            let pixels = Pixels {
                image: &image,
                pixel_center: photographs.pixel_center,
            };
            straight.look(view, camera, &pixels);
            circular.look(view, camera, &pixels);
        }
        progress(LOOKED * (view + 1) as f64 / images.views.len() as f64)?;
    }
    let Some(response) = response_of(&straight.profiles, &circular.profiles) else {
        return ControlFlow::Continue(None);
    };
    let moved_arcs = {
        let progress = &mut part(progress, [LOOKED, ROUND]);
        move_arcs(
            arcs,
            circular.explained(
                response,
                |arc, _, bundle| PlacedArc::new(arc, bundle),
                progress,
            )?,
        )
    };
    let placed = {
        let progress = &mut part(progress, [ROUND, 1.0]);
        let widths = Widths::new(response.blur);
        let least_radius = MIN_REACHES * images.reach;
        let of_line = |straight: &Straight, light: &[LightProfile<4>], bundle: &Bundle<'_, 4>| {
            let as_outline = outline_gain(light, &widths, response.blur, least_radius);
            (as_outline, PlacedLine::new(straight, bundle))
        };
        straight.explained(response, of_line, progress)?
    };
    let (rounded, placed) = told_apart(lines, indices, &straight.profiles, placed, response.blur);
    let (before, moved) = (lines.len(), move_lines(lines, &placed));
    add_beside(images, lines, placed);
    let beside = lines.len() - before;
    let mut index = 0..;
    lines.retain(|_| index.next().is_none_or(|index| !rounded.contains(&index)));
    tracing::debug!(
        ?response,
        moved,
        beside,
        moved_arcs,
        rounded = rounded.len(),
        "curves are placed by profiles"
    );
    ControlFlow::Continue(Some(response))
}

/// The middles of rounded edges, and what profiles tell of the other lines: `told` is that of all
/// that have `profiles`, and by how much each is rather the outline of a fillet than an edge.
fn told_apart(
    lines: &[ChosenLine],
    indices: Vec<usize>,
    profiles: &[Vec<Profile<4>>],
    told: Vec<Option<(f64, PlacedLine)>>,
    blur: f64,
) -> (Vec<usize>, Vec<(usize, PlacedLine)>) {
    let views = |index: &usize| lines[*index].evidence.views().collect();
    let shown: Vec<Vec<usize>> = indices.iter().map(views).collect();
    let from_in_front = Softness::new(blur).gains(profiles, &shown);
    let least = least_gain(&from_in_front, ADVANTAGE);
    let (mut rounded, mut others) = (Vec::new(), Vec::new());
    for ((index, line), in_front) in indices.into_iter().zip(told).zip(from_in_front) {
        let as_outline = line.as_ref().map_or(0.0, |(gain, _)| *gain);
        if as_outline + in_front > least {
            rounded.push(index);
        } else if let Some((_, line)) = line {
            others.push((index, line));
        }
    }
    (rounded, others)
}

/// What profiles tell of a line.
struct PlacedLine {
    /// Where it is.
    line: Option<LineSegment3>,
    /// What runs beside it, and by how much that lowers the loss of a profile.
    beside: Vec<(LineSegment3, f64)>,
}

impl PlacedLine {
    fn new(straight: &Straight, bundle: &Bundle<'_, 4>) -> Self {
        let beside = bundle.beside.iter();
        Self {
            line: bundle.own.map(|step| straight.moved(&step)),
            beside: (beside.map(|(step, gain)| (straight.moved(step), *gain))).collect(),
        }
    }
}

/// How many lines have moved.
fn move_lines(lines: &mut [ChosenLine], placed: &[(usize, PlacedLine)]) -> usize {
    let mut moved = 0;
    for (index, placed) in placed {
        if let Some(line) = placed.line {
            lines[*index].line = line;
            lines[*index].placed = true;
            moved += 1;
        }
    }
    moved
}

/// Adds what runs beside lines, the surest first, where no line is yet: as long as the line that
/// it is beside, in the views that show that.
fn add_beside(images: &Images, lines: &mut Vec<ChosenLine>, placed: Vec<(usize, PlacedLine)>) {
    let of_line = |(index, placed): (usize, PlacedLine)| {
        let beside = placed.beside.into_iter();
        beside.map(move |(line, gain)| (gain, index, line))
    };
    let mut found: Vec<(f64, usize, LineSegment3)> = placed.into_iter().flat_map(of_line).collect();
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

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::assemble::test_views::{TestViews, chosen, end_distance};
    use crate::test_scenes::camera_looking_at_origin;
    use image::Rgb;
    use nalgebra::{Vector2, Vector3};
    use neat_core::Camera;

    /// Two bright bars in the plane z = 0, of 28 and 3 pixels, as they reach along x.
    const BARS: [[f64; 2]; 2] = [[-0.3, -0.2], [0.2, 0.211]];

    pub(in crate::assemble) fn cameras() -> Vec<Camera> {
        let place = |k: u32| {
            let (sin, cos) = (0.9 * f64::from(k)).sin_cos();
            2.5 * Vector3::new(0.7 * cos, 0.5 * sin, 1.0).normalize()
        };
        (0..12)
            .map(|k| camera_looking_at_origin(&place(k)))
            .collect()
    }

    /// The bars, which reach beyond the image: each pixel is the root of the light that falls on it.
    pub(in crate::assemble) fn photograph(camera: &Camera) -> RgbImage {
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
        let views = TestViews::of_edges(&cameras, &junctions, &[[0, 1], [2, 3], [4, 5]]);
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
        let views = TestViews::of_edges(&cameras, &junctions, &[[0, 1]]);
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
        assert!(place_curves(images, photographs, lines, &mut [], go_on).is_continue());
    }
}
