//! A scene that is about to be written, in the layout of `cameras.npz`.

use super::load_options;
use super::textured::{textured, veins};
use image::RgbImage;
use nalgebra::{Matrix3, Matrix4};
use neat_core::layout::abc;
use neat_core::npz::{NpyArray, write_npz};
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_core::{
    Camera, LoadOptions, Scene, SceneError, ViewImage, Wireframe2d, hawp_json, load_scene,
};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Images are spoilt at this size: larger ones take time and tell nothing else.
const MAX_IMAGE_SIZE: u32 = 1024;

/// A good scene, and a folder that holds it.
pub struct Base {
    pub scene: Scene,
    dir: TempDir,
}

impl Base {
    /// The scene in the folder `dir`, its images not larger than they have to be.
    pub fn read(dir: &Path) -> Result<Self, SceneError> {
        let load = LoadOptions {
            max_image_size: Some(MAX_IMAGE_SIZE),
            ..load_options()
        };
        Self::new(load_scene(dir, &load)?.scene)
    }

    pub fn new(scene: Scene) -> Result<Self, SceneError> {
        let dir = tempfile::tempdir().unwrap();
        abc::write_scene(&scene, dir.path())?;
        Ok(Self { scene, dir })
    }

    /// Whether the border of the first image shows something.
    fn is_photographed(&self) -> bool {
        let image = self.scene.views[0].image.read().unwrap();
        (0..image.width()).any(|x| image.get_pixel(x, 0) != image.get_pixel(0, 0))
    }
}

/// A scene that can be spoilt before it is written.
pub struct Draft {
    /// In the order of the poses in their file.
    pub views: Vec<DraftView>,
    /// What it will be read with.
    pub load: LoadOptions,
    /// The share of the file of poses that is written.
    pub share_of_cameras: f64,
    /// Images without a pose.
    pub extra_images: Vec<DraftView>,
    /// The images have no plain background.
    is_photographed: bool,
    pixel_center: f64,
}

#[derive(Clone)]
pub struct DraftView {
    /// Of image and 2D wireframe.
    pub name: String,
    pub picture: Picture,
    pub pose: Matrix4<f64>,
    pub k: Matrix3<f64>,
    /// `None` if the scene has none.
    pub wireframe: Option<Wireframe2d>,
    image: ViewImage,
}

/// What stands in the place of an image.
#[derive(Clone)]
pub enum Picture {
    /// A copy of a file.
    File(PathBuf),
    Pixels(RgbImage),
    /// What is no image, or not all of it.
    Bytes(Vec<u8>),
    Missing,
}

impl DraftView {
    /// What the image shows before it is spoilt.
    pub fn pixels(&self) -> RgbImage {
        self.image.read().unwrap().into_owned()
    }

    /// Puts another image in its place.
    pub fn edit(&mut self, edit: impl Fn(&RgbImage) -> RgbImage) {
        self.picture = Picture::Pixels(edit(&self.pixels()));
    }

    /// Width and height of the image before it is spoilt.
    pub fn size(&self) -> [f64; 2] {
        let (width, height) = self.image.dimensions();
        [f64::from(width), f64::from(height)]
    }

    fn write(&self, dir: &Path) {
        let file = dir.join("images").join(format!("{}.png", self.name));
        match &self.picture {
            Picture::File(path) => {
                fs::copy(path, &file).unwrap();
            }
            Picture::Pixels(pixels) => pixels.save(file).unwrap(),
            Picture::Bytes(bytes) => fs::write(file, bytes).unwrap(),
            Picture::Missing => return,
        }
        if let Some(wireframe) = &self.wireframe {
            let path = dir.join("hawp").join(format!("{}.json", self.name));
            fs::create_dir_all(dir.join("hawp")).unwrap();
            fs::write(path, hawp_json::to_bytes(wireframe, 0.0)).unwrap();
        }
    }
}

