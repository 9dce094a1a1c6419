//! Values of Parquet columns as numbers, whatever type they are written in.

use super::blocks::Stamps;
use parquet::basic::{ConvertedType, LogicalType, Type};
use parquet::column::reader::ColumnReader;
use parquet::data_type::{ByteArray, FixedLenByteArray, Int96};
use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::schema::types::ColumnDescriptor;

/// Powers of ten and whole numbers up to these are exact in floating point.
const EXACT: (i32, u128) = (22, 1 << 53);

/// What the values of a column stand for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Kind {
    /// The numbers that they are.
    #[default]
    Plain,
    /// Whole numbers without a sign, stored as if they had one.
    Unsigned,
    /// Whole numbers of `10^-scale`.
    Decimal(i32),
}

impl Kind {
    /// Of a column; `None` where it holds no numbers.
    pub(super) fn of(c: &ColumnDescriptor) -> Option<Self> {
        let decimal = match c.logical_type_ref() {
            Some(LogicalType::Decimal(d)) => Some(d.scale),
            _ => (c.converted_type() == ConvertedType::DECIMAL).then(|| c.type_scale()),
        };
        let unsigned = match c.logical_type_ref() {
            Some(LogicalType::Integer(i)) => !i.is_signed,
            _ => matches!(c.converted_type(), ConvertedType::UINT_32 | ConvertedType::UINT_64),
        };
        match (decimal, c.physical_type()) {
            (_, Type::BOOLEAN) => None,
            (Some(scale), _) => Some(Self::Decimal(scale)),
            (None, Type::BYTE_ARRAY | Type::FIXED_LEN_BYTE_ARRAY) => None,
            (None, _) => Some(if unsigned { Self::Unsigned } else { Self::Plain }),
        }
    }
    fn int32(self, x: i32) -> f64 {
        match self {
            Self::Plain => f64::from(x),
            Self::Unsigned => f64::from(x as u32),
            Self::Decimal(scale) => decimal(x.into(), scale),
        }
    }
    fn int64(self, x: i64) -> f64 {
        match self {
            Self::Plain => x as f64,
            Self::Unsigned => x as u64 as f64,
            Self::Decimal(scale) => decimal(x.into(), scale),
        }
    }
    /// Of a whole number of bytes, the highest first; NaN where there are more than a number of 128 bits has.
    fn bytes(self, all: &[u8]) -> f64 {
        let Self::Decimal(scale) = self else { return f64::NAN };
        if all.len() > 16 {
            return f64::NAN;
        }
        let sign = all.first().map_or(0, |b| if b & 0x80 == 0 { 0 } else { -1 });
        decimal(all.iter().fold(sign, |n: i128, b| n << 8 | i128::from(*b)), scale)
    }
}

/// The nearest number to `x 10^-scale`.
fn decimal(x: i128, scale: i32) -> f64 {
    if x.unsigned_abs() <= EXACT.1 && (0..=EXACT.0).contains(&scale) {
        return x as f64 / 10_f64.powi(scale);
    }
    format!("{x}e{}", -i64::from(scale)).parse().unwrap_or(f64::NAN)
}

/// Buffers of the physical types.
#[derive(Default)]
pub(super) struct Buffers {
    int32: Vec<i32>,
    int64: Vec<i64>,
    int96: Vec<Int96>,
    float: Vec<f32>,
    bytes: Vec<ByteArray>,
    fixed: Vec<FixedLenByteArray>,
    levels: Vec<i16>,
}

/// Puts numbers where the levels say there are some, NaN elsewhere.
fn spread<T>(values: &[T], levels: &[i16], full: i16, rows: usize, to: impl Fn(&T) -> f64, out: &mut Vec<f64>) {
    if values.len() == rows {
        out.extend(values.iter().map(to));
        return;
    }
    let mut next = values.iter();
    for level in levels.iter().take(rows) {
        out.push(if *level == full { next.next().map_or(f64::NAN, &to) } else { f64::NAN });
    }
}

