//! Segments of edge maps: images in which edges are bright lines on black.
//!
//! Lines are thinned to one pixel (Zhang and Suen, 1984), followed from end to end
//! and split where they bend (Douglas and Peucker, 1973).

use image::GrayImage;
use nalgebra::Vector2;
use neat_core::{LineSegment2, SceneError, image_file};
use std::path::Path;

/// Pixels at least this bright are edges, as a share of the brightest.
const THRESHOLD: f64 = 0.5;
/// A piece of a line is straight if it keeps this near to its chord, in pixels.
const STRAIGHT: f64 = 1.5;
/// Shorter pieces are dropped, in pixels.
const MIN_LENGTH: f64 = 5.0;
/// Thicker lines than twice this, in pixels, are no lines: thinning stops.
const MAX_THINNING: usize = 32;
/// The longest side of an edge map, in pixels.
const MAX_SIDE: u32 = 1 << 14;
/// Neighbours of a pixel, clockwise from the one above.
const NEIGHBORS: [[isize; 2]; 8] = [
    [0, -1],
    [1, -1],
    [1, 0],
    [1, 1],
    [0, 1],
    [-1, 1],
    [-1, 0],
    [-1, -1],
];

/// Reads an edge map.
///
/// # Errors
/// If the file is missing, empty or no image.
pub fn read(path: &Path) -> Result<GrayImage, SceneError> {
    parse(
        &neat_core::file::read(path, "give one edge map per image")?,
        path,
    )
}

/// [`read`] from bytes; `path` is for messages.
///
/// # Errors
/// As [`read`].
pub fn parse(bytes: &[u8], path: &Path) -> Result<GrayImage, SceneError> {
    Ok(image_file::decode(bytes, path, MAX_SIDE)?.into_luma8())
}

/// The straight pieces of the lines of an edge map.
///
/// ```
/// let mut map = image::GrayImage::new(60, 40);
/// for x in 10..50 {
///     map.put_pixel(x, 20, image::Luma([255]));
/// }
/// let segments = neat_detect::edge_map::segments(&map);
/// assert_eq!(segments.len(), 1);
/// assert!(segments[0].length() > 35.0);
/// ```
pub fn segments(map: &GrayImage) -> Vec<LineSegment2> {
    let brightest = map.iter().copied().max().unwrap_or(0);
    let threshold = (f64::from(brightest) * THRESHOLD).max(1.0);
    let mut lines = Mask::new(map, |value| f64::from(value) >= threshold);
    lines.thin();
    lines.cut_corners();
    let mut segments = Vec::new();
    let width = lines.width;
    lines.for_each_chain(|chain| split(chain, width, &mut segments));
    segments
}

/// A binary image with a margin of one pixel, which is never set.
struct Mask {
    width: usize,
    set: Vec<bool>,
}

impl Mask {
    fn new(map: &GrayImage, is_set: impl Fn(u8) -> bool) -> Self {
        let (width, height) = (map.width() as usize + 2, map.height() as usize + 2);
        let mut set = vec![false; width * height];
        for (x, y, value) in map.enumerate_pixels() {
            set[(y as usize + 1) * width + x as usize + 1] = is_set(value.0[0]);
        }
        Self { width, set }
    }

    /// The indices of the eight neighbours of an inner pixel.
    fn neighbors(&self, index: usize) -> [usize; 8] {
        NEIGHBORS.map(|[x, y]| index.wrapping_add_signed(y * self.width as isize + x))
    }

    /// Thins lines to one pixel. Only what has a neighbour that is not set can go: the inside of
    /// what is wide is left alone until its border has come that far.
    fn thin(&mut self) {
        let mut border: Vec<usize> = (0..self.set.len())
            .filter(|&index| self.set[index] && self.is_at_border(index))
            .collect();
        for _ in 0..MAX_THINNING {
            let mut changed = false;
            for first_pass in [true, false] {
                let removed: Vec<usize> = (border.iter().copied())
                    .filter(|&index| self.is_removable(index, first_pass))
                    .collect();
                changed |= !removed.is_empty();
                // What has had such a neighbour before is in the list already.
                let mut bared: Vec<usize> = (removed.iter())
                    .flat_map(|&index| self.neighbors(index))
                    .filter(|&index| self.set[index] && !self.is_at_border(index))
                    .collect();
                bared.sort_unstable();
                bared.dedup();
                for index in removed {
                    self.set[index] = false;
                }
                border.retain(|&index| self.set[index]);
                border.extend(bared);
            }
            if !changed {
                return;
            }
        }
    }

