//! The image of a view: in memory, in a temporary file that is read when it is wanted,
//! or made then.
//!
//! Three hundred photographs of twelve megapixels are ten gigabytes, and a step of
//! training looks at some hundred pixels of them. An [`ImageStore`] decides where
//! images go; whoever uses a [`ViewImage`] need not know.

use crate::{MemoryLimit, SceneError};
use image::{Rgb, RgbImage};
use std::borrow::Cow;
use std::fmt;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Red, green and blue: one byte each.
const CHANNELS: u64 = 3;

/// An image that is cheap to clone and need not be in memory.
///
/// # Example
/// ```
/// use image::{Rgb, RgbImage};
/// use neat_core::ViewImage;
///
/// let image = ViewImage::from(RgbImage::from_pixel(4, 3, Rgb([7, 8, 9])));
/// assert_eq!(image.dimensions(), (4, 3));
/// assert_eq!(image.pixel(3, 2)?, Rgb([7, 8, 9]));
/// assert_eq!(image.read()?.as_raw().len(), 3 * 12);
/// # Ok::<(), neat_core::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct ViewImage(Pixels);

#[derive(Clone)]
enum Pixels {
    InMemory(Arc<RgbImage>),
    InFile(Arc<Stretch>),
    OnDemand {
        size: (u32, u32),
        make: Arc<dyn Fn() -> RgbImage + Send + Sync>,
    },
}

impl fmt::Debug for Pixels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InMemory(image) => write!(f, "InMemory({:?})", image.dimensions()),
            Self::InFile(stretch) => write!(f, "InFile({:?})", stretch.size),
            Self::OnDemand { size, .. } => write!(f, "OnDemand({size:?})"),
        }
    }
}

/// An image in the file of its store: rows one after the other, three bytes a pixel.
#[derive(Debug)]
struct Stretch {
    file: Arc<StoreFile>,
    offset: u64,
    size: (u32, u32),
    /// For messages.
    view: String,
}

impl From<RgbImage> for ViewImage {
    fn from(image: RgbImage) -> Self {
        Self(Pixels::InMemory(Arc::new(image)))
    }
}

impl ViewImage {
    /// An image of this width and height that `make` makes, the same one whenever it is
    /// wanted: for images that are written once, such as those of synthetic scenes.
    pub fn on_demand(
        size: (u32, u32),
        make: impl Fn() -> RgbImage + Send + Sync + 'static,
    ) -> Self {
        let make = Arc::new(make);
        Self(Pixels::OnDemand { size, make })
    }

    /// Width and height in pixels.
    pub fn dimensions(&self) -> (u32, u32) {
        match &self.0 {
            Pixels::InMemory(image) => image.dimensions(),
            Pixels::InFile(stretch) => stretch.size,
            Pixels::OnDemand { size, .. } => *size,
        }
    }

    /// Bytes of the whole image in memory.
    pub fn byte_len(&self) -> u64 {
        byte_len(self.dimensions())
    }

    /// Whether the image lies in a file.
    pub fn is_in_file(&self) -> bool {
        matches!(self.0, Pixels::InFile(_))
    }

    /// The pixel in column `x` and row `y`.
    ///
    /// # Errors
    /// If the temporary file cannot be read.
    ///
    /// # Panics
    /// If there is no such pixel.
    pub fn pixel(&self, x: u32, y: u32) -> Result<Rgb<u8>, SceneError> {
        match &self.0 {
            Pixels::InMemory(image) => Ok(*image.get_pixel(x, y)),
            Pixels::InFile(stretch) => {
                let (width, height) = stretch.size;
                assert!(
                    x < width && y < height,
                    "ViewImage::pixel: ({x}, {y}) of {width}×{height} pixels"
                );
                let index = u64::from(y) * u64::from(width) + u64::from(x);
                let mut rgb = [0; CHANNELS as usize];
                stretch.read(CHANNELS * index, &mut rgb)?;
                Ok(Rgb(rgb))
            }
            Pixels::OnDemand { make, .. } => Ok(*make().get_pixel(x, y)),
        }
    }

