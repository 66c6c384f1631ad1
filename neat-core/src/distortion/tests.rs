use super::*;
use proptest::prelude::*;

/// Lenses as calibrations give them, one or two of each model.
fn lenses() -> [Distortion; 9] {
    [
        Distortion::None,
        Distortion::Brown {
            radial: [-0.21, 0.08, -0.01, 0.0, 0.0, 0.0],
            tangential: [1e-3, -6e-4],
        },
        Distortion::Brown {
            radial: [0.4, 0.2, 0.03, 0.55, 0.17, 0.05],
            tangential: [-2e-4, 4e-4],
        },
        Distortion::Fisheye {
            radial: [0.03, -0.01, 0.004, -0.001, 2e-4, -1e-5],
            tangential: [5e-4, -3e-4],
            thin_prism: [4e-4, -1e-4, -3e-4, 2e-4],
        },
        Distortion::ThinPrismFisheye {
            radial: [0.03, -0.01, 0.004, -0.001],
            tangential: [5e-4, -3e-4],
            thin_prism: [4e-4, -3e-4],
        },
        Distortion::Fov { omega: 0.9 },
        Distortion::ReverseRadial { k: -0.08 },
        Distortion::Division { k: -0.08 },
        Distortion::ExtendedUnified {
            alpha: 0.6,
            beta: 1.2,
        },
    ]
}

/// The formulas in polar coordinates, as the documentation of COLMAP and OpenCV
/// has them, term by term.
fn by_the_book(lens: &Distortion, x: f64, y: f64) -> (f64, f64) {
    let (r, phi) = (x.hypot(y), y.atan2(x));
    match *lens {
        Distortion::None | Distortion::ReverseRadial { .. } | Distortion::Division { .. } => (x, y),
        Distortion::ExtendedUnified { alpha, beta } => {
            let distance = (beta * (x * x + y * y) + 1.0).sqrt();
            let depth = alpha * distance + (1.0 - alpha);
            (x / depth, y / depth)
        }
        Distortion::Brown {
            radial: [k1, k2, k3, k4, k5, k6],
            tangential: [p1, p2],
        } => {
            let factor = (1.0 + k1 * r.powi(2) + k2 * r.powi(4) + k3 * r.powi(6))
                / (1.0 + k4 * r.powi(2) + k5 * r.powi(4) + k6 * r.powi(6));
            (
                x * factor + 2.0 * p1 * x * y + p2 * (3.0 * x * x + y * y),
                y * factor + p1 * (x * x + 3.0 * y * y) + 2.0 * p2 * x * y,
            )
        }
        Distortion::Fisheye {
            radial,
            tangential: [p1, p2],
            thin_prism: [s1, s2, s3, s4],
        } => {
            let theta = r.atan2(1.0);
            let rho: f64 = (1..)
                .zip(radial)
                .map(|(i, k)| k * theta.powi(2 * i + 1))
                .sum::<f64>()
                + theta;
            let (u, v) = (rho * phi.cos(), rho * phi.sin());
            (
                u + 2.0 * p1 * u * v
                    + p2 * (3.0 * u * u + v * v)
                    + s1 * rho.powi(2)
                    + s2 * rho.powi(4),
                v + p1 * (u * u + 3.0 * v * v)
                    + 2.0 * p2 * u * v
                    + s3 * rho.powi(2)
                    + s4 * rho.powi(4),
            )
        }
        Distortion::ThinPrismFisheye {
            radial: [k1, k2, k3, k4],
            tangential: [p1, p2],
            thin_prism: [s1, s2],
        } => {
            let theta = r.atan2(1.0);
            let (u, v) = (theta * phi.cos(), theta * phi.sin());
            let q = theta * theta;
            let factor = 1.0 + k1 * q + k2 * q.powi(2) + k3 * q.powi(3) + k4 * q.powi(4);
            (
                u * factor + 2.0 * p1 * u * v + p2 * (q + 2.0 * u * u) + s1 * q,
                v * factor + p1 * (q + 2.0 * v * v) + 2.0 * p2 * u * v + s2 * q,
            )
        }
        Distortion::Fov { omega } => {
            let rho = (2.0 * r * (0.5 * omega).tan()).atan() / omega;
            (rho * phi.cos(), rho * phi.sin())
        }
    }
}

