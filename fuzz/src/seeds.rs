//! Small files that the readers can read, made here: none is anybody's data.

use crate::readers::SEPARATOR;
use image::{DynamicImage, GrayImage, ImageFormat, Luma, RgbImage, RgbaImage};
use neat_core::npz::{NpyArray, write_npz};
use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;

const IDENTITY: [f64; 16] = [
    1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, -4.0, 0.0, 0.0, 0.0, 1.0,
];
const ASIDE: [f64; 16] = [
    1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, -4.0, 0.0, 0.0, 0.0, 1.0,
];
const K: [f64; 9] = [20.0, 0.0, 6.0, 0.0, 21.0, 4.0, 0.0, 0.0, 1.0];

/// The files of one input.
fn joined<T: AsRef<[u8]>>(files: &[T]) -> Vec<u8> {
    let files: Vec<&[u8]> = files.iter().map(AsRef::as_ref).collect();
    files.join(SEPARATOR)
}

fn little<T, const N: usize>(numbers: &[T], bytes: impl Fn(&T) -> [u8; N]) -> Vec<u8> {
    numbers.iter().flat_map(bytes).collect()
}

fn f64s(numbers: &[f64]) -> Vec<u8> {
    little(numbers, |x| x.to_le_bytes())
}

fn u64s(numbers: &[u64]) -> Vec<u8> {
    little(numbers, |x| x.to_le_bytes())
}

fn u32s(numbers: &[u32]) -> Vec<u8> {
    little(numbers, |x| x.to_le_bytes())
}

fn archive(arrays: &[(&str, &[usize], Vec<f64>)]) -> Vec<u8> {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.npz");
    let array = |shape: &[usize], values: &[f64]| NpyArray {
        shape: shape.to_vec(),
        values: values.to_vec(),
    };
    let arrays: BTreeMap<&str, NpyArray> = (arrays.iter())
        .map(|(name, shape, values)| (*name, array(shape, values)))
        .collect();
    write_npz(&path, &arrays).expect("an archive");
    fs::read(path).expect("the archive")
}

/// A `.npy` file of 32-bit floats as NumPy writes it.
fn npy_of(shape: &str, values: &[f32]) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(little(values, |x| x.to_le_bytes()));
    bytes
}

fn encoded(image: impl Into<DynamicImage>, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.into().write_to(&mut bytes, format).expect("an image");
    bytes.into_inner()
}

pub fn abc() -> Vec<Vec<u8>> {
    let poses = [IDENTITY, ASIDE].concat();
    let arrays: &[(&str, &[usize], Vec<f64>)] = &[
        ("intrinsics", &[2, 3, 3], [K, K].concat()),
        ("extrinsics", &[2, 4, 4], poses),
        ("pixel_center", &[], vec![0.5]),
        ("sphere_radius", &[], vec![1.5]),
    ];
    vec![archive(arrays)]
}

pub fn dtu() -> Vec<Vec<u8>> {
    // K (R | t) of two cameras in front of the origin.
    let world = |x: f64| {
        let mut rows = vec![20.0, 0.0, 6.0, 24.0 - 20.0 * x, 0.0, 21.0, 4.0, 16.0];
        rows.extend([0.0, 0.0, 1.0, 4.0, 0.0, 0.0, 0.0, 1.0]);
        rows
    };
    let mut scale = IDENTITY.to_vec();
    scale[11] = 0.5;
    let arrays: &[(&str, &[usize], Vec<f64>)] = &[
        ("world_mat_0", &[4, 4], world(0.0)),
        ("world_mat_1", &[4, 4], world(1.0)),
        ("scale_mat_0", &[4, 4], scale.clone()),
        ("scale_mat_1", &[4, 4], scale),
    ];
    vec![archive(arrays)]
}