    /// The whole image: borrowed where it is in memory, else read or made.
    ///
    /// # Errors
    /// If the temporary file cannot be read.
    pub fn read(&self) -> Result<Cow<'_, RgbImage>, SceneError> {
        match &self.0 {
            Pixels::InMemory(image) => Ok(Cow::Borrowed(image)),
            Pixels::InFile(stretch) => {
                let (width, height) = stretch.size;
                let mut image = RgbImage::new(width, height);
                stretch.read(0, &mut image)?;
                Ok(Cow::Owned(image))
            }
            Pixels::OnDemand { make, .. } => Ok(Cow::Owned(make())),
        }
    }
}

impl Stretch {
    fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), SceneError> {
        read_exact_at(&self.file.file, bytes, self.offset + offset).map_err(|source| {
            SceneError::ImageStore {
                view: self.view.clone(),
                dir: self.file.dir.clone(),
                source,
            }
        })
    }
}

/// Where the images of a scene go while they are loaded or made.
#[derive(Clone, Debug)]
pub struct ImageStore(Option<Arc<StoreFile>>);

#[derive(Debug)]
struct StoreFile {
    /// Without a name: the system removes it when the last image is gone, however
    /// the program ends.
    file: File,
    /// Its folder, for messages.
    dir: PathBuf,
    /// Bytes that are taken.
    end: AtomicU64,
}

impl ImageStore {
    /// Keeps images in memory.
    pub fn in_memory() -> Self {
        Self(None)
    }

    /// Keeps images in a temporary file in the folder `dir`, which is created where
    /// needed.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn in_file(dir: &Path) -> Result<Self, SceneError> {
        let create = || {
            std::fs::create_dir_all(dir)?;
            tempfile::tempfile_in(dir)
        };
        let file = create().map_err(|source| SceneError::write(dir, source))?;
        Ok(Self(Some(Arc::new(StoreFile {
            file,
            dir: dir.into(),
            end: AtomicU64::new(0),
        }))))
    }

    /// For images of these sizes: in memory where `limit` leaves room for all of
    /// them ([`MemoryLimit::holds_images`]), else in a file in `dir`, or in the
    /// system's folder of temporary files where that is `None`.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn for_images(
        sizes: impl Iterator<Item = (u32, u32)>,
        limit: MemoryLimit,
        dir: Option<&Path>,
    ) -> Result<Self, SceneError> {
        let bytes = sizes.map(byte_len).fold(0, u64::saturating_add);
        if limit.holds_images(bytes) {
            return Ok(Self::in_memory());
        }
        match dir {
            Some(dir) => Self::in_file(dir),
            None => Self::in_file(&std::env::temp_dir()),
        }
    }

    /// Takes the image of the view `view`.
    ///
    /// # Errors
    /// If the temporary file cannot be written, as on a full disk.
    pub fn keep(&self, view: &str, image: RgbImage) -> Result<ViewImage, SceneError> {
        let Some(file) = &self.0 else {
            return Ok(image.into());
        };
        let offset = (file.end).fetch_add(byte_len(image.dimensions()), Ordering::Relaxed);
        write_all_at(&file.file, &image, offset).map_err(|source| SceneError::ImageStore {
            view: view.to_owned(),
            dir: file.dir.clone(),
            source,
        })?;
        Ok(ViewImage(Pixels::InFile(Arc::new(Stretch {
            file: file.clone(),
            offset,
            size: image.dimensions(),
            view: view.to_owned(),
        }))))
    }
}

fn byte_len((width, height): (u32, u32)) -> u64 {
    CHANNELS * u64::from(width) * u64::from(height)
}

#[cfg(unix)]
fn read_exact_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(unix)]
fn write_all_at(file: &File, bytes: &[u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, offset)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> io::Result<()> {
    use std::os::windows::fs::FileExt;
    while !bytes.is_empty() {
        match file.seek_read(bytes, offset)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            read => {
                bytes = &mut bytes[read..];
                offset += read as u64;
            }
        }
    }
    Ok(())
}

#[cfg(windows)]
fn write_all_at(file: &File, mut bytes: &[u8], mut offset: u64) -> io::Result<()> {
    use std::os::windows::fs::FileExt;
    while !bytes.is_empty() {
        match file.seek_write(bytes, offset)? {
            0 => return Err(io::ErrorKind::WriteZero.into()),
            written => {
                bytes = &bytes[written..];
                offset += written as u64;
            }
        }
    }
    Ok(())
}

