//! The layout of an OpenMVG reconstruction as JSON.
//!
//! - `sfm_data.json`, else in `reconstruction_sequential/` or
//!   `reconstruction_global/`, where OpenMVG's pipelines put it. Binary files are
//!   converted by `openMVG_main_ConvertSfM_DataFormat`
//! - images as `root_path` and the views name them, below the folder or below
//!   `images/`; `root_path` may be that of another machine
//! - `hawp/NAME.json`, see [`crate::hawp_json`]
//!
//! The cameras `pinhole`, `pinhole_radial_k1`, `pinhole_radial_k3`,
//! `pinhole_brown_t2` ([`Distortion::Brown`]) and `fisheye`
//! ([`Distortion::Fisheye`]) are read. Poses are rotations camera-from-world and
//! centres, in OpenCV axes. Views without a pose or without intrinsics are
//! skipped. Integer coordinates are the centres of pixels.
//!
//! The library that writes these files names a type where it first occurs and
//! then gives only its number (`polymorphic_id`), and it writes what two pointers
//! share only once (`ptr_wrapper`). Members of a base class can lie in `value0`.
//! Other members are ignored.

use super::images;
use super::poses::{PosedImage, Poses, pose_of};
use super::reconstruction::Reconstruction;
use crate::hawp_json::file_stem;
use crate::{Distortion, Intrinsics, Observation, SceneError, SparsePoint, file};
use nalgebra::{Matrix3, Vector2, Vector3};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// In the order in which they are looked for.
const FILE_NAMES: [&str; 3] = [
    "sfm_data.json",
    "reconstruction_sequential/sfm_data.json",
    "reconstruction_global/sfm_data.json",
];
const PIXEL_CENTER: f64 = 0.0;
const REMEDY: &str = "provide the `sfm_data.json` of the reconstruction";
/// Set in the first number of a type or an object, which comes with its name or
/// data.
const FIRST_OCCURRENCE: u32 = 1 << 31;

#[derive(Deserialize)]
struct SfmData {
    #[serde(default)]
    root_path: String,
    views: Vec<Entry<Pointer>>,
    intrinsics: Vec<Entry<Pointer>>,
    extrinsics: Vec<Entry<Pose>>,
    #[serde(default)]
    structure: Vec<Entry<Landmark>>,
}

/// An entry of a map.
#[derive(Deserialize)]
struct Entry<T> {
    key: u32,
    value: T,
}

/// A pointer to an object of a class or of one derived from it.
#[derive(Deserialize)]
struct Pointer {
    polymorphic_id: Option<u32>,
    polymorphic_name: Option<String>,
    ptr_wrapper: Object,
}

#[derive(Deserialize)]
struct Object {
    id: Option<u32>,
    data: Option<Value>,
}

#[derive(Deserialize)]
struct Pose {
    rotation: [[f64; 3]; 3],
    center: [f64; 3],
}

#[derive(Deserialize)]
struct Landmark {
    #[serde(rename = "X")]
    position: [f64; 3],
    #[serde(default)]
    observations: Vec<Entry<Feature>>,
}

#[derive(Deserialize)]
struct Feature {
    x: [f64; 2],
}

/// The file of this layout in the folder `dir`, where there is one.
pub(super) fn find(dir: &Path) -> Option<PathBuf> {
    images::first_of(dir, &FILE_NAMES)
}

pub(super) fn read_poses(dir: &Path) -> Result<Poses, SceneError> {
    let path = find(dir).unwrap_or_else(|| dir.join(FILE_NAMES[0]));
    let bytes = file::read(&path, REMEDY)?;
    parse(&bytes, &path, &[dir.into(), dir.join("images")])
}