pub fn cameras_json() -> Vec<Vec<u8>> {
    let frame = |name: &str, x: f64| {
        format!(
            r#"{{"file": "images/{name}.png", "width": 12, "height": 8,
            "K": [[20, 0, 6], [0, 21, 4], [0, 0, 1]],
            "c2w": [[1, 0, 0, {x}], [0, 1, 0, 0], [0, 0, 1, -4], [0, 0, 0, 1]]}}"#
        )
    };
    let text = format!(
        r#"{{"frames": [{}, {}]}}"#,
        frame("a", 0.0),
        frame("b", 1.0)
    );
    vec![text.into_bytes()]
}

pub fn transforms_json() -> Vec<Vec<u8>> {
    let frames = r#""frames": [{"file_path": "./images/a.png", "transform_matrix":
        [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]}, {"file_path": "images/b",
        "transform_matrix": [[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]}]"#;
    [
        r#""camera_angle_x": 0.6"#,
        r#""fl_x": 20, "fl_y": 21.0, "cx": 6, "cy": 4, "w": 12, "h": 8, "k1": 0.05, "k2": -0.01, "p1": 0.001, "camera_model": "OPENCV", "ply_file_path": "sparse_pc.ply""#,
        r#""fl_x": 20, "is_fisheye": true, "distortion_params": [0.01, 0.001, 0, 0, 0, 0]"#,
    ]
    .map(|lens| format!("{{{lens}, {frames}}}").into_bytes())
    .to_vec()
}

pub fn colmap_binary() -> Vec<Vec<u8>> {
    let mut cameras = u64s(&[2]);
    // PINHOLE and OPENCV.
    for (id, model, parameters) in [
        (7, 1, vec![20.0, 21.0, 6.0, 4.0]),
        (2, 4, vec![20.0, 21.0, 6.0, 4.0, 0.05, 0.0, 0.001, 0.0]),
    ] {
        cameras.extend(u32s(&[id, model]));
        cameras.extend(u64s(&[12, 8]));
        cameras.extend(f64s(&parameters));
    }
    let mut images = u64s(&[2]);
    for (id, camera, name) in [(1, 7, "a.png"), (3, 2, "b.png")] {
        images.extend(u32s(&[id]));
        images.extend(f64s(&[1.0, 0.0, 0.0, 0.0, f64::from(id) - 1.0, 0.0, 4.0]));
        images.extend(u32s(&[camera]));
        images.extend(name.as_bytes());
        images.push(0);
        images.extend(u64s(&[1]));
        images.extend(f64s(&[6.0, 4.0]));
        images.extend(u64s(&[1]));
    }
    let mut points = u64s(&[1, 1]);
    points.extend(f64s(&[0.0, 0.1, 0.2]));
    points.extend([255; 3]);
    points.extend(f64s(&[0.5]));
    points.extend(u64s(&[2]));
    points.extend(u32s(&[1, 0, 3, 0]));
    vec![joined(&[cameras, images, points])]
}

pub fn colmap_text() -> Vec<Vec<u8>> {
    let cameras = [
        "7 PINHOLE 12 8 20 21 6 4\n2 OPENCV 12 8 20 21 6 4 0.05 0 0.001 0\n",
        "7 SIMPLE_RADIAL 12 8 20 6 4 0.05\n2 OPENCV_FISHEYE 12 8 20 21 6 4 0.05 0 0 0\n",
        "7 FOV 12 8 20 21 6 4 0.2\n2 THIN_PRISM_FISHEYE 12 8 20 21 6 4 0.05 0 0 0 0 0 0 0\n",
        "7 FULL_OPENCV 12 8 20 21 6 4 0.05 0 0 0 0 0.01 0 0\n2 RADIAL_FISHEYE 12 8 20 6 4 0.01 0\n",
    ];
    let images =
        "# a comment\n1 1 0 0 0 0 0 4 7 a.png\n6 4 1\n3 1 0 0 0 1 0 4 2 b.png\n6 4 1 1.5 2.5 -1\n";
    let points = "1 0 0.1 0.2 255 0 0 0.5 1 0 3 0\n2 0.3 0 0 1 2 3 0.5\n";
    cameras
        .map(|cameras| joined(&[cameras, images, points]))
        .to_vec()
}

