//! Images, files and 2D wireframes that do not belong to the poses.

use super::draft::Picture;
use super::{Corruption, Needs};
use image::{RgbImage, imageops};
use neat_doctor::{Cause, Check};
use std::fs;

pub fn table() -> Vec<Corruption> {
    let tables = [files(), all_images(), single_images(), wireframes()];
    tables.into_iter().flatten().collect()
}

fn files() -> Vec<Corruption> {
    let problem = Corruption::problem;
    vec![
        problem("a missing image", Cause::CountMismatch, |draft| {
            draft.one().picture = Picture::Missing;
        }),
        problem("a pose too few", Cause::CountMismatch, |draft| {
            let mut extra = draft.views[0].clone();
            extra.name = "zzz".into();
            // Its image only.
            draft.extra_images.push(extra);
        }),
        problem("`cameras.npz` truncated", Cause::DamagedFile, |draft| {
            draft.share_of_cameras = 0.6;
        }),
        problem("an image truncated", Cause::DamagedFile, |draft| {
            let view = draft.one();
            if let Picture::File(path) = &view.picture {
                let bytes = fs::read(path).unwrap();
                view.picture = Picture::Bytes(bytes[..bytes.len() / 2].to_vec());
            }
        }),
        problem(
            "a page of HTML in place of an image",
            Cause::DamagedFile,
            |draft| {
                draft.one().picture = Picture::Bytes(b"<!DOCTYPE html><html>404</html>".to_vec());
            },
        ),
    ]
}

fn all_images() -> Vec<Corruption> {
    let problem = Corruption::problem;
    vec![
        problem("images of half size", Cause::ResizedImages, |draft| {
            draft.each_image(half);
            draft.each_wireframe(|wireframe| {
                wireframe.vertices.iter_mut().for_each(|v| *v *= 0.5);
                (wireframe.width, wireframe.height) = (wireframe.width / 2, wireframe.height / 2);
            });
        })
        .repaired_by("--intrinsics-scale 0.5"),
        problem("mirrored images", Cause::MirroredPoses, |draft| {
            draft.each_image(imageops::flip_horizontal);
            draft.without_wireframes();
        })
        .repaired_by("--camera-axes left-down-forward --mirrored-world"),
        problem("images turned by 180°", Cause::CameraAxes, |draft| {
            draft.each_image(imageops::rotate180);
            draft.without_wireframes();
        })
        .repaired_by("--camera-axes left-up-forward"),
        problem("images turned by 90°", Cause::TurnedImages, |draft| {
            draft.each_image(imageops::rotate90);
            draft.without_wireframes();
        }),
        problem(
            "a quarter of the width cut off",
            Cause::PrincipalPoint,
            |draft| {
                draft.each_image(|image| {
                    let cut = image.width() / 4;
                    imageops::crop_imm(image, cut, 0, image.width() - cut, image.height())
                        .to_image()
                });
                draft.without_wireframes();
            },
        ),
        problem(
            "a wide lens that was not undistorted",
            Cause::LensDistortion,
            |draft| {
                for view in &mut draft.views {
                    let k = view.k;
                    view.edit(|image| distorted(image, [k[(0, 0)], k[(0, 2)], k[(1, 2)]]));
                }
                draft.without_wireframes();
            },
        ),
        problem("all images black", Cause::Other, |draft| {
            draft.each_image(|image| RgbImage::new(image.width(), image.height()));
        }),
        problem("all images blown out", Cause::Other, |draft| {
            draft.each_image(|image| {
                RgbImage::from_pixel(image.width(), image.height(), image::Rgb([255; 3]))
            });
        }),
        problem("one image copied over all others", Cause::Other, |draft| {
            let first = draft.views[0].pixels();
            draft.each_image(|_| first.clone());
            draft.without_wireframes();
        }),
    ]
}

