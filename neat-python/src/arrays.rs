//! Between numpy's arrays and ours.

use crate::errors::Failure;
use image::RgbImage;
use nalgebra::Vector3;
use numpy::ndarray::{Array, Dimension, IntoDimension};
use numpy::{Element, PyArray, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// An array of this shape that Python can only read: to change it would not change what it
/// shows.
///
/// # Panics
/// If there are not as many values.
pub fn read_only<'py, T: Element, D: IntoDimension>(
    py: Python<'py>,
    shape: D,
    values: Vec<T>,
) -> Bound<'py, PyArray<T, D::Dim>>
where
    D::Dim: Dimension,
{
    let array = Array::from_shape_vec(shape.into_dimension(), values)
        .expect("arrays::read_only: values of the shape");
    let array = PyArray::from_owned_array(py, array);
    (*array.readwrite().make_nonwriteable()).clone()
}

/// Numbers of anything that numpy takes for an array (lists, arrays, tensors on the CPU), or
/// that speaks DLPack.
pub fn numbers<'py>(object: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let numpy = object.py().import("numpy")?;
    let is_foreign = object.hasattr("__dlpack__")? && !object.hasattr("__array__")?;
    let array = match is_foreign {
        true => &numpy.call_method1("from_dlpack", (object,))?,
        false => object,
    };
    let array = numpy.call_method1("ascontiguousarray", (array, "float64"))?;
    array.extract()
}

/// The same with `columns` numbers in each row; `name` is for messages.
pub fn rows<const N: usize>(object: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<[f64; N]>> {
    let array = numbers(object)?;
    let shape = array.shape();
    // numpy gives an empty list the shape (0,).
    if array.len() > 0 && !matches!(shape, [_, columns] if *columns == N) {
        return Err(
            Failure::input(format!("{name} has the shape {shape:?}: give (N, {N})")).into(),
        );
    }
    Ok(array.as_slice()?.as_chunks().0.to_vec())
}

/// Points in space.
pub fn points(object: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<Vector3<f64>>> {
    Ok(rows::<3>(object, name)?
        .into_iter()
        .map(Vector3::from)
        .collect())
}

/// An image: height × width × 3 bytes.
pub fn rgb_image(object: &Bound<'_, PyAny>, name: &str) -> PyResult<RgbImage> {
    let numpy = object.py().import("numpy")?;
    let array = numpy.call_method1("ascontiguousarray", (object,))?;
    let wrong = || -> PyResult<PyErr> {
        let (kind, shape) = (array.getattr("dtype")?, array.getattr("shape")?);
        Ok(Failure::input(format!(
            "{name} is {kind} of the shape {shape}: give uint8 of the shape (height, width, 3), red first"
        ))
        .into())
    };
    let Ok(pixels) = array.extract::<PyReadonlyArrayDyn<'_, u8>>() else {
        return Err(wrong()?);
    };
    let &[height, width, 3] = pixels.shape() else {
        return Err(wrong()?);
    };
    let size = u32::try_from(width).ok().zip(u32::try_from(height).ok());
    match size.and_then(|(width, height)| {
        RgbImage::from_raw(width, height, pixels.as_slice().ok()?.to_vec())
    }) {
        Some(image) if width > 0 && height > 0 => Ok(image),
        _ => Err(wrong()?),
    }
}
