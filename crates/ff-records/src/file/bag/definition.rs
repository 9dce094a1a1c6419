//! Definitions of messages as a bag holds them (`.msg` files with those they name behind them, between lines of `=`), and messages read
//! by them.
//!
//! A message is known by the names of its fields, whatever its package calls it: what a package adds to `sensor_msgs/JointState` is
//! stepped over.

use crate::file::dates::SECOND;

/// A time as ROS 1 writes it (ns).
pub(super) fn stamp(b: [u8; 8]) -> i64 {
    let [a, b, c, d, e, f, g, h] = b;
    let (sec, nsec) = (u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h]));
    i64::from(sec) * SECOND + i64::from(nsec)
}

/// Deepest nesting of types.
const DEEPEST: usize = 16;
/// Most fields of a type, those of its parts counted.
const MAX_FIELDS: usize = 4096;

/// A number, as it is in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "bool" | "uint8" | "char" => Self::U8,
            "int8" | "byte" => Self::I8,
            "int16" => Self::I16,
            "uint16" => Self::U16,
            "int32" => Self::I32,
            "uint32" => Self::U32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "float32" => Self::F32,
            "float64" => Self::F64,
            _ => return None,
        })
    }
    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
    /// Its value, of the first bytes.
    fn get(self, b: &[u8]) -> Option<f64> {
        Some(match self {
            Self::I8 => f64::from(b.first()?.cast_signed()),
            Self::U8 => f64::from(*b.first()?),
            Self::I16 => f64::from(i16::from_le_bytes(*b.first_chunk()?)),
            Self::U16 => f64::from(u16::from_le_bytes(*b.first_chunk()?)),
            Self::I32 => f64::from(i32::from_le_bytes(*b.first_chunk()?)),
            Self::U32 => f64::from(u32::from_le_bytes(*b.first_chunk()?)),
            Self::I64 => i64::from_le_bytes(*b.first_chunk()?) as f64,
            Self::U64 => u64::from_le_bytes(*b.first_chunk()?) as f64,
            Self::F32 => f64::from(f32::from_le_bytes(*b.first_chunk()?)),
            Self::F64 => f64::from_le_bytes(*b.first_chunk()?),
        })
    }
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    Number(Number),
    Text,
    /// Seconds and nanoseconds.
    Time,
    /// So many of them, or as many as a number before them says.
    Several(Box<Kind>, Option<usize>),
    /// Fields of another type, one behind the other.
    Parts(Vec<Field>),
}

#[derive(Clone, Debug, PartialEq)]
struct Field {
    /// Path from the message, `header.stamp`; empty inside of lists.
    path: String,
    kind: Kind,
}

/// How messages of a type are laid out.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Layout(Vec<Field>);