fn parse(bytes: &[u8], path: &Path, dirs: &[PathBuf]) -> Result<Poses, SceneError> {
    let json: SfmData = file::parse_json(bytes, path, "OpenMVG scene")?;
    let mut types = BTreeMap::new();
    let views = objects(json.views, &mut types);
    let intrinsics = objects(json.intrinsics, &mut types);
    let poses: BTreeMap<u32, Pose> = json
        .extrinsics
        .into_iter()
        .map(|entry| (entry.key, entry.value))
        .collect();

    let mut posed = Vec::new();
    for (key, view) in &views {
        let member = |name| member::<u32>(&view.data, name);
        let pose = member("id_pose").and_then(|id| poses.get(&id));
        let camera = member("id_intrinsic").and_then(|id| intrinsics.get(&id));
        let (Some(pose), Some(camera)) = (pose, camera) else {
            continue;
        };
        let context = Context {
            path,
            root_path: &json.root_path,
            dirs,
            key: *key,
        };
        posed.push((*key as usize, context.posed_image(view, camera, pose)?));
    }
    let points = json.structure.into_iter().map(|entry| {
        let seen = entry.value.observations.into_iter();
        let observations = seen.map(|seen| Observation {
            view: seen.key as usize,
            pixel: Vector2::from(seen.value.x),
        });
        SparsePoint {
            position_in_world: Vector3::from(entry.value.position),
            observations: observations.collect(),
        }
    });
    let points = points.collect();
    let reconstruction = Reconstruction {
        path: path.into(),
        views: posed,
        points,
        pixel_center: PIXEL_CENTER,
    };
    reconstruction.into_poses()
}

/// An object with the name of its class, where the file gives one. Both are
/// shared: a file can name one large object from as many places as it likes.
struct Typed {
    class: Option<Rc<str>>,
    data: Rc<Value>,
}

/// The objects of a map by their keys; `types` are the names that the file has
/// given to the numbers of classes so far.
fn objects(
    entries: Vec<Entry<Pointer>>,
    types: &mut BTreeMap<u32, Rc<str>>,
) -> BTreeMap<u32, Typed> {
    let mut shared = BTreeMap::new();
    let mut objects = BTreeMap::new();
    for Entry { key, value } in entries {
        let type_id = value.polymorphic_id.map(|id| id & !FIRST_OCCURRENCE);
        if let (Some(id), Some(name)) = (type_id, value.polymorphic_name) {
            types.insert(id, name.into());
        }
        let class = type_id.and_then(|id| types.get(&id)).cloned();
        let id = value.ptr_wrapper.id.map(|id| id & !FIRST_OCCURRENCE);
        let data = match (value.ptr_wrapper.data, id) {
            (Some(data), Some(id)) => {
                let data = Rc::new(data);
                shared.insert(id, Rc::clone(&data));
                data
            }
            (Some(data), None) => Rc::new(data),
            (None, id) => id
                .and_then(|id| shared.get(&id))
                .cloned()
                .unwrap_or_default(),
        };
        objects.insert(key, Typed { class, data });
    }
    objects
}

/// A member of an object or of its base class.
fn member<T: DeserializeOwned>(data: &Value, name: &str) -> Option<T> {
    match data.get(name) {
        Some(value) => T::deserialize(value).ok(),
        None => member(data.get("value0")?, name),
    }
}

/// What every view of a file shares, and the number of one.
struct Context<'a> {
    path: &'a Path,
    root_path: &'a str,
    dirs: &'a [PathBuf],
    key: u32,
}

