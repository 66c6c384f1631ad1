//! Small parsers of what the tests write; they panic on anything else.

use nalgebra::Vector3;
use neat_export::Format;
use neat_wireframe::Wireframe3d;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::str::FromStr;

/// The graph in a file of any format but pictures.
pub fn parse(path: &Path, format: Format) -> Wireframe3d {
    if format == Format::Colmap {
        return colmap(path);
    }
    let bytes = fs::read(path).unwrap();
    if format == Format::Glb {
        return glb(&bytes);
    }
    if format == Format::Npz {
        return npz(&bytes);
    }
    let text = String::from_utf8(bytes).unwrap();
    match format {
        Format::Json => json(&text),
        Format::Obj => obj(&text),
        Format::Ply => ply(&text),
        Format::Gltf => gltf(&text),
        Format::Dxf => dxf(&text),
        Format::Step => step(&text),
        Format::GeoJson => geojson(&text),
        other => panic!("{other:?} is no graph"),
    }
}

fn numbers<T: FromStr>(text: &str) -> Vec<T> {
    let number = |x: &str| x.parse().unwrap_or_else(|_| panic!("{x} is no number"));
    text.split_whitespace().map(number).collect()
}

fn pair(text: &str) -> [usize; 2] {
    numbers(text).try_into().unwrap()
}

fn point(value: &Value) -> Vector3<f64> {
    let coordinates: Vec<f64> = value.as_array().unwrap().iter().map(float).collect();
    Vector3::from_row_slice(&coordinates)
}

fn float(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn index(value: &Value) -> usize {
    value.as_u64().unwrap() as usize
}

fn items(value: &Value) -> Vec<Value> {
    value.as_array().cloned().unwrap_or_default()
}

fn json(text: &str) -> Wireframe3d {
    let value: Value = serde_json::from_str(text).unwrap();
    Wireframe3d {
        junctions: items(&value["junctions"]).iter().map(point).collect(),
        edges: items(&value["edges"])
            .iter()
            .map(|edge| [index(&edge[0]), index(&edge[1])])
            .collect(),
    }
}

fn obj(text: &str) -> Wireframe3d {
    let mut wireframe = Wireframe3d::default();
    for line in text.lines() {
        match line.split_once(' ').unwrap() {
            ("v", rest) => wireframe.junctions.push(Vector3::from_vec(numbers(rest))),
            ("l", rest) => wireframe.edges.push(pair(rest).map(|end| end - 1)),
            _ => panic!("{line}"),
        }
    }
    wireframe
}

fn ply(text: &str) -> Wireframe3d {
    let (header, body) = text.split_once("end_header\n").unwrap();
    let mut counts = header
        .lines()
        .filter_map(|line| line.strip_prefix("element "));
    let vertices: usize = counts
        .next()
        .unwrap()
        .strip_prefix("vertex ")
        .unwrap()
        .parse()
        .unwrap();
    let lines: Vec<&str> = body.lines().collect();
    let (junctions, edges) = lines.split_at(vertices);
    Wireframe3d {
        junctions: junctions
            .iter()
            .map(|l| Vector3::from_vec(numbers(l)))
            .collect(),
        edges: edges.iter().map(|line| pair(line)).collect(),
    }
}

fn gltf(text: &str) -> Wireframe3d {
    let json: Value = serde_json::from_str(text).unwrap();
    let data = match json["buffers"][0]["uri"].as_str() {
        Some(uri) => base64(uri.split_once(";base64,").unwrap().1),
        None => Vec::new(),
    };
    from_gltf(&json, &data)
}

fn glb(bytes: &[u8]) -> Wireframe3d {
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(
        (&bytes[..4], word(4), word(8)),
        (&b"glTF"[..], 2, bytes.len())
    );
    let length = word(12);
    assert_eq!((&bytes[16..20], length % 4), (&b"JSON"[..], 0));
    let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
    let rest = 20 + length;
    if rest == bytes.len() {
        return from_gltf(&json, &[]);
    }
    assert_eq!(
        (&bytes[rest + 4..rest + 8], word(rest) % 4),
        (&b"BIN\0"[..], 0)
    );
    assert_eq!(rest + 8 + word(rest), bytes.len());
    from_gltf(&json, &bytes[rest + 8..])
}

fn from_gltf(json: &Value, data: &[u8]) -> Wireframe3d {
    assert_eq!(json["asset"]["version"], "2.0");
    if data.is_empty() {
        assert!(json.get("nodes").is_none() && json.get("buffers").is_none());
        return Wireframe3d::default();
    }
    assert_eq!(json["buffers"][0]["byteLength"], data.len());
    let accessor = |accessor: &Value| -> Vec<[u8; 4]> {
        let accessor = &json["accessors"][index(accessor)];
        let view = &json["bufferViews"][index(&accessor["bufferView"])];
        let width = if accessor["type"] == "VEC3" { 3 } else { 1 };
        let (start, length) = (index(&view["byteOffset"]), index(&view["byteLength"]));
        assert_eq!(length, 4 * width * index(&accessor["count"]));
        let bytes = data[start..start + length].chunks_exact(4);
        bytes.map(|b| b.try_into().unwrap()).collect()
    };
    let node = &json["nodes"][0];
    let translation = point(&node["translation"]);
    let primitives = items(&json["meshes"][index(&node["mesh"])]["primitives"]);
    let positions: Vec<f64> = accessor(&primitives[0]["attributes"]["POSITION"])
        .into_iter()
        .map(|bytes| f64::from(f32::from_le_bytes(bytes)))
        .collect();
    let mut edges = Vec::new();
    for primitive in primitives.iter().filter(|primitive| primitive["mode"] == 1) {
        let ends = accessor(&primitive["indices"]);
        let ends: Vec<_> = ends
            .into_iter()
            .map(|b| u32::from_le_bytes(b) as usize)
            .collect();
        edges.extend(ends.chunks_exact(2).map(|ends| [ends[0], ends[1]]));
    }
    Wireframe3d {
        junctions: positions
            .chunks_exact(3)
            .map(|p| Vector3::from_row_slice(p) + translation)
            .collect(),
        edges,
    }
}

fn base64(text: &str) -> Vec<u8> {
    const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut bytes = Vec::new();
    let (mut bits, mut count) = (0u32, 0);
    for digit in text.bytes().filter(|digit| *digit != b'=') {
        let value = DIGITS.iter().position(|d| *d == digit).unwrap() as u32;
        bits = (bits << 6 | value) & 0xffff;
        count += 6;
        if count >= 8 {
            count -= 8;
            bytes.push((bits >> count) as u8);
        }
    }
    bytes
}

/// Code and value of every group.
fn dxf_groups(text: &str) -> Vec<(u32, &str)> {
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len() % 2, 0);
    lines
        .chunks_exact(2)
        .map(|pair| (pair[0].parse().unwrap(), pair[1]))
        .collect()
}

