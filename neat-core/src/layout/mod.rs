//! Scenes on disk: which files hold images, poses and 2D wireframes.
//!
//! Several layouts are known ([`Layout`]); each has a file here that reads its
//! poses. Images and wireframes are read alike for all of them, by this file.

pub mod abc;
mod binary_reader;
mod bundler;
mod cameras_json;
mod colmap;
pub(crate) mod dtu;
mod images;
mod input_files;
mod load;
mod load_options;
mod masks;
mod meta_data_json;
mod nvm;
mod openmvg;
mod openmvs;
mod photograph;
mod pixel_center;
mod point_files;
mod pose_convention;
pub(crate) mod poses;
mod reconstruction;
mod rectify;
mod sphere;
mod strecha;
mod text_lines;
mod transforms_json;
mod turn;
mod view_reader;
mod warning;

pub use abc::HAWP_DIR;
pub use images::{list as list_images, read_rgb as read_image, read_size as image_size};
pub use load::{LoadedScene, load_scene};
pub use load_options::LoadOptions;
pub use pixel_center::PixelCenter;
pub use pose_convention::{CameraAxes, PoseConvention, PoseConventionError, PoseDirection};
pub use warning::SceneWarning;

use crate::SceneError;
use crate::npz::NpzReader;
use poses::Poses;
use std::fmt;
use std::path::Path;

/// How the files of a scene are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// `images/`, `hawp/`, and `cameras.npz` with stacked `intrinsics` and
    /// `extrinsics`: the ABC objects of the published code. See [`abc`].
    Abc,
    /// `image/`, `hawp/`, and `cameras_sphere.npz` or `cameras.npz` with
    /// `world_mat_i` and `scale_mat_i`: DTU and BlendedMVS, as IDR, VolSDF and
    /// NeuS store them.
    Dtu,
    /// `cameras.json` that names every image with its intrinsics and pose, and
    /// `hawp/`.
    CamerasJson,
    /// `transforms.json` or `transforms_train.json` that names every image with
    /// its pose, and `hawp/`: Blender's NeRF scenes, instant-ngp, nerfstudio.
    TransformsJson,
    /// `images/`, `hawp/`, and a COLMAP model in `sparse/0/`, `sparse/` or the
    /// folder itself, binary or text.
    Colmap,
    /// `meta_data.json` that names every image with its pose, and `hawp/`:
    /// sdfstudio and EMAP.
    MetaDataJson,
    /// `sfm_data.json` of OpenMVG, and `hawp/`.
    OpenMvg,
    /// A `.mvs` scene in OpenMVS's interface format, and `hawp/`.
    OpenMvs,
    /// A `.nvm` file of VisualSfM, and `hawp/`.
    VisualSfm,
    /// `bundle.out` and `list.txt` of Bundler, and `hawp/`.
    Bundler,
    /// One `NAME.jpg.camera` per image, and `hawp/`: the benchmark of Strecha and
    /// others.
    Strecha,
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Abc => "ABC (cameras.npz with intrinsics and extrinsics)",
            Self::Dtu => "DTU (cameras.npz or cameras_sphere.npz with world_mat and scale_mat)",
            Self::CamerasJson => "cameras.json",
            Self::TransformsJson => "transforms.json (OpenGL axes)",
            Self::Colmap => "COLMAP (cameras and images of a sparse model)",
            Self::MetaDataJson => "meta_data.json (sdfstudio, EMAP)",
            Self::OpenMvg => "OpenMVG (sfm_data.json)",
            Self::OpenMvs => "OpenMVS (scene.mvs)",
            Self::VisualSfm => "VisualSfM (N-View Match file, .nvm)",
            Self::Bundler => "Bundler (bundle.out and list.txt)",
            Self::Strecha => "Strecha (one .camera file per image)",
        })
    }
}

impl Layout {
    /// Whether the images of a scene are those of its folders, of which some may have found no
    /// pose; elsewhere other pictures, as of depths, lie beside them.
    fn poses_some_images(self) -> bool {
        use Layout::{Bundler, Colmap, OpenMvg, OpenMvs, VisualSfm};
        matches!(self, Colmap | OpenMvg | OpenMvs | VisualSfm | Bundler)
    }

    /// Tells the layout of the folder `dir` by its files, looked for in the order
    /// `cameras_sphere.npz`, `cameras.npz`, `cameras.json`, `transforms.json`, a
    /// COLMAP model, `meta_data.json`, `sfm_data.json`, `.mvs`, `.nvm`,
    /// `bundle.out`, `.camera`.
    ///
    /// # Errors
    /// If the folder does not exist or follows no known layout.
    pub fn detect(dir: &Path) -> Result<Self, SceneError> {
        let remedy = "give the folder of a scene";
        if dir.is_file() {
            return Err(SceneError::NotAFolder {
                path: dir.into(),
                remedy: remedy.into(),
            });
        }
        if !dir.is_dir() {
            return Err(SceneError::missing(dir, remedy));
        }
        for npz_path in dtu::candidates(dir) {
            if npz_path.exists() {
                let npz = NpzReader::open(&npz_path, poses::NPZ_REMEDY)?;
                if abc::is_in(&npz) && npz_path.ends_with(poses::CAMERAS_NPZ) {
                    return Ok(Self::Abc);
                }
                if dtu::is_in(&npz) {
                    return Ok(Self::Dtu);
                }
            }
        }
        type IsIn = fn(&Path) -> bool;
        let checks: [(Self, IsIn); 9] = [
            (Self::CamerasJson, |dir| {
                dir.join(cameras_json::FILE_NAME).exists()
            }),
            (Self::TransformsJson, |dir| {
                transforms_json::find(dir).is_some()
            }),
            (Self::Colmap, colmap::is_in),
            (Self::MetaDataJson, |dir| {
                dir.join(meta_data_json::FILE_NAME).exists()
            }),
            (Self::OpenMvg, |dir| openmvg::find(dir).is_some()),
            (Self::OpenMvs, |dir| openmvs::find(dir).is_some()),
            (Self::VisualSfm, |dir| nvm::find(dir).is_some()),
            (Self::Bundler, |dir| bundler::find(dir).is_some()),
            (Self::Strecha, |dir| strecha::find(dir).is_some()),
        ];
        let found = checks.into_iter().find(|(_, is_in)| is_in(dir));
        found
            .map(|(layout, _)| layout)
            .ok_or_else(|| SceneError::UnknownLayout { path: dir.into() })
    }

    fn read_poses(self, dir: &Path) -> Result<Poses, SceneError> {
        match self {
            Self::Abc => abc::read_poses(dir),
            Self::Dtu => dtu::read_poses(dir),
            Self::CamerasJson => cameras_json::read_poses(dir),
            Self::TransformsJson => transforms_json::read_poses(dir),
            Self::Colmap => colmap::read_poses(dir),
            Self::MetaDataJson => meta_data_json::read_poses(dir),
            Self::OpenMvg => openmvg::read_poses(dir),
            Self::OpenMvs => openmvs::read_poses(dir),
            Self::VisualSfm => nvm::read_poses(dir),
            Self::Bundler => bundler::read_poses(dir),
            Self::Strecha => strecha::read_poses(dir),
        }
    }
}
