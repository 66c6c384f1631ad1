//! glTF 2.0 (Khronos Group, ISO/IEC 12113): lines and triangles with shared vertices.
//!
//! Positions are 32-bit numbers from the centre of the wireframe, which is the
//! translation of the node: coordinates far from the origin keep their accuracy.
//! Every class of confidence, the arcs and the splines, as chains of straight pieces, are a
//! primitive each with a material of its own, and so are the faces; all use the same positions. Axes and unit are those of the document, although glTF means
//! metres with +Y up.

use crate::drawn::Drawn;
use crate::isolated::isolated_junctions;
use crate::target::Target;
use crate::{Confidence, ExportError};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use nalgebra::Vector3;
use neat_wireframe::export::WireframeDocument;
use serde_json::{Value, json};
use std::ops::Range;

const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const POINTS: u32 = 0;
const LINES: u32 = 1;
const TRIANGLES: u32 = 4;
/// Faces are grey, so that edges stand out.
const FACE_COLOR: [u8; 3] = [0xc8, 0xc8, 0xc8];
/// The extents that 32-bit numbers hold: smaller ones would lose digits.
const EXTENTS: Range<f64> = 1e-30..1e38;

/// A `.gltf` file with the data inside.
pub fn write_text(to: &mut Target) -> Result<(), ExportError> {
    to.write(text(to.document).ok_or_else(|| to.out_of_range())?)
}

/// A `.glb` file.
pub fn write_binary(to: &mut Target) -> Result<(), ExportError> {
    to.write(binary(to.document).ok_or_else(|| to.out_of_range())?)
}

/// `None` if 32-bit numbers cannot hold the extent
/// of the wireframe.
fn text(document: &WireframeDocument) -> Option<Vec<u8>> {
    let mut asset = Asset::new(document)?;
    if !asset.data.is_empty() {
        let data = BASE64_STANDARD.encode(&asset.data);
        asset.json["buffers"][0]["uri"] =
            format!("data:application/octet-stream;base64,{data}").into();
    }
    Some(format!("{}\n", asset.json).into_bytes())
}

/// `None` as for [`text`].
fn binary(document: &WireframeDocument) -> Option<Vec<u8>> {
    let asset = Asset::new(document)?;
    let mut json = asset.json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut chunks = chunk(b"JSON", &json)?;
    if !asset.data.is_empty() {
        chunks.extend(chunk(b"BIN\0", &asset.data)?);
    }
    let mut bytes = b"glTF".to_vec();
    bytes.extend(2u32.to_le_bytes());
    bytes.extend(u32::try_from(12 + chunks.len()).ok()?.to_le_bytes());
    bytes.extend(chunks);
    Some(bytes)
}

fn chunk(kind: &[u8; 4], data: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = u32::try_from(data.len()).ok()?.to_le_bytes().to_vec();
    bytes.extend(kind);
    bytes.extend(data);
    Some(bytes)
}

/// The JSON of an asset and its one buffer, whose length is a multiple of 4.
struct Asset {
    json: Value,
    data: Vec<u8>,
}

impl Asset {
    fn new(document: &WireframeDocument) -> Option<Self> {
        let mut asset = Self {
            json: json!({
                "asset": {"version": "2.0", "generator": "neat"},
                "scene": 0,
                "scenes": [{}],
            }),
            data: Vec::new(),
        };
        // Empty arrays are not allowed: a scene without nodes is.
        let drawn = Drawn::new(document);
        let junctions = &drawn.wireframe.junctions;
        if junctions.is_empty() {
            return Some(asset);
        }
        let (center, extent) = center_and_extent(junctions);
        if extent > 0.0 && !EXTENTS.contains(&extent) {
            return None;
        }
        let positions: Vec<Vector3<f32>> = junctions
            .iter()
            .map(|p| (p - center).map(|x| x as f32))
            .collect();
        asset.json["scenes"][0]["nodes"] = json!([0]);
        asset.json["nodes"] = json!([{
            "name": "wireframe",
            "mesh": 0,
            "translation": [center.x, center.y, center.z],
        }]);
        let position = asset.add_positions(&positions);
        let isolated = isolated_junctions(document);
        let triangles = document.drawn_triangles();
        let primitives = asset.add_primitives(&drawn, &isolated, &triangles, position)?;
        asset.json["meshes"] = json!([{"name": "wireframe", "primitives": primitives}]);
        asset.json["extensionsUsed"] = json!(["KHR_materials_unlit"]);
        asset.json["buffers"] = json!([{"byteLength": asset.data.len()}]);
        Some(asset)
    }

