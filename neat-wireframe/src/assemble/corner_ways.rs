//! The ways by which one line may go over into another one that it would meet: sharply, along an arc, or
//! along a third line that cuts the corner; and what the images say about each.

use super::corners::{MAX_GAP, MAX_WINDOW_SHARE, WINDOW_IN_PIXELS, beyond_end, nearest_points};
use super::curves::BESIDE_IN_PIXELS;
use super::edge_samples::{Images, Sample};
use super::line_evidence::Showing;
use super::line_extent::gain_of_sample;
use nalgebra::Vector3;
use neat_core::{CircularArc, LineSegment3};

/// Smoothing rounds corners by so many pixels: nearer to a sharp one nothing is asked …
const ROUNDING_IN_PIXELS: f64 = 2.0;
/// … and an arc that comes nearer to it may be a sharp one, judged.
const MIN_RISE_IN_PIXELS: f64 = 2.5;
/// An edge goes on over so many pixels of its arc, besides those that cannot be told apart, judged.
const OVER_IN_PIXELS: f64 = 4.0;
/// Of both lines so many pixels are asked with the arc.
const MARGIN_IN_PIXELS: f64 = 6.0;
/// Distance between samples, in pixels.
pub(super) const SPACING: f64 = 2.0;
/// Lines under a smaller angle than this have no corner to round (cosine), about 15°.
const MAX_COSINE: f64 = 0.966;

/// Where two lines in one plane would meet.
pub(super) struct Meet {
    point: Vector3<f64>,
    /// From it along both lines.
    pub toward: [Vector3<f64>; 2],
    /// Between both, and cosine and tangent of the angle to either.
    pub bisector: Vector3<f64>,
    pub cosine: f64,
    pub tangent: f64,
    /// How far it lies beyond the nearest end of each line (inside: negative), and that end.
    pub beyond: [(f64, usize); 2],
    /// How far from it the other end of each line lies.
    far: [f64; 2],
}

impl Meet {
    /// Of lines that come as near to each other as `most`.
    pub(super) fn of(lines: [&LineSegment3; 2], most: f64) -> Option<Self> {
        let (places, gap) = nearest_points(lines[0], lines[1])?;
        if gap > most {
            return None;
        }
        let beyond = [0, 1].map(|k| beyond_end(places[k], lines[k].length()));
        let point = 0.5 * (lines[0].point_at(places[0]) + lines[1].point_at(places[1]));
        let far = [0, 1].map(|k| lines[k].ends()[1 - beyond[k].1] - point);
        let toward = far.map(|far| far.normalize());
        let bisector = (toward[0] + toward[1]).try_normalize(1e-9)?;
        let cosine = bisector.dot(&toward[0]);
        Some(Self {
            point,
            toward,
            bisector,
            cosine,
            tangent: (1.0 - cosine * cosine).sqrt() / cosine,
            beyond,
            far: far.map(|far| far.norm()),
        })
    }

    /// How far the arc that begins at a distance of 1 passes the corner.
    fn rise(&self) -> f64 {
        self.cosine.recip() - self.tangent
    }

    /// The arc that begins so far from the corner, on the first line.
    pub(super) fn arc(&self, from: f64) -> Option<CircularArc> {
        let middle = from * self.rise() * self.bisector;
        let points = [from * self.toward[0], middle, from * self.toward[1]];
        CircularArc::through(points.map(|point| self.point + point))
    }

    /// How a point of the arc moves as that begins farther from the corner, by its direction from the
    /// centre.
    pub(super) fn moved(&self, outward: &Vector3<f64>) -> f64 {
        self.tangent + outward.dot(&self.bisector) / self.cosine
    }
}

/// Where two lines meet, and the arcs that may round it.
pub(super) struct Corner {
    pub lines: [usize; 2],
    pub meet: Meet,
    /// From where to where an arc may begin, away from the corner.
    pub bounds: [f64; 2],
    pub pixel: f64,
}

impl Corner {
    /// Of two lines of these numbers.
    pub(super) fn between(
        images: &Images,
        numbers: [usize; 2],
        lines: [&LineSegment3; 2],
        pixel: f64,
    ) -> Option<Self> {
        let reach = images.reach * pixel;
        let meet = Meet::of(lines, MAX_GAP * reach)?;
        let short = meet.beyond[0].0.max(meet.beyond[1].0);
        // Beside an arc, twice as far as they cannot be told apart: t = short + 2 √(2 r δ), r = t tan.
        let over = (2.0 * reach * meet.tangent).sqrt();
        let most = (over + (over * over + short.max(0.0)).sqrt()).powi(2);
        let bounds = [
            (short - WINDOW_IN_PIXELS * pixel).max(MIN_RISE_IN_PIXELS * pixel / meet.rise()),
            (most + OVER_IN_PIXELS * pixel)
                .min(meet.far[0])
                .min(meet.far[1]),
        ];
        let is_corner = meet.toward[0].dot(&meet.toward[1]).abs() < MAX_COSINE;
        let mut beyond = meet.beyond.iter();
        let ends_there = beyond.all(|(beyond, _)| *beyond > -OVER_IN_PIXELS * pixel);
        (is_corner && ends_there && 0.0 < bounds[0] && bounds[0] < bounds[1]).then_some(Self {
            lines: numbers,
            meet,
            bounds,
            pixel,
        })
    }

