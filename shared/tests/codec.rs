//! The codec: golden bytes, every message bit for bit, and bytes of any kind.

mod common;

use common::{from_bytes, to_bytes};
use inekf_shared::codec::*;
use inekf_shared::message::{Counters, Header, ImuSample, Message};
use proptest::prelude::*;
use proptest::test_runner::{RngAlgorithm, TestRng, TestRunner};
use serde::{Deserialize, Serialize};

/// Like a checkpoint: text, options, lengths.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Record {
    name: String,
    note: Option<u8>,
    values: Vec<f64>,
}

fn record() -> Record {
    Record {
        name: "car".to_owned(),
        note: Some(3),
        values: vec![1.0, -0.0],
    }
}

/// A runner whose cases are the same at every run.
fn seeded(cases: u32) -> TestRunner {
    let config = ProptestConfig {
        cases,
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    TestRunner::new_with_rng(config, TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]))
}

/// CRC-32 (IEEE 802.3), bit by bit from its definition.
fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for &byte in bytes {
        crc ^= u32::from(byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xedb8_8320 & (0u32.wrapping_sub(crc & 1)));
        }
    }
    !crc
}

/// The frame as the module's table describes it, built independently.
fn frame(version: u32, kind: u32, payload: &[u8]) -> Vec<u8> {
    let mut covered = Vec::new();
    covered.extend(version.to_le_bytes());
    covered.extend(kind.to_le_bytes());
    covered.extend((payload.len() as u32).to_le_bytes());
    let mut frame = b"INEKFRM\0".to_vec();
    frame.extend(&covered);
    covered.extend(payload);
    frame.extend(crc32(&covered).to_le_bytes());
    frame.extend(payload);
    frame
}

#[test]
fn golden_bytes() {
    assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
    let counters = Counters {
        accepted: 1,
        gated: 0x0203,
        late: 0,
        lost: u64::MAX,
        rejected: 4,
        unpaired: 5,
    };
    #[rustfmt::skip]
    let golden = [
        b'I', b'N', b'E', b'K', b'F', b'R', b'M', 0,
        1, 0, 0, 0,
        9, 0, 0, 0,
        48, 0, 0, 0,
        0x1f, 0xb2, 0xa9, 0xfb,
        1, 0, 0, 0, 0, 0, 0, 0,
        3, 2, 0, 0, 0, 0, 0, 0,
        0, 0, 0, 0, 0, 0, 0, 0,
        255, 255, 255, 255, 255, 255, 255, 255,
        4, 0, 0, 0, 0, 0, 0, 0,
        5, 0, 0, 0, 0, 0, 0, 0,
    ];
    assert_eq!(encode(9, &counters).unwrap(), golden);
    assert_eq!(decode::<Counters>(9, &golden).unwrap(), counters);
    assert_eq!(kind(&golden).unwrap(), 9);
    assert_eq!(frame(1, 9, &golden[24..]), golden);
}

#[test]
fn golden_bytes_of_text_and_lengths() {
    #[rustfmt::skip]
    let payload = [
        3, 0, 0, 0, 0, 0, 0, 0, b'c', b'a', b'r',
        1, 3,
        2, 0, 0, 0, 0, 0, 0, 0,
        0, 0, 0, 0, 0, 0, 0xf0, 0x3f,
        0, 0, 0, 0, 0, 0, 0, 0x80,
    ];
    assert_eq!(encode(2, &record()).unwrap(), frame(1, 2, &payload));
}

#[test]
fn every_message_comes_back_bit_for_bit() {
    fn check<M: Message>() {
        let bytes = proptest::collection::vec(any::<u8>(), size_of::<M>());
        seeded(64)
            .run(&bytes, |bytes| {
                let message: M = from_bytes(&bytes);
                let frame = encode(1, &message).unwrap();
                // On a little-endian host the payload is the memory itself.
                prop_assert_eq!(&frame[FRAME_HEADER_LEN..], &bytes[..]);
                let back: M = decode(1, &frame).unwrap();
                prop_assert_eq!(to_bytes(&back), &bytes[..]);
                Ok(())
            })
            .unwrap();
    }
    for_every_message!(check);
}

#[test]
fn special_floats_come_back_bit_for_bit() {
    let signalling_nan = f64::from_bits(0x7ff0_0000_0000_0001);
    let sample = ImuSample {
        header: Header::default(),
        gyro_rps: [f64::NAN, signalling_nan, -0.0],
        accel_mps2: [f64::INFINITY, f64::MIN_POSITIVE / 2.0, f64::MAX],
    };
    let back: ImuSample = decode(1, &encode(1, &sample).unwrap()).unwrap();
    assert_eq!(to_bytes(&back), to_bytes(&sample));
}

