//! From a folder of posed images to its wireframe, without a learned field.
//!
//! A scene is read as a configuration wants it ([`scene`], [`config`]), its 2D wireframes
//! are detected where there are none ([`detection`]), and the assembler makes lines of the
//! edgels of all images and says how sure they are ([`assemble`], [`distilled`]). All of it
//! reports through events ([`event`]); nothing here draws on a terminal.
//!
//! ```no_run
//! use neat_detect::DetectorConfig;
//! use neat_images::assemble::assemble_images;
//! use neat_images::config::DataConfig;
//! use neat_images::event::OnEvent;
//! use neat_images::resources::Resources;
//! use neat_images::scene::prepare_scene;
//! use neat_wireframe::ViewObservation;
//!
//! let (data, detector) = (DataConfig::default(), DetectorConfig::default());
//! let on_event: OnEvent<'_, ()> = &mut |event| println!("{event:?}");
//! let dir = "SCENE".as_ref();
//! let resources = Resources::default();
//! let scene = prepare_scene(dir, &data, &detector, None, resources, on_event)?.scene;
//! let (radius, min_score) = (scene.sphere_radius, data.min_segment_score);
//! let views = ViewObservation::from_scene(&scene, min_score);
//! let (assembler, assessing) = Default::default();
//! let progress = &mut |_| Ok(());
//! let draft = assemble_images(&scene, &views, None, radius, &detector, &assembler, progress)?;
//! let distilled = draft.assess(&scene, min_score, None, radius, &assessing)?;
//! println!("{} edges", distilled.wireframe.edges.len());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![forbid(unsafe_code)]

pub mod assemble;
mod assess;
pub mod config;
pub mod detection;
pub mod distilled;
pub mod error;
pub mod event;
pub mod overlay;
pub mod resources;
pub mod scene;
