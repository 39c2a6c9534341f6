//! Frames for what is stored or sent off the hot path: checkpoints, recordings. The only module that names bincode.
//!
//! A frame is a header of 24 bytes, all little-endian, and a payload:
//!
//! | offset | bytes | holds                                                        |
//! |-------:|------:|--------------------------------------------------------------|
//! |      0 |     8 | magic `INEKFRM` and a zero                                   |
//! |      8 |     4 | version of the frame and of the encoding, [`FRAME_VERSION`]  |
//! |     12 |     4 | kind of the payload, chosen by the caller                    |
//! |     16 |     4 | length of the payload, bytes, at most [`MAX_PAYLOAD_LEN`]    |
//! |     20 |     4 | CRC-32 (IEEE) of bytes 8 to 20 and of the payload            |
//!
//! The payload is bincode with fixed-width little-endian integers: a message's fields one after the other as they lie
//! in memory, floats bit for bit. Decoding never panics and never allocates more than [`MAX_PAYLOAD_LEN`] asks for,
//! whatever the bytes.

use bincode::config::{Configuration, Fixint, Limit, LittleEndian};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// First bytes of every frame.
pub const FRAME_MAGIC: [u8; 8] = *b"INEKFRM\0";

/// Version of the frame and of the encoding of its payload.
pub const FRAME_VERSION: u32 = 1;

/// Bytes before the payload.
pub const FRAME_HEADER_LEN: usize = 24;

/// Longest payload, bytes.
pub const MAX_PAYLOAD_LEN: usize = 16 * 1024 * 1024;

/// Kind of a frame: a checkpoint of the daemon.
pub const FRAME_CHECKPOINT: u32 = 1;
/// Kind of a frame: the beginning of a recording.
pub const FRAME_RECORDING: u32 = 2;
/// Kind of a frame: an entry of the journal in a recording.
pub const FRAME_ENTRY: u32 = 3;
/// Kind of a frame: an estimate in a recording.
pub const FRAME_ESTIMATE: u32 = 4;

const CONFIG: Configuration<LittleEndian, Fixint, Limit<MAX_PAYLOAD_LEN>> =
    bincode::config::standard()
        .with_fixed_int_encoding()
        .with_limit::<MAX_PAYLOAD_LEN>();

/// Why a value or a frame was refused.
///
/// ```
/// use inekf_shared::codec::{CodecError, FRAME_CHECKPOINT, decode, encode};
///
/// let mut frame = encode(FRAME_CHECKPOINT, &7_u64)?;
/// // Cut short, and changed on the way: two faults of two names.
/// assert!(matches!(
///     decode::<u64>(FRAME_CHECKPOINT, &frame[..30]),
///     Err(CodecError::TooShort { found: 30, needed: 32 })
/// ));
/// frame[25] ^= 1;
/// assert!(matches!(decode::<u64>(FRAME_CHECKPOINT, &frame), Err(CodecError::Damaged { .. })));
/// # Ok::<(), CodecError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CodecError {
    /// There are fewer bytes than the header has, or than the header announces.
    #[error("the frame is cut short: {found} bytes of {needed}")]
    TooShort {
        /// Bytes there are.
        found: usize,
        /// Bytes there must be.
        needed: usize,
    },
    /// It does not begin like a frame.
    #[error("this is no frame: it does not begin with the magic bytes")]
    WrongMagic,
    /// It is a frame of another version.
    #[error("the frame has version {found}, this program reads version {FRAME_VERSION}")]
    WrongVersion {
        /// Version of the frame.
        found: u32,
    },
    /// It holds something else.
    #[error("the frame holds kind {found}, expected was kind {expected}")]
    WrongKind {
        /// Kind of the frame.
        found: u32,
        /// Kind that was asked for.
        expected: u32,
    },
    /// The payload is longer than a frame may hold.
    #[error("the payload has {len} bytes, a frame holds at most {MAX_PAYLOAD_LEN}")]
    TooLong {
        /// Length of the payload; when encoding, the least it would have.
        len: usize,
    },
    /// The bytes were changed after they were written.
    #[error("the frame is damaged: its checksum is {found:08x}, the bytes give {computed:08x}")]
    Damaged {
        /// Checksum in the frame.
        found: u32,
        /// Checksum of its bytes.
        computed: u32,
    },
    /// The value ends before the bytes do.
    #[error("{count} bytes are left over after the value")]
    Trailing {
        /// Bytes left over.
        count: usize,
    },
    /// The payload is no such value.
    #[error("the payload cannot be read as the value expected: {cause}")]
    Malformed {
        /// What the decoder says.
        cause: String,
    },
    /// The value cannot be written.
    #[error("the value cannot be encoded: {cause}")]
    Unencodable {
        /// What the encoder says.
        cause: String,
    },
}

/// Encodes `value` into a frame of kind `kind`.
///
/// # Errors
/// [`CodecError::TooLong`], [`CodecError::Unencodable`].
///
/// ```
/// use inekf_shared::codec::{FRAME_ENTRY, FRAME_HEADER_LEN, FRAME_MAGIC, encode};
///
/// let frame = encode(FRAME_ENTRY, &0x0102_0304_u32)?;
/// assert!(frame.starts_with(&FRAME_MAGIC));
/// // Of fixed width, little-endian.
/// assert_eq!(frame[FRAME_HEADER_LEN..], [4, 3, 2, 1]);
/// # Ok::<(), inekf_shared::codec::CodecError>(())
/// ```
pub fn encode<T: Serialize>(kind: u32, value: &T) -> Result<Vec<u8>, CodecError> {
    let mut frame = vec![0; FRAME_HEADER_LEN];
    bincode::serde::encode_into_std_write(value, &mut frame, CONFIG).map_err(|error| {
        CodecError::Unencodable {
            cause: error.to_string(),
        }
    })?;
    // The encoder itself ignores the limit, and so many bytes fit into 32 bits.
    let len = frame.len() - FRAME_HEADER_LEN;
    if len > MAX_PAYLOAD_LEN {
        return Err(CodecError::TooLong { len });
    }
    frame[..8].copy_from_slice(&FRAME_MAGIC);
    frame[8..12].copy_from_slice(&FRAME_VERSION.to_le_bytes());
    frame[12..16].copy_from_slice(&kind.to_le_bytes());
    frame[16..20].copy_from_slice(&(len as u32).to_le_bytes());
    let checksum = checksum(&frame[8..20], &frame[FRAME_HEADER_LEN..]);
    frame[20..24].copy_from_slice(&checksum.to_le_bytes());
    Ok(frame)
}