    fn is_at_border(&self, index: usize) -> bool {
        !self.neighbors(index).iter().all(|&at| self.set[at])
    }

    /// Takes the corners out of staircases, which thinning leaves: they have three
    /// neighbours like a branch, but what they join touches without them.
    fn cut_corners(&mut self) {
        for index in 0..self.set.len() {
            if !self.set[index] {
                continue;
            }
            let around = self.neighbors(index).map(|neighbor| self.set[neighbor]);
            // Two sides that touch each other, and nothing on the other side.
            let is_corner = (0..8).step_by(2).any(|side| {
                let at = |turn: usize| around[(side + turn) % 8];
                at(0) && at(2) && !at(4) && !at(5) && !at(6)
            });
            if is_corner {
                self.set[index] = false;
            }
        }
    }

    /// The condition of Zhang and Suen.
    fn is_removable(&self, index: usize, first_pass: bool) -> bool {
        let around = self.neighbors(index).map(|neighbor| self.set[neighbor]);
        let count = around.iter().filter(|set| **set).count();
        let rises = (0..8)
            .filter(|&i| !around[i] && around[(i + 1) % 8])
            .count();
        let [up, right, down, left] = [around[0], around[2], around[4], around[6]];
        let open = if first_pass {
            !(right && down && (up || left))
        } else {
            !(up && left && (right || down))
        };
        (2..=6).contains(&count) && rises == 1 && open
    }

    /// Tells the lines as chains of pixels, one after the other: from ends and branches first,
    /// then what is left, which is closed.
    fn for_each_chain(mut self, mut tell: impl FnMut(&[usize])) {
        let is_node = |index: usize| {
            let set = |at: &usize| self.set[*at];
            set(&index) && self.neighbors(index).iter().filter(|at| set(at)).count() != 2
        };
        let nodes: Vec<bool> = (0..self.set.len()).map(is_node).collect();
        for start in 0..self.set.len() {
            if !nodes[start] {
                continue;
            }
            for next in self.neighbors(start) {
                if self.set[next] && !nodes[next] {
                    tell(&self.walk(start, next, &nodes));
                }
            }
        }
        for start in 0..self.set.len() {
            if self.set[start] && !nodes[start] {
                self.set[start] = false;
                let mut around = self.neighbors(start).into_iter();
                if let Some(next) = around.find(|&next| self.set[next]) {
                    tell(&self.walk(start, next, &nodes));
                }
            }
        }
    }

    /// Follows and erases a line from `start` over `next` to the next node.
    fn walk(&mut self, start: usize, next: usize, nodes: &[bool]) -> Vec<usize> {
        let mut chain = vec![start, next];
        let mut at = next;
        self.set[at] = false;
        loop {
            let neighbors = self.neighbors(at);
            if let Some(&next) = neighbors
                .iter()
                .find(|&&next| self.set[next] && !nodes[next])
            {
                self.set[next] = false;
                chain.push(next);
                at = next;
                continue;
            }
            let end = neighbors
                .iter()
                .find(|&&next| nodes[next] && !chain[..2].contains(&next));
            chain.extend(end);
            return chain;
        }
    }
}