/// The entities, with their groups.
fn dxf_entities(text: &str) -> Vec<BTreeMap<u32, &str>> {
    let groups = dxf_groups(text);
    assert_eq!(groups.last(), Some(&(0, "EOF")));
    let start = groups
        .iter()
        .position(|group| *group == (2, "ENTITIES"))
        .unwrap();
    let mut entities = Vec::<BTreeMap<_, _>>::new();
    for (code, value) in &groups[start + 1..groups.len() - 2] {
        if *code == 0 {
            entities.push(BTreeMap::new());
        }
        let previous = entities.last_mut().unwrap().insert(*code, *value);
        assert_eq!(previous, None);
    }
    entities
}

/// The layer of every line.
pub fn dxf_layers(path: &Path) -> Vec<String> {
    let text = fs::read_to_string(path).unwrap();
    let lines = dxf_entities(&text)
        .into_iter()
        .filter(|entity| entity[&0] == "LINE");
    lines.map(|line| line[&8].to_owned()).collect()
}

fn dxf(text: &str) -> Wireframe3d {
    let mut wireframe = Wireframe3d::default();
    let mut lines = Vec::new();
    for entity in dxf_entities(text) {
        let point =
            |code: u32| Vector3::from([0, 10, 20].map(|i| entity[&(code + i)].parse().unwrap()));
        match entity[&0] {
            "POINT" => wireframe.junctions.push(point(10)),
            "LINE" => lines.push([point(10), point(11)]),
            other => panic!("{other}"),
        }
    }
    wireframe.edges = ends_as_indices(&lines, &wireframe.junctions);
    wireframe
}

/// The junctions at the ends of lines: the first with the same coordinates.
fn ends_as_indices(lines: &[[Vector3<f64>; 2]], junctions: &[Vector3<f64>]) -> Vec<[usize; 2]> {
    let index = |end: Vector3<f64>| junctions.iter().position(|j| *j == end).unwrap();
    lines.iter().map(|ends| ends.map(index)).collect()
}

