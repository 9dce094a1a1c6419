//! Arrays of NumPy: checked on the way in, made on the way out. What is wrong with one is named: type, shape, a number that is not finite,
//! layout, size.

use crate::errors::array;
use ffid::model::{Area, Problem};
use nalgebra::DMatrix;
use numpy::{
    PyArray1, PyArray2, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyReadwriteArrayDyn,
    PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

/// Most numbers of one array: 8 GiB.
const MOST: usize = 1 << 30;
/// Bits that are all set in infinities and NaN alone.
const EXPONENT: u64 = 0x7ff << 52;

fn problem(code: &'static str, name: &str, what: String) -> Problem {
    Problem::error(Area::Data, code, what).on(name)
}

/// A shape in words, such as `(1000, 7)`.
fn words(shape: &[usize]) -> String {
    let all: Vec<String> = shape.iter().map(ToString::to_string).collect();
    if shape.len() == 1 { format!("({},)", all[0]) } else { format!("({})", all.join(", ")) }
}

/// Numbers of an array in C order, held for as long as this lives.
pub(crate) struct Numbers<'py> {
    array: PyReadonlyArrayDyn<'py, f64>,
}

impl Numbers<'_> {
    pub(crate) fn as_slice(&self) -> PyResult<&[f64]> {
        self.array.as_slice().map_err(|e| array(problem("Array::Layout", "array", e.to_string())))
    }
    pub(crate) fn shape(&self) -> &[usize] {
        self.array.shape()
    }
}

/// What is wrong with the type of an object as an array of real numbers, if something is.
fn check_type(name: &str, given: &Bound<'_, PyUntypedArray>) -> PyResult<()> {
    let kind = given.dtype().kind();
    if matches!(kind, b'f' | b'i' | b'u') {
        return Ok(());
    }
    let p = problem("Array::Type", name, format!("dtype {}, real numbers (float64) needed", given.dtype().str()?));
    Err(array(p.hint("convert it with .astype(float)")))
}

/// The numbers of an array of a shape; `None` for any number of rows, at least one. Integers, other floats and layouts are converted in a
/// copy; arrays of float64 in C order are not copied.
pub(crate) fn numbers<'py>(name: &str, given: &Bound<'py, PyAny>, shape: &[Option<usize>]) -> PyResult<Numbers<'py>> {
    let numbers = numbers_or_nan(name, given, shape)?;
    finite(name, &numbers)?;
    Ok(numbers)
}

/// [`numbers`] that need not be finite.
pub(crate) fn numbers_or_nan<'py>(
    name: &str,
    given: &Bound<'py, PyAny>,
    shape: &[Option<usize>],
) -> PyResult<Numbers<'py>> {
    let py = given.py();
    let numpy = py.import("numpy")?;
    let any = numpy.call_method1("asarray", (given,)).map_err(|e| {
        let p = problem("Array::Type", name, format!("not an array: {e}"));
        array(p.hint("give a rectangular array of numbers"))
    })?;
    let untyped = any.cast::<PyUntypedArray>().map_err(PyErr::from)?;
    check_type(name, untyped)?;
    let found = untyped.shape().to_vec();
    let fits = found.len() == shape.len() && found.iter().zip(shape).all(|(n, want)| want.is_none_or(|w| w == *n));
    if !fits {
        let wanted: Vec<String> = shape.iter().map(|n| n.map_or_else(|| "N".to_owned(), |n| n.to_string())).collect();
        let wanted = if wanted.len() == 1 { format!("({},)", wanted[0]) } else { format!("({})", wanted.join(", ")) };
        let p = problem("Array::Shape", name, format!("shape {}, needed {wanted}", words(&found)));
        return Err(array(p.hint("rows are samples, columns are channels")));
    }
    let size = found.iter().try_fold(1_usize, |n, k| n.checked_mul(*k)).unwrap_or(usize::MAX);
    if size == 0 && !shape.contains(&Some(0)) {
        return Err(array(
            problem("Array::Empty", name, format!("shape {}, no numbers", words(&found))).hint("give one row or more"),
        ));
    }
    if size > MOST {
        let p = problem("Array::TooLarge", name, format!("{size} numbers, limit {MOST}"));
        return Err(array(p.hint("pass it in parts")));
    }
    let plain = numpy.call_method1("ascontiguousarray", (untyped, "float64"))?;
    let plain = plain.cast::<PyArrayDyn<f64>>().map_err(PyErr::from)?;
    let held = plain.try_readonly().map_err(|_| {
        array(
            problem("Array::Overlap", name, "is being written by another call".into())
                .hint("give each call arrays of its own"),
        )
    })?;
    let numbers = Numbers { array: held };
    numbers.as_slice()?;
    Ok(numbers)
}

