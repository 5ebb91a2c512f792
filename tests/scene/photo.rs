use gprop::camera::{Camera, Distortion, Intrinsics};
use gprop::scene::{Mask, Photo, SceneError, Upright, View};
use image::{DynamicImage, GrayImage, ImageBuffer, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use nalgebra::Isometry3;

/// A view whose photo is `picture`, saved in `folder`.
fn view(folder: &tempfile::TempDir, picture: &DynamicImage) -> View {
    let image = folder.path().join("photo.png");
    picture.save(&image).unwrap();
    let (width, height) = (picture.width(), picture.height());
    let intrinsics =
        Intrinsics { width, height, fx: 1.0, fy: 1.0, cx: 0.5, cy: 0.5, distortion: Distortion::default() };
    View {
        name: "photo".to_owned(),
        camera: Camera { intrinsics, camera_from_world: Isometry3::identity() },
        image,
        upright: Upright::AsStored,
        mask: None,
    }
}

#[test]
fn alpha_is_composited_over_white_and_tells_the_foreground() {
    let folder = tempfile::tempdir().unwrap();
    let mut rgba = RgbaImage::new(3, 1);
    rgba.put_pixel(0, 0, Rgba([200, 100, 0, 255]));
    rgba.put_pixel(1, 0, Rgba([200, 100, 0, 0]));
    rgba.put_pixel(2, 0, Rgba([200, 100, 0, 128]));
    for picture in [DynamicImage::from(rgba.clone()), DynamicImage::ImageRgba16(DynamicImage::from(rgba).into_rgba16())]
    {
        let photo = view(&folder, &picture).photo().unwrap();
        assert_eq!(photo.rgb.get_pixel(0, 0), &Rgb([200, 100, 0]));
        assert_eq!(photo.rgb.get_pixel(1, 0), &Rgb([255, 255, 255]));
        // 0.502 * 200 + 0.498 * 255 = 227.4 and so on.
        assert_eq!(photo.rgb.get_pixel(2, 0), &Rgb([227, 177, 127]));
        assert_eq!(photo.foreground.as_raw(), &[255, 0, 255]);
    }
}

#[test]
fn without_alpha_all_is_foreground() {
    let folder = tempfile::tempdir().unwrap();
    let grey16 = ImageBuffer::from_pixel(2, 2, Luma([257u16 * 40]));
    let pictures: [DynamicImage; 3] = [
        RgbImage::from_pixel(2, 2, Rgb([40, 40, 40])).into(),
        GrayImage::from_pixel(2, 2, Luma([40])).into(),
        grey16.into(),
    ];
    for picture in pictures {
        let photo = view(&folder, &picture).photo().unwrap();
        assert!(photo.rgb.pixels().all(|pixel| pixel == &Rgb([40, 40, 40])));
        assert!(photo.foreground.as_raw().iter().all(|value| *value == 255));
    }
}

#[test]
fn a_bad_photo_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut view = view(&folder, &RgbImage::new(2, 2).into());
    view.camera.intrinsics.width = 3;
    assert!(matches!(view.photo(), Err(SceneError::ImageChanged { expected: (3, 2), found: (2, 2), .. })));
    let whole = std::fs::read(&view.image).unwrap();
    std::fs::write(&view.image, &whole[..whole.len() - 20]).unwrap();
    let message = view.photo().unwrap_err().to_string();
    assert!(message.contains("photo.png") && message.contains("cannot be decoded"), "{message}");
    std::fs::remove_file(&view.image).unwrap();
    let message = view.photo().unwrap_err().to_string();
    assert!(message.contains("photo.png") && message.contains("is missing"), "{message}");
}

#[test]
fn a_large_photo_is_shrunk_without_the_colour_of_what_is_transparent() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.png");
    // Of each square of 3 x 3 pixels, the first column is transparent, and black as most programs leave it.
    let picture = RgbaImage::from_fn(6144, 3, |x, _| Rgba(if x % 3 == 0 { [0; 4] } else { [200, 0, 0, 255] }));
    picture.save(&path).unwrap();
    let (photo, size) = Photo::open(&path, None).unwrap();
    assert_eq!((photo.rgb.dimensions(), size), ((2048, 1), (6144, 3)));
    // The mean alpha is 170 of 255: (200 * 170 + 255 * 85) / 255 = 218.3, and 85 in the other channels.
    assert!(photo.rgb.pixels().all(|pixel| pixel == &Rgb([218, 85, 85])), "{:?}", photo.rgb.get_pixel(0, 0));
    assert!(photo.foreground.as_raw().iter().all(|value| *value == 255));
}

#[test]
fn a_mask_of_zeros_and_ones_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut view = view(&folder, &RgbImage::from_pixel(4, 2, Rgb([40, 40, 40])).into());
    let path = folder.path().join("mask.png");
    let mut foreground = |object: u8| {
        GrayImage::from_fn(4, 2, |x, _| Luma([if x < 2 { object } else { 0 }])).save(&path).unwrap();
        view.mask = Some(Mask::new(path.clone()));
        view.photo().map(|photo| photo.foreground.as_raw().iter().filter(|value| **value == 255).count())
    };
    assert_eq!(foreground(255).unwrap(), 4);
    // The object may be out of the picture.
    assert_eq!(foreground(0).unwrap(), 0);
    let refused = |outcome: Result<usize, SceneError>| {
        let message = outcome.unwrap_err().to_string();
        assert!(message.contains("mask.png") && message.contains("255"), "{message}");
    };
    refused(foreground(1));
    let deep = ImageBuffer::from_fn(4, 2, |x, _| Luma([u16::from(x < 2)]));
    DynamicImage::ImageLuma16(deep).save(&path).unwrap();
    refused(view.photo().map(|_| 0));
}