fn step(text: &str) -> Wireframe3d {
    let entities: BTreeMap<usize, (&str, &str)> = text
        .lines()
        .filter_map(|line| line.strip_prefix('#')?.strip_suffix(';'))
        .map(|line| {
            let (id, entity) = line.split_once('=').unwrap();
            let (name, arguments) = entity.split_once('(').unwrap();
            (
                id.parse().unwrap(),
                (name, arguments.strip_suffix(')').unwrap()),
            )
        })
        .collect();
    let references = |arguments: &str| -> Vec<usize> {
        let names = arguments
            .split(['(', ')', ','])
            .filter_map(|name| name.strip_prefix('#'));
        names.map(|name| name.parse().unwrap()).collect()
    };
    let mut wireframe = Wireframe3d::default();
    let mut vertices = BTreeMap::new();
    let mut of_model = 0;
    for (id, (name, arguments)) in &entities {
        match *name {
            "VERTEX_POINT" => {
                let (kind, point) = entities[&references(arguments)[0]];
                assert_eq!(kind, "CARTESIAN_POINT");
                vertices.insert(*id, wireframe.junctions.len());
                wireframe.junctions.push(triple(point));
            }
            "EDGE_CURVE" => {
                let ids = references(arguments);
                wireframe.edges.push([vertices[&ids[0]], vertices[&ids[1]]]);
                // The line leads from the first vertex towards the second.
                let (kind, line) = entities[&ids[2]];
                assert_eq!(kind, "LINE");
                let [origin, vector] = references(line).try_into().unwrap();
                let direction = entities[&references(entities[&vector].1)[0]].1;
                let [a, b] = wireframe
                    .edges
                    .last()
                    .unwrap()
                    .map(|v| wireframe.junctions[v]);
                assert_eq!(triple(entities[&origin].1), a);
                assert!((triple(direction).norm() - 1.0).abs() < 1e-12);
                assert!((b / 2.0 - a / 2.0).dot(&triple(direction)) >= 0.0);
            }
            "EDGE_BASED_WIREFRAME_MODEL" => of_model = references(arguments).len(),
            _ => {}
        }
    }
    assert_eq!(of_model, wireframe.edges.len());
    wireframe
}

/// The three numbers of `'',(x,y,z)`, which must have a decimal point.
fn triple(arguments: &str) -> Vector3<f64> {
    let inner = arguments
        .strip_prefix("'',(")
        .unwrap()
        .strip_suffix(')')
        .unwrap();
    let coordinates: Vec<f64> = inner
        .split(',')
        .map(|x| {
            assert!(x.contains('.') && !x.contains('e'), "{x}");
            x.parse().unwrap()
        })
        .collect();
    Vector3::from_row_slice(&coordinates)
}

fn geojson(text: &str) -> Wireframe3d {
    let value: Value = serde_json::from_str(text).unwrap();
    assert_eq!(value["type"], "FeatureCollection");
    let mut junctions = BTreeMap::new();
    let mut edges = Vec::new();
    for feature in items(&value["features"]) {
        let coordinates = &feature["geometry"]["coordinates"];
        let properties = &feature["properties"];
        if feature["geometry"]["type"] == "Point" {
            junctions.insert(index(&properties["junction"]), point(coordinates));
            continue;
        }
        assert_eq!(feature["geometry"]["type"], "LineString");
        let ends = [0, 1].map(|i| index(&properties["junctions"][i]));
        for (end, coordinates) in ends.iter().zip(items(coordinates)) {
            let known = junctions.insert(*end, point(&coordinates));
            assert!(known.is_none_or(|known| known == point(&coordinates)));
        }
        edges.push(ends);
    }
    Wireframe3d {
        junctions: junctions.into_values().collect(),
        edges,
    }
}

/// The shape and the data of an array in an archive that is not compressed.
fn npy<'a>(archive: &'a [u8], name: &str, kind: &str) -> (String, &'a [u8]) {
    let find = |from: usize, text: &[u8]| {
        let found = archive[from..].windows(text.len()).position(|w| w == text);
        from + found.unwrap_or_else(|| panic!("no {name}"))
    };
    let start = find(find(0, name.as_bytes()), b"\x93NUMPY");
    let length = usize::from(u16::from_le_bytes([archive[start + 8], archive[start + 9]]));
    let header = std::str::from_utf8(&archive[start + 10..start + 10 + length]).unwrap();
    assert!(
        header.contains(kind) && header.contains("'fortran_order': False"),
        "{header}"
    );
    let shape = header
        .split_once("'shape': (")
        .unwrap()
        .1
        .split_once(')')
        .unwrap()
        .0;
    let count: usize = shape
        .split(',')
        .filter_map(|n| n.trim().parse::<usize>().ok())
        .product();
    let data = start + 10 + length;
    (shape.replace(' ', ""), &archive[data..data + 8 * count])
}