/// Whether no number is infinite or NaN. Over bits and without a branch, so that the look at all numbers goes in lanes.
pub(crate) fn all_finite(x: &[f64]) -> bool {
    !x.iter().fold(false, |bad, x| bad | (x.to_bits() & EXPONENT == EXPONENT))
}

/// Refuses numbers that are not finite, with the place of the first.
pub(crate) fn finite(name: &str, numbers: &Numbers<'_>) -> PyResult<()> {
    let (x, found) = (numbers.as_slice()?, numbers.shape());
    let bad = !all_finite(x);
    if let Some(i) = x.iter().position(|x| !x.is_finite()).filter(|_| bad) {
        let x = x[i];
        let (mut rest, mut at) = (i, Vec::new());
        for n in found.iter().rev() {
            at.push(rest % n);
            rest /= n;
        }
        at.reverse();
        let p = problem("Array::NotFinite", name, format!("value {x} at {}, finite numbers needed", words(&at)));
        return Err(array(p.hint("leave out the samples that have none")));
    }
    Ok(())
}

/// [`numbers`] of what may be absent.
pub(crate) fn maybe<'py>(
    name: &str,
    given: Option<&Bound<'py, PyAny>>,
    shape: &[Option<usize>],
) -> PyResult<Option<Numbers<'py>>> {
    given.filter(|g| !g.is_none()).map(|g| numbers(name, g, shape)).transpose()
}

/// The array that results are written into: float64, C order, writable, of this shape.
pub(crate) fn writable<'py>(given: &Bound<'py, PyAny>, shape: &[usize]) -> PyResult<PyReadwriteArrayDyn<'py, f64>> {
    let wrong = |code, what: String, hint: &str| array(problem(code, "out", what).hint(hint));
    let Ok(untyped) = given.cast::<PyUntypedArray>() else {
        return Err(wrong("Array::Type", "not a NumPy array".into(), "give numpy.empty(shape)"));
    };
    if untyped.shape() != shape {
        let what = format!("shape {}, needed {}", words(untyped.shape()), words(shape));
        return Err(wrong("Array::Shape", what, "give numpy.empty of the needed shape"));
    }
    let Ok(plain) = given.cast::<PyArrayDyn<f64>>() else {
        let what = format!("dtype {}, float64 needed", untyped.dtype().str()?);
        return Err(wrong("Array::Type", what, "give an array of float64"));
    };
    if !plain.is_c_contiguous() {
        return Err(wrong(
            "Array::Layout",
            "not contiguous in C order".into(),
            "give a fresh array, not a view of columns",
        ));
    }
    plain.try_readwrite().map_err(|e| match e {
        numpy::BorrowError::NotWriteable => {
            wrong("Array::ReadOnly", "read-only".into(), "give an array that can be written")
        }
        _ => wrong(
            "Array::Overlap",
            "overlaps an argument, or is used by another call".into(),
            "give an array of its own",
        ),
    })
}

/// Rows of numbers as a matrix.
pub(crate) fn matrix(x: &Numbers<'_>) -> PyResult<DMatrix<f64>> {
    let shape = x.shape();
    Ok(DMatrix::from_row_slice(shape[0], shape[1], x.as_slice()?))
}

/// A matrix as an array in C order.
pub(crate) fn array2<'py>(py: Python<'py>, m: &DMatrix<f64>) -> PyResult<Bound<'py, PyArray2<f64>>> {
    table(py, m.transpose().as_slice().to_vec(), [m.nrows(), m.ncols()])
}

/// Numbers row by row as an array.
pub(crate) fn table<'py>(py: Python<'py>, x: Vec<f64>, shape: [usize; 2]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_vec(py, x).reshape(shape)
}