/// What a field holds.
#[derive(Clone, Copy, Debug)]
pub(super) enum Value<'a> {
    Number(f64),
    /// ns.
    Time(i64),
    Text(&'a [u8]),
    /// A list of numbers: bytes, what they are, and how many.
    Numbers(&'a [u8], Number),
    /// A list of texts: bytes, each behind its length.
    Texts(&'a [u8]),
}

impl Value<'_> {
    /// The numbers of a list into a buffer; `None` for what is no list of numbers.
    pub(super) fn numbers(self, out: &mut Vec<f64>) -> Option<()> {
        out.clear();
        let Value::Numbers(bytes, number) = self else { return None };
        out.extend(bytes.chunks_exact(number.size()).filter_map(|b| number.get(b)));
        Some(())
    }
    /// The texts of a list.
    pub(super) fn texts(self) -> Option<Vec<String>> {
        let Value::Texts(mut bytes) = self else { return None };
        let mut out = Vec::new();
        while let Some((n, rest)) = bytes.split_first_chunk::<4>() {
            let (text, rest) = rest.split_at_checked(u32::from_le_bytes(*n) as usize)?;
            out.push(String::from_utf8_lossy(text).into_owned());
            bytes = rest;
        }
        Some(out)
    }
}

impl Layout {
    /// Of a definition; `None` where it does not make sense.
    pub(super) fn new(definition: &str) -> Option<Self> {
        let mut types: Vec<(&str, Vec<&str>)> = vec![("", Vec::new())];
        for line in definition.lines() {
            let line = line.trim();
            if line.len() > 3 && line.bytes().all(|b| b == b'=') {
                types.push(("", Vec::new()));
            } else if let (Some(name), Some(last)) = (line.strip_prefix("MSG:"), types.last_mut()) {
                last.0 = name.trim();
            } else if let Some(last) = types.last_mut() {
                last.1.push(line);
            }
        }
        let mut left = MAX_FIELDS;
        let (_, main) = types.first()?;
        Some(Self(fields(main, "", &types, DEEPEST, &mut left)?))
    }
    /// Whether it has a field of this path.
    pub(super) fn has(&self, path: &str) -> bool {
        let mut found = false;
        each(&self.0, &mut |f| found |= f.path == path);
        found
    }
    /// Hands every field of a message to `visit`; `None` for a message that is cut short.
    pub(super) fn read<'a>(&self, message: &'a [u8], visit: &mut dyn FnMut(&str, Value<'a>)) -> Option<()> {
        let mut rest = message;
        read(&self.0, &mut rest, &mut Some(visit))
    }
}

fn each(fields: &[Field], visit: &mut dyn FnMut(&Field)) {
    for f in fields {
        visit(f);
        if let Kind::Parts(parts) = &f.kind {
            each(parts, visit);
        }
    }
}

/// Fields of a type from its lines.
fn fields(
    lines: &[&str],
    path: &str,
    types: &[(&str, Vec<&str>)],
    deeper: usize,
    left: &mut usize,
) -> Option<Vec<Field>> {
    let deeper = deeper.checked_sub(1)?;
    let mut out = Vec::new();
    for line in lines {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_whitespace();
        let Some(of) = words.next() else { continue };
        let name = words.next()?;
        // Constants are not in messages. `X=1` and `X = 1`.
        if name.contains('=') || words.next().is_some_and(|w| w.starts_with('=')) {
            continue;
        }
        *left = left.checked_sub(1)?;
        let path = if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
        let (of, list) = match of.strip_suffix(']').and_then(|o| o.rsplit_once('[')) {
            Some((of, "")) => (of, Some(None)),
            Some((of, n)) => (of, Some(Some(n.parse::<usize>().ok()?))),
            None => (of, None),
        };
        let mut kind = match of {
            "string" => Kind::Text,
            "time" | "duration" => Kind::Time,
            _ => match Number::of(of) {
                Some(n) => Kind::Number(n),
                None => {
                    let inner = if list.is_some() { "" } else { &path };
                    Kind::Parts(fields(named(of, types)?, inner, types, deeper, left)?)
                }
            },
        };
        if let Some(n) = list {
            kind = Kind::Several(Box::new(kind), n);
        }
        out.push(Field { path, kind });
    }
    Some(out)
}

/// Lines of a type by its name, with or without its package.
fn named<'a>(name: &str, types: &'a [(&str, Vec<&'a str>)]) -> Option<&'a [&'a str]> {
    let short = |n: &str| n.rsplit('/').next().map(str::to_owned);
    let behind = || types.iter().skip(1);
    let exact = behind().find(|t| t.0 == name);
    exact.or_else(|| behind().find(|t| short(t.0) == short(name))).map(|t| &t.1[..])
}

fn take<'a>(rest: &mut &'a [u8], n: usize) -> Option<&'a [u8]> {
    let (out, more) = rest.split_at_checked(n)?;
    *rest = more;
    Some(out)
}

fn length(rest: &mut &[u8]) -> Option<usize> {
    Some(u32::from_le_bytes(*take(rest, 4)?.first_chunk()?) as usize)
}

type Visit<'v, 'a> = Option<&'v mut dyn FnMut(&str, Value<'a>)>;