impl Draft {
    pub fn new(base: &Base) -> Self {
        let has_wireframes = base.scene.has_wireframes();
        let images = base.dir.path().join("images");
        let views = (base.scene.views.iter())
            .map(|view| DraftView {
                name: view.name.clone(),
                picture: Picture::File(images.join(format!("{}.png", view.name))),
                pose: view.camera.matrix_world_from_camera(),
                k: view.camera.intrinsics.matrix(),
                wireframe: has_wireframes.then(|| view.wireframe.clone()),
                image: view.image.clone(),
            })
            .collect();
        Self {
            views,
            load: load_options(),
            share_of_cameras: 1.0,
            extra_images: Vec::new(),
            is_photographed: base.is_photographed(),
            pixel_center: base.scene.pixel_center,
        }
    }

    /// Changes every pose.
    pub fn each_pose(&mut self, change: impl Fn(&Matrix4<f64>) -> Matrix4<f64>) {
        for view in &mut self.views {
            view.pose = change(&view.pose);
        }
    }

    /// Changes every image.
    pub fn each_image(&mut self, edit: impl Fn(&RgbImage) -> RgbImage) {
        self.views.iter_mut().for_each(|view| view.edit(&edit));
    }

    /// Changes every 2D wireframe.
    pub fn each_wireframe(&mut self, change: impl Fn(&mut Wireframe2d)) {
        let views = self.views.iter_mut();
        views
            .filter_map(|view| view.wireframe.as_mut())
            .for_each(change);
    }

    /// Leaves the 2D wireframes out.
    pub fn without_wireframes(&mut self) {
        self.views.iter_mut().for_each(|view| view.wireframe = None);
    }

    /// Gives view i the pose and intrinsics of view `order[i]`.
    pub fn reorder(&mut self, order: &[usize]) {
        let cameras: Vec<_> = self.views.iter().map(|view| (view.pose, view.k)).collect();
        for (view, source) in self.views.iter_mut().zip(order) {
            (view.pose, view.k) = cameras[*source];
        }
    }

    /// A view in the midst of the others.
    pub fn one(&mut self) -> &mut DraftView {
        let view = self.views.len() / 3;
        &mut self.views[view]
    }

    /// Images of another scene, of the size of the first image, and their cameras. It
    /// shows texture if this one does.
    pub fn other_scene(&self, views: usize) -> (Vec<RgbImage>, Vec<Camera>) {
        let [width, height] = self.views[0].size();
        let config = SyntheticScene {
            solid: Solid::UPrism,
            // Spread otherwise than those of synthetic scenes.
            views: views + 9,
            image_size: width as u32,
            image_height: Some(height as u32),
            camera_distance: 3.0,
            seed: 5,
            ..SyntheticScene::default()
        };
        let data = generate(&config).unwrap();
        let scene = if self.is_photographed {
            textured(data, veins)
        } else {
            data.scene
        };
        let views = &scene.views[..views];
        let images = (views.iter()).map(|view| view.image.read().unwrap().into_owned());
        let cameras = views.iter().map(|view| view.camera);
        (images.collect(), cameras.collect())
    }

    /// The folder of the scene, as it is read by [`Self::load`].
    pub fn write(&self) -> TempDir {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("images")).unwrap();
        let views = self.views.iter().chain(&self.extra_images);
        views.for_each(|view| view.write(dir.path()));
        let count = self.views.len();
        let array = |side: usize, values: Vec<f64>| NpyArray {
            shape: vec![count, side, side],
            values,
        };
        // Row by row: nalgebra stores columns.
        let poses = self
            .views
            .iter()
            .flat_map(|v| v.pose.transpose().as_slice().to_vec());
        let intrinsics = self
            .views
            .iter()
            .flat_map(|v| v.k.transpose().as_slice().to_vec());
        let pixel_center = NpyArray {
            shape: Vec::new(),
            values: vec![self.pixel_center],
        };
        let arrays = BTreeMap::from([
            ("extrinsics", array(4, poses.collect())),
            ("intrinsics", array(3, intrinsics.collect())),
            ("pixel_center", pixel_center),
        ]);
        let path = dir.path().join("cameras.npz");
        write_npz(&path, &arrays).unwrap();
        if self.share_of_cameras < 1.0 {
            let bytes = fs::read(&path).unwrap();
            let kept = (bytes.len() as f64 * self.share_of_cameras) as usize;
            fs::write(&path, &bytes[..kept]).unwrap();
        }
        dir
    }
}