pub fn meta_data_json() -> Vec<Vec<u8>> {
    let text = r#"{"camera_model": "OPENCV", "height": 8, "width": 12,
        "worldtogt": [[2, 0, 0, 10], [0, 2, 0, 20], [0, 0, 2, 30], [0, 0, 0, 1]],
        "frames": [{"rgb_path": "b.png", "intrinsics": [[20, 0.5, 6], [0, 21, 4], [0, 0, 1]],
            "camtoworld": [[1, 0, 0, 1], [0, 1, 0, 0], [0, 0, 1, -4], [0, 0, 0, 1]]},
        {"rgb_path": "images/a.png",
            "intrinsics": [[10, 0, 5.5, 0], [0, 10, 3.5, 0], [0, 0, 1, 0], [0, 0, 0, 1]],
            "camtoworld": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -4], [0, 0, 0, 1]]}]}"#;
    vec![text.into()]
}

pub fn openmvg() -> Vec<Vec<u8>> {
    let text = r#"{"root_path": "/home/someone/images", "views": [
        {"key": 0, "value": {"polymorphic_id": 1073741824, "ptr_wrapper": {"id": 2147483649, "data":
            {"local_path": "", "filename": "a.png", "width": 12, "height": 8, "id_intrinsic": 0, "id_pose": 0}}}},
        {"key": 2, "value": {"polymorphic_id": 1073741824, "ptr_wrapper": {"id": 2147483650, "data":
            {"filename": "b.png", "width": 12, "height": 8, "id_intrinsic": 5, "id_pose": 2}}}}],
        "intrinsics": [{"key": 0, "value": {"polymorphic_id": 2147483649,
            "polymorphic_name": "pinhole_radial_k3", "ptr_wrapper": {"id": 2147483652, "data":
            {"focal_length": 20.0, "principal_point": [6, 4], "disto_k3": [0.05, 0, 0]}}}},
        {"key": 5, "value": {"polymorphic_id": 1, "ptr_wrapper": {"id": 4, "data":
            {"value0": {"focal_length": 10.0, "principal_point": [6.0, 4.5]}, "disto_k3": [0, 0, 0]}}}}],
        "extrinsics": [{"key": 0, "value": {"rotation": [[1,0,0],[0,1,0],[0,0,1]], "center": [0, 0, -4]}},
            {"key": 2, "value": {"rotation": [[1,0,0],[0,1,0],[0,0,1]], "center": [1, 0, -4]}}],
        "structure": [{"key": 7, "value": {"X": [0, 0.1, 0.2], "observations": [
            {"key": 0, "value": {"id_feat": 3, "x": [6.5, 4.0]}}, {"key": 2, "value": {"x": [2.25, 3.5]}}]}}]}"#;
    vec![text.into()]
}

pub fn openmvs() -> Vec<Vec<u8>> {
    let counted = |text: &str| [u64s(&[text.len() as u64]).as_slice(), text.as_bytes()].concat();
    let version = |version: u32| {
        let mut bytes = b"MVSI".to_vec();
        bytes.extend(u32s(&[version, 0]));
        bytes.extend(u64s(&[1]));
        bytes.extend(counted("rig"));
        bytes.extend(u64s(&[1]));
        bytes.extend(counted("camera"));
        if version > 3 {
            bytes.extend(counted("RGB"));
        }
        bytes.extend(u32s(&[12, 8]));
        let pose = |z: f64| [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, z];
        bytes.extend(f64s(&K));
        bytes.extend(f64s(&pose(0.0)));
        bytes.extend(u64s(&[2]));
        bytes.extend(f64s(&pose(-4.0)));
        bytes.extend(f64s(&pose(-5.0)));
        bytes.extend(u64s(&[2]));
        for (index, name) in ["images/a.png", "b.png"].into_iter().enumerate() {
            bytes.extend(counted(name));
            if version > 4 {
                bytes.extend(counted(""));
            }
            bytes.extend(u32s(&[0, 0, index as u32]));
            if version > 2 {
                bytes.extend(u32s(&[index as u32]));
            }
            if version > 6 {
                bytes.extend([0; 12]);
                bytes.extend(u64s(&[0]));
            }
        }
        bytes.extend(u64s(&[1]));
        bytes.extend(little(&[0.0_f32, 0.1, 0.2], |x| x.to_le_bytes()));
        bytes.extend(u64s(&[2]));
        bytes.extend(u32s(&[0, 0, 1, 0]));
        bytes
    };
    vec![version(2), version(7)]
}

