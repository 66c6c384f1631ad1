//! The two tables: right scenes are accepted, and of spoilt ones the right cause is named.

mod corruption;
mod real;
mod right;

use corruption::draft::Base;
use corruption::{Corruption, load_options};
use neat_core::LoadOptions;
use neat_core::layout::Layout;
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_doctor::{Check, Depth, ExamineOptions, Level, examine_folder};
use real::real;
use right::Right;

/// What is said of the corruptions of a scene that are not judged right.
fn misjudged(base: &Base) -> Vec<(&'static str, String)> {
    (Corruption::all().iter())
        .filter(|corruption| corruption.applies_to(base))
        .filter_map(|corruption| {
            let judged = corruption.judged(&corruption.examined(base));
            Some((corruption.name, judged.err()?))
        })
        .collect()
}

#[test]
fn every_corruption_of_a_synthetic_scene_is_named() {
    let config = SyntheticScene {
        solid: Solid::LPrism,
        views: 30,
        image_size: 400,
        image_height: Some(320),
        camera_distance: 2.3,
        ..SyntheticScene::default()
    };
    let base = Base::new(generate(&config).unwrap().scene).unwrap();
    let none_left_out = |corruption: &Corruption| corruption.applies_to(&base);
    assert!(Corruption::all().iter().all(none_left_out));
    let wrong = misjudged(&base);
    assert!(wrong.is_empty(), "{wrong:#?}");
}

fn assert_every_corruption_is_named(name: &str) {
    let Some(dir) = real(name) else {
        return;
    };
    let wrong = misjudged(&Base::read(&dir).unwrap());
    assert!(wrong.is_empty(), "{name}: {wrong:#?}");
}

#[test]
#[ignore = "takes minutes"]
fn every_corruption_of_the_toy_object_is_named() {
    assert_every_corruption_is_named("abc-00075213");
}

#[test]
fn every_corruption_of_ten_photographs_is_named() {
    assert_every_corruption_is_named("strecha-entry-P10");
}

#[test]
#[ignore = "takes minutes"]
fn every_corruption_of_49_photographs_is_named() {
    assert_every_corruption_is_named("dtu-scan24");
}

#[test]
fn no_right_synthetic_scene_is_refused() {
    let depths = [Depth::Quick, Depth::Full];
    let wrong: Vec<_> = (Right::all().iter())
        .flat_map(|right| {
            let of_depth = Iterator::zip(depths.iter(), right.examined(depths));
            of_depth.filter_map(|(depth, examined)| {
                Some((right.name, *depth, right.judged(&examined).err()?))
            })
        })
        .collect();
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn no_real_scene_is_refused() {
    for name in real::SCENES {
        let Some(dir) = real(name) else {
            continue;
        };
        let has_list = dir.join("cameras.json").exists();
        let load = LoadOptions {
            layout: has_list.then_some(Layout::CamerasJson),
            ..load_options()
        };
        for depth in [Depth::Quick, Depth::Full] {
            let options = ExamineOptions {
                depth,
                ..ExamineOptions::default()
            };
            let examination = examine_folder(&dir, &load, &options);
            assert_eq!(examination.problems().count(), 0, "{depth:?} {examination}");
            let mut findings = examination.findings.iter();
            let poses = findings.find(|f| f.check == Check::Poses);
            let level = poses.map(|f| f.level);
            assert_eq!(level, Some(Level::Good), "{depth:?} {examination}");
        }
    }
}