// WebAssembly in a browser has no files: images stay in memory there.
#[cfg(not(any(unix, windows)))]
fn read_exact_at(_: &File, _: &mut [u8], _: u64) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(not(any(unix, windows)))]
fn write_all_at(_: &File, _: &[u8], _: u64) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(seed: u32, width: u32, height: u32) -> RgbImage {
        RgbImage::from_fn(width, height, |x, y| {
            let value = (x + 31 * y + 977 * seed).wrapping_mul(2_654_435_761);
            Rgb([value as u8, (value >> 8) as u8, (value >> 16) as u8])
        })
    }

    #[test]
    fn images_in_a_file_are_those_that_were_kept() {
        use rayon::prelude::*;
        let dir = tempfile::tempdir().unwrap();
        let store = ImageStore::in_file(&dir.path().join("new")).unwrap();
        let pictures: Vec<_> = (0..40).map(|i| picture(i, 5 + i % 7, 4 + i % 3)).collect();
        // From several threads: the places must not overlap.
        let images: Vec<ViewImage> = (pictures.par_iter())
            .map(|picture| store.keep("a", picture.clone()).unwrap())
            .collect();
        for (image, picture) in images.iter().zip(&pictures) {
            assert!(image.is_in_file());
            assert_eq!(image.dimensions(), picture.dimensions());
            assert_eq!(image.byte_len(), picture.as_raw().len() as u64);
            assert_eq!(*image.clone().read().unwrap(), *picture);
            for (x, y, rgb) in picture.enumerate_pixels() {
                assert_eq!(image.pixel(x, y).unwrap(), *rgb);
            }
        }
        // The images outlive the store, and the file has no name.
        drop(store);
        assert_eq!(*images[0].read().unwrap(), pictures[0]);
        #[cfg(unix)]
        assert_eq!(
            std::fs::read_dir(dir.path().join("new")).unwrap().count(),
            0
        );
    }

    #[test]
    fn images_on_demand_are_made_whenever_they_are_wanted() {
        let image = ViewImage::on_demand((7, 5), || picture(3, 7, 5));
        assert_eq!((image.dimensions(), image.byte_len()), ((7, 5), 105));
        assert!(!image.is_in_file());
        assert_eq!(*image.read().unwrap(), picture(3, 7, 5));
        assert_eq!(
            image.pixel(6, 4).unwrap(),
            *picture(3, 7, 5).get_pixel(6, 4)
        );
    }

    #[test]
    fn images_stay_in_memory_where_they_fit() {
        let dir = tempfile::tempdir().unwrap();
        let sizes = || [(100, 100); 2].into_iter();
        let kept = |limit| {
            let store = ImageStore::for_images(sizes(), limit, Some(dir.path())).unwrap();
            store.keep("a", picture(1, 100, 100)).unwrap().is_in_file()
        };
        assert!(!kept(MemoryLimit::NONE));
        assert!(!kept(MemoryLimit::of_bytes(1 << 20)));
        assert!(kept(MemoryLimit::of_bytes(60_000)));
    }

    #[test]
    fn a_folder_that_cannot_be_written_and_a_lost_file_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let occupied = dir.path().join("file");
        std::fs::write(&occupied, "x").unwrap();
        let error = ImageStore::in_file(&occupied).unwrap_err();
        assert!(error.to_string().contains("file"), "{error}");

        let store = ImageStore::in_file(dir.path()).unwrap();
        let image = store.keep("left", picture(0, 9, 9)).unwrap();
        store.0.unwrap().file.set_len(100).unwrap();
        for error in [image.read().unwrap_err(), image.pixel(8, 8).unwrap_err()] {
            assert!(error.to_string().contains("`left`"), "{error}");
        }
        assert!(image.pixel(0, 0).is_ok());
    }

    #[test]
    #[should_panic(expected = "ViewImage::pixel")]
    fn pixels_beyond_a_row_are_our_own_bug() {
        let dir = tempfile::tempdir().unwrap();
        let store = ImageStore::in_file(dir.path()).unwrap();
        let image = store.keep("a", picture(0, 9, 9)).unwrap();
        let _ = image.pixel(9, 0);
    }
}