    /// The ends of the lines there.
    pub(super) fn ends(&self) -> [usize; 2] {
        self.meet.beyond.map(|(_, end)| end)
    }

    /// Each `2 * line + end`.
    pub(super) fn ends_of_lines(&self) -> [usize; 2] {
        [0, 1].map(|side| 2 * self.lines[side] + self.meet.beyond[side].1)
    }

    /// How far from the corner both lines are asked.
    fn asked(&self) -> f64 {
        self.bounds[1] + MARGIN_IN_PIXELS * self.pixel
    }
}

/// A way from one line to the other.
pub(super) struct Way<'a> {
    pub corner: &'a Corner,
    /// How far from the corner it leaves the lines.
    from: [f64; 2],
    between: Between,
}

/// What lies between both lines.
enum Between {
    /// Nothing that is asked: they meet.
    Nothing,
    Line(LineSegment3),
    Arc(CircularArc),
}

impl<'a> Way<'a> {
    pub(super) fn sharp(corner: &'a Corner) -> Self {
        Self {
            corner,
            from: [ROUNDING_IN_PIXELS * corner.pixel; 2],
            between: Between::Nothing,
        }
    }

    /// By a line that runs from one to the other.
    pub(super) fn cut(
        corner: &'a Corner,
        lines: [&LineSegment3; 2],
        cut: &LineSegment3,
    ) -> Option<Self> {
        let gap = BESIDE_IN_PIXELS * corner.pixel;
        let window = (WINDOW_IN_PIXELS * corner.pixel).min(MAX_WINDOW_SHARE * cut.length());
        let from = |line: &LineSegment3, toward: &Vector3<f64>| {
            let ([place, along], apart) = nearest_points(line, cut)?;
            let from = (line.point_at(place) - corner.meet.point).dot(toward);
            let beyond = beyond_end(along, cut.length()).0.abs();
            (apart <= gap && beyond <= window && from > 0.0).then_some((from, cut.point_at(along)))
        };
        let (one, start) = from(lines[0], &corner.meet.toward[0])?;
        let (other, end) = from(lines[1], &corner.meet.toward[1])?;
        Some(Self {
            corner,
            from: [one, other],
            between: Between::Line(LineSegment3::new(start, end)),
        })
    }

    pub(super) fn round(corner: &'a Corner, from: f64) -> Option<Self> {
        Some(Self {
            corner,
            from: [from; 2],
            between: Between::Arc(corner.meet.arc(from)?),
        })
    }

    /// The places of both lines, as distances from the corner along it: negative on the first.
    pub(super) fn on_lines(&self) -> [[f64; 2]; 2] {
        let asked = self.corner.asked();
        let [one, other] = self.from;
        [[-asked, -one], [other, asked]]
    }

    pub(super) fn point(&self, place: f64) -> Vector3<f64> {
        let Meet { point, toward, .. } = &self.corner.meet;
        point + place.abs() * toward[usize::from(place > 0.0)]
    }

    /// What each view says about it, by its length.
    pub(super) fn gains(&self, images: &Images, views: &[Showing]) -> Vec<f64> {
        let of_view = |showing: &Showing| {
            let samples = |part: [f64; 2], at: &dyn Fn(f64) -> Vector3<f64>| {
                images.samples_of_curve(showing.view, part, SPACING, |place| Some(at(place)))
            };
            let between = match &self.between {
                Between::Nothing => None,
                Between::Line(line) => samples([0.0, 1.0], &|place| line.point_at(place)),
                Between::Arc(arc) => samples(arc.angles, &|angle| arc.point_at(angle)),
            };
            let on_lines = self.on_lines();
            let of_lines = on_lines.into_iter().filter(|part| part[0] < part[1]);
            let of_lines = of_lines.map(|part| samples(part, &|place| self.point(place)));
            (of_lines.chain([between]).flatten())
                .map(|samples| gain_of_part(images, showing, &samples))
                .sum()
        };
        views.iter().map(of_view).collect()
    }
}

/// What a view says about a part of a way, as if its samples were as far apart as others.
fn gain_of_part(images: &Images, Showing { view, chance }: &Showing, samples: &[Sample]) -> f64 {
    let gain = |sample: &Sample| gain_of_sample(images.has_edgel(*view, sample, None), *chance);
    let steps = samples
        .windows(2)
        .map(|pair| (pair[1].pixel - pair[0].pixel).norm());
    let spacing = steps.sum::<f64>() / (samples.len() - 1) as f64;
    spacing / SPACING * samples.iter().map(gain).sum::<f64>()
}
