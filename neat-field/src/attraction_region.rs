//! Attraction regions: the pixels that a 2D segment attracts, and where to.
//!
//! The attraction field of an image sends every pixel to its nearest point on
//! its nearest segment (paper §3.2). Only pixels near a segment are
//! *foreground*: from them NEAT draws its rays, and their labels say which
//! segment a ray must render.

use neat_core::LineSegment2;

/// Added to the squared length of a segment, so that a segment without length
/// attracts like a disc (`linesegment.cu` of HAWP).
const SQUARED_LENGTH_GUARD: f64 = 1e-6;

/// Pixels are visited this much beyond the threshold, so that rounding in the
/// bounds of a row cannot lose one. The distance test decides.
const REACH_MARGIN: f64 = 1e-3;

/// The foreground pixels of one view, in row-major order.
///
/// One entry per pixel in each of the parallel lists. A pixel is foreground if
/// the nearest point of its nearest segment is not an end cap and lies within
/// the threshold. So a pixel whose nearest segment is reached at an end point is
/// background, even with the inside of another segment in range; of equally
/// near segments the first attracts.
///
/// Regions are nested: label, foot and parameter of a pixel do not depend on the
/// threshold, which is why [`Self::thin`] can narrow regions after the fact.
///
/// # Example
/// ```
/// use nalgebra::Vector2;
/// use neat_core::LineSegment2;
/// use neat_field::attraction_region::AttractionRegions;
///
/// let segment = LineSegment2::new(Vector2::new(2.0, 4.0), Vector2::new(6.0, 4.0));
/// let regions = AttractionRegions::compute(&[segment], 9, 9, 0.0, 1.0);
/// assert_eq!(regions.len(), 3 * 5); // rows 3 to 5, columns 2 to 6
/// assert_eq!(regions.thin(0.5).len(), 5);
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AttractionRegions {
    /// Pixel index `row · width + column`, ascending.
    pub pixels: Vec<u32>,
    /// Index of the attracting segment.
    pub labels: Vec<u32>,
    /// The attracting point on that segment, `[x, y]` in image coordinates.
    pub feet: Vec<[f32; 2]>,
    /// Distance from the pixel's centre to the foot, in pixels.
    pub distances: Vec<f32>,
    /// Where the foot lies on the segment: 0 at its start, 1 at its end.
    pub parameters: Vec<f32>,
}

impl AttractionRegions {
    /// The regions of `segments` in a `width × height` image, for pixels at most
    /// `threshold` pixels away (published: 10 for ABC, 5 for DTU and BlendedMVS,
    /// 1 in final parsing).
    ///
    /// `segments` are in image coordinates, where pixel `(0, 0)` has its centre
    /// at `(pixel_center, pixel_center)`. A segment that is not finite attracts
    /// nothing, and no pixel is within a negative or NaN threshold.
    ///
    /// Source: Appendix B; `BlenderDataset.compute_point_line_attraction`.
    ///
    /// # Panics
    /// If the image has more than `u32::MAX` pixels.
    pub fn compute(
        segments: &[LineSegment2],
        width: u32,
        height: u32,
        pixel_center: f64,
        threshold: f64,
    ) -> Self {
        let mut regions = Self::default();
        for_each_pixel(
            segments,
            (width, height),
            pixel_center,
            threshold,
            |found| {
                regions.pixels.push(found.pixel);
                regions.labels.push(found.attraction.label);
                regions.feet.push(found.attraction.foot(found.center));
                regions.distances.push(found.distance);
                regions.parameters.push(found.attraction.parameter);
            },
        );
        regions
    }

    /// The narrower regions of a smaller threshold: what [`Self::compute`] gives
    /// for it. A larger threshold than the one computed with changes nothing.
    pub fn thin(&self, threshold: f64) -> Self {
        let kept: Vec<usize> = (0..self.len())
            .filter(|&i| within(self.distances[i], threshold))
            .collect();
        Self {
            pixels: select(&self.pixels, &kept),
            labels: select(&self.labels, &kept),
            feet: select(&self.feet, &kept),
            distances: select(&self.distances, &kept),
            parameters: select(&self.parameters, &kept),
        }
    }

    /// Number of foreground pixels.
    pub fn len(&self) -> usize {
        self.pixels.len()
    }

    /// Whether no pixel is foreground.
    pub fn is_empty(&self) -> bool {
        self.pixels.is_empty()
    }
}

/// A foreground pixel.
pub(crate) struct Foreground {
    /// `row · width + column`.
    pub pixel: u32,
    pub attraction: Attraction,
    /// Of the pixel, in image coordinates.
    center: [f64; 2],
    /// From there to the foot, in pixels.
    distance: f32,
}