#[test]
fn every_fault_has_its_own_error() {
    let good = encode(5, &record()).unwrap();
    let decode_record = |bytes: &[u8]| decode::<Record>(5, bytes);
    assert_eq!(decode_record(&good).unwrap(), record());

    let too_short = |found, needed| Err(CodecError::TooShort { found, needed });
    assert_eq!(decode_record(&[]), too_short(0, 24));
    assert_eq!(decode_record(&good[..23]), too_short(23, 24));
    assert_eq!(
        decode_record(&good[..good.len() - 1]),
        too_short(good.len() - 1, good.len())
    );

    assert_eq!(
        decode_record(b"PK\x03\x04 another file"),
        Err(CodecError::WrongMagic)
    );
    assert_eq!(decode_record(b"x"), Err(CodecError::WrongMagic));
    assert_eq!(
        decode_record(&frame(2, 5, &good[24..])),
        Err(CodecError::WrongVersion { found: 2 })
    );
    assert_eq!(
        decode_record(&frame(1, 6, &good[24..])),
        Err(CodecError::WrongKind {
            found: 6,
            expected: 5
        })
    );

    let mut too_long = good.clone();
    too_long[16..20].copy_from_slice(&(16 * 1024 * 1024 + 1u32).to_le_bytes());
    assert_eq!(
        decode_record(&too_long),
        Err(CodecError::TooLong { len: 16_777_217 })
    );

    let mut damaged = good.clone();
    *damaged.last_mut().unwrap() ^= 1;
    assert!(matches!(
        decode_record(&damaged),
        Err(CodecError::Damaged { .. })
    ));

    let mut followed = good.clone();
    followed.extend([0, 0, 0]);
    assert_eq!(
        decode_record(&followed),
        Err(CodecError::Trailing { count: 3 })
    );
    assert_eq!(
        decode_prefix::<Record>(5, &followed).unwrap(),
        (record(), good.len())
    );
    let mut padded = good[24..].to_vec();
    padded.push(0);
    assert_eq!(
        decode_record(&frame(1, 5, &padded)),
        Err(CodecError::Trailing { count: 1 })
    );

    // Checksums right, contents not: no UTF-8, an option that is neither, a payload that ends early.
    let mut no_text = good[24..].to_vec();
    no_text[8] = 0xff;
    let mut no_option = good[24..].to_vec();
    no_option[11] = 2;
    for payload in [&no_text[..], &no_option[..], &good[24..40], &[]] {
        assert!(matches!(
            decode_record(&frame(1, 5, payload)),
            Err(CodecError::Malformed { .. })
        ));
    }
}

#[test]
fn a_length_no_memory_could_hold_is_refused_at_once() {
    for count in [u64::MAX, 1 << 40, MAX_PAYLOAD_LEN as u64] {
        let payload = frame(1, 1, &count.to_le_bytes());
        assert!(matches!(
            decode::<Vec<u64>>(1, &payload),
            Err(CodecError::Malformed { .. })
        ));
        assert!(matches!(
            decode::<String>(1, &payload),
            Err(CodecError::Malformed { .. })
        ));
    }
}

#[test]
fn a_payload_over_the_limit_is_not_written_and_one_at_the_limit_is() {
    // A vector of bytes is its length, 8 bytes, and itself.
    let fits = vec![1u8; MAX_PAYLOAD_LEN - 8];
    assert_eq!(decode::<Vec<u8>>(1, &encode(1, &fits).unwrap()), Ok(fits));
    let over = vec![1u8; MAX_PAYLOAD_LEN - 7];
    assert_eq!(
        encode(1, &over),
        Err(CodecError::TooLong {
            len: MAX_PAYLOAD_LEN + 1
        })
    );
}

#[test]
fn a_value_that_serde_cannot_size_is_an_error() {
    struct Refuses;
    impl Serialize for Refuses {
        fn serialize<S: serde::Serializer>(&self, _: S) -> Result<S::Ok, S::Error> {
            Err(serde::ser::Error::custom("never"))
        }
    }
    assert!(matches!(
        encode(1, &Refuses),
        Err(CodecError::Unencodable { .. })
    ));
}

#[test]
fn every_truncation_and_every_flipped_bit_is_found() {
    let good = encode(5, &record()).unwrap();
    for len in 0..good.len() {
        assert!(decode::<Record>(5, &good[..len]).is_err(), "{len}");
    }
    for bit in 0..8 * good.len() {
        let mut flipped = good.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert!(decode::<Record>(5, &flipped).is_err(), "bit {bit}");
    }
}

#[test]
fn any_bytes_decode_to_an_error_or_a_value_but_never_panic() {
    let bytes = proptest::collection::vec(any::<u8>(), 0..400);
    seeded(4000)
        .run(&bytes, |bytes| {
            // Raw; behind a right magic and version; and behind a whole right header, so that the payload decoder
            // is reached.
            prop_assert!(decode::<Record>(5, &bytes).is_err());
            let mut headed = b"INEKFRM\0\x01\0\0\0\x05\0\0\0".to_vec();
            headed.extend(&bytes);
            prop_assert!(decode::<Record>(5, &headed).is_err());
            let framed = frame(1, 5, &bytes);
            if let Ok(value) = decode::<Record>(5, &framed) {
                prop_assert_eq!(&encode(5, &value).unwrap(), &framed);
            }
            let is_imu = decode::<ImuSample>(5, &framed).is_ok();
            prop_assert_eq!(is_imu, bytes.len() == size_of::<ImuSample>());
            Ok(())
        })
        .unwrap();
}