proptest! {
    #[test]
    fn points_go_where_the_formulas_say(x in -1.2..1.2, y in -1.2..1.2) {
        let point = Vector2::new(x, y);
        for lens in lenses() {
            if let Distortion::ReverseRadial { k } = lens {
                // Its formula leads the other way.
                let stretched = point * (1.0 + k * point.norm_squared());
                // The fold is at r = 2.04, beyond the corners of the range.
                let found = lens.undistort(&point).unwrap();
                prop_assert!((found - stretched).norm() < 1e-15);
                continue;
            }
            if let Distortion::Division { k } = lens {
                let divided = point / (1.0 + k * point.norm_squared());
                let found = lens.undistort(&point).unwrap();
                prop_assert!((found - divided).norm() < 1e-15);
                continue;
            }
            let (u, v) = by_the_book(&lens, x, y);
            let found = lens.distort(&point);
            prop_assert!((found - Vector2::new(u, v)).norm() < 1e-14, "{lens:?}");
        }
    }

    #[test]
    fn undistortion_undoes_distortion(x in -0.9..0.9, y in -0.9..0.9) {
        let point = Vector2::new(x, y);
        for lens in lenses() {
            prop_assert!(lens.is_one_to_one_to(&point), "{lens:?}");
            let found = lens.undistort(&lens.distort(&point)).unwrap();
            prop_assert!((found - point).norm() < 1e-11, "{lens:?}: {found}");
        }
    }

    #[test]
    fn jacobians_are_finite_differences(x in -0.9..0.9, y in -0.9..0.9, near_axis: bool) {
        // Around the axis the fisheye's derivative is another formula.
        let point = Vector2::new(x, y) * if near_axis { 1e-4 } else { 1.0 };
        for lens in lenses() {
            let Some((value, jacobian)) = lens.with_jacobian(&point) else {
                continue;
            };
            prop_assert_eq!(value, lens.distort(&point));
            let h = 1e-6;
            for (axis, step) in [Vector2::new(h, 0.0), Vector2::new(0.0, h)].iter().enumerate() {
                let difference = (lens.distort(&(point + step)) - lens.distort(&(point - step))) / (2.0 * h);
                let error = (difference - jacobian.column(axis)).norm();
                prop_assert!(error < 1e-8, "{lens:?}: {error:e}");
            }
        }
    }

    #[test]
    fn random_lenses_invert_or_say_that_they_cannot(
        radial in prop::array::uniform6(-3.0..3.0), tangential in prop::array::uniform2(-0.3..0.3),
        thin_prism in prop::array::uniform4(-0.3..0.3), k in -3.0..3.0, omega in -3.0..3.0,
        x in -3.0..3.0, y in -3.0..3.0,
    ) {
        let point = Vector2::new(x, y);
        for lens in [
            Distortion::Brown { radial, tangential },
            Distortion::Fisheye { radial, tangential, thin_prism },
            Distortion::Fov { omega },
            Distortion::ReverseRadial { k },
            Distortion::Division { k },
            Distortion::ExtendedUnified { alpha: k, beta: omega.abs() },
        ] {
            if let Some(found) = lens.undistort(&point) {
                prop_assert!((lens.distort(&found) - point).norm() < 1e-9, "{lens:?}");
                prop_assert!(lens.is_one_to_one_to(&found));
            }
        }
    }
}

#[test]
fn points_beyond_the_fold_are_nothing() {
    // r (1 − r²/3) rises to 2/3 at r = 1 and then falls.
    let folding = Distortion::Brown {
        radial: [-1.0 / 3.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        tangential: [0.0; 2],
    };
    for (radius, before) in [(0.5, true), (0.99, true), (1.01, false), (1.7, false)] {
        let point = Vector2::new(0.6, -0.8) * radius;
        assert_eq!(folding.is_one_to_one_to(&point), before);
        let back = folding.undistort(&folding.distort(&point));
        match before {
            true => assert!((back.unwrap() - point).norm() < 1e-9),
            // The point is shown where another one before the fold is.
            false => assert!(back.is_none_or(|other| other.norm() < 1.0)),
        }
    }
    assert_eq!(folding.undistort(&Vector2::new(0.667, 0.0)), None);

    // Falls from 0.5 and rises again: the second rise is not a solution.
    let returning = Distortion::Brown {
        radial: [-1.2, 0.6, 0.0, 0.0, 0.0, 0.0],
        tangential: [0.0; 2],
    };
    assert_eq!(returning.undistort(&Vector2::new(0.5, 0.0)), None);

    // r (1 − r²/3) again, but from the photograph to the pinhole.
    let division = Distortion::ReverseRadial { k: -1.0 / 3.0 };
    assert_eq!(division.undistort(&Vector2::new(1.01, 0.0)), None);
    assert!(division.undistort(&Vector2::new(0.99, 0.0)).is_some());
    assert!(division.is_one_to_one_to(&Vector2::new(0.666, 0.0)));
    assert!(!division.is_one_to_one_to(&Vector2::new(0.667, 0.0)));
    assert!(division.distort(&Vector2::new(0.667, 0.0)).x.is_nan());
}

#[test]
fn rays_at_a_right_angle_to_the_axis_are_in_no_pinhole_image() {
    let fisheye = Distortion::Fisheye {
        radial: [0.0; 6],
        tangential: [0.0; 2],
        thin_prism: [0.0; 4],
    };
    let fov = Distortion::Fov { omega: 1.0 };
    for lens in [fisheye, fov] {
        assert!(lens.undistort(&Vector2::new(1.5, 0.0)).is_some());
        assert_eq!(lens.undistort(&Vector2::new(1.6, 0.0)), None);
        assert_eq!(lens.undistort(&Vector2::new(f64::NAN, 0.0)), None);
    }
    let seen = fisheye.undistort(&Vector2::new(0.0, 1.5)).unwrap();
    assert!((seen.y - 1.5_f64.tan()).abs() < 1e-9 && seen.x == 0.0);
}

#[test]
fn lenses_without_distortion_change_nothing() {
    let point = Vector2::new(0.3, -0.7);
    for lens in [
        Distortion::None,
        Distortion::Brown {
            radial: [0.0; 6],
            tangential: [0.0; 2],
        },
        Distortion::Fov { omega: 0.0 },
        Distortion::ReverseRadial { k: 0.0 },
    ] {
        assert!(lens.is_none());
        assert_eq!(lens.distort(&point), point);
        assert!((lens.undistort(&point).unwrap() - point).norm() < 1e-15);
    }
    // Small coefficients are no division by zero.
    for (omega, k) in [(1e-9, 1e-18), (-1e-9, -1e-18)] {
        for lens in [Distortion::Fov { omega }, Distortion::ReverseRadial { k }] {
            assert!((lens.distort(&point) - point).norm() < 1e-15, "{lens:?}");
            assert!((lens.undistort(&point).unwrap() - point).norm() < 1e-15);
            assert_eq!(lens.distort(&Vector2::zeros()), Vector2::zeros());
        }
    }
}
