//! The page is one file that fetches nothing, and texts stay texts.

use nalgebra::Vector3;
use neat_core::synthetic::{Solid, SyntheticScene, generate};
use neat_core::{CircularArc, Spline};
use neat_report::{Curve, FactGroup, JunctionSnapshot, PhotographConfig, Report};
use proptest::prelude::*;

fn small_report() -> Report {
    let config = SyntheticScene {
        solid: Solid::Box,
        views: 4,
        image_size: 64,
        min_visible_length: 2.0,
        ..SyntheticScene::default()
    };
    let data = generate(&config).unwrap();
    let photographs = PhotographConfig {
        max_photographs: 2,
        ..PhotographConfig::default()
    };
    Report::of_scene(&data.scene, (&data.truth).into(), 0.05, &photographs).unwrap()
}

/// The JSON in the page.
fn data_of(page: &str) -> serde_json::Value {
    let (_, rest) = page
        .split_once("<script type=\"application/json\" id=\"data\">")
        .unwrap();
    let (json, _) = rest.split_once("</script>").unwrap();
    serde_json::from_str(json).unwrap()
}

/// Everything but the data and the title.
fn frame_of(page: &str, title: &str) -> String {
    let (before, rest) = page.split_once("id=\"data\">").unwrap();
    let (_, after) = rest.split_once("</script>").unwrap();
    format!("{}{after}", before.replacen(title, "", 1))
}

#[test]
fn the_data_are_complete() {
    let mut report = small_report();
    report.curves = vec![Curve {
        name: "loss".into(),
        points: vec![(1, 0.5), (2, f64::NAN)],
    }];
    report.junction_evolution = vec![JunctionSnapshot {
        step: 7,
        junctions: vec![[1.0, 2.0, 3.0], [f32::NAN, 0.0, 0.0]],
    }];
    report.facts = vec![FactGroup {
        heading: "Run".into(),
        facts: vec![("seed".into(), "3".into())],
    }];
    let page = report.render().unwrap();
    let data = data_of(&page);
    assert_eq!(data["title"], "box");
    assert_eq!(data["junctions"].as_array().unwrap().len(), 8);
    assert_eq!(data["edges"].as_array().unwrap().len(), 12);
    assert_eq!(data["views"].as_array().unwrap().len(), 4);
    let photographs = data["views"].as_array().unwrap().iter();
    let with_image = photographs.filter(|view| view["photograph"].is_string());
    assert_eq!(with_image.count(), 2);
    assert_eq!(data["curves"][0]["points"][1][1], serde_json::Value::Null);
    assert_eq!(data["evolution"][0]["step"], 7);
    assert_eq!(data["facts"][0][1][0][1], "3");
}

#[test]
fn splines_are_drawn_behind_arcs() {
    let mut report = small_report();
    report.document.arcs = vec![CircularArc {
        center: Vector3::zeros(),
        axes: [Vector3::x(), Vector3::y()],
        radius: 1.0,
        angles: [0.0, 1.0],
    }];
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    report.document.splines = vec![Spline {
        controls: corners.map(|[x, y]| Vector3::new(x, y, 0.0)).to_vec(),
        closed: true,
    }];
    let data = data_of(&report.render().unwrap());
    let chains: Vec<_> = report.document.drawn_curves().collect();
    assert_eq!(data["arcs"], serde_json::json!(chains));
    let closed = data["arcs"][1].as_array().unwrap();
    assert_eq!(closed.first(), closed.last());
}

#[test]
fn triangles_of_faces_have_their_corners() {
    // A block whose top is drawn from one arc to another: the patch has points within.
    let loft = include_str!("../../neat-export/tests/data/lofted.json");
    let mut report = small_report();
    report.document = serde_json::from_str(loft).unwrap();
    report.document.edge_support = Vec::new();
    let data = data_of(&report.render().unwrap());
    let count = |key: &str| data[key].as_array().unwrap().len();
    let of_arcs = data["arcs"].as_array().unwrap().iter();
    let of_arcs: usize = of_arcs.map(|arc| arc.as_array().unwrap().len()).sum();
    let corners = count("junctions") + of_arcs + count("within");
    let faces = data["faces"].as_array().unwrap();
    let triangles = faces
        .iter()
        .flat_map(|face| face["triangles"].as_array().unwrap());
    let used = triangles.flat_map(|triangle| triangle.as_array().unwrap());
    let last = used.map(|corner| corner.as_u64().unwrap() as usize).max();
    assert!(count("within") > 100);
    assert_eq!(last, Some(corners - 1));
}

#[test]
fn nothing_is_fetched() {
    let page = small_report().render().unwrap();
    for forbidden in [
        "https:",
        "src=\"",
        "<link",
        "@import",
        "url(",
        "fetch(",
        "XMLHttpRequest",
    ] {
        assert!(!page.contains(forbidden), "{forbidden}");
    }
    // The name of a namespace is no address.
    let addresses: Vec<_> = page.match_indices("http:").collect();
    assert_eq!(
        addresses.len(),
        page.matches("http://www.w3.org/2000/svg").count()
    );
    let (_, policy) = page
        .split_once("Content-Security-Policy\" content=\"")
        .unwrap();
    let (policy, _) = policy.split_once('"').unwrap();
    assert!(policy.starts_with("default-src 'none'; script-src 'sha256-"));
    assert!(!policy.contains("unsafe"));
}

