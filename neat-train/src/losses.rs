//! The terms of the total loss (paper eq. 8): one table, [`LOSS_TERMS`].
//!
//! A new term is a field of [`LossConfig`] and of [`Losses`], an entry of the table, a
//! function in the crate of its idea, and a row of the table in `docs/method.md`.

use crate::batch::Batch;
use crate::model::{NeatModel, PlacedSamples, Rendering};
use crate::surface_points::KnownDistance;
use burn::tensor::{Device, Tensor, TensorData};
use neat_field::segment_loss::SegmentLossConfig;
use neat_gjp::candidates::JunctionView;
use neat_gjp::junction_loss::JunctionLoss;
use neat_sdf::losses::{eikonal_loss, eikonal_loss_where, mask_loss, point_loss, rgb_loss};
use neat_tensor::host::{constant_on, point_tensor};
use serde::{Deserialize, Serialize};

/// Weights of the loss terms, and which rays count in them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LossConfig {
    /// Colour, L1.
    pub rgb: f64,
    /// Eikonal term.
    pub eikonal: f64,
    /// Cross entropy of the accumulated weight against the silhouette of images
    /// on a black background.
    pub mask: f64,
    /// 3D segments, calibrated L1.
    pub segment: f64,
    /// 3D distance of matched junctions.
    pub junction_3d: f64,
    /// Distance of their projections (calibrated).
    pub junction_2d: f64,
    /// Error of the distance at points on the surface, or of known distance from it, in
    /// the world.
    #[serde(default)]
    pub points: f64,
    /// Rays whose segment misses its 2D segment by this many pixels or more do
    /// not count.
    pub segment_cutoff_in_pixels: f64,
    /// Rays whose accumulated weight is not above this do not count in the
    /// segment term; `None` counts all, as published.
    pub segment_min_opacity: Option<f64>,
    /// Divides the segment term by all rays, as published, instead of by those
    /// that count.
    pub segment_mean_over_all_rays: bool,
}

impl Default for LossConfig {
    /// As published.
    fn default() -> Self {
        Self {
            rgb: 1.0,
            eikonal: 0.1,
            mask: 0.0,
            segment: 0.01,
            junction_3d: 0.1,
            junction_2d: 0.01,
            points: 0.0,
            segment_cutoff_in_pixels: 100.0,
            segment_min_opacity: None,
            segment_mean_over_all_rays: true,
        }
    }
}

/// Where the eikonal term samples the gradient.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EikonalConfig {
    /// Points drawn uniformly in the cube around the scene ball; `None` draws as
    /// many as there are rays, as published.
    pub uniform_points: Option<usize>,
    /// One random sample of every ray is added, as published.
    pub one_sample_per_ray: bool,
    /// All samples that are rendered are added.
    pub rendered_samples: bool,
}

impl Default for EikonalConfig {
    /// As published.
    fn default() -> Self {
        Self {
            uniform_points: None,
            one_sample_per_ray: true,
            rendered_samples: false,
        }
    }
}

/// The loss terms of an iteration, before weighting, and their weighted sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Losses {
    /// The weighted sum that is minimised.
    pub total: f64,
    /// Colour.
    pub rgb: f64,
    /// Eikonal term.
    pub eikonal: f64,
    /// Silhouette.
    pub mask: f64,
    /// Segments, calibrated.
    pub segment: f64,
    /// Junctions in the world.
    pub junction_3d: f64,
    /// Junctions in the image, calibrated.
    pub junction_2d: f64,
    /// Error of the distance at points where it is known.
    #[serde(default)]
    pub points: f64,
}

