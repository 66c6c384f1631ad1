//! What was asked, and a scene and a machine to do it with: what will be done.
//!
//! A [`Config`] may leave values to the scene and the machine. [`settle`] decides them,
//! once, tells what it has decided and why, and checks the whole. What runs is the
//! [`Plan`]: nothing after it changes a setting.

mod background;
mod latents;
mod step_memory;
mod without_effect;

pub use step_memory::{bytes_per_ray, rows_of_step};
pub(crate) use without_effect::{Given, NO_FIELD, changes_of_presets, settings_without_effect};

use crate::config::{BackEnd, Background, Choice, Config, DistillConfig, FieldUse, Partners};
use crate::event::Decision;
use neat_core::{MemoryLimit, Scene, SceneError};
use neat_detect::DetectorConfigError;
use neat_gjp::JunctionCount;
use neat_tensor::{Backend, Kernels};
use neat_train::TrainError;
use std::fmt;

/// Slope of the sphere's distance, as published for DTU.
const SPHERE_SLOPE: f64 = 20.0;

/// What a run does: a configuration that leaves nothing open and has been checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    config: Config,
    background: Option<Background>,
    field: FieldUse,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// An image that the decision needs cannot be read.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The configuration contradicts itself.
    #[error(transparent)]
    Config(#[from] TrainError),
    /// The settings of the detector are out of range.
    #[error("the section `detect` of the configuration: {0}")]
    Detector(#[from] DetectorConfigError),
    /// A back end that asks the field, and no field.
    #[error(
        "distill.back_end = {0} asks the field: leave out distill.field = none, or take distill.back_end = assembler"
    )]
    NoField(BackEnd),
    /// Partners are sought by the field, and no field.
    #[error(
        "distill.partners = field asks the field: leave out distill.field = none, or take distill.partners = epipolar"
    )]
    NoFieldForPartners,
    /// A value that a scene decides is still open.
    #[error("{0} is open: a scene has to decide it")]
    Open(&'static str),
}

/// What a run has of the machine.
#[derive(Clone, Copy, Debug)]
pub struct Machine {
    /// What computes, never [`Backend::Auto`].
    pub backend: Backend,
    /// How much memory may be used.
    pub memory_limit: MemoryLimit,
}

impl Plan {
    /// The plan that `config` is, if it leaves nothing open.
    ///
    /// # Errors
    /// If something is open or contradicts itself.
    pub fn new(mut config: Config) -> Result<Self, PlanError> {
        let field = settle_field_use(&config.distill)?;
        config.distill.field = Choice::Given(field);
        let background = match config.data.background {
            None => None,
            Some(Choice::Given(background)) => Some(background),
            Some(Choice::Auto) if field == FieldUse::None => None,
            Some(Choice::Auto) => return Err(PlanError::Open("data.background")),
        };
        config.detect.validate()?;
        if field == FieldUse::Trained {
            if config.model.perceiver.junctions.fixed().is_none() {
                return Err(PlanError::Open("model.perceiver.junctions"));
            }
            config.training(Kernels::default()).validate()?;
        }
        Ok(Self {
            config,
            background,
            field,
        })
    }

    /// The configuration, with every choice made.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// What lies behind the object; `None` where nothing follows from it, as without a field.
    pub fn background(&self) -> Option<Background> {
        self.background
    }

    /// What assembles the wireframe.
    pub fn back_end(&self) -> BackEnd {
        self.config.distill.back_end
    }

    /// Whether a field is trained.
    pub fn trains(&self) -> bool {
        self.field == FieldUse::Trained
    }
}

/// Whether a field is trained: by default where something asks it.
pub(crate) fn settle_field_use(asked: &DistillConfig) -> Result<FieldUse, PlanError> {
    let asks = asked.back_end == BackEnd::Paper;
    let partners = !asks && asked.partners == Partners::Field;
    match asked.field {
        Choice::Auto if asks || partners => Ok(FieldUse::Trained),
        Choice::Auto => Ok(FieldUse::None),
        Choice::Given(FieldUse::None) if asks => Err(PlanError::NoField(asked.back_end)),
        Choice::Given(FieldUse::None) if partners => Err(PlanError::NoFieldForPartners),
        Choice::Given(field) => Ok(field),
    }
}

/// Tells a decision: the setting, its value, and the reason.
type Decide<'a> = &'a mut dyn FnMut(&str, &dyn fmt::Display, String);

