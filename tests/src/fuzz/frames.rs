//! Frames of the codec. The first byte chooses the type; what is decoded encodes to the same bytes again.

use inekf_shared::codec::{decode, decode_prefix, encode, kind};
use inekf_shared::message::{
    ControlRequest, ControlResponse, EstimateSe2, EstimateSe3, EstimateSe23, Health, ImuSample,
    PositionFix, SmoothedState, StateVector, Zero,
};
use serde::Serialize;
use serde::de::DeserializeOwned;

const KIND: u32 = 3;

macro_rules! types {
    ($($message:ty),+ $(,)?) => {
        const CHECKS: &[fn(&[u8])] = &[$(check::<$message>),+];

        /// A frame of every type.
        pub fn seeds() -> Vec<Vec<u8>> {
            let frames = [$(frame::<$message>()),+];
            let numbered = frames.into_iter().enumerate();
            numbered.map(|(index, frame)| [&[index as u8][..], &frame[..]].concat()).collect()
        }
    };
}

types![
    ImuSample,
    PositionFix,
    StateVector,
    EstimateSe23,
    EstimateSe3,
    EstimateSe2,
    Health,
    ControlRequest,
    ControlResponse,
    SmoothedState,
    // Lengths from outside: none is believed before there are as many bytes.
    Vec<u64>,
    String,
];

/// The target.
pub fn run(bytes: &[u8]) {
    let Some((choice, rest)) = bytes.split_first() else {
        return;
    };
    CHECKS[usize::from(*choice) % CHECKS.len()](rest);
    // The same with a checksum that is right: behind it, the payload is not to be trusted either.
    let mut mended = rest.to_vec();
    if mend(&mut mended).is_some() {
        CHECKS[usize::from(*choice) % CHECKS.len()](&mended);
    }
}

fn check<T: Serialize + DeserializeOwned>(bytes: &[u8]) {
    let whole = decode::<T>(KIND, bytes);
    if let Ok((value, len)) = decode_prefix::<T>(KIND, bytes) {
        assert_eq!(kind(bytes), Ok(KIND));
        assert_eq!(whole.is_ok(), len == bytes.len());
        let again = encode(KIND, &value).expect("what was decoded can be encoded");
        assert_eq!(again, &bytes[..len]);
    } else {
        assert!(whole.is_err());
    }
}

/// Writes the length and the checksum that the bytes ought to have into the header.
fn mend(bytes: &mut [u8]) -> Option<()> {
    let payload = u32::try_from(bytes.len().checked_sub(24)?).ok()?;
    bytes[16..20].copy_from_slice(&payload.to_le_bytes());
    let sum = crc32(&[&bytes[8..20], &bytes[24..]]);
    bytes[20..24].copy_from_slice(&sum.to_le_bytes());
    Some(())
}

/// CRC-32 (IEEE 802.3), bit by bit, written out here so as not to ask the code under test.
fn crc32(parts: &[&[u8]]) -> u32 {
    let mut sum = u32::MAX;
    for byte in parts.iter().copied().flatten() {
        sum ^= u32::from(*byte);
        for _ in 0..8 {
            sum = (sum >> 1) ^ (0xedb8_8320 & (sum & 1).wrapping_neg());
        }
    }
    !sum
}

fn frame<T: Serialize + Sample>() -> Vec<u8> {
    encode(KIND, &T::sample()).expect("it can be encoded")
}

/// A value to begin with.
trait Sample {
    fn sample() -> Self;
}

macro_rules! zero_samples {
    ($($message:ty),+ $(,)?) => {
        $(impl Sample for $message {
            fn sample() -> Self {
                Self::ZERO
            }
        })+
    };
}

zero_samples![
    ImuSample,
    PositionFix,
    StateVector,
    EstimateSe23,
    EstimateSe3,
    EstimateSe2,
    Health,
    ControlRequest,
    ControlResponse,
    SmoothedState,
];

impl Sample for Vec<u64> {
    fn sample() -> Self {
        vec![1, 2, 3]
    }
}

impl Sample for String {
    fn sample() -> Self {
        "text".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_checksum_is_that_of_the_standard() {
        // The check value of the catalogue of CRCs.
        assert_eq!(crc32(&[b"1234", b"56789"]), 0xcbf4_3926);
    }

    #[test]
    fn a_mended_frame_is_whole() {
        let mut bytes = frame::<ImuSample>();
        bytes[30] ^= 1;
        assert!(decode::<ImuSample>(KIND, &bytes).is_err());
        mend(&mut bytes).unwrap();
        assert!(decode::<ImuSample>(KIND, &bytes).is_ok());
    }
}