    /// One primitive per group, and one each for junctions without edges and for faces.
    fn add_primitives(
        &mut self,
        drawn: &Drawn,
        isolated: &[usize],
        triangles: &[[usize; 3]],
        position: usize,
    ) -> Option<Vec<Value>> {
        let mut primitives = Vec::new();
        let mut materials = Vec::new();
        let mut add = |name: &str, color: [u8; 3], mode: u32, indices: &[usize]| {
            if indices.is_empty() {
                return Some(());
            }
            let indices = self.add_indices(indices)?;
            primitives.push(json!({
                "attributes": {"POSITION": position},
                "indices": indices,
                "material": materials.len(),
                "mode": mode,
            }));
            let [red, green, blue] = color.map(linear_from_srgb);
            let mut material = json!({
                "name": name,
                "pbrMetallicRoughness": {"baseColorFactor": [red, green, blue, 1.0]},
            });
            // Lines have no side that light could fall on; of a sheet both are seen.
            match mode {
                TRIANGLES => material["doubleSided"] = true.into(),
                _ => material["extensions"] = json!({"KHR_materials_unlit": {}}),
            }
            materials.push(material);
            Some(())
        };
        for (name, color, edges) in &drawn.groups {
            let ends = edges.iter().flat_map(|e| drawn.wireframe.edges[*e]);
            add(name, *color, LINES, &ends.collect::<Vec<_>>())?;
        }
        add("isolated", Confidence::Unknown.color(), POINTS, isolated)?;
        add("faces", FACE_COLOR, TRIANGLES, triangles.as_flattened())?;
        self.json["materials"] = materials.into();
        Some(primitives)
    }

    fn add_positions(&mut self, positions: &[Vector3<f32>]) -> usize {
        let low = positions.iter().fold(positions[0], |low, p| low.inf(p));
        let high = positions.iter().fold(positions[0], |high, p| high.sup(p));
        let exact = |p: Vector3<f32>| p.map(f64::from);
        let bytes = positions.iter().flatten().flat_map(|x| x.to_le_bytes());
        self.add_accessor(
            bytes.collect(),
            ARRAY_BUFFER,
            json!({
                "componentType": FLOAT,
                "type": "VEC3",
                "count": positions.len(),
                "min": exact(low).as_slice(),
                "max": exact(high).as_slice(),
            }),
        )
    }

    fn add_indices(&mut self, indices: &[usize]) -> Option<usize> {
        let mut bytes = Vec::with_capacity(4 * indices.len());
        for index in indices {
            bytes.extend(u32::try_from(*index).ok()?.to_le_bytes());
        }
        let accessor = json!({
            "componentType": UNSIGNED_INT,
            "type": "SCALAR",
            "count": indices.len(),
        });
        Some(self.add_accessor(bytes, ELEMENT_ARRAY_BUFFER, accessor))
    }

    /// Appends data with a buffer view of its own; returns the accessor's index.
    fn add_accessor(&mut self, bytes: Vec<u8>, target: u32, mut accessor: Value) -> usize {
        let view = json!({
            "buffer": 0,
            "byteOffset": self.data.len(),
            "byteLength": bytes.len(),
            "target": target,
        });
        self.data.extend(bytes);
        accessor["bufferView"] = push(&mut self.json, "bufferViews", view).into();
        push(&mut self.json, "accessors", accessor)
    }
}

/// Appends to the array of this name, which is made if need be; returns the index.
fn push(json: &mut Value, array: &str, item: Value) -> usize {
    let array = &mut json[array];
    if array.is_null() {
        *array = json!([]);
    }
    match array {
        Value::Array(items) => {
            items.push(item);
            items.len() - 1
        }
        _ => unreachable!("glTF: {array} is an array"),
    }
}

/// The middle and the longest side of the bounding box of at least one point.
fn center_and_extent(points: &[Vector3<f64>]) -> (Vector3<f64>, f64) {
    let low = points.iter().fold(points[0], |low, p| low.inf(p));
    let high = points.iter().fold(points[0], |high, p| high.sup(p));
    (low / 2.0 + high / 2.0, (high - low).max())
}

/// IEC 61966-2-1: factors of materials are linear, colours of screens are not.
fn linear_from_srgb(value: u8) -> f64 {
    let value = f64::from(value) / 255.0;
    if value <= 0.04045 {
        value / 12.92
    } else {
        ((value + 0.055) / 1.055).powf(2.4)
    }
}