pub fn nvm() -> Vec<Vec<u8>> {
    [
        "NVM_V3\n\n2\nimages/a.png 20 1 0 0 0 0 0 -4 0.01 0\nb.png\t20 1 0 0 0 1 0 -4 0 0\n\n\
         1\n0 0.1 0.2 255 0 0 2 0 5 -1.5 0.5 1 7 2 1\n\n0\n",
        "NVM_V3_R9T FixedK 20 6 21 4 0\n2\na.png 20 1 0 0 0 1 0 0 0 1 0 0 4 0 0\n\
         b.png 20 1 0 0 0 1 0 0 0 1 1 0 4 0 0\n0\n0\n",
    ]
    .map(|text| text.into())
    .to_vec()
}

pub fn bundler() -> Vec<Vec<u8>> {
    let list = "images/a.png 0 20\nb.png\n";
    let bundle = "# Bundle file v0.3\n2 1\n20 0.01 0\n1 0 0\n0 1 0\n0 0 1\n0 0 -4\n\
        20 0 0\n1 0 0\n0 1 0\n0 0 1\n-1 0 -4\n0 0.1 0.2\n255 0 0\n2 0 7 -2.5 1.25 1 8 0 0\n";
    vec![joined(&[list, bundle])]
}

pub fn strecha() -> Vec<Vec<u8>> {
    let camera =
        |x: f64| format!("20 0 6\n0 21 4\n0 0 1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n{x} 0 -4\n12 8\n");
    vec![joined(&[camera(0.0), camera(1.0)])]
}

pub fn points_of_scene() -> Vec<Vec<u8>> {
    ply()
}

pub fn hawp() -> Vec<Vec<u8>> {
    [
        r#"{"vertices": [[1.5, 2.25], [3.0, 4.0]], "vertices-score": [0.9, 0.8],
            "edges": [[0, 1]], "edges-weights": [0.7], "height": 8, "width": 9}"#,
        r#"{"vertices": [1.5, 2.25, 3, 4], "vertices-score": [0.9, 0.8],
            "edges": [0, 1], "edges-weights": [0.7], "height": 8, "width": 9}"#,
    ]
    .map(|text| text.into())
    .to_vec()
}

pub fn wireframe_of_truth() -> Vec<Vec<u8>> {
    let text = r#"{"junctions": [[0, 0, 0], [1.5, 0, -2]], "lines": [[0, 1]],
        "curves": [{"type": "Circle", "points": [[0, 0, 0], [0, 1, 0], [0, 1, 1]]}]}"#;
    vec![text.into()]
}

pub fn ply() -> Vec<Vec<u8>> {
    let ascii = "ply\nformat ascii 1.0\ncomment any\nelement vertex 2\nproperty uchar red\n\
        property float x\nproperty float y\nproperty float z\nelement face 1\n\
        property list uchar int vertex_indices\nend_header\n9 1 2 3\n8 -4 5e-1 6\n3 0 1 0\n";
    let mut binary = b"ply\nformat binary_little_endian 1.0\nelement vertex 2\n\
        property double x\nproperty float y\nproperty short flag\nproperty float z\nend_header\n"
        .to_vec();
    for x in [1.0, -4.0] {
        binary.extend(f64s(&[x]));
        binary.extend([0; 10]);
    }
    vec![ascii.into(), binary]
}

pub fn npy() -> Vec<Vec<u8>> {
    vec![
        npy_of("(2, 4)", &[1.0, 2.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.25]),
        npy_of("()", &[1.0]),
        npy_of("(3,)", &[1.0, 2.0, 3.0]),
    ]
}