/// One term of the total loss.
#[derive(Clone, Copy, Debug)]
pub struct LossTerm {
    /// Its key in `metrics.jsonl` and, for its weight, in `train.loss`.
    pub name: &'static str,
    /// Its name for people, before the word loss.
    pub label: &'static str,
    /// What it is, with the function that computes it.
    pub what: &'static str,
    /// Its weight in the total.
    pub weight: fn(&LossConfig) -> f64,
    /// Its place among the logged values.
    pub value: fn(&mut Losses) -> &mut f64,
    mean_over: MeanOver,
    function: fn(&TermInput<'_>) -> Option<Tensor<1>>,
}

impl LossTerm {
    /// The term among `losses`, before weighting.
    pub fn of(&self, losses: &Losses) -> f64 {
        let mut losses = *losses;
        *(self.value)(&mut losses)
    }
}

/// What a term is a mean over: of rays and gradients, the mean over a batch is the
/// weighted mean of those over its parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum MeanOver {
    Rays,
    Gradients,
    /// It looks at all rays of a batch at once.
    Batch,
}

/// All terms, in the order in which they are added up and logged.
pub static LOSS_TERMS: [LossTerm; 7] = [
    LossTerm {
        name: "rgb",
        label: "Colour",
        what: "colour of rays, mean L1: `neat_sdf::losses::rgb_loss`",
        weight: |weights| weights.rgb,
        value: |losses| &mut losses.rgb,
        mean_over: MeanOver::Rays,
        function: |rays| {
            let rendered = rays.rendering?.color.clone()?;
            let observed = point_tensor(&rays.step.batch.colors, rays.device);
            Some(rgb_loss(rendered, observed))
        },
    },
    LossTerm {
        name: "eikonal",
        label: "Eikonal",
        what: "length of the distance's gradient: `neat_sdf::losses::eikonal_loss`",
        weight: |weights| weights.eikonal,
        value: |losses| &mut losses.eikonal,
        mean_over: MeanOver::Gradients,
        function: |rays| rays.eikonal(),
    },
    LossTerm {
        name: "mask",
        label: "Silhouette",
        what: "silhouette on a black background: `neat_sdf::losses::mask_loss`",
        weight: |weights| weights.mask,
        value: |losses| &mut losses.mask,
        mean_over: MeanOver::Rays,
        function: |rays| {
            // Without a weight there is no black background, and no silhouette.
            let rendering = rays.rendering.filter(|_| rays.weights.mask > 0.0)?;
            let silhouette = rays.step.batch.silhouette.clone();
            let silhouette = TensorData::new(silhouette, [rays.step.batch.rays.len(), 1]);
            let silhouette = Tensor::from_data(silhouette, rays.device);
            Some(mask_loss(rendering.opacity.clone(), silhouette))
        },
    },
    LossTerm {
        name: "segment",
        label: "Segment",
        what: "3D segments in the image: `neat_field::segment_comparison::compare_segments`",
        weight: |weights| weights.segment,
        value: |losses| &mut losses.segment,
        mean_over: MeanOver::Batch,
        function: |batch| batch.segment.clone(),
    },
    LossTerm {
        name: "junction_3d",
        label: "Junction",
        what: "matched junctions in the world: `neat_gjp::junction_loss::JunctionMatching::loss`",
        weight: |weights| weights.junction_3d,
        value: |losses| &mut losses.junction_3d,
        mean_over: MeanOver::Batch,
        function: |batch| Some(batch.junctions.as_ref()?.in_world.clone()),
    },
    LossTerm {
        name: "junction_2d",
        label: "Junction in the image",
        what: "matched junctions in the image: `neat_gjp::junction_loss::JunctionMatching::loss`",
        weight: |weights| weights.junction_2d,
        value: |losses| &mut losses.junction_2d,
        mean_over: MeanOver::Batch,
        function: |batch| batch.junctions.as_ref()?.calibrated.clone(),
    },
    LossTerm {
        name: "points",
        label: "Sparse point",
        what: "distance at points of known distance: `neat_sdf::losses::point_loss`",
        weight: |weights| weights.points,
        value: |losses| &mut losses.points,
        mean_over: MeanOver::Batch,
        function: |batch| {
            let points = batch.step.surface_points;
            (!points.is_empty()).then(|| {
                let places: Vec<[f32; 3]> = points.iter().map(|known| known.point).collect();
                let distances: Vec<f32> = points.iter().map(|known| known.distance).collect();
                let distances = TensorData::new(distances, [points.len(), 1]);
                let sdf = (batch.model.implicit_network)
                    .sdf_uncapped(point_tensor(&places, batch.device));
                point_loss(sdf, Tensor::from_data(distances, batch.device))
            })
        },
    },
];