/// Decodes a value from bytes that are exactly one frame of kind `kind`.
///
/// # Errors
/// [`CodecError::Trailing`] if bytes follow the frame, else as [`decode_prefix`].
///
/// ```
/// use inekf_shared::codec::{CodecError, FRAME_CHECKPOINT, FRAME_ENTRY, decode, encode};
///
/// let frame = encode(FRAME_CHECKPOINT, &[0.1_f64, f64::MIN_POSITIVE])?;
/// // Bit for bit.
/// assert_eq!(decode::<[f64; 2]>(FRAME_CHECKPOINT, &frame)?, [0.1, f64::MIN_POSITIVE]);
/// // A frame of another kind is not taken for one of this.
/// assert!(matches!(decode::<[f64; 2]>(FRAME_ENTRY, &frame), Err(CodecError::WrongKind { .. })));
/// # Ok::<(), CodecError>(())
/// ```
pub fn decode<T: DeserializeOwned>(kind: u32, bytes: &[u8]) -> Result<T, CodecError> {
    let (value, len) = decode_prefix(kind, bytes)?;
    match bytes.len() - len {
        0 => Ok(value),
        count => Err(CodecError::Trailing { count }),
    }
}

/// Decodes a value from the frame of kind `kind` that `bytes` begin with, and says how many bytes the frame has: for
/// files of many frames.
///
/// # Errors
/// A [`CodecError`] that names the cause.
///
/// ```
/// use inekf_shared::codec::{FRAME_ENTRY, decode_prefix, encode};
///
/// let mut file = encode(FRAME_ENTRY, &1_u8)?;
/// file.extend(encode(FRAME_ENTRY, &2_u8)?);
/// // A file of many frames, front to back.
/// let (first, len) = decode_prefix::<u8>(FRAME_ENTRY, &file)?;
/// let (second, _) = decode_prefix::<u8>(FRAME_ENTRY, &file[len..])?;
/// assert_eq!((first, second), (1, 2));
/// # Ok::<(), inekf_shared::codec::CodecError>(())
/// ```
pub fn decode_prefix<T: DeserializeOwned>(
    kind: u32,
    bytes: &[u8],
) -> Result<(T, usize), CodecError> {
    let (found, payload) = split(bytes)?;
    if found != kind {
        return Err(CodecError::WrongKind {
            found,
            expected: kind,
        });
    }
    let (value, read) = bincode::serde::decode_from_slice(payload, CONFIG).map_err(|error| {
        CodecError::Malformed {
            cause: error.to_string(),
        }
    })?;
    match payload.len() - read {
        0 => Ok((value, FRAME_HEADER_LEN + payload.len())),
        count => Err(CodecError::Trailing { count }),
    }
}

/// Kind of the frame that `bytes` begin with, once header and checksum have been found right.
///
/// # Errors
/// A [`CodecError`] that names the cause.
///
/// ```
/// use inekf_shared::codec::{CodecError, FRAME_ESTIMATE, encode, kind};
///
/// assert_eq!(kind(&encode(FRAME_ESTIMATE, &1_u8)?)?, FRAME_ESTIMATE);
/// assert_eq!(kind(b"t_ns,x,y,z"), Err(CodecError::WrongMagic));
/// # Ok::<(), CodecError>(())
/// ```
pub fn kind(bytes: &[u8]) -> Result<u32, CodecError> {
    Ok(split(bytes)?.0)
}

/// Checks header and checksum; returns kind and payload.
fn split(bytes: &[u8]) -> Result<(u32, &[u8]), CodecError> {
    let too_short = |needed| CodecError::TooShort {
        found: bytes.len(),
        needed,
    };
    // A foreign file is called foreign even if it is short.
    let magic_len = FRAME_MAGIC.len().min(bytes.len());
    if bytes[..magic_len] != FRAME_MAGIC[..magic_len] {
        return Err(CodecError::WrongMagic);
    }
    let Some((header, rest)) = bytes.split_first_chunk::<FRAME_HEADER_LEN>() else {
        return Err(too_short(FRAME_HEADER_LEN));
    };
    let word = |at: usize| {
        u32::from_le_bytes([header[at], header[at + 1], header[at + 2], header[at + 3]])
    };
    let version = word(8);
    if version != FRAME_VERSION {
        return Err(CodecError::WrongVersion { found: version });
    }
    let len = word(16) as usize;
    if len > MAX_PAYLOAD_LEN {
        return Err(CodecError::TooLong { len });
    }
    let Some(payload) = rest.get(..len) else {
        return Err(too_short(FRAME_HEADER_LEN + len));
    };
    let found = word(20);
    let computed = checksum(&header[8..20], payload);
    if found != computed {
        return Err(CodecError::Damaged { found, computed });
    }
    Ok((word(12), payload))
}

fn checksum(header: &[u8], payload: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(header);
    hasher.update(payload);
    hasher.finalize()
}