/// Steps over the fields of a message, and hands over those outside of lists of other types.
fn read<'a>(fields: &[Field], rest: &mut &'a [u8], visit: &mut Visit<'_, 'a>) -> Option<()> {
    for f in fields {
        let value = match &f.kind {
            Kind::Parts(parts) => {
                read(parts, rest, visit)?;
                continue;
            }
            Kind::Number(n) => Value::Number(n.get(take(rest, n.size())?)?),
            Kind::Time => Value::Time(stamp(*take(rest, 8)?.first_chunk()?)),
            Kind::Text => {
                let n = length(rest)?;
                Value::Text(take(rest, n)?)
            }
            Kind::Several(of, n) => {
                let n = match n {
                    Some(n) => *n,
                    None => length(rest)?,
                };
                match &**of {
                    Kind::Number(number) => Value::Numbers(take(rest, n.checked_mul(number.size())?)?, *number),
                    Kind::Text => {
                        let all = *rest;
                        for _ in 0..n {
                            let n = length(rest)?;
                            take(rest, n)?;
                        }
                        Value::Texts(&all[..all.len() - rest.len()])
                    }
                    Kind::Time => {
                        take(rest, n.checked_mul(8)?)?;
                        continue;
                    }
                    Kind::Parts(parts) => {
                        for _ in 0..n {
                            let before = rest.len();
                            read(parts, rest, &mut None)?;
                            // Parts without content are the same however many they are.
                            if rest.len() == before {
                                break;
                            }
                        }
                        continue;
                    }
                    // Lists of lists do not exist.
                    Kind::Several(..) => return None,
                }
            }
        };
        if let Some(visit) = visit {
            visit(&f.path, value);
        }
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_found_by_name_and_the_others_stepped_over() {
        let text = "# a comment\nuint8 MODE=3\nint32 LAST = 7 # not a field\nHeader header\nPoint[] path\nstring[] name\nfloat32[2] pair\n\
                    other_pkg/Point at\n================\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n\
                    ====\nMSG: other_pkg/Point\nfloat64 x\nint16 y\n";
        let layout = Layout::new(text).unwrap();
        assert!(layout.has("header.stamp") && layout.has("at.x") && !layout.has("MODE") && !layout.has("path.x"));
        let mut m = Vec::new();
        m.extend(5u32.to_le_bytes());
        m.extend([3u32.to_le_bytes(), 400u32.to_le_bytes(), 2u32.to_le_bytes()].concat());
        m.extend(b"ab");
        m.extend(2u32.to_le_bytes()); // two points
        for k in 0..2 {
            m.extend(f64::from(k).to_le_bytes());
            m.extend(7i16.to_le_bytes());
        }
        m.extend([1u32.to_le_bytes(), 3u32.to_le_bytes()].concat());
        m.extend(b"arm");
        m.extend([1.5f32.to_le_bytes(), (-2.0f32).to_le_bytes()].concat());
        m.extend(4.25f64.to_le_bytes());
        m.extend((-3i16).to_le_bytes());
        let mut seen = Vec::new();
        layout.read(&m, &mut |path, v| seen.push((path.to_owned(), format!("{v:?}")))).unwrap();
        let of = |p: &str| seen.iter().find(|s| s.0 == p).map(|s| s.1.clone()).unwrap();
        assert_eq!(of("header.stamp"), "Time(3000000400)");
        assert_eq!((of("at.x"), of("at.y")), ("Number(4.25)".into(), "Number(-3.0)".into()));
        let mut pair = Vec::new();
        layout
            .read(&m, &mut |path, v| {
                if path == "pair" {
                    v.numbers(&mut pair).unwrap();
                }
                if path == "name" {
                    assert_eq!(v.texts().unwrap(), ["arm"]);
                }
            })
            .unwrap();
        assert_eq!(pair, [1.5, -2.0]);
        assert!((0..m.len()).all(|n| layout.read(&m[..n], &mut |_, _| ()).is_none()));
        // A type that holds itself, and one that is not there.
        assert!(Layout::new("A a\n===\n").is_none());
        assert!(Layout::new("A a\n=====\nMSG: p/A\nA a\n").is_none());
    }
}
