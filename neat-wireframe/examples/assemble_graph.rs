//! A wireframe graph from segments of any other program: no field, no images.
//!
//! ```text
//! cargo run --release -p neat-wireframe --example assemble_graph -- [SEGMENTS.txt]
//! ```
//!
//! The file has six numbers per line, the two ends of a segment. Without one, the
//! edges of a box are taken, each found three times with an error. Ends that lie
//! together become junctions, and these attract the segments: every pair that one
//! of them joins is an edge.

#![expect(clippy::print_stdout, reason = "an example shows its results")]

use nalgebra::{Vector2, Vector3};
use neat_core::{LineSegment3, Wireframe3d};
use neat_wireframe::fast::SegmentEnd;
use neat_wireframe::fast::junction_modes;
use neat_wireframe::paper::{AttractionConfig, attract};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let segments = match std::env::args_os().nth(1) {
        Some(path) => parse(&std::fs::read_to_string(path)?)?,
        None => noisy_box(),
    };

    // Junctions: where ends are dense. Lengths are in the unit of the segments;
    // the defaults suit an object of the size of 1.
    let ends: Vec<SegmentEnd> = segments
        .iter()
        .flat_map(LineSegment3::ends)
        .map(|position| SegmentEnd {
            position,
            weight: 1.0,
            // Not looked at here: these ends come from no image.
            view: 0,
            pixel: Vector2::zeros(),
        })
        .collect();
    let junctions = junction_modes(&ends);
    let edges = attract(&segments, &junctions, &AttractionConfig::default());
    let graph = Wireframe3d { junctions, edges };

    println!(
        "{} segments → {} junctions, {} edges",
        segments.len(),
        graph.junctions.len(),
        graph.edges.len()
    );
    for edge in graph.segments() {
        let [a, b] = edge.ends();
        println!(
            "({:.3}, {:.3}, {:.3}) – ({:.3}, {:.3}, {:.3})",
            a.x, a.y, a.z, b.x, b.y, b.z
        );
    }
    Ok(())
}

fn parse(text: &str) -> Result<Vec<LineSegment3>, Box<dyn std::error::Error>> {
    let mut segments = Vec::new();
    for line in text.lines().filter(|line| !line.trim().is_empty()) {
        let numbers: Vec<f64> = line
            .split_whitespace()
            .map(str::parse)
            .collect::<Result<_, _>>()?;
        let [a, b, c, d, e, f] = numbers[..] else {
            return Err(format!("six finite numbers are a segment, not `{line}`").into());
        };
        let segment = LineSegment3::new(Vector3::new(a, b, c), Vector3::new(d, e, f));
        if !segment.length().is_finite() {
            return Err(format!("six finite numbers are a segment, not `{line}`").into());
        }
        segments.push(segment);
    }
    Ok(segments)
}

/// The twelve edges of a box, three times, each end a little off.
fn noisy_box() -> Vec<LineSegment3> {
    let corner = |index: usize| Vector3::from([0, 1, 2].map(|axis| (index >> axis & 1) as f64));
    let mut segments = Vec::new();
    for index in 0..8_usize {
        for axis in 0..3 {
            let other = index | 1 << axis;
            if other == index {
                continue;
            }
            for turn in 0..3 {
                // Directions that differ from edge to edge and add up to little.
                let angle = (index * 3 + axis) as f64 + f64::from(turn) * 2.1;
                let off = 0.006 * Vector3::new(angle.cos(), angle.sin(), (2.0 * angle).sin());
                segments.push(LineSegment3::new(corner(index) + off, corner(other) - off));
            }
        }
    }
    segments
}
