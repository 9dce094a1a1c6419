//! The messages, from CDR (OMG DDSI-RTPS 2.5, section 10; XCDR1 as ROS 2 writes it): little or big endian, numbers
//! aligned to their size from behind the four bytes of the header.

use super::message::{Imu, JointState, Wrench};
use crate::file::dates::SECOND;

/// Most joints of a message.
const MAX_JOINTS: usize = 10_000;

/// A message being read; every getter gives `None` at its end.
struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    big: bool,
}

/// Numbers side by side.
struct Numbers<'a> {
    bytes: &'a [[u8; 8]],
    big: bool,
}

impl Numbers<'_> {
    fn get(&self, k: usize) -> f64 {
        let b = self.bytes[k];
        if self.big { f64::from_be_bytes(b) } else { f64::from_le_bytes(b) }
    }
    fn array<const N: usize>(&self, first: usize) -> [f64; N] {
        core::array::from_fn(|k| self.get(first + k))
    }
}

impl<'a> Cdr<'a> {
    fn new(message: &'a [u8]) -> Option<Self> {
        // Plain CDR, big or little endian; other encodings are of types with optional members, which these are not.
        let big = match message.get(..4)? {
            [0, 0, ..] => true,
            [0, 1, ..] => false,
            _ => return None,
        };
        Some(Self { bytes: &message[4..], at: 0, big })
    }
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let at = self.at.checked_next_multiple_of(N)?;
        let out = self.bytes.get(at..)?.first_chunk::<N>()?;
        self.at = at + N;
        Some(*out)
    }
    fn u32(&mut self) -> Option<u32> {
        let b = self.take::<4>()?;
        Some(if self.big { u32::from_be_bytes(b) } else { u32::from_le_bytes(b) })
    }
    /// A length followed by so many bytes, the last of them zero.
    fn string(&mut self) -> Option<&'a [u8]> {
        let n = self.u32()? as usize;
        let out = self.bytes.get(self.at..self.at.checked_add(n)?)?;
        self.at += n;
        Some(out.strip_suffix(&[0]).unwrap_or(out))
    }
    /// So many numbers, as they are in the message.
    fn numbers(&mut self, n: usize) -> Option<Numbers<'a>> {
        let start = self.at.checked_next_multiple_of(8)?;
        let bytes = self.bytes.get(start..start.checked_add(n.checked_mul(8)?)?)?;
        self.at = start + bytes.len();
        Some(Numbers { bytes: bytes.as_chunks().0, big: self.big })
    }
    /// A sequence of numbers into a buffer that is used again.
    fn sequence(&mut self, out: &mut Vec<f64>) -> Option<()> {
        out.clear();
        let n = self.u32()? as usize;
        if n == 0 {
            return Some(());
        }
        let numbers = self.numbers(n)?;
        out.extend((0..n).map(|k| numbers.get(k)));
        Some(())
    }
    /// `std_msgs/Header`: the stamp in ns, and the name of the frame.
    fn header(&mut self) -> Option<(i64, &'a [u8])> {
        let (sec, nanosec) = (self.u32()?, self.u32()?);
        let frame = self.string()?;
        // Seconds are signed.
        Some((i64::from(sec.cast_signed()) * SECOND + i64::from(nanosec), frame))
    }
}

impl JointState {
    /// Reads into the buffers of a message before. What is left after `None` is of no use.
    pub(super) fn read_cdr(&mut self, message: &[u8]) -> Option<()> {
        let mut c = Cdr::new(message)?;
        (self.stamp, _) = c.header()?;
        self.read_names(&mut c)?;
        c.sequence(&mut self.position)?;
        c.sequence(&mut self.velocity)?;
        c.sequence(&mut self.effort)
    }
    fn read_names(&mut self, c: &mut Cdr<'_>) -> Option<()> {
        let (begin, same) = (c.at, self.image.len());
        let of = (begin % 4, c.big);
        if same > 0 && of == self.image_of && c.bytes.get(begin..begin.checked_add(same)?) == Some(&self.image[..]) {
            c.at += same;
            return Some(());
        }
        let n = c.u32()? as usize;
        if n > MAX_JOINTS {
            return None;
        }
        self.image.clear();
        self.version += 1;
        self.names.clear();
        for _ in 0..n {
            self.names.push(String::from_utf8_lossy(c.string()?).into_owned());
        }
        self.image.extend_from_slice(&c.bytes[begin..c.at]);
        self.image_of = of;
        Some(())
    }
}

impl Imu {
    pub(super) fn read_cdr(message: &[u8]) -> Option<Self> {
        let mut c = Cdr::new(message)?;
        let (stamp, _) = c.header()?;
        // Orientation, angular velocity and acceleration, each with nine covariances behind it.
        let all = c.numbers(4 + 9 + 3 + 9 + 3 + 9)?;
        let known = |covariance: usize| all.get(covariance) != -1.0;
        let [x, y, z, w] = all.array(0);
        let att = known(4) && [x, y, z, w] != [0.0; 4];
        Some(Self {
            stamp,
            att: att.then_some([w, x, y, z]),
            gyro: known(16).then(|| all.array(13)),
            acc: known(28).then(|| all.array(25)),
        })
    }
}

impl Wrench {
    pub(super) fn read_cdr(message: &[u8]) -> Option<Self> {
        let mut c = Cdr::new(message)?;
        let (stamp, frame) = c.header()?;
        let frame = String::from_utf8_lossy(frame).into_owned();
        Some(Self { stamp, frame, numbers: c.numbers(6)?.array(0) })
    }
}
