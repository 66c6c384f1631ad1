use super::*;
use crate::config::Preset;
use neat_core::synthetic::{SyntheticScene, generate};

const MACHINE: Machine = Machine {
    backend: Backend::Flex,
    memory_limit: MemoryLimit::NONE,
};

/// Of an object before black.
fn black() -> Scene {
    let small = SyntheticScene {
        views: 4,
        image_size: 48,
        min_visible_length: 2.0,
        ..SyntheticScene::default()
    };
    generate(&small).unwrap().scene
}

/// The same before something else.
fn photographs() -> Scene {
    let mut scene = black();
    for view in &mut scene.views {
        let mut image = view.image.read().unwrap().into_owned();
        for pixel in image.pixels_mut() {
            pixel.0 = pixel.0.map(|c| c.max(90));
        }
        view.image = image.into();
    }
    scene
}

fn settled(asked: &Config, scene: &Scene) -> (Plan, Vec<String>) {
    let (plan, decisions) = settle(asked, scene, MACHINE, None).unwrap();
    (plan, decisions.into_iter().map(|d| d.setting).collect())
}

/// The fast preset, with a field.
fn with_field() -> Config {
    let mut asked = Preset::Fast.config();
    asked.distill.field = Choice::Given(FieldUse::Trained);
    asked
}

#[test]
fn images_need_no_field() {
    let mut asked = Preset::Fast.config();
    asked.model.perceiver.junctions = JunctionCount::AUTO;
    for scene in [black(), photographs()] {
        let (plan, decisions) = settled(&asked, &scene);
        assert_eq!(plan.back_end(), BackEnd::Assembler);
        assert!(!plan.trains());
        // Nothing is decided that only training looks at.
        assert_eq!(plan.background(), None);
        assert_eq!(plan.config().train, asked.train);
        assert_eq!(plan.config().model, asked.model);
        assert_eq!(decisions, ["distill.field"]);
    }
}

#[test]
fn a_field_of_an_object_before_black_is_as_configured() {
    let asked = with_field();
    let (plan, decisions) = settled(&asked, &black());
    assert_eq!(plan.background(), Some(Background::Black));
    assert_eq!(plan.config().train, asked.train);
    assert_eq!(plan.config().model, asked.model);
    assert!(plan.trains());
    assert_eq!(decisions, ["data.background"]);
}

#[test]
fn a_field_of_photographs_gets_a_sphere_behind_them() {
    let (plan, decisions) = settled(&with_field(), &photographs());
    assert_eq!(plan.back_end(), BackEnd::Assembler);
    assert!(plan.trains());
    let config = plan.config();
    assert_eq!(config.train.loss.mask, 0.0);
    assert_eq!(config.model.implicit.bounding_sphere_slope, SPHERE_SLOPE);
    assert_eq!(
        decisions,
        [
            "data.background",
            "train.loss.mask",
            "model.implicit.bounding_sphere_slope",
        ]
    );
}

#[test]
fn shells_stand_behind_photographs_in_place_of_the_sphere() {
    let mut asked = with_field();
    asked.model.background.shells = 4;
    let (plan, decisions) = settled(&asked, &photographs());
    assert_eq!(plan.config().model, asked.model);
    assert_eq!(decisions, ["data.background", "train.loss.mask"]);
    let (on_black, decisions) = settled(&asked, &black());
    assert_eq!(on_black.config().model.background.shells, 0);
    assert_eq!(decisions, ["data.background", "model.background.shells"]);
    // What was trained stays.
    let (later, _) = settle(&asked, &black(), MACHINE, Some(&plan)).unwrap();
    assert_eq!(later.config().model, plan.config().model);
}

#[test]
fn what_is_given_or_decided_stays() {
    let (plan, _) = settled(&with_field(), &photographs());
    // As a person has it who leaves nothing open.
    let (again, decisions) = settled(plan.config(), &black());
    assert_eq!(again, plan);
    assert!(decisions.is_empty(), "{decisions:?}");
    let (published, decisions) = settled(&Preset::PaperDtu.config(), &photographs());
    assert_eq!(published.config(), &Preset::PaperDtu.config());
    assert!(decisions.is_empty(), "{decisions:?}");
}

#[test]
fn what_an_earlier_part_of_a_run_has_decided_stays() {
    let mut asked = with_field();
    asked.model.perceiver.junctions = JunctionCount::AUTO;
    let (mut first, decisions) = settled(&asked, &photographs());
    assert!(decisions.contains(&"model.perceiver.junctions".to_owned()));
    first.config.model.perceiver.junctions = JunctionCount::Fixed(99);
    first.config.train.ray_chunk = Some(7);
    let (again, _) = settle(&asked, &black(), MACHINE, Some(&first)).unwrap();
    assert_eq!(again, first);
    // But not against what is given.
    asked.distill.back_end = BackEnd::Paper;
    asked.train.ray_chunk = Some(8);
    let (other, _) = settle(&asked, &black(), MACHINE, Some(&first)).unwrap();
    assert_eq!(other.back_end(), BackEnd::Paper);
    assert_eq!(other.config().train.ray_chunk, Some(8));
}

#[test]
fn a_trained_field_keeps_its_sphere_whatever_is_said_of_the_background() {
    let (trained, _) = settled(&with_field(), &photographs());
    let mut asked = with_field();
    asked.data.background = Some(Choice::Given(Background::Black));
    let (plan, _) = settle(&asked, &photographs(), MACHINE, Some(&trained)).unwrap();
    assert_eq!(plan.background(), Some(Background::Black));
    assert_eq!(plan.config().model, trained.config().model);
}

#[test]
fn steps_are_taken_in_passes_where_memory_is_short_and_nobody_has_decided() {
    let mut asked = Preset::PaperAbc.config();
    let scene = black();
    let chunk = |asked: &Config, machine: Machine| {
        let (plan, decisions) = settle(asked, &scene, machine, None).unwrap();
        (plan.config.train.ray_chunk, decisions.len())
    };
    let small = Machine {
        memory_limit: MemoryLimit::of_bytes(2 << 30),
        ..MACHINE
    };
    assert_eq!(chunk(&asked, MACHINE), (None, 0));
    assert!(matches!(chunk(&asked, small), (Some(350..512), 1)));
    let on_gpu = Machine {
        backend: Backend::Wgpu,
        ..small
    };
    assert_eq!(chunk(&asked, on_gpu), (None, 0));
    asked.train.ray_chunk = Some(999);
    assert_eq!(chunk(&asked, small), (Some(999), 0));
}

#[test]
fn what_is_open_or_contradicts_itself_is_no_plan() {
    let open = Plan::new(with_field()).unwrap_err();
    assert!(open.to_string().contains("data.background"), "{open}");
    let mut config = Preset::PaperAbc.config();
    config.train.rays = 0;
    assert!(matches!(Plan::new(config), Err(PlanError::Config(_))));
    let mut config = Preset::PaperAbc.config();
    config.detect.min_gradient = 0.0;
    assert!(matches!(Plan::new(config), Err(PlanError::Detector(_))));
    let mut config = Preset::PaperAbc.config();
    config.distill.field = Choice::Given(FieldUse::None);
    let error = Plan::new(config).unwrap_err().to_string();
    assert!(error.contains("distill.back_end = paper asks"), "{error}");
    let mut config = Preset::Neat.config();
    config.distill.field = Choice::Given(FieldUse::None);
    let error = Plan::new(config.clone()).unwrap_err().to_string();
    assert!(error.contains("distill.partners = field asks"), "{error}");
    config.distill.partners = Partners::Epipolar;
    assert!(!Plan::new(config).unwrap().trains());
}