impl Context<'_> {
    fn posed_image(
        &self,
        view: &Typed,
        camera: &Typed,
        pose: &Pose,
    ) -> Result<PosedImage, SceneError> {
        let local_path: String = member(&view.data, "local_path").unwrap_or_default();
        let file_name: String = self.required("view", view, "filename")?;
        if file_name.is_empty() {
            return Err(self.error("has an empty `filename`"));
        }
        let mut folders_and_name = vec![self.root_path, &local_path, &file_name];
        folders_and_name.retain(|part| !part.is_empty());
        let image = images::locate(self.path, self.dirs, &folders_and_name.join("/"))?;
        let (intrinsics, distortion) = self.lens(camera)?;
        let size = member(&view.data, "width").zip(member(&view.data, "height"));
        // `From` takes the inner arrays for columns.
        let rotation = Matrix3::from(pose.rotation).transpose();
        Ok(PosedImage {
            name: file_stem(&image),
            image,
            intrinsics,
            distortion,
            world_from_camera: pose_of(&rotation, &Vector3::from(pose.center)),
            size,
        })
    }

    fn lens(&self, camera: &Typed) -> Result<(Intrinsics, Distortion), SceneError> {
        let distortion = match camera.class.as_deref().unwrap_or("without type") {
            "pinhole" => Distortion::None,
            "pinhole_radial_k1" => {
                let radial: [f64; 1] = self.required("camera", camera, "disto_k1")?;
                Distortion::brown(&radial, [0.0; 2])
            }
            "pinhole_radial_k3" => {
                let radial: [f64; 3] = self.required("camera", camera, "disto_k3")?;
                Distortion::brown(&radial, [0.0; 2])
            }
            "pinhole_brown_t2" => {
                let [k1, k2, k3, t1, t2] = self.required("camera", camera, "disto_t2")?;
                Distortion::brown(&[k1, k2, k3], [t1, t2])
            }
            "fisheye" => {
                let radial: [f64; 4] = self.required("camera", camera, "fisheye")?;
                Distortion::fisheye(&radial)
            }
            other => {
                return Err(self.error(&format!(
                    "has the camera `{other}`, which is not read: undistort its images with \
                     OpenMVG and give those"
                )));
            }
        };
        let f = self.required("camera", camera, "focal_length")?;
        let [cx, cy] = self.required("camera", camera, "principal_point")?;
        Ok((Intrinsics::new(f, f, cx, cy), distortion))
    }

    fn required<T: DeserializeOwned>(
        &self,
        what: &str,
        object: &Typed,
        name: &str,
    ) -> Result<T, SceneError> {
        member(&object.data, name)
            .ok_or_else(|| self.error(&format!("has a {what} without a valid `{name}`")))
    }

    fn error(&self, reason: &str) -> SceneError {
        SceneError::malformed(self.path, format!("view {} {reason}", self.key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mutation::{CASES, damaged};
    use nalgebra::Matrix4;
    use proptest::prelude::*;
    use serde_json::json;

    /// As OpenMVG writes it: three views, of which the second has no pose; two
    /// cameras of one class.
    fn scene() -> Value {
        let view = |key: u32, name: &str, intrinsic: u32, pose: u32| {
            json!({"key": key, "value": {"polymorphic_id": 1073741824, "ptr_wrapper": {
                "id": 2147483649_u32 + key, "data": {"local_path": "left", "filename": name,
                "width": 12, "height": 8, "id_view": key, "id_intrinsic": intrinsic,
                "id_pose": pose}}}})
        };
        json!({
            "sfm_data_version": "0.3", "root_path": "/home/someone/images",
            "views": [view(0, "b.jpg", 0, 0), view(1, "c.jpg", 0, u32::MAX), view(2, "a.jpg", 5, 2)],
            "intrinsics": [
                {"key": 0, "value": {"polymorphic_id": 2147483649_u32,
                    "polymorphic_name": "pinhole_radial_k3", "ptr_wrapper": {"id": 2147483652_u32,
                    "data": {"width": 12, "height": 8, "focal_length": 20.0,
                    "principal_point": [6.5, 4.0], "disto_k3": [0.1, -0.2, 0.3]}}}},
                {"key": 5, "value": {"polymorphic_id": 1, "ptr_wrapper": {"id": 2147483653_u32,
                    "data": {"value0": {"value0": {"width": 12, "height": 8}, "focal_length": 10.0,
                    "principal_point": [6.0, 4.5]}, "disto_k3": [0.0, 0.0, 0.0]}}}}],
            "extrinsics": [
                {"key": 0, "value": {"rotation": [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
                    "center": [1.0, 2.0, 3.0]}},
                {"key": 2, "value": {"rotation": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
                    "center": [4.0, 5.0, 6.0]}}],
            "structure": [{"key": 7, "value": {"X": [1.0, 2.0, 8.0], "observations": [
                {"key": 0, "value": {"id_feat": 3, "x": [6.5, 4.0]}},
                {"key": 1, "value": {"id_feat": 4, "x": [1.0, 1.0]}},
                {"key": 2, "value": {"id_feat": 5, "x": [2.25, 3.5]}}]}}],
            "control_points": [],
        })
    }

    fn parse_json(json: &Value) -> Result<Poses, SceneError> {
        parse_text(json.to_string().as_bytes())
    }

    fn parse_text(bytes: &[u8]) -> Result<Poses, SceneError> {
        parse(bytes, Path::new("scene/sfm_data.json"), &["scene".into()])
    }

    #[test]
    fn views_poses_and_structure_are_read() {
        let poses = parse_json(&scene()).unwrap();
        let [a, b] = poses.views.as_slice() else {
            panic!("two views with a pose");
        };
        assert_eq!((a.name.as_str(), b.name.as_str()), ("a", "b"));
        assert_eq!(a.size, Some((12, 8)));
        assert_eq!((a.intrinsics.fx, a.intrinsics.cy), (10.0, 4.5));
        assert_eq!((b.intrinsics.fy, b.intrinsics.cx), (20.0, 6.5));
        assert_eq!(a.distortion, Distortion::None);
        let lens = Distortion::Brown {
            radial: [0.1, -0.2, 0.3, 0.0, 0.0, 0.0],
            tangential: [0.0; 2],
        };
        assert_eq!(b.distortion, lens);
        let turned = Matrix4::new(
            0.0, 1.0, 0.0, 1.0, -1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 1.0,
        );
        assert_eq!(b.world_from_camera, turned);
        assert_eq!(poses.pixel_center, Some(0.0));
        let seen = |view, x, y| Observation {
            view,
            pixel: Vector2::new(x, y),
        };
        let point = &poses.points[0];
        assert_eq!(point.position_in_world, Vector3::new(1.0, 2.0, 8.0));
        assert_eq!(point.observations, [seen(1, 6.5, 4.0), seen(0, 2.25, 3.5)]);
    }

    #[test]
    fn every_lens_has_its_distortion() {
        let with = |class: &str, member: &str, values: Value| {
            let mut json = scene();
            let value = &mut json["intrinsics"][0]["value"];
            value["polymorphic_name"] = class.into();
            value["ptr_wrapper"]["data"][member] = values;
            // The other camera is of the same class.
            json["views"].as_array_mut().unwrap().truncate(1);
            parse_json(&json).map(|poses| poses.views[0].distortion)
        };
        assert_eq!(with("pinhole", "x", json!(0)).unwrap(), Distortion::None);
        let brown = |radial, tangential| Distortion::Brown { radial, tangential };
        let k1 = with("pinhole_radial_k1", "disto_k1", json!([0.5])).unwrap();
        assert_eq!(k1, brown([0.5, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; 2]));
        let t2 = json!([0.1, 0.2, 0.3, 0.4, 0.5]);
        let t2 = with("pinhole_brown_t2", "disto_t2", t2).unwrap();
        assert_eq!(t2, brown([0.1, 0.2, 0.3, 0.0, 0.0, 0.0], [0.4, 0.5]));
        let fisheye = with("fisheye", "fisheye", json!([0.1, 0.2, 0.3, 0.4])).unwrap();
        let expected = Distortion::Fisheye {
            radial: [0.1, 0.2, 0.3, 0.4, 0.0, 0.0],
            tangential: [0.0; 2],
            thin_prism: [0.0; 4],
        };
        assert_eq!(fisheye, expected);
        for (class, expected) in [
            ("spherical", "camera `spherical`, which is not read"),
            ("pinhole_radial_k1", "camera without a valid `disto_k1`"),
        ] {
            let message = with(class, "x", json!(0)).unwrap_err().to_string();
            assert!(
                message.contains("view 0") && message.contains(expected),
                "{message}"
            );
        }
    }

    #[test]
    fn bad_views_are_named() {
        let error = |change: &dyn Fn(&mut Value)| {
            let mut json = scene();
            change(&mut json);
            parse_json(&json).err().unwrap().to_string()
        };
        let data = |json: &mut Value, key: &str, value: Value| {
            json["views"][2]["value"]["ptr_wrapper"]["data"][key] = value;
        };
        assert!(
            error(&|json| data(json, "filename", json!(3))).contains("view 2 has a view without")
        );
        assert!(error(&|json| data(json, "filename", json!(""))).contains("empty `filename`"));
        assert!(
            error(&|json| data(json, "filename", json!("b.jpg"))).contains("`b` appears twice")
        );
        let focal = |json: &mut Value, value: Value| {
            json["intrinsics"][0]["value"]["ptr_wrapper"]["data"]["focal_length"] = value;
        };
        assert!(error(&|json| focal(json, json!(-1))).contains("not both positive"));
        assert!(error(&|json| focal(json, Value::Null)).contains("without a valid `focal_length`"));
        let no_type = |json: &mut Value| {
            json["intrinsics"][0]["value"]["polymorphic_name"] = Value::Null;
        };
        assert!(error(&no_type).contains("camera `without type`"));
        let text = error(&|json| json["extrinsics"] = json!("none"));
        assert!(
            text.contains("sfm_data.json is not a valid OpenMVG scene"),
            "{text}"
        );
        // Nothing but views without pose.
        let mut none = scene();
        none["extrinsics"] = json!([]);
        assert!(parse_json(&none).unwrap().views.is_empty());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(CASES))]
        #[test]
        fn damaged_files_never_panic(bytes in damaged(scene().to_string())) {
            if let Ok(poses) = parse_text(&bytes) {
                prop_assert!(poses.views.iter().all(|view| view.intrinsics.validate().is_ok()));
            }
        }
    }
}