#[test]
fn the_same_report_is_the_same_page() {
    assert_eq!(
        small_report().render().unwrap(),
        small_report().render().unwrap()
    );
}

#[test]
fn pixels_count_from_the_corner() {
    let mut report = small_report();
    let at_corner = data_of(&report.render().unwrap());
    report.pixel_center = 0.0;
    let at_center = data_of(&report.render().unwrap());
    for path in ["/views/0/intrinsics/2", "/views/0/segments/0/0"] {
        let value = |data: &serde_json::Value| data.pointer(path).unwrap().as_f64().unwrap();
        assert!((value(&at_center) - value(&at_corner) - 0.5).abs() < 0.011);
    }
}

#[test]
fn a_page_is_written_whole() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("report.html");
    let report = small_report();
    report.write(&path).unwrap();
    assert_eq!(
        std::fs::read_to_string(&path).unwrap(),
        report.render().unwrap()
    );
    let missing = dir.path().join("missing/report.html");
    let message = report.write(&missing).unwrap_err().to_string();
    assert!(message.contains("missing"), "{message}");
}

#[test]
fn an_empty_report_is_a_page() {
    let page = Report::default().render().unwrap();
    assert_eq!(data_of(&page)["edges"], serde_json::json!([]));
}

#[test]
fn names_of_all_kinds_stay_texts() {
    const HOSTILE: &str = "</script></title><!--<img src=x onerror=alert(1)>-->{{data}}\
        \u{2028}\u{2029}\0\u{1b}[31m\u{202e}\"'`${1}&lt;\\u003c";
    let mut report = small_report();
    let title = format!("<title>{} – neat report</title>", report.title);
    let frame = frame_of(&report.render().unwrap(), &title);
    report.title = HOSTILE.into();
    report.curves = vec![Curve {
        name: HOSTILE.into(),
        points: vec![(1, 0.5)],
    }];
    report.views[0].name = HOSTILE.into();
    report.document.views = report.views.iter().map(|view| view.name.clone()).collect();
    let edges = vec![0.5; report.document.edges.len()];
    let junctions = vec![0.5; report.document.junctions.len()];
    for name in [HOSTILE, "__proto__", "constructor"] {
        (report.document.edge_fields.other).insert(name.into(), edges.clone());
        (report.document.junction_fields.other).insert(name.into(), junctions.clone());
    }
    report.document.metadata = [(HOSTILE.to_owned(), HOSTILE.into())].into();
    let page = report.render().unwrap();
    let data = data_of(&page);
    for path in ["/title", "/curves/0/name", "/views/0/name"] {
        assert_eq!(data.pointer(path).unwrap(), HOSTILE, "{path}");
    }
    for fields in ["edgeFields", "junctionFields"] {
        assert_eq!(data[fields][HOSTILE][0], 0.5);
        assert_eq!(data[fields]["__proto__"][0], 0.5);
    }
    // Around the data and the title the page is as ever, and nothing is invisible.
    let (_, rest) = page.split_once("<title>").unwrap();
    let (title, _) = rest.split_once("</title>").unwrap();
    assert_eq!(frame_of(&page, &format!("<title>{title}</title>")), frame);
    assert!(!page.contains(|c: char| c.is_control() && c != '\n'));
}

fn hostile_text() -> impl Strategy<Value = String> {
    prop_oneof![
        any::<String>(),
        "(</script>|<!--|-->|<script>|\\{\\{data\\}\\}|\\{\\{script\\}\\}|\u{2028}|'|\"|&|\\\\|a){0,12}",
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn texts_stay_texts(texts in prop::collection::vec(hostile_text(), 6)) {
        let mut report = Report {
            title: texts[0].clone(),
            configuration: texts[1].clone(),
            warnings: vec![texts[2].clone()],
            facts: vec![FactGroup {
                heading: texts[3].clone(),
                facts: vec![(texts[4].clone(), texts[5].clone())],
            }],
            ..Report::default()
        };
        let page = report.render().unwrap();
        let data = data_of(&page);
        prop_assert_eq!(data["title"].as_str(), Some(texts[0].as_str()));
        prop_assert_eq!(data["configuration"].as_str(), Some(texts[1].as_str()));
        prop_assert_eq!(data["warnings"][0].as_str(), Some(texts[2].as_str()));
        prop_assert_eq!(data["facts"][0][0].as_str(), Some(texts[3].as_str()));
        prop_assert_eq!(data["facts"][0][1][0][1].as_str(), Some(texts[5].as_str()));
        // Around the data and the title the page is always the same.
        let (_, title) = page.split_once("<title>").unwrap();
        let (title, _) = title.split_once("</title>").unwrap();
        let title = format!("<title>{title}</title>");
        report = Report::default();
        let plain = report.render().unwrap();
        prop_assert_eq!(
            frame_of(&page, &title),
            frame_of(&plain, "<title> – neat report</title>")
        );
    }
}
