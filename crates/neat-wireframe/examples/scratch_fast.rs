use nalgebra::{Matrix3, Vector2, Vector3};
use neat_core::{Camera, Intrinsics, LineSegment2, LineSegment3, ScoredSegment2};
use neat_wireframe::fast_back_end::{FastBackEndConfig, run};
use neat_wireframe::{SegmentProposal, SignedDistance, ViewObservation};
use serde_json::Value;
struct Grid {
    n: usize,
    r: f64,
    v: Vec<f64>,
}
impl SignedDistance for Grid {
    fn sdf(&self, p: &[Vector3<f64>]) -> Vec<f64> {
        p.iter()
            .map(|p| {
                let f = |x: f64| {
                    ((x / self.r + 1.0) * 0.5 * (self.n - 1) as f64)
                        .clamp(0.0, self.n as f64 - 1.0001)
                };
                let (x, y, z) = (f(p.x), f(p.y), f(p.z));
                let (i, j, k) = (x as usize, y as usize, z as usize);
                let (u, v, w) = (x - i as f64, y - j as f64, z - k as f64);
                let g = |a: usize, b: usize, c: usize| {
                    self.v[((i + a) * self.n + j + b) * self.n + k + c]
                };
                let l = |a: f64, b: f64, t: f64| a + (b - a) * t;
                l(
                    l(
                        l(g(0, 0, 0), g(0, 0, 1), w),
                        l(g(0, 1, 0), g(0, 1, 1), w),
                        v,
                    ),
                    l(
                        l(g(1, 0, 0), g(1, 0, 1), w),
                        l(g(1, 1, 0), g(1, 1, 1), w),
                        v,
                    ),
                    u,
                )
            })
            .collect()
    }
    fn sdf_and_gradient(&self, p: &[Vector3<f64>]) -> Vec<(f64, Vector3<f64>)> {
        self.sdf(p).into_iter().map(|d| (d, Vector3::x())).collect()
    }
}
fn nums(v: &Value) -> Vec<f64> {
    v.as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap_or(f64::NAN))
        .collect()
}
fn main() {
    let mut args = std::env::args().skip(1);
    let dump: Value =
        serde_json::from_slice(&std::fs::read(args.next().unwrap()).unwrap()).unwrap();
    let gt: Value = serde_json::from_slice(&std::fs::read(args.next().unwrap()).unwrap()).unwrap();
    let config: FastBackEndConfig =
        serde_json::from_str(&args.next().unwrap_or("{}".into())).unwrap();
    let verbose = args.next().is_some();
    let keep: usize = std::env::var("KEEP")
        .ok()
        .and_then(|x| x.parse().ok())
        .unwrap_or(1000);
    let all = dump["views"].as_array().unwrap();
    let n_views = all.len();
    let chosen: Vec<bool> = (0..n_views)
        .map(|i| i * keep / n_views != (i + 1) * keep / n_views || keep >= n_views)
        .collect();
    let views: Vec<ViewObservation> = all
        .iter()
        .enumerate()
        .map(|(i, v)| {
            let k = nums(&v["k"]);
            let r = nums(&v["r"]);
            let t = nums(&v["t"]);
            ViewObservation {
                camera: Camera {
                    intrinsics: Intrinsics {
                        fx: k[0],
                        fy: k[1],
                        cx: k[2],
                        cy: k[3],
                        skew: k[4],
                    },
                    world_from_camera: Matrix3::from_column_slice(&r),
                    center_in_world: Vector3::from_column_slice(&t),
                    width: v["w"].as_u64().unwrap() as _,
                    height: v["h"].as_u64().unwrap() as _,
                },
                segments: if !chosen[i] {
                    vec![]
                } else {
                    v["s"]
                        .as_array()
                        .unwrap()
                        .iter()
                        .map(|s| {
                            let s = nums(s);
                            ScoredSegment2 {
                                segment: LineSegment2::new(
                                    Vector2::new(s[0], s[1]),
                                    Vector2::new(s[2], s[3]),
                                ),
                                score: s[4],
                                edge: 0,
                            }
                        })
                        .collect()
                },
                junctions: v["j"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .map(|j| {
                        let j = nums(j);
                        Vector2::new(j[0], j[1])
                    })
                    .collect(),
            }
        })
        .collect();
    let proposals: Vec<SegmentProposal> = dump["proposals"]
        .as_array()
        .unwrap()
        .iter()
        .map(|p| {
            let p = nums(p);
            SegmentProposal {
                view: p[0] as _,
                segment_in_view: p[1] as _,
                segment: LineSegment3::new(
                    Vector3::new(p[2], p[3], p[4]),
                    Vector3::new(p[5], p[6], p[7]),
                ),
                end_error_in_pixels: [p[8], p[9]],
                end_spread: [p[10], p[11]],
            }
        })
        .collect();
    let perceived: Vec<_> = dump["perceived"]
        .as_array()
        .unwrap()
        .iter()
        .map(|j| Vector3::from_column_slice(&nums(j)))
        .collect();
    let radius = dump["radius"].as_f64().unwrap();
    let grid = Grid {
        n: dump["n"].as_u64().unwrap() as _,
        r: radius,
        v: nums(&dump["sdf"]),
    };
    let (scale, origin) = (
        dump["scale"].as_f64().unwrap(),
        Vector3::from_column_slice(&nums(&dump["origin"])),
    );
    let t0 = std::time::Instant::now();
    let result = run(&views, &proposals, &perceived, &grid, radius, &config);
    let dt = t0.elapsed().as_secs_f64();
    let j: Vec<_> = result
        .wireframe
        .junctions
        .iter()
        .map(|x| x * scale + origin)
        .collect();
    let tj: Vec<Vector3<f64>> = gt["junctions"]
        .as_array()
        .unwrap()
        .iter()
        .map(|j| Vector3::from_column_slice(&nums(j)))
        .collect();
    let tl: Vec<[usize; 2]> = gt["lines"]
        .as_array()
        .unwrap()
        .iter()
        .map(|l| {
            let l = nums(l);
            [l[0] as usize, l[1] as usize]
        })
        .collect();
    let seg = |j: &[Vector3<f64>], e: &[[usize; 2]]| {
        e.iter()
            .map(|e| LineSegment3::new(j[e[0]], j[e[1]]))
            .collect::<Vec<_>>()
    };
    use neat_wireframe::metrics::*;
    let dj = junction_distances(&j, &tj);
    let ds = segment_distances(
        &seg(&j, &result.wireframe.edges),
        &seg(&tj, &tl),
        SegmentDistance::Max,
    );
    let f = |p: &[PrecisionRecall]| {
        p.iter()
            .map(|p| format!("{:.3}/{:.3}", p.precision, p.recall))
            .collect::<Vec<_>>()
            .join(" ")
    };
    let pj = precision_recall(&dj, &[0.01, 0.02], Matching::MinimumSum).unwrap();
    let ps = precision_recall(&ds, &[0.01, 0.02], Matching::MinimumSum).unwrap();
    println!(
        "J {} S {} {}J {}E {:.2}s",
        f(&pj),
        f(&ps),
        j.len(),
        result.wireframe.edges.len(),
        dt
    );
    {
        use neat_wireframe::Wireframe3d;
        use neat_wireframe::supported_truth::*;
        let world: Vec<_> = tj.iter().map(|x| (x - origin) / scale).collect();
        let truth = Wireframe3d {
            junctions: world,
            edges: tl.clone(),
        };
        let st = supported_truth(
            &truth,
            &views,
            result.report.required_views,
            &SupportedTruthConfig::default(),
        )
        .map(|x| x * scale + origin);
        let curves: Vec<neat_core::ground_truth::Curve> =
            serde_json::from_value(gt.get("curves").cloned().unwrap_or(Value::Array(vec![])))
                .unwrap();
        let full = Wireframe3d {
            junctions: tj.clone(),
            edges: tl.clone(),
        };
        let w = without_curves(
            &Wireframe3d {
                junctions: j.clone(),
                edges: result.wireframe.edges.clone(),
            },
            &full,
            &curves,
            0.01,
        );
        let dj = junction_distances(&w.wireframe.junctions, &st.junctions);
        let ds = segment_distances(
            &w.wireframe.segments(),
            &st.segments(),
            SegmentDistance::Max,
        );
        let pj = precision_recall(&dj, &[0.01], Matching::PerThreshold).unwrap();
        let ps = precision_recall(&ds, &[0.01], Matching::PerThreshold).unwrap();
        let h = |p: &PrecisionRecall| {
            format!(
                "{:.3}/{:.3} F {:.3}",
                p.precision,
                p.recall,
                2.0 * p.precision * p.recall / (p.precision + p.recall).max(1e-9)
            )
        };
        println!(
            "        supported {}J {}E of {}/{}: J {} S {}  rims {}J {}E",
            st.junctions.len(),
            st.edges.len(),
            tj.len(),
            tl.len(),
            h(&pj[0]),
            h(&ps[0]),
            w.junctions_on_curves,
            w.edges_on_curves
        );
    }
    if verbose {
        println!("{:?}", result.report);
        let name = |x: &Vector3<f64>| {
            let (i, d) = tj
                .iter()
                .enumerate()
                .map(|(i, t)| (i, (t - x).norm()))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .unwrap();
            if d < 0.01 {
                format!("{i}({d:.4})")
            } else {
                format!("{i}?{d:.3}")
            }
        };
        for (e, ev) in result.wireframe.edges.iter().zip(&result.edges) {
            let [a, b] = e.map(|e| name(&j[e]));
            println!(
                "  {a} - {b} support {} visible {:?} ",
                ev.support, ev.visible_views
            );
        }
        for (i, t) in tj.iter().enumerate() {
            let d = j.iter().map(|x| (x - t).norm()).fold(9.0, f64::min);
            if d > 0.003 {
                println!("  truth {i} at {d:.4}");
            }
        }
    }
}