/// Decides what the field is, where one is trained or was.
fn settle_field(
    config: &mut Config,
    scene: &Scene,
    earlier: Option<&Plan>,
    trains: bool,
    decide: Decide<'_>,
) {
    let is_photo = config.data.background == Some(Choice::Given(Background::Photo));
    if trains && is_photo && config.train.loss.mask != 0.0 {
        config.train.loss.mask = 0.0;
        let reason = "as photographs show no silhouettes".to_owned();
        decide("train.loss.mask", &0, reason);
    }
    let is_black = config.data.background == Some(Choice::Given(Background::Black));
    if trains && is_black && config.train.dense_points {
        config.train.dense_points = false;
        let reason = "as objects on black have outlines and little texture".to_owned();
        decide("train.dense_points", &false, reason);
    }
    if let Some(plan) = earlier {
        // As below: the field was trained with it.
        config.model.background = plan.config.model.background.clone();
    } else if trains && is_black && config.model.background.shells > 0 {
        config.model.background.shells = 0;
        let reason = "as nothing lies behind objects on black".to_owned();
        decide("model.background.shells", &0, reason);
    }
    let has_shells = config.model.background.shells > 0;
    if config.model.implicit.bounding_sphere_slope == 0.0 {
        let slope = &mut config.model.implicit.bounding_sphere_slope;
        match earlier {
            // The field was trained with it, whatever is said of the background now.
            Some(plan) => *slope = plan.config.model.implicit.bounding_sphere_slope,
            None if trains && is_photo && !has_shells => {
                *slope = SPHERE_SLOPE;
                let reason = "as the sphere stands for all that is behind the scene".to_owned();
                let setting = "model.implicit.bounding_sphere_slope";
                decide(setting, &SPHERE_SLOPE, reason);
            }
            None => (),
        }
    }
    if config.model.perceiver.junctions.fixed().is_none() {
        let kept = earlier.and_then(|plan| plan.config.model.perceiver.junctions.fixed());
        let count = kept.or_else(|| {
            trains.then(|| {
                let wireframes = scene.views.iter().map(|view| &view.wireframe);
                let count = latents::latents_for(wireframes, config.data.min_segment_score);
                let reason = "as the 2D wireframes have junctions".to_owned();
                decide("model.perceiver.junctions", &count, reason);
                count
            })
        });
        if let Some(count) = count {
            config.model.perceiver.junctions = JunctionCount::Fixed(count);
        }
    }
}

/// Decides what `asked` leaves open, by the scene and the machine, and tells it. What
/// an `earlier` part of the run has decided stays.
///
/// For a field of photographs the border of the sphere is put behind the scene and the silhouette
/// term is dropped. A configuration without `data.background` stays as it is.
///
/// # Errors
/// If an image lies in a file that cannot be read, or the whole contradicts itself.
pub fn settle(
    asked: &Config,
    scene: &Scene,
    machine: Machine,
    earlier: Option<&Plan>,
) -> Result<(Plan, Vec<Decision>), PlanError> {
    let mut decisions = Vec::new();
    let mut decide = |setting: &str, value: &dyn fmt::Display, reason: String| {
        decisions.push(Decision {
            setting: setting.to_owned(),
            value: value.to_string(),
            reason,
        });
    };
    let mut config = asked.clone();
    let field = settle_field_use(&config.distill)?;
    let trains = field == FieldUse::Trained;
    if trains && asked.data.background == Some(Choice::Auto) {
        let background = match earlier.and_then(Plan::background) {
            Some(background) => background,
            None => {
                let (background, reason) = background::background(scene, machine.memory_limit)?;
                decide("data.background", &background, reason);
                background
            }
        };
        config.data.background = Some(Choice::Given(background));
    }
    settle_field(&mut config, scene, earlier, trains, &mut decide);
    let mut plan = Plan::new(config)?;
    if asked.distill.field == Choice::Auto && !trains {
        let reason = "as the images alone make the wireframe; --train trains one".to_owned();
        decide("distill.field", &field, reason);
    }
    if trains && asked.train.ray_chunk.is_none() {
        plan.config.train.ray_chunk = match earlier {
            // A run keeps the passes that it began with, whatever memory is here.
            Some(plan) => plan.config.train.ray_chunk,
            // A GPU has memory of its own.
            None if machine.backend == Backend::Wgpu => None,
            None => {
                step_memory::ray_chunk(&plan.config, machine.memory_limit).map(|(chunk, reason)| {
                    decide("train.ray_chunk", &chunk, reason);
                    chunk
                })
            }
        };
    }
    Ok((plan, decisions))
}

#[cfg(test)]
mod tests;