fn single_images() -> Vec<Corruption> {
    let (problem, told) = (Corruption::problem, Corruption::told);
    let warning = Corruption::warning;
    vec![
        problem("one image turned by 180°", Cause::TurnedImages, |draft| {
            draft.one().edit(imageops::rotate180);
            draft.without_wireframes();
        }),
        problem("an image copied over another", Cause::BadPose, |draft| {
            let last = draft.views.last().unwrap().pixels();
            draft.one().edit(|_| last.clone());
            draft.without_wireframes();
        }),
        told("an image of another scene", Cause::BadPose, |draft| {
            let (images, _) = draft.other_scene(1);
            draft.one().picture = Picture::Pixels(images[0].clone());
            draft.without_wireframes();
        }),
        told("the last third of another run", Cause::BadPose, |draft| {
            let count = draft.views.len();
            let (images, _) = draft.other_scene(count);
            let pairs = draft.views.iter_mut().zip(images).skip(count - count / 3);
            pairs.for_each(|(view, image)| view.picture = Picture::Pixels(image));
            draft.without_wireframes();
        }),
        warning("a view that is there twice", Check::Duplicates, |draft| {
            let mut again = draft.views.last().unwrap().clone();
            again.name += "_copy";
            draft.views.push(again);
        }),
        warning("one image black", Check::Exposure, |draft| {
            draft
                .one()
                .edit(|image| RgbImage::new(image.width(), image.height()));
        }),
        warning("one image blurred", Check::Sharpness, |draft| {
            draft
                .one()
                .edit(|image| imageops::fast_blur(image, 0.012 * image.width() as f32));
        }),
    ]
}

fn wireframes() -> Vec<Corruption> {
    let of_others = |name, spoil| {
        Corruption::problem(name, Cause::SegmentsOfOtherImages, spoil).needs(Needs::Wireframes)
    };
    vec![
        of_others("2D wireframes of the next view", |draft| {
            let mut all: Vec<_> = draft.views.iter().map(|v| v.wireframe.clone()).collect();
            all.rotate_left(1);
            for (view, wireframe) in draft.views.iter_mut().zip(all) {
                view.wireframe = wireframe;
            }
        }),
        of_others("2D wireframes mirrored", |draft| {
            draft.each_wireframe(|wireframe| {
                let width = f64::from(wireframe.width);
                wireframe
                    .vertices
                    .iter_mut()
                    .for_each(|v| v.x = width - v.x);
            });
        }),
        of_others("2D wireframes with x and y exchanged", |draft| {
            draft.each_wireframe(|wireframe| {
                wireframe.vertices.iter_mut().for_each(|v| *v = v.yx());
            });
        }),
        of_others("2D wireframes in pixels of half the image", |draft| {
            draft.each_wireframe(|wireframe| {
                wireframe.vertices.iter_mut().for_each(|v| *v *= 0.5);
            });
        }),
        of_others("2D wireframes shifted by a border", |draft| {
            draft.each_wireframe(|wireframe| {
                wireframe
                    .vertices
                    .iter_mut()
                    .for_each(|v| *v = v.add_scalar(25.0));
            });
        }),
        Corruption::problem(
            "2D wireframes of images of half size",
            Cause::ResizedImages,
            |draft| {
                draft.each_wireframe(|wireframe| {
                    wireframe.vertices.iter_mut().for_each(|v| *v *= 0.5);
                    (wireframe.width, wireframe.height) =
                        (wireframe.width / 2, wireframe.height / 2);
                });
            },
        )
        .needs(Needs::Wireframes),
    ]
}

/// Every second pixel's square averaged.
fn half(image: &RgbImage) -> RgbImage {
    let (width, height) = (image.width() / 2, image.height() / 2);
    imageops::resize(image, width, height, imageops::FilterType::Triangle)
}

/// What a lens with a barrel distortion of 12 % at the side of the image makes of it; for a
/// focal length and a principal point.
fn distorted(image: &RgbImage, [focal, cx, cy]: [f64; 3]) -> RgbImage {
    let side = 0.5 * f64::from(image.width()) / focal;
    // (x, y) = (u, v) (1 + k ρ²) leads from the photograph to the pinhole.
    let k = 0.12 / (side * side);
    RgbImage::from_fn(image.width(), image.height(), |x, y| {
        let [u, v] = [(x, cx), (y, cy)].map(|(at, c)| (f64::from(at) + 0.5 - c) / focal);
        let bent = 1.0 + k * (u * u + v * v);
        let [x, y] = [(u, cx), (v, cy)].map(|(at, c)| (at * bent * focal + c - 0.5) as f32);
        imageops::interpolate_bilinear(image, x, y).unwrap_or(*image.get_pixel(0, 0))
    })
}