pub fn npz() -> Vec<Vec<u8>> {
    segments_npz()
}

pub fn picture() -> Vec<Vec<u8>> {
    let image = RgbImage::from_fn(9, 7, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 7]));
    let transparent = RgbaImage::from_pixel(5, 4, image::Rgba([9, 200, 30, 99]));
    vec![
        encoded(image.clone(), ImageFormat::Png),
        encoded(image, ImageFormat::Jpeg),
        encoded(transparent, ImageFormat::Png),
    ]
}

pub fn segments_npz() -> Vec<Vec<u8>> {
    let rows = vec![1.0, 2.0, 3.5, 4.0, 5.0, 6.0, 7.0, 8.25];
    vec![archive(&[("lines", &[2, 4], rows)])]
}

pub fn segments_text() -> Vec<Vec<u8>> {
    vec![b"2\n1 2 3.5 4 0.9\n5e0,-6,7,8.25\n# end\n".into()]
}

pub fn edge_picture() -> Vec<Vec<u8>> {
    let is_edge = |x: u32, y: u32| x == 10 || y == 15 || x == y;
    let map = GrayImage::from_fn(40, 30, |x, y| Luma([if is_edge(x, y) { 255 } else { 0 }]));
    vec![encoded(map, ImageFormat::Png)]
}

pub fn mat() -> Vec<Vec<u8>> {
    let element = |code: u32, data: &[u8]| {
        let mut bytes = u32s(&[code, data.len() as u32]);
        bytes.extend(data);
        bytes.resize(bytes.len().next_multiple_of(8), 0);
        bytes
    };
    let matrix = |name: &str, class: u8, shape: &[u32], code: u32, data: &[u8]| {
        let flags = element(6, &[class, 0, 0, 0, 0, 0, 0, 0]);
        let parts = [
            flags,
            element(5, &u32s(shape)),
            element(1, name.as_bytes()),
            element(code, data),
        ];
        element(14, &parts.concat())
    };
    let mut file = vec![b' '; 124];
    file.extend([0, 1, b'I', b'M']);
    file.extend(matrix("ObsMask", 9, &[2, 1, 2], 2, &[1, 0, 0, 1]));
    file.extend(matrix("P", 6, &[4, 1], 9, &f64s(&[1.5, -2.0, 3.0, 4.0])));
    // Packed by zlib without compression: one stored block.
    let inner = matrix("Res", 6, &[1, 1], 2, &[1]);
    let length = inner.len() as u16;
    let mut packed = vec![0x78, 0x01, 0x01];
    packed.extend(length.to_le_bytes());
    packed.extend((!length).to_le_bytes());
    packed.extend(&inner);
    let sums = inner.iter().fold((1_u32, 0_u32), |(a, b), &byte| {
        let a = (a + u32::from(byte)) % 65_521;
        (a, (a + b) % 65_521)
    });
    packed.extend(((sums.1 << 16) | sums.0).to_be_bytes());
    file.extend(u32s(&[15, packed.len() as u32]));
    file.extend(packed);
    vec![file]
}

pub fn obj() -> Vec<Vec<u8>> {
    vec![
        b"# a comment\nv 0 0 0\nv 1 0 0 1.0\nvn 0 0 1\nv 1 1 0\nl 1 2 3\nl -1/4 -3\nf 1 2 3\n"
            .into(),
    ]
}

pub fn true_edges() -> Vec<Vec<u8>> {
    let text = r#"{"junctions": [[0, 0, 0], [1.5, 0, -2]], "edges": [[0, 1]],
        "cut_end": [false, true], "edge_views": [[0, 3, 12]]}"#;
    vec![text.into(), text.replace("edge_views", "other").into()]
}

