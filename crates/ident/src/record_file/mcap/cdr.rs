//! The two messages, from CDR (OMG DDSI-RTPS 2.5, section 10; XCDR1 as ROS 2 writes it): little or big endian, numbers
//! aligned to their size from behind the four bytes of the header.

/// Most joints of a message.
const MAX_JOINTS: usize = 10_000;

/// A message being read; every getter gives `None` at its end.
struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    big: bool,
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
    fn f64(&mut self) -> Option<f64> {
        let b = self.take::<8>()?;
        Some(if self.big { f64::from_be_bytes(b) } else { f64::from_le_bytes(b) })
    }
    /// A length followed by so many bytes, the last of them zero.
    fn string(&mut self) -> Option<&'a [u8]> {
        let n = self.u32()? as usize;
        let out = self.bytes.get(self.at..self.at.checked_add(n)?)?;
        self.at += n;
        Some(out.strip_suffix(&[0]).unwrap_or(out))
    }
    fn array<const N: usize>(&mut self) -> Option<[f64; N]> {
        let mut out = [0.0; N];
        for x in &mut out {
            *x = self.f64()?;
        }
        Some(out)
    }
    /// A sequence of numbers into a buffer that is used again.
    fn sequence(&mut self, out: &mut Vec<f64>) -> Option<()> {
        out.clear();
        let n = self.u32()? as usize;
        if n == 0 {
            return Some(());
        }
        let start = self.at.checked_next_multiple_of(8)?;
        let bytes = self.bytes.get(start..start.checked_add(n.checked_mul(8)?)?)?;
        self.at = start + bytes.len();
        let numbers = bytes.chunks_exact(8).filter_map(|b| b.first_chunk::<8>());
        if self.big {
            out.extend(numbers.map(|b| f64::from_be_bytes(*b)));
        } else {
            out.extend(numbers.map(|b| f64::from_le_bytes(*b)));
        }
        Some(())
    }
    /// `std_msgs/Header`: the stamp in ns; the name of the frame is skipped.
    fn header(&mut self) -> Option<i64> {
        let (sec, nanosec) = (self.u32()?, self.u32()?);
        self.string()?;
        // Seconds are signed.
        Some(i64::from(sec.cast_signed()) * 1_000_000_000 + i64::from(nanosec))
    }
}

/// `sensor_msgs/JointState`; empty lists where it has none.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct JointState {
    /// ns.
    pub(super) stamp: i64,
    pub(super) names: Vec<String>,
    pub(super) position: Vec<f64>,
    pub(super) velocity: Vec<f64>,
    pub(super) effort: Vec<f64>,
}

impl JointState {
    pub(super) fn read(message: &[u8]) -> Option<Self> {
        let mut out = Self::default();
        out.read_again(message)?;
        Some(out)
    }
    /// Reads into the buffers of a message before, whose names are mostly the same. What is left after `None` is of no use.
    pub(super) fn read_again(&mut self, message: &[u8]) -> Option<()> {
        let mut c = Cdr::new(message)?;
        self.stamp = c.header()?;
        let n = c.u32()? as usize;
        if n > MAX_JOINTS {
            return None;
        }
        self.names.truncate(n);
        for k in 0..n {
            let name = c.string()?;
            match self.names.get_mut(k) {
                Some(old) if old.as_bytes() == name => {}
                Some(old) => *old = String::from_utf8_lossy(name).into_owned(),
                None => self.names.push(String::from_utf8_lossy(name).into_owned()),
            }
        }
        c.sequence(&mut self.position)?;
        c.sequence(&mut self.velocity)?;
        c.sequence(&mut self.effort)?;
        [&self.position, &self.velocity, &self.effort].into_iter().all(|v| v.is_empty() || v.len() == n).then_some(())
    }
}

/// `sensor_msgs/Imu`; `None` for what the sensor says it does not measure (first covariance -1).
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Imu {
    /// ns.
    pub(super) stamp: i64,
    /// Body to world, scalar first.
    pub(super) att: Option<[f64; 4]>,
    pub(super) gyro: Option<[f64; 3]>,
    pub(super) acc: Option<[f64; 3]>,
}

impl Imu {
    pub(super) fn read(message: &[u8]) -> Option<Self> {
        let mut c = Cdr::new(message)?;
        let stamp = c.header()?;
        let [x, y, z, w] = c.array()?;
        let known = |cov: [f64; 9]| cov[0] != -1.0;
        let att = known(c.array()?) && [x, y, z, w] != [0.0; 4];
        let gyro = c.array()?;
        let has_gyro = known(c.array()?);
        let acc = c.array()?;
        let has_acc = known(c.array()?);
        Some(Self {
            stamp,
            att: att.then_some([w, x, y, z]),
            gyro: has_gyro.then_some(gyro),
            acc: has_acc.then_some(acc),
        })
    }
}
