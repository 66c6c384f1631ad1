//! `neat measure`.

use crate::error::CliError;
use crate::output;
use clap::Args;
use neat_export::ExportError;
use neat_wireframe::dimensions::{Dimension, DimensionError, Dimensions, Quantity, Scale};
use neat_wireframe::export::read_json;
use serde_json::json;
use std::fmt::Write;
use std::path::PathBuf;

/// Digits where no interval says how many there are.
const DIGITS: i32 = 6;
/// No number needs more digits after its point.
const MOST_DECIMALS: i32 = 12;

/// Read lengths, distances, angles, radii and areas off a wireframe, with 95 % intervals
///
/// Without a selection the lengths of all edges, the radii of all arcs and the areas of all faces.
/// Junctions, edges and arcs have the numbers of wireframe.json and of the report, from 0; faces
/// are counted through all shells. Lengths are in the unit of your files, or in that of --scale,
/// and areas in its square. Intervals are from the covariances of junctions and arcs: an error that all views share is
/// not in them, nor what your unit itself may be off.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  neat measure RUN
  neat measure RUN --edge 12 --between 3-17 --scale 0-4=3.20m±0.01
  neat measure RUN --angle 4,9 --radius 0 --spacing 0,1 --area 2
  neat measure RUN --parallel --csv > gaps.csv
  neat measure RUN/wireframe.json --json")]
pub struct MeasureArgs {
    /// Folder of a run, or a wireframe.json
    #[arg(value_name = "RUN")]
    run: PathBuf,
    /// The length of an edge; may be given again, as all selections may
    #[arg(long, value_name = "N")]
    edge: Vec<usize>,
    /// The distance of two junctions
    #[arg(long, value_name = "A-B", value_parser = |text: &str| pair(text, '-'))]
    between: Vec<[usize; 2]>,
    /// The angle between two edges
    #[arg(long, value_name = "A,B", value_parser = |text: &str| pair(text, ','))]
    angle: Vec<[usize; 2]>,
    /// The distance of two edges: from the middle of the shorter one to the line of the other
    #[arg(long, value_name = "A,B", value_parser = |text: &str| pair(text, ','))]
    gap: Vec<[usize; 2]>,
    /// The radius of an arc
    #[arg(long, value_name = "N")]
    radius: Vec<usize>,
    /// The distance of the centres of two arcs, such as holes
    #[arg(long, value_name = "A,B", value_parser = |text: &str| pair(text, ','))]
    spacing: Vec<[usize; 2]>,
    /// The area of a face, less its holes
    #[arg(long, value_name = "N")]
    area: Vec<usize>,
    /// The gaps between parallel edges that lie beside each other, the longest edges first
    #[arg(long)]
    parallel: bool,
    /// So many gaps at most
    #[arg(long, value_name = "N", default_value_t = 100, requires = "parallel")]
    most: usize,
    /// The true distance of two junctions in mm, cm, m, in or ft, perhaps with ± (or +-) and what
    /// it may be off with 95 % probability
    #[arg(long, value_name = "A-B=LENGTH")]
    scale: Option<Scale>,
    /// Write JSON
    #[arg(long, conflicts_with = "csv")]
    json: bool,
    /// Write comma-separated values
    #[arg(long)]
    csv: bool,
}

/// Takes two numbers, separated.
fn pair(text: &str, separator: char) -> Result<[usize; 2], String> {
    let number = |text: &str| text.trim().parse().ok();
    text.split_once(separator)
        .and_then(|(a, b)| Some([number(a)?, number(b)?]))
        .ok_or_else(|| format!("must be two numbers, such as 3{separator}17"))
}

impl MeasureArgs {
    pub fn run(self) -> Result<(), CliError> {
        let json = match self.run.is_dir() {
            true => self.run.join("wireframe.json"),
            false => self.run.clone(),
        };
        let document = read_json(&json).map_err(ExportError::from)?;
        let usage = |error: DimensionError| CliError::Usage(error.to_string());
        let dimensions = Dimensions::new(&document, self.scale).map_err(usage)?;
        let measured = self.selected(&dimensions).map_err(usage)?;
        let is_known =
            !(document.junction_covariances.is_empty() && document.arc_covariances.is_empty());
        if !measured.is_empty() && !is_known {
            output::warning(&format!(
                "{} has no covariances, so there are no intervals: neat reconstruct writes them",
                json.display()
            ));
        }
        output::print(&if self.json {
            as_json(&dimensions, &measured)
        } else if self.csv {
            as_csv(&dimensions, &measured)
        } else {
            as_table(&dimensions, &measured)
        })
    }

    fn selected(&self, dimensions: &Dimensions) -> Result<Vec<Dimension>, DimensionError> {
        let edges = self
            .edge
            .iter()
            .map(|edge| Quantity::Length { edge: *edge });
        let distances = (self.between.iter()).map(|pair| Quantity::Distance { junctions: *pair });
        let angles = self
            .angle
            .iter()
            .map(|edges| Quantity::Angle { edges: *edges });
        let gaps = self.gap.iter().map(|edges| Quantity::Gap { edges: *edges });
        let radii = self.radius.iter().map(|arc| Quantity::Radius { arc: *arc });
        let spacings = (self.spacing.iter()).map(|arcs| Quantity::Spacing { arcs: *arcs });
        let areas = self.area.iter().map(|face| Quantity::Area { face: *face });
        let chosen = edges.chain(distances).chain(angles).chain(gaps);
        let mut measured: Vec<Dimension> = (chosen.chain(radii).chain(spacings).chain(areas))
            .map(|quantity| dimensions.measure(quantity))
            .collect::<Result<_, _>>()?;
        if self.parallel {
            measured.extend(dimensions.parallels(self.most));
        } else if measured.is_empty() {
            measured = dimensions.lengths();
            measured.extend(dimensions.radii());
            measured.extend(dimensions.areas());
        }
        Ok(measured)
    }
}