pub fn triangle_mesh() -> Vec<Vec<u8>> {
    let header = "ply\nformat FORMAT 1.0\nelement vertex 4\nproperty float x\n\
        property float y\nproperty float z\nelement face 2\n\
        property list uchar int vertex_indices\nend_header\n";
    let text =
        header.replace("FORMAT", "ascii") + "0 0 0\n1 0 0\n1 1 0\n0 1 2\n4 0 1 2 3\n3 0 1 3\n";
    let mut binary = header
        .replace("FORMAT", "binary_little_endian")
        .into_bytes();
    for x in [0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 2.0] {
        binary.extend(x.to_le_bytes());
    }
    for face in [&[0, 1, 2, 3][..], &[0, 1, 3]] {
        binary.push(face.len() as u8);
        binary.extend(u32s(face));
    }
    vec![text.into(), binary]
}

pub fn ply_edges() -> Vec<Vec<u8>> {
    let header = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 2\nproperty uchar red\nproperty float x\n\
             property double y\nproperty float z\nelement face 1\n\
             property list uchar int vertex_indices\nelement edge 1\n\
             property short vertex1\nproperty int vertex2\nend_header\n"
        )
    };
    let ascii = header("ascii") + "9 1 2 3\n8 -4 5e-1 6\n2 0 -1\n1 0\n";
    let binary = |format: &str| {
        let mut bytes = header(format).into_bytes();
        // Zeros but for the lengths of the list and the last index.
        bytes.extend([0; 34]);
        bytes.push(0);
        bytes.extend([0; 6]);
        bytes
    };
    vec![
        ascii.into(),
        binary("binary_little_endian"),
        binary("binary_big_endian"),
    ]
}

pub fn numpy_lines() -> Vec<Vec<u8>> {
    let values: Vec<f32> = (0..12_u8).map(f32::from).collect();
    vec![npy_of("(2, 2, 3)", &values), npy_of("(2, 6)", &values)]
}

pub fn neat_npz() -> Vec<Vec<u8>> {
    let values = (0..12_u8).map(f64::from).collect();
    vec![archive(&[("lines3d", &[2, 2, 3], values)])]
}

pub fn line3dpp() -> Vec<Vec<u8>> {
    vec![b"1 0 0.5 0 1.25 0.5 0 2 0 7 1 2 3 4 5 9 10 20 30 40\n1 1.25 0.5 0 1.25 2 -3 0\n".into()]
}

pub fn parametric_edges() -> Vec<Vec<u8>> {
    let text = r#"{"curves_ctl_pts": [[[0,0,0],[1,0,0],[2,0,0],[3,0,0]]],
        "lines_end_pts": [[[0, 0.5, 0], [1.25, 0.5, 0]], [1.25, 0.5, 0, 1.25, 2, -3]]}"#;
    vec![text.into()]
}

pub fn wireframe_json() -> Vec<Vec<u8>> {
    let text = r#"{"metadata": {"scene": "x", "n": [1, {"a": null}]},
        "junctions": [[0, 0, 0], [1, 0, 0]], "edges": [[0, 1]],
        "junction_fields": {"votes": [7, 5]}, "edge_fields": {"visible_views": [12]},
        "junction_covariances": [[1e-6, 0, 0, 1e-6, 0, 4e-6], null], "views": ["a", "b"],
        "edge_support": [[{"view": 1, "segment": [10, 20.5, 80.25, 21], "residual": 0.3}]]}"#;
    vec![text.into()]
}

pub fn limap_tracks() -> Vec<Vec<u8>> {
    vec![b"2\n0 2 2\n0 0 0\n1 0 0.5\n0 1\n3 4\n1 1 1\n0 0 0\n1 1 1\n0\n7\n".into()]
}

pub fn limap_track() -> Vec<Vec<u8>> {
    vec![
        b"0 0 0 1 0 0.5\n2 2\nimage_id_list 0 1\nline_id_list 3 4\nline2d_list\n1 2 3 4\n5 6 7 8\nEND\n"
            .into(),
    ]
}

pub fn limap_images() -> Vec<Vec<u8>> {
    vec![b"number of images, 2\n0, a.png\n1, left/b.png\n".into()]
}
