//! Layout and codes of the messages. Sizes and offsets are asserted at compile time beside each struct; here is what
//! those assertions cannot say.

mod common;

use std::collections::HashSet;

use common::{from_bytes, to_bytes};
use iceoryx2::prelude::ZeroCopySend;
use inekf_shared::message::*;

#[test]
fn the_type_name_on_the_wire_is_the_documented_one_and_carries_a_version() {
    fn check<M: Message>() {
        // SAFETY: the name is only compared.
        let on_the_wire = unsafe { <M as ZeroCopySend>::type_name() };
        assert_eq!(on_the_wire, M::TYPE_NAME);
        let (name, version) = M::TYPE_NAME.rsplit_once(".v").unwrap();
        assert!(name.starts_with("inekf."), "{name}");
        assert!(version.parse::<u32>().unwrap() >= 1);
    }
    for_every_message!(check);
}

#[test]
fn type_names_are_distinct() {
    let mut names = HashSet::new();
    macro_rules! collect {
        ($($message:ty),*) => { $(assert!(names.insert(<$message>::TYPE_NAME));)* };
    }
    collect!(
        Header,
        ImuSample,
        Odometry2d,
        Odometry3d,
        PositionFix,
        VelocityFix,
        HeadingFix,
        Counters,
        EstimateHead,
        EstimateSe23,
        EstimateSe3,
        EstimateSe2,
        Health,
        StateVector,
        ControlRequest,
        ControlResponse,
        SmoothedState,
        ProcessNoise,
        JournalEntry
    );
}

#[test]
fn the_default_is_all_zero_bytes() {
    fn check<M: Message + Default>() {
        assert!(to_bytes(&M::default()).iter().all(|&byte| byte == 0));
        assert!(to_bytes(&M::ZERO).iter().all(|&byte| byte == 0));
    }
    for_every_message!(check);
}

#[test]
fn fields_lie_where_another_language_would_read_them() {
    // Written by hand into the bytes, read through the struct.
    let mut bytes = [0u8; 80];
    bytes[0..8].copy_from_slice(&11u64.to_le_bytes());
    bytes[8..16].copy_from_slice(&12u64.to_le_bytes());
    bytes[16..24].copy_from_slice(&13u64.to_le_bytes());
    bytes[24..32].copy_from_slice(&14u64.to_le_bytes());
    for (index, value) in [0.1, 0.2, 0.3, 9.1, 9.2, 9.3f64].into_iter().enumerate() {
        bytes[32 + 8 * index..40 + 8 * index].copy_from_slice(&value.to_le_bytes());
    }
    let expected = ImuSample {
        header: Header {
            stamp_ns: 11,
            seq: 12,
            sent_ns: 13,
            epoch: 14,
        },
        gyro_rps: [0.1, 0.2, 0.3],
        accel_mps2: [9.1, 9.2, 9.3],
    };
    assert_eq!(from_bytes::<ImuSample>(&bytes), expected);
}

#[test]
fn the_triangle_is_numbered_row_by_row() {
    for dim in 0..=NAV_DIM {
        let mut next = 0;
        for row in 0..dim {
            for col in row..dim {
                assert_eq!(triangle_index(row, col, dim), Some(next));
                assert_eq!(triangle_index(col, row, dim), Some(next));
                next += 1;
            }
            assert_eq!(triangle_index(row, dim, dim), None);
            assert_eq!(triangle_index(dim, row, dim), None);
        }
        assert_eq!(triangle_index(usize::MAX, usize::MAX, dim), None);
        let entries = match dim {
            15 => NAV_TRI,
            9 => 45,
            6 => SE3_TRI,
            3 => SE2_TRI,
            _ => next,
        };
        assert_eq!(next, entries);
    }
}

#[test]
fn every_code_has_a_name_of_its_own_and_an_undefined_one_is_unknown() {
    type Family = (fn(u32) -> &'static str, &'static [u32]);
    let input: fn(u32) -> &'static str = |code| input_name(code as usize);
    let families: [Family; 9] = [
        (state_name, &[1, 2, 3, 4, 5, 6]),
        (waiting_for_name, &[0, 1, 2, 3, 4]),
        (reason_name, &[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]),
        (estimate_flag_name, &[1, 2, 4, 8, 16, 32, 64]),
        (model_name, &[1, 2, 3]),
        (control_kind_name, &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10]),
        (journal_kind_name, &[1, 2, 3, 4, 5, 6, 7, 8, 9]),
        (control_status_name, &[0, 1]),
        (input, &[0, 1, 2, 3, 4, 5]),
    ];
    for (name, defined) in families {
        let mut seen = HashSet::new();
        for code in 0..1000 {
            if defined.contains(&code) {
                assert_ne!(name(code), "unknown", "code {code}");
                assert!(seen.insert(name(code)), "{} twice", name(code));
            } else {
                assert_eq!(name(code), "unknown", "code {code}");
            }
        }
        assert_eq!(name(u32::MAX), "unknown");
    }
    assert!((REASON_NOT_READY as usize) < REASONS);
    assert_eq!(INPUT_HEADING + 1, INPUTS);
    assert_eq!(ESTIMATE_FLAGS, 127);
    assert_eq!(JOURNAL_HEADING as usize, INPUT_HEADING + 1);
}