/// Splits a chain into straight pieces, in order, and keeps those that are long enough.
fn split(chain: &[usize], width: usize, segments: &mut Vec<LineSegment2>) {
    let position =
        |index: usize| Vector2::new((index % width) as f64 - 1.0, (index / width) as f64 - 1.0);
    // A stack, not recursion: a file must not decide how deep it goes.
    let mut pieces = vec![chain];
    while let Some(piece) = pieces.pop() {
        let &[first, .., last] = piece else {
            continue;
        };
        let chord = LineSegment2::new(position(first), position(last));
        let farthest = (piece.iter().enumerate())
            .map(|(at, &index)| (chord.distance_to_point(&position(index)), at))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        match farthest {
            Some((distance, at)) if distance > STRAIGHT => {
                pieces.push(&piece[at..]);
                pieces.push(&piece[..=at]);
            }
            _ if chord.length() >= MIN_LENGTH => segments.push(chord),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Luma;

    /// Draws a line of the given thickness.
    fn draw(map: &mut GrayImage, from: [f64; 2], to: [f64; 2], thickness: f64) {
        let line = LineSegment2::new(from.into(), to.into());
        for (x, y, value) in map.enumerate_pixels_mut() {
            let point = Vector2::new(f64::from(x), f64::from(y));
            if line.distance_to_point(&point) <= thickness / 2.0 {
                *value = Luma([200]);
            }
        }
    }

    #[test]
    fn a_thick_triangle_gives_its_three_sides() {
        let corners = [[15.0, 20.0], [110.0, 30.0], [50.0, 90.0]];
        let mut map = GrayImage::new(128, 100);
        for i in 0..3 {
            draw(&mut map, corners[i], corners[(i + 1) % 3], 3.0);
        }
        let found = segments(&map);
        for i in 0..3 {
            let side = LineSegment2::new(corners[i].into(), corners[(i + 1) % 3].into());
            let near = |end| side.distance_to_point(&end) < 2.5;
            let length: f64 = (found.iter())
                .filter(|segment| segment.ends().into_iter().all(near))
                .map(LineSegment2::length)
                .sum();
            assert!(
                length > 0.8 * side.length(),
                "{length} of {}",
                side.length()
            );
        }
    }

    #[test]
    fn staircases_are_lines() {
        // As lines are drawn that step along one axis at a time.
        for (from, to) in [([10.0, 10.0], [80.0, 45.0]), ([15.0, 70.0], [60.0, 12.0])] {
            let mut map = GrayImage::new(96, 96);
            let line = LineSegment2::new(from.into(), to.into());
            for step in 0..=1000 {
                let point = line.point_at(f64::from(step) / 1000.0);
                map.put_pixel(point.x.round() as u32, point.y.round() as u32, Luma([255]));
                let aside = point + Vector2::new(0.4, 0.0);
                map.put_pixel(aside.x.round() as u32, aside.y.round() as u32, Luma([255]));
            }
            let found = segments(&map);
            let length: f64 = found.iter().map(LineSegment2::length).sum();
            assert!(length > 0.9 * line.length(), "{found:?}");
        }
    }

    /// As published: every pixel is asked in every pass.
    fn thinned_plainly(mask: &mut Mask) {
        for _ in 0..MAX_THINNING {
            for first_pass in [true, false] {
                let removed: Vec<usize> = (0..mask.set.len())
                    .filter(|&index| mask.set[index] && mask.is_removable(index, first_pass))
                    .collect();
                for index in removed {
                    mask.set[index] = false;
                }
            }
        }
    }

    #[test]
    fn asking_the_border_alone_thins_alike() {
        let mut map = GrayImage::new(150, 150);
        draw(&mut map, [20.0, 30.0], [120.0, 50.0], 9.0);
        draw(&mut map, [30.0, 110.0], [120.0, 100.0], 90.0);
        draw(&mut map, [70.0, 0.0], [75.0, 149.0], 2.0);
        let mask = || Mask::new(&map, |value| value > 0);
        let (mut thinned, mut plainly) = (mask(), mask());
        thinned.thin();
        thinned_plainly(&mut plainly);
        assert_eq!(thinned.set, plainly.set);
        assert_ne!(thinned.set, mask().set);
    }

    #[test]
    fn maps_without_lines_have_no_segments() {
        assert_eq!(segments(&GrayImage::new(0, 0)), []);
        assert_eq!(segments(&GrayImage::new(30, 30)), []);
        segments(&GrayImage::from_pixel(30, 30, Luma([255])));
    }
}
