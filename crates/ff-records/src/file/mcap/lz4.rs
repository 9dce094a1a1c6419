//! LZ4 frames (<https://github.com/lz4/lz4/blob/dev/doc/lz4_Frame_format.md>) unpacked where they are wanted.
//!
//! The reader of `lz4_flex` goes through a window of its own, which costs as much as the unpacking. Frames as recorders write them
//! are a head, blocks and an end; those with a dictionary or checksums are left to that reader. What was unpacked has
//! the checksum of its chunk.

use lz4_flex::block;
use lz4_flex::block::DecompressError;
use std::io::Read;

const MAGIC: u32 = 0x184D_2204;
/// Flags of the second byte: version 1 in the upper two bits.
const VERSION: (u8, u8) = (0b1100_0000, 0b0100_0000);
const INDEPENDENT: u8 = 1 << 5;
const BLOCK_CHECKSUM: u8 = 1 << 4;
const CONTENT_SIZE: u8 = 1 << 3;
const OTHERS: u8 = BLOCK_CHECKSUM | 1 << 2 | 1 << 1 | 1;
/// How far back a match may reach (bytes).
const WINDOW: usize = 1 << 16;
/// A block that is not compressed.
const PLAIN: u32 = 1 << 31;

/// Most bytes that these can be unpacked to: a byte of a length stands for 255 of them.
pub(super) fn most(packed: &[u8]) -> u64 {
    255 * packed.len() as u64
}

/// Unpacks `packed` to `out`: how many bytes there were, one more than fit where there were more.
///
/// # Errors
/// What is wrong with the frame.
pub(super) fn unpack(packed: &[u8], out: &mut [u8]) -> Result<usize, String> {
    let Some((mut blocks, independent)) = head(packed) else {
        return slowly(packed, out);
    };
    let mut at = 0;
    loop {
        let (size, rest) = blocks.split_first_chunk().ok_or("the frame ends within a block")?;
        let size = u32::from_le_bytes(*size);
        if size == 0 {
            return Ok(at);
        }
        let (content, rest) =
            rest.split_at_checked((size & !PLAIN) as usize).ok_or("a block is longer than its frame")?;
        blocks = rest;
        let (before, to) = out.split_at_mut(at);
        at += if size & PLAIN != 0 {
            let Some(to) = to.get_mut(..content.len()) else { return Ok(out.len() + 1) };
            to.copy_from_slice(content);
            content.len()
        } else {
            let done = if independent {
                block::decompress_into(content, to)
            } else {
                block::decompress_into_with_dict(content, to, &before[at.saturating_sub(WINDOW)..])
            };
            match done {
                Ok(n) => n,
                Err(DecompressError::OutputTooSmall { .. }) => return Ok(out.len() + 1),
                Err(e) => return Err(e.to_string()),
            }
        };
    }
}

/// The blocks of a frame of the usual kind, and whether they are independent.
fn head(packed: &[u8]) -> Option<(&[u8], bool)> {
    let (magic, rest) = packed.split_first_chunk()?;
    let (&[flags, _], rest) = rest.split_first_chunk()?;
    if u32::from_le_bytes(*magic) != MAGIC || flags & VERSION.0 != VERSION.1 || flags & OTHERS != 0 {
        return None;
    }
    let size = if flags & CONTENT_SIZE != 0 { 8 } else { 0 };
    // Then one byte of checksum of the head.
    Some((rest.get(size + 1..)?, flags & INDEPENDENT != 0))
}

/// The same through the reader of the crate, for every kind of frame.
fn slowly(packed: &[u8], out: &mut [u8]) -> Result<usize, String> {
    let mut reader = lz4_flex::frame::FrameDecoder::new(packed);
    let mut read = || -> std::io::Result<usize> {
        let mut at = 0;
        while at < out.len() {
            match reader.read(&mut out[at..])? {
                0 => return Ok(at),
                n => at += n,
            }
        }
        Ok(at + reader.read(&mut [0])?)
    };
    read().map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lz4_flex::frame::{BlockMode, BlockSize, FrameEncoder, FrameInfo};
    use std::io::Write;

    fn text(n: usize) -> Vec<u8> {
        // Repeats near and far, and some that does not compress.
        let mut seed = 7_u64;
        let mut next = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 40) as u8
        };
        let noise: Vec<u8> = (0..n).map(|_| next()).collect();
        (0..n).map(|i| if i / 700 % 3 == 0 { noise[i] } else { noise[i / 9 % 50_000] ^ (i / 70_000) as u8 }).collect()
    }
    fn packed(bytes: &[u8], info: FrameInfo) -> Vec<u8> {
        let mut e = FrameEncoder::with_frame_info(info, Vec::new());
        e.write_all(bytes).unwrap();
        e.finish().unwrap()
    }

    #[test]
    fn frames_of_every_kind_unpack_to_what_was_packed() {
        let want = text(400_000);
        for mode in [BlockMode::Independent, BlockMode::Linked] {
            for size in [BlockSize::Max64KB, BlockSize::Max1MB] {
                let plain = || FrameInfo::new().block_mode(mode).block_size(size);
                let usual = [plain(), plain().content_size(Some(want.len() as u64))];
                let checked = [plain().block_checksums(true), plain().content_checksum(true)];
                for (info, fast) in usual.into_iter().map(|i| (i, true)).chain(checked.into_iter().map(|i| (i, false)))
                {
                    let frame = packed(&want, info);
                    assert_eq!(head(&frame).is_some(), fast);
                    let mut out = vec![1; want.len()];
                    assert_eq!(unpack(&frame, &mut out), Ok(want.len()));
                    assert!(out == want);
                    // A frame that has more or less than there should be.
                    let mut long = vec![1; want.len() + 9];
                    assert_eq!(unpack(&frame, &mut long), Ok(want.len()));
                    let mut short = vec![1; want.len() - 9];
                    assert_eq!(unpack(&frame, &mut short), Ok(short.len() + 1));
                }
            }
        }
    }

    #[test]
    fn no_damage_makes_it_panic() {
        let want = text(3000);
        let good = packed(&want, FrameInfo::new().block_mode(BlockMode::Linked));
        let mut out = vec![0; want.len()];
        for at in 0..good.len() {
            let _ = unpack(&good[..at], &mut out);
            for bit in [1, 8, 64, 128] {
                let mut bad = good.clone();
                bad[at] ^= bit;
                let _ = unpack(&bad, &mut out);
            }
        }
    }
}
