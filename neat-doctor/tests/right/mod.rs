//! Right scenes of many kinds, which the doctor has to accept.

mod table;

use crate::corruption::draft::{Base, Draft};
use crate::corruption::textured::{Texture, textured};
use image::RgbImage;
use neat_core::Camera;
use neat_core::synthetic::{SyntheticScene, generate, render};
use neat_doctor::{Cause, Check, Depth, Examination, ExamineOptions, Level, examine_folder};

/// How a synthetic scene is made.
pub struct Right {
    pub name: &'static str,
    scene: SyntheticScene,
    /// What is other than usual about each camera; views for which it is `None` are left out.
    camera: fn(usize, Camera) -> Option<Camera>,
    texture: Option<Texture>,
    image: fn(usize, RgbImage) -> RgbImage,
    draft: fn(&mut Draft),
    /// So little can be seen that nothing is said of the poses.
    pub shows_little: bool,
}

impl Right {
    /// All of them.
    pub fn all() -> Vec<Self> {
        table::all()
    }

    fn new(name: &'static str, scene: SyntheticScene) -> Self {
        Self {
            name,
            scene,
            camera: |_, camera| Some(camera),
            texture: None,
            image: |_, image| image,
            draft: |_| {},
            shows_little: false,
        }
    }

    fn camera(mut self, camera: fn(usize, Camera) -> Option<Camera>) -> Self {
        self.camera = camera;
        self
    }

    fn texture(mut self, texture: Texture) -> Self {
        self.texture = Some(texture);
        self
    }

    fn image(mut self, image: fn(usize, RgbImage) -> RgbImage) -> Self {
        self.image = image;
        self
    }

    fn draft(mut self, draft: fn(&mut Draft)) -> Self {
        self.draft = draft;
        self
    }

    fn shows_little(mut self) -> Self {
        self.shows_little = true;
        self
    }

    /// What is said of it at each depth.
    pub fn examined<const N: usize>(&self, depths: [Depth; N]) -> [Examination; N] {
        let mut data = generate(&self.scene).unwrap();
        let views = std::mem::take(&mut data.scene.views);
        for (index, mut view) in views.into_iter().enumerate() {
            let Some(camera) = (self.camera)(index, view.camera) else {
                continue;
            };
            view.camera = camera;
            view.image = render(&data.solid, &camera, self.scene.shading).into();
            view.wireframe = neat_core::Wireframe2d::empty(camera.width, camera.height);
            data.scene.views.push(view);
        }
        let mut scene = match self.texture {
            Some(texture) => textured(data, texture),
            None => data.scene,
        };
        for (index, view) in scene.views.iter_mut().enumerate() {
            let image = view.image.read().unwrap().into_owned();
            view.image = (self.image)(index, image).into();
        }
        let base = Base::new(scene).unwrap();
        let mut draft = Draft::new(&base);
        (self.draft)(&mut draft);
        let folder = draft.write();
        depths.map(|depth| {
            let options = ExamineOptions {
                depth,
                ..ExamineOptions::default()
            };
            examine_folder(folder.path(), &draft.load, &options)
        })
    }

    /// Whether it is accepted, and its poses are found to be good.
    pub fn judged(&self, examination: &Examination) -> Result<(), String> {
        let poses = examination
            .findings
            .iter()
            .find(|f| f.check == Check::Poses);
        let right = if self.shows_little {
            poses.is_some_and(|f| f.cause == Some(Cause::TooLittleEvidence))
        } else {
            poses.is_some_and(|f| f.level == Level::Good)
        };
        if right && examination.problems().count() == 0 {
            return Ok(());
        }
        Err(examination.to_string())
    }
}