/// Everything random or observed of one iteration: with it the loss is a plain
/// function of the parameters.
#[derive(Clone, Copy, Debug)]
pub struct StepInput<'a> {
    /// The rays and what was observed.
    pub batch: &'a Batch,
    /// Where the rays are sampled, by the model as it is now.
    pub samples: PlacedSamples<'a>,
    /// Points of the eikonal term besides rendered samples.
    pub eikonal_points: &'a [[f32; 3]],
    /// More of them that only the device knows, `[K, 3]`, without gradient.
    pub eikonal_samples: Option<&'a Tensor<2>>,
    /// Points on the surface or at known distances from it.
    pub surface_points: &'a [KnownDistance],
    /// The views that [`Batch::view_of_ray`] speaks of: camera and 2D junctions.
    pub views: &'a [JunctionView<'a>],
    /// Whether the junction terms are due.
    pub junctions_due: bool,
}

/// What terms are made of.
pub(crate) struct TermInput<'a> {
    pub model: &'a NeatModel,
    pub step: &'a StepInput<'a>,
    pub weights: &'a LossConfig,
    pub eikonal: &'a EikonalConfig,
    /// For means over rays and gradients.
    pub rendering: Option<&'a Rendering>,
    /// The segment loss, where it is not a sum over parts of the batch.
    pub segment: Option<Tensor<1>>,
    pub junctions: Option<JunctionLoss>,
    pub device: &'a Device,
}

/// The value `[1]` of each term, as far as there is one, in the order of the table.
pub(crate) type TermValues = [Option<Tensor<1>>; LOSS_TERMS.len()];

impl TermInput<'_> {
    /// All terms.
    pub fn all_values(&self) -> TermValues {
        LOSS_TERMS.each_ref().map(|term| (term.function)(self))
    }

    /// The terms that a part of a batch has a share in, those of rays and of gradients
    /// being given, or those of the whole batch; with that share and their value `[1]`.
    pub fn shares(&self, of_part: Option<[f64; 2]>) -> Vec<(&'static LossTerm, f64, Tensor<1>)> {
        let of_term = |term: &'static LossTerm| {
            let share = term.mean_over.share(of_part)?;
            Some((term, share, (term.function)(self)?))
        };
        LOSS_TERMS.iter().filter_map(of_term).collect()
    }

    /// The eikonal term; `None` where no gradient is asked for.
    fn eikonal(&self) -> Option<Tensor<1>> {
        let (input, rendering, device) = (self.step, self.rendering?, self.device);
        let mut points = Vec::new();
        if !input.eikonal_points.is_empty() {
            points.push(point_tensor(input.eikonal_points, device));
        }
        points.extend((input.eikonal_samples).map(|points| constant_on(device, points)));
        let mut gradients = Vec::new();
        if !points.is_empty() {
            let points = Tensor::cat(points, 0);
            gradients.push(self.model.implicit_network.gradient_uncapped(points));
        }
        // The bounding sphere has a slope of its own, which nothing can change.
        let rendered =
            (self.eikonal.rendered_samples).then(|| rendering.gradients_uncapped.clone());
        let counts = rendering.counts.clone().filter(|_| rendered.is_some());
        let counts = counts.map(|counts| {
            let all_count = gradients
                .iter()
                .map(|g| Tensor::ones([g.dims()[0], 1], device));
            Tensor::cat(all_count.chain([counts]).collect(), 0)
        });
        gradients.extend(rendered);
        if gradients.is_empty() {
            return None;
        }
        let gradients = Tensor::cat(gradients, 0);
        Some(match counts {
            Some(counts) => eikonal_loss_where(gradients, counts),
            None => eikonal_loss(gradients),
        })
    }
}