/// The kind of a quantity, and its numbers.
fn named(quantity: &Quantity) -> (&'static str, Vec<usize>) {
    match quantity {
        Quantity::Length { edge } => ("length", vec![*edge]),
        Quantity::Distance { junctions } => ("distance", junctions.to_vec()),
        Quantity::Gap { edges } => ("gap", edges.to_vec()),
        Quantity::Angle { edges } => ("angle", edges.to_vec()),
        Quantity::Radius { arc } => ("radius", vec![*arc]),
        Quantity::Spacing { arcs } => ("spacing", arcs.to_vec()),
        Quantity::Area { face } => ("area", vec![*face]),
    }
}

fn unit(dimension: &Dimension, of_lengths: &str) -> String {
    match dimension.quantity {
        Quantity::Angle { .. } => "°".to_owned(),
        Quantity::Area { .. } if !of_lengths.is_empty() => format!("{of_lengths}²"),
        _ => of_lengths.to_owned(),
    }
}

fn as_json(dimensions: &Dimensions, measured: &[Dimension]) -> String {
    let document = json!({
        "version": 1,
        "unit": dimensions.unit(),
        "dimensions": measured,
    });
    format!("{document:#}")
}

fn as_csv(dimensions: &Dimensions, measured: &[Dimension]) -> String {
    let mut text = String::from("kind,a,b,value,sigma,low,high,unit,free_end\n");
    let or_empty = |number: Option<f64>| number.map(|x| x.to_string()).unwrap_or_default();
    for dimension in measured {
        let (kind, numbers) = named(&dimension.quantity);
        let second = numbers.get(1).map(usize::to_string).unwrap_or_default();
        let [low, high] = [0, 1].map(|end| dimension.interval.map(|ends| ends[end]));
        let _ = writeln!(
            text,
            "{kind},{},{second},{},{},{},{},{},{}",
            numbers[0],
            dimension.value,
            or_empty(dimension.sigma),
            or_empty(low),
            or_empty(high),
            unit(dimension, dimensions.unit().unwrap_or_default()),
            dimension.free_end
        );
    }
    text
}

fn as_table(dimensions: &Dimensions, measured: &[Dimension]) -> String {
    let of_lengths = dimensions.unit().unwrap_or_default();
    let mut text = match dimensions.unit() {
        Some(unit) => format!("lengths in {unit}, 95 % intervals\n"),
        None => "lengths in the unit of your files, 95 % intervals\n".to_owned(),
    };
    for dimension in measured {
        let (kind, numbers) = named(&dimension.quantity);
        let separator = match dimension.quantity {
            Quantity::Distance { .. } => "-",
            _ => ",",
        };
        let numbers: Vec<String> = numbers.iter().map(usize::to_string).collect();
        let what = format!("{kind} {}", numbers.join(separator));
        let sure = dimension.interval.map(|[low, high]| 0.5 * (high - low));
        let decimals = decimals(dimension.value, sure);
        let number = |x: f64| format!("{x:.decimals$}");
        let interval = match dimension.interval {
            Some([low, high]) => format!("{} to {}", number(low), number(high)),
            None => "not determined".to_owned(),
        };
        let note = if dimension.free_end { "  free end" } else { "" };
        let unit = unit(dimension, of_lengths);
        let value = format!("{} {unit}", number(dimension.value));
        let _ = writeln!(text, "{what:18} {value:>16}   {interval}{note}");
    }
    text
}

/// Two digits of half the interval are worth reading.
fn decimals(value: f64, half_width: Option<f64>) -> usize {
    let magnitude = |x: f64| x.abs().log10().floor() as i32;
    let wanted = match half_width {
        Some(half) if half > 0.0 => 1 - magnitude(half),
        _ if value == 0.0 => 0,
        _ => DIGITS - 1 - magnitude(value),
    };
    usize::try_from(wanted.clamp(0, MOST_DECIMALS)).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_follow_the_interval() {
        assert_eq!(decimals(3.2, Some(0.0123)), 3);
        assert_eq!(decimals(1234.5, Some(120.0)), 0);
        assert_eq!(decimals(3.2, Some(0.0)), 5);
        assert_eq!(decimals(3.2, None), 5);
        assert_eq!(decimals(0.0, None), 0);
    }

    #[test]
    fn pairs_are_two_numbers() {
        assert_eq!(pair("3-17", '-'), Ok([3, 17]));
        assert_eq!(pair(" 4, 9", ','), Ok([4, 9]));
        for bad in ["3", "3-", "3-17-1", "-3-4", "a-b"] {
            assert!(pair(bad, '-').is_err(), "{bad}");
        }
    }
}