fn npz(archive: &[u8]) -> Wireframe3d {
    let (shape, junctions) = npy(archive, "junctions.npy", "<f8");
    assert!(shape.contains(",3"), "{shape}");
    let (shape, edges) = npy(archive, "edges.npy", "<i8");
    assert!(shape.contains(",2"), "{shape}");
    let (shape, lines) = npy(archive, "lines3d.npy", "<f8");
    assert!(shape.contains(",2,3"), "{shape}");
    let points = |bytes: &[u8]| -> Vec<Vector3<f64>> {
        let number = |b: &[u8]| f64::from_le_bytes(b.try_into().unwrap());
        bytes
            .chunks_exact(24)
            .map(|b| Vector3::new(number(&b[..8]), number(&b[8..16]), number(&b[16..])))
            .collect()
    };
    let index = |b: &[u8]| i64::from_le_bytes(b.try_into().unwrap()) as usize;
    let wireframe = Wireframe3d {
        junctions: points(junctions),
        edges: edges
            .chunks_exact(16)
            .map(|b| [index(&b[..8]), index(&b[8..])])
            .collect(),
    };
    let ends = wireframe.edges.iter().flatten();
    let expected: Vec<_> = ends.map(|end| wireframe.junctions[*end]).collect();
    assert_eq!(points(lines), expected);
    wireframe
}

fn colmap(dir: &Path) -> Wireframe3d {
    let rows = |name: &str| -> Vec<Vec<String>> {
        let text = fs::read_to_string(dir.join(name)).unwrap();
        let rows = text.lines().filter(|line| !line.starts_with('#'));
        rows.map(|row| row.split(' ').map(str::to_owned).collect())
            .collect()
    };
    assert!(rows("cameras.txt").is_empty() && rows("images.txt").is_empty());
    let mut wireframe = Wireframe3d::default();
    for (at, row) in rows("points3D.txt").iter().enumerate() {
        assert_eq!((row.len(), &row[0]), (8, &(at + 1).to_string()));
        let coordinates: Vec<f64> = row[1..4].iter().map(|x| x.parse().unwrap()).collect();
        wireframe
            .junctions
            .push(Vector3::from_row_slice(&coordinates));
    }
    for (at, row) in rows("lines3D.txt").iter().enumerate() {
        assert_eq!((row.len(), &row[0]), (3, &(at + 1).to_string()));
        wireframe
            .edges
            .push([1, 2].map(|i: usize| row[i].parse::<usize>().unwrap() - 1));
    }
    wireframe
}

/// What an SVG shows.
pub struct View {
    pub width: u32,
    pub height: u32,
    /// Ends of lines in the order of the edges, right and up in units of the document.
    pub lines: Vec<[[f64; 2]; 2]>,
    /// Centres of circles in pixels.
    pub circles: Vec<[f64; 2]>,
}

/// Reads a picture back.
pub fn svg(path: &Path) -> View {
    let text = fs::read_to_string(path).unwrap();
    let attribute = |element: &str, name: &str| -> Vec<f64> {
        let quoted = element.split_once(&format!(" {name}=\"")).unwrap().1;
        numbers(quoted.split_once('"').unwrap().0)
    };
    let elements = |name: &str| -> Vec<String> {
        let start = format!("<{name} ");
        text.split(start.as_str())
            .skip(1)
            .map(|e| format!(" {}", e.split_once('>').unwrap().0))
            .collect()
    };
    let root = &elements("svg")[0];
    let [width, height] = ["width", "height"].map(|name| attribute(root, name)[0]);
    let scale = attribute(root, "data-scale")[0];
    let center = attribute(root, "data-center");
    let in_units = |x: f64, y: f64| {
        [
            center[0] + (x - width / 2.0) / scale,
            center[1] - (y - height / 2.0) / scale,
        ]
    };
    let mut lines: Vec<_> = elements("line")
        .iter()
        .map(|line| {
            let at = |name| attribute(line, name)[0];
            let ends = [in_units(at("x1"), at("y1")), in_units(at("x2"), at("y2"))];
            (at("data-edge") as usize, ends)
        })
        .collect();
    lines.sort_by_key(|(edge, _)| *edge);
    View {
        width: width as u32,
        height: height as u32,
        lines: lines.into_iter().map(|(_, ends)| ends).collect(),
        circles: elements("circle")
            .iter()
            .map(|circle| ["cx", "cy"].map(|name| attribute(circle, name)[0]))
            .collect(),
    }
}