#[test]
fn a_refusal_is_cut_at_a_character_and_read_back() {
    let mut response = ControlResponse::default();
    assert_eq!(response.reason(), "");
    for text in ["", "no", &"x".repeat(256)] {
        response.set_reason(text);
        assert_eq!(response.reason(), text);
    }
    // A shorter text leaves nothing of a longer one behind.
    response.set_reason("short");
    assert!(response.reason[5..].iter().all(|&byte| byte == 0));
    response.set_reason(&"x".repeat(300));
    assert_eq!(response.reason(), "x".repeat(256));
    // 85 characters of 3 bytes make 255; the 86th does not fit whole.
    response.set_reason(&"\u{20ac}".repeat(90));
    assert_eq!(response.reason(), "\u{20ac}".repeat(85));
}

#[test]
fn whatever_a_faulty_writer_leaves_a_refusal_is_text() {
    let mut response = ControlResponse {
        reason: [b'a'; REASON_TEXT_LEN],
        reason_len: u32::MAX,
        ..ControlResponse::default()
    };
    assert_eq!(response.reason(), "a".repeat(256));
    response.reason[3] = 0xff;
    assert_eq!(response.reason(), "aaa");
    response.reason[0] = 0x80;
    assert_eq!(response.reason(), "");
}

#[test]
fn the_text_of_a_configuration_comes_in_pages() {
    let text: String = (0..700)
        .map(|i| char::from(b'a' + (i % 26) as u8))
        .collect();
    let (mut response, mut read) = (ControlResponse::default(), Vec::new());
    for (offset, len) in [(0, 256), (256, 256), (512, 188), (700, 0), (9999, 0)] {
        response.set_page(&text, offset);
        assert_eq!((response.page().len(), response.config_len), (len, 700));
        read.extend_from_slice(response.page());
    }
    assert_eq!(read, text.as_bytes());
    response.reason_len = u32::MAX;
    assert_eq!(
        response.page().len(),
        256,
        "whatever a faulty writer leaves"
    );
}

#[test]
fn an_entry_of_the_journal_gives_back_the_message_it_was_made_of_and_no_other() {
    let mut fix = PositionFix::default();
    (fix.header.seq, fix.source, fix.position_w_m[2]) = (7, 3, -0.5);
    let entry = JournalEntry::new(5, 9, JOURNAL_POSITION, fix.as_bytes());
    assert_eq!(
        (entry.index, entry.estimates, entry.kind),
        (5, 9, JOURNAL_POSITION)
    );
    assert_eq!(entry.read::<PositionFix>(), Some(fix));
    assert_eq!(entry.read::<ImuSample>(), None);
    assert_eq!(entry.read::<ControlRequest>(), None);
    let faulty = JournalEntry {
        size: u32::MAX,
        ..entry
    };
    assert_eq!(faulty.message().len(), JOURNAL_PAYLOAD_LEN);
    let cut = JournalEntry::new(0, 0, JOURNAL_CONTROL, &[1; 2 * JOURNAL_PAYLOAD_LEN]);
    assert_eq!(cut.message(), [1; JOURNAL_PAYLOAD_LEN]);
}

#[test]
fn an_estimate_gives_its_head_and_its_model() {
    fn check<E: EstimateMessage>(model: u32) {
        let mut estimate = E::ZERO;
        *estimate.head_mut() = EstimateHead::UNSTARTED;
        estimate.head_mut().seq = 7;
        assert_eq!(estimate.head().seq, 7);
        assert_eq!(estimate.head().source, NO_SOURCE);
        assert!(estimate.head().nis.iter().all(|nis| nis.is_nan()));
        assert_eq!(E::MODEL, model);
    }
    check::<EstimateSe23>(MODEL_IMU);
    check::<EstimateSe3>(MODEL_ODOMETRY_3D);
    check::<EstimateSe2>(MODEL_ODOMETRY_2D);
}