/// Calls `visit` with every foreground pixel, in row-major order; the arguments are
/// those of [`AttractionRegions::compute`].
///
/// # Panics
/// If the image has more than `u32::MAX` pixels.
pub(crate) fn for_each_pixel(
    segments: &[LineSegment2],
    (width, height): (u32, u32),
    pixel_center: f64,
    threshold: f64,
    mut visit: impl FnMut(Foreground),
) {
    assert!(
        width.checked_mul(height).is_some(),
        "attraction regions: a {width}×{height} image has too many pixels"
    );
    if threshold.is_nan() || threshold < 0.0 {
        return;
    }
    // Why visiting only the strips gives the minimum over all segments for
    // every pixel that can be foreground: a pixel outside the strip of a
    // segment is farther than the threshold from it. If a visited segment is
    // within the threshold, no unvisited one can be nearer or equally near;
    // if none is, the pixel is background whatever the others say.
    let strips: Vec<Strip> = (0..)
        .zip(segments)
        .filter_map(|(label, segment)| Strip::new(segment, label, threshold))
        .collect();
    let mut nearest = vec![Attraction::NONE; width as usize];
    for row in 0..height {
        nearest.fill(Attraction::NONE);
        let y = f64::from(row) + pixel_center;
        for strip in &strips {
            for column in strip.columns(y, width, pixel_center) {
                let x = f64::from(column) + pixel_center;
                let attraction = strip.attract([x, y]);
                let best = &mut nearest[column as usize];
                if attraction.squared_distance < best.squared_distance {
                    *best = attraction;
                }
            }
        }
        for (column, attraction) in (0..width).zip(&nearest) {
            if !attraction.is_inside() {
                continue;
            }
            let distance = attraction.squared_distance.sqrt();
            if within(distance, threshold) {
                visit(Foreground {
                    pixel: row * width + column,
                    attraction: *attraction,
                    center: [f64::from(column) + pixel_center, y],
                    distance,
                });
            }
        }
    }
}

/// The one test of membership. It reads the stored precision, so that thinning
/// agrees with computing anew to the last bit.
fn within(distance: f32, threshold: f64) -> bool {
    f64::from(distance) <= threshold
}

fn select<T: Copy>(values: &[T], indices: &[usize]) -> Vec<T> {
    indices.iter().map(|&i| values[i]).collect()
}

/// Where a segment pulls a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Attraction {
    /// In single precision, as published: there the pixels on the bisector of two
    /// segments are ties, which the first wins, and not decided by rounding.
    squared_distance: f32,
    /// On the infinite line: outside [0, 1] the foot is an end cap.
    parameter: f32,
    /// From the pixel to the foot.
    offset: [f64; 2],
    pub label: u32,
}

impl Attraction {
    const NONE: Self = Self {
        squared_distance: f32::INFINITY,
        parameter: f32::NAN,
        offset: [0.0; 2],
        label: u32::MAX,
    };

    fn is_inside(&self) -> bool {
        (0.0..=1.0).contains(&self.parameter)
    }

    fn foot(&self, pixel: [f64; 2]) -> [f32; 2] {
        std::array::from_fn(|axis| (self.offset[axis] + pixel[axis]) as f32)
    }
}

/// A segment with the part of the image that it can attract: the strip of half
/// width `reach` around its line, cut by its dilated bounding box.
struct Strip {
    label: u32,
    start: [f64; 2],
    direction: [f64; 2],
    squared_length: f64,
    reach: f64,
    min: [f64; 2],
    max: [f64; 2],
}

impl Strip {
    /// `None` if the segment is not finite.
    fn new(segment: &LineSegment2, label: u32, threshold: f64) -> Option<Self> {
        let reach = threshold + REACH_MARGIN;
        let direction = segment.end - segment.start;
        let squared_length = direction.norm_squared();
        let min = segment.start.inf(&segment.end).add_scalar(-reach);
        let max = segment.start.sup(&segment.end).add_scalar(reach);
        let finite = segment.start.iter().all(|c| c.is_finite()) && squared_length.is_finite();
        finite.then(|| Self {
            label,
            start: segment.start.into(),
            direction: direction.into(),
            squared_length,
            reach,
            min: min.into(),
            max: max.into(),
        })
    }

    /// The columns of the row at height `y` that the strip covers.
    fn columns(&self, y: f64, width: u32, pixel_center: f64) -> std::ops::Range<u32> {
        if y < self.min[1] || y > self.max[1] {
            return 0..0;
        }
        let (mut left, mut right) = (self.min[0], self.max[0]);
        let [dx, dy] = self.direction;
        if dy != 0.0 {
            // |cross(direction, pixel - start)| <= reach · length, solved for x.
            let crossing = self.start[0] + (y - self.start[1]) * dx / dy;
            let half_width = self.reach * (self.squared_length.sqrt() / dy).abs();
            left = left.max(crossing - half_width);
            right = right.min(crossing + half_width);
        }
        // Float to integer casts saturate, which clips to the image.
        let first = (left - pixel_center).ceil() as u32;
        let end = ((right - pixel_center).floor() + 1.0) as u32;
        first..end.min(width)
    }

    #[inline]
    fn attract(&self, pixel: [f64; 2]) -> Attraction {
        let [ax, ay] = self.start;
        let [dx, dy] = self.direction;
        let [x, y] = pixel;
        let along = (x - ax) * dx + (y - ay) * dy;
        // Rounding removes what the guard takes from 1 at the end of a segment: a
        // pixel that two segments share as an end point is a tie too.
        let parameter = (along / (self.squared_length + SQUARED_LENGTH_GUARD)) as f32;
        let clamped = f64::from(parameter.clamp(0.0, 1.0));
        let offset = [ax + clamped * dx - x, ay + clamped * dy - y];
        Attraction {
            squared_distance: (offset[0] * offset[0] + offset[1] * offset[1]) as f32,
            parameter,
            offset,
            label: self.label,
        }
    }
}
