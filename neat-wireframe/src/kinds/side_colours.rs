//! What the colours on both sides of an edge say, and how steady they are over the views.

use super::edge_samples::{Bands, ViewSamples};
use crate::statistics::upper_median;

/// Added to colours before the logarithm: below it noise and a black background hide ratios.
const DARK: f64 = 5.0;

/// Differences are natural logarithms of ratios: 0.1 is ten percent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SideColours {
    /// Mean over the colour channels by how much their ratios across the edge differ: what
    /// light cannot do, as it changes all channels alike.
    pub chroma: f64,
    /// Brightness of one side over the other's: the median of the views' absolute values.
    pub step: f64,
    /// By how much the edge is darker than the mean of its sides; negative if it is brighter.
    pub darkness: f64,
    /// Half the ratio of brightness just left and right of it: root mean square over the views.
    /// Two faces are lit alike by chance only, and hardly from all sides.
    pub contrast: f64,
    /// By how much more the chroma of one side changes over the views than that of the other:
    /// a background moves behind an edge, a face does not.
    pub instability: f64,
}

impl SideColours {
    /// `None` if no view shows the bands.
    pub(super) fn new(samples: &[ViewSamples]) -> Option<Self> {
        let bands: Vec<&Bands> = (samples.iter())
            .filter_map(|view| view.bands.as_ref())
            .collect();
        if bands.is_empty() {
            return None;
        }
        let views: Vec<[[f64; 3]; 3]> = bands.iter().map(|bands| logarithms(bands)).collect();
        let across = |view: &[[f64; 3]; 3]| std::array::from_fn(|k| view[0][k] - view[2][k]);
        let ratios: Vec<[f64; 3]> = views.iter().map(across).collect();
        let mut steps: Vec<f64> = ratios
            .iter()
            .map(|ratio| mean_channel(ratio).abs())
            .collect();
        let relative = |side: usize| {
            views
                .iter()
                .map(|view| chromaticity(&view[side]))
                .collect::<Vec<_>>()
        };
        let chroma_ratios: Vec<[f64; 3]> = ratios.iter().map(chromaticity).collect();
        let dark = |view: &[[f64; 3]; 3]| {
            0.5 * (mean_channel(&view[0]) + mean_channel(&view[2])) - mean_channel(&view[1])
        };
        let contrasts = bands.iter().map(|bands| {
            let [left, right] = bands.near.map(|rgb| mean_channel(&logarithm(&rgb)));
            (0.5 * (left - right)).powi(2)
        });
        Some(Self {
            chroma: mean_channel(&mean(&chroma_ratios).map(f64::abs)),
            step: upper_median(&mut steps),
            darkness: views.iter().map(dark).sum::<f64>() / views.len() as f64,
            contrast: (contrasts.sum::<f64>() / bands.len() as f64).sqrt(),
            instability: (scatter(&relative(0)) - scatter(&relative(2))).abs(),
        })
    }
}

fn logarithms(bands: &Bands) -> [[f64; 3]; 3] {
    [bands.left, bands.centre, bands.right].map(|rgb| logarithm(&rgb))
}

fn logarithm(rgb: &[f64; 3]) -> [f64; 3] {
    rgb.map(|x| (x + DARK).ln())
}

fn mean_channel(rgb: &[f64; 3]) -> f64 {
    rgb.iter().sum::<f64>() / 3.0
}

/// Without what all channels share.
fn chromaticity(rgb: &[f64; 3]) -> [f64; 3] {
    let mean = mean_channel(rgb);
    rgb.map(|x| x - mean)
}

fn mean(values: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|k| values.iter().map(|rgb| rgb[k]).sum::<f64>() / values.len() as f64)
}

/// Standard deviation over the views, the mean of the channels.
fn scatter(values: &[[f64; 3]]) -> f64 {
    let center = mean(values);
    let squared: Vec<[f64; 3]> = (values.iter())
        .map(|rgb| std::array::from_fn(|k| (rgb[k] - center[k]).powi(2)))
        .collect();
    mean_channel(&mean(&squared).map(f64::sqrt))
}
