//! The program as the page calls it.

use super::run;
use neat_wireframe::export::read_json;
use std::fs;

#[test]
fn the_bundled_scene_becomes_a_wireframe_a_report_and_exports() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let [scene, out] = ["scene", "out"].map(path);
    run(&["synthesise", &scene]).unwrap().unwrap();
    assert!(
        !dir.path().join("scene/hawp").exists(),
        "the detector has nothing to do"
    );
    run(&["reconstruct", &scene, &out]).unwrap().unwrap();

    let json = path("out/wireframe.json");
    let document = read_json(json.as_ref()).unwrap();
    assert_eq!((document.junctions.len(), document.edges.len()), (12, 18));
    let report = fs::read_to_string(path("out/report.html")).unwrap();
    assert!(report.contains("\"Seconds\""));
    for (format, begins) in [
        ("step", &b"ISO-10303-21"[..]),
        ("limap", b"PK"),
        ("glb", b"glTF"),
        ("cityjson", b"{\"CityObjects\":"),
    ] {
        let file = path(format);
        run(&["export", &json, format, &file]).unwrap().unwrap();
        let bytes = fs::read(&file).unwrap();
        assert!(bytes.starts_with(begins), "{format}");
        assert!(!dir.path().join(format).with_extension("folder").exists());
    }
}

#[test]
fn what_cannot_be_done_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let error = |arguments: &[&str]| run(arguments).unwrap().unwrap_err().to_string();
    let scene = path("scene");
    fs::create_dir(&scene).unwrap();
    assert!(error(&["reconstruct", &scene, &path("out")]).contains("scene"));
    assert!(error(&["export", &path("none.json"), "dxf", &path("a")]).contains("none.json"));
    assert!(error(&["export", &path("none.json"), "doc", &path("a")]).contains("doc"));
    assert!(run(&["reconstruct", &scene]).is_none());
    assert!(run(&[]).is_none());
}