/// Reads `rows` values of a column as numbers; `full` is the definition level of one that is there.
pub(super) fn numbers(
    reader: &mut ColumnReader,
    (full, kind): (i16, Kind),
    rows: usize,
    b: &mut Buffers,
    out: &mut Vec<f64>,
) -> ParquetResult<usize> {
    b.levels.clear();
    macro_rules! cast {
        ($r:expr, $buffer:expr, $to:expr) => {{
            $buffer.clear();
            let (n, _, _) = $r.read_records(rows, Some(&mut b.levels), None, &mut $buffer)?;
            spread(&$buffer, &b.levels, full, n, $to, out);
            Ok(n)
        }};
    }
    match reader {
        ColumnReader::DoubleColumnReader(r) => {
            let (n, values, _) = r.read_records(rows, Some(&mut b.levels), None, out)?;
            if values < n {
                let dense = std::mem::take(out);
                spread(&dense, &b.levels, full, n, |x| *x, out);
            }
            Ok(n)
        }
        ColumnReader::FloatColumnReader(r) => cast!(r, b.float, |x| f64::from(*x)),
        ColumnReader::Int32ColumnReader(r) => cast!(r, b.int32, |x| kind.int32(*x)),
        ColumnReader::Int64ColumnReader(r) => cast!(r, b.int64, |x| kind.int64(*x)),
        ColumnReader::Int96ColumnReader(r) => cast!(r, b.int96, |x| x.to_nanos() as f64),
        ColumnReader::ByteArrayColumnReader(r) => cast!(r, b.bytes, |x| kind.bytes(x.data())),
        ColumnReader::FixedLenByteArrayColumnReader(r) => cast!(r, b.fixed, |x| kind.bytes(x.data())),
        ColumnReader::BoolColumnReader(_) => Err(ParquetError::General("a column that holds no numbers".to_owned())),
    }
}

/// Reads `rows` time stamps.
pub(super) fn stamps(
    reader: &mut ColumnReader,
    (full, kind): (i16, Kind),
    rows: usize,
    b: &mut Buffers,
    out: &mut Stamps,
) -> ParquetResult<usize> {
    b.levels.clear();
    let empty = || ParquetError::General("a row without a time".to_owned());
    let (n, values) = match reader {
        // No stamp without a sign is beyond those that have one.
        ColumnReader::Int64ColumnReader(r) if !matches!(kind, Kind::Decimal(_)) => {
            let mut whole = out.take_whole();
            let (n, values, _) = r.read_records(rows, Some(&mut b.levels), None, &mut whole)?;
            *out = Stamps::Whole(whole);
            (n, values)
        }
        ColumnReader::Int32ColumnReader(r) if kind == Kind::Plain => {
            b.int32.clear();
            let (n, values, _) = r.read_records(rows, Some(&mut b.levels), None, &mut b.int32)?;
            *out = Stamps::Whole(b.int32.iter().map(|&x| i64::from(x)).collect());
            (n, values)
        }
        ColumnReader::Int96ColumnReader(r) => {
            b.int96.clear();
            let (n, values, _) = r.read_records(rows, Some(&mut b.levels), None, &mut b.int96)?;
            *out = Stamps::Whole(b.int96.iter().map(Int96::to_nanos).collect());
            (n, values)
        }
        other => {
            let mut real = match std::mem::replace(out, Stamps::Real(Vec::new())) {
                Stamps::Real(v) => v,
                Stamps::Whole(_) => Vec::new(),
            };
            let n = numbers(other, (full, kind), rows, b, &mut real)?;
            let values = real.iter().filter(|x| !x.is_nan()).count();
            *out = Stamps::Real(real);
            (n, values)
        }
    };
    if values < n { Err(empty()) } else { Ok(n) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_and_unsigned_numbers_are_what_they_stand_for() {
        let d = Kind::Decimal(5);
        assert_eq!((d.int64(-10_734), d.int32(7), d.bytes(&[0xd6, 0x12])), (-0.10734, 7e-5, -0.10734));
        assert_eq!(Kind::Decimal(18).int64(123_456_789_012_345_678), 0.123_456_789_012_345_68);
        assert_eq!(Kind::Decimal(-2).int32(3), 300.0);
        assert_eq!((Kind::Unsigned.int32(-1), Kind::Unsigned.int64(-1)), (4_294_967_295.0, u64::MAX as f64));
    }
}
