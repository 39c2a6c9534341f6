//! The file of a recording: what is read is what was written, in its order, or less; never anything else.

use std::io::Cursor;

use inekf_client::recording::{Entry, Head, Item, RECORDING_VERSION, Reader, Writer};
use inekf_shared::message::{
    EstimateSe2, JOURNAL_CONTROL, JOURNAL_IMU, JournalEntry, MODEL_ODOMETRY_2D,
};

type Items = Vec<Item<EstimateSe2>>;

fn head() -> Head {
    Head {
        version: RECORDING_VERSION,
        model: MODEL_ODOMETRY_2D,
        instance: "car".to_owned(),
        began_unix_s: 1_700_000_000,
        config: "model = 'odometry2d'\n".to_owned(),
    }
}

/// A recording of a few frames: its items and its bytes.
fn recording() -> (Items, Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.rec");
    let mut writer = Writer::create(&path, &head()).unwrap();
    let mut items = Items::new();
    for index in 0..4 {
        let kind = [JOURNAL_IMU, JOURNAL_CONTROL][index as usize % 2];
        let message = vec![index as u8 + 1; 20 + 30 * index as usize];
        let entry = JournalEntry::new(index, 2 * index, kind, &message);
        writer.entry(&entry).unwrap();
        items.push(Item::Entry(Entry::of(&entry)));
        let mut estimate = EstimateSe2 {
            theta_rad: 0.1 * index as f64,
            ..EstimateSe2::default()
        };
        estimate.head.estimate_seq = index;
        writer.estimate(&estimate).unwrap();
        items.push(Item::Estimate(estimate));
    }
    writer.finish().unwrap();
    assert!(
        Writer::create(&path, &head()).is_err(),
        "nothing is overwritten"
    );
    (items, std::fs::read(&path).unwrap())
}

/// Everything that can be read, with the bytes left out in the middle and at the end.
fn read(bytes: &[u8]) -> Option<(Items, u64, u64)> {
    let mut reader = Reader::new(Cursor::new(bytes)).ok()?;
    assert_eq!(*reader.head(), head());
    let mut items = Vec::new();
    while let Some(item) = reader.next_item().unwrap() {
        items.push(item);
    }
    let damage = reader.damage();
    assert_eq!(damage.places == 0, damage.bytes == 0);
    Some((items, damage.bytes, damage.torn))
}

#[test]
fn what_was_written_is_read() {
    let (items, bytes) = recording();
    assert_eq!(read(&bytes), Some((items, 0, 0)));
}

#[test]
fn of_a_recording_cut_anywhere_the_whole_frames_are_read_and_the_rest_is_counted() {
    let (items, bytes) = recording();
    let mut before = None;
    for len in 0..bytes.len() {
        let Some((found, left_out, torn)) = read(&bytes[..len]) else {
            assert!(before.is_none(), "the head is there or not");
            continue;
        };
        assert!(items.starts_with(&found), "{len} bytes");
        assert_eq!(left_out, 0);
        let whole = len as u64 - torn;
        let grown = before.is_none_or(|(count, end)| found.len() >= count && whole >= end);
        assert!(grown, "{len} bytes");
        before = Some((found.len(), whole));
    }
    assert_eq!(before.map(|(count, _)| count), Some(items.len() - 1));
}

#[test]
fn a_flipped_bit_costs_the_frame_that_it_is_in_and_nothing_else() {
    let (items, mut bytes) = recording();
    let mut lost = 0;
    for at in 0..bytes.len() {
        let bit = 1 << (at % 8);
        bytes[at] ^= bit;
        if let Some((found, left_out, torn)) = read(&bytes) {
            assert_eq!(found.len(), items.len() - 1, "byte {at}");
            let mut rest = items.iter();
            assert!(
                found.iter().all(|item| rest.any(|other| other == item)),
                "byte {at}"
            );
            assert!(left_out + torn > 0);
            lost += 1;
        }
        bytes[at] ^= bit;
    }
    // But for the head, without which the rest means nothing.
    assert!(lost > bytes.len() * 3 / 4);
}

#[test]
fn bytes_that_are_none_of_it_are_left_out() {
    let (items, bytes) = recording();
    let (_, _, torn) = read(&bytes[..bytes.len() - 1]).unwrap();
    let last = bytes.len() - 1 - torn as usize;
    for strange in [&b"?"[..], b"INEKFRM", b"INEKFRM\0INEKFRM\0", &[0; 100_000]] {
        let between = [&bytes[..last], strange, &bytes[last..]].concat();
        assert_eq!(
            read(&between),
            Some((items.clone(), strange.len() as u64, 0))
        );
        let after = [&bytes[..], strange].concat();
        assert_eq!(read(&after), Some((items.clone(), 0, strange.len() as u64)));
        assert_eq!(read(strange), None);
    }
    // A frame that announces more than there is.
    let mut endless = bytes.clone();
    endless[last + 18] = 0x0f;
    let (found, left_out, torn) = read(&endless).unwrap();
    assert_eq!((found.len(), left_out), (items.len() - 1, 0));
    assert_eq!(torn as usize, bytes.len() - last);
}