impl MeanOver {
    /// The share of a whole batch that its part has in the mean, where it is one over
    /// parts; all of it for the whole batch.
    fn share(self, of_part: Option<[f64; 2]>) -> Option<f64> {
        match (self, of_part) {
            (Self::Rays, Some([of_rays, _])) => Some(of_rays),
            (Self::Gradients, Some([_, of_gradients])) => Some(of_gradients),
            (Self::Batch, None) => Some(1.0),
            _ => None,
        }
    }
}

impl LossConfig {
    /// How rays are counted in the segment term.
    pub(crate) fn segments(&self) -> SegmentLossConfig {
        SegmentLossConfig {
            cutoff_in_pixels: self.segment_cutoff_in_pixels,
            min_opacity: self.segment_min_opacity,
            mean_over_all_rays: self.segment_mean_over_all_rays,
        }
    }

    /// `total`, and all terms behind it, without gradient: `[1 + terms]`.
    pub(crate) fn add_up(&self, values: TermValues, device: &Device) -> (Tensor<1>, Tensor<1>) {
        let zero = || Tensor::<1>::zeros([1], device);
        let values = values.map(|value| value.unwrap_or_else(zero));
        let total = LOSS_TERMS
            .iter()
            .zip(&values)
            .map(|(term, value)| value.clone().mul_scalar((term.weight)(self)))
            .reduce(|sum, term| sum + term)
            .expect("LOSS_TERMS has terms");
        let all = std::iter::once(total.clone()).chain(values);
        let terms = Tensor::cat(all.map(Tensor::detach).collect(), 0);
        (total, terms)
    }
}

impl Losses {
    /// From the total and, in the order of the table, the terms.
    pub fn from_terms(numbers: &[f32]) -> Self {
        debug_assert_eq!(numbers.len(), 1 + LOSS_TERMS.len());
        let mut losses = Self {
            total: f64::from(numbers[0]),
            ..Self::default()
        };
        for (term, number) in LOSS_TERMS.iter().zip(&numbers[1..]) {
            *(term.value)(&mut losses) = f64::from(*number);
        }
        losses
    }

    /// The weighted sum of the terms.
    pub(crate) fn weighted_sum(mut self, weights: &LossConfig) -> f64 {
        let terms = LOSS_TERMS.iter();
        terms
            .map(|term| (term.weight)(weights) * *(term.value)(&mut self))
            .reduce(|sum, term| sum + term)
            .unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_term_has_its_weight_and_its_place_in_the_log() {
        let numbers: Vec<f32> = (0..=LOSS_TERMS.len()).map(|i| i as f32).collect();
        let losses = Losses::from_terms(&numbers);
        let logged = serde_json::to_value(losses).unwrap();
        for (i, term) in LOSS_TERMS.iter().enumerate() {
            assert_eq!(logged[term.name], (i + 1) as f64, "{}", term.name);
            let mut config = serde_json::json!({
                "rgb": 0.0, "eikonal": 0.0, "mask": 0.0, "segment": 0.0, "junction_3d": 0.0,
                "junction_2d": 0.0, "segment_cutoff_in_pixels": 1.0, "segment_min_opacity": null,
                "segment_mean_over_all_rays": true,
            });
            config[term.name] = 2.0.into();
            let config: LossConfig = serde_json::from_value(config).unwrap();
            assert_eq!((term.weight)(&config), 2.0, "{}", term.name);
            assert_eq!(losses.weighted_sum(&config), 2.0 * (i + 1) as f64);
        }
    }
}
